"""Shortest paths in polygons.

They are searched in the visibility graph reduced to tangents (de Berg et al., Computational Geometry, chapter
15): a shortest path turns only at corners where the free area's inner angle is more than half a turn, and its
legs pass their corners without cutting off either. A line of sight is looked at when A* comes to it.
"""

from __future__ import annotations

from heapq import heappop, heappush

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.geometry.polygons import FlatPolygon, segment_inside
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index

_GRAZE = 1e-9  # a neighbour this near to a line is on it [m]


def shortest_path(free: Polygon | MultiPolygon, start: Array, goal: Array) -> Array | None:
    """Find the shortest path of all between two points of an area.

    Parameters
    ----------
    free : Polygon or MultiPolygon [m]
    start, goal : (2,) array
        Different points of it [m].

    Returns
    -------
    (k, 2) array or None
        Start, corners of the area, goal; None where they are in parts that do not join.

    Examples
    --------
    >>> room = shapely.box(0, 0, 3, 3) - shapely.box(1, 0, 2, 2)
    >>> shortest_path(room, np.array([0.5, 0.0]), np.array([2.5, 0.0])).tolist()
    [[0.5, 0.0], [1.0, 2.0], [2.0, 2.0], [2.5, 0.0]]
    """
    flat = FlatPolygon.from_shapely(shapely.orient_polygons(free))
    ends = np.stack([start, goal])
    nodes, before, after = (np.vstack([ends, part]) for part in _corners(flat))
    came = _search(flat.vertices, flat.starts, nodes, before, after)
    if came[1] < 0:
        return None
    chain = [1]
    while chain[-1] != 0:
        chain.append(int(came[chain[-1]]))
    return nodes[chain[::-1]]


def _corners(flat: FlatPolygon) -> tuple[Array, Array, Array]:
    """Corners where a path may bend, and their neighbours, of polygons with their inside to the left."""
    rings = np.split(flat.vertices, flat.starts[1:-1])
    before = np.concatenate([np.roll(ring, 1, axis=0) for ring in rings])
    after = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    into, out = flat.vertices - before, after - flat.vertices
    bends = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0] < 0.0
    return flat.vertices[bends], before[bends], after[bends]


@compiled
def _is_tangent(at: Array, before: Array, after: Array, x: float, y: float) -> bool:
    """True if the line through a corner in a direction touches it: both neighbours lie on one side."""
    one = x * (before[1] - at[1]) - y * (before[0] - at[0])
    other = x * (after[1] - at[1]) - y * (after[0] - at[0])
    return bool(min(one, other) >= -_GRAZE or max(one, other) <= _GRAZE)


@compiled
def _search(vertices: Array, starts: Index, nodes: Array, before: Array, after: Array) -> Index:
    """The node before each node on the shortest path to it, -1 where none is known; A*.

    The first two nodes are start and goal, which have no neighbours to keep on one side.
    """
    n = len(nodes)
    came, way, left = np.full(n, -1, np.int64), np.zeros(n), np.empty(n)
    for k in range(n):
        left[k] = np.hypot(nodes[k, 0] - nodes[1, 0], nodes[k, 1] - nodes[1, 1])
    heap = [(left[0], 0, 0)]
    while len(heap) > 0:
        _, i, j = heappop(heap)
        if came[j] >= 0:
            continue
        if i != j and not segment_inside(
            vertices, starts, nodes[i, 0], nodes[i, 1], nodes[j, 0], nodes[j, 1]
        ):
            continue
        came[j] = i
        way[j] = way[i] + np.hypot(nodes[j, 0] - nodes[i, 0], nodes[j, 1] - nodes[i, 1])
        if j == 1:
            break
        for k in range(n):
            x, y = nodes[k, 0] - nodes[j, 0], nodes[k, 1] - nodes[j, 1]
            length = np.hypot(x, y)
            if came[k] >= 0 or length == 0.0:
                continue
            x, y = x / length, y / length
            if j > 1 and not _is_tangent(nodes[j], before[j], after[j], x, y):
                continue
            if k > 1 and not _is_tangent(nodes[k], before[k], after[k], x, y):
                continue
            heappush(heap, (way[j] + length + left[k], j, k))
    return came
