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

from regionik.planners.kernels import compiled
from regionik.planners.search.motion_bounds import longest_levers, second_derivatives
from regionik.planners.solvers.serial_chain import (
    SerialArm,
    active_levers,
    chain_frames,
    joint_axes,
    joint_jacobian,
    serial_arm,
)
from regionik.worlds.arms import pivot_index
from regionik.worlds.arrays import Array, Index
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint

STILL = 1e-12  # a lever below this does not move the tool [m]; limits closer than this hold still
UNIT = np.array([1.0, 0.0])
LEVEL = 1e-12  # how near to the height a posture of a walk is [m]
ROUNDING = 1e-12  # added to bounds [m]
CORRECTIONS = 40  # Newton steps to the height


class Meridian(NamedTuple):
    """The joints that move the tool in its meridian, for kernels: n joints, of which m are active."""

    arm: SerialArm  # the pivot at zero
    which: Index  # (m,) where the active joints are in the chain's postures
    # lower, upper: (m,) limits; infinite where a joint may turn all round [rad] or [m]
    lower: Array
    upper: Array
    levers: Array  # (n,) most that the tool is off each joint's axis in any posture [m]; 1 for sliding joints
    speeds: Array  # (m,) most that the tool moves by the unit speed of each active joint, in any posture
    weights: Array  # (m,) of joints where the height is corrected: the less, the farther one moves the tool
    bend: Array  # (m, m) bound of the tool's second derivative by two active joints, in any posture
    hub: Array  # (n,) point on each axis nearest to the axis before, from the joint's origin [m]


class MeridianTool(NamedTuple):
    """Position and velocities of the tool in its meridian; scratch space that `tool_motion` fills."""

    at: Array  # (2,) distance from the pivot axis and height over the arm's base frame [m]
    # out, up, aside: (m,) speed outwards, upwards and square to both for each active joint's unit speed
    out: Array
    up: Array
    aside: Array
    away: Array  # (2,) direction from the axis to the tool, seen from above
    axes: Array  # (n, 3) joint axes in the arm's base frame
    frames: Array  # (n + 1, 4, 4)
    J: Array  # (6, n) of each of all joints


@lru_cache(maxsize=64)
def meridian_of(chain: Chain) -> Meridian | None:
    """Read a chain whose sliding joints have limits; None where nothing but the pivot moves the tool.

    Raises
    ------
    InputError
        When the arm has no vertical pivot.
    """
    pivot = chain.active_joints[pivot_index(chain)]
    levers, _ = longest_levers(chain, len(chain.joints) - 1, chain.T_last_tool[:3, 3])
    alone = {joint.name for joint, turns in zip(chain.active_joints, chain.turning, strict=True) if turns}
    joints: list[Joint] = []
    built_in = np.eye(4)
    for joint, lever in zip(chain.joints, levers, strict=True):
        built_in = built_in @ joint.T_parent_joint
        held = joint.upper - joint.lower < STILL
        if joint is pivot or held or (joint.name in alone and lever < STILL):
            built_in = built_in @ joint.transform(joint.lower if held and joint is not pivot else 0.0)
        else:
            joints.append(replace(joint, T_parent_joint=built_in))
            built_in = np.eye(4)
    if not joints:
        return None
    left = Chain(tuple(joints), built_in @ chain.T_last_tool)
    arm, levers = serial_arm(left), longest_levers(left, len(joints) - 1, left.T_last_tool[:3, 3])[0]
    speeds, all_round = active_levers(arm, levers), left.turning & (arm.upper - arm.lower >= 2 * np.pi)
    return Meridian(
        arm,
        np.array([chain.names.index(name) for name in left.names]),
        np.where(all_round, -np.inf, arm.lower),
        np.where(all_round, np.inf, arm.upper),
        levers,
        speeds,
        1.0 / np.maximum(speeds, 1e-3),
        second_derivatives(left, levers),
        np.array([0.0, *(hub_along(*pair) for pair in pairwise(left.joints))]),
    )


def hub_along(before: Joint, joint: Joint) -> float:
    """Along the axis of a joint, from its origin to the foot of the common normal with the axis before."""
    T = joint.T_parent_joint
    u, v, p = before.axis, T[:3, :3] @ joint.axis, T[:3, 3]
    normal = np.cross(u, v)
    square = float(normal @ normal)
    if square < 1e-6 or "prismatic" in (before.kind, joint.kind):
        return 0.0
    return float(np.cross(p, u) @ normal) / square


def tool_for(meridian: Meridian) -> MeridianTool:
    """Scratch space for `tool_motion`."""
    n, m = len(meridian.levers), len(meridian.speeds)
    return MeridianTool(
        np.zeros(2), np.zeros(m), np.zeros(m), np.zeros(m), UNIT.copy(), np.zeros((n, 3)),
        np.zeros((n + 1, 4, 4)), np.zeros((6, n)),
    )  # fmt: skip


@compiled
def tool_motion(meridian: Meridian, joints: Array, tool: MeridianTool) -> None:
    """Compute position and velocities of the tool in a posture (m,)."""
    arm = meridian.arm
    chain_frames(arm, joints, tool.frames)
    joint_jacobian(arm, tool.frames, tool.J)
    joint_axes(arm, tool.frames, tool.axes)
    x, y = tool.frames[-1, 0, 3], tool.frames[-1, 1, 3]
    r = np.sqrt(x * x + y * y)
    if r > 0.0:  # on the axis itself every direction is as good as the last
        tool.away[0], tool.away[1] = x / r, y / r
    tool.at[0], tool.at[1] = r, tool.frames[-1, 2, 3]
    c, s = tool.away
    tool.out[:] = tool.aside[:] = tool.up[:] = 0.0
    for k in range(len(arm.axis)):
        j, ratio = arm.leader[k], arm.ratio[k]
        tool.out[j] += ratio * (c * tool.J[0, k] + s * tool.J[1, k])
        tool.aside[j] += ratio * (c * tool.J[1, k] - s * tool.J[0, k])
        tool.up[j] += ratio * tool.J[2, k]


@compiled
def to_level(meridian: Meridian, z: float, joints: Array, tool: MeridianTool) -> bool:
    """Bring a posture's tool to a height by Newton steps within the limits; ``tool`` is that posture's."""
    share, free, trial = 1.0, meridian.weights, np.empty(len(joints))
    tool_motion(meridian, joints, tool)
    miss = z - tool.at[1]
    for _ in range(CORRECTIONS):
        if abs(miss) <= LEVEL:
            return True
        square = 0.0
        for k in range(len(joints)):
            onwards = miss * tool.up[k]
            stopped = joints[k] >= meridian.upper[k] if onwards > 0.0 else joints[k] <= meridian.lower[k]
            if onwards != 0.0 and not stopped:
                square += free[k] * tool.up[k] * tool.up[k]
        if square < 1e-12:
            return False
        for k in range(len(joints)):
            step = share * free[k] * tool.up[k] * miss / square
            trial[k] = joints[k] + max(-1.0, min(1.0, step))
            trial[k] = max(meridian.lower[k], min(meridian.upper[k], trial[k]))
        tool_motion(meridian, trial, tool)
        left = z - tool.at[1]
        if abs(left) < abs(miss):
            joints[:], miss, share = trial, left, min(1.0, 2.0 * share)
        else:
            share *= 0.25
            tool_motion(meridian, joints, tool)
    return False


@compiled
def hop_stray(meridian: Meridian, a: Array, b: Array, tool: MeridianTool) -> float:
    """Most that a motion at one height from one posture (m,) to another strays from its chord [m].

    It is -1 where there is not proven to be one. Along the straight hop the height is off by at most E.
    Along a direction d it rises at least half as fast as in the middle of the hop, within 2 E of the hop: so
    every posture of it can be corrected.
    """
    m = len(a)
    hop, d = np.abs(b - a), np.zeros(m)
    off = _bent(meridian.bend, hop, hop) / 8.0 + 4.0 * LEVEL + ROUNDING
    tool_motion(meridian, 0.5 * (a + b), tool)
    held = np.zeros(m, dtype=np.bool_)
    for _ in range(m + 1):
        rise = 0.0
        for k in range(m):
            d[k] = 0.0 if held[k] else meridian.weights[k] * tool.up[k]
            rise += d[k] * tool.up[k]
        if rise < 1e-9:
            return -1.0
        d /= rise  # now the height rises by 1 for each unit of d, in the middle of the hop
        size = np.abs(d)
        if _bent(meridian.bend, size, 0.5 * hop + 2.0 * off * size) > 0.5:
            return -1.0
        fits = True
        for k in range(m):
            room = min(min(a[k], b[k]) - meridian.lower[k], meridian.upper[k] - max(a[k], b[k]))
            if not held[k] and room < 2.0 * off * size[k]:
                held[k], fits = True, False
        if fits:
            lever = 0.0
            for k in range(m):
                lever += size[k] * meridian.speeds[k]
            return float(off + 2.0 * off * lever)
    return -1.0


@compiled
def _bent(bend: Array, a: Array, b: Array) -> float:
    """Bound of a bilinear form with coefficients at most ``bend`` (m, m)."""
    total = 0.0
    for j in range(len(a)):
        for k in range(len(b)):
            total += bend[j, k] * a[j] * b[k]
    return total
