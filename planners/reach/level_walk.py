"""Proven motions of an arm with its tool at one height: the distances that they pass are in reach.

A walk goes from posture to posture at the height. Straight motion of the joints between two of them leaves
the height a little; it is proven that moving along one more direction brings every posture back to it, in
exactly one way and within the limits. So the corrected postures are a continuous motion at that height, and
it passes all distances from the axis between those at its ends.
"""

from __future__ import annotations

import numpy as np

from regionik.planners.geometry.polygons import compiled
from regionik.planners.reach.meridian_plane import Meridian, Tool, look
from regionik.worlds.arrays import Array

LEVEL = 1e-12  # how near to the height a posture of a walk is [m]
ROUNDING = 1e-12  # added to bounds [m]
CORRECTIONS = 40  # Newton steps to the height
FIRST_STEP, LEAST_STEP = 0.3, 1e-5  # of a walk, as largest change of a joint [rad] or [m]
HALVINGS = 40  # of the last hop of a walk that is to end at a distance
NEAR = 1e-9  # [m]
GAIN = 1e-5  # a walk ends where the next step promises no more [m]


@compiled
def to_level(meridian: Meridian, z: float, joints: Array, tool: Tool, free: Array, trial: Array) -> bool:
    """Bring the tool of a posture to a height, by Newton steps within the limits; ``tool`` is that posture's.

    ``free`` (m,) weighs the joints; ``trial`` (m,) is scratch space.
    """
    share = 1.0
    look(meridian, joints, tool)
    miss = z - tool.at[1]
    for _ in range(CORRECTIONS):
        if abs(miss) <= LEVEL:
            return True
        square = 0.0
        for k in range(len(joints)):
            onwards = miss * tool.up[k]
            if (onwards > 0.0 and joints[k] < meridian.upper[k]) or (
                onwards < 0.0 and joints[k] > meridian.lower[k]
            ):
                square += free[k] * tool.up[k] * tool.up[k]
        if square < 1e-12:
            return False
        for k in range(len(joints)):
            step = share * free[k] * tool.up[k] * miss / square
            trial[k] = joints[k] + max(-1.0, min(1.0, step))
            trial[k] = max(meridian.lower[k], min(meridian.upper[k], trial[k]))
        look(meridian, trial, tool)
        left = z - tool.at[1]
        if abs(left) < abs(miss):
            joints[:], miss, share = trial, left, min(1.0, 2.0 * share)
        else:
            share *= 0.25
            look(meridian, joints, tool)
    return False


@compiled
def hop_holds(meridian: Meridian, a: Array, b: Array, tool: Tool, free: Array) -> bool:
    """True where a motion at one height is proven to lead from one posture (m,) at it to another.

    Along the straight hop the height is off by at most E. Along a direction d it rises at least half as fast
    as in the middle of the hop, within 2 E of the hop: so every posture of it can be corrected.
    """
    m = len(a)
    hop, d = np.abs(b - a), np.zeros(m)
    off = _bent(meridian.bend, hop, hop) / 8.0 + 4.0 * LEVEL + ROUNDING
    look(meridian, 0.5 * (a + b), tool)
    held = np.zeros(m, dtype=np.bool_)
    for _ in range(m + 1):
        rise = 0.0
        for k in range(m):
            d[k] = 0.0 if held[k] else free[k] * tool.up[k]
            rise += d[k] * tool.up[k]
        if rise < 1e-9:
            return False
        d /= rise  # now the height rises by 1 for each unit of d, in the middle of the hop
        size = np.abs(d)
        if _bent(meridian.bend, size, 0.5 * hop + 2.0 * off * size) > 0.5:
            return False
        fits = True
        for k in range(m):
            room = min(min(a[k], b[k]) - meridian.lower[k], meridian.upper[k] - max(a[k], b[k]))
            if not held[k] and room < 2.0 * off * size[k]:
                held[k], fits = True, False
        if fits:
            return True
    return False


@compiled
def _bent(bend: Array, a: Array, b: Array) -> float:
    """Bound of a bilinear form with coefficients at most ``bend`` (m, m)."""
    total = 0.0
    for j in range(len(a)):
        for k in range(len(b)):
            total += bend[j, k] * a[j] * b[k]
    return total


@compiled
def walk(
    meridian: Meridian,
    z: float,
    outwards: float,
    joints: Array,
    tool: Tool,
    most: int,
    goal: float,
    last: Array,
) -> float:
    """Walk at one height out (``outwards`` 1) or in (-1), to a distance or as far as it goes; where to [m].

    ``joints`` (m,) starts at the height and becomes the last posture of the walk, ``last`` the one before.
    """
    m = len(joints)
    free = weights(meridian)
    d, trial, spare = np.empty(m), np.empty(m), np.empty(m)
    last[:] = joints
    look(meridian, joints, tool)
    r, stride = float(tool.at[0]), FIRST_STEP
    for _ in range(most):
        look(meridian, joints, tool)
        gain = _uphill(meridian, outwards, joints, tool, free, d)
        longest = np.abs(d).max()
        if gain <= 0.0 or (goal - r) * outwards <= 0.0 or r + outwards * GAIN < 0.0:
            break
        moved = False
        while stride > LEAST_STEP and gain / longest * stride > GAIN:
            for k in range(m):
                step = stride / longest * d[k]
                trial[k] = max(meridian.lower[k], min(meridian.upper[k], joints[k] + step))
            if to_level(meridian, z, trial, tool, free, spare):
                far = float(tool.at[0])
                if (far - r) * outwards > 0.0 and hop_holds(meridian, joints, trial, tool, free):
                    last[:], joints[:] = joints, trial
                    r, moved = far, True
                    break
            stride *= 0.5
        if not moved:
            break
        stride = min(FIRST_STEP, 1.6 * stride)
    return float(r)


@compiled
def weights(meridian: Meridian) -> Array:
    """Weights of the joints (m,): the less, the farther a joint moves the tool."""
    return 1.0 / np.maximum(meridian.levers, 1e-3)


@compiled
def _uphill(meridian: Meridian, outwards: float, joints: Array, tool: Tool, free: Array, d: Array) -> float:
    """Write the direction of steepest ascent at one height within limits into ``d``; returns its gain."""
    m = len(joints)
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
def walks(meridian: Meridian, z: float, starts: Array, tool: Tool, most: int, found: Array) -> int:
    """Write distances passed by walks from starts (s, m) as rows of ``found`` (s, 2); returns how many."""
    free, last = weights(meridian), np.empty(starts.shape[1])
    count = 0
    for start in starts:
        here = start.copy()
        if not to_level(meridian, z, here, tool, free, last):
            continue
        there = here.copy()
        found[count, 0] = walk(meridian, z, -1.0, here, tool, most, -np.inf, last)
        found[count, 1] = walk(meridian, z, 1.0, there, tool, most, np.inf, last)
        count += 1
    return count


@compiled
def posture_on(
    meridian: Meridian, z: float, goal: float, starts: Array, tool: Tool, most: int, joints: Array
) -> float:
    """Walk to a posture at a height and a distance, from one start after the other; returns its error [m].

    ``joints`` (m,) becomes that posture. The last hop of a walk is halved until it ends at the distance.
    """
    free, m = weights(meridian), starts.shape[1]
    last, middle, spare = np.empty(m), np.empty(m), np.empty(m)
    least = np.inf
    for start in starts:
        here = start.copy()
        if not to_level(meridian, z, here, tool, free, spare):
            continue
        outwards = 1.0 if goal > tool.at[0] else -1.0
        off = abs(walk(meridian, z, outwards, here, tool, most, goal, last) - goal)
        for _ in range(HALVINGS):
            middle[:] = 0.5 * (last + here)
            if off <= LEVEL or not to_level(meridian, z, middle, tool, free, spare):
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
