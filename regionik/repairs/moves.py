"""The shortest moves of a target, or of an obstacle over the floor, that bring the target within reach."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Point
from shapely.ops import nearest_points

from regionik.areas.ground import GUARD, ground_of, grow
from regionik.areas.reachable import model_of
from regionik.areas.relaxations import with_obstacle_moved, with_target_moved, without_obstacle
from regionik.areas.standing import LEAST_AREA
from regionik.regions import path_areas
from regionik.repairs.least import FINE, Opens, circle, first_seen, shortest_step, sphere
from regionik.repairs.trials import checked, opened, sighted
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Repair
from regionik.worlds.pivoted_arm import reach_bound
from regionik.worlds.scene import World

_ROUND = 32  # directions on the floor
_SPHERE = 48
_FARTHER = 1.05  # than areas have it, from which on other directions are looked at


def target_moved(world: World, who: str) -> Repair | None:
    """The shortest move found that brings a world's one target within reach, or None.

    In all directions where areas are exact, else over the floor; not where they are looked for pose by pose.
    """
    target, model = world.task[0], model_of(world, world.task[0])
    if not model.proven:
        return None

    def opens(steps: Array) -> NDArray[np.bool_]:
        places = target.position + steps
        found = opened(world, [replace(target, position=place) for place in places])
        found[places[:, 2] < 0] = False
        for k in np.flatnonzero(found):
            found[k] = all(solid.distance(places[k]) >= 0 for solid in world.solids)
        return found

    around = np.column_stack([circle(_ROUND), np.zeros(_ROUND)])
    directions = np.vstack([around, sphere(_SPHERE)]) if model.exact else around
    by = _least(
        world,
        lambda by: with_target_moved(world, 0, by),
        opens if model.exact else lambda steps: opens(steps * [1.0, 1.0, 0.0]),
        np.vstack([_inwards(world), directions]),
        _farthest(world),
    )
    if by is None:
        return None
    return target_repair(who, by)


def target_repair(who: str, by: Array) -> Repair:
    """A target moved by (3,) [m], as a repair."""
    length = float(np.linalg.norm(by))
    text = f"move {who} by ({by[0]:z.4f}, {by[1]:z.4f}, {by[2]:z.4f}) m, {length:z.4f} m in all"
    return Repair("move-target", who, length, text, "m", tuple(by.tolist()))


def obstacle_moved(world: World, name: str) -> Repair | None:
    """The shortest move over the floor found for one obstacle that brings the target within reach, or None.

    Looked for where the base has room at every heading, or at the one that the rules fix.
    """
    solid = next((solid for solid in world.obstacles if solid.name == name), None)
    if solid is None:  # the cells of a map are nobody's to move
        return None
    shadow, ground = solid.shadow(world.robot.body_height), ground_of(world)
    areas = path_areas(without_obstacle(world, name), world.task)
    room = shapely.union_all(areas.inner[shapely.area(areas.inner) > LEAST_AREA])
    if shadow is None or room.is_empty:
        return None
    taken = grow(shadow, ground.clearance + ground.far + GUARD, inner=True)
    spot = world.task[0].position

    def opens(steps: Array) -> NDArray[np.bool_]:
        moved = np.array([shapely.transform(taken, lambda xy, by=by: xy + by) for by in steps], dtype=object)
        found: NDArray[np.bool_] = shapely.area(shapely.difference(room, moved)) > LEAST_AREA
        for k in np.flatnonzero(found):
            found[k] = solid.distance(spot - [*steps[k], 0.0]) >= 0
        return found

    low_x, low_y, high_x, high_y = room.union(taken).bounds
    most = float(np.hypot(high_x - low_x, high_y - low_y))
    by = _least(world, lambda by: with_obstacle_moved(world, name, by), opens, circle(_ROUND), most)
    if by is None:
        return None
    return obstacle_repair(name, by)


def obstacle_repair(name: str, by: Array) -> Repair:
    """An obstacle moved over the floor by (2,) [m], as a repair."""
    length = float(np.linalg.norm(by))
    text = f"move {name} by ({by[0]:z.4f}, {by[1]:z.4f}) m, {length:z.4f} m in all"
    return Repair("move-obstacle", name, length, text, "m", tuple(by.tolist()))


def _least(
    world: World, change: Callable[[Array], World], opens: Opens, directions: Array, most: float
) -> Array | None:
    """The shortest step found by areas, on the grid, and confirmed.

    Where it has to be longer than areas have it, for the arm would touch something, other directions are
    looked at with the arm.
    """
    step = shortest_step(opens, directions, most)
    if step is None:
        return None
    length, way = step
    first = _confirmed(world, change, way, length, most)
    longest = 2 * length if first is None else float(np.linalg.norm(first))
    if longest <= _FARTHER * length:
        return first
    aside = first_seen(opens, lambda by: sighted(world, change(on_grid(by))), directions, length, longest)
    second = None if aside is None else _confirmed(world, change, aside[1], aside[0], longest)
    return first if second is None else second


def _confirmed(
    world: World, change: Callable[[Array], World], way: Array, length: float, most: float
) -> Array | None:
    found = checked(world, lambda amount: change(on_grid(amount * way)), length, most)
    return None if found is None else on_grid(found * way)


def on_grid(step: Array) -> Array:
    """A step as it is told; adding zero makes no zero negative."""
    rounded: Array = np.round(np.round(step / FINE) * FINE, 6) + 0.0
    return rounded


def _farthest(world: World) -> float:
    """A move of the target that is long enough to bring it next to the arm, wherever that may stand [m]."""
    span, target = reach_bound(world.robot.chain), world.task[0].position
    off = float(world.floor.polygon.distance(Point(target[:2])))
    height = abs(float(target[2] - world.robot.mount[2]) - span.height)
    return off + height + 2 * (span.radius + span.length)


def _inwards(world: World) -> Array:
    """Straight to the free floor, (0 or 1, 3)."""
    free, target = ground_of(world).inner.free, world.task[0].position
    if free.is_empty:
        return np.empty((0, 3))
    there = np.array(nearest_points(free, Point(target[:2]))[0].coords[0])
    way = np.array([*(there - target[:2]), 0.0])
    length = float(np.linalg.norm(way))
    return way[None] / length if length > FINE else np.empty((0, 3))
