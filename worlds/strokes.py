"""Strokes of a path: stretches that the tool works in one go, and the travel between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regionik.worlds.arrays import Array

Strokes = NDArray[np.int64]
Mask = NDArray[np.bool_]

TRAVEL = 0  # number of points on the way from one stroke to another


def numbered_strokes(works: Mask) -> Strokes:
    """Return the stroke of each of n points, from 1, of a path that is worked on some of its n - 1 segments.

    >>> numbered_strokes(np.array([True, True, False, False, True])).tolist()
    [1, 1, 1, 0, 2, 2]
    """
    before, after = np.append(False, works), np.append(works, False)
    begins = after & ~before
    return np.where(before | after, np.cumsum(begins), TRAVEL)


def worked(strokes: Strokes) -> Mask:
    """Return the segments between n points on which the tool works, (n - 1,).

    >>> worked(np.array([1, 1, 1, 0, 2, 2])).tolist()
    [True, True, False, False, True]
    """
    return (strokes[1:] == strokes[:-1]) & (strokes[1:] != TRAVEL)


def travel(points: Array, strokes: Strokes) -> tuple[int, float]:
    """Return how many ways lead from one stroke to another, and their length in all [m]."""
    idle = ~worked(strokes)
    ways = int((idle & ~np.append(False, idle[:-1])).sum())
    return ways, float(np.linalg.norm(np.diff(points, axis=0), axis=1)[idle].sum())
