"""Shortest paths in polygons: pulled out of a known path like a string, and the shortest of all.

String pulling runs the funnel algorithm (Lee and Preparata, 1984) through the sleeve of triangles that a path
passes. The shortest path of all is found in the visibility graph reduced to tangents (de Berg et al.,
Computational Geometry, chapter 15): it turns only at corners where the free area's inner angle is more than
half a turn, and its legs pass their corners without cutting off either. A path that is known leaves fewer
lines to look at: nothing outside the ellipse that it spans is on a shorter one.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.geometry.polygons import DEPTH, FlatPolygon, segment_inside
from regionik.planners.geometry.triangulation import (
    Triangulation,
    gap_to,
    link_round,
    locate,
    passed,
    search_through,
    triangulate,
)
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index, frozen
from regionik.worlds.errors import InputError

ON_IT = 1e-11  # a point this near to a triangle is in it, too [m]
TOUCH = 1e-8  # triangles this near to a point of the path meet there [m]
MOST_CORNERS = 2000  # beyond that many the lines between them are not looked at
GRAZE = 1e-9  # a neighbour this near to a line is on it [m]


def tighten(free: Polygon | MultiPolygon, points: ArrayLike) -> Array:
    """Pull a path tight like a string, ends held, without leaving ``free``.

    Parameters
    ----------
    free : Polygon or MultiPolygon [m]
    points : (k, 2) array_like
        The path; every leg inside ``free`` to 1e-9 m.

    Returns
    -------
    (m, 2) array
        Start, polygon vertices round which the string bends, goal; never longer than the input.

    Raises
    ------
    InputError
        When a leg leaves ``free``.

    Notes
    -----
    Exact in the path's homotopy class. Where two parts of ``free`` meet in one point only, the string stays
    held at that point.

    Examples
    --------
    >>> from shapely import box
    >>> room = box(0, 0, 3, 3) - box(1, 0, 2, 2)
    >>> tighten(room, [[0.5, 0], [0.2, 2.9], [2.7, 2.5], [2.5, 0]]).tolist()
    [[0.5, 0.0], [1.0, 2.0], [2.0, 2.0], [2.5, 0.0]]
    """
    path = frozen(points, (None, 2), "path")
    flat = FlatPolygon.from_shapely(free)
    for k in range(len(path) - 1):
        if not segment_inside(flat.vertices, flat.starts, *path[k], *path[k + 1]):
            raise InputError(f"path: leg {k} from {path[k]} to {path[k + 1]} leaves the free area")
    if len(path) < 2:
        return path
    mesh = triangulate(free)
    pulled = [path[:1]]
    for start, sleeve, end in _find_sleeves(mesh, path):
        pulled.append(_pull(mesh, start, sleeve, end)[1:])
    return frozen(np.concatenate(pulled), (None, 2), "path")


def route(free: Polygon | MultiPolygon, start: ArrayLike, goal: ArrayLike) -> Array | None:
    """Find a short path through the triangles of ``free``, pulled tight; None when no triangles lead there.

    Complete: where start and goal lie in one part of the area, it finds a path. The sleeve is the best by the
    middles of the edges it passes, so the path is often but not always the shortest of all.
    """
    a, b = frozen(start, (2,), "start"), frozen(goal, (2,), "goal")
    mesh = triangulate(free)
    first, last = (int(locate(mesh.vertices, mesh.corners, *p)) for p in (a, b))
    sleeve = search_through(mesh, a, first, last)
    return None if sleeve is None else frozen(_pull(mesh, a, sleeve, b), (None, 2), "path")


def _find_sleeves(mesh: Triangulation, path: Array) -> Iterator[tuple[Array, list[int], Array]]:
    """Sleeves of triangles that the path passes, without detours, from one held point to the next."""
    start, sleeve = path[0], list[int]()
    for triangle, here, radius in _triangles_along(mesh, path):
        link = link_round(mesh, sleeve[-1], triangle, here, radius) if sleeve else [triangle]
        if link is None:
            yield start, sleeve, here
            start, sleeve, link = here, [], [triangle]
        for t in link:
            if len(sleeve) > 1 and sleeve[-2] == t:
                sleeve.pop()
            elif not sleeve or sleeve[-1] != t:
                sleeve.append(t)
    yield start, sleeve, path[-1]


def _triangles_along(mesh: Triangulation, path: Array) -> Iterator[tuple[int, Array, float]]:
    """Triangles in turn, with the point where the path enters each and how far it may lie from there."""
    for a, b in zip(path[:-1], path[1:], strict=True):
        length = float(np.hypot(*(b - a)))
        if length <= DEPTH:
            yield int(locate(mesh.vertices, mesh.corners, *b)), b, TOUCH
            continue
        triangles, spans = passed(mesh.vertices, mesh.corners, a, b)
        left = 0.0
        for triangle, (enters, leaves) in zip(triangles.tolist(), spans, strict=True):
            middle, gap = (left + enters) / 2, (enters - left) / 2
            yield triangle, a + (b - a) * (middle / length), gap + TOUCH
            left = leaves


def _trim(mesh: Triangulation, sleeve: Index, end: Array) -> Index:
    """Leave out triangles whose exit the end stands on: such a portal may seem to lie behind the apex."""
    first = 0
    while (
        first + 1 < len(sleeve)
        and gap_to(mesh.vertices, mesh.corners[sleeve[first + 1]], end[0], end[1]) <= ON_IT
    ):
        first += 1
    return sleeve[first:]


def _pull(mesh: Triangulation, start: Array, sleeve: list[int], end: Array) -> Array:
    """Shortest path from start to end through a sleeve."""
    triangles = _trim(mesh, np.array(sleeve), start)
    triangles = _trim(mesh, triangles[::-1], end)[::-1]
    exits = np.argmax(mesh.neighbours[triangles[:-1]] == triangles[1:, None], axis=1)
    right = mesh.vertices[mesh.corners[triangles[:-1], exits]]
    left = mesh.vertices[mesh.corners[triangles[:-1], (exits + 1) % 3]]
    return _funnel(np.vstack([left, end]), np.vstack([right, end]), start)


@compiled
def _cross(o: Array, a: Array, b: Array) -> float:
    return float((a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]))


@compiled
def _equal(a: Array, b: Array) -> bool:
    return bool(a[0] == b[0] and a[1] == b[1])


@compiled
def _funnel(left: Array, right: Array, start: Array) -> Array:
    """Shortest path through portals (left[k], right[k]); the last portal is the goal, both sides."""
    path = np.empty((len(left) + 2, 2))
    path[0] = start
    n = 1
    apex, tight_left, tight_right = start, start, start
    at_left, at_right, k = -1, -1, 0
    while k < len(left):
        bend = False
        if _cross(apex, tight_right, right[k]) >= 0.0:
            if _equal(apex, tight_right) or _cross(apex, tight_left, right[k]) < 0.0:
                tight_right, at_right = right[k], k
            else:
                apex, k, bend = tight_left, at_left, True
        if not bend and _cross(apex, tight_left, left[k]) <= 0.0:
            if _equal(apex, tight_left) or _cross(apex, tight_right, left[k]) > 0.0:
                tight_left, at_left = left[k], k
            else:
                apex, k, bend = tight_right, at_right, True
        if bend:
            tight_left, tight_right, at_left, at_right = apex, apex, k, k
            if not _equal(path[n - 1], apex):
                path[n] = apex
                n += 1
        k += 1
    if n == 1 or not _equal(path[n - 1], left[-1]):
        path[n] = left[-1]
        n += 1
    return path[:n]


def shorter_path(free: Polygon, start: Array, goal: Array, bound: float) -> Array | None:
    """Find the shortest path of all, where it is shorter than a bound.

    Parameters
    ----------
    free : Polygon [m]
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
    return nodes[_trace_back(came[0])] if far[0, 1] < bound else None


def _trace_back(came: NDArray[np.int32]) -> list[int]:
    """Nodes on the way from the first to the second."""
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
def _is_tangent(at: Array, before: Array, after: Array, x: float, y: float) -> bool:
    """True if the line through a corner in a direction touches it: both neighbours lie on one side."""
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
            if i > 1 and not _is_tangent(nodes[i], before[i], after[i], x, y):
                continue
            if j > 1 and not _is_tangent(nodes[j], before[j], after[j], x, y):
                continue
            if segment_inside(vertices, starts, nodes[i, 0], nodes[i, 1], nodes[j, 0], nodes[j, 1]):
                first[count], second[count] = i, j
                count += 1
    return first[:count], second[:count]
