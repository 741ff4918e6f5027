"""M-FABRIK with the passes of FABRIK-R: the base follows the pivot of any serial arm, compiled.

Source: M-FABRIK (Santos et al., IEEE Access 2020), Algorithm 1, whose arm is here the rigid bodies of
FABRIK-R (paper 001).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.kernels import compiled
from regionik.planners.solvers.base_placement import BaseArea, move_to_area
from regionik.planners.solvers.damped_least_squares import Aim
from regionik.planners.solvers.fabrikr import Posture, backward_pass, posture_of
from regionik.planners.solvers.multistart_ik import (
    Effort,
    inward_pass,
    posture_error,
    solve_ik,
    tolerance_share,
)
from regionik.planners.solvers.rigid_bodies import RigidBodies
from regionik.worlds.arrays import Array


class ArmStand(NamedTuple):
    """Mounting of an arm on its base."""

    # the joint that turns about the vertical through the arm's base frame; what comes before lifts it
    pivot: int
    # yaw, rise: heading and height of the arm's base frame [rad], [m]
    yaw: float
    rise: float


@compiled
def solve_serial(
    bodies: RigidBodies,
    stand: ArmStand,
    starts: Array,
    area: BaseArea,
    place: Array,
    aim: Aim,
    effort: Effort,
    joints: Array,
) -> tuple[float, float, int]:
    """Move arm axis and arm until the tool meets its aim: passes, restarts, then polishing.

    Parameters
    ----------
    bodies : RigidBodies
        Pointing ones for a position, posing ones for more.
    starts : (r, n) array
        Postures to start again from.
    place : (2,) array
        Arm axis on the floor; overwritten with the answer [m].
    aim : Aim
        In the world.
    joints : (dof,) array
        Overwritten with the answer.

    Returns
    -------
    error [m], angle error [rad], passes
    """
    n, passes = len(bodies.slide), 0
    first, nearest, trial, best = place.copy(), place.copy(), joints[:n].copy(), np.inf
    for attempt in range(len(starts) + 1):
        place[:] = first
        trial[:] = joints[:n] if attempt == 0 else starts[attempt - 1]
        posture = posture_of(bodies, trial)
        error, angle, used = serial_passes(bodies, stand, area, place, aim, effort, posture)
        passes += used
        share = tolerance_share(error, angle, effort)
        if share <= 1.0:
            for k in range(n):
                joints[k] = posture.joints[k]
            return error, angle, passes
        if share < best:
            best = share
            nearest[:] = place
    place[:] = nearest  # inside the area: the last pass took it there
    seen = in_arm_frame(place, stand.yaw, stand.rise, aim)
    error, angle, used, _, _ = solve_ik(bodies, seen, starts, effort, joints)
    return error, angle, passes + used


@compiled
def serial_passes(
    bodies: RigidBodies,
    stand: ArmStand,
    area: BaseArea,
    place: Array,
    aim: Aim,
    effort: Effort,
    posture: Posture,
) -> tuple[float, float, int]:
    """M-FABRIK, Algorithm 1, from one posture: misses [m], [rad] and passes; overwrites place and posture."""
    c, s, passes = math.cos(stand.yaw), math.sin(stand.yaw), 0
    goal, miss = in_arm_frame(place, stand.yaw, stand.rise, aim), np.empty(6)
    error, angle = posture_error(bodies, goal, posture, miss)  # M-FABRIK, Alg. 1 l. 8
    # A base that has become inadmissible must move even where the tool is in place already.
    if tolerance_share(error, angle, effort) <= 1.0 and move_to_area(area, place[0], place[1]) == (
        place[0],
        place[1],
    ):
        return error, angle, 0
    while passes < effort.most_passes:  # l. 9
        passes += 1
        inward_pass(bodies, goal, posture)  # l. 11
        dx, dy = posture.outer[stand.pivot, 0], posture.outer[stand.pivot, 1]  # l. 13: ProjectPoint
        if stand.pivot == 0:
            dx, dy = dx - bodies.root[0], dy - bodies.root[1]
        x, y = move_to_area(area, place[0] + c * dx - s * dy, place[1] + s * dx + c * dy)  # l. 15-19
        by_x, by_y = c * (x - place[0]) + s * (y - place[1]), c * (y - place[1]) - s * (x - place[0])
        place[0], place[1] = x, y
        _shift(posture, goal, by_x, by_y)
        backward_pass(bodies, posture)  # l. 21
        error, angle = posture_error(bodies, goal, posture, miss)  # l. 23
        if tolerance_share(error, angle, effort) <= 1.0:
            break
    return error, angle, passes


@compiled
def _shift(posture: Posture, goal: Aim, x: float, y: float) -> None:
    """Take chain and target back by what the arm's base frame has moved."""
    for k in range(len(posture.outer)):
        posture.outer[k, 0] -= x
        posture.outer[k, 1] -= y
        posture.inner[k, 0] -= x
        posture.inner[k, 1] -= y
    goal.position[0] -= x
    goal.position[1] -= y


@compiled
def in_arm_frame(place: Array, yaw: float, rise: float, aim: Aim) -> Aim:
    """An aim in the base frame of an arm whose axis stands at a place."""
    c, s = math.cos(yaw), math.sin(yaw)
    dx, dy = aim.position[0] - place[0], aim.position[1] - place[1]
    position = np.array([c * dx + s * dy, c * dy - s * dx, aim.position[2] - rise])
    turn = np.empty((3, 3))
    for i in range(3):
        turn[0, i] = c * aim.turn[0, i] + s * aim.turn[1, i]
        turn[1, i] = c * aim.turn[1, i] - s * aim.turn[0, i]
        turn[2, i] = aim.turn[2, i]
    return Aim(position, aim.kind, turn, aim.cone)
