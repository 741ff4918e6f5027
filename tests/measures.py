"""What postures and tool frames are measured by, reckoned here from the chain in space alone."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from regionik.worlds.robot import Robot
from regionik.worlds.scene import Target
from tests.maths import Array

GRAVITY = 9.80665  # standard gravity [m/s2]


def axis_of(robot: Robot, base: Array) -> Array:
    """Return where the arm's axis stands on the floor (..., 2), of base poses (..., 3)."""
    (x, y), c, s = robot.mount[:2], np.cos(base[..., 2]), np.sin(base[..., 2])
    return np.asarray(base[..., :2] + np.stack([c * x - s * y, s * x + c * y], axis=-1))


def pose_of(robot: Robot, axis: Array, yaw: float) -> Array:
    """Return the base pose (3,) that puts the arm's axis on a spot with a heading."""
    return np.array([*(axis - axis_of(robot, np.array([0.0, 0.0, yaw]))), yaw])


def deviation(target: Target, turn: Array) -> float:
    """Return the angle between a tool frame (3, 3) and the frame or axis of a target, 0 where it has none."""
    if target.orientation is not None:
        return float(Rotation.from_matrix(target.orientation.T @ turn).magnitude())
    if target.direction is not None:
        aside = np.linalg.norm(np.cross(turn[:, 2], target.direction))
        return float(np.arctan2(aside, turn[:, 2] @ target.direction))
    return 0.0


def goal_error(target: Target, tool: Array) -> tuple[float, float]:
    """Return how far a tool frame (4, 4) is off a target: in position [m], and in axis or turn [rad]."""
    return float(np.linalg.norm(tool[:3, 3] - target.position)), deviation(target, tool[:3, :3])


def manipulability(robot: Robot, joints: Array) -> Array:
    """Return Yoshikawa's measure of the tool's position, of joints (..., dof)."""
    columns = _columns(robot, joints, len(robot.chain.joints) - 1, robot.chain.T_last_tool[:3, 3])
    square = np.swapaxes(columns, -1, -2) @ columns
    return np.asarray(np.sqrt(np.maximum(np.linalg.det(square), 0.0)))


def efforts(robot: Robot, joints: Array) -> Array:
    """Return the torque or force with which each joint bears links and payload, of joints (..., dof)."""
    lifted = [one.mass * _columns(robot, joints, one.link, one.center)[..., 2] for one in robot.loads]
    return np.asarray(GRAVITY * np.sum(lifted, axis=0)) if lifted else np.zeros(np.shape(joints))


def joint_margins(robot: Robot, joints: Array) -> Array:
    """Return how far limited joints (..., dof) are off their nearer limit, as shares of their ranges."""
    low, high = robot.chain.lower, robot.chain.upper
    return np.asarray(np.minimum(joints - low, high - joints) / (high - low))


def _columns(robot: Robot, joints: Array, link: int, point: Array) -> Array:
    """Return how each active joint moves a point of a link, (..., dof, 3)."""
    frames = robot.chain.frames(joints)
    spot = frames[..., link, :3, :3] @ point + frames[..., link, :3, 3]
    found = np.zeros((*np.shape(joints)[:-1], len(robot.chain.joints), 3))
    for k, joint in enumerate(robot.chain.joints[: link + 1]):
        axis = frames[..., k, :3, :3] @ joint.axis
        slides = joint.kind == "prismatic"
        found[..., k, :] = axis if slides else np.cross(axis, spot - frames[..., k, :3, 3])
    return np.asarray(robot.chain.coupling.T @ found)  # what leads others moves them too
