"""Masks as COCO writes them: run lengths down the columns, packed into text.

Format: https://github.com/cocodataset/cocoapi (common/maskApi.c, rleToString). The first run counts
zeros. From the third run on, the difference to the run two before is written instead, which is small
where neighbouring columns look alike. Numbers go into characters '0'..'o', five bits each, lowest first;
bit 5 says that more follow, and the last group's bit 4 is the sign.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def run_lengths(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Lengths of the runs of a (h, w) mask read column by column, zeros first; they sum to h * w."""
    flat = np.asarray(mask, bool).ravel(order="F")
    edges = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    runs = np.diff(np.concatenate([[0], edges, [flat.size]]))
    return np.concatenate([[0], runs]) if flat.size and flat[0] else runs


def packed(runs: NDArray[np.int64]) -> str:
    """Run lengths as COCO's text (``counts`` of a segmentation)."""
    values = np.asarray(runs, np.int64).copy()
    values[3:] -= np.asarray(runs, np.int64)[1:-2]
    text = bytearray()
    for value in values.tolist():
        more = True
        while more:
            group = value & 0x1F
            value >>= 5
            more = value != (-1 if group & 0x10 else 0)
            text.append(48 + (group | 0x20 if more else group))
    return text.decode("ascii")
