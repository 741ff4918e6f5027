"""Drives of a base that goes every way and has a shape: it turns so as to pass where its circle would not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry import MultiPolygon, Point, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.planners.driving.arcs import wrapped
from regionik.planners.driving.footprint_scene import fits, room_of
from regionik.planners.driving.heading_slabs import Slab, slab_areas, slabs_along, width_of
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.driving.pose_planner import direct, find, shortened
from regionik.planners.driving.slab_roadmap import joined, nodes, parts, through
from regionik.planners.driving.steering import NOTHING, SLIDE, Base
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.obstacles import Shadow

SLABS = 48  # of heading, in the search that answers where sampling gave up or wandered
GOOD = 1.5  # a way so much dearer than the straight one is not bettered by slabs
HALVINGS = 24  # in the search for the narrowest place


@dataclass(frozen=True, eq=False)
class ShapeDrive:
    """How a base that goes every way gets from one pose to another.

    Attributes
    ----------
    poses : (k, 3) array
        x, y [m], yaw [rad]; between neighbours the base goes straight and turns evenly, the shorter way, and
        each such motion is proven free.
    method : {"straight", "ompl", "slabs"}
        What found it. "slabs" is the search through areas by heading where RRTConnect gave up or wandered.
    """

    poses: Array
    method: Literal["straight", "ompl", "slabs"]


class TightSpotError(NoPathError):
    """The base does not pass.

    Attributes
    ----------
    passage : float
        Width of the narrowest place on the widest way, clearance taken off; 0 where there is no way [m].
    across : float
        Smallest width of the footprint [m].
    proven : bool
        Whether there is no way; else none was found.
    """

    def __init__(
        self, reason: str, start: Array, goal: Array, passage: float, across: float, proven: bool
    ) -> None:
        super().__init__(reason, start, goal)
        self.passage = passage
        self.across = across
        self.proven = proven


def drive_shape(
    footprint: ArrayLike,
    floor: Polygon | MultiPolygon,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    obstacles: Sequence[Shadow] = (),
    clearance: float = 0.0,
    seed: int,
) -> ShapeDrive:
    """Drive a footprint that can go every way, turning as it goes.

    Parameters
    ----------
    footprint : (n, 2) array_like
        Corners of a convex outline in the base frame; the origin may lie anywhere [m].
    floor : Polygon or MultiPolygon
        The whole footprint stays inside [m].
    start, goal : (3,) array_like
        x, y [m], yaw [rad].
    obstacles : sequence of Shadow
        The footprint stays farther than ``clearance`` from each of them.
    clearance : float
        [m]
    seed : int
        Of the sampling planner, 0 or above. Same input, same drive.

    Returns
    -------
    ShapeDrive

    Raises
    ------
    TightSpotError
        When there is no way, or none was found; the message gives the width of the narrowest place and that
        of the footprint.
    NoPathError
        When the footprint does not fit at start or goal.
    InputError
        When the footprint is not convex, the seed or clearance is negative or a pose is not three numbers.

    Examples
    --------
    >>> from shapely import box
    >>> long = [[0.29, -0.19], [0.29, 0.19], [-0.29, 0.19], [-0.29, -0.19]]
    >>> corridor = box(0, 0, 2, 2) | box(1.9, 0.7, 4, 1.2)
    >>> drive_shape(long, corridor, [0.5, 1, 1.57], [3.5, 0.95, 0], seed=0).method
    'ompl'
    """
    if seed < 0:
        raise InputError(f"seed: expected a whole number from 0 up, got {seed}")
    a, b = np.array(frozen(start, (3,), "start")), np.array(frozen(goal, (3,), "goal"))
    room = room_of(footprint, floor, obstacles, clearance)
    for what, pose in (("start", a), ("goal", b)):
        if not fits(room, *pose):
            raise NoPathError(f"{what} {_at(pose)}: the footprint does not fit there", a[:2], b[:2])
    if np.hypot(*(b - a)[:2]) <= NOTHING and abs(wrapped(b[2] - a[2])) <= NOTHING:
        return ShapeDrive(frozen([a], (None, 3), "drive"), "straight")
    # A turn costs what it moves the outermost corner by.
    base = Base(SLIDE, 0.0, float(np.hypot(*room.corners.T).max()))
    if direct(room, base, a, b) is not None:
        return ShapeDrive(frozen([a, b], (None, 3), "drive"), "straight")
    found, cost = find(room, base, a, b, seed)
    straight = float(np.hypot(*(b - a)[:2]) + base.weight * abs(wrapped(b[2] - a[2])))
    if found is not None and cost <= GOOD * straight:
        return ShapeDrive(frozen(found, (None, 3), "drive"), "ompl")
    areas = slab_areas(footprint, floor, obstacles, clearance, slabs_along(room, SLABS))
    other = through(room, areas, a, b, seed)
    if other is not None:
        other, least = shortened(room, base, other)
        if least < cost:
            return ShapeDrive(frozen(other, (None, 3), "drive"), "slabs")
    if found is None:
        raise _refusal(footprint, floor, obstacles, clearance, areas, (a, b))
    return ShapeDrive(frozen(found, (None, 3), "drive"), "ompl")


def narrowest(free: BaseGeometry, start: BaseGeometry, goal: BaseGeometry) -> float:
    """Largest diameter of a disc that gets from touching one shape to touching another inside ``free`` [m].

    Examples
    --------
    >>> from shapely import box
    >>> hourglass = box(0, 0, 2, 2) | box(1.9, 0.7, 3, 1.2) | box(2.9, 0, 5, 2)
    >>> round(narrowest(hourglass, Point(1, 1), Point(4, 1)), 4)
    0.5
    """
    low, high = 0.0, float(shapely.maximum_inscribed_circle(free).length)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        parts = shapely.get_parts(free.buffer(-middle, quad_segs=32))
        # The disc may stand anywhere near the shape: what counts is the way, not how tight it is at its ends.
        met = [shapely.distance(parts, shape) <= middle for shape in (start, goal)]
        low, high = (middle, high) if bool((met[0] & met[1]).any()) else (low, middle)
    return 2 * low


def _refusal(
    footprint: ArrayLike,
    floor: Polygon | MultiPolygon,
    obstacles: Sequence[Shadow],
    clearance: float,
    areas: Sequence[Slab],
    ends: tuple[Array, Array],
) -> TightSpotError:
    """Why there is no way, with the widths of place and footprint."""
    a, b = ends
    grown = [s.core.buffer(clearance + s.radius) if clearance + s.radius > 0 else s.core for s in obstacles]
    spots = (Point(a[:2]), Point(b[:2]))
    passage = narrowest(shapely.difference(floor, shapely.union_all(grown)), *spots)
    across = width_of(footprint)
    graph = [parts(slab.outer) for slab in areas]
    proven = not joined(graph, *(nodes(areas, graph, pose) for pose in ends))
    what = "no way" if proven else "no way was found"
    where = f"from {_at(a)} to {_at(b)}"
    if passage < across:
        why = f"its narrowest place is {passage:.3f} m wide, the footprint nowhere less than {across:.3f} m"
    else:
        why = (
            f"its narrowest place is {passage:.3f} m wide and the footprint only {across:.3f} m across, but "
            "too long for the bends on the way"
        )
    return TightSpotError(f"{what} {where}: {why}", a[:2], b[:2], passage, across, proven)


def _at(pose: Array) -> str:
    return f"({pose[0]:z.3f}, {pose[1]:z.3f}, {pose[2]:z.3f} rad)"
