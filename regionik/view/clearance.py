"""Distances of a robot from the solids of its world, from itself and of its base from shadows, by pose."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import shapely

from regionik.planners.collision.proximity import nearest
from regionik.planners.collision.robot_bodies import Bodies, ContactTargets, bodies_from
from regionik.scene import scene_of
from regionik.verification.base_clearance import base_shadows, footprint_hulls
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World


@dataclass(frozen=True, eq=False)
class Clearances:
    """Distances at some poses, (n,) each [m]; infinite where there is nothing to avoid."""

    base: Array  # footprint to the shadow of the nearest solid that the base could hit
    arm: Array  # the robot's solids to the nearest of the world, apart from allowed contact of the tool
    own: Array  # the robot's solids to each other and to its base, where these have to keep apart


def clearances(world: World, base: Array, joints: Array) -> Clearances:
    """Return the distances at base poses (n, 3) and joint values (n, dof)."""
    nothing = np.full(len(base), np.inf)
    contact = scene_of(world).guard.contact
    return Clearances(
        base=_base_clearance(world, base),
        arm=_distances(bodies_around(world), base, joints, contact) if world.arm_solids else nothing,
        own=_distances(bodies_from(world.robot, ()), base, joints, None),
    )


def bodies_around(world: World) -> Bodies:
    """A robot among the solids of its world, with nothing of its own that has to keep apart."""
    robot = world.robot
    pairs = tuple(combinations([solid.name for solid in robot.all_solids], 2))
    apart = replace(robot, footprint=np.zeros((1, 2)), unchecked=pairs)
    return bodies_from(apart, world.solids, floor=world.floor_slab)


def _distances(bodies: Bodies, base: Array, joints: Array, contact: ContactTargets | None) -> Array:
    """Least distance at every pose, negative where something overlaps, (n,) [m]."""
    pairs = zip(base, joints, strict=True)
    return np.array([nearest(bodies, at, q, contact=contact).distance for at, q in pairs])


def _base_clearance(world: World, base: Array) -> Array:
    """Footprint to the nearest shadow at every pose, 0 where they meet, (n,) [m]."""
    shown = [shadow for _, shadow in base_shadows(world)]
    nearest_shadow = np.full(len(base), np.inf)
    prints = footprint_hulls(world.robot, base)
    for radius in sorted({shadow.radius for shadow in shown}):
        cores = shapely.STRtree([shadow.core for shadow in shown if shadow.radius == radius])
        which, distance = cores.query_nearest(prints, return_distance=True, all_matches=False)
        nearest_shadow[which[0]] = np.minimum(nearest_shadow[which[0]], distance - radius)
    clearance: Array = np.maximum(nearest_shadow, 0.0)
    return clearance
