"""Aims of the tool along a path, what robots in given states miss of them, and how these change that."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from regionik.planners.kernels import compiled
from regionik.planners.solvers.damped_least_squares import DIRECTION, Aim, Aims, turns_left
from regionik.planners.solvers.serial_chain import (
    SerialArm,
    chain_jacobian,
    chain_on,
    joint_values,
    serial_arm,
)
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot

ANGLE_LENGTH = 0.3  # weighs angles of the tool against lengths [m/rad]


def in_columns(aims: Sequence[Aim]) -> Aims:
    """Aims one by one as columns, to be met to rounding."""
    return Aims._make([*map(np.array, zip(*aims, strict=True)), np.zeros(len(aims))])


class Missed(NamedTuple):
    """What the tool misses in states, angles as lengths (n, 6), and how states change it (n, 6, m)."""

    miss: Array
    J: Array


def missed_by(robot: Robot, aims: Aims, states: Array) -> Missed:
    """What states (n, m) of coordinates x, y, yaw and joints miss of n aims, their cones aside."""
    frame, J = tool_jacobians(robot, states)
    miss = np.zeros((len(states), 6))
    miss[:, :3] = aims.positions - frame[:, :3, 3]
    miss[:, 3:] = ANGLE_LENGTH * turns_left(aims.kinds, aims.turns, frame[:, :3, :3].copy())
    J[:, 3:] *= np.where(aims.kinds > 0, ANGLE_LENGTH, 0.0)[:, None, None]
    axis = frame[:, :3, 2] * (aims.kinds == DIRECTION)[:, None]
    J[:, 3:] -= axis[:, :, None] * np.einsum("ni,nij->nj", axis, J[:, 3:])[:, None]  # its roll is free
    return Missed(miss, J)


def beyond_cones(aims: Aims, missed: Missed) -> Missed:
    """What is missed beyond the aims' cones: of a turn, how far it is from there and how that changes."""
    miss, J = missed.miss.copy(), missed.J.copy()
    angle = np.linalg.norm(miss[:, 3:], axis=1)
    way = miss[:, 3:] / np.maximum(angle, 1e-300)[:, None]
    beyond = np.maximum(angle - ANGLE_LENGTH * aims.cones, 0.0)
    miss[:, 3:] = beyond[:, None] * way
    J[:, 3:] *= ((aims.cones == 0) | (beyond > 0))[:, None, None]
    J[:, 3:] = np.where(
        (aims.cones > 0)[:, None, None],
        way[:, :, None] * np.einsum("ni,nij->nj", way, J[:, 3:])[:, None],
        J[:, 3:],
    )
    return Missed(miss, J)


def tool_jacobians(robot: Robot, states: Array) -> tuple[Array, Array]:
    """Tool frames (n, 4, 4) and how coordinates x, y, yaw and joints move and turn them, (n, 6, m)."""
    frames, J = np.empty((len(states), 4, 4)), np.empty((len(states), 6, states.shape[1]))
    _tool_jacobians(serial_arm(robot.chain), np.array(robot.T_base_arm), np.array(states), frames, J)
    return frames, J


@compiled
def _tool_jacobians(arm: SerialArm, mount: Array, states: Array, tools: Array, J: Array) -> None:
    """Write `tool_jacobians` of states (n, m)."""
    frames, by_joints = np.empty((len(arm.axis) + 1, 4, 4)), np.empty((6, len(arm.lower)))
    for n in range(len(states)):
        x, y, c, s = states[n, 0], states[n, 1], math.cos(states[n, 2]), math.sin(states[n, 2])
        for j in range(4):
            frames[0, 0, j] = c * mount[0, j] - s * mount[1, j] + (x if j == 3 else 0.0)
            frames[0, 1, j] = s * mount[0, j] + c * mount[1, j] + (y if j == 3 else 0.0)
            frames[0, 2, j], frames[0, 3, j] = mount[2, j], mount[3, j]
        chain_on(arm, joint_values(arm, states[n, 3:]), frames)
        chain_jacobian(arm, frames, by_joints)
        for i in range(4):
            for j in range(4):
                tools[n, i, j] = frames[-1, i, j]
        for i in range(6):
            for j in range(3):
                J[n, i, j] = 0.0
            for j in range(len(arm.lower)):
                J[n, i, 3 + j] = by_joints[i, j]
        J[n, 0, 0] = J[n, 1, 1] = J[n, 5, 2] = 1.0
        J[n, 0, 2], J[n, 1, 2] = y - frames[-1, 1, 3], frames[-1, 0, 3] - x
