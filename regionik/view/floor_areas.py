"""What pictures show of the floor: where the base has room, and the areas that a plan uses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Point, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.postures.poses import axis_of
from regionik.scene import scene_of
from regionik.values import Plan, Stop
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

# Floor areas are drawn to this [m], before one is cut from another, so that no gap shows between them.
DETAIL = 0.002


class ShownFloor(NamedTuple):
    """Disjoint parts of the floor, by places of the arm's axis."""

    free: BaseGeometry  # the footprint has room at every heading
    turning: BaseGeometry  # it may have room at some
    rejected: BaseGeometry  # it has none at any heading, for solids or the floor's edge


def shown_floor(world: World, detail: float = DETAIL) -> ShownFloor:
    """The floor in the parts that pictures show, as fine as ``detail`` [m].

    No place in the part that is rejected is one where a plan that holds has its arm's axis: the part is
    drawn a little too small.
    """
    ground, floor = scene_of(world).ground, world.floor.polygon
    room = ground.outer.free
    rejected = shapely.simplify(shapely.buffer(floor - room, -detail), detail)
    turning: BaseGeometry = Polygon()
    if ground.far > ground.near:
        turning = shapely.simplify(shapely.buffer(room - ground.inner.free, -detail), detail)
        turning = shapely.buffer(turning, detail, quad_segs=2) & floor - rejected
    return ShownFloor(floor - rejected - turning, turning, rejected)


def rejected_words(world: World) -> str:
    """Words for places where the base has no room at any heading."""
    return "rejected: too close to a solid" + (
        " or the floor's edge" if scene_of(world).ground.near > 0 else ""
    )


def used_areas(plan: Plan) -> list[BaseGeometry]:
    """Areas of the set-points as far as the plan can use them.

    What is left of an area for the whole path, and of a plan that is not parked the whole components in
    which it has its arm's axis: ladders are those of a base that goes every way, and one on wheels, or a
    tracker, may work elsewhere.
    """
    if plan.stops:
        return [area.pruned for area in plan.areas]
    places = shapely.points(axis_of(plan.world.robot, np.array([one.base for one in plan.setpoints])))
    rolls, found = plan.world.robot.drive.rolls, []
    for area, place in zip(plan.areas, places, strict=False):
        parts = shapely.get_parts(area.admissible)
        held = parts[shapely.dwithin(parts, place, DETAIL)]
        holds = shapely.dwithin(area.pruned, place, DETAIL) and not rolls
        found.append(area.pruned if holds else shapely.union_all([area.pruned, *held]))
    return found


def area_words(plan: Plan) -> tuple[str, str]:
    """Words for areas that a plan can use, and for the rest of what is admissible."""
    rest = "admissible for some set-point"
    if plan.stops:
        return "places to park for the next set-points", rest
    if plan.world.robot.drive.rolls:
        return "areas that the plan works in", rest
    return "areas for the whole path", "admissible, but a dead end"


def axis_path(plan: Plan) -> Array:
    """Path of the arm's axis on the floor, (n, 2) [m]."""
    motion, drive = plan.motion, plan.world.robot.drive
    return axis_of(plan.world.robot, drive.sampled(motion.base, drive.cuts(motion.base)))


def parking_circles(world: World, stops: Sequence[Stop]) -> BaseGeometry:
    """Circles in which the arm's axis may park, one for each stop."""
    places = [Point(axis_of(world.robot, stop.base)) for stop in stops]
    return MultiPolygon([at.buffer(stop.tolerance) for at, stop in zip(places, stops, strict=True)])


def drawn_union(areas: Sequence[BaseGeometry], detail: float = DETAIL) -> BaseGeometry:
    """The union of many areas, as fine as it is drawn."""
    union = shapely.union_all([area.simplify(detail) for area in areas])
    # Overlapping rings leave thousands of holes: simplify and repair is far faster than to stay valid.
    return shapely.make_valid(union.simplify(detail, preserve_topology=False))
