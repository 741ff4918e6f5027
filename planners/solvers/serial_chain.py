"""Any serial chain as flat arrays, with compiled forward kinematics."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.vectors import Vector, cross, put, row, turned
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.chain import Chain
from regionik.worlds.prepared import made_once

_UNTURNED = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


class SerialArm(NamedTuple):
    """A chain for kernels; joint k turns about, or slides along, ``axis[k]`` in its own frame.

    Postures are values of its dof active joints. Joint k is at ``ratio[k] * posture[leader[k]] + offset[k]``.
    """

    fixed: Array  # (n, 4, 4) from the link before to the joint at zero
    axis: Array  # (n, 3) unit vectors
    revolute: Mask  # (n,)
    # lower, upper: (dof,) [rad] or [m]; infinite where there is no limit
    lower: Array
    upper: Array
    tool: Array  # (4, 4) from the last link to the tool
    leader: Index  # (n,)
    ratio: Array  # (n,)
    offset: Array  # (n,) [rad] or [m]


@made_once
def serial_arm(chain: Chain) -> SerialArm:
    """Read a chain; kept for the last few chains."""
    return SerialArm(
        np.array([joint.T_parent_joint for joint in chain.joints]),
        np.array([joint.axis for joint in chain.joints]),
        np.array([joint.kind == "revolute" for joint in chain.joints]),
        chain.lower,
        chain.upper,
        np.array(chain.T_last_tool),
        np.array(chain.leaders, dtype=np.int64),
        np.array(chain.multipliers),
        np.array(chain.offsets),
    )


def active_levers(arm: SerialArm, levers: Array) -> Array:
    """Most that a point moves by the unit speed of active joints, (dof,), from all joints' levers, (n,)."""
    found = np.zeros(len(arm.lower))
    np.add.at(found, arm.leader, np.abs(arm.ratio) * levers)
    return found


@compiled
def rotation_about(axis: Array, angle: float) -> tuple[Vector, Vector, Vector]:
    """The rotation by ``angle`` about a unit axis, row by row: Rodrigues' formula."""
    c, s = math.cos(angle), math.sin(angle)
    x, y, z = axis[0], axis[1], axis[2]
    t = 1.0 - c
    return (
        (t * x * x + c, t * x * y - s * z, t * x * z + s * y),
        (t * x * y + s * z, t * y * y + c, t * y * z - s * x),
        (t * x * z - s * y, t * y * z + s * x, t * z * z + c),
    )


@compiled
def rotate_about(axis: Array, angle: float, R: Array) -> None:
    """Write `rotation_about` into ``R`` (3, 3)."""
    u, v, w = rotation_about(axis, angle)
    R[0, 0], R[0, 1], R[0, 2] = u
    R[1, 0], R[1, 1], R[1, 2] = v
    R[2, 0], R[2, 1], R[2, 2] = w


@compiled
def joint_values(arm: SerialArm, posture: Array) -> Array:
    """Values (n,) of all joints in a posture (dof,)."""
    values = np.empty(len(arm.axis))
    for k in range(len(values)):
        values[k] = arm.ratio[k] * posture[arm.leader[k]] + arm.offset[k]
    return values


@compiled
def joint_changes(arm: SerialArm, change: Array) -> Array:
    """Sizes (n,) of the changes of all joints by a change of the active ones (dof,)."""
    changes: Array = np.abs(arm.ratio * change[arm.leader])
    return changes


@compiled
def chain_frames(arm: SerialArm, posture: Array, frames: Array) -> None:
    """Write the pose of every link, then of the tool, into ``frames`` (n + 1, 4, 4), in the base frame."""
    frames[0] = np.eye(4)
    chain_on(arm, joint_values(arm, posture), frames)


@compiled
def chain_on(arm: SerialArm, joints: Array, frames: Array) -> None:
    """Write frames as `chain_frames` does, of the values of all joints (n,), on a base that moves.

    ``frames[0]`` is the pose of the chain's base at first.
    """
    n = len(arm.axis)
    for k in range(n + 1):
        last, step = frames[max(k - 1, 0)], arm.fixed[k] if k < n else arm.tool
        turns, slides = k < n and arm.revolute[k], k < n and not arm.revolute[k]
        u, v, w = rotation_about(arm.axis[k], joints[k]) if turns else _UNTURNED
        for i in range(3):
            a, b, c, p = last[i, 0], last[i, 1], last[i, 2], last[i, 3]
            p += a * step[0, 3] + b * step[1, 3] + c * step[2, 3]
            x = a * step[0, 0] + b * step[1, 0] + c * step[2, 0]
            y = a * step[0, 1] + b * step[1, 1] + c * step[2, 1]
            z = a * step[0, 2] + b * step[1, 2] + c * step[2, 2]
            if turns:
                x, y, z = (
                    x * u[0] + y * v[0] + z * w[0],
                    x * u[1] + y * v[1] + z * w[1],
                    x * u[2] + y * v[2] + z * w[2],
                )
            elif slides:
                p += (x * arm.axis[k, 0] + y * arm.axis[k, 1] + z * arm.axis[k, 2]) * joints[k]
            frames[k, i, 0], frames[k, i, 1], frames[k, i, 2], frames[k, i, 3] = x, y, z, p
        frames[k, 3, 0] = frames[k, 3, 1] = frames[k, 3, 2] = 0.0
        frames[k, 3, 3] = 1.0


@compiled
def joint_axes(arm: SerialArm, frames: Array, axes: Array) -> None:
    """Write the unit vectors of the joint axes into ``axes`` (n, 3), in the base frame."""
    for k in range(len(arm.axis)):
        put(axes, k, turned(frames[k], row(arm.axis, k)))


@compiled
def chain_jacobian(arm: SerialArm, frames: Array, J: Array) -> None:
    """Write the tool's linear and angular velocity for each active joint's unit speed into ``J`` (6, dof)."""
    J[:] = 0.0
    for k in range(len(arm.axis)):
        j, ratio, twist = arm.leader[k], arm.ratio[k], joint_twist(arm, frames, k)
        for i in range(6):
            J[i, j] += ratio * twist[i]


@compiled
def joint_jacobian(arm: SerialArm, frames: Array, J: Array) -> None:
    """Write the tool's linear and angular velocity for the unit speed of each of all joints, (6, n)."""
    for k in range(len(arm.axis)):
        twist = joint_twist(arm, frames, k)
        for i in range(6):
            J[i, k] = twist[i]


@compiled
def joint_twist(arm: SerialArm, frames: Array, k: int) -> tuple[float, float, float, float, float, float]:
    """The tool's linear and angular velocity for the unit speed of joint k of all n."""
    T, tool = frames[k], frames[len(arm.axis)]
    x, y, z = axis = turned(T, row(arm.axis, k))
    if not arm.revolute[k]:
        return x, y, z, 0.0, 0.0, 0.0
    u, v, w = cross(axis, (tool[0, 3] - T[0, 3], tool[1, 3] - T[1, 3], tool[2, 3] - T[2, 3]))
    return u, v, w, x, y, z
