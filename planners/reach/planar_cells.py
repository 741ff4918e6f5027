"""Cells of postures of an arm in one plane with its base anywhere: bounds that hold all over a cell.

A posture with its tool on the target is given by the plane's yaw, the pitch of the last link, how far the
pivot axis is from the target (negative where the arm works over its back), the turn of the pivot, and which
way the elbow bends. A cell is a box of these. How far the links' angles vary in it follows from how far the
wrist may be from the shoulder.

Verdicts on a cell: RULED_OUT holds for all of it, PROVEN for the posture in its middle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.angles import fit, wrap
from regionik.planners.kernels import compiled
from regionik.planners.search.box_search import PROOF_SLACK, Verdict
from regionik.planners.solvers.planar_kinematics import LIMIT_SLACK, PlanarLinkage
from regionik.worlds.arrays import Array

YAW, PITCH, AWAY, TURN, ELBOW = range(5)  # the sides of a cell; the elbow is -1 or 1


class ArmMount(NamedTuple):
    """The arm as it stands on its base."""

    plane: PlanarLinkage
    # sign, offset: (3,) ``bend = sign * joint + offset`` [rad]
    sign: Array
    offset: Array
    mount: Array  # (2,) the pivot axis in the base's frame [m]
    zero: float  # direction of the plane, seen from the base, with the pivot at zero [rad]
    low: float  # limits of the pivot [rad]
    high: float
    yaw: float  # heading of a base that keeps it; NaN where the heading is free [rad]


class PlanarCell(NamedTuple):
    """One cell, and what is found of it for an arm with s capsules; scratch space."""

    middle: Array  # (5,)
    half: Array  # (5,) half widths
    bends: Array  # (3,) angles of the links in the middle [rad]
    vary: Array  # (3,) by how much these vary in the cell [rad]
    points: Array  # (s, 2, 3) ends of the capsules: from the pivot axis along the plane, up, off it [m]
    moves: Array  # (s, 2, 2) most that they move in the plane, seen from target and pivot axis [m]
    open: Array  # (5,) how much each side leaves open; 0 for those that do not matter [m]


def cell_for(capsules: int) -> PlanarCell:
    """Scratch space for an arm with so many capsules."""
    s = capsules
    return PlanarCell(
        np.empty(5), np.empty(5), np.empty(3), np.empty(3), np.empty((s, 2, 3)), np.empty((s, 2, 2)),
        np.empty(5),
    )  # fmt: skip


@compiled
def chord(turn: float) -> float:
    """Chord of a turn at radius 1: how far a point one metre off the axis goes, 2 sin(turn / 2) [m]."""
    return 2.0 * math.sin(0.5 * min(turn, math.pi))


@compiled
def _angle(a: float, b: float, d: float) -> float:
    """Angle of a triangle between sides a and d, opposite to b; where there is none, the nearest."""
    cosine = (d * d + a * a - b * b) / (2.0 * a * d) if d > 0.0 else 2.0
    return math.acos(min(1.0, max(-1.0, cosine)))


@compiled
def _spread(a: float, b: float, low: float, middle: float, high: float) -> float:
    """Largest change of a triangle's angle from its value at ``middle`` for a third side in [low, high]."""
    at = _angle(a, b, middle)
    most = max(abs(_angle(a, b, low) - at), abs(_angle(a, b, high) - at))
    if a > b:
        turning = math.sqrt(a * a - b * b)  # the angle grows up to here
        if low < turning < high:
            most = max(most, abs(_angle(a, b, turning) - at))
    return most


@compiled
def judge_links(plane: PlanarLinkage, z: float, cell: PlanarCell) -> Verdict:
    """Judge a cell by the links' lengths and limits; writes ``bends`` and ``vary``.

    The first and second of ``bends`` mean nothing where the links do not meet in the middle.
    """
    mid, half, vary, elbow = cell.middle, cell.half, cell.vary, cell.middle[ELBOW]
    a, b, c = plane.lengths[0], plane.lengths[1], plane.lengths[2]
    pitch, away = mid[PITCH], mid[AWAY]
    x = away - plane.shoulder_r - c * math.cos(pitch)
    y = z - plane.shoulder_z - c * math.sin(pitch)
    d, moved = math.sqrt(x * x + y * y), half[AWAY] + c * chord(half[PITCH])
    low, high = max(d - moved, abs(a - b), 1e-9), min(d + moved, a + b)
    if low > high + PROOF_SLACK:
        return Verdict.RULED_OUT
    high = max(low, high)
    at = min(high, max(low, d))
    bend_low, bend_high = math.pi - _opposite(a, b, high), math.pi - _opposite(a, b, low)
    middle, swing = -elbow * 0.5 * (bend_low + bend_high), 0.5 * (bend_high - bend_low)
    if fit(middle, plane.lower[1], plane.upper[1])[1] > swing + PROOF_SLACK:
        return Verdict.RULED_OUT
    lead = math.atan2(y, x)
    seen = math.pi if moved >= d else math.asin(moved / d)
    cell.bends[0] = lead + elbow * _angle(a, b, at)
    cell.bends[1] = lead - elbow * _angle(b, a, at)
    cell.bends[2] = pitch
    vary[0] = min(math.pi, seen + _spread(a, b, low, at, high))
    vary[1] = min(math.pi, seen + _spread(b, a, low, at, high))
    vary[2] = half[PITCH]
    first = fit(cell.bends[0], plane.lower[0], plane.upper[0])[1]
    last = fit(pitch - cell.bends[1], plane.lower[2], plane.upper[2])[1]
    if first > vary[0] + PROOF_SLACK or last > vary[1] + vary[2] + PROOF_SLACK:
        return Verdict.RULED_OUT
    bend = fit(cell.bends[1] - cell.bends[0], plane.lower[1], plane.upper[1])[1]
    fits = max(first, last, bend) <= LIMIT_SLACK
    return Verdict.PROVEN if fits and at == d else Verdict.OPEN


@compiled
def _opposite(a: float, b: float, d: float) -> float:
    """Angle of a triangle between sides a and b, opposite to d."""
    return math.acos(min(1.0, max(-1.0, (a * a + b * b - d * d) / (2.0 * a * b))))


@compiled
def turn_pivot(mount: ArmMount, cell: PlanarCell) -> bool:
    """Set the pivot's turn in a cell of a base that keeps its heading; False where it cannot turn so far."""
    if np.isnan(mount.yaw):
        return True
    mid, half = cell.middle, cell.half
    wanted = wrap(mid[YAW] - mount.yaw - mount.zero)
    turn, over = fit(wanted, mount.low, mount.high)
    mid[TURN], half[TURN] = wanted if over > 0.0 else turn, half[YAW]
    return bool(over <= half[YAW] + PROOF_SLACK)
