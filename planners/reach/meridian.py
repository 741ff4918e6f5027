"""An arm on a vertical pivot in its meridian plane, and walks of it at one height.

The pivot turns the tool about its axis; all that the other joints do for reach shows in two numbers, the
tool's distance from the axis and its height. Straight motion of the joints between two postures leaves the
height a little; it is proven that moving along one more direction brings every posture back to it, in exactly
one way and within the limits. So the corrected postures are a continuous motion at that height, and it passes
all distances from the axis between those at its ends.
"""

from __future__ import annotations

import math
from dataclasses import replace
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

MIN_LEVER = 1e-12  # a lever below this does not move the tool [m]; limits closer than this hold still
UNIT = np.array([1.0, 0.0])
HEIGHT_TOLERANCE = 1e-12  # how near to the height a posture of a walk is [m]
ROUNDING = 1e-12  # added to bounds [m]
MAX_CORRECTIONS = 40  # Newton steps to the height


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
        held = joint.upper - joint.lower < MIN_LEVER
        if joint is pivot or held or (joint.name in alone and lever < MIN_LEVER):
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
    for _ in range(MAX_CORRECTIONS):
        if abs(miss) <= HEIGHT_TOLERANCE:
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
    off = _bent(meridian.bend, hop, hop) / 8.0 + 4.0 * HEIGHT_TOLERANCE + ROUNDING
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


MAX_STEPS = 300  # of one walk
FIRST_STEP, MIN_STEP = 0.3, 1e-5  # of a walk, as largest change of a joint [rad] or [m]
MAX_SWING = 0.5  # of the tool about the pivot axis, as far as the bounds of a walk are kept [rad]
MAX_HALVINGS = 40  # of the last hop of a walk that is to end at a distance
DISTANCE_TOLERANCE = 1e-9  # [m]
MIN_GAIN = 1e-5  # a walk ends where the next step promises no more [m]


@compiled
def walk(
    meridian: Meridian,
    z: float,
    outwards: float,
    joints: Array,
    tool: MeridianTool,
    most: int,
    goal: float,
    last: Array,
    turns: Array,
) -> float:
    """Walk at one height out (``outwards`` 1) or in (-1), to a distance or as far as it goes; where to [m].

    ``joints`` (m,) starts at the height and becomes the last posture of the walk, ``last`` the one before.
    ``turns`` (3,) becomes the distance to which the tool's turn about the pivot axis is within ``MAX_SWING``,
    and bounds of that turn, from the start on.
    """
    m = len(joints)
    d, trial = np.empty(m), np.empty(m)
    last[:] = joints
    tool_motion(meridian, joints, tool)
    r, stride, turn = float(tool.at[0]), FIRST_STEP, 0.0
    turns[0], turns[1], turns[2] = r, 0.0, 0.0
    for _ in range(most):
        tool_motion(meridian, joints, tool)
        x, y = tool.away
        gain = _uphill(meridian, outwards, joints, tool, d)
        longest = np.abs(d).max()
        if gain <= 0.0 or (goal - r) * outwards <= 0.0 or r + outwards * MIN_GAIN < 0.0:
            break
        moved = False
        while stride > MIN_STEP and gain / longest * stride > MIN_GAIN:
            for k in range(m):
                step = stride / longest * d[k]
                trial[k] = max(meridian.lower[k], min(meridian.upper[k], joints[k] + step))
            if to_level(meridian, z, trial, tool):
                far, c = float(tool.at[0]), x * tool.away[0] + y * tool.away[1]
                s = x * tool.away[1] - y * tool.away[0]
                onward = (far - r) * outwards > 0.0
                stray = hop_stray(meridian, joints, trial, tool) if onward else -1.0
                if stray >= 0.0:
                    swing, near = math.atan2(s, c), max(0.0, c) * min(r, far)
                    aside = math.asin(stray / near) if stray < near else np.pi
                    right = min(turns[1], turn + min(0.0, swing) - aside)
                    left = max(turns[2], turn + max(0.0, swing) + aside)
                    if turns[0] == r and left - right <= MAX_SWING:
                        turns[0], turns[1], turns[2] = far, right, left
                    turn += swing
                    last[:], joints[:] = joints, trial
                    r, moved = far, True
                    break
            stride *= 0.5
        if not moved:
            break
        stride = min(FIRST_STEP, 1.6 * stride)
    return float(r)


@compiled
def _uphill(meridian: Meridian, outwards: float, joints: Array, tool: MeridianTool, d: Array) -> float:
    """Write the direction of steepest ascent at one height within limits into ``d``; returns its gain."""
    m, free = len(joints), meridian.weights
    held = np.zeros(m, dtype=np.bool_)
    for _ in range(m + 1):
        along = square = 0.0
        for k in range(m):
            if not held[k]:
                along += free[k] * tool.out[k] * tool.up[k]
                square += free[k] * tool.up[k] * tool.up[k]
        share = along / square if square > 1e-12 else 0.0
        gain, again = 0.0, False
        for k in range(m):
            d[k] = 0.0 if held[k] else outwards * free[k] * (tool.out[k] - share * tool.up[k])
            if (d[k] < 0.0 and joints[k] <= meridian.lower[k]) or (
                d[k] > 0.0 and joints[k] >= meridian.upper[k]
            ):
                held[k], again = True, True
            else:
                gain += outwards * d[k] * tool.out[k]
        if not again:
            break
    return gain


@compiled
def walk_both_ways(meridian: Meridian, z: float, starts: Array, tool: MeridianTool, walks: Array) -> int:
    """Write what walks from starts (s, m) pass as rows of ``walks`` (s, 6); returns how many.

    A row is the least and largest distance; then those between which the tool's azimuth, with the pivot at
    zero, has bounds, and these.
    """
    last, turns = np.empty(starts.shape[1]), np.empty(3)
    count = 0
    for start in starts:
        here = start.copy()
        if not to_level(meridian, z, here, tool):
            continue
        there, azimuth = here.copy(), math.atan2(tool.away[1], tool.away[0])
        walks[count, 0] = walk(meridian, z, -1.0, here, tool, MAX_STEPS, -np.inf, last, turns)
        walks[count, 2], walks[count, 4], walks[count, 5] = turns[0], azimuth + turns[1], azimuth + turns[2]
        walks[count, 1] = walk(meridian, z, 1.0, there, tool, MAX_STEPS, np.inf, last, turns)
        walks[count, 3] = turns[0]
        walks[count, 4] = min(walks[count, 4], azimuth + turns[1])
        walks[count, 5] = max(walks[count, 5], azimuth + turns[2])
        count += 1
    return count


@compiled
def walk_to_posture(
    meridian: Meridian, z: float, goal: float, starts: Array, tool: MeridianTool, joints: Array
) -> float:
    """Walk to a posture at a height and a distance, from one start after the other; returns its error [m].

    ``joints`` (m,) becomes that posture. The last hop of a walk is halved until it ends at the distance.
    """
    m, least = starts.shape[1], np.inf
    last, middle, turns = np.empty(m), np.empty(m), np.empty(3)
    for start in starts:
        here = start.copy()
        if not to_level(meridian, z, here, tool):
            continue
        outwards = 1.0 if goal > tool.at[0] else -1.0
        off = abs(walk(meridian, z, outwards, here, tool, MAX_STEPS, goal, last, turns) - goal)
        for _ in range(MAX_HALVINGS):
            middle[:] = 0.5 * (last + here)
            if off <= HEIGHT_TOLERANCE or not to_level(meridian, z, middle, tool):
                break
            if (goal - tool.at[0]) * outwards > 0.0:
                last[:] = middle
            else:
                here[:] = middle
                off = tool.at[0] - goal if outwards > 0.0 else goal - tool.at[0]
        if off < least:
            least = off
            joints[:] = here
            if off < DISTANCE_TOLERANCE:
                break
    return least
