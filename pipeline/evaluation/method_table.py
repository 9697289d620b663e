"""Methods over scenes and seeds in one table: mean, worst seed and runtime per kind of scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.evaluation.counts import mean_defined
from pipeline.evaluation.report import Report
from pipeline.evaluation.summary import PAIR_COLUMNS, Summary
from pipeline.evaluation.tables import markdown, number

CHANGE_F1 = "change F1"
ALL_SCENES = "all"


@dataclass(frozen=True, order=True)
class Trial:
    """One method on one generated pair."""

    method: str
    scene: str
    seed: int

    def __str__(self) -> str:
        return f"{self.method} {self.scene} {self.seed}"


@dataclass(frozen=True)
class Outcome:
    """What a trial gave, and how long the method took, in seconds."""

    report: Report
    seconds: float


@dataclass(frozen=True)
class MethodTable:
    """Outcomes of all trials, in the order in which they are shown."""

    outcomes: Mapping[Trial, Outcome]

    @property
    def methods(self) -> tuple[str, ...]:
        """Methods in the order in which they first appear."""
        return tuple(dict.fromkeys(trial.method for trial in self.outcomes))

    @property
    def scenes(self) -> tuple[str, ...]:
        """Kinds of scenes in the order in which they first appear."""
        return tuple(dict.fromkeys(trial.scene for trial in self.outcomes))

    def summary(self, method: str, scene: str = ALL_SCENES) -> Summary:
        """Reports of one method, of one kind of scene or of all."""
        return Summary(
            {
                f"{trial.scene} {trial.seed}": outcome.report
                for trial, outcome in self.outcomes.items()
                if trial.method == method and scene in (ALL_SCENES, trial.scene)
            }
        )

    def mean_seconds(self, method: str, scene: str = ALL_SCENES) -> float | None:
        """Mean runtime of a pair."""
        return mean_defined(
            outcome.seconds
            for trial, outcome in self.outcomes.items()
            if trial.method == method and scene in (ALL_SCENES, trial.scene)
        )

    def to_dict(self) -> dict[str, Any]:
        """Every trial's report, and means and worst seeds per method and kind of scene."""
        return {
            "trials": [
                {**vars(trial), "seconds": outcome.seconds, "report": outcome.report.to_dict()}
                for trial, outcome in self.outcomes.items()
            ],
            "means": {
                method: {scene: self._row(method, scene) for scene in (*self.scenes, ALL_SCENES)}
                for method in self.methods
            },
            "classes": {method: self.summary(method).to_dict()["micro"] for method in self.methods},
            "calibration": {method: self.summary(method).calibration().to_dict() for method in self.methods},
            "abstention": {method: self.summary(method).abstention().to_dict() for method in self.methods},
        }

    def text(self) -> str:
        """Markdown: scenes x methods, then each method's confidence over all its objects."""
        header = ["scene", "method", CHANGE_F1, "worst seed", *list(PAIR_COLUMNS)[1:], "s a pair"]
        rows = []
        for scene in (*self.scenes, ALL_SCENES):
            for method in self.methods:
                row = self._row(method, scene)
                if row["pairs"]:
                    means = (row["mean"][name] for name in PAIR_COLUMNS)
                    first, *rest = (number(value) for value in means)
                    worst = number(row["worst"][CHANGE_F1])
                    rows.append([scene, method, first, worst, *rest, number(row["seconds"], 1)])
        lines = [markdown(header, rows), ""]
        for method in self.methods:
            calibration = self.summary(method).calibration()
            abstention = self.summary(method).abstention()
            lines.append(
                f"{method}: ECE {number(calibration.ece)} over {calibration.objects} decided objects of all "
                f"pairs, the least certain 20 % hold {number(calibration.errors_in_least_certain)} of "
                f"{calibration.errors} errors, {abstention.unknown} objects left unknown, area under "
                f"risk-coverage {number(abstention.area_under_risk_coverage)}"
            )
        return "\n".join(lines)

    def _row(self, method: str, scene: str) -> dict[str, Any]:
        summary = self.summary(method, scene)
        return {
            "pairs": len(summary.reports),
            "mean": {name: summary.mean(name) for name in PAIR_COLUMNS},
            "worst": {name: summary.worst(name) for name in PAIR_COLUMNS},
            "seconds": self.mean_seconds(method, scene),
        }
