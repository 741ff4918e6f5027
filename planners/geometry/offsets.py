"""Offsets of shapes by a disc, by GEOS, each on the side of the true one that is asked for.

GEOS draws arcs as chords, and rounds how many: what is grown or taken away is less than the true one. It
also fills shallow bays before it begins, a hundredth of the distance deep: there it is more. And where bays
or holes are just filled it may leave a hole of some square millimetres or less.
"""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.worlds.arrays import Array

QUAD_SEGMENTS = 12
QUANTUM = np.pi / (2 * QUAD_SEGMENTS)  # angle of one segment of an arc [rad]
ROUNDING = 1e-6  # a number of segments this near to the next may be rounded either way
SHALLOW = 0.01  # of the distance: how deep bays may be that are filled


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
    swept: BaseGeometry = shape.buffer(_asked(shape, by, 1.0, more=outside), quad_segs=QUAD_SEGMENTS)
    return _filled(swept, shape, by) if outside else swept


def shrunk(shape: BaseGeometry, by: float, *, outside: bool) -> BaseGeometry:
    """Erosion of a shape by a disc (centres of discs inside it): all and a little more, or a part.

    Parameters
    ----------
    shape : BaseGeometry
        Polygons.
    by : float
        Radius [m].
    """
    left: BaseGeometry = shape.buffer(-_asked(shape, by, -1.0, more=not outside), quad_segs=QUAD_SEGMENTS)
    return left


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


def _asked(shape: BaseGeometry, by: float, side: float, *, more: bool) -> float:
    """Distance to ask of GEOS for at least ``by``, or for at most [m].

    Corners that stand out are rounded, seen from outside (side 1) or from inside (-1). The others are bays.
    """
    angles, depths = _turns(shape)
    bays = bool(((side * angles < 0) & (depths < 2 * SHALLOW * by)).any())
    if not more:
        return (1 - SHALLOW) * by if bays else by
    if bays or shapely.get_type_id(shape) > shapely.GeometryType.POLYGON:
        return float(by / np.cos(0.75 * QUANTUM))  # a segment may be half as wide again as it should be
    out = np.abs(angles) if side > 0 else -angles[angles < 0]
    segments = np.maximum(1.0, np.floor(out / QUANTUM + 0.5 - ROUNDING))
    widest = min((out / segments).max(initial=QUANTUM if side > 0 else 0.0), 1.5 * QUANTUM)
    return float(by / np.cos(widest / 2))
