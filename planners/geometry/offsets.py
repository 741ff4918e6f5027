"""Shapes on the floor offset by a disc, and how far one reaches out of another, or into it.

Offsets are made by GEOS, each on the side of the true one that is asked for. GEOS draws arcs as chords, and
rounds how many: what is grown or taken away is less than the true one. Corners that hardly turn it does not
round at all, and starts the next side where the one before ends. It also fills shallow bays before it begins,
a hundredth of the distance deep and now and then more: there it is more, and how far it reaches is measured.
And where bays or holes are just filled it may leave a hole of some square millimetres or less.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.planners.geometry.options import GEOMETRY
from regionik.worlds.arrays import Array

OPTIONS = GEOMETRY.offsets

_QUANTUM = np.pi / (2 * OPTIONS.quadrant_segments)  # angle of one segment of an arc [rad]
ROUNDING = 1e-6  # a number of segments this near to the next may be rounded either way
MAX_UNROUNDED_TURN = 1.001e-3  # corners that turn by less are not rounded [rad]
DISTANCE_TOLERANCE = 1e-9  # to which distances are [m]
SNAPPED_SHARE = 1e-3  # of the distance: how near corners of an offset may be that GEOS takes for one


def radius_that_holds(most: float, least: float, holds: Callable[[float], bool]) -> float:
    """Return the first of ever smaller radii for which something holds; the least where none does.

    >>> round(radius_that_holds(1.0, 0.1, lambda radius: radius < 0.5), 3)
    0.49
    """
    radius = most
    while radius > least and not holds(radius):
        radius = max(least, OPTIONS.shrinkage * radius if radius > OPTIONS.min_circle else 0.0)
    return radius


def grown(shape: BaseGeometry, by: float, *, outside: bool) -> BaseGeometry:
    """Minkowski sum of a shape and a disc: all of it and a little more, or a part of it.

    Parameters
    ----------
    by : float
        Radius [m].

    Examples
    --------
    >>> corner = shapely.Point(0, 0)
    >>> [round(grown(corner, 1.0, outside=side).area / np.pi, 4) for side in (True, False)]
    [1.0014, 0.9971]
    """
    if not outside:
        return _offset_by_less(shape, by, 1.0)
    return _filled(_offset(shape, _distance_for_more(shape, by, 1.0)), shape, by)


def shrunk(shape: BaseGeometry, by: float, *, outside: bool) -> BaseGeometry:
    """Erosion of a shape by a disc (centres of discs inside it): all and a little more, or a part.

    Parameters
    ----------
    shape : BaseGeometry
        Polygons.
    by : float
        Radius [m].
    """
    if outside:
        return _offset_by_less(shape, by, -1.0)
    return _offset(shape, -_distance_for_more(shape, by, -1.0))


def _offset(shape: BaseGeometry, by: float) -> BaseGeometry:
    offset: BaseGeometry = shape.buffer(by, quad_segs=OPTIONS.quadrant_segments)
    return offset


def _offset_by_less(shape: BaseGeometry, by: float, side: float) -> BaseGeometry:
    """Return the shape with its edge moved outwards (side 1) or inwards (-1) by at most ``by``."""
    angles, depths = _turns(shape)
    if not (side * angles < 0).any():
        return _offset(shape, side * by)
    asked = (1 - OPTIONS.shallow_share) * by if _has_shallow_bays(angles, depths, by, side) else by
    for _ in range(OPTIONS.max_easings):
        offset = _offset(shape, side * asked)
        over = _overreach(offset, shape, by, asked / OPTIONS.easing)
        if over <= DISTANCE_TOLERANCE:
            return offset
        asked -= max(OPTIONS.easing * over, SNAPPED_SHARE * by)
        if asked <= 0:
            break
    return shape


def _overreach(offset: BaseGeometry, shape: BaseGeometry, by: float, most: float) -> float:
    """Upper bound for how much farther than ``by`` some point of an offset's edge is from the shape's [m].

    From one side of the shape the distance is convex along a side of the offset, so its ends tell. Where one
    of them is more than ``most`` too far, that is all that is told.
    """
    sides, ends = _sides(shape), shapely.get_coordinates(_sides(offset)).reshape(-1, 2, 2)
    tree = shapely.STRtree(sides)
    for halving in range(OPTIONS.max_halvings + 1):
        start, end = ends[:, 0], ends[:, 1]
        near = [tree.nearest(shapely.points(place)) for place in (start, (start + end) / 2, end)]
        far_off = [
            [shapely.distance(shapely.points(place), sides[one]) for place in (start, end)] for one in near
        ]
        known = float(far_off[0][0].max(initial=0.0)) - by  # of starts, from the side nearest to each
        if known > most:
            return known
        excess = np.min([np.maximum(*both) for both in far_off], axis=0) - by
        far = excess > DISTANCE_TOLERANCE
        if halving == OPTIONS.max_halvings or not far.any():
            break
        start, end = start[far], end[far]
        middle = (start + end) / 2
        ends = np.concatenate([np.stack([start, middle], axis=1), np.stack([middle, end], axis=1)])
    return float(excess.max(initial=-by))


def _filled(swept: BaseGeometry, shape: BaseGeometry, by: float) -> BaseGeometry:
    """The sum without holes that come nearer to the shape than its disc reaches."""
    parts = shapely.get_parts(swept)
    if not shapely.get_num_interior_rings(parts).any():
        return swept
    whole, nearer = [], np.nextafter(by, 0.0)
    shapely.prepare(shape)  # of a map's walls, with tens of thousands of corners
    for part in parts:
        rims = [shapely.points(shapely.get_coordinates(ring)) for ring in part.interiors]
        true = [not shapely.dwithin(shape, rim, nearer).any() for rim in rims]
        holes = [ring for ring, one in zip(part.interiors, true, strict=True) if one]
        whole.append(shapely.Polygon(part.exterior, holes))
    return shapely.union_all(whole)


def _turns(shape: BaseGeometry) -> tuple[Array, Array]:
    """Turning angles of a shape's corners, left positive [rad], and their depths [m].

    The depth of a corner is its distance from the line through the corners beside it.
    """
    angles, depths = [np.zeros(0)], [np.zeros(0)]
    for ring in shapely.get_rings(shapely.orient_polygons(shape)):
        corners = shapely.get_coordinates(ring)[:-1]
        corners = corners[(corners != np.roll(corners, 1, axis=0)).any(axis=1)]
        way = np.roll(corners, -1, axis=0) - corners
        ahead = np.roll(way, -1, axis=0)
        cross = way[:, 0] * ahead[:, 1] - way[:, 1] * ahead[:, 0]
        angles.append(np.arctan2(cross, (way * ahead).sum(axis=1)))
        across = np.hypot(*(way + ahead).T)
        depths.append(np.abs(cross) / np.where(across > 0, across, np.inf))
    return np.concatenate(angles), np.concatenate(depths)


def _has_shallow_bays(angles: Array, depths: Array, by: float, side: float) -> bool:
    """Return True where a shape has corners that GEOS may leave out.

    Corners that stand out are rounded, seen from outside (side 1) or from inside (-1). The others are bays.
    """
    return bool(((side * angles < 0) & (depths < 2 * OPTIONS.shallow_share * by)).any())


def _distance_for_more(shape: BaseGeometry, by: float, side: float) -> float:
    """Return the distance to ask of GEOS for at least ``by``, outwards (side 1) or inwards (-1) [m]."""
    angles, depths = _turns(shape)
    bays = _has_shallow_bays(angles, depths, by, side)
    if bays or shapely.get_type_id(shape) > shapely.GeometryType.POLYGON:
        return float(by / np.cos(0.75 * _QUANTUM))  # a segment may be half as wide again as it should be
    out = np.abs(angles) if side > 0 else -angles[angles < 0]
    segments = np.maximum(1.0, np.floor(out / _QUANTUM + 0.5 - ROUNDING))
    wide = np.where(out < MAX_UNROUNDED_TURN, 2 * out, out / segments)
    widest = min(wide.max(initial=_QUANTUM if side > 0 else 0.0), 1.5 * _QUANTUM)
    return float(by / np.cos(widest / 2))


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
        some = (there + far > best + OPTIONS.depth_error) & (shapely.distance(middle, shape) <= far)
        kept = np.flatnonzero(some)
        if not len(kept):
            return best
        kept = kept[np.argsort(-there[kept], kind="stable")[: OPTIONS.max_squares]]
        half /= 2
        centers = (centers[kept, None] + 2 * half * QUARTERS).reshape(-1, 2)


def _sides(region: BaseGeometry) -> Array:
    """Sides of polygons as lines, (n,)."""
    corners, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(region)), return_index=True)
    same = ring[1:] == ring[:-1]
    sides: Array = shapely.linestrings(np.stack([corners[:-1], corners[1:]], axis=1)[same])
    return sides
