"""Steps of a target or an obstacle that may mend a failure: directions, the longest, and a test by areas."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Point
from shapely.ops import nearest_points

from regionik.areas.free_space import MIN_AREA
from regionik.areas.layers import ROUNDING_MARGIN, grow
from regionik.explain.changes import Move
from regionik.explain.constraints import without_obstacle
from regionik.explain.minimal_change import Opens, circle, sphere
from regionik.explain.options import EXPLAIN
from regionik.regions import have_known_places, path_areas
from regionik.scene import Scene
from regionik.worlds.arms import reach_bound
from regionik.worlds.arrays import Array

OPTIONS = EXPLAIN.questions


@dataclass(frozen=True)
class Steps:
    """Steps tested by areas: their directions, the longest, and the test whether each helps."""

    directions: Array
    most: float
    opens: Opens


def target_steps(move: Move) -> Steps:
    """Steps of a target: in space where areas are exact, else over the floor."""
    scene, exact = move.scene, move.scene.model(move.scene.task[0]).exact
    around = np.column_stack([circle(32), np.zeros(32)])
    directions = [_inwards(scene), around, sphere(48)] if exact else [_inwards(scene), around]
    return Steps(np.vstack(directions), _farthest(scene), _opens(move, space=exact))


def steps_around(move: Move) -> tuple[Steps, tuple[float, ...]]:
    """Steps of a target in space and their lengths: to the free floor, up, down, level and oblique."""
    scene, proven = move.scene, move.scene.model(move.scene.task[0]).is_proven(move.scene.rules)
    level = np.column_stack([circle(8 if proven else 4), np.zeros(8 if proven else 4)])
    upright = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    oblique = [(level + way) / np.sqrt(2) for way in upright] if proven else []
    lengths = OPTIONS.target_lengths if proven else OPTIONS.sampled_target_lengths
    return Steps(
        np.vstack([_inwards(scene), upright, level, *oblique]), lengths[-1], _opens(move, space=True)
    ), lengths


def scene_of_setpoint(scene: Scene, i: int) -> Scene:
    """The world of one set-point alone; of a crowded map only what is near it, however a repair moves it.

    Obstacles that are moved come from there: they are near the set-point, or are no cause.
    """
    alone = scene.changed(task=(scene.task[i],))
    return alone.within_reach(alone.task[0].position[None], max(OPTIONS.target_lengths[-1], _farthest(alone)))


def _opens(move: Move, *, space: bool) -> Opens:
    """Test by areas whether steps of a target help, over the floor only or in space."""
    scene, target = move.scene, move.scene.task[0]

    def opens(steps: Array) -> NDArray[np.bool_]:
        places = target.position + (steps if space else steps * [1.0, 1.0, 0.0])
        found = have_known_places(scene, [replace(target, position=place) for place in places])
        found[places[:, 2] < 0] = False
        for k in np.flatnonzero(found):
            found[k] = all(solid.distance(places[k]) >= 0 for solid in scene.world.solids)
        return found

    return opens


def _farthest(scene: Scene) -> float:
    """Length of a move that brings the target next to the arm, wherever that may stand [m]."""
    span, target = reach_bound(scene.robot.chain), scene.task[0].position
    off = float(scene.world.open_floor.distance(Point(target[:2])))
    height = abs(float(target[2] - scene.robot.mount[2]) - span.height)
    return off + height + 2 * (span.radius + span.length)


def _inwards(scene: Scene) -> Array:
    """Direction straight to the free floor, (0 or 1, 3)."""
    free, target = scene.ground.inner.free, scene.task[0].position
    if free.is_empty:
        return np.empty((0, 3))
    there = np.array(nearest_points(free, Point(target[:2]))[0].coords[0])
    way = np.array([*(there - target[:2]), 0.0])
    length = float(np.linalg.norm(way))
    return way[None] / length if length > EXPLAIN.grid else np.empty((0, 3))


def obstacle_steps(move: Move) -> Steps | None:
    """Steps of an obstacle over the floor, off the places there would be without it; None without any."""
    scene, ground = move.scene, move.scene.ground
    solid = next(solid for solid in scene.world.obstacles if solid.name == move.name)
    shadow = solid.shadow(scene.robot.body_height, above=0.0)
    areas = path_areas(without_obstacle(scene, move.name), scene.task)
    room = shapely.union_all(areas.inner[shapely.area(areas.inner) > MIN_AREA])
    if shadow is None or room.is_empty:
        return None
    taken = grow(shadow, scene.world.base_clearance_from(solid) + ground.far + ROUNDING_MARGIN, inner=True)
    spot = scene.task[0].position

    def opens(steps: Array) -> NDArray[np.bool_]:
        moved = np.array([shapely.transform(taken, lambda xy, by=by: xy + by) for by in steps], dtype=object)
        found: NDArray[np.bool_] = shapely.area(shapely.difference(room, moved)) > MIN_AREA
        for k in np.flatnonzero(found):
            found[k] = solid.distance(spot - [*steps[k], 0.0]) >= 0
        return found

    low_x, low_y, high_x, high_y = room.union(taken).bounds
    return Steps(circle(32), float(np.hypot(high_x - low_x, high_y - low_y)), opens)
