"""What an evaluation found, as plain data and as a table people read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.evaluation.counts import Counts
from pipeline.evaluation.detection import DetectionScores
from pipeline.evaluation.displacement import DisplacementScores
from pipeline.evaluation.identity import IdentityScores
from pipeline.evaluation.pointwise import PointwiseScores
from pipeline.evaluation.replaced import ReplacedScores
from pipeline.evaluation.units import UNIT_SIZE_M
from pipeline.result import ChangeLabel


@dataclass(frozen=True)
class Report:
    """Scores of one result against its ground truth.

    Attributes:
        radius_m: match radius that was used; ``UNIT_SIZE_M`` is the voxel of the evaluation units.
        overridden: whether labels other than the machine's were scored.
        detection: per visit and IoU threshold.
        identity: per pair of consecutive visits, per label.
        displacement: per pair of consecutive visits, of moved objects.
    """

    radius_m: float
    overridden: bool
    pointwise: PointwiseScores
    replaced: ReplacedScores
    detection: tuple[DetectionScores, ...]
    identity: tuple[dict[ChangeLabel, IdentityScores], ...]
    displacement: tuple[DisplacementScores, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain nested data for JSON; undefined ratios are None."""
        return {
            "unit_size_m": UNIT_SIZE_M,
            "match_radius_m": self.radius_m,
            "labels": "given" if self.overridden else "machine",
            "pointwise": self.pointwise.to_dict(),
            "replaced": self.replaced.to_dict(),
            "detection": [scores.to_dict() for scores in self.detection],
            "identity": [
                {label.name.lower(): scores.to_dict() for label, scores in pair.items()}
                for pair in self.identity
            ],
            "displacement": [scores.to_dict() for scores in self.displacement],
        }

    def table(self) -> str:
        """Text tables of fixed width; ``-`` where a number is not defined."""
        points = self.pointwise
        header = ("points", "TP", "FP", "FN", "P", "R", "F1")
        rows: list[tuple[str, Counts | None]] = [
            (label.name.lower(), counts) for label, counts in points.per_label.items()
        ]
        rows += [("appeared + disappeared", points.appeared_disappeared), ("micro, all labels", points.micro)]
        paper: list[tuple[str, Counts | None]] = [
            ("static", self.replaced.static),
            ("appeared/disappeared", self.replaced.appeared_disappeared),
            ("replaced", self.replaced.replaced),
            ("moved", self.replaced.moved),
            ("replaced events (pairs)", self.replaced.events),
        ]
        objects: list[tuple[str, Counts | None]] = [
            (f"visit {scores.session}, IoU >= {scores.threshold:g}", scores.counts)
            for scores in self.detection
        ]
        return "\n".join(
            [
                f"{points.scored} units of {UNIT_SIZE_M:g} m scored, {points.unscored} not scored, "
                f"match radius {self.radius_m:.3f} m, {'given' if self.overridden else 'machine'} labels",
                "",
                *_aligned([header, *(_row(*row) for row in rows)]),
                f"mean change F1 {_number(points.mean_change_f1)}   macro F1 {_number(points.macro_f1)}   "
                f"unknown {_share(points.unknown, points.scored)} "
                f"(of changed {_share(points.changed_unknown, points.changed)})   "
                f"missed {_share(points.missed, points.scored)}",
                "",
                *_aligned([("as in the paper", *header[1:]), *(_row(*row) for row in paper)]),
                "",
                *_aligned([("objects", *header[1:]), *(_row(*row) for row in objects)]),
                "",
                *_aligned(self._identity_rows()),
                *(self._displacement_line(pair) for pair in range(len(self.displacement))),
            ]
        )

    def _identity_rows(self) -> list[tuple[str, ...]]:
        rows: list[tuple[str, ...]] = [("identity", "kept", "of", "R", "right", "of", "P")]
        for pair, by_label in enumerate(self.identity):
            for label, scores in by_label.items():
                rows.append(
                    (
                        f"{label.name.lower()}, visit {pair} to {pair + 1}",
                        str(scores.kept),
                        str(scores.present),
                        _number(scores.recall),
                        str(scores.right),
                        str(scores.claimed),
                        _number(scores.precision),
                    )
                )
        return rows

    def _displacement_line(self, pair: int) -> str:
        scores = self.displacement[pair]
        return (
            f"displacement of {scores.compared} moved objects: mean error {_number(scores.mean_error_m)} m, "
            f"median {_number(scores.median_error_m)} m, largest {_number(scores.largest_error_m)} m"
        )


def _row(name: str, counts: Counts | None) -> tuple[str, ...]:
    if counts is None or not counts.occurs:
        return (name, "0", "0", "0", "-", "-", "-")
    return (
        name,
        str(counts.tp),
        str(counts.fp),
        str(counts.fn),
        _number(counts.precision),
        _number(counts.recall),
        _number(counts.f1),
    )


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    widths[0] = max(widths[0], 24)
    return [
        "  ".join(
            cell.ljust(width) if column == 0 else cell.rjust(max(width, 6))
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _share(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f} %" if whole else "-"
