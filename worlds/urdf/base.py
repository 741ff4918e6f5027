"""The base of a URDF robot: a footprint up to some height, and solids for what stands above it.

As one block, a base with a mast would be as high as the mast and as wide as the base. It is cut at the height
where the block below and boxes around the parts above take least volume, among heights below which it covers
nearly all of its floor area; where that saves little, it stays one block. Parts that reach above the cut are
kept whole as solids (meshes from the cut upwards), and below it they are in the footprint too: nothing is
left out at any height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from regionik.worlds.arrays import Array
from regionik.worlds.urdf.bounding import hull_triangles
from regionik.worlds.urdf.decomposition import CollisionPart, clip_triangles, decompose, mesh_part

MOST_SOLIDS = 6
SPARED = 0.7  # of the one block's volume, below which it is cut
WIDE = 0.9  # of the floor area of the whole base, that the footprint keeps
_CORNERS = 32  # of a footprint
_HEIGHTS, _TOPS = 14, 24  # tried: evenly spread ones, and tops of parts
_LEAST = 0.02  # height of a base, and of what stands on it [m]
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class BaseShape:
    """A footprint with the parts above it."""

    outline: Array  # (n, 2) convex footprint [m]; no rows where nothing is low
    height: float  # height up to which the footprint counts [m]; 0 for a base without parts
    parts: tuple[CollisionPart, ...] = ()  # parts that stand higher


def base_shape(parts: Sequence[CollisionPart], height: float | None) -> BaseShape:
    """Return the base that contains all parts; cut at ``height``, or where that saves most [m]."""
    if not parts:
        return BaseShape(np.empty((0, 2)), 0.0)
    surface = np.concatenate([_surface(part) for part in parts])
    cut = _best_height(parts, surface) if height is None else height
    high = [_upper(part, cut) for part in parts if part.points[:, 2].max() > cut + _LEAST / 2]
    return BaseShape(convex_outline(_lower(surface, cut)), cut, decompose(high, MOST_SOLIDS))


def _surface(part: CollisionPart) -> Array:
    return part.triangles if len(part.triangles) else hull_triangles(part.points)


def _lower(surface: Array, cut: float) -> Array:
    """Return the points (n, 2) of a surface below a height, projected on the floor."""
    return clip_triangles(surface, -_UP, -cut).reshape(-1, 3)[:, :2]


def _upper(part: CollisionPart, cut: float) -> CollisionPart:
    """Return the part of a mesh above a height; other parts whole."""
    if not len(part.triangles) or part.points[:, 2].min() >= cut:
        return part
    return mesh_part(part.link, part.name, clip_triangles(part.triangles, _UP, cut))


def _best_height(parts: Sequence[CollisionPart], surface: Array) -> float:
    """Return the height of the cut; the top where a cut saves little [m]."""
    tops = np.unique([part.points[:, 2].max() for part in parts])
    top = float(tops[-1])
    tried = {*tops[:: 1 + len(tops) // _TOPS].tolist(), *np.linspace(0.0, top, _HEIGHTS)[1:-1].tolist()}
    block = {h: _ground(surface, h) for h in {*tried, top}}
    heights = sorted(h for h in tried if _LEAST <= h <= top - _LEAST and block[h] >= WIDE * block[top])
    room = {h: block[h] * h + _boxes(parts, h) for h in heights}
    best = min(heights, key=lambda h: room[h], default=top)
    return best if best in room and room[best] < SPARED * block[top] * top else top


def _ground(surface: Array, cut: float) -> float:
    """Return the area of the footprint of all that is below a height [m^2]."""
    return float(shapely.convex_hull(shapely.multipoints(_lower(surface, cut))).area)


def _boxes(parts: Sequence[CollisionPart], cut: float) -> float:
    """Return the volume of boxes around the parts that reach above a height [m^3]."""
    high = (_upper(part, cut).points for part in parts if part.points[:, 2].max() > cut)
    return sum(float(np.prod(np.ptp(points, axis=0))) for points in high)


def convex_outline(points: Array) -> Array:
    """Return a convex outline around points (n, 2), in order: their hull, or `_CORNERS` tangents to it."""
    hull = shapely.convex_hull(shapely.multipoints(points))
    if not len(points) or hull.geom_type != "Polygon" or hull.area < 1e-8:
        return np.empty((0, 2))
    corners = _ring(hull)
    if len(corners) <= _CORNERS:
        return corners
    # Hundreds of corners would slow all that uses the outline; each tangent is at most a 200th of the radius
    # away from the hull.
    angles = np.arange(_CORNERS) * 2 * pi / _CORNERS
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    reach = (corners @ normals.T).max(0)
    step = 2 * pi / _CORNERS
    sides = np.column_stack([-normals[:, 1], normals[:, 0]])
    along = (np.roll(reach, -1) - reach * np.cos(step)) / np.sin(step)
    outer = reach[:, None] * normals + along[:, None] * sides
    return _ring(shapely.convex_hull(shapely.multipoints(outer)))


def _ring(hull: Polygon) -> Array:
    """Return the corners of a hull, counter-clockwise."""
    corners: Array = np.asarray(orient(hull).exterior.coords)[:-1]
    return corners
