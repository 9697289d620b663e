"""Figures of what ``evaluate_methods.py --json`` measured.

    python benchmarks/plot_methods.py all.json FOLDER

``change_f1.png``: mean change F1 of each method on each kind of scene, a mark at the worst seed.
``confidence.png``: reliability (share right over confidence) and abstention (precision over coverage).
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")  # before pyplot: no screen is needed
import matplotlib.pyplot as plt

# Okabe and Ito: told apart also without full colour vision.
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9", "#F0E442", "#000000")


def main() -> None:
    """Read the measurements and draw them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("measured", type=Path, metavar="FILE")
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    arguments = parser.parse_args()
    for path in draw(json.loads(arguments.measured.read_text()), arguments.folder):
        print(path)


def draw(measured: dict[str, Any], folder: Path) -> list[Path]:
    """Draw both figures into a folder; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / "change_f1.png", folder / "confidence.png"]
    for path, figure in zip(paths, (_change_f1(measured), _confidence(measured)), strict=True):
        figure.savefig(path, dpi=150)
        plt.close(figure)
    return paths


def _change_f1(measured: dict[str, Any]) -> plt.Figure:
    means = measured["means"]
    scenes = list(next(iter(means.values()), {}))
    figure, axes = plt.subplots(figsize=(1.6 * len(scenes) + 2, 4), layout="constrained")
    width = 0.8 / max(1, len(means))
    for number, (method, by_scene) in enumerate(means.items()):
        places = np.arange(len(scenes)) + (number - (len(means) - 1) / 2) * width
        heights, worst = (
            [by_scene[scene][kind]["change F1"] or 0.0 for scene in scenes] for kind in ("mean", "worst")
        )
        axes.bar(places, heights, 0.92 * width, label=method, color=COLOURS[number % len(COLOURS)])
        axes.scatter(places, worst, marker="_", s=180, color="black", zorder=3)
    axes.set_xticks(np.arange(len(scenes)), scenes)
    axes.set(ylim=(0, 1), ylabel="change F1 (mean; line: worst seed)")
    axes.grid(axis="y", alpha=0.3)
    axes.legend(frameon=False, ncols=2)
    return figure


def _confidence(measured: dict[str, Any]) -> plt.Figure:
    figure, (reliability, abstention) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    reliability.plot([0, 1], [0, 1], color="grey", linewidth=1, linestyle=":")
    for number, method in enumerate(measured["means"]):
        colour = COLOURS[number % len(COLOURS)]
        bins = measured["calibration"][method]["bins"]
        reliability.plot(
            [item["mean_confidence"] for item in bins],
            [item["accuracy"] for item in bins],
            marker="o",
            color=colour,
            label=f"{method}, ECE {measured['calibration'][method]['ece'] or 0:.3f}",
        )
        curve = measured["abstention"][method]["curve"]
        abstention.plot(
            [point["coverage"] for point in curve],
            [point["precision"] for point in curve],
            color=colour,
            label=method,
        )
    reliability.set(xlim=(0, 1), ylim=(0, 1.02), xlabel="confidence", ylabel="share right")
    abstention.set(
        xlim=(0, 1.02), ylim=(0, 1.02), xlabel="coverage", ylabel="precision of the decided objects"
    )
    for axes in (reliability, abstention):
        axes.grid(alpha=0.3)
        axes.legend(frameon=False)
    return figure


if __name__ == "__main__":
    main()
