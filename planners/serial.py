"""Any serial chain as flat arrays, with compiled forward kinematics."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.planners.flat import compiled
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain


class SerialArm(NamedTuple):
    """A chain for kernels; joint k turns about, or slides along, ``axis[k]`` in its own frame.

    Attributes
    ----------
    fixed : (n, 4, 4) array
        From the link before to the joint at zero.
    axis : (n, 3) array
        Unit vectors.
    revolute : (n,) array of bool
    lower, upper : (n,) array
        [rad] or [m]; infinite where there is no limit.
    tool : (4, 4) array
        From the last link to the tool.
    """

    fixed: Array
    axis: Array
    revolute: NDArray[np.bool_]
    lower: Array
    upper: Array
    tool: Array


@lru_cache(maxsize=64)
def serial_arm(chain: Chain) -> SerialArm:
    """Read a chain; kept for the last few chains."""
    return SerialArm(
        np.array([joint.T_parent_joint for joint in chain.joints]),
        np.array([joint.axis for joint in chain.joints]),
        np.array([joint.kind == "revolute" for joint in chain.joints]),
        chain.lower,
        chain.upper,
        np.array(chain.T_last_tool),
    )


@compiled
def rotate_about(axis: Array, angle: float, R: Array) -> None:
    """Write the rotation by ``angle`` about a unit axis into ``R`` (3, 3): Rodrigues' formula."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = axis[0], axis[1], axis[2]
    t = 1.0 - c
    R[0, 0], R[0, 1], R[0, 2] = t * x * x + c, t * x * y - s * z, t * x * z + s * y
    R[1, 0], R[1, 1], R[1, 2] = t * x * y + s * z, t * y * y + c, t * y * z - s * x
    R[2, 0], R[2, 1], R[2, 2] = t * x * z - s * y, t * y * z + s * x, t * z * z + c


@compiled
def chain_frames(arm: SerialArm, joints: Array, frames: Array) -> None:
    """Write the pose of every link, then of the tool, into ``frames`` (n + 1, 4, 4), in the base frame."""
    n = len(joints)
    R, p = np.eye(3), np.zeros(3)
    turn, turned = np.empty((3, 3)), np.empty((3, 3))
    for k in range(n + 1):
        step = arm.fixed[k] if k < n else arm.tool
        for i in range(3):
            p[i] += R[i, 0] * step[0, 3] + R[i, 1] * step[1, 3] + R[i, 2] * step[2, 3]
        _times(R, step, turned)
        if k < n and arm.revolute[k]:
            rotate_about(arm.axis[k], joints[k], turn)
            _times(turned, turn, R)
        else:
            R[:] = turned
            if k < n:
                for i in range(3):
                    for j in range(3):
                        p[i] += R[i, j] * arm.axis[k, j] * joints[k]
        frames[k, :3, :3] = R
        frames[k, :3, 3] = p
        frames[k, 3, 0] = frames[k, 3, 1] = frames[k, 3, 2] = 0.0
        frames[k, 3, 3] = 1.0


@compiled
def chain_jacobian(arm: SerialArm, frames: Array, J: Array) -> None:
    """Write the tool's linear and angular velocity for each joint's unit speed into ``J`` (6, n)."""
    n = len(arm.axis)
    tool = frames[n, :3, 3]
    axis, lever = np.empty(3), np.empty(3)
    for k in range(n):
        for i in range(3):
            axis[i] = (
                frames[k, i, 0] * arm.axis[k, 0]
                + frames[k, i, 1] * arm.axis[k, 1]
                + frames[k, i, 2] * arm.axis[k, 2]
            )
            lever[i] = tool[i] - frames[k, i, 3]
        if arm.revolute[k]:
            J[0, k] = axis[1] * lever[2] - axis[2] * lever[1]
            J[1, k] = axis[2] * lever[0] - axis[0] * lever[2]
            J[2, k] = axis[0] * lever[1] - axis[1] * lever[0]
            J[3:, k] = axis
        else:
            J[:3, k] = axis
            J[3:, k] = 0.0


@compiled
def _times(A: Array, B: Array, out: Array) -> None:
    """Product of the 3 x 3 parts of two matrices, written into ``out``."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]
