"""A world of an arm in one plane as compiled loops take it."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon

from regionik.areas.ground import EVERY, Side
from regionik.areas.reachable import planar_reach
from regionik.planners.collision.robot_bodies import RobotScene
from regionik.planners.reach.floor_distances import FloorParts, parts_of
from regionik.planners.reach.planar_cells import Stance
from regionik.planners.reach.rings import boundary_circles
from regionik.postures.arm_guard import guard_of
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World


class Reach(NamedTuple):
    """Circles of the arm's plane on which its reach can begin or end.

    Attributes
    ----------
    centers : (k, 2) array
        [m]
    radii : (k,) array
        [m]
    """

    centers: Array
    radii: Array


@lru_cache(maxsize=128)
def stance_of(world: World, span: tuple[float, float]) -> Stance:
    """Stance of the robot with its heading in a span."""
    robot, model = world.robot, planar_reach(world.robot)
    arm = model.arm
    low, high = arm.pivot_lower, arm.pivot_upper
    if world.rules.heading == "face_target":
        low = high = min(max(0.0, low), high)
    zero, yaw = float(arm.pivot_zero + robot.mount[3]), 0.0
    if world.start is not None:
        yaw = float(world.start.base[2])
    if span != EVERY:
        yaw = (span[0] + span[1]) / 2
    sign, offset, mount = map(own, (arm.sign, arm.offset, robot.mount[:2]))
    return Stance(model.plane, sign, offset, zero, low, high, mount, yaw)


@lru_cache(maxsize=8)
def reach_of(world: World) -> Reach:
    """The circles on which the arm's reach can begin or end."""
    model = planar_reach(world.robot)
    circles = boundary_circles(model.arm, model.plane.shoulder_z)
    return Reach(own(circles[:, :2]), own(circles[:, 2]))


@lru_cache(maxsize=8)
def scene_of(world: World) -> RobotScene:
    """The robot among the solids that it keeps away from."""
    guard = guard_of(world)
    return guard.bodies.scene(guard.contact)


@lru_cache(maxsize=256)
def floor_of(side: Side) -> FloorParts:
    """The free floor of a side."""
    parts = shapely.get_parts(side.free)
    return parts_of([part for part in parts if isinstance(part, Polygon) and part.area > 0])


def own(values: Array) -> Array:
    """A copy that kernels take: writable and in order, so that they are compiled once."""
    return np.array(values, dtype=np.float64, order="C")
