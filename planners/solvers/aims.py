"""Aims of the tool along a path, what robots in given states miss of them, and how these change that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from regionik.planners.solvers.damped_least_squares import DIRECTION, ORIENTATION, Aim
from regionik.worlds.arrays import Array, Index, cross
from regionik.worlds.robot import Robot

ANGLE_LENGTH = 0.3  # weighs angles of the tool against lengths [m/rad]


@dataclass(frozen=True, eq=False)
class Aims:
    """What is asked of the tool at n points of its path: `Aim` by column."""

    position: Array  # (n, 3) [m]
    kind: Index  # (n,) what is asked of the tool's axes, see `damped_least_squares.Aim`
    turn: Array  # (n, 3, 3)
    cone: Array  # (n,) [rad]

    def part(self, rows: slice) -> Aims:
        """Some of the points."""
        return Aims(self.position[rows], self.kind[rows], self.turn[rows], self.cone[rows])


def in_columns(aims: Sequence[Aim]) -> Aims:
    """Aims one by one as columns."""
    return Aims(
        np.array([aim.position for aim in aims]),
        np.array([aim.kind for aim in aims]),
        np.array([aim.turn for aim in aims]),
        np.array([aim.cone for aim in aims]),
    )


class Missed(NamedTuple):
    """What the tool misses in states, angles as lengths (n, 6), and how states change it (n, 6, m)."""

    miss: Array
    J: Array


def missed_by(robot: Robot, aims: Aims, states: Array) -> Missed:
    """What states (n, m) of coordinates x, y, yaw and joints miss of n aims.

    Of a turn within a cone only what is beyond it counts, and of motions how they change that angle.
    """
    frame, J = tool_jacobians(robot, states)
    miss = np.zeros((len(states), 6))
    miss[:, :3] = aims.position - frame[:, :3, 3]
    miss[:, 3:] = _turn_left(aims, frame[:, :3, :3])
    angle = np.linalg.norm(miss[:, 3:], axis=1)
    way = miss[:, 3:] / np.maximum(angle, 1e-300)[:, None]
    beyond = np.maximum(angle - aims.cone, 0.0)
    miss[:, 3:] = ANGLE_LENGTH * beyond[:, None] * way
    asked = np.where((aims.kind > 0) & ((aims.cone == 0) | (beyond > 0)), ANGLE_LENGTH, 0.0)
    J[:, 3:] *= asked[:, None, None]
    axis = frame[:, :3, 2] * (aims.kind == DIRECTION)[:, None]
    J[:, 3:] -= axis[:, :, None] * np.einsum("ni,nij->nj", axis, J[:, 3:])[:, None]  # its roll is free
    J[:, 3:] = np.where(
        (aims.cone > 0)[:, None, None],
        way[:, :, None] * np.einsum("ni,nij->nj", way, J[:, 3:])[:, None],
        J[:, 3:],
    )
    return Missed(miss, J)


def _turn_left(aims: Aims, turned: Array) -> Array:
    """Rotation vectors (n, 3) from tool frames to what is asked of them; zero where nothing is."""
    left = np.zeros((len(turned), 3))
    whole, pointed = aims.kind == ORIENTATION, aims.kind == DIRECTION
    if whole.any():
        way = aims.turn[whole] @ np.swapaxes(turned[whole], 1, 2)
        left[whole] = Rotation.from_matrix(way).as_rotvec()
    if pointed.any():
        axis, asked = turned[pointed, :, 2], aims.turn[pointed, :, 2]
        normal = cross(axis, asked)
        sine = np.linalg.norm(normal, axis=1)
        angle = np.arctan2(sine, np.einsum("ni,ni->n", axis, asked))
        left[pointed] = normal * (angle / np.maximum(sine, 1e-300))[:, None]
    return left


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
