"""Polygons cut into a few convex pieces (Hertel and Mehlhorn, 1983)."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry import Polygon

from regionik.planners.geometry.options import GEOMETRY
from regionik.worlds.arrays import Array, Index

_FLAT = 1e-12  # area that rounding may put between a convex ring and its hull [m^2]


def convex_pieces(polygon: Polygon) -> list[Array]:
    """Convex polygons that cover the polygon, overlap in edges only and add no area to it.

    Parameters
    ----------
    polygon : Polygon
        With holes or without.

    Returns
    -------
    list of (k, 2) array
        Corners in counter-clockwise order, k at most 16 [m].

    Examples
    --------
    >>> ell = Polygon([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])
    >>> pieces = [Polygon(piece) for piece in convex_pieces(ell)]
    >>> sum(piece.area for piece in pieces)
    3.0
    >>> max(piece.convex_hull.area - piece.area for piece in pieces)
    0.0
    """
    outline = np.asarray(polygon.exterior.coords)[:-1]
    if not polygon.interiors and _is_convex(outline):
        corners = hull_corners(outline)
        if len(corners) <= GEOMETRY.max_piece_corners:
            return [corners]
    points, triangles = _triangles(polygon)
    return [hull_corners(points[ring]) for ring in _merged(points, triangles.tolist())]


def _triangles(polygon: Polygon) -> tuple[Array, Index]:
    """Constrained Delaunay triangles: vertices (v, 2) [m], and indices counter-clockwise, (t, 3)."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    xy = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)[:, :3]
    vertices, corners = np.unique(xy.reshape(-1, 2), axis=0, return_inverse=True)
    return vertices, corners.reshape(-1, 3).astype(np.int64)


def _merged(points: Array, rings: list[list[int]]) -> list[list[int]]:
    """Triangles joined across shared edges, longest first, while they stay convex."""
    home = {edge: k for k, ring in enumerate(rings) for edge in _edges(ring)}
    inner = [(u, v) for u, v in home if u < v and (v, u) in home]
    inner.sort(key=lambda e: (-float(np.linalg.norm(points[e[0]] - points[e[1]])), e))
    parts = dict(enumerate(rings))
    for u, v in inner:
        a, b = home[u, v], home[v, u]
        if a == b:
            continue
        joined = _joined(parts[a], parts[b], u)
        if len(joined) > GEOMETRY.max_piece_corners or not _is_convex(points[joined]):
            continue
        parts[a] = joined
        for edge in _edges(parts.pop(b)):
            home[edge] = a
    return [parts[k] for k in sorted(parts)]


def _joined(a: list[int], b: list[int], u: int) -> list[int]:
    """Ring ``a``, whose edge from u on is shared, with that edge replaced by the rest of ring ``b``."""
    i, j = a.index(u), b.index(u)
    around = b[j + 1 :] + b[:j]  # ends in the edge's other corner, which ring a has already
    return a[: i + 1] + around[:-1] + a[i + 1 :]


def _edges(ring: list[int]) -> list[tuple[int, int]]:
    return list(zip(ring, ring[1:] + ring[:1], strict=True))


def _is_convex(corners: Array) -> bool:
    # By area, because turning angles say nothing where corners lie a rounding error apart.
    ring = shapely.polygons(corners)
    return bool(shapely.area(shapely.convex_hull(ring)) - shapely.area(ring) < _FLAT)


def hull_corners(corners: Array) -> Array:
    """Counter-clockwise corners of the hull of points (n, 2), without those on straight edges."""
    hull = shapely.orient_polygons(shapely.convex_hull(shapely.multipoints(corners)))
    return np.asarray(hull.exterior.coords)[:-1]
