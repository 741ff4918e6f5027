"""The picture of a no: the target, what stands in the way, the area before and after a repair, and arrows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from regionik.explain.changes import repaired
from regionik.regions import admissible_area, reach_of
from regionik.view import triangle_meshes
from regionik.view.camera import camera_for
from regionik.view.picture import (
    AHEAD,
    CAUSE,
    MENDED,
    NAVIGABLE,
    PALE,
    REJECTION,
    SOLID,
    STRONG,
    Body,
    Picture,
)
from regionik.view.world_picture import BALL, DETAIL, extent, first_posture, layer, robot_bodies, world_bodies
from regionik.worlds.errors import Explanation, Repair
from regionik.worlds.obstacles import Solid
from regionik.worlds.scene import Target, World

_SHAFT = 0.008  # radius of arrows [m]


def picture_of_why(world: World, why: Explanation, target: Target | None = None) -> Picture:
    """What there is to see of a no.

    Parameters
    ----------
    world : World
    why : Explanation
    target : Target, optional
        What was asked for; by default the set-point that the explanation names.
    """
    i = 0 if target is not None or why.setpoint is None else why.setpoint
    scene = world if target is None else replace(world, task=(target,))
    base, joints = first_posture(scene)
    robot, poses = robot_bodies(scene.robot, base, joints)
    names = {cause.name for cause in why.causes if cause.kind == "obstacle"}
    marked = {f"obstacles/{k}" for k, solid in enumerate(scene.obstacles) if solid.name in names}
    bodies = [
        replace(body, color=CAUSE, opacity=max(0.75, body.opacity)) if body.path in marked else body
        for body in world_bodies(scene)
    ]
    camera = camera_for(scene, base[None, :2])
    shown = (*_areas(scene, why, i), *_changes(scene, why, i)) if why.setpoint is not None else ()
    blame = ", ".join(cause.name for cause in why.causes)
    return Picture(
        title=f"{world.name}: why not",
        facts=(f"in the way: {blame}", *(repair.text for repair in why.repairs)),
        legend=(
            (CAUSE, "what stands in the way; the set-point"),
            (MENDED, "what a repair moves"),
            (PALE, "reach, were nothing in the way"),
            (STRONG, "area after the smallest repair"),
            (NAVIGABLE, "free floor"),
            (REJECTION, "rejected: too close to a solid"),
            (SOLID, "other obstacles"),
            (AHEAD, "set-points"),
        ),
        bodies=(*bodies, *robot, *shown),
        poses=poses,
        camera=camera,
        extent=extent(scene, camera),
    )


def _areas(world: World, why: Explanation, i: int) -> Iterator[Body]:
    """Reach and area before, area after the smallest repair."""
    target = world.task[i]
    yield layer("why/reach", reach_of(world, target).simplify(DETAIL), PALE, 0.5, 3)
    yield layer("why/before", admissible_area(world, target).inner.simplify(DETAIL), STRONG, 0.4, 4)
    if why.repairs:
        mended = repaired(world, why.repairs[0], i)
        after = admissible_area(mended, mended.task[i]).inner
        # What is left of a smallest repair is next to nothing: a rim makes it seen.
        yield layer("why/after", after.buffer(0.01).simplify(DETAIL), STRONG, 0.85, 5)


def _changes(world: World, why: Explanation, i: int) -> Iterator[Body]:
    """The set-point, where it would move to, and obstacles where they would."""
    spot = world.task[i].position
    yield Body("why/target", triangle_meshes.balls(spot[None], 1.8 * BALL), CAUSE)
    for k, repair in enumerate(why.repairs):
        if repair.kind == "move-target":
            there = spot + np.array(repair.vector)
            yield Body(f"why/move {k}", triangle_meshes.arrow(spot, there, _SHAFT), MENDED)
            yield Body(f"why/moved {k}", triangle_meshes.balls(there[None], 1.5 * BALL), MENDED)
        elif repair.kind == "move-obstacle":
            yield from _moved(world, repair, k)


def _moved(world: World, repair: Repair, k: int) -> Iterator[Body]:
    """An obstacle where a repair puts it, and the arrow over its top from here to there."""
    before, after = (_named(one, repair.name) for one in (world, repaired(world, repair)))
    center = triangle_meshes.outline(before).centroid
    top = np.array([center.x, center.y, before.z_range[1] + 3 * _SHAFT])
    yield Body(f"why/move {k}", triangle_meshes.arrow(top, top + [*repair.vector, 0.0], _SHAFT), MENDED)
    yield Body(f"why/moved {k}", triangle_meshes.solid(after), MENDED, 0.35)


def _named(world: World, name: str) -> Solid:
    return next(solid for solid in world.obstacles if solid.name == name)
