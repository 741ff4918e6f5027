"""Distances at which an arm in one plane meets thresholds: those proven to, and those not ruled out.

At a height, the distance of the tool, the pitch of the last link and the side of the elbow determine a
posture. Limits and thresholds are bounded over boxes of distance and pitch: a box all of whose postures meet
them proves its distances, and distances are ruled out with the last box of their pitches. What is left open
is bisected down to `MIN_UNDECIDED`.
"""

from __future__ import annotations

import math
import sys
from typing import NamedTuple

import numpy as np

from regionik.planners.kernels import compiled
from regionik.planners.reach.level_reach import merged
from regionik.planners.search.box_search import (
    NO_SIDE,
    Boxes,
    Verdict,
    begin_in_kernel,
    both,
    explore_in_kernel,
    interval_cos,
    interval_product,
    interval_sin,
    interval_square,
    left_open,
    opening,
    polar_angle,
    proven,
    verdict_of,
    within_limits,
)
from regionik.planners.solvers.planar_kinematics import LIMIT_SLACK, PlanarLinkage
from regionik.planners.solvers.posture_criteria import Thresholds
from regionik.worlds.arrays import Array

MIN_UNDECIDED = 2.5e-4  # of distances that are left undecided [m]
MAX_PITCH_SHARE = 0.3  # what a box of pitches may move the tool, against the width of its distances
ROUNDING = 1e-12
EVERY = sys.maxsize  # boxes: the search ends of itself


class _HeightThresholds(NamedTuple):
    """Thresholds of the postures at a height."""

    arm: PlanarLinkage
    demanded: Thresholds
    z: float  # height of the tool over the floor [m]
    low: float  # pitches of the last link [rad]
    high: float


class _LinkAngles(NamedTuple):
    """Intervals of the angles of the three links in the plane [rad]."""

    first: tuple[float, float]
    second: tuple[float, float]
    last: tuple[float, float]


class Distances(NamedTuple):
    """Distances from near to far, for which one pitch is sought that serves them all [m]."""

    thresholds: _HeightThresholds
    near: float
    far: float


def distances_within_thresholds(
    arm: PlanarLinkage, demanded: Thresholds, pitches: tuple[float, float], z: float, known: Array
) -> tuple[Array, Array]:
    """Signed distances at a height with a posture that meets limits and thresholds.

    Parameters
    ----------
    pitches : (low, high)
        Angles that the last link may take in the plane, infinite for any [rad].
    z : float
        Height of the tool over the floor [m].
    known : (k, 2) array
        Intervals outside of which nothing is in reach, apart and ascending [m].

    Returns
    -------
    inner, outer : (n, 2) array
        Intervals, each of whose distances has such a posture; and all outside of which no distance has one.
    """
    low, high = pitches if np.isfinite(pitches).all() else (-np.pi, np.pi)
    boxes = _pave(_HeightThresholds(arm, demanded, z, low, high), known[:, :1].copy(), known[:, 1:].copy())
    inner = proven(boxes)
    rows = np.column_stack([boxes.low, boxes.high])
    both = rows[inner], rows[np.concatenate([inner, left_open(boxes)])]
    first, second = (np.array(merged(some.tolist())).reshape(-1, 2) for some in both)
    return first, second


@compiled
def _pave(thresholds: _HeightThresholds, near: Array, far: Array) -> Boxes:
    boxes = begin_in_kernel(_judge_distances, thresholds, near, far)
    return explore_in_kernel(_judge_distances, thresholds, boxes, EVERY, EVERY)


@compiled
def _judge_distances(thresholds: _HeightThresholds, near: Array, far: Array) -> tuple[Verdict, float, int]:
    """Judge distances (1,): proven by one pitch that serves all of them, ruled out where none serves any."""
    distances = Distances(thresholds, near[0], far[0])
    low = np.array([[thresholds.low, -1.0], [thresholds.low, 1.0]])  # of pitch and elbow
    high = np.array([[thresholds.high, -1.0], [thresholds.high, 1.0]])
    boxes = begin_in_kernel(_judge_pitches, distances, low, high)
    boxes = explore_in_kernel(_judge_pitches, distances, boxes, EVERY, 1)
    return verdict_of(boxes), 0.0, 0 if far[0] - near[0] > MIN_UNDECIDED else NO_SIDE


@compiled
def _judge_pitches(distances: Distances, low: Array, high: Array) -> tuple[Verdict, float, int]:
    """Judge a box of pitches, and an elbow, over all distances; narrow ones come first."""
    width = high[0] - low[0]
    verdict = judge_pitch_box(distances, low[0], high[0], low[1])
    if verdict == Verdict.OPEN:
        middle = 0.5 * (low[0] + high[0])
        if judge_pitch_box(distances, middle, middle, low[1]) == Verdict.PROVEN:
            verdict = Verdict.PROVEN
    wide = distances.thresholds.arm.lengths[2] * width > MAX_PITCH_SHARE * (distances.far - distances.near)
    return verdict, -width, 0 if wide else NO_SIDE


@compiled
def judge_pitch_box(distances: Distances, low: float, high: float, elbow: float) -> Verdict:
    """Judge a box of distances and pitches: proven where all its postures meet the thresholds."""
    arm, demanded, z = distances.thresholds.arm, distances.thresholds.demanded, distances.thresholds.z
    near, far = distances.near, distances.far
    a, b, c = arm.lengths[0], arm.lengths[1], arm.lengths[2]
    cos0, cos1 = interval_cos(low, high)
    sin0, sin1 = interval_sin(low, high)
    x0, x1 = near - arm.shoulder_r, far - arm.shoulder_r
    y = z - arm.shoulder_z
    wx0, wx1, wy0, wy1 = x0 - c * cos1, x1 - c * cos0, y - c * sin1, y - c * sin0
    sx0, sx1 = interval_square(wx0, wx1)
    sy0, sy1 = interval_square(wy0, wy1)
    d0, d1 = np.sqrt(sx0 + sy0), np.sqrt(sx1 + sy1)
    if d0 > a + b + ROUNDING or d1 < abs(a - b) - ROUNDING:
        return Verdict.RULED_OUT
    sure = d0 >= abs(a - b) + ROUNDING and d1 <= a + b - ROUNDING
    d0 = min(max(d0, abs(a - b), ROUNDING), a + b)
    d1 = max(min(d1, a + b), d0)
    lead0, lead1 = polar_angle(wx0, wx1, wy0, wy1)
    root0, root1 = opening(a, b, d0, d1)
    tip0, tip1 = opening(b, a, d0, d1)
    if elbow > 0.0:
        first0, first1, second0, second1 = lead0 + root0, lead1 + root1, lead0 - tip1, lead1 - tip0
    else:
        first0, first1, second0, second1 = lead0 - root1, lead1 - root0, lead0 + tip0, lead1 + tip1
    # The bend at the elbow is the third side's alone: pi less the angle across from it.
    across0, across1 = _across(a, b, d0, d1)
    bend0, bend1 = (-across1, -across0) if elbow > 0.0 else (across0, across1)
    verdict = both(
        Verdict.PROVEN if sure else Verdict.OPEN,
        within_limits(first0, first1, arm.lower[0], arm.upper[0], LIMIT_SLACK),
    )
    verdict = both(verdict, within_limits(bend0, bend1, arm.lower[1], arm.upper[1], LIMIT_SLACK))
    verdict = both(
        verdict, within_limits(low - second1, high - second0, arm.lower[2], arm.upper[2], LIMIT_SLACK)
    )
    if verdict == Verdict.RULED_OUT:
        return Verdict.RULED_OUT
    links = _LinkAngles((first0, first1), (second0, second1), (low, high))
    verdict = both(verdict, _manipulable(distances, links))
    if verdict == Verdict.RULED_OUT:
        return Verdict.RULED_OUT
    return both(verdict, _within_torques(demanded, links))


@compiled
def _across(a: float, b: float, d0: float, d1: float) -> tuple[float, float]:
    """Bend between two links whose ends are (d0, d1) apart: 0 when stretched, pi when folded [rad]."""
    low = (d1 * d1 - a * a - b * b) / (2.0 * a * b)
    high = (d0 * d0 - a * a - b * b) / (2.0 * a * b)
    return math.acos(min(1.0, max(-1.0, low))), math.acos(min(1.0, max(-1.0, high)))


@compiled
def _manipulable(distances: Distances, links: _LinkAngles) -> Verdict:
    """Judge the manipulability of a box against its threshold; terms as in `threshold_margin`."""
    arm, demanded = distances.thresholds.arm, distances.thresholds.demanded
    if demanded.least <= 0.0:
        return Verdict.PROVEN
    (low, high), (second0, second1) = links.last, links.second
    x0, x1 = distances.near - arm.shoulder_r, distances.far - arm.shoulder_r
    y = distances.thresholds.z - arm.shoulder_z
    a, b, c = arm.lengths[0], arm.lengths[1], arm.lengths[2]
    p0, p1 = interval_cos(*links.first)
    q0, q1 = interval_product(*interval_sin(*links.first), x0, x1)
    u0, u1 = interval_square(a * (min(p0 * y, p1 * y) - q1), a * (max(p0 * y, p1 * y) - q0))
    p0, p1 = interval_cos(low, high)
    q0, q1 = interval_product(*interval_sin(low, high), x0, x1)
    v0, v1 = interval_square(c * (q0 - max(p0 * y, p1 * y)), c * (q1 - min(p0 * y, p1 * y)))
    w0, w1 = interval_sin(low - second1, high - second0)
    w0, w1 = interval_square(b * c * w0, b * c * w1)
    r0, r1 = interval_square(x0 + arm.shoulder_r, x1 + arm.shoulder_r)
    wanted = demanded.least * demanded.least
    if r1 * (u1 + v1 + w1) < wanted * (1.0 - ROUNDING):
        return Verdict.RULED_OUT
    return Verdict.PROVEN if r0 * (u0 + v0 + w0) > wanted * (1.0 + ROUNDING) else Verdict.OPEN


@compiled
def _within_torques(demanded: Thresholds, links: _LinkAngles) -> Verdict:
    """Judge the torques of a box against their limits."""
    verdict, least, most = Verdict.PROVEN, 0.0, 0.0
    for k in range(2, -1, -1):
        low, high = links.first if k == 0 else (links.second if k == 1 else links.last)
        pull, turn = demanded.pull[k]
        p0, p1 = interval_cos(low + turn, high + turn)
        least, most = least + pull * p0, most + pull * p1
        limit = demanded.most[k]
        if limit < np.inf:
            if least > limit + ROUNDING or most < -limit - ROUNDING:
                return Verdict.RULED_OUT
            if most > limit - ROUNDING or least < -limit + ROUNDING:
                verdict = Verdict.OPEN
    return verdict
