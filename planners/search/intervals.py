"""Interval arithmetic for kernels: (low, high) in, (low, high) out, each holding all values there are.

Source: Jaulin, Kieffer, Didrit and Walter, Applied Interval Analysis, 2001: inclusion functions (2.4) and
contractors (4.2).
"""

from __future__ import annotations

import math

import numpy as np

from regionik.planners.kernels import compiled
from regionik.planners.search.box_search import Verdict
from regionik.worlds.arrays import Array

TWO_PI = 2.0 * np.pi
WORTH = 0.9  # a contraction is repeated if it left less than this share of some side


@compiled
def interval_cos(low: float, high: float) -> tuple[float, float]:
    """Cosine of an interval of angles [rad]."""
    if high - low >= TWO_PI:
        return -1.0, 1.0
    a, b = math.cos(low), math.cos(high)
    least, most = min(a, b), max(a, b)
    if np.ceil(low / TWO_PI) * TWO_PI <= high:
        most = 1.0
    if np.ceil((low - np.pi) / TWO_PI) * TWO_PI + np.pi <= high:
        least = -1.0
    return least, most


@compiled
def interval_sin(low: float, high: float) -> tuple[float, float]:
    """Sine of an interval of angles [rad]."""
    return interval_cos(low - 0.5 * np.pi, high - 0.5 * np.pi)


@compiled
def interval_product(a: float, b: float, c: float, d: float) -> tuple[float, float]:
    """(a, b) times (c, d)."""
    p, q, r, s = a * c, a * d, b * c, b * d
    return min(min(p, q), min(r, s)), max(max(p, q), max(r, s))


@compiled
def interval_square(low: float, high: float) -> tuple[float, float]:
    """Square of an interval."""
    a, b = low * low, high * high
    return (0.0 if low <= 0.0 <= high else min(a, b)), max(a, b)


@compiled
def opening(own: float, other: float, low: float, high: float) -> tuple[float, float]:
    """Angle of a triangle between side ``own`` and a third side of a length in (low, high) > 0 [rad]."""
    spread = own * own - other * other
    a, b = (low + spread / low) / (2.0 * own), (high + spread / high) / (2.0 * own)
    least, most = min(a, b), max(a, b)
    if spread > 0.0 and low * low < spread < high * high:  # convex in the third side
        least = np.sqrt(spread) / own
    return math.acos(min(1.0, max(-1.0, most))), math.acos(min(1.0, max(-1.0, least)))


@compiled
def polar_angle(x0: float, x1: float, y0: float, y1: float) -> tuple[float, float]:
    """Angle of all points of a box, seen from the origin, as an interval that may pass pi [rad]."""
    if x0 <= 0.0 <= x1 and y0 <= 0.0 <= y1:
        return -np.pi, np.pi
    middle = math.atan2(0.5 * (y0 + y1), 0.5 * (x0 + x1))
    c, s = math.cos(middle), math.sin(middle)
    low = high = 0.0
    for x in (x0, x1):
        for y in (y0, y1):
            off = math.atan2(c * y - s * x, c * x + s * y)
            low, high = min(low, off), max(high, off)
    return middle + low, middle + high


@compiled
def within_limits(low: float, high: float, lower: float, upper: float, rounding: float) -> Verdict:
    """Verdict on an interval of angles against limits, whole turns aside [rad]."""
    if lower == -np.inf and upper == np.inf:
        return Verdict.PROVEN
    lower = lower if lower > -np.inf else -np.pi  # as `angles.fit` takes what has one end
    upper = upper if upper < np.inf else np.pi
    turn = np.round((0.5 * (low + high) - 0.5 * (lower + upper)) / TWO_PI)
    touches = False
    for n in (turn - 1.0, turn, turn + 1.0):
        a, b = low - TWO_PI * n, high - TWO_PI * n
        if lower <= a and b <= upper:
            return Verdict.PROVEN
        touches = touches or (a <= upper + rounding and b >= lower - rounding)
    return Verdict.OPEN if touches else Verdict.RULED_OUT


@compiled
def contract(shift: Array, row: Array, low: float, high: float) -> bool:
    """Contract a box (2, n) of x to low <= row . x <= high, side by side; False where nothing is left."""
    least = most = 0.0
    for k in range(len(row)):
        a, b = row[k] * shift[0, k], row[k] * shift[1, k]
        least += min(a, b)
        most += max(a, b)
    if least > high or most < low:
        return False
    for k in range(len(row)):
        c = row[k]
        if abs(c) < 1e-9:
            continue
        a, b = c * shift[0, k], c * shift[1, k]
        others_least, others_most = least - min(a, b), most - max(a, b)
        u, v = (low - others_most) / c, (high - others_least) / c
        shift[0, k] = max(shift[0, k], min(u, v))
        shift[1, k] = min(shift[1, k], max(u, v))
        if shift[0, k] > shift[1, k]:
            return False
        a, b = c * shift[0, k], c * shift[1, k]
        least, most = others_least + min(a, b), others_most + max(a, b)
    return True


@compiled
def cut_to(low: Array, high: Array, centre: Array, shift: Array) -> bool:
    """Cut a box down to what `contract` left of it, relative to its centre; True where that was much."""
    much = False
    for k in range(len(centre)):
        much = much or shift[1, k] - shift[0, k] < WORTH * (high[k] - low[k])
        low[k] = max(low[k], centre[k] + shift[0, k])
        high[k] = min(high[k], centre[k] + shift[1, k])
    return much
