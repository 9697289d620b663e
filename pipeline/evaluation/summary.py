"""Many evaluated pairs in one table, micro and macro.

Micro pools the counts of all pairs; macro is the mean of the pairs' own ratios, over those pairs in
which they are defined. The paper's Car Park numbers are only consistent with macro means, its 3RScan
numbers with a single scene.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.evaluation.abstention import AbstentionScores, abstention_scores
from pipeline.evaluation.calibration import CalibrationScores, calibration_scores
from pipeline.evaluation.counts import Counts, mean_defined, pooled
from pipeline.evaluation.identity import PERSISTENT
from pipeline.evaluation.report import Report
from pipeline.evaluation.tables import markdown, number
from pipeline.evaluation.verdicts import pooled_verdicts
from pipeline.result import ChangeLabel

_CLASSES: dict[str, Callable[[Report], Counts]] = {
    "static": lambda report: report.pointwise.per_label[ChangeLabel.STATIC],
    "appeared": lambda report: report.pointwise.per_label[ChangeLabel.APPEARED],
    "disappeared": lambda report: report.pointwise.per_label[ChangeLabel.DISAPPEARED],
    "moved": lambda report: report.pointwise.per_label[ChangeLabel.MOVED],
    "appeared + disappeared": lambda report: report.pointwise.appeared_disappeared,
    "paper: static": lambda report: report.replaced.static,
    "paper: appeared/disappeared": lambda report: report.replaced.appeared_disappeared,
    "paper: replaced": lambda report: report.replaced.replaced,
    "paper: moved": lambda report: report.replaced.moved,
    "replaced events": lambda report: report.replaced.events,
}
PAIR_COLUMNS: dict[str, Callable[[Report], float | None]] = {
    "change F1": lambda report: report.pointwise.mean_change_f1,
    "static": lambda report: report.pointwise.per_label[ChangeLabel.STATIC].f1,
    "app.": lambda report: report.pointwise.per_label[ChangeLabel.APPEARED].f1,
    "dis.": lambda report: report.pointwise.per_label[ChangeLabel.DISAPPEARED].f1,
    "moved": lambda report: report.pointwise.per_label[ChangeLabel.MOVED].f1,
    "repl.": lambda report: report.replaced.replaced.f1,
    "unknown": lambda report: _share(report.pointwise.unknown, report.pointwise.scored),
    "missed": lambda report: _share(report.pointwise.missed, report.pointwise.scored),
    "det. R@.25": lambda report: _detection(report, 0.25).recall,
    "det. P@.25": lambda report: _detection(report, 0.25).precision,
    "det. R@.5": lambda report: _detection(report, 0.5).recall,
    "id static R": lambda report: _identity_recall(report, ChangeLabel.STATIC),
    "id moved R": lambda report: _identity_recall(report, ChangeLabel.MOVED),
    "id distinct R": lambda report: _identity_distinct(report, PERSISTENT),
    "id P": lambda report: _identity_precision(report, PERSISTENT),
    "displ. err m": lambda report: mean_defined(item.mean_error_m for item in report.displacement),
    "rot. err deg": lambda report: mean_defined(item.mean_error_deg for item in report.rotation),
    "ECE": lambda report: report.calibration.ece,
}


@dataclass(frozen=True)
class Summary:
    """Reports of several pairs by name, in the order in which they are shown."""

    reports: Mapping[str, Report]

    def to_dict(self) -> dict[str, Any]:
        """Every pair's report, and micro and macro of every class."""
        return {
            "pairs": {name: report.to_dict() for name, report in self.reports.items()},
            "micro": {name: self.micro(name).to_dict() for name in _CLASSES},
            "macro": {name: self.macro(name) for name in _CLASSES},
            "macro_columns": {
                name: mean_defined(column(report) for report in self.reports.values())
                for name, column in PAIR_COLUMNS.items()
            },
            "calibration": self.calibration().to_dict(),
            "abstention": self.abstention().to_dict(),
        }

    def micro(self, name: str) -> Counts:
        """Counts of a class pooled over all pairs."""
        return pooled(_CLASSES[name](report) for report in self.reports.values())

    def macro(self, name: str) -> dict[str, float | None]:
        """Mean precision, recall and F1 of a class over the pairs that define them."""
        counts = [_CLASSES[name](report) for report in self.reports.values()]
        return {
            "precision": mean_defined(item.precision for item in counts),
            "recall": mean_defined(item.recall for item in counts),
            "f1": mean_defined(item.f1 for item in counts),
        }

    def calibration(self) -> CalibrationScores:
        """Calibration over the objects of all pairs."""
        return calibration_scores(pooled_verdicts([report.verdicts for report in self.reports.values()]))

    def abstention(self) -> AbstentionScores:
        """Abstention over the objects of all pairs."""
        return abstention_scores(pooled_verdicts([report.verdicts for report in self.reports.values()]))

    def mean(self, column: str) -> float | None:
        """Mean of one of ``PAIR_COLUMNS`` over the pairs that define it."""
        return mean_defined(PAIR_COLUMNS[column](report) for report in self.reports.values())

    def worst(self, column: str) -> float | None:
        """Smallest value of one of ``PAIR_COLUMNS`` over the pairs that define it."""
        values = (PAIR_COLUMNS[column](report) for report in self.reports.values())
        return min((value for value in values if value is not None), default=None)

    def pair_table(self) -> str:
        """Markdown: one row per pair, the mean below."""
        rows = [
            [name, *(number(column(report)) for column in PAIR_COLUMNS.values())]
            for name, report in self.reports.items()
        ]
        means = [
            mean_defined(column(report) for report in self.reports.values())
            for column in PAIR_COLUMNS.values()
        ]
        rows.append(["**mean**", *(f"**{number(mean)}**" for mean in means)])
        return markdown(["pair", *PAIR_COLUMNS], rows)

    def class_table(self) -> str:
        """Markdown: one row per class with pooled counts, micro ratios and macro ratios."""
        rows = []
        for name in _CLASSES:
            micro, macro = self.micro(name), self.macro(name)
            rows.append(
                [
                    name,
                    *map(str, (micro.tp, micro.fp, micro.fn)),
                    *map(number, (micro.precision, micro.recall, micro.f1)),
                    *map(number, macro.values()),
                ]
            )
        return markdown(
            ["class", "TP", "FP", "FN", "P", "R", "F1", "macro P", "macro R", "macro F1"],
            rows,
        )


def _detection(report: Report, threshold: float) -> Counts:
    return pooled(scores.counts for scores in report.detection if scores.threshold == threshold)


def _identity_recall(report: Report, label: ChangeLabel) -> float | None:
    scores = [pair[label] for pair in report.identity]
    return _share(sum(item.kept for item in scores), sum(item.present for item in scores))


def _identity_distinct(report: Report, labels: tuple[ChangeLabel, ...]) -> float | None:
    scores = [pair[label] for pair in report.identity for label in labels]
    return _share(sum(item.distinct for item in scores), sum(item.present for item in scores))


def _identity_precision(report: Report, labels: tuple[ChangeLabel, ...]) -> float | None:
    scores = [pair[label] for pair in report.identity for label in labels]
    return _share(sum(item.right for item in scores), sum(item.claimed for item in scores))


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None
