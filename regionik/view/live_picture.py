"""The picture of a look at a world: its areas, and which set-points have none."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import grow, shadow_of
from regionik.view import triangle_meshes
from regionik.view.live_areas import Look
from regionik.view.picture import AHEAD, FLOOR, MISSING, NAVIGABLE, PALE, PATH, REJECTED, STRONG, Body
from regionik.view.world_picture import BALL, DETAIL, grey, layer, map_bodies
from regionik.worlds.obstacles import Solid
from regionik.worlds.scene import Floor, World

Mask = NDArray[np.bool_]


def look_bodies(look: Look) -> list[Body]:
    """Floor, solids with what they forbid, areas, and the tool path; the robot is for others to draw.

    Bodies of what has not changed since the look before are the very same objects.
    """
    world = look.world
    found = [*_floor(world.floor)]
    far = float(np.hypot(*world.robot.footprint.T).max())
    for k, solid in enumerate(world.obstacles):
        found += _solid(solid, k, world.robot.body_height, world.rules.clearance + far)
    return [*found, *_areas(look), *_task(world, _without(look))]


def verdict(look: Look) -> str:
    """The verdict in words, on one line."""
    if look.why is not None:
        return look.why.reason
    assert look.pruned is not None
    count, lifts = len(look.world.task), len(look.pruned.breaks)
    how = "without lifting the tool" if not lifts else f"with {lifts} lift-off{'s' * (lifts > 1)}"
    return f"All {count} set-points can be reached, {how}; whether the arm touches anything, a plan will say."


@lru_cache(maxsize=4)
def _floor(floor: Floor) -> tuple[Body, ...]:
    return (
        Body("floor/all", triangle_meshes.flat(floor.polygon), FLOOR, 1.0, 0),
        layer("floor/free", floor.polygon, NAVIGABLE, 0.55, 1),
        *map_bodies(floor),
    )


@lru_cache(maxsize=4096)
def _solid(solid: Solid, k: int, height: float, by: float) -> tuple[Body, ...]:
    """A solid and what it keeps the base off, painted opaque: two of them may overlap."""
    shadow = shadow_of(solid, height)
    body = grey(f"obstacles/{k}", triangle_meshes.solid(solid), solid.z_range[1])
    if shadow is None:
        return (body,)
    kept_off = grow(shadow, by, inner=False).simplify(DETAIL)
    return body, layer(f"floor/rejected/{k}", kept_off, REJECTED, 1.0, 2)


def _areas(look: Look) -> list[Body]:
    rows = look.areas
    every = shapely.union_all(rows.inner).simplify(DETAIL) if len(rows.inner) else shapely.Polygon()
    strong: BaseGeometry = shapely.Polygon()
    if look.pruned is not None:
        kept = look.pruned.ladder.component[look.pruned.keep]
        strong = shapely.union_all(kept).simplify(DETAIL)
    return [
        layer("areas/pale", every - strong, PALE, 0.8, 3),
        layer("areas/strong", strong, STRONG, 0.62, 4),
    ]


def _without(look: Look) -> Mask:
    """Whether set-points have no area at all, (n,)."""
    some = look.areas.target[~shapely.is_empty(look.areas.inner)]
    none = np.ones(len(look.world.task), dtype=bool)
    none[some] = False
    return none


def _task(world: World, none: Mask) -> list[Body]:
    points = np.array([target.position for target in world.task]).reshape(-1, 3)
    bodies = (
        [Body("task/path", triangle_meshes.tubes(points, 0.004), PATH, lit=False)] if len(points) > 1 else []
    )
    marks = (("task/ahead", ~none, AHEAD, 1.0), ("task/missing", none, MISSING, 1.6))
    return [
        *bodies,
        *(
            Body(path, triangle_meshes.balls(points[on], size * BALL), color)
            for path, on, color, size in marks
            if on.any()
        ),
    ]
