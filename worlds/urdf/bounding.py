"""Capsules and boxes around solids: every point of the solid is inside.

Of all capsules about one axis the one of least volume is found on a grid of radii: a thicker capsule may be
shorter, as its round ends then reach further past the ends of its segment.
"""

from __future__ import annotations

from math import pi

import numpy as np
import shapely

from regionik.worlds.arrays import Array
from regionik.worlds.readers.meshes import nearly_least_box, oriented_box
from regionik.worlds.robot import LinkBox, LinkCapsule, LinkSolid

_RADII = 65
_THIN = 1e-4  # no side and no radius is smaller [m]
_SHORT = 1e-6  # nor any segment shorter: engines want a direction [m]
_GROWN = 1 + 1e-9  # against rounding


def cylinder_capsule(link: int, name: str, T_link: Array, radius: float, length: float) -> LinkCapsule:
    """The least capsule that contains a cylinder along z of ``T_link``; its ends are round and stand out."""
    half = length / 2
    rim = np.array([[radius, -half], [radius, half]])
    return _capsule(link, name, T_link, *_least(rim[:, 0], rim[:, 1]))


def sphere_capsule(link: int, name: str, center: Array, radius: float) -> LinkCapsule:
    """A sphere as a capsule of next to no length."""
    T = np.eye(4)
    T[:3, 3] = center
    return _capsule(link, name, T, radius, 0.0, 0.0)


def bounding_solid(link: int, name: str, points: Array) -> LinkSolid:
    """The least by volume of a few boxes and capsules that contain points (n, 3) in the link's frame."""
    found = [_smaller(link, name, points, *box(points)) for box in (oriented_box, nearly_least_box)]
    return min(found, key=volume)


def rough_volume(points: Array) -> float:
    """Volume of a solid that contains points (n, 3), quickly found [m^3]."""
    return volume(_smaller(0, "rough", points, *nearly_least_box(points)))


def volume(solid: LinkSolid) -> float:
    """[m^3]"""
    if isinstance(solid, LinkBox):
        return float(np.prod(solid.size))
    length = float(np.linalg.norm(solid.end - solid.start))
    return pi * solid.radius**2 * (length + 4 / 3 * solid.radius)


def _smaller(link: int, name: str, points: Array, T_link_box: Array, size: Array) -> LinkSolid:
    size = np.maximum(size * _GROWN, _THIN)
    in_box = (points - T_link_box[:3, 3]) @ T_link_box[:3, :3]
    best: LinkSolid = LinkBox(link, name, T_link_box, size)
    least = float(np.prod(size))
    for along in range(3):
        across = [(along + 1) % 3, (along + 2) % 3]
        middle = _middle(in_box[:, across])
        radius, start, end = _least(np.linalg.norm(in_box[:, across] - middle, axis=1), in_box[:, along])
        volume = float(_volume(*np.array([radius, start, end])))
        if volume < least:
            least = volume
            T = T_link_box.copy()
            T[:3, 3] += T_link_box[:3, across] @ middle
            T[:3, :3] = T_link_box[:3, [*across, along]]
            best = _capsule(link, name, T, radius, start, end)
    return best


def _middle(points: Array) -> Array:
    """Middle of the smallest circle around points (n, 2)."""
    circle = shapely.minimum_bounding_circle(shapely.multipoints(points))
    found = shapely.get_coordinates(shapely.centroid(circle))
    center: Array = found[0] if len(found) else points[0]  # no circle where all points are one
    return center


def _least(radial: Array, axial: Array) -> tuple[float, float, float]:
    """Radius, start and end of the least capsule about an axis.

    Points (n,) are given by their distances from the axis and along it.
    """
    thinnest = max(float(radial.max()), _THIN)
    half = float(np.ptp(axial)) / 2
    radii = np.linspace(thinnest, np.hypot(thinnest, half), _RADII)[:, None]
    bulge = np.sqrt(np.maximum(radii**2 - radial**2, 0.0))
    start, end = (axial + bulge).min(1), (axial - bulge).max(1)
    inside = start > end  # one ball holds all, wherever between the two its middle is
    start, end = np.where(inside, (start + end) / 2, start), np.where(inside, (start + end) / 2, end)
    best = int(np.argmin(_volume(radii[:, 0], start, end)))
    return float(radii[best, 0]), float(start[best]), float(end[best])


def _volume(radius: Array, start: Array, end: Array) -> Array:
    volume: Array = pi * radius**2 * (end - start) + 4 / 3 * pi * radius**3
    return volume


def _capsule(link: int, name: str, T_link: Array, radius: float, start: float, end: float) -> LinkCapsule:
    """A capsule about z of ``T_link``."""
    if end - start < _SHORT:
        start, end = (start + end - _SHORT) / 2, (start + end + _SHORT) / 2
    origin, along = T_link[:3, 3], T_link[:3, 2]
    ends = origin + start * along, origin + end * along
    return LinkCapsule(link, name, *ends, max(radius, _THIN) * _GROWN)
