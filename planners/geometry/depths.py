"""How far a shape on the floor reaches out of another, or into it: the distance of its worst point."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.worlds.arrays import Array

RESOLVED = 1e-5  # by which a distance may be told too small [m]
MOST = 300  # squares that are halved: on a ridge, as far from the edge all along, more tell nothing new
QUARTERS = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]]) / 2


def farthest_outside(shape: BaseGeometry, ground: BaseGeometry) -> float:
    """Return the distance from the ground of the point of a shape that is farthest from it, at least 0 [m].

    Corners alone do not tell: over a hole or an inner corner of the ground the farthest point lies between.

    Examples
    --------
    >>> holed = shapely.box(-2, -2, 2, 2) - shapely.box(-0.5, -0.5, 0.5, 0.5)
    >>> round(farthest_outside(shapely.box(-1, -1, 1, 1), holed), 3)
    0.5
    """
    return max(0.0, _worst(shape, ground, -1.0))


def deepest_inside(shape: BaseGeometry, solid: BaseGeometry) -> float:
    """Return the depth in a solid of the point of a shape that is deepest in it, at least 0 [m].

    Examples
    --------
    >>> round(deepest_inside(shapely.box(0, -1, 5, 1), shapely.box(-1, -1, 1, 1)), 3)
    1.0
    """
    return max(0.0, _worst(shape, solid, 1.0))


def _worst(shape: BaseGeometry, region: BaseGeometry, inside: float) -> float:
    """Largest distance of a point of a shape from a region's edge, below 0 on its other side [m].

    Squares are halved as long as one might hold a point that is worse: no point is farther from the edge than
    another by more than the way between them.
    """
    edge = shapely.STRtree(_sides(region))
    shapely.prepare(shape)
    shapely.prepare(region)

    def height(points: Array) -> Array:
        found = np.full(len(points), np.inf)
        (row, _), distance = edge.query_nearest(
            shapely.points(points), return_distance=True, all_matches=False
        )
        found[row] = distance
        return np.where(shapely.intersects_xy(region, points[:, 0], points[:, 1]), inside, -inside) * found

    low, high = np.array(shape.bounds[:2]), np.array(shape.bounds[2:])
    centers, half = (low + high)[None] / 2, float((high - low).max()) / 2
    best = float(height(shapely.get_coordinates(shape)).max())
    while True:
        middle = shapely.points(centers)
        near = shapely.get_coordinates(shapely.shortest_line(middle, shape)).reshape(-1, 2, 2)[:, 1]
        best = max(best, float(height(near).max()))
        far = half * np.sqrt(2)
        there = height(centers)
        some = (there + far > best + RESOLVED) & (shapely.distance(middle, shape) <= far)
        kept = np.flatnonzero(some)
        if not len(kept):
            return best
        kept = kept[np.argsort(-there[kept], kind="stable")[:MOST]]
        half /= 2
        centers = (centers[kept, None] + 2 * half * QUARTERS).reshape(-1, 2)


def _sides(region: BaseGeometry) -> Array:
    """Sides of polygons as lines, (n,)."""
    corners, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(region)), return_index=True)
    same = ring[1:] == ring[:-1]
    sides: Array = shapely.linestrings(np.stack([corners[:-1], corners[1:]], axis=1)[same])
    return sides
