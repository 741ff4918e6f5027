"""The turns that a FABRIK-R step chooses from: pointing a link, eq. (6), and what limits leave of them."""

from __future__ import annotations

import numpy as np

from regionik.planners.geometry.angles import TWO_PI, wrap
from regionik.planners.geometry.polygons import compiled
from regionik.planners.geometry.vectors import Vector, across, cross, dot, minus, norm, rotated, scaled
from regionik.worlds.arrays import Array

NOTHING = 1e-13  # lengths, and products of lengths, that are rounding and give no direction [m, m^2]
TIE = 1e-9  # candidates this near to each other are equally good [m, rad]


@compiled
def held(wanted: float, now: float, lower: float, upper: float) -> float:
    """The turn of ``wanted`` within the limits, nearest to ``now``; else the nearer limit."""
    value = now + wrap(wanted - now)
    if lower <= value <= upper:
        return value
    above = lower + (wanted - lower) % TWO_PI if np.isfinite(lower) else upper - (upper - wanted) % TWO_PI
    if lower <= above <= upper:
        return above
    return upper if above - upper <= TWO_PI - (above - lower) else lower


@compiled
def pointing(axis: Vector, link: Vector, line: Vector, now: float) -> float:
    """Turn about ``axis`` that points ``link`` along ``line`` as far as it can; ``now`` where none does."""
    link, line = across(link, axis), across(line, axis)
    c, s = dot(link, line), dot(axis, cross(link, line))
    if np.hypot(c, s) <= NOTHING * norm(link):
        return now
    angle: float = np.arctan2(s, c)
    return angle


@compiled
def planar_turn(
    axis: Vector,
    normal: Vector,
    line: Vector,
    link: Vector,
    nearest: Vector,
    now: float,
    lower: float,
    upper: float,
    sense: float,
) -> float:
    """Eq. (6): the turn about ``axis`` that makes ``normal`` normal to ``line``.

    Of two roots the one within the limits wins, then the one of the smallest circumference (the end of
    ``link`` nearest to the next point), then the smaller turn. Where there is no root, the closest
    approach.
    """
    K1, K2 = dot(line, normal), dot(axis, normal) * dot(line, axis)
    a, K3 = K1 - K2, dot(line, cross(axis, normal))
    R = np.hypot(a, K3)
    if R <= NOTHING:
        return held(now, now, lower, upper)
    delta = np.arctan2(K3, a)
    half = np.arctan2(np.sqrt(max(0.0, (R - K2) * (R + K2))), -K2)
    best, best_out, best_gap, best_turn = now, np.inf, np.inf, np.inf
    for side in (1.0, -1.0):
        wanted = sense * (delta + side * half)
        value = held(wanted, now, lower, upper)
        out = abs(wrap(value - wanted))
        gap = norm(minus(rotated(axis, sense * value, link), nearest))
        turn = abs(value - now)
        better = out < best_out - TIE
        if not better and out <= best_out + TIE:
            better = gap < best_gap - TIE or (gap <= best_gap + TIE and turn < best_turn)
        if better:
            best, best_out, best_gap, best_turn = value, out, gap, turn
    return best


@compiled
def turn_frame(x: Vector, z: Vector, new_x: Vector, new_z: Vector, turn: Array) -> None:
    """Turn ``turn`` (3, 3) as that takes the directions x, z (at right angles) to new_x, new_z."""
    x, z = scaled(x, 1.0 / norm(x)), scaled(z, 1.0 / norm(z))
    new_x, new_z = scaled(new_x, 1.0 / norm(new_x)), scaled(new_z, 1.0 / norm(new_z))
    y, new_y = cross(z, x), cross(new_z, new_x)
    for j in range(3):
        column = (turn[0, j], turn[1, j], turn[2, j])
        a, b, c = dot(x, column), dot(y, column), dot(z, column)
        for i in range(3):
            turn[i, j] = a * new_x[i] + b * new_y[i] + c * new_z[i]


@compiled
def product(A: Array, B: Array, out: Array) -> None:
    """A B of the 3 x 3 parts."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]


@compiled
def product_back(A: Array, B: Array, out: Array) -> None:
    """A B^T of the 3 x 3 parts."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[j, 0] + A[i, 1] * B[j, 1] + A[i, 2] * B[j, 2]
