"""Convex footprints: outline, width, rotations through a range of headings, Minkowski sums."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import Polygon

from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError

GUARD = 1e-9  # by which a hull of rotations is larger, a core smaller, against rounding [m]
PIECE = 0.25  # ranges of headings are cut in pieces no wider than this [rad]


def outline(footprint: ArrayLike) -> Array:
    """Return the corners of a convex footprint, counter-clockwise, without those on straight edges.

    Raises
    ------
    InputError
        When it is not convex, or has no area and is not a single point.
    """
    given = frozen(footprint, (None, 2), "footprint")
    if len(given) == 1:
        return given
    if len(given) < 3:
        raise InputError("footprint: expected one point or at least three corners")
    hull = shapely.convex_hull(shapely.multipoints(given))
    if not isinstance(hull, Polygon) or hull.area < 1e-9:
        raise InputError("footprint: expected an outline with an area, its corners lie on one line")
    ring = Polygon(given)
    if not ring.is_valid or hull.area - ring.area > 1e-9 * hull.area:
        more = 100 * (hull.area / ring.area - 1) if ring.is_valid else np.inf
        raise InputError(f"footprint: expected a convex outline, its convex hull is {more:.3g} % larger")
    corners = np.asarray(shapely.orient_polygons(hull).exterior.coords)[:-1]
    return frozen(corners, (None, 2), "footprint")


def rotation_hull(corners: Array, low: float, high: float) -> Array:
    """Corners of a convex polygon round all rotations of a footprint; tangents close each corner's arc."""
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


def rotation_core(corners: Array, low: float, high: float) -> Array:
    """Corners of a convex polygon inside all rotations of a footprint; none where they share no point.

    The half-plane n x <= d turned through an angle leaves a disc of radius d between its two ends; a chord of
    the disc keeps it a polygon. Where d is below 0 the two ends alone are the tightest.
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


def footprint_width(footprint: ArrayLike) -> float:
    """Smallest distance between two parallel lines with the footprint between them [m].

    Examples
    --------
    >>> round(footprint_width([[0, 0], [0.58, 0], [0.58, 0.38], [0, 0.38]]), 12)
    0.38
    """
    corners = outline(footprint)
    if len(corners) == 1:
        return 0.0
    normals, offsets = _sides(corners)
    return float((offsets[:, None] - normals @ corners.T).max(axis=1).min())


def _turned(points: Array, angle: float) -> Array:
    """Points turned about the origin."""
    c, s = np.cos(angle), np.sin(angle)
    turned: Array = points @ np.array([[c, s], [-s, c]])
    return turned


def _pieces(low: float, high: float) -> tuple[Array, float]:
    """Middles of equal pieces of a range of headings, and half their width."""
    count = max(1, int(np.ceil((high - low) / PIECE)))
    half = (high - low) / (2 * count)
    return np.asarray(low + half * (2.0 * np.arange(count) + 1.0), dtype=np.float64), half


def _sides(corners: Array) -> tuple[Array, Array]:
    """Outward normals n and offsets d of a counter-clockwise outline: it is where n x <= d for all sides."""
    along = np.roll(corners, -1, axis=0) - corners
    normals: Array = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, None]
    return normals, np.einsum("ij,ij->i", normals, corners)


def _clipped(ring: Array, normal: Array, bound: float) -> Array:
    """Part of a convex ring where ``normal`` x <= ``bound`` (Sutherland and Hodgman 1974)."""
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


def grown_by_disc(shape: Array, radius: float, sides: int, *, outside: bool) -> Array:
    """Corners of a convex shape grown by a polygon round a disc, or inside it.

    Corner by corner: shapely's buffer rounds the number of sides of a quarter.
    """
    if radius == 0:
        return shape
    turns = 2 * np.pi * np.arange(sides) / sides
    corner = radius / np.cos(np.pi / sides) if outside else radius
    disc = corner * np.column_stack([np.cos(turns), np.sin(turns)])
    hull = shapely.convex_hull(shapely.multipoints((shape[:, None] + disc).reshape(-1, 2)))
    corners: Array = shapely.get_coordinates(hull)
    return corners


def minkowski_sums(pieces: Sequence[Array], shape: Array) -> NDArray[np.object_]:
    """Minkowski sums of convex pieces with a convex shape."""
    corners, owner = np.concatenate(pieces), np.repeat(np.arange(len(pieces)), [len(p) for p in pieces])
    points = shapely.points((corners[:, None] + shape).reshape(-1, 2))
    sums: NDArray[np.object_] = shapely.convex_hull(
        shapely.multipoints(points, indices=np.repeat(owner, len(shape)))
    )
    return sums
