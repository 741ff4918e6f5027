"""Cells of postures of an arm in one plane, wherever its base stands: bounds that hold all over a cell.

A posture that has its tool on the target is told by the plane's yaw, the pitch of the last link, how far the
pivot axis is from the target (negative where the arm works over its back), the turn of the pivot, and which
way the elbow bends. A cell is a box of the first four. How far the links' angles change in it follows from
how far the wrist may be from the shoulder.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.angles import fit, wrap
from regionik.planners.geometry.flat import compiled
from regionik.planners.solvers.planar_arm import LIMIT_SLACK, PlaneArm
from regionik.worlds.arrays import Array

SLACK = 1e-10  # rounding that no proof may rest on [m] or [rad]
YAW, PITCH, AWAY, TURN = range(4)  # the sides of a cell
GONE, CLEAR, DOUBT, NEAR = range(4)  # what is known of a cell


class Frame(NamedTuple):
    """How the arm stands on its base.

    Attributes
    ----------
    plane : PlaneArm
    mount : (2,) array
        The pivot axis in the base's frame [m].
    zero : float
        Direction of the plane, seen from the base, with the pivot at zero [rad].
    low, high : float
        What the pivot may turn [rad].
    yaw : float
        Heading of a base that keeps it; NaN where the heading is free [rad].
    """

    plane: PlaneArm
    mount: Array
    zero: float
    low: float
    high: float
    yaw: float


class Look(NamedTuple):
    """Room for what `weigh` finds of one cell.

    Attributes
    ----------
    bends : (3,) array
        Angles of the links in the middle of the cell; the first and second mean something if `CLEAR` [rad].
    points : (s, 2, 3) array
        Ends of the capsules: from the pivot axis along the plane, up, and off the plane [m].
    sway : (s, 2, 2) array
        Most that they move in the plane, seen from the target and from the pivot axis [m].
    wide : (4,) array
        How much each side of the cell leaves open; 0 for those that do not matter [m].
    """

    bends: Array
    points: Array
    sway: Array
    wide: Array


@compiled
def chord(turn: float) -> float:
    """Most that a point one metre off an axis moves in a turn [m]."""
    return 2.0 * math.sin(0.5 * min(turn, math.pi))


@compiled
def _cosine(a: float, b: float, d: float) -> float:
    """Of the angle between sides a and d of a triangle, opposite to b; below -1 or above 1 where none is."""
    return (d * d + a * a - b * b) / (2.0 * a * d) if d > 0.0 else 2.0


@compiled
def _angle(a: float, b: float, d: float) -> float:
    return math.acos(min(1.0, max(-1.0, _cosine(a, b, d))))


@compiled
def _spread(a: float, b: float, low: float, middle: float, high: float) -> float:
    """Most that a triangle's angle differs from its value at ``middle`` for a third side in [low, high]."""
    at = _angle(a, b, middle)
    most = max(abs(_angle(a, b, low) - at), abs(_angle(a, b, high) - at))
    if a > b:
        turning = math.sqrt(a * a - b * b)  # the angle grows up to here
        if low < turning < high:
            most = max(most, abs(_angle(a, b, turning) - at))
    return most


@compiled
def links(frame: Frame, z: float, elbow: float, mid: Array, half: Array, look: Look, vary: Array) -> int:
    """Angles of the links at the middle of a cell, and by how much they vary in it (3,) [rad].

    Returns `GONE` where no posture of the cell is within the limits, `CLEAR` where the middle is one,
    otherwise `DOUBT`.
    """
    plane = frame.plane
    a, b, c = plane.lengths[0], plane.lengths[1], plane.lengths[2]
    pitch, away = mid[PITCH], mid[AWAY]
    x = away - plane.shoulder_r - c * math.cos(pitch)
    y = z - plane.shoulder_z - c * math.sin(pitch)
    d, moved = math.sqrt(x * x + y * y), half[AWAY] + c * chord(half[PITCH])
    low, high = max(d - moved, abs(a - b), 1e-9), min(d + moved, a + b)
    if low > high + SLACK:
        return GONE
    high = max(low, high)
    at = min(high, max(low, d))
    bend_low, bend_high = math.pi - _opposite(a, b, high), math.pi - _opposite(a, b, low)
    middle, swing = -elbow * 0.5 * (bend_low + bend_high), 0.5 * (bend_high - bend_low)
    if fit(middle, plane.lower[1], plane.upper[1])[1] > swing + SLACK:
        return GONE
    lead = math.atan2(y, x)
    sway = math.pi if moved >= d else math.asin(moved / d)
    look.bends[0] = lead + elbow * _angle(a, b, at)
    look.bends[1] = lead - elbow * _angle(b, a, at)
    look.bends[2] = pitch
    vary[0] = min(math.pi, sway + _spread(a, b, low, at, high))
    vary[1] = min(math.pi, sway + _spread(b, a, low, at, high))
    vary[2] = half[PITCH]
    first = fit(look.bends[0], plane.lower[0], plane.upper[0])[1]
    last = fit(pitch - look.bends[1], plane.lower[2], plane.upper[2])[1]
    if first > vary[0] + SLACK or last > vary[1] + vary[2] + SLACK:
        return GONE
    bend = fit(look.bends[1] - look.bends[0], plane.lower[1], plane.upper[1])[1]
    fits = max(first, last, bend) <= LIMIT_SLACK
    return CLEAR if fits and at == d else DOUBT


@compiled
def _opposite(a: float, b: float, d: float) -> float:
    """Angle of a triangle between sides a and b, opposite to d."""
    return math.acos(min(1.0, max(-1.0, (a * a + b * b - d * d) / (2.0 * a * b))))


@compiled
def turned_by(frame: Frame, mid: Array, half: Array) -> bool:
    """Set the pivot's turn of a cell of a base that keeps its heading; False where it cannot turn so far."""
    if np.isnan(frame.yaw):
        return True
    turn, over = fit(wrap(mid[YAW] - frame.yaw - frame.zero), frame.low, frame.high)
    mid[TURN], half[TURN] = turn, half[YAW]
    if over > 0.0:
        mid[TURN] = wrap(mid[YAW] - frame.yaw - frame.zero)
    return bool(over <= half[YAW] + SLACK)
