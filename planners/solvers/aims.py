"""Aims of the tool along a path, what robots in given states miss of them, and how these change that."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from regionik.planners.solvers.damped_least_squares import DIRECTION, Aim, Aims, turns_left
from regionik.worlds.arrays import Array, cross
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
    base, joints = states[:, :3], states[:, 3:]
    frames = robot.frames(base, joints)
    tool = frames[:, -1, :3, 3]
    J = np.zeros((len(states), 6, states.shape[1]))
    J[:, 0, 0] = J[:, 1, 1] = 1.0
    up, origin = np.array([0.0, 0.0, 1.0]), np.column_stack([base[:, :2], np.zeros(len(base))])
    J[:, :3, 2], J[:, 3:, 2] = cross(up, tool - origin), up
    chain = robot.chain
    J[:, :3, 3:] = chain.point_jacobian(frames, tool, len(chain.joints)).swapaxes(1, 2)
    J[:, 3:, 3:] = chain.turn_jacobian(frames).swapaxes(1, 2)
    return frames[:, -1], J
