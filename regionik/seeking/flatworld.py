"""A world of an arm in one plane as compiled loops take it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import shapely
from shapely.geometry import Polygon

from regionik.areas.ground import EVERY, Side
from regionik.planners.clearance.bulkreach import Keep, Reach, Stance
from regionik.planners.reach.ringfloor import Parts, parts_of
from regionik.planners.reach.rings import boundary_circles
from regionik.planners.solvers.planar_arm import PlaneArm
from regionik.postures.guard import SPARE, guard_of
from regionik.worlds.arrays import Array
from regionik.worlds.planar import planar_arm
from regionik.worlds.scene import World

SLACK = 1e-9  # rounding allowed at a bound [rad]


@lru_cache(maxsize=128)
def stance_of(world: World, span: tuple[float, float]) -> Stance:
    """How the robot stands with its heading in a span."""
    robot, arm = world.robot, planar_arm(world.robot.chain)
    low, high = arm.pivot_lower, arm.pivot_upper
    if world.rules.heading == "face_target":
        low = high = min(max(0.0, low), high)
    shoulder = float(arm.shoulder[0]), float(arm.shoulder[1] + robot.mount[2])
    plane = PlaneArm(*shoulder, *map(own, (arm.lengths, arm.lower, arm.upper)))
    zero, yaw, turn = float(arm.pivot_zero + robot.mount[3]), 0.0, np.inf
    if world.start is not None:
        yaw = float(world.start.base[2])
    if span != EVERY:
        yaw, turn = (span[0] + span[1]) / 2, (span[1] - span[0]) / 2
    sign, offset, mount, carry = map(own, (arm.sign, arm.offset, robot.mount[:2], robot.carry))
    return Stance(plane, sign, offset, zero, low, high, mount, yaw, turn + SLACK, carry)


@lru_cache(maxsize=8)
def reach_of(world: World) -> Reach:
    """The circles on which the arm's reach can begin or end."""
    arm = planar_arm(world.robot.chain)
    circles = boundary_circles(arm, float(arm.shoulder[1] + world.robot.mount[2]))
    return Reach(own(circles[:, :2]), own(circles[:, 2]), world.rules.reach_margin)


@lru_cache(maxsize=8)
def keep_of(world: World) -> Keep:
    """What the arm keeps off."""
    guard, bodies = guard_of(world), guard_of(world).bodies
    return Keep(bodies.arm, own(bodies.mount), bodies.movers, bodies.hulls, SPARE, guard.on)


@lru_cache(maxsize=256)
def floor_of(side: Side) -> Parts:
    """The free floor of a side."""
    parts = shapely.get_parts(side.free)
    return parts_of([part for part in parts if isinstance(part, Polygon) and part.area > 0])


def own(values: Array) -> Array:
    """A copy that kernels take: writable and in order, so that they are compiled once."""
    return np.array(values, dtype=np.float64, order="C")
