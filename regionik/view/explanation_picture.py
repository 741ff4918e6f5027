"""The picture of an explanation: the target, its obstacles, areas before and after a repair, and arrows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from regionik.explain.changes import repaired
from regionik.regions import admissible_area, reach_of
from regionik.view.picture import Color, Picture, SceneMesh
from regionik.view.triangle_meshes import arrow, obstacle_mesh, outline, spheres
from regionik.view.world_picture import DETAIL, MARK_RADIUS, floor_layer, picture_of_world
from regionik.worlds.errors import Explanation
from regionik.worlds.obstacles import Solid
from regionik.worlds.scene import Target, World

_SHAFT = 0.008  # radius of arrows [m]


def picture_of_explanation(world: World, explanation: Explanation, target: Target | None = None) -> Picture:
    """The picture of why a target or a path is out of reach.

    Parameters
    ----------
    world : World
    explanation : Explanation
    target : Target, optional
        The one explained; by default the set-point that the explanation names.
    """
    i = 0 if target is not None or explanation.setpoint is None else explanation.setpoint
    scene = world if target is None else replace(world, task=(target,))
    before = picture_of_world(scene)
    names = {cause.name for cause in explanation.causes if cause.kind == "obstacle"}
    causes = {f"obstacles/{k}" for k, solid in enumerate(scene.obstacles) if solid.name in names}
    bodies = [
        replace(body, color=Color.CAUSE, opacity=max(0.75, body.opacity)) if body.path in causes else body
        for body in before.bodies
    ]
    if explanation.setpoint is not None:
        bodies += [*_areas(scene, explanation, i), *_changes(scene, explanation, i)]
    blamed = ", ".join(cause.name for cause in explanation.causes)
    return replace(
        before,
        title=f"{world.name}: why not",
        facts=(f"in the way: {blamed}", *(repair.text for repair in explanation.repairs)),
        legend=(
            (Color.CAUSE, "what stands in the way; the set-point"),
            (Color.REPAIR, "what a repair moves"),
            (Color.PALE, "reach, were nothing in the way"),
            (Color.STRONG, "area after the smallest repair"),
            (Color.NAVIGABLE, "free floor"),
            (Color.REJECTION, "rejected: too close to a solid"),
            (Color.SOLID, "other obstacles"),
            (Color.AHEAD, "set-points"),
        ),
        bodies=tuple(bodies),
    )


def _areas(world: World, explanation: Explanation, i: int) -> Iterator[SceneMesh]:
    """Reach and area before, and the area after the smallest repair."""
    target = world.task[i]
    area = admissible_area(world, target).inner
    yield floor_layer("why/reach", reach_of(world, target).simplify(DETAIL), Color.PALE, 0.5, 3)
    yield floor_layer("why/before", area.simplify(DETAIL), Color.STRONG, 0.4, 4)
    if explanation.repairs:
        mended = repaired(world, explanation.repairs[0], i)
        after = admissible_area(mended, mended.task[i]).inner
        # The area after a smallest repair is next to nothing: a rim makes it visible.
        yield floor_layer("why/after", after.buffer(0.01).simplify(DETAIL), Color.STRONG, 0.85, 5)


def _changes(world: World, explanation: Explanation, i: int) -> Iterator[SceneMesh]:
    """The set-point, and targets and obstacles where repairs move them, with arrows."""
    position = world.task[i].position
    yield SceneMesh("why/target", spheres(position[None], 1.8 * MARK_RADIUS), Color.CAUSE)
    for k, repair in enumerate(explanation.repairs):
        if repair.kind == "move-target":
            start, move = position, np.array(repair.vector)
            moved = SceneMesh(
                f"why/moved {k}", spheres((start + move)[None], 1.5 * MARK_RADIUS), Color.REPAIR
            )
        elif repair.kind == "move-obstacle":
            before, after = (_obstacle(one, repair.name) for one in (world, repaired(world, repair)))
            center = outline(before).centroid
            start = np.array([center.x, center.y, before.z_range[1] + 3 * _SHAFT])  # above the obstacle
            move = np.array([*repair.vector, 0.0])
            moved = SceneMesh(f"why/moved {k}", obstacle_mesh(after), Color.REPAIR, 0.35)
        else:
            continue
        yield SceneMesh(f"why/move {k}", arrow(start, start + move, _SHAFT), Color.REPAIR)
        yield moved


def _obstacle(world: World, name: str) -> Solid:
    return next(solid for solid in world.obstacles if solid.name == name)
