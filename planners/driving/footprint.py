"""Convex outlines turned through a range of headings: polygons round all rotations, and inside all."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import ArrayLike

from regionik.planners.driving.footprint_scene import outline
from regionik.worlds.arrays import Array

GUARD = 1e-9  # by which a shape round rotations is larger, one inside them smaller, against rounding [m]
PIECE = 0.25  # ranges are turned through in pieces no wider than this [rad]


def around(corners: Array, low: float, high: float) -> Array:
    """Corners of a convex polygon round all rotations of the footprint: tangents close each corner's arc."""
    middles, half = _pieces(low, high)
    spots = [
        _turned(corners, angle) * far
        for m in middles
        for angle, far in ((m - half, 1.0), (m, 1 / np.cos(half)), (m + half, 1.0))
    ]
    guard = GUARD * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    points = (np.concatenate(spots)[:, None] + guard).reshape(-1, 2)
    hull = shapely.orient_polygons(shapely.convex_hull(shapely.multipoints(points)))
    return np.asarray(hull.exterior.coords)[:-1]


def within(corners: Array, low: float, high: float) -> Array:
    """Corners of a convex polygon inside all rotations of the footprint; none where they share no point.

    The side n x <= d turned through an angle leaves a disc of radius d between its two ends; a chord of the
    disc keeps to a polygon. Where d is below 0 the ends alone are the tightest.
    """
    if len(corners) == 1:
        still = high == low or not corners.any()
        return _turned(corners, low) if still else np.zeros((0, 2))
    middles, half = _pieces(low, high)
    normals, offsets = _sides(corners)
    reach = float(np.hypot(*corners.T).max()) + 1.0
    left: Array = reach * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    for m in middles:
        for angle, share in ((m - half, 1.0), (m, np.cos(half)), (m + half, 1.0)):
            bounds = np.where(offsets > 0, offsets * share, offsets if share == 1.0 else np.inf)
            for normal, bound in zip(_turned(normals, angle), bounds - GUARD, strict=True):
                left = _clipped(left, normal, bound)
    return left


def width_of(footprint: ArrayLike) -> float:
    """Smallest distance between two parallel lines that hold the footprint between them [m].

    Examples
    --------
    >>> round(width_of([[0, 0], [0.58, 0], [0.58, 0.38], [0, 0.38]]), 12)
    0.38
    """
    corners = outline(footprint)
    if len(corners) == 1:
        return 0.0
    normals, offsets = _sides(corners)
    return float((offsets[:, None] - normals @ corners.T).max(axis=1).min())


def _turned(points: Array, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    turned: Array = points @ np.array([[c, s], [-s, c]])
    return turned


def _pieces(low: float, high: float) -> tuple[Array, float]:
    """Middles of equal pieces of a slab, and half their width."""
    count = max(1, int(np.ceil((high - low) / PIECE)))
    half = (high - low) / (2 * count)
    return np.asarray(low + half * (2.0 * np.arange(count) + 1.0), dtype=np.float64), half


def _sides(corners: Array) -> tuple[Array, Array]:
    """Outward normals and offsets of a counter-clockwise outline: it is where n x <= d for all sides."""
    along = np.roll(corners, -1, axis=0) - corners
    normals: Array = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, None]
    return normals, np.einsum("ij,ij->i", normals, corners)


def _clipped(ring: Array, normal: Array, bound: float) -> Array:
    """The part of a convex ring with ``normal`` x <= ``bound``."""
    if not len(ring) or not np.isfinite(bound):
        return ring
    over = ring @ normal - bound
    kept = []
    for k in range(len(ring)):
        a, b = over[k - 1], over[k]
        if (a > 0) != (b > 0):
            kept.append(ring[k - 1] + (ring[k] - ring[k - 1]) * (a / (a - b)))
        if b <= 0:
            kept.append(ring[k])
    return np.array(kept).reshape(-1, 2)
