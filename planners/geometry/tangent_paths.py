"""The shortest path in a polygon: bends at corners, straight lines that touch both of theirs.

A shortest path turns only at corners where the free area's inner angle is more than half a turn, and each of
its legs goes past both its corners without cutting off either: of all lines of sight only these tangents are
looked at. A path that is known already leaves fewer: nothing outside the ellipse that it spans is on a
shorter one.
Source: visibility graph reduced to tangents (de Berg et al., Computational Geometry, chapter 15).
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely.geometry import Polygon

from regionik.planners.geometry.polygons import FlatPolygon, Index, compiled, segment_inside
from regionik.worlds.arrays import Array

MOST_CORNERS = 2000  # beyond that many the lines between them are not looked at
GRAZE = 1e-9  # a neighbour this near to a line is on it [m]


def shorter_path(free: Polygon, start: Array, goal: Array, bound: float) -> Array | None:
    """The shortest path of all, where it is shorter than a bound.

    Parameters
    ----------
    free : Polygon
        [m]
    start, goal : (2,) array
        Different points of it.
    bound : float
        Length of a path that is known [m].

    Returns
    -------
    (k, 2) array or None
        Start, corners of the polygon, goal; None where no path is shorter than the bound, or more than
        `MOST_CORNERS` corners might be on one.

    Examples
    --------
    >>> room = shapely.box(0, 0, 3, 3) - shapely.box(1, 0, 2, 2)
    >>> shorter_path(room, np.array([0.5, 0.0]), np.array([2.5, 0.0]), 9.0).tolist()
    [[0.5, 0.0], [1.0, 2.0], [2.0, 2.0], [2.5, 0.0]]
    """
    whole = shapely.orient_polygons(free)
    corner, before, after = _corners(whole)
    near = np.hypot(*(corner - start).T) + np.hypot(*(corner - goal).T) < bound
    if np.count_nonzero(near) > MOST_CORNERS:
        return None
    ends = np.stack([start, goal])
    nodes, before, after = (np.vstack([ends, part[near]]) for part in (corner, before, after))
    flat = FlatPolygon.from_shapely(whole)
    i, j = _tangents(flat.vertices, flat.starts, nodes, before, after, bound)
    lengths = np.hypot(*(nodes[i] - nodes[j]).T)
    graph = csr_array((lengths, (i, j)), shape=(len(nodes), len(nodes)))
    far, came = dijkstra(graph, directed=False, indices=[0], return_predecessors=True, limit=bound)
    return nodes[_back(came[0])] if far[0, 1] < bound else None


def _back(came: NDArray[np.int32]) -> list[int]:
    """Nodes from the first to the second."""
    chain = [1]
    while chain[-1] != 0:
        chain.append(int(came[chain[-1]]))
    return chain[::-1]


def _corners(free: Polygon) -> tuple[Array, Array, Array]:
    """Corners where a path may bend, and their neighbours, of a polygon with its inside to the left."""
    flat = FlatPolygon.from_shapely(free)
    rings = np.split(flat.vertices, flat.starts[1:-1])
    before = np.concatenate([np.roll(ring, 1, axis=0) for ring in rings])
    after = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    into, out = flat.vertices - before, after - flat.vertices
    bends = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0] < 0.0
    return flat.vertices[bends], before[bends], after[bends]


@compiled
def _past(at: Array, before: Array, after: Array, x: float, y: float) -> bool:
    """Whether the line through a corner in a direction keeps both neighbours on one side."""
    one = x * (before[1] - at[1]) - y * (before[0] - at[0])
    other = x * (after[1] - at[1]) - y * (after[0] - at[0])
    return bool(min(one, other) >= -GRAZE or max(one, other) <= GRAZE)


@compiled
def _tangents(
    vertices: Array, starts: Index, nodes: Array, before: Array, after: Array, bound: float
) -> tuple[Index, Index]:
    """Pairs of nodes that see each other along a tangent and may lie on a path shorter than a bound.

    The first two nodes are start and goal, which have no neighbours to keep on one side.
    """
    n = len(nodes)
    from_start, to_goal = np.empty(n), np.empty(n)
    for k in range(n):
        from_start[k] = np.hypot(nodes[k, 0] - nodes[0, 0], nodes[k, 1] - nodes[0, 1])
        to_goal[k] = np.hypot(nodes[k, 0] - nodes[1, 0], nodes[k, 1] - nodes[1, 1])
    first, second = np.empty(n * (n - 1) // 2, np.int64), np.empty(n * (n - 1) // 2, np.int64)
    count = 0
    for i in range(n):
        for j in range(i + 1, n):
            x, y = nodes[j, 0] - nodes[i, 0], nodes[j, 1] - nodes[i, 1]
            length = np.hypot(x, y)
            if length + min(from_start[i] + to_goal[j], from_start[j] + to_goal[i]) >= bound or length == 0.0:
                continue
            x, y = x / length, y / length
            if i > 1 and not _past(nodes[i], before[i], after[i], x, y):
                continue
            if j > 1 and not _past(nodes[j], before[j], after[j], x, y):
                continue
            if segment_inside(vertices, starts, nodes[i, 0], nodes[i, 1], nodes[j, 0], nodes[j, 1]):
                first[count], second[count] = i, j
                count += 1
    return first[:count], second[:count]
