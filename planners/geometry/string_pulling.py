"""Shortest paths in a polygon by string pulling: the sleeve of triangles a path runs through, the funnel."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.geometry.polygons import DEPTH, FlatPolygon, Index, compiled, segment_inside
from regionik.planners.geometry.triangulation import (
    Triangulation,
    gap_to,
    link_round,
    locate,
    passed,
    search_through,
    triangulate,
)
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError

ON_IT = 1e-11  # a point this near to a triangle is in it, too [m]
TOUCH = 1e-8  # triangles this near to a point of the path meet there [m]


def tighten(free: Polygon | MultiPolygon, points: ArrayLike) -> Array:
    """The shortest path that can be pulled out of a path like a string, ends held, without leaving ``free``.

    Parameters
    ----------
    free : Polygon or MultiPolygon
        [m]
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
    for start, sleeve, end in _sleeves(mesh, path):
        pulled.append(_pull(mesh, start, sleeve, end)[1:])
    return frozen(np.concatenate(pulled), (None, 2), "path")


def route(free: Polygon | MultiPolygon, start: ArrayLike, goal: ArrayLike) -> Array | None:
    """A short path through the triangles of ``free``, pulled tight; None when no triangles lead there.

    Complete: where start and goal lie in one part of the area, it finds a path. The sleeve is the best by the
    middles of the edges it passes, so the path is often but not always the shortest of all.
    """
    a, b = frozen(start, (2,), "start"), frozen(goal, (2,), "goal")
    mesh = triangulate(free)
    first, last = (int(locate(mesh.vertices, mesh.corners, *p)) for p in (a, b))
    sleeve = search_through(mesh, a, first, last)
    return None if sleeve is None else frozen(_pull(mesh, a, sleeve, b), (None, 2), "path")


def _sleeves(mesh: Triangulation, path: Array) -> Iterator[tuple[Array, list[int], Array]]:
    """Triangles that the path runs through, without going back and forth, from one held point to the next."""
    start, sleeve = path[0], list[int]()
    for triangle, here, radius in _pieces(mesh, path):
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


def _pieces(mesh: Triangulation, path: Array) -> Iterator[tuple[int, Array, float]]:
    """Each triangle in turn, with where the path enters it and how far off it may lie from there."""
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
    """Leave out the triangles whose exit the end stands on: to the funnel such a door could lie behind it."""
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
    """Shortest path through doors (left[k], right[k]); the last door is the goal, both sides."""
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
