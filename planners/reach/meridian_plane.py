"""An arm on a vertical pivot in its meridian plane: distance from the axis and height of the tool.

The joints besides the pivot move the tool in a half plane, the meridian. Joints that cannot move the tool in
it (the pivot, rolls about the tool's point, joints whose limits hold them still) are fixed into the links.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.polygons import Index, compiled
from regionik.planners.search.motion_bounds import longest_levers
from regionik.planners.solvers.serial_chain import SerialArm, chain_frames, chain_jacobian, serial_arm
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, Joint
from regionik.worlds.pivoted_arm import pivot_index

STILL = 1e-12  # a lever below this does not move the tool [m]; limits closer than this hold still
UNIT = np.array([1.0, 0.0])


class Meridian(NamedTuple):
    """The joints that move the tool in its meridian, for kernels.

    Attributes
    ----------
    arm : SerialArm
        Of m joints, the pivot at zero.
    which : (m,) array of int
        Where they are in the chain.
    lower, upper : (m,) array
        Limits; infinite where a joint may turn all round [rad] or [m].
    levers : (m,) array
        Largest distance of the tool from each joint's axis in any posture [m]; 1 for sliding joints.
    bend : (m, m) array
        Bound of the tool's second derivative by two joints, in any posture.
    hub : (m,) array
        Point on each axis nearest to the axis before, from the joint's origin [m].
    """

    arm: SerialArm
    which: Index
    lower: Array
    upper: Array
    levers: Array
    bend: Array
    hub: Array


class Tool(NamedTuple):
    """Position and velocities of the tool in its meridian; scratch space that `look` fills.

    Attributes
    ----------
    at : (2,) array
        Distance from the pivot axis and height over the arm's base frame [m].
    out, up, aside : (m,) array
        Speed outwards, upwards and square to both for each joint's unit speed.
    away : (2,) array
        Direction from the axis to the tool, seen from above.
    axes : (m, 3) array
        Joint axes in the arm's base frame.
    frames : (m + 1, 4, 4) array
    J : (6, m) array
    """

    at: Array
    out: Array
    up: Array
    aside: Array
    away: Array
    axes: Array
    frames: Array
    J: Array


@lru_cache(maxsize=64)
def meridian_of(chain: Chain) -> Meridian | None:
    """Read a chain whose sliding joints have limits; None where nothing but the pivot moves the tool.

    Raises
    ------
    InputError
        When the arm has no vertical pivot.
    """
    pivot = pivot_index(chain)
    levers, _ = longest_levers(chain, chain.dof - 1, chain.T_last_tool[:3, 3])
    joints: list[Joint] = []
    which: list[int] = []
    built_in = np.eye(4)
    for k, joint in enumerate(chain.joints):
        built_in = built_in @ joint.T_parent_joint
        held = joint.upper - joint.lower < STILL
        if k == pivot or held or (joint.kind == "revolute" and levers[k] < STILL):
            built_in = built_in @ joint.transform(joint.lower if held and k != pivot else 0.0)
        else:
            joints.append(replace(joint, T_parent_joint=built_in))
            which.append(k)
            built_in = np.eye(4)
    if not joints:
        return None
    left = Chain(tuple(joints), built_in @ chain.T_last_tool)
    arm, levers = serial_arm(left), longest_levers(left, left.dof - 1, left.T_last_tool[:3, 3])[0]
    all_round = arm.revolute & (arm.upper - arm.lower >= 2 * np.pi)
    return Meridian(
        arm,
        np.array(which),
        np.where(all_round, -np.inf, arm.lower),
        np.where(all_round, np.inf, arm.upper),
        levers,
        _bends(left, levers),
        np.array([0.0, *(_hub(*pair) for pair in pairwise(left.joints))]),
    )


def _bends(chain: Chain, levers: Array) -> Array:
    """Bounds of the tool's second derivatives: the later joint's speed, turned by the earlier joint."""
    bend = np.zeros((chain.dof, chain.dof))
    for j, joint in enumerate(chain.joints):
        if joint.kind == "revolute":
            bend[j, j:] = bend[j:, j] = levers[j:]
    return bend


def _hub(before: Joint, joint: Joint) -> float:
    """Along the axis of a joint, from its origin to the foot of the common normal with the axis before."""
    T = joint.T_parent_joint
    u, v, p = before.axis, T[:3, :3] @ joint.axis, T[:3, 3]
    normal = np.cross(u, v)
    square = float(normal @ normal)
    if square < 1e-6 or "prismatic" in (before.kind, joint.kind):
        return 0.0
    return float(np.cross(p, u) @ normal) / square


def tool_for(meridian: Meridian) -> Tool:
    """Scratch space for `look`."""
    m = len(meridian.levers)
    return Tool(
        np.zeros(2), np.zeros(m), np.zeros(m), np.zeros(m), UNIT.copy(), np.zeros((m, 3)),
        np.zeros((m + 1, 4, 4)), np.zeros((6, m)),
    )  # fmt: skip


@compiled
def look(meridian: Meridian, joints: Array, tool: Tool) -> None:
    """Compute position and velocities of the tool in a posture (m,)."""
    arm, m = meridian.arm, len(joints)
    chain_frames(arm, joints, tool.frames)
    chain_jacobian(arm, tool.frames, tool.J)
    x, y = tool.frames[m, 0, 3], tool.frames[m, 1, 3]
    r = np.sqrt(x * x + y * y)
    if r > 0.0:  # on the axis itself every direction is as good as the last
        tool.away[0], tool.away[1] = x / r, y / r
    tool.at[0], tool.at[1] = r, tool.frames[m, 2, 3]
    c, s = tool.away
    for k in range(m):
        tool.out[k] = c * tool.J[0, k] + s * tool.J[1, k]
        tool.aside[k] = c * tool.J[1, k] - s * tool.J[0, k]
        tool.up[k] = tool.J[2, k]
        for i in range(3):
            tool.axes[k, i] = (
                tool.frames[k, i, 0] * arm.axis[k, 0]
                + tool.frames[k, i, 1] * arm.axis[k, 1]
                + tool.frames[k, i, 2] * arm.axis[k, 2]
            )
