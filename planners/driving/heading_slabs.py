"""Free area of a footprint by slabs of heading: the configuration space in slices with inner and outer
bounds.

In the inner area of a slab the footprint is free at every heading of it, outside the outer area at none. Both
are Minkowski sums with one convex shape (Lozano-Perez 1983): the hull of all rotations of the slab for the
inner area, their core for the outer one. The two differ by the square of the slab's width.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.planners.driving.footprint import grown_by_disc, minkowski_sums, rotation_core, rotation_hull
from regionik.planners.driving.footprint_scene import (
    FootprintScene,
    core_edges,
    edges_of,
    footprint_scene,
)
from regionik.planners.geometry.polygons import FlatPolygon
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.obstacles import Shadow

SIDES = 48  # of the polygons that stand for discs
MOST_WALLS = 12  # directions of walls that exact headings are taken from, the longest


@dataclass(frozen=True, eq=False)
class Slab:
    """Free area of a footprint's reference point while the heading is between two bounds.

    Attributes
    ----------
    low, high : float
        [rad]
    inner : Polygon or MultiPolygon
        The footprint is free at every point of it at every heading of the slab; may be empty.
    outer : Polygon or MultiPolygon
        The footprint is free at no point outside it at any heading of the slab.
    """

    low: float
    high: float
    inner: BaseGeometry
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
    if count < 1:
        raise InputError(f"slabs: expected at least 1, got {count}")
    ends = (np.arange(count + 1) - 0.5) * (2 * np.pi / count)
    return np.column_stack([ends[:-1], ends[1:]])


def slabs_along(scene: FootprintScene, count: int, walls: int = MOST_WALLS) -> Array:
    """Cut a full turn in slabs, some of no width: headings at which a side of the footprint is along a wall.

    A footprint goes through its tightest passages with a side along the wall; a slab of no width is exact.

    Parameters
    ----------
    scene : FootprintScene
    count : int
        Of equal slabs.
    walls : int
        From how many directions of walls, the longest, headings are taken.

    Returns
    -------
    (n, 2) array
        Lowest and highest heading; each slab begins where the one before it ends [rad].
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
    """Headings with a side of the footprint along one of the longest walls."""
    along = scene.edges[:, 2:] - scene.edges[:, :2]
    lengths = np.hypot(*along.T)
    angles = np.mod(np.arctan2(along[:, 1], along[:, 0]), np.pi)
    walls, which = np.unique(angles.round(6) % np.pi, return_inverse=True)
    longest = np.argsort(-np.bincount(which, lengths), kind="stable")[:most]
    # The angle itself, not the one rounded to group walls by.
    walls = np.array([angles[which == w][np.argmax(lengths[which == w])] for w in longest])
    corners = scene.corners
    if len(corners) < 2:
        return np.zeros(0)
    sides = np.arctan2(*(np.roll(corners, -1, axis=0) - corners).T[::-1])
    headings: Array = (walls[:, None, None] - sides[:, None] + [0.0, np.pi]).ravel()
    return headings


def slab_areas(
    footprint: ArrayLike,
    floor: Polygon | MultiPolygon,
    obstacles: Sequence[Shadow],
    clearance: float,
    bounds: ArrayLike,
) -> tuple[Slab, ...]:
    """`slab_free` for many slabs, (n, 2) lowest and highest headings [rad]."""
    scene = _convex_scene(footprint, floor, obstacles, clearance)
    return tuple(_slab(scene, low, high) for low, high in frozen(bounds, (None, 2), "slabs").tolist())


def slab_free(
    footprint: ArrayLike,
    floor: Polygon | MultiPolygon,
    obstacles: Sequence[Shadow],
    clearance: float,
    low: float,
    high: float,
    sides: int = SIDES,
) -> Slab:
    """Free area of a footprint while its heading is between two bounds.

    Parameters
    ----------
    footprint : (n, 2) array_like
        Corners of a convex outline in the base frame, or one point; the origin may lie anywhere [m].
    floor : Polygon or MultiPolygon
        The whole footprint stays inside [m].
    obstacles : sequence of Shadow
        The footprint keeps ``clearance`` from each of them.
    clearance : float
        [m]
    low, high : float
        Headings, the same or rising [rad].
    sides : int
        Of the polygons that stand for discs.

    Returns
    -------
    Slab

    Raises
    ------
    InputError
        When the footprint is not convex, the clearance is negative or the headings fall.

    Examples
    --------
    >>> from shapely import box
    >>> long = [[0.3, -0.1], [0.3, 0.1], [-0.3, 0.1], [-0.3, -0.1]]
    >>> slab = slab_free(long, box(0, 0, 2, 0.3), [], 0.0, -0.1, 0.1)
    >>> [round(area.area, 3) for area in (slab.inner, slab.outer)]
    [0.057, 0.142]
    """
    return _slab(_convex_scene(footprint, floor, obstacles, clearance, sides), low, high)


class _ConvexScene(NamedTuple):
    """Footprint and surroundings, the same for all slabs.

    Attributes
    ----------
    corners : (n, 2) array
        Of the footprint [m].
    floor : Polygon or MultiPolygon
    covered : geometry
        Obstacles that are not convex, or have no area.
    pieces : tuple
        By clearance [m] the corners of convex pieces that the footprint keeps it from.
    sides : int
        Of the polygons that stand for discs.
    """

    corners: Array
    floor: BaseGeometry
    covered: BaseGeometry
    pieces: tuple[tuple[float, list[Array]], ...]
    sides: int


def _convex_scene(
    footprint: ArrayLike,
    floor: Polygon | MultiPolygon,
    obstacles: Sequence[Shadow],
    clearance: float,
    sides: int = SIDES,
) -> _ConvexScene:
    corners = footprint_scene(footprint, floor, obstacles, clearance).corners
    edges = [(edge.reshape(2, 2), 0.0) for edge in core_edges(floor)]
    solids = [
        (core, clearance + shadow.radius) for shadow in obstacles for core in shapely.get_parts(shadow.core)
    ]
    convex = [(shapely.get_coordinates(core), keep) for core, keep in solids if _is_convex(core)]
    rest = [(core, keep) for core, keep in solids if not _is_convex(core)]
    edges += [(edge.reshape(2, 2), keep) for core, keep in rest for edge in core_edges(core)]
    pieces: dict[float, list[Array]] = {}
    for piece, keep in (*edges, *convex):
        pieces.setdefault(keep, []).append(piece)
    covered = shapely.union_all([core for core, _ in rest])
    return _ConvexScene(corners, floor, covered, tuple(pieces.items()), sides)


def _is_convex(core: BaseGeometry) -> bool:
    """True if a part of a shadow is its own hull, as a point is and a bent line is not."""
    hull = shapely.convex_hull(core)
    return bool(hull.geom_type == core.geom_type and hull.area - core.area <= 1e-12 * hull.area)


def _slab(scene: _ConvexScene, low: float, high: float) -> Slab:
    if not -np.inf < low <= high < np.inf:
        raise InputError(f"slab: expected two rising headings, got {low} and {high}")
    corners = scene.corners
    inner = _positions(scene, rotation_hull(corners, low, high), inner=True)
    shared = rotation_core(corners, low, high)
    if len(shared):
        return Slab(low, high, inner, _positions(scene, shared, inner=False))
    # The rotations have no point in common. Those about the footprint's middle have, and it keeps to an arc.
    middle = corners.mean(axis=0)
    about = _positions(scene, rotation_core(corners - middle, low, high), inner=False)
    return Slab(low, high, inner, _sum(about, -rotation_hull(middle[None], low, high)))


class Rejection(NamedTuple):
    """Positions that a convex shape may not take, as floor and forbidden pieces.

    Attributes
    ----------
    floor : Polygon or MultiPolygon
        One point of the shape is on the floor, and not in an obstacle that is not convex.
    taken : array of Polygon
        An edge of floor or obstacles comes too near to it.
    """

    floor: BaseGeometry
    taken: NDArray[np.object_]


def slab_rejections(
    footprint: ArrayLike,
    floor: Polygon | MultiPolygon,
    obstacles: Sequence[Shadow],
    clearance: float,
    bounds: ArrayLike,
) -> tuple[Rejection, ...]:
    """Floor and forbidden pieces, of which each inner area is the difference; see `slab_areas`."""
    scene = _convex_scene(footprint, floor, obstacles, clearance)
    shapes = [
        rotation_hull(scene.corners, low, high) for low, high in frozen(bounds, (None, 2), "slabs").tolist()
    ]
    return tuple(_rejection(scene, shape, inner=True) for shape in shapes)


def _positions(scene: _ConvexScene, shape: Array, *, inner: bool) -> BaseGeometry:
    """Positions at which a convex shape lies on the floor and keeps its distance from the obstacles."""
    here, taken = _rejection(scene, shape, inner=inner)
    parts = shapely.get_parts(shapely.difference(here, shapely.union_all(taken)))
    whole: BaseGeometry = shapely.union_all(parts[shapely.area(parts) > 0])
    return whole


def _rejection(scene: _ConvexScene, shape: Array, *, inner: bool) -> Rejection:
    """Floor and forbidden pieces: a shape is free where one point of it is and no edge comes too near."""
    point = shape.mean(axis=0)
    met = [
        minkowski_sums(pieces, grown_by_disc(-shape, keep, scene.sides, outside=inner))
        for keep, pieces in scene.pieces
    ]
    solid = np.concatenate(met)
    here, covered = (shapely.transform(g, lambda p: p - point) for g in (scene.floor, scene.covered))
    floor = shapely.difference(here, covered) if not covered.is_empty else here
    return Rejection(floor, solid[shapely.area(solid) > 0])


def _sum(area: BaseGeometry, shape: Array) -> BaseGeometry:
    """Minkowski sum of an area and a convex shape: the area moved by a corner, its edges by all of it."""
    if area.is_empty:
        return area
    ends = edges_of(FlatPolygon.from_shapely(area))
    spots = np.concatenate([ends[:, None, :2] + shape, ends[:, None, 2:] + shape], axis=1)
    grown = shapely.convex_hull(shapely.multipoints(spots))
    whole: BaseGeometry = shapely.union_all([shapely.transform(area, lambda p: p + shape[0]), *grown])
    return whole
