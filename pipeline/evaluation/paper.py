"""The tables of the OASIS-Map paper: change per point, detection per visit, association between the visits.

Changes are the four exclusive classes static, appeared/disappeared, replaced and moved; micro pools their
counts, macro is the mean F1 of those that occur. Detection matches true and predicted objects of a visit one
to one; the paper names no overlap, so two are given. Over several pairs, its Car Park numbers are consistent
only with means of the pairs' own F1, its 3RScan numbers with a single scene.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pipeline.evaluation.association import AssociationScores, association_scores
from pipeline.evaluation.counts import Counts, mean_defined, pooled
from pipeline.evaluation.detection import DetectionScores, all_detection_scores
from pipeline.evaluation.matched import Matched
from pipeline.evaluation.replaced import ReplacedScores, replaced_scores
from pipeline.evaluation.report import association_rows
from pipeline.evaluation.tables import COUNT_HEADER, aligned, count_row, number


@dataclass(frozen=True)
class PaperScores:
    """The paper's three tables for one pair of visits."""

    change: ReplacedScores
    detection: tuple[DetectionScores, ...]
    association: dict[str, AssociationScores]

    @property
    def classes(self) -> dict[str, Counts]:
        """The four exclusive classes of the first table."""
        names = ("static", "appeared_disappeared", "replaced", "moved")
        return {name: getattr(self.change, name) for name in names}

    @property
    def macro_f1(self) -> float | None:
        """Mean F1 of the classes that occur."""
        return mean_defined(counts.f1 for counts in self.classes.values())

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "change": {
                **self.change.to_dict(),
                "micro": pooled(self.classes.values()).to_dict(),
                "macro_f1": self.macro_f1,
            },
            "detection": [scores.to_dict() for scores in self.detection],
            "association": {state: scores.to_dict() for state, scores in self.association.items()},
        }

    def lines(self) -> list[str]:
        """The tables."""
        changes = [
            *(count_row(name.replace("_", "/"), counts) for name, counts in self.classes.items()),
            count_row("micro", pooled(self.classes.values())),
        ]
        objects = [
            count_row(f"visit {scores.session}, IoU >= {scores.threshold:g}", scores.counts)
            for scores in self.detection
        ]
        return [
            *aligned([("points", *COUNT_HEADER), *changes]),
            f"macro F1 {number(self.macro_f1)}",
            "",
            *aligned([("objects", *COUNT_HEADER), *objects]),
            "",
            *aligned(association_rows((self.association,))),
        ]


def paper_scores(matched: Matched) -> PaperScores:
    """Score a result of two visits."""
    before, after = matched.overlaps[:2]
    return PaperScores(
        change=replaced_scores(matched.units, matched.result.replaced),
        detection=all_detection_scores(matched.overlaps, matched.predicted_counts),
        association=association_scores(matched.units, before, after, (0, 1), matched.labels),
    )
