"""Triangulations of polygons: constrained Delaunay triangles, searched and located along a path."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import lru_cache
from heapq import heappop, heappush
from math import hypot

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.geometry.polygons import DEPTH, FlatPolygon, nearest_on_segment
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index
from regionik.worlds.errors import EngineError

SLACK = 1e-10  # triangles are grown by this when a leg is cut at their edges [m]


@dataclass(frozen=True, eq=False)
class Triangulation:
    """Triangles that fill a polygon edge to edge, without vertices of their own."""

    vertices: Array  # (v, 2) [m]
    corners: Index  # (t, 3) vertices of each triangle, counter-clockwise
    neighbours: Index  # (t, 3) triangle across the edge from corner k to corner k + 1, -1 for none


def delaunay_triangles(polygon: Polygon | MultiPolygon) -> tuple[Array, Index]:
    """Constrained Delaunay triangles: vertices (v, 2) [m], and indices counter-clockwise, (t, 3)."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    xy = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)[:, :3]
    vertices, corners = np.unique(xy.reshape(-1, 2), axis=0, return_inverse=True)
    return vertices, corners.reshape(-1, 3).astype(np.int64)


@lru_cache(maxsize=32)
def triangulate(free: Polygon | MultiPolygon) -> Triangulation:
    """Constrained Delaunay triangles of a polygon, kept for the polygons used last.

    Raises
    ------
    EngineError
        When the triangles do not fill the polygon edge to edge.
    """
    vertices, corners = delaunay_triangles(free)
    neighbours = _neighbours(corners, len(vertices))
    ring_edges = len(FlatPolygon.from_shapely(free).vertices)
    if np.count_nonzero(neighbours < 0) != ring_edges:
        raise EngineError(f"triangulation: the triangles do not fill the polygon ({len(corners)} of them)")
    for array in (vertices, corners, neighbours):
        array.flags.writeable = False
    return Triangulation(vertices, corners, neighbours)


def search_through(mesh: Triangulation, start: Array, first: int, last: int) -> list[int] | None:
    """Triangles from one to another by Dijkstra over edge midpoints; None where none lead there."""
    ends, neighbours = mesh.vertices[mesh.corners], mesh.neighbours.tolist()
    middles = ((ends + np.roll(ends, -1, axis=1)) / 2).tolist()
    heap: list[tuple[float, int, int, tuple[float, float]]] = [(0.0, first, first, (start[0], start[1]))]
    came: dict[int, int] = {}
    while heap:
        cost, t, parent, at = heappop(heap)
        if t in came:
            continue
        came[t] = parent
        if t == last:
            return _trace(came, last)
        for n, (x, y) in zip(neighbours[t], middles[t], strict=True):
            if n >= 0 and n not in came:
                heappush(heap, (cost + hypot(x - at[0], y - at[1]), n, t, (x, y)))
    return None


def link_round(mesh: Triangulation, source: int, target: int, at: Array, radius: float) -> list[int] | None:
    """Triangles that link one to another round a point that both touch; None when they only meet in it."""
    if source == target or target in mesh.neighbours[source]:
        return [target]
    came = {source: source}
    queue = deque([source])
    while queue:
        t = queue.popleft()
        if t == target:
            return _trace(came, target)[1:]
        for n in mesh.neighbours[t].tolist():
            if n >= 0 and n not in came and gap_to(mesh.vertices, mesh.corners[n], at[0], at[1]) <= radius:
                came[n] = t
                queue.append(n)
    return None


def _trace(came: dict[int, int], last: int) -> list[int]:
    chain = [last]
    while came[chain[-1]] != chain[-1]:
        chain.append(came[chain[-1]])
    return chain[::-1]


def _neighbours(corners: Index, vertex_count: int) -> Index:
    """Triangle across each edge, (t, 3), -1 for none."""
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2)
    key = ends.min(axis=1) * vertex_count + ends.max(axis=1)
    order = np.argsort(key, kind="stable")
    twin = np.flatnonzero(key[order][:-1] == key[order][1:])
    one, other = order[twin], order[twin + 1]
    neighbours = np.full(len(key), -1, dtype=np.int64)
    neighbours[one], neighbours[other] = other // 3, one // 3
    return neighbours.reshape(-1, 3)


@compiled
def gap_to(vertices: Array, corners: Index, x: float, y: float) -> float:
    """Distance from a triangle to a point, 0 inside."""
    inside = True
    gap = np.inf
    for k in range(3):
        ax, ay = vertices[corners[k]]
        bx, by = vertices[corners[(k + 1) % 3]]
        if (bx - ax) * (y - ay) - (by - ay) * (x - ax) < 0.0:
            inside = False
        px, py = nearest_on_segment(ax, ay, bx, by, x, y)
        gap = min(gap, np.hypot(px - x, py - y))
    return 0.0 if inside else gap


@compiled
def locate(vertices: Array, corners: Index, x: float, y: float) -> int:
    """The triangle that contains a point, else the nearest; the first of several."""
    best, best_gap = -1, np.inf
    for t in range(len(corners)):
        gap = gap_to(vertices, corners[t], x, y)
        if gap < best_gap:
            best, best_gap = t, gap
            if gap == 0.0:
                break
    return best


@compiled
def _clip(vertices: Array, corners: Index, a: Array, u: Array, length: float) -> tuple[float, float]:
    """Part of a leg inside a triangle grown by ``SLACK``: start and end, the start larger when empty."""
    enters, leaves = 0.0, length
    for k in range(3):
        px, py = vertices[corners[k]]
        qx, qy = vertices[corners[(k + 1) % 3]]
        side = np.hypot(qx - px, qy - py)
        ex, ey = (qx - px) / side, (qy - py) / side
        height = ex * (a[1] - py) - ey * (a[0] - px) + SLACK
        climb = ex * u[1] - ey * u[0]
        if climb == 0.0 and height < 0.0:
            return 1.0, 0.0
        if climb > 0.0:
            enters = max(enters, -height / climb)
        elif climb < 0.0:
            leaves = min(leaves, -height / climb)
    return enters, leaves


@compiled
def passed(vertices: Array, corners: Index, a: Array, b: Array) -> tuple[Index, Array]:
    """Triangles in the order in which a leg from a to b passes them, and its part in each, (m, 2) [m]."""
    length = np.hypot(b[0] - a[0], b[1] - a[1])
    u = (b - a) / length
    hits = np.empty(len(corners), np.int64)
    cuts = np.empty(2 * len(corners) + 2)
    cuts[0], cuts[1] = 0.0, length
    n = 0
    for t in range(len(corners)):
        enters, leaves = _clip(vertices, corners[t], a, u, length)
        if leaves >= enters:
            hits[n] = t
            cuts[2 * n + 2], cuts[2 * n + 3] = enters, leaves
            n += 1
    cuts = np.sort(cuts[: 2 * n + 2])
    triangles, spans = np.empty(len(cuts), np.int64), np.empty((len(cuts), 2))
    m = 0
    for k in range(len(cuts) - 1):
        if cuts[k + 1] - cuts[k] <= DEPTH / 2:
            continue
        middle = a + u * (0.5 * (cuts[k] + cuts[k + 1]))
        hit = locate(vertices, corners[hits[:n]], middle[0], middle[1])
        triangles[m] = hits[hit]
        spans[m, 0], spans[m, 1] = cuts[k], cuts[k + 1]
        m += 1
    return triangles[:m], spans[:m]
