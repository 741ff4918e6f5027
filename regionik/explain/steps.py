"""Steps of a target or an obstacle as areas see them: directions, how far, and which of many help."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Point
from shapely.ops import nearest_points

from regionik.areas.ground import GUARD, ground_of, grow
from regionik.areas.reachable import model_of
from regionik.areas.standing import LEAST_AREA
from regionik.explain.causes import opened
from regionik.explain.changes import Move
from regionik.explain.minimal_change import FINE, Opens, circle, sphere
from regionik.explain.relaxations import without_obstacle
from regionik.regions import path_areas
from regionik.worlds.arms import reach_bound
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World


@dataclass(frozen=True)
class Steps:
    """Steps that are looked at by areas: in which directions, how far, and whether each helps."""

    directions: Array
    most: float
    opens: Opens


def target_steps(move: Move) -> Steps:
    """Of a target: in space where areas are exact, else over the floor."""
    world, target = move.world, move.world.task[0]
    exact = model_of(world, target).exact

    def opens(steps: Array) -> NDArray[np.bool_]:
        places = target.position + (steps if exact else steps * [1.0, 1.0, 0.0])
        found = opened(world, [replace(target, position=place) for place in places])
        found[places[:, 2] < 0] = False
        for k in np.flatnonzero(found):
            found[k] = all(solid.distance(places[k]) >= 0 for solid in world.solids)
        return found

    around = np.column_stack([circle(32), np.zeros(32)])
    directions = [_inwards(world), around, sphere(48)] if exact else [_inwards(world), around]
    return Steps(np.vstack(directions), _farthest(world), opens)


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


def obstacle_steps(move: Move) -> Steps | None:
    """Of an obstacle: over the floor, off the places there would be without it; None where none are."""
    world, ground = move.world, ground_of(move.world)
    solid = next(solid for solid in world.obstacles if solid.name == move.name)
    shadow = solid.shadow(world.robot.body_height)
    areas = path_areas(without_obstacle(world, move.name), world.task)
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
    return Steps(circle(32), float(np.hypot(high_x - low_x, high_y - low_y)), opens)
