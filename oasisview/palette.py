"""Colours of labels: told apart by every kind of colour vision, on a light and on a dark ground.

Both sets were searched for the greatest smallest difference (CIEDE2000) between any two under normal,
protan, deutan and tritan vision, with a contrast of at least 3.1 to the ground.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.result import ChangeLabel

LIGHT: dict[ChangeLabel, str] = {
    ChangeLabel.UNKNOWN: "#58595b",
    ChangeLabel.STATIC: "#1e9c85",
    ChangeLabel.APPEARED: "#9d3225",
    ChangeLabel.DISAPPEARED: "#222f77",
    ChangeLabel.MOVED: "#c47514",
}
DARK: dict[ChangeLabel, str] = {
    ChangeLabel.UNKNOWN: "#757b8a",
    ChangeLabel.STATIC: "#019868",
    ChangeLabel.APPEARED: "#ed2712",
    ChangeLabel.DISAPPEARED: "#94cbeb",
    ChangeLabel.MOVED: "#f2db83",
}
REPLACED_LIGHT, REPLACED_DARK = "#8e03fb", "#b05fef"


def label_table(palette: dict[ChangeLabel, str]) -> NDArray[np.uint8]:
    """(5, 3) RGB with one row per label code."""
    return np.array(
        [[int(palette[label][i : i + 2], 16) for i in (1, 3, 5)] for label in ChangeLabel], dtype=np.uint8
    )
