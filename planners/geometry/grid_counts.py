"""Counts of the rings that each cell of a grid lies in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from regionik.worlds.arrays import Array, Mask


def count_rings(centers: Array, spans: Sequence[Array], x: Array, y: Array, free: Mask) -> NDArray[np.int32]:
    """Count, for each free cell, the centers that are as far off as one of their spans says, (ny, nx).

    Parameters
    ----------
    centers : (n, 2) array [m]
    spans : sequence of n arrays (k, 2)
        Least and largest distances [m].
    x, y : (nx,), (ny,) array
        Middles of the cells [m].
    free : (ny, nx) array of bool
    """
    count = np.zeros(free.shape, dtype=np.int32)
    for (cx, cy), own in zip(centers, spans, strict=False):
        far = own[:, 1].max(initial=0.0)
        rows, columns = np.flatnonzero(np.abs(y - cy) <= far), np.flatnonzero(np.abs(x - cx) <= far)
        off = np.hypot(x[columns] - cx, y[rows, None] - cy)[..., None]
        count[np.ix_(rows, columns)] += ((own[:, 0] <= off) & (off <= own[:, 1])).any(axis=-1)
    count[~free] = 0
    return count
