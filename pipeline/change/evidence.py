"""What speaks for and against a change, per object: coverage, seen-through share, appearance.

Coverage is nu of the paper (Sec. III-C.3): the fraction of an object's volume that the other visit observed,
measured on the object's voxels; a voxel counts once it was hit or seen through, never when occluded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.change.appearance import MIN_COMPARED_VOXELS, AppearanceResidual
from pipeline.change.prints import PrintSupport
from pipeline.correspondence.pattern import PatternAgreement
from pipeline.mapping.colours import within_faces

# Residuals beyond this many spreads of the pair of visits, and beyond this, belong to another surface.
TAIL_SPREADS = 3.0
TAIL_RESIDUAL = 0.4
# Columns of the stored table.
_TABLE = (
    "voxel_count",
    "coverage",
    "seen_through",
    "compared_count",
    "median_residual",
    "tail_share",
    "texture",
    "texture_correlation",
    "dissimilarity",
    "pattern_pixels",
    "pattern_correlation",
    "print_here",
    "print_elsewhere",
)


@dataclass(frozen=True)
class ObjectEvidence:
    """Evidence per instance of one visit; arrays are (K + 1,), entry 0 is background.

    Attributes:
        voxel_count: voxels met so far.
        coverage: nu, in [0, 1].
        seen_through: share of the observed voxels that are empty in the other visit.
        compared_count: voxels of which both visits know the colour.
        median_residual: median colour residual (log units); 0 where not compared.
        tail_share: share of compared voxels whose residual no lighting explains.
        texture: spread of the object's own log brightness within its faces.
        texture_correlation: of its brightness pattern in the two visits, within faces; 1 where not compared.
        centroid_world: (K + 1, 3) metres.
        dissimilarity: how unlike the object's patches are to those at the same place in the other visit, on
            the scale of the semantic heatmap (log odds); NaN where no keyframe compared it.
        pattern_pixels: pixels of all compared keyframes that show a pattern on the object.
        pattern_correlation: mean local correlation of the pattern in the two visits; NaN without pixels.
        print_here: places of its print that the other visit shows where they were (``Prints``).
        print_elsewhere: places of its print that the other visit shows somewhere else.
    """

    voxel_count: NDArray[np.int64]
    coverage: NDArray[np.float64]
    seen_through: NDArray[np.float64]
    compared_count: NDArray[np.int64]
    median_residual: NDArray[np.float64]
    tail_share: NDArray[np.float64]
    texture: NDArray[np.float64]
    texture_correlation: NDArray[np.float64]
    centroid_world: NDArray[np.float64]
    dissimilarity: NDArray[np.float64]
    pattern_pixels: NDArray[np.float64]
    pattern_correlation: NDArray[np.float64]
    print_here: NDArray[np.float64]
    print_elsewhere: NDArray[np.float64]

    @classmethod
    def from_table(cls, rows: NDArray[np.void]) -> ObjectEvidence:
        """What ``table`` gave, with a background entry put before it; centroids are not in it (NaN)."""
        padded = np.zeros(len(rows) + 1, rows.dtype)
        padded[1:] = rows
        columns: dict[str, Any] = {name: padded[name].astype(float) for name in _TABLE}
        for name in ("voxel_count", "compared_count"):
            columns[name] = columns[name].astype(np.int64)
        return cls(**columns, centroid_world=np.full((len(padded), 3), np.nan))

    def table(self, **scores: NDArray[np.float64]) -> NDArray[np.void]:
        """(K,) one row per instance (background left out): what thresholds and weights apply to.

        Args:
            scores: further columns, (K + 1,) each.
        """
        columns = {name: getattr(self, name) for name in _TABLE} | scores
        rows = np.zeros(len(self.coverage) - 1, [(name, np.float32) for name in columns])
        for name, values in columns.items():
            rows[name] = values[1:]
        return rows


def object_evidence(
    instance_of_voxel: NDArray[np.int32],
    count: int,
    is_met: NDArray[np.bool_],
    is_observed: NDArray[np.bool_],
    is_seen_through: NDArray[np.bool_],
    appearance: AppearanceResidual,
    own_log_colours: NDArray[np.float32],
    normals_world: NDArray[np.float32],
    points_world: NDArray[np.float32],
    dissimilarity: NDArray[np.float64],
    pattern: PatternAgreement,
    prints: PrintSupport,
) -> ObjectEvidence:
    """Gather the evidence of all instances.

    Args:
        instance_of_voxel: (M,) instance of each voxel, 0 = background.
        count: K.
        is_met: (M,) the voxel has been mapped already (all of them for a finished visit) and is no noise.
        is_observed, is_seen_through: (M,) by the other visit.
        appearance: colour residual against the other visit.
        own_log_colours, normals_world, points_world: (M, 3) of the surface.
        dissimilarity: (K + 1,) from the compared keyframes.
        pattern: how alike the compared keyframes' pixels are.
        prints: where its print was found again.
    """
    size = count + 1
    owner = np.where(is_met, instance_of_voxel, 0)
    voxel_count = np.bincount(owner, is_met, size).astype(np.int64)
    observed = np.bincount(owner, is_observed & is_met, size)
    through = np.bincount(owner, is_seen_through & is_observed & is_met, size)
    sums = np.stack([np.bincount(owner, points_world[:, axis], size) for axis in range(3)], axis=1)
    centroid = sums.astype(np.float64) / np.maximum(np.bincount(owner, minlength=size), 1)[:, None]

    median = np.zeros(size)
    tail = np.zeros(size)
    texture = np.zeros(size)
    correlation = np.ones(size)
    compared = np.flatnonzero((owner > 0) & appearance.is_compared & ~is_seen_through)
    compared = compared[np.argsort(owner[compared], kind="stable")]
    starts = np.searchsorted(owner[compared], np.arange(size + 1))
    magnitude = np.linalg.norm(appearance.residual, axis=1)
    tail_from = max(TAIL_RESIDUAL, TAIL_SPREADS * appearance.scale)
    for instance in range(1, size):
        voxels = compared[starts[instance] : starts[instance + 1]]
        if len(voxels) < MIN_COMPARED_VOXELS:
            continue
        median[instance] = np.median(magnitude[voxels])
        tail[instance] = (magnitude[voxels] > tail_from).mean()
        own = own_log_colours[voxels].mean(axis=1).astype(np.float64)
        other = own + appearance.residual[voxels].mean(axis=1)
        own, other = within_faces(own, normals_world[voxels]), within_faces(other, normals_world[voxels])
        texture[instance] = own.std()
        correlation[instance] = own @ other / np.sqrt((own @ own) * (other @ other) + 1e-9)
    return ObjectEvidence(
        voxel_count=voxel_count,
        coverage=observed / np.maximum(voxel_count, 1),
        seen_through=through / np.maximum(observed, 1),
        compared_count=np.diff(starts),
        median_residual=median,
        tail_share=tail,
        texture=texture,
        texture_correlation=correlation,
        centroid_world=centroid,
        dissimilarity=dissimilarity,
        pattern_pixels=pattern.weight.copy(),  # goes on growing
        pattern_correlation=pattern.mean_correlation,
        print_here=prints.here,
        print_elsewhere=prints.elsewhere,
    )
