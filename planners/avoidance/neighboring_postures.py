"""Clear postures at many targets from one pose of the base, each led on from that of a target nearby."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.collision.collision_checking import is_clear
from regionik.planners.collision.robot_scene import RobotScene
from regionik.planners.kernels import compiled
from regionik.planners.reach.serial_criteria import SerialThresholds, led_within
from regionik.planners.solvers.damped_least_squares import Aim, Aims, polish
from regionik.planners.solvers.serial_chain import SerialArm
from regionik.worlds.arrays import Array, Index, Mask

STEPS = 20  # of damped least squares from a start


class NeighboringTargets(NamedTuple):
    """Targets that an arm is to reach with the base where it is, for kernels."""

    scene: RobotScene
    margin: float  # kept from all solids beyond what the scene asks [m]
    base: Array  # (3,) x, y [m], yaw [rad]
    asked: SerialThresholds  # of the postures
    arm: SerialArm  # it may have more joints than the robot, the first of which do not move
    aims: Aims  # n targets as the arm's base frame has them
    tool_on: Index  # (n,) obstacle that the tool works on at each, -1 for none
    near: Index  # (n, m) targets near each, the nearest first
    # reach, tolerance: as of `polish`
    reach: float
    tolerance: float


@compiled
def neighboring_postures(targets: NeighboringTargets, starts: Array, postures: Array) -> Mask:
    """Find clear postures: from the starts at a target, and from each found on to the targets near it.

    Parameters
    ----------
    starts : (n, s, k) array
        Postures to begin from, the first that leads to a clear one is taken.
    postures : (n, k) array
        Overwritten where one is found.

    Returns
    -------
    (n,) array of bool
        True where one was found.
    """
    n = len(targets.aims.positions)
    found, queue = np.zeros(n, dtype=np.bool_), np.empty(n, dtype=np.int64)
    for i in range(n):
        for s in range(starts.shape[1]):
            if found[i] or not _meets(targets, i, starts[i, s], postures):
                continue
            found[i], queue[0] = True, i
            first, count = 0, 1
            while first < count:
                k = queue[first]
                first += 1
                for j in targets.near[k]:
                    if not found[j] and _meets(targets, j, postures[k], postures):
                        found[j], queue[count] = True, j
                        count += 1
    return found


@compiled
def _meets(targets: NeighboringTargets, i: int, start: Array, postures: Array) -> bool:
    """True if a start leads to a clear posture at target i that meets what is asked; it is kept."""
    aims, joints = targets.aims, start.copy()
    aim = Aim(aims.positions[i], aims.kinds[i], aims.turns[i], aims.cones[i])
    reach, most, widest = targets.reach, targets.tolerance, aims.angle_tolerances[i]
    error, angle, _ = polish(targets.arm, aim, joints, reach, most, widest, STEPS)
    if error > most or angle > widest:
        return False
    if not led_within(targets.arm, targets.asked, aim, joints, reach, most, widest):
        return False
    more = len(joints) - len(targets.scene.robot.arm.lower)
    if not is_clear(targets.scene, targets.margin, targets.base, joints[more:], targets.tool_on[i]):
        return False
    postures[i] = joints
    return True
