"""Walks of an arm in its meridian plane, at one height, proven to pass all distances that lie between.

Straight motion of the joints between two postures leaves the height a little; it is proven that moving along
one more direction brings every posture back to it, in exactly one way and within the limits. So the corrected
postures are a continuous motion at that height, and it passes all distances from the axis between those at
its ends.
"""

from __future__ import annotations

import math

import numpy as np

from regionik.planners.kernels import compiled
from regionik.planners.reach.meridian_plane import (
    LEVEL,
    Meridian,
    MeridianTool,
    hop_stray,
    to_level,
    tool_motion,
)
from regionik.worlds.arrays import Array

MOST_STEPS = 300  # of one walk
FIRST_STEP, LEAST_STEP = 0.3, 1e-5  # of a walk, as largest change of a joint [rad] or [m]
SWING = 0.5  # of the tool about the pivot axis, as far as the bounds of a walk are kept [rad]
HALVINGS = 40  # of the last hop of a walk that is to end at a distance
NEAR = 1e-9  # [m]
GAIN = 1e-5  # a walk ends where the next step promises no more [m]


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
    ``turns`` (3,) becomes the distance to which the tool's turn about the pivot axis is within ``SWING``, and
    bounds of that turn, from the start on.
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
        if gain <= 0.0 or (goal - r) * outwards <= 0.0 or r + outwards * GAIN < 0.0:
            break
        moved = False
        while stride > LEAST_STEP and gain / longest * stride > GAIN:
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
                    if turns[0] == r and left - right <= SWING:
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
def walk_both_ways(meridian: Meridian, z: float, starts: Array, tool: MeridianTool, found: Array) -> int:
    """Write what walks from starts (s, m) pass as rows of ``found`` (s, 6); returns how many.

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
        found[count, 0] = walk(meridian, z, -1.0, here, tool, MOST_STEPS, -np.inf, last, turns)
        found[count, 2], found[count, 4], found[count, 5] = turns[0], azimuth + turns[1], azimuth + turns[2]
        found[count, 1] = walk(meridian, z, 1.0, there, tool, MOST_STEPS, np.inf, last, turns)
        found[count, 3] = turns[0]
        found[count, 4] = min(found[count, 4], azimuth + turns[1])
        found[count, 5] = max(found[count, 5], azimuth + turns[2])
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
        off = abs(walk(meridian, z, outwards, here, tool, MOST_STEPS, goal, last, turns) - goal)
        for _ in range(HALVINGS):
            middle[:] = 0.5 * (last + here)
            if off <= LEVEL or not to_level(meridian, z, middle, tool):
                break
            if (goal - tool.at[0]) * outwards > 0.0:
                last[:] = middle
            else:
                here[:] = middle
                off = tool.at[0] - goal if outwards > 0.0 else goal - tool.at[0]
        if off < least:
            least = off
            joints[:] = here
            if off < NEAR:
                break
    return least
