"""Counts of the rings that each cell of a grid lies in."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index, Mask


@compiled
def count_rings(
    centers: Array,
    starts: Index,
    spans: Array,
    x: Array,
    y: Array,
    free: Mask,
    count: NDArray[np.int32],
) -> None:
    """Add to each free cell one for every center that is as far off as one of its spans says.

    Parameters
    ----------
    centers : (n, 2) array [m]
    starts : (n + 1,) array of int
        Center i has the spans from ``starts[i]`` to ``starts[i + 1]``.
    spans : (m, 2) array
        Least and largest distance [m].
    x, y : (nx,), (ny,) array
        Middles of the cells, evenly spaced [m].
    free : (ny, nx) array of bool
    count : (ny, nx) array of int
        Added to in place.
    """
    cell = x[1] - x[0] if len(x) > 1 else (y[1] - y[0] if len(y) > 1 else 1.0)
    for i in range(len(centers)):
        far = 0.0
        for s in range(starts[i], starts[i + 1]):
            far = max(far, spans[s, 1])
        cx, cy = centers[i]
        left = max(0, math.ceil((cx - far - x[0]) / cell) - 1)
        right = min(len(x), math.floor((cx + far - x[0]) / cell) + 2)
        low = max(0, math.ceil((cy - far - y[0]) / cell) - 1)
        high = min(len(y), math.floor((cy + far - y[0]) / cell) + 2)
        for row in range(low, high):
            for column in range(left, right):
                if free[row, column]:
                    off = np.hypot(x[column] - cx, y[row] - cy)
                    for s in range(starts[i], starts[i + 1]):
                        if spans[s, 0] <= off <= spans[s, 1]:
                            count[row, column] += 1
                            break
