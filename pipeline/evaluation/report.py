"""What an evaluation found, as plain data and as a table people read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pipeline.evaluation.abstention import AbstentionScores
from pipeline.evaluation.association import AssociationScores
from pipeline.evaluation.background import BackgroundScores
from pipeline.evaluation.calibration import CalibrationScores
from pipeline.evaluation.detection import DetectionScores
from pipeline.evaluation.displacement import DisplacementScores
from pipeline.evaluation.identity import IdentityScores
from pipeline.evaluation.pointwise import PointwiseScores
from pipeline.evaluation.replaced import ReplacedScores
from pipeline.evaluation.rotation import RotationScores
from pipeline.evaluation.tables import COUNT_HEADER, aligned, count_row, number, percent
from pipeline.evaluation.units import UNIT_SIZE_M
from pipeline.evaluation.verdicts import Verdicts
from pipeline.result import ChangeLabel

_TABLE_COVERAGES = (0.5, 0.8, 0.9, 1.0)


@dataclass(frozen=True)
class Report:
    """Scores of one result against its ground truth.

    Attributes:
        radius_m: match radius that was used; ``UNIT_SIZE_M`` is the voxel of the evaluation units.
        overridden: whether labels other than the machine's were scored.
        detection: per visit and IoU threshold.
        identity, association: per pair of consecutive visits, per label or state.
        displacement, rotation: per pair of consecutive visits, of moved objects.
        verdicts: what calibration and abstention were counted over, for pooling.
    """

    radius_m: float
    overridden: bool
    pointwise: PointwiseScores
    replaced: ReplacedScores
    detection: tuple[DetectionScores, ...]
    identity: tuple[dict[ChangeLabel, IdentityScores], ...]
    association: tuple[dict[str, AssociationScores], ...]
    displacement: tuple[DisplacementScores, ...]
    rotation: tuple[RotationScores, ...]
    background: BackgroundScores
    verdicts: Verdicts
    calibration: CalibrationScores
    abstention: AbstentionScores

    def to_dict(self) -> dict[str, Any]:
        """Plain nested data for JSON; undefined ratios are None."""
        return {
            "unit_size_m": UNIT_SIZE_M,
            "match_radius_m": self.radius_m,
            "labels": "given" if self.overridden else "machine",
            "pointwise": self.pointwise.to_dict(),
            "replaced": self.replaced.to_dict(),
            "background": self.background.to_dict(),
            "detection": [scores.to_dict() for scores in self.detection],
            "identity": [
                {label.name.lower(): scores.to_dict() for label, scores in pair.items()}
                for pair in self.identity
            ],
            "association": [
                {state: scores.to_dict() for state, scores in pair.items()} for pair in self.association
            ],
            "displacement": [scores.to_dict() for scores in self.displacement],
            "rotation": [scores.to_dict() for scores in self.rotation],
            "calibration": self.calibration.to_dict(),
            "abstention": self.abstention.to_dict(),
        }

    def table(self) -> str:
        """Text tables of fixed width; ``-`` where a number is not defined."""
        points, background = self.pointwise, self.background
        rows = [
            *((label.name.lower(), counts) for label, counts in points.per_label.items()),
            ("appeared + disappeared", points.appeared_disappeared),
            ("micro, all labels", points.micro),
        ]
        paper = [
            ("static", self.replaced.static),
            ("appeared/disappeared", self.replaced.appeared_disappeared),
            ("replaced", self.replaced.replaced),
            ("moved", self.replaced.moved),
            ("replaced events (pairs)", self.replaced.events),
        ]
        objects = [
            (f"visit {scores.session}, IoU >= {scores.threshold:g}", scores.counts)
            for scores in self.detection
        ]
        return "\n".join(
            [
                f"{points.scored} units of {UNIT_SIZE_M:g} m scored, {points.unscored} not scored, "
                f"match radius {self.radius_m:.3f} m, {'given' if self.overridden else 'machine'} labels",
                "",
                *aligned([("points", *COUNT_HEADER), *(count_row(*row) for row in rows)]),
                f"mean change F1 {number(points.mean_change_f1)}   macro F1 {number(points.macro_f1)}   "
                f"unknown {percent(points.unknown, points.scored)} "
                f"(of changed {percent(points.changed_unknown, points.changed)})   "
                f"missed {percent(points.missed, points.scored)}",
                f"background: {background.changed} of {background.true_units} units called changed "
                f"({percent(background.changed, background.true_units)}), "
                f"{sum(background.map_points)} of {sum(background.all_map_points)} map points",
                "",
                *aligned([("as in the paper", *COUNT_HEADER), *(count_row(*row) for row in paper)]),
                "",
                *aligned([("objects", *COUNT_HEADER), *(count_row(*row) for row in objects)]),
                "",
                *aligned(self._identity_rows()),
                "",
                *aligned(association_rows(self.association)),
                *(self._motion_line(pair) for pair in range(len(self.displacement))),
                "",
                *self._confidence_lines(),
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
                        number(scores.recall),
                        str(scores.right),
                        str(scores.claimed),
                        number(scores.precision),
                    )
                )
        return rows

    def _motion_line(self, pair: int) -> str:
        moved, turned = self.displacement[pair], self.rotation[pair]
        return (
            f"displacement of {moved.compared} moved objects: mean error {number(moved.mean_error_m)} m, "
            f"median {number(moved.median_error_m)} m, largest {number(moved.largest_error_m)} m; "
            f"at the true centroid ({moved.centroid_compared}): mean "
            f"{number(moved.mean_centroid_error_m)} m\n"
            f"rotation of {turned.compared} of {turned.known}: mean error "
            f"{number(turned.mean_error_deg, 1)} deg, largest {number(turned.largest_error_deg, 1)} deg"
        )

    def _confidence_lines(self) -> list[str]:
        scores, abstention = self.calibration, self.abstention
        precisions = ", ".join(
            f"{number(abstention.precision_at(share))} at {100 * share:.0f} %" for share in _TABLE_COVERAGES
        )
        return [
            f"confidence of {scores.objects} decided objects: ECE {number(scores.ece)}, Brier "
            f"{number(scores.brier)}; the least certain 20 % hold "
            f"{number(scores.errors_in_least_certain)} of {scores.errors} errors",
            f"abstention: precision {precisions} coverage; area under risk-coverage "
            f"{number(abstention.area_under_risk_coverage)}; {abstention.unknown} objects left unknown, "
            f"{abstention.unknown_changed} of them truly changed",
        ]


def association_rows(association: tuple[dict[str, AssociationScores], ...]) -> list[tuple[str, ...]]:
    """Rows of the paper's association table, header first."""
    rows: list[tuple[str, ...]] = [("association", "N_gt", "found", "right", "of", "P", "R", "F1")]
    for pair, by_state in enumerate(association):
        for state, scores in by_state.items():
            rows.append(
                (
                    f"{state}, visit {pair} to {pair + 1}",
                    str(scores.true_count),
                    str(scores.found),
                    str(scores.right),
                    str(scores.claimed),
                    *map(number, (scores.precision, scores.recall, scores.f1)),
                )
            )
    return rows
