"""Free areas of a footprint by slabs of heading: its configuration space in slices, inner and outer.

In the inner area of a slab the footprint is free at every heading of it, outside the outer area at none. Both
are Minkowski sums with one convex shape (Lozano-Perez 1983): the hull of all rotations of the slab for the
inner area, their core for the outer one. The two differ by the square of the slab's width.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.planners.driving.footprint_scene import (
    FootprintScene,
    Outline,
    core_edges,
    edges_of,
    footprint_scene,
    side_lines,
)
from regionik.planners.geometry.convex_decomposition import hull_corners
from regionik.planners.geometry.polygons import FlatPolygon
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.shadows import Shadow


def _minkowski_sum(area: BaseGeometry, shape: Array) -> BaseGeometry:
    """Minkowski sum of an area and a convex shape: the area moved by a corner, its edges by all of it."""
    if area.is_empty:
        return area
    ends = edges_of(FlatPolygon.from_shapely(area))
    spots = np.concatenate([ends[:, None, :2] + shape, ends[:, None, 2:] + shape], axis=1)
    grown = shapely.convex_hull(shapely.multipoints(spots))
    whole: BaseGeometry = shapely.union_all([shapely.transform(area, lambda p: p + shape[0]), *grown])
    return whole


def grown_by_disc(shape: Array, radius: float, sides: int, *, outside: bool) -> Array:
    """Corners of a convex shape, counter-clockwise, grown by a polygon round a disc, or inside it.

    By the sides of both in the order of their directions: shapely's buffer rounds the number of sides.
    """
    if radius == 0:
        return shape
    turns = 2 * np.pi * np.arange(sides) / sides
    corner = radius / np.cos(np.pi / sides) if outside else radius
    disc = corner * np.column_stack([np.cos(turns), np.sin(turns)])
    sides_of_both = np.concatenate([np.roll(ring, -1, axis=0) - ring for ring in (shape, disc)])
    order = np.argsort(np.arctan2(*sides_of_both.T[::-1]) % (2 * np.pi), kind="stable")
    lowest = sum(ring[np.lexsort(ring.T)[0]] for ring in (shape, disc))
    corners: Array = lowest + np.cumsum(sides_of_both[order], axis=0)
    return corners


def minkowski_sums(pieces: Sequence[Array], shape: Array) -> NDArray[np.object_]:
    """Minkowski sums of convex pieces with a convex shape, as hulls of all sums of their corners."""
    if not pieces:
        return np.empty(0, dtype=object)
    closed = np.concatenate([shape, shape[:1]])  # a line has two corners at least
    points = (np.concatenate(pieces)[:, None] + closed).reshape(-1, 2)
    owner = np.repeat(np.arange(len(pieces)), [len(closed) * len(piece) for piece in pieces])
    lines = shapely.linestrings(points, indices=owner)  # several times as quick to make as points
    sums: NDArray[np.object_] = shapely.convex_hull(lines)
    return sums


ROUNDING_MARGIN = 1e-9  # by which a hull of rotations is larger, a core smaller, against rounding [m]
UPPER_OVERHANG = 10.0  # that upper outlines are looked at beyond the floor [m]
_MAX_HEADING_RANGE = 0.25  # ranges of headings are cut in pieces no wider than this [rad]
DISC_SIDES = 48  # of the polygons that stand for discs
_MAX_WALL_DIRECTIONS = 12  # directions of walls that exact headings are taken from, the longest
MIN_SIDE_SHARE = 0.25  # of a footprint's diameter, from which on a side counts: round outlines have none
_COMPASS = np.exp(2j * np.pi * np.arange(16) / 16).view(np.float64).reshape(-1, 2)


@dataclass(frozen=True, eq=False)
class Slab:
    """Free area of a footprint's reference point while the heading is between two bounds."""

    low: float  # [rad]
    high: float  # [rad]
    # Polygon or MultiPolygon, may be empty: the footprint is free at each of its points at every heading
    inner: BaseGeometry
    # Polygon or MultiPolygon: the footprint is free at no point outside it at any heading
    outer: BaseGeometry

    @property
    def middle(self) -> float:
        """[rad]"""
        return (self.low + self.high) / 2


def slabs(count: int) -> Array:
    """Cut a full turn in equal slabs: (count, 2) lowest and highest heading, the first about 0 [rad].

    Examples
    --------
    >>> np.round(slabs(4), 3).tolist()
    [[-0.785, 0.785], [0.785, 2.356], [2.356, 3.927], [3.927, 5.498]]
    """
    ends = (np.arange(count + 1) - 0.5) * (2 * np.pi / count)
    return np.column_stack([ends[:-1], ends[1:]])


def slabs_along(scene: FootprintScene, count: int, walls: int = _MAX_WALL_DIRECTIONS) -> Array:
    """Cut a full turn in slabs, some of no width: headings at which a side of the footprint is along a wall.

    A footprint goes through its tightest passages with a side along the wall; a slab of no width is exact.
    To ``count`` equal slabs come the headings from so many directions of walls, the longest. Each slab (n, 2)
    of a lowest and highest heading begins where the one before it ends [rad].
    """
    exact = _headings_along(scene, walls)
    even = slabs(count)
    first = even[0, 0]
    inside = first + np.unique(np.mod(exact - first, 2 * np.pi).round(9))
    cuts = np.sort(np.concatenate([even[:, 0], [first + 2 * np.pi], inside, inside]))
    bounds = np.column_stack([cuts[:-1], cuts[1:]])
    double: Array = bounds[np.isin(bounds[:, 0], inside) | (bounds[:, 1] > bounds[:, 0])]
    return double


def _headings_along(scene: FootprintScene, most: int) -> Array:
    """Headings with a long side of the footprint along one of the longest walls."""
    edges = scene.edges[:, 2:] - scene.edges[:, :2]
    lengths = np.hypot(*edges.T)
    angles = np.mod(np.arctan2(edges[:, 1], edges[:, 0]), np.pi)
    walls, which = np.unique(angles.round(6) % np.pi, return_inverse=True)
    longest = np.argsort(-np.bincount(which, lengths), kind="stable")[:most]
    # The angle itself, not the one rounded to group walls by.
    walls = np.array([angles[which == w][np.argmax(lengths[which == w])] for w in longest])
    corners = scene.corners
    if len(corners) < 2:
        return np.zeros(0)
    along = np.roll(corners, -1, axis=0) - corners
    diameter = np.hypot(*(corners[:, None] - corners).T).max()
    sides = np.arctan2(*along[np.hypot(*along.T) >= MIN_SIDE_SHARE * diameter].T[::-1])
    headings: Array = (walls[:, None, None] - sides[:, None] + [0.0, np.pi]).ravel()
    return headings


def slab_areas(
    footprint: ArrayLike,
    floor: Polygon | MultiPolygon,
    obstacles: Sequence[Shadow],
    clearance: float,
    bounds: ArrayLike,
    upper: Sequence[Outline] = (),
) -> tuple[Slab, ...]:
    """Free areas of a footprint while its heading is between two bounds, one for each slab.

    Parameters
    ----------
    footprint, floor, obstacles, clearance, upper
        As for `footprint_scene`; inner areas alone know of ``upper`` outlines.
    bounds : (n, 2) array_like
        Lowest and highest heading of each slab, the same or rising [rad].

    Examples
    --------
    >>> from shapely import box
    >>> long = [[0.3, -0.1], [0.3, 0.1], [-0.3, 0.1], [-0.3, -0.1]]
    >>> (slab,) = slab_areas(long, box(0, 0, 2, 0.3), [], 0.0, [[-0.1, 0.1]])
    >>> [round(area.area, 3) for area in (slab.inner, slab.outer)]
    [0.057, 0.142]
    """
    scene = convex_scene(footprint, floor, obstacles, clearance)
    others = [outline_scene(one, floor) for one in upper]
    found = []
    for low, high in frozen(bounds, (None, 2), "slabs").tolist():
        inner = free_at_all(scene, low, high)
        for other in others:
            inner &= free_at_all(other, low, high)
        found.append(Slab(low, high, inner, free_at_some(scene, low, high)))
    return tuple(found)


def free_at_all(scene: ConvexScene, low: float, high: float) -> BaseGeometry:
    """Positions at which a footprint is free at every heading of a range [rad], from within."""
    return _positions(scene, _rotations(scene.outline, low, high)[0], inner=True)


def free_at_some(scene: ConvexScene, low: float, high: float) -> BaseGeometry:
    """Positions at which a footprint is free at some heading of a range [rad], from outside."""
    shared = _rotations(scene.outline, low, high)[1]
    if len(shared):
        return _positions(scene, shared, inner=False)
    # The rotations have no point in common. Those about the footprint's middle have, and it keeps to an arc.
    middle = scene.corners.mean(axis=0)
    core = rotation_core(scene.corners - middle, low, high)
    about = _positions(scene._replace(window=None), core, inner=False)
    whole = _minkowski_sum(about, -rotation_hull(middle[None], low, high))
    return whole if scene.window is None else whole & scene.window


class ConvexScene(NamedTuple):
    """Footprint and surroundings, the same for all slabs."""

    corners: Array  # (n, 2) of the footprint [m]
    floor: BaseGeometry  # Polygon or MultiPolygon, less obstacles that are not convex
    # by clearance [m] the corners of convex pieces that the footprint keeps it from
    pieces: tuple[tuple[float, list[Array]], ...]
    sides: int  # of the polygons that stand for discs
    window: BaseGeometry | None  # positions that are looked at alone

    @property
    def outline(self) -> tuple[tuple[float, float], ...]:
        """The corners, hashable."""
        return tuple(map(tuple, self.corners.tolist()))


def convex_scene(
    footprint: ArrayLike,
    floor: Polygon | MultiPolygon,
    obstacles: Sequence[Shadow],
    clearance: float,
    sides: int = DISC_SIDES,
    window: BaseGeometry | None = None,
) -> ConvexScene:
    """Return footprint and surroundings for `free_at_all` and `free_at_some`; see `slab_areas`."""
    corners = footprint_scene(footprint, floor, obstacles, clearance).corners
    edges = [(edge.reshape(2, 2), 0.0) for edge in core_edges(floor)]
    solids = [
        (core, clearance + shadow.kept) for shadow in obstacles for core in shapely.get_parts(shadow.core)
    ]
    convex = [(shapely.get_coordinates(core), keep) for core, keep in solids if _is_convex(core)]
    rest = [(core, keep) for core, keep in solids if not _is_convex(core)]
    edges += [(edge.reshape(2, 2), keep) for core, keep in rest for edge in core_edges(core)]
    pieces: dict[float, list[Array]] = {}
    for piece, keep in (*edges, *convex):
        pieces.setdefault(keep, []).append(piece)
    left = shapely.difference(floor, shapely.union_all([core for core, _ in rest])) if rest else floor
    return ConvexScene(corners, left, tuple(pieces.items()), sides, window)


def outline_scene(outline: Outline, floor: BaseGeometry) -> ConvexScene:
    """Return an upper outline and its surroundings, as far as the floor goes and beyond: no edge binds it."""
    beyond = UPPER_OVERHANG + 2 * float(np.abs(outline.corners).max())
    plane = shapely.buffer(floor.envelope, beyond, join_style="mitre")
    return convex_scene(np.array(outline.corners), plane, outline.shadows, outline.clearance)


def _is_convex(core: BaseGeometry) -> bool:
    """True if a part of a shadow is its own hull, as a point is and a bent line is not."""
    hull = shapely.convex_hull(core)
    return bool(hull.geom_type == core.geom_type and hull.area - core.area <= 1e-12 * hull.area)


@lru_cache(maxsize=1024)  # many targets ask for the same headings
def _rotations(corners: tuple[tuple[float, float], ...], low: float, high: float) -> tuple[Array, Array]:
    """Hull and core of a footprint's rotations."""
    outline = np.array(corners)
    return rotation_hull(outline, low, high), rotation_core(outline, low, high)


class Rejection(NamedTuple):
    """Positions that a convex shape may not take, as floor and forbidden pieces."""

    # Polygon or MultiPolygon: one point of the shape is on the floor, in no obstacle that is not convex
    floor: BaseGeometry
    taken: NDArray[np.object_]  # an edge of floor or obstacles comes too near to it


def slab_rejections(
    footprint: ArrayLike,
    floor: Polygon | MultiPolygon,
    obstacles: Sequence[Shadow],
    clearance: float,
    bounds: ArrayLike,
    upper: Sequence[Outline] = (),
) -> tuple[Rejection, ...]:
    """Floor and forbidden pieces, of which each inner area is the difference; see `slab_areas`."""
    scene = convex_scene(footprint, floor, obstacles, clearance)
    scenes = [scene, *(outline_scene(one, floor) for one in upper)]
    return tuple(
        _rejection_by_all(scenes, low, high) for low, high in frozen(bounds, (None, 2), "slabs").tolist()
    )


def _rejection_by_all(scenes: Sequence[ConvexScene], low: float, high: float) -> Rejection:
    """What no outline of the base may take at some heading of a range."""
    found = [_rejection(one, rotation_hull(one.corners, low, high), inner=True) for one in scenes]
    floor = shapely.intersection_all([one.floor for one in found])
    return Rejection(floor, np.concatenate([one.taken for one in found]))


def _positions(scene: ConvexScene, shape: Array, *, inner: bool) -> BaseGeometry:
    """Positions at which a convex shape lies on the floor and keeps its distance from the obstacles."""
    here, taken = _rejection(scene, shape, inner=inner)
    if scene.window is not None:
        here, taken = here & scene.window, taken[shapely.intersects(taken, scene.window)]
        if shapely.contains(taken, scene.window).any():
            return Polygon()
    parts = shapely.get_parts(shapely.difference(here, shapely.union_all(taken)))
    whole: BaseGeometry = shapely.union_all(parts[shapely.area(parts) > 0])
    return whole


def _rejection(scene: ConvexScene, shape: Array, *, inner: bool) -> Rejection:
    """Floor and forbidden pieces: a shape is free where one point of it is and no edge comes too near."""
    point = shape.mean(axis=0)
    met = []
    for keep, pieces in scene.pieces:
        wide = grown_by_disc(-shape, keep, scene.sides, outside=inner)
        met.append(minkowski_sums(_near_window(scene, pieces, wide), wide))
    solid = np.concatenate(met)
    floor = shapely.transform(scene.floor, lambda p: p - point)
    if not floor.is_valid:  # rounding where edges nearly meet
        floor = shapely.make_valid(floor, method="structure", keep_collapsed=False)
    return Rejection(floor, solid[shapely.area(solid) > 0])


def _near_window(scene: ConvexScene, pieces: list[Array], shape: Array) -> list[Array]:
    """Pieces whose sums with a shape no line of a few directions parts from the window."""
    if scene.window is None:
        return pieces
    beyond = (shapely.get_coordinates(scene.window) @ _COMPASS.T).min(
        axis=0, initial=np.inf
    ) - ROUNDING_MARGIN
    least = beyond - (shape @ _COMPASS.T).max(axis=0)
    return [piece for piece in pieces if ((piece @ _COMPASS.T).max(axis=0) >= least).all()]


def rotation_hull(corners: Array, low: float, high: float) -> Array:
    """Corners of a convex polygon round all rotations of a footprint; tangents close each corner's arc."""
    middles, half = _pieces(low, high)
    spots = [
        _turned(corners, angle) * far
        for m in middles
        for angle, far in ((m - half, 1.0), (m, 1 / np.cos(half)), (m + half, 1.0))
    ]
    guard = ROUNDING_MARGIN * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    return hull_corners((np.concatenate(spots)[:, None] + guard).reshape(-1, 2))


def rotation_core(corners: Array, low: float, high: float) -> Array:
    """Corners of a convex polygon inside all rotations of a footprint; none where they share no point.

    The half-plane n x <= d turned through an angle leaves a disc of radius d between its two ends; a chord of
    the disc keeps it a polygon. Where d is below 0 the two ends alone are the tightest.
    """
    if len(corners) == 1:
        still = high == low or not corners.any()
        return _turned(corners, low) if still else np.zeros((0, 2))
    middles, half = _pieces(low, high)
    normals, offsets = side_lines(corners)
    reach = float(np.hypot(*corners.T).max()) + 1.0
    left: Array = reach * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    for m in middles:
        for angle, share in ((m - half, 1.0), (m, np.cos(half)), (m + half, 1.0)):
            bounds = np.where(offsets > 0, offsets * share, offsets if share == 1.0 else np.inf)
            for normal, bound in zip(_turned(normals, angle), bounds - ROUNDING_MARGIN, strict=True):
                left = _clipped(left, normal, bound)
    return left


def _turned(points: Array, angle: float) -> Array:
    """Points turned about the origin."""
    c, s = np.cos(angle), np.sin(angle)
    turned: Array = points @ np.array([[c, s], [-s, c]])
    return turned


def _pieces(low: float, high: float) -> tuple[Array, float]:
    """Middles of equal pieces of a range of headings, and half their width."""
    count = max(1, int(np.ceil((high - low) / _MAX_HEADING_RANGE)))
    half = (high - low) / (2 * count)
    return np.asarray(low + half * (2.0 * np.arange(count) + 1.0), dtype=np.float64), half


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
