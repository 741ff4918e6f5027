"""The task that all solvers get: the bundled youBot on its omnidirectional base, targets and starts.

Peers get it as a chain of eight joints: the base's x, y and yaw, then the arm's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.worlds.arrays import Array, frozen
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain, rot_z
from regionik.worlds.joints import Joint
from regionik.worlds.robot import Robot

TOLERANCE = 1e-3  # [m]
ROOM = 10.0  # that the base has to either side, where a peer wants limits [m]


class Task(NamedTuple):
    """Targets (n, 3) [m], base poses (n, 3), joints (n, dof) to start from, all drawn evenly."""

    robot: Robot
    targets: Array
    bases: Array
    joints: Array

    def first(self, count: int) -> Task:
        return Task(self.robot, self.targets[:count], self.bases[:count], self.joints[:count])

    @property
    def starts(self) -> Array:
        """Base and joints in one row, as a peer takes them (n, 3 + dof)."""
        return np.hstack([self.bases, self.joints])


def task(count: int) -> Task:
    robot, rng = robot_named("youbot"), np.random.default_rng(0)
    targets = np.column_stack([rng.uniform(-1, 1, (count, 2)), rng.uniform(0.1, 0.4, count)])
    joints = rng.uniform(robot.chain.lower, robot.chain.upper, (count, robot.chain.dof))
    rows = targets, rng.uniform(-1, 1, (count, 3)), joints
    return Task(robot, *(frozen(part, part.shape, "task") for part in rows))


def mobile_chain(robot: Robot) -> Chain:
    """Base and arm as one chain."""
    x, y, z = np.eye(3)
    T_base_arm = rot_z(float(robot.mount[3]))
    T_base_arm[:3, 3] = robot.mount[:3]
    first, *others = robot.chain.joints
    root = Joint(
        first.name, first.kind, first.lower, first.upper, T_base_arm @ first.T_parent_joint, first.axis
    )
    base = (
        Joint("base_x", "prismatic", -ROOM, ROOM, np.eye(4), x),
        Joint("base_y", "prismatic", -ROOM, ROOM, np.eye(4), y),
        Joint("base_yaw", "revolute", -2 * np.pi, 2 * np.pi, np.eye(4), z),
    )
    return Chain((*base, root, *others), robot.chain.T_last_tool)
