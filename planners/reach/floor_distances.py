"""Free floors as flat arrays: points inside and points near, compiled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from shapely.geometry import Polygon

from regionik.planners.driving.footprint import core_edges
from regionik.planners.geometry.polygons import nearest_on_segment
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index

ROWS = 256  # bands of the floor that edges are looked up by


class FloorParts(NamedTuple):
    """Edges of a floor by bands of y, as values for kernels; made by `parts_of`."""

    edges: Array  # (m, 4) both ends of every edge [m]
    first: Index  # (r + 1,) band k of the floor meets the edges ``listed[first[k]:first[k + 1]]``
    listed: Index  # (l,)
    bottom: float  # of the lowest band [m]
    height: float  # of each [m]


def parts_of(polygons: Sequence[Polygon]) -> FloorParts:
    """Prepare polygons that do not overlap, each with holes or without.

    Examples
    --------
    >>> from shapely import box
    >>> parts = parts_of([box(0, 0, 1, 1), box(2, 0, 3, 1)])
    >>> inside(parts, 0.5, 0.5), inside(parts, 1.5, 0.5)
    (True, False)
    """
    tables = [core_edges(polygon) for polygon in polygons]
    edges = np.concatenate([np.zeros((0, 4)), *tables])
    low, high = edges[:, 1::2].min(1), edges[:, 1::2].max(1)
    bottom = float(low.min(initial=0.0))
    height = max(float(high.max(initial=1.0)) - bottom, 1e-9) / ROWS
    begin, end = (np.clip(((y - bottom) / height).astype(np.int64), 0, ROWS - 1) for y in (low, high))
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *map(np.arange, begin, end + 1)])
    listed = np.repeat(np.arange(len(edges)), end - begin + 1)
    order = np.argsort(rows, kind="stable")
    first = np.searchsorted(rows[order], np.arange(ROWS + 1))
    return FloorParts(edges, first.astype(np.int64), listed[order].astype(np.int64), bottom, height)


@compiled
def _band(parts: FloorParts, y: float) -> int:
    return int(min(ROWS - 1, max(0.0, math.floor((y - parts.bottom) / parts.height))))


@compiled
def inside(parts: FloorParts, x: float, y: float) -> bool:
    """True where a place is on the floor."""
    odd = False
    k = _band(parts, y)
    for i in range(parts.first[k], parts.first[k + 1]):
        ax, ay, bx, by = parts.edges[parts.listed[i]]
        if (ay > y) != (by > y) and ((bx - ax) * (y - ay) > (x - ax) * (by - ay)) == (by > ay):
            odd = not odd
    return odd


@compiled
def is_near(parts: FloorParts, x: float, y: float, by: float) -> bool:
    """True where some place of the floor is at most ``by`` away [m]."""
    if inside(parts, x, y):
        return True
    for k in range(_band(parts, y - by), _band(parts, y + by) + 1):
        for i in range(parts.first[k], parts.first[k + 1]):
            ax, ay, bx, end = parts.edges[parts.listed[i]]
            if min(ax, bx) - x <= by and x - max(ax, bx) <= by:
                px, py = nearest_on_segment(ax, ay, bx, end, x, y)
                if np.hypot(px - x, py - y) <= by:
                    return True
    return False
