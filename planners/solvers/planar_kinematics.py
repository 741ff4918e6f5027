"""Closed-form kinematics of an arm that works in one vertical plane, of three links; compiled.

Conventions: r points away from the pivot axis, z up; ``lower`` and ``upper`` bound the bend of each link
against the one before it (the first against the r axis), counter-clockwise from r to z [rad].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.angles import TWO_PI, fit
from regionik.planners.kernels import compiled
from regionik.planners.solvers.fabrik import Pair
from regionik.worlds.arrays import Array

LIMIT_SLACK = 1e-10  # rounding allowed when a bend is held against its limit [rad]
PITCH_SAMPLES = 180  # of the last link, tried to either side for the posture of least change
MAX_TILT = 0.5  # how far to either side [rad]


class PlanarLinkage(NamedTuple):
    """A planar arm for kernels: shoulder [m], link lengths [m], limits of the bends [rad]."""

    shoulder_r: float
    shoulder_z: float
    lengths: Array
    lower: Array
    upper: Array


@compiled
def two_link_angles(length_a: float, length_b: float, x: float, z: float) -> tuple[float, float, float, bool]:
    """Two links that end at (x, z): direction of the end, angles at root and end, False where out of reach.

    With the elbow on side e (+1 or -1) the links lie at ``lead + e * root`` and ``lead - e * tip``.
    """
    d2 = x * x + z * z
    d = np.sqrt(d2)
    if d > length_a + length_b or d < abs(length_a - length_b) or d == 0.0:
        return 0.0, 0.0, 0.0, False
    root = (d2 + length_a * length_a - length_b * length_b) / (2.0 * d * length_a)
    tip = (d2 + length_b * length_b - length_a * length_a) / (2.0 * d * length_b)
    root, tip = min(1.0, max(-1.0, root)), min(1.0, max(-1.0, tip))
    return math.atan2(z, x), math.acos(root), math.acos(tip), True


@compiled
def wrist_triangle(arm: PlanarLinkage, r: float, z: float, pitch: float) -> tuple[float, float, float, bool]:
    """`two_link_angles` of the first two links, the tool at (r, z) and the last link at a pitch."""
    x, y = r - arm.shoulder_r, z - arm.shoulder_z
    a, b, c = arm.lengths[0], arm.lengths[1], arm.lengths[2]
    return two_link_angles(a, b, x - c * math.cos(pitch), y - c * math.sin(pitch))


@compiled
def fitted_bends(arm: PlanarLinkage, a: float, b: float, c: float) -> tuple[float, float, float]:
    """Bends of absolute link angles, each taken to the turn within its limits [rad]."""
    return (
        fit(a, arm.lower[0], arm.upper[0])[0],
        fit(b - a, arm.lower[1], arm.upper[1])[0],
        fit(c - b, arm.lower[2], arm.upper[2])[0],
    )


@compiled
def limit_margin(arm: PlanarLinkage, a: float, b: float, c: float) -> float:
    """Least distance of the three bends to their limits, from absolute link angles; negative outside."""
    least = np.inf
    for i, angle in enumerate((a, b - a, c - b)):
        bend, over = fit(angle, arm.lower[i], arm.upper[i])
        room = -over if over > 0.0 else min(bend - arm.lower[i], arm.upper[i] - bend)
        least = min(least, room)
    return least


@compiled
def fits_limits(
    lower: Array, upper: Array, a: float, b: float, c: float, pitch_low: float, pitch_high: float
) -> bool:
    """True where absolute link angles keep every bend and the pitch of the last link within limits."""
    if fit(a, lower[0], upper[0])[1] > LIMIT_SLACK or fit(b - a, lower[1], upper[1])[1] > LIMIT_SLACK:
        return False
    return fit(c - b, lower[2], upper[2])[1] <= LIMIT_SLACK and (
        pitch_high - pitch_low >= TWO_PI or fit(c, pitch_low, pitch_high)[1] <= LIMIT_SLACK
    )


@compiled
def critical_posture(
    arm: PlanarLinkage, pitch_low: float, pitch_high: float, r: float, z: float
) -> tuple[bool, float, float, float]:
    """Angles of links that put the tool at (r, z) within limits and two pitches, after True if there are any.

    Every connected piece of the arm's self-motion holds a posture with a bend or the pitch at its limit,
    with the elbow straight or folded, or else every pitch; so it is enough to try those.
    """
    shoulder_r, shoulder_z, lengths, lower, upper = arm
    x, y = r - shoulder_r, z - shoulder_z
    a, b, c = lengths[0], lengths[1], lengths[2]
    for end in (pitch_low, pitch_high):
        pitch = end if np.isfinite(end) else 0.0
        lead, root, tip, ok = two_link_angles(a, b, x - c * math.cos(pitch), y - c * math.sin(pitch))
        for e in (-1.0, 1.0):
            first, second = lead + e * root, lead - e * tip
            if ok and fits_limits(lower, upper, first, second, pitch, pitch_low, pitch_high):
                return True, first, second, pitch
        if pitch_low == pitch_high:
            return False, 0.0, 0.0, 0.0
    for first in (lower[0], upper[0]):
        if np.isfinite(first):
            lead, root, tip, ok = two_link_angles(b, c, x - a * math.cos(first), y - a * math.sin(first))
            for e in (-1.0, 1.0):
                second, last = lead + e * root, lead - e * tip
                if ok and fits_limits(lower, upper, first, second, last, pitch_low, pitch_high):
                    return True, first, second, last
    for bend in (lower[1], upper[1], 0.0, math.pi):
        if np.isfinite(bend):
            er, ez = a + b * math.cos(bend), b * math.sin(bend)
            lead, root, tip, ok = two_link_angles(np.hypot(er, ez), c, x, y)
            for e in (-1.0, 1.0):
                first, last = lead + e * root - math.atan2(ez, er), lead - e * tip
                if ok and fits_limits(lower, upper, first, first + bend, last, pitch_low, pitch_high):
                    return True, first, first + bend, last
    for bend in (lower[2], upper[2]):
        if np.isfinite(bend):
            er, ez = b + c * math.cos(bend), c * math.sin(bend)
            lead, root, tip, ok = two_link_angles(a, np.hypot(er, ez), x, y)
            for e in (-1.0, 1.0):
                first, second = lead + e * root, lead - e * tip - math.atan2(ez, er)
                if ok and fits_limits(lower, upper, first, second, second + bend, pitch_low, pitch_high):
                    return True, first, second, second + bend
    return False, 0.0, 0.0, 0.0


@compiled
def widest_posture(arm: PlanarLinkage, pitch: float, r: float, z: float, bends: Array, tries: int) -> bool:
    """Among postures that reach (r, z), the one farthest from its limits; False where there is none."""
    best = -LIMIT_SLACK
    found = False
    count = 1 if np.isfinite(pitch) else tries
    for k in range(count):
        tool = pitch if np.isfinite(pitch) else TWO_PI * k / tries
        lead, root, tip, ok = wrist_triangle(arm, r, z, tool)
        for elbow in (-1.0, 1.0):
            first, second = lead + elbow * root, lead - elbow * tip
            if ok:
                room = min(limit_margin(arm, first, second, tool), np.pi)
                if room > best:
                    best, found = room, True
                    bends[0], bends[1], bends[2] = fitted_bends(arm, first, second, tool)
    if not found:  # it hides between two pitches
        pitch_low, pitch_high = (pitch, pitch) if np.isfinite(pitch) else (-np.inf, np.inf)
        found, first, second, tool = critical_posture(arm, pitch_low, pitch_high, r, z)
        if found:
            bends[0], bends[1], bends[2] = fitted_bends(arm, first, second, tool)
    return found


@compiled
def intervals_at_height(
    arm: PlanarLinkage, pitches: Pair, circles: Array, z: float, front: bool, back: bool, out: Array
) -> int:
    """Intervals of r that the tool can reach at height z; returns their number, fills ``out`` (k, 2).

    Parameters
    ----------
    pitches : (low, high)
        Of the last link [rad].
    circles : (n, 3) array
        Center r, z and radius of the circles on which the reach can begin or end [m].
    front, back : bool
        Which of r > 0 and r < 0 to take.
    """
    breaks = np.empty(2 * len(circles) + 1)
    n = 0
    for r, height, radius in circles:
        dz = z - height
        h2 = radius * radius - dz * dz
        if h2 >= 0.0:
            h = np.sqrt(h2)
            breaks[n], breaks[n + 1] = r - h, r + h
            n += 2
    if n == 0:
        return 0
    breaks[n] = 0.0  # front and back part at the axis
    n += 1
    ordered = np.sort(breaks[:n])
    count = 0
    open_end = np.nan
    for k in range(n - 1):
        a, b = ordered[k], ordered[k + 1]
        if b - a < 1e-9 or (a >= 0.0 and not front) or (b <= 0.0 and not back):
            continue
        if critical_posture(arm, pitches[0], pitches[1], 0.5 * (a + b), z)[0]:
            if count > 0 and a - open_end < 1e-9 and a != 0.0:
                out[count - 1, 1] = b
            elif count < len(out):
                out[count, 0], out[count, 1] = a, b
                count += 1
            open_end = b
    return count


@compiled
def nearest_posture(arm: PlanarLinkage, pitch: float, r: float, z: float, near: Array, bends: Array) -> float:
    """Among postures that reach (r, z), the one with the least largest change of a bend against ``near``.

    Pitches within `MAX_TILT` of the present one are tried; returns the change, inf for none.
    """
    if np.isfinite(pitch):
        return nearest_of(arm, np.full(1, pitch), r, z, near, bends)
    present, tools = near[0] + near[1] + near[2], np.empty(2 * PITCH_SAMPLES + 1)
    for k in range(len(tools)):
        tools[k] = present + MAX_TILT * (k - PITCH_SAMPLES) / PITCH_SAMPLES
    return nearest_of(arm, tools, r, z, near, bends)


@compiled
def nearest_of(arm: PlanarLinkage, pitches: Array, r: float, z: float, near: Array, bends: Array) -> float:
    """`nearest_posture` among those at given pitches of the last link (n,)."""
    best = np.inf
    for tool in pitches:
        lead, root, tip, ok = wrist_triangle(arm, r, z, tool)
        for elbow in (-1.0, 1.0):
            first, second = lead + elbow * root, lead - elbow * tip
            if ok and limit_margin(arm, first, second, tool) >= 0.0:
                a, b, c = fitted_bends(arm, first, second, tool)
                change = max(abs(a - near[0]), abs(b - near[1]), abs(c - near[2]))
                if change < best:
                    best = change
                    bends[0], bends[1], bends[2] = a, b, c
    return best


@compiled
def self_motion(arm: PlanarLinkage, pitches: Array, r: float, z: float, out: Array) -> int:
    """Postures that reach (r, z), elbow either way, at pitches of the last link (n,).

    Returns their number; fills bends into ``out`` (2 n, 3).
    """
    count = 0
    for tool in pitches:
        lead, root, tip, ok = wrist_triangle(arm, r, z, tool)
        for elbow in (-1.0, 1.0):
            first, second = lead + elbow * root, lead - elbow * tip
            if ok and limit_margin(arm, first, second, tool) >= 0.0:
                out[count, 0], out[count, 1], out[count, 2] = fitted_bends(arm, first, second, tool)
                count += 1
    return count
