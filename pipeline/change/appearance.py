"""How differently the surface of one visit looks in the other, once the light is accounted for.

A lamp that moved or a sun that turned changes the colour of everything by a gain and by a smooth function
of the surface normal; what is left over is the surface itself. Fitted robustly, so that changed things do
not bend the fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAX_FITTED_VOXELS = 40_000
FIT_ROUNDS = 10
MIN_SCALE = 0.03
_RIDGE = 1e-3
MIN_COMPARED_VOXELS = 8


@dataclass(frozen=True)
class AppearanceResidual:
    """Colour change per voxel after the fit.

    Attributes:
        is_compared: (M,) both visits' colours are known.
        residual: (M, 3) log RGB difference, other visit minus own; zeros where not compared.
        scale: robust spread of the residual of the pair of visits (log units): the noise of appearance here.
        log_gain: (3,) log RGB of the other visit's light over the own visit's.
    """

    is_compared: NDArray[np.bool_]
    residual: NDArray[np.float32]
    scale: float
    log_gain: NDArray[np.float64]


def appearance_residual(
    own_log_colours: NDArray[np.float32],
    other_log_colours: NDArray[np.float32],
    is_compared: NDArray[np.bool_],
    normals_world: NDArray[np.float32],
) -> AppearanceResidual:
    """Fit gain per channel and second-order shading (Ramamoorthi and Hanrahan, 2001) and take them out.

    Args:
        own_log_colours, other_log_colours: (M, 3) log RGB of the two visits.
        is_compared: (M,) voxels where both are known.
        normals_world: (M, 3).
    """
    difference = np.where(is_compared[:, None], other_log_colours - own_log_colours, 0).astype(np.float32)
    compared = np.flatnonzero(is_compared)
    if len(compared) < MIN_COMPARED_VOXELS:
        return AppearanceResidual(is_compared, difference, MIN_SCALE, np.zeros(3))
    sample = compared[:: max(1, len(compared) // MAX_FITTED_VOXELS)]
    basis = _shading_basis(normals_world[sample].astype(np.float64))
    target = difference[sample].astype(np.float64)
    gain = np.median(target, axis=0)
    shading = np.zeros(basis.shape[1])
    weights, scale = np.ones(len(sample)), MIN_SCALE
    for _ in range(FIT_ROUNDS):
        weighted = basis * weights[:, None]
        normal_matrix = weighted.T @ basis + _RIDGE * len(sample) * np.eye(basis.shape[1])
        shading = np.linalg.solve(normal_matrix, weighted.T @ (target - gain).mean(axis=1))
        unshaded = target - (basis @ shading)[:, None]
        gain = weights @ unshaded / weights.sum()
        error = np.linalg.norm(unshaded - gain, axis=1)
        scale = max(1.48 * float(np.median(error)), MIN_SCALE)
        weights = 1.0 / (1.0 + (error / scale) ** 2) ** 2
    residual = np.zeros_like(difference)
    shade = _shading_basis(normals_world[compared].astype(np.float64)) @ shading
    residual[compared] = difference[compared] - gain - shade[:, None]
    return AppearanceResidual(is_compared, residual, scale, gain)


def _shading_basis(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = normals.T
    return np.stack([x, y, z, x * y, y * z, x * z, z * z - 1 / 3, x * x - y * y], axis=1)
