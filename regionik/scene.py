"""A world prepared once: what the stages ask of it, each part made when it is first asked for."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.areas.free_space import FreeFloor, footprint_on, headings_of
from regionik.areas.ground import Ground, ground_from
from regionik.areas.lifted import LiftedBody
from regionik.areas.options import AREAS
from regionik.areas.reach_model import ReachModel
from regionik.areas.reachable import reach_model
from regionik.areas.surroundings import cut_to, is_large, region_in_reach
from regionik.areas.touching import without_rounding_margin
from regionik.planners.collision.robot_bodies import Bodies
from regionik.planners.driving.footprint import fits
from regionik.planners.driving.footprint_scene import FootprintScene
from regionik.postures.arm import goal_of
from regionik.postures.collision_checker import CollisionChecker, bodies_in, checker_at, checker_from
from regionik.worlds.arrays import Array, Mask
from regionik.worlds.body import with_lift
from regionik.worlds.errors import InputError
from regionik.worlds.prepared import Prepared
from regionik.worlds.robot import Robot, with_joint_margin
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from regionik.worlds.strokes import within_strokes

MAX_CUTS = 8  # of one scene to what is near some places, that are kept at a time
MAX_SCENES = 8  # of worlds that public functions were asked about, that are kept at a time

_BODY = frozenset({"robot", "floor", "obstacles", "zones", "rules"})
DEPENDS_ON = {  # fields of the world that each part is made of
    "ground": _BODY,
    "free_floor": _BODY | {"start"},
    "footprint": _BODY,
    "lifted": _BODY,
    "bodies": _BODY,
    "_ground_without_margin": _BODY,
    "_footprint_without_margin": _BODY,
    "_model_robot": frozenset({"robot", "rules"}),
}


@dataclass(frozen=True, eq=False)
class Scene(Prepared):
    """A world with what its stages prepare of it; it lives as long as whoever holds it.

    Examples
    --------
    >>> from regionik.worlds.documents.world_file import load_world
    >>> scene = Scene(load_world("pillar"))
    >>> ground = scene.ground
    >>> scene.changed(task=scene.task[:1]).ground is ground
    True
    """

    world: World
    _cuts: dict[tuple[bytes, bool], Scene] = field(default_factory=dict, init=False, repr=False)

    @property
    def robot(self) -> Robot:
        return self.world.robot

    @property
    def floor(self) -> Floor:
        return self.world.floor

    @property
    def task(self) -> tuple[Target, ...]:
        return self.world.task

    @property
    def rules(self) -> Rules:
        return self.world.rules

    @property
    def start(self) -> Start | None:
        return self.world.start

    @cached_property
    def within_strokes(self) -> Mask:
        """Set-points (n,) to which the tool works its way from the one before."""
        return within_strokes([target.stroke for target in self.task])

    @cached_property
    def ground(self) -> Ground:
        """Floor, layers of the base, and what they leave of it."""
        return ground_from(self.world)

    @cached_property
    def free_floor(self) -> FreeFloor:
        """Free floor by heading."""
        return FreeFloor(self.ground, headings_of(self.world))

    @cached_property
    def footprint(self) -> FootprintScene:
        """Outlines of the base in its frame, and all they must keep clear of."""
        return footprint_on(self.ground, self.robot)

    @cached_property
    def lifted(self) -> LiftedBody:
        """What lifts carry, and what that rejects."""
        return LiftedBody(self.world, self.ground.base)

    @cached_property
    def bodies(self) -> Bodies:
        """The robot's solids and those that they must keep clear of."""
        return bodies_in(self.world)

    @cached_property
    def collision(self) -> CollisionChecker:
        """Collision checks with the tool at any set-point."""
        return checker_from(self.world, self.bodies)

    def collision_at(self, target: Target) -> CollisionChecker:
        """Return the collision checks with the tool at one target."""
        return checker_at(self.world, self.bodies, target)

    def model(self, target: Target) -> ReachModel:
        """Return the model of reach for a target, with the limits that the rules' criteria leave."""
        return reach_model(self._model_robot, goal_of(target))

    def model_with_lift(self, target: Target, lift: tuple[float, float]) -> ReachModel:
        """Return the model of reach for a target whose lifts raise the arm within a part of their range."""
        return reach_model(self.once(_limited_lift, lift), goal_of(target))

    @cached_property
    def _model_robot(self) -> Robot:
        return with_joint_margin(self.robot, self.rules.criteria)

    @cached_property
    def _ground_without_margin(self) -> Ground:
        return without_rounding_margin(self.ground)

    @cached_property
    def _footprint_without_margin(self) -> FootprintScene:
        return footprint_on(self._ground_without_margin, self.robot)

    def ground_between(self, *bases: Array) -> Ground:
        """Return the ground for a drive between base poses (3,): without margin where one touches a bound."""
        return self._ground_without_margin if self._leaves_a_bound(bases) else self.ground

    def footprint_between(self, *bases: Array) -> FootprintScene:
        """Return the footprint and what it keeps clear of on such a drive, as `ground_between`."""
        return self._footprint_without_margin if self._leaves_a_bound(bases) else self.footprint

    def _leaves_a_bound(self, bases: tuple[Array, ...]) -> bool:
        """True where some base touches a bound, and all of them stand without the margin."""
        if all(fits(self.footprint, *base) for base in bases):
            return False
        return all(fits(self._footprint_without_margin, *base) for base in bases)

    def within_reach(self, places: Array, moved: float = 0.0) -> Scene:
        """Return the scene for a tool at places (n, 2 or more) that move so far [m]: few of many solids."""
        if not is_large(self.world) or not len(places):
            return self
        return self._cut(region_in_reach(self.world, places, moved), floor=False)

    def about_path(self) -> Scene:
        """Return the scene about the whole path: of many solids those near it, and the floor among them."""
        if not is_large(self.world) or not self.task:
            return self
        places = np.array([target.position[:2] for target in self.task])
        return self._cut(shapely.envelope(region_in_reach(self.world, places, AREAS.max_driven)), floor=True)

    def _cut(self, region: BaseGeometry, *, floor: bool) -> Scene:
        key = shapely.to_wkb(region), floor
        if key not in self._cuts:
            near = cut_to(self.world, region, floor=floor)
            while len(self._cuts) >= MAX_CUTS:
                del self._cuts[next(iter(self._cuts))]
            self._cuts[key] = self if near is self.world else Scene(near)
        return self._cuts[key]

    def changed(self, **changes: Any) -> Scene:
        """Return the scene with other values of the world's fields; what does not depend on them is kept."""
        scene = Scene(replace(self.world, **changes))
        made = vars(self)
        kept = {
            part: made[part] for part, on in DEPENDS_ON.items() if part in made and on.isdisjoint(changes)
        }
        vars(scene).update(kept)
        return scene


def _limited_lift(scene: Scene, lift: tuple[float, float]) -> Robot:
    """Return the robot of models with its lifts limited to a part of their range."""
    return with_lift(scene._model_robot, lift)


WorldSource = World | str | os.PathLike[str]  # a world, the name of a bundled one, or its file


def world_of(source: WorldSource) -> World:
    """Return a world as it is, or what `load_world` makes of a name or path."""
    from regionik.worlds.documents.world_file import load_world  # readers take long to load

    if isinstance(source, World):
        return source
    if not isinstance(source, str | os.PathLike):
        raise InputError(f"world: expected a World, or the name or file of one, got {type(source).__name__}")
    return load_world(source if isinstance(source, str) else Path(source))


@lru_cache(maxsize=MAX_SCENES)
def scene_of(world: World) -> Scene:
    """Return the scene of a world; those of the last few worlds are kept for functions that get a world."""
    return Scene(world)
