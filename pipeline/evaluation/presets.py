"""Evaluations by the name of the publication that defines them, each stating what it counted with.

``paper`` (OASIS-Map), ``khronos``, ``livingscenes`` and ``scenediff``. Definitions, and where they differ
from what was published, stand in the module of each.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from pipeline.errors import InputError
from pipeline.evaluation import khronos, livingscenes, paper, scenediff
from pipeline.evaluation.ground_truth import read_ground_truth
from pipeline.evaluation.matched import Matched, match
from pipeline.evaluation.overlap import MIN_SHARE
from pipeline.evaluation.replaced import MIN_SHARED_BOUNDS
from pipeline.evaluation.units import UNIT_SIZE_M
from pipeline.result import ChangeLabel


class PresetScores(Protocol):
    """What a preset counts."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""

    def lines(self) -> list[str]:
        """A table as text."""


@dataclass(frozen=True)
class Preset:
    """A named evaluation.

    Attributes:
        defined_by: the publication.
        thresholds: by name, with units in the names.
        score: counts a matched result.
    """

    name: str
    defined_by: str
    thresholds: Mapping[str, float | int | bool | str]
    score: Callable[[Matched], PresetScores]


@dataclass(frozen=True)
class PresetReport:
    """Scores of a preset and what they were counted with.

    Attributes:
        parameters: voxel size, match radius and every threshold.
    """

    preset: Preset
    parameters: Mapping[str, float | int | bool | str]
    scores: PresetScores

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "preset": self.preset.name,
            "defined_by": self.preset.defined_by,
            "parameters": dict(self.parameters),
            **self.scores.to_dict(),
        }

    def table(self) -> str:
        """Text of fixed width; ``-`` where a number is not defined."""
        stated = ", ".join(f"{name} {value}" for name, value in self.parameters.items())
        return "\n".join(
            [f"preset {self.preset.name}: {self.preset.defined_by}", stated, "", *self.scores.lines()]
        )


PRESETS = {
    preset.name: preset
    for preset in (
        Preset(
            "paper",
            "OASIS-Map; it states neither voxel, radius nor overlap, so these are this program's own",
            {
                "detection_iou": "0.25 and 0.5",
                "majority_share": MIN_SHARE,
                "replaced_shared_bounds": MIN_SHARED_BOUNDS,
            },
            paper.paper_scores,
        ),
        Preset(
            "khronos",
            "Khronos (RSS 2024), surface votes in both directions, end of the current visit",
            {
                "max_matching_distance_m": khronos.MATCHING_DISTANCE_M,
                "vertex_step": 1,
                "match_require_semantics": False,
                "compensate_missegmentation": False,
            },
            khronos.khronos_scores,
        ),
        Preset(
            "livingscenes",
            "LivingScenes (CVPR 2024) on 3RScan",
            {
                "dynamic_rotation_deg": livingscenes.DYNAMIC_ROTATION_DEG,
                "dynamic_translation_m": livingscenes.DYNAMIC_TRANSLATION_M,
                "registered_m": livingscenes.REGISTERED_M,
                "registered_deg": livingscenes.REGISTERED_DEG,
                "majority_share": MIN_SHARE,
            },
            livingscenes.livingscenes_scores,
        ),
        Preset(
            "scenediff",
            "SceneDiff (ECCV 2026), 2D average precision of changed objects",
            {
                "mask_iou": scenediff.MIN_IOU,
                "duplicates": 1,
                "average_precision": "VOC, all points",
                "mask_stride_px": scenediff.MASK_STRIDE,
                "min_mask_px": scenediff.MIN_MASK_PX,
            },
            scenediff.scenediff_scores,
        ),
    )
}


def evaluate_preset(
    name: str,
    result_path: Path | str,
    ground_truth: Path | str,
    radius_m: float | None = None,
    labels: Mapping[int, ChangeLabel] | None = None,
) -> PresetReport:
    """Score a result folder by a named preset; arguments as in ``evaluator.evaluate``.

    Raises:
        ResultError: the result cannot be opened.
        InputError: there is no such preset, or the ground truth does not fit.
    """
    if name not in PRESETS:
        raise InputError(f"there is no preset {name!r}", f"choose one of {', '.join(PRESETS)}")
    from pipeline.store import open_result

    result = open_result(Path(result_path))
    return preset_report(name, match(result, read_ground_truth(ground_truth), radius_m, labels))


def preset_report(name: str, matched: Matched) -> PresetReport:
    """A preset's scores of a result that is matched already."""
    preset = PRESETS[name]
    parameters = {
        "voxel_m": UNIT_SIZE_M,
        "match_radius_m": round(matched.radius_m, 4),
        "labels": "given" if matched.overridden else "machine",
        **preset.thresholds,
    }
    return PresetReport(preset, parameters, preset.score(matched))
