"""Paths of a footprint that moves in any direction: it turns to pass where its circle would not."""

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
from regionik.planners.driving.footprint import footprint_width
from regionik.planners.driving.footprint_scene import fits, footprint_scene
from regionik.planners.driving.heading_slabs import Slab, slab_areas, slabs_along
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.driving.pose_planner import direct, plan_poses, pose_text, shortcut
from regionik.planners.driving.slab_roadmap import connected, nodes_at, path_through_slabs, polygon_parts
from regionik.planners.driving.steering import NEGLIGIBLE, SLIDE, Steering
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.obstacles import Shadow

SLABS = 48  # of heading, in the search that answers where sampling gave up or wandered
GOOD = 1.5  # a path at most so much dearer than the straight one is kept without the slabs
HALVINGS = 24  # of the bisection for the narrowest passage


@dataclass(frozen=True, eq=False)
class FootprintPath:
    """Path of an omnidirectional base from one pose to another.

    Attributes
    ----------
    poses : (k, 3) array
        x, y [m], yaw [rad]; between neighbours the base goes straight and turns evenly the shorter way, and
        each such motion is proven free.
    method : {"straight", "ompl", "slabs"}
        What found it. "slabs" is the roadmap of areas by heading, where RRTConnect gave up or wandered.
    """

    poses: Array
    method: Literal["straight", "ompl", "slabs"]


class NarrowPassageError(NoPathError):
    """The base does not pass.

    Attributes
    ----------
    passage : float
        Width of the narrowest place on the widest route, clearance taken off; 0 where there is none [m].
    across : float
        Smallest width of the footprint [m].
    proven : bool
        True if there is no path, False if none was found.
    """

    def __init__(
        self, reason: str, start: Array, goal: Array, passage: float, across: float, proven: bool
    ) -> None:
        super().__init__(reason, start, goal)
        self.passage = passage
        self.across = across
        self.proven = proven


def drive_footprint(
    footprint: ArrayLike,
    floor: Polygon | MultiPolygon,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    obstacles: Sequence[Shadow] = (),
    clearance: float = 0.0,
    seed: int,
) -> FootprintPath:
    """Drive a footprint that can move in any direction and turn on the way.

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
        Of the sampling planner, 0 or above. Same input, same path.

    Returns
    -------
    FootprintPath

    Raises
    ------
    NarrowPassageError
        When there is no path, or none was found; the message gives the width of the narrowest place and that
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
    >>> drive_footprint(long, corridor, [0.5, 1, 1.57], [3.5, 0.95, 0], seed=0).method
    'ompl'
    """
    if seed < 0:
        raise InputError(f"seed: expected a whole number from 0 up, got {seed}")
    a, b = np.array(frozen(start, (3,), "start")), np.array(frozen(goal, (3,), "goal"))
    scene = footprint_scene(footprint, floor, obstacles, clearance)
    for what, pose in (("start", a), ("goal", b)):
        if not fits(scene, *pose):
            raise NoPathError(f"{what} {pose_text(pose)}: the footprint does not fit there", a[:2], b[:2])
    if np.hypot(*(b - a)[:2]) <= NEGLIGIBLE and abs(wrapped(b[2] - a[2])) <= NEGLIGIBLE:
        return FootprintPath(frozen([a], (None, 3), "path"), "straight")
    # A turn costs what it moves the outermost corner by.
    base = Steering(SLIDE, 0.0, float(np.hypot(*scene.corners.T).max()))
    if direct(scene, base, a, b) is not None:
        return FootprintPath(frozen([a, b], (None, 3), "path"), "straight")
    found, cost = plan_poses(scene, base, a, b, seed)
    straight = float(np.hypot(*(b - a)[:2]) + base.weight * abs(wrapped(b[2] - a[2])))
    if found is not None and cost <= GOOD * straight:
        return FootprintPath(frozen(found, (None, 3), "path"), "ompl")
    areas = slab_areas(footprint, floor, obstacles, clearance, slabs_along(scene, SLABS))
    other = path_through_slabs(scene, areas, a, b, seed)
    if other is not None:
        other, least = shortcut(scene, base, other)
        if least < cost:
            return FootprintPath(frozen(other, (None, 3), "path"), "slabs")
    if found is None:
        raise _refusal(footprint, floor, obstacles, clearance, areas, (a, b))
    return FootprintPath(frozen(found, (None, 3), "path"), "ompl")


def passage_width(free: BaseGeometry, start: BaseGeometry, goal: BaseGeometry) -> float:
    """Largest diameter of a disc that moves inside ``free`` from touching one shape to touching another [m].

    Examples
    --------
    >>> from shapely import box
    >>> hourglass = box(0, 0, 2, 2) | box(1.9, 0.7, 3, 1.2) | box(2.9, 0, 5, 2)
    >>> round(passage_width(hourglass, Point(1, 1), Point(4, 1)), 4)
    0.5
    """
    low, high = 0.0, float(shapely.maximum_inscribed_circle(free).length)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        parts = shapely.get_parts(free.buffer(-middle, quad_segs=32))
        # The disc may stand anywhere near a shape: the passage counts, not how narrow it is at its ends.
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
) -> NarrowPassageError:
    """Error with the widths of the narrowest place and of the footprint."""
    a, b = ends
    grown = [s.core.buffer(clearance + s.radius) if clearance + s.radius > 0 else s.core for s in obstacles]
    spots = (Point(a[:2]), Point(b[:2]))
    passage = passage_width(shapely.difference(floor, shapely.union_all(grown)), *spots)
    across = footprint_width(footprint)
    graph = [polygon_parts(slab.outer) for slab in areas]
    proven = not connected(graph, *(nodes_at(areas, graph, pose) for pose in ends))
    what = "no way" if proven else "no way was found"
    where = f"from {pose_text(a)} to {pose_text(b)}"
    if passage < across:
        why = f"its narrowest place is {passage:.3f} m wide, the footprint nowhere less than {across:.3f} m"
    else:
        why = (
            f"its narrowest place is {passage:.3f} m wide and the footprint only {across:.3f} m across, but "
            "too long for the bends on the way"
        )
    return NarrowPassageError(f"{what} {where}: {why}", a[:2], b[:2], passage, across, proven)
