"""Directions within a cone, as a swing of their vertical plane and a pitch in it.

Both are counted from the cone's axis: a direction of swing s and pitch p is within a cone of half angle c
about one of pitch q where cos p cos q cos s + sin p sin q is no less than cos c. In front, with cos p above
zero, that holds at every swing up to a widest one, so that pitches within the cone at a swing are within it
at each smaller swing.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from regionik.planners.geometry.options import GEOMETRY

OPTIONS = GEOMETRY.cones

UPRIGHT = 0.5 * math.pi

Span = tuple[float, float]


class Swing(NamedTuple):
    """Pitches in front that are within a cone at every swing up to one."""

    half: float  # either way [rad]
    pitches: Span  # lowest and highest [rad]


def pitches_within(pitch: float, cone: float, swing: float) -> Span | None:
    """Middle and half width of the pitches within a cone at a swing, or None.

    They go all round, with a half width of pi, where the cone holds every one.

    >>> pitches_within(0.3, 0.1, 0.0)
    (0.3, 0.1)
    >>> pitches_within(0.0, 0.1, 0.2) is None
    True
    """
    level, rise = math.cos(pitch) * math.cos(swing), math.sin(pitch)
    length, least = math.hypot(level, rise), math.cos(cone)
    if least > length:
        return None
    half = math.acos(least / length) if least > -length else math.pi
    return (math.atan2(rise, level), half) if swing else (pitch, min(cone, math.pi))


def _pitches_in_front(pitch: float, cone: float, swing: float) -> list[Span]:
    """Lowest and highest of the pitches from straight down to straight up within a cone, by interval."""
    found = pitches_within(pitch, cone, swing)
    if found is None:
        return []
    middle, half = found
    if half >= math.pi:
        return [(-UPRIGHT, UPRIGHT)]
    turns = (middle + turn for turn in (-2 * math.pi, 0.0, 2 * math.pi))
    ends = [(max(at - half, -UPRIGHT), min(at + half, UPRIGHT)) for at in turns]
    return [(low, high) for low, high in ends if low <= high]


def _widest_swing(pitch: float, cone: float) -> float:
    """Farthest that a direction within a cone swings from its axis; pi where that holds the vertical."""
    flat = math.cos(pitch)
    if cone >= UPRIGHT or math.sin(cone) >= flat:
        return math.pi
    return math.asin(math.sin(cone) / flat)


def _widest_level_swing(pitch: float, cone: float) -> float:
    """Farthest that a direction of the axis's own pitch swings within a cone."""
    flat = math.cos(pitch)
    # cos(cone) = cos^2(pitch) cos(swing) + sin^2(pitch)
    left = math.cos(cone) - math.sin(pitch) ** 2
    return math.pi if left <= -flat * flat else math.acos(min(1.0, left / flat**2))


@lru_cache(maxsize=1024)
def swings_within(pitch: float, cone: float) -> tuple[Swing, ...]:
    """Swings and pitches that are within a cone together, the widest swing first.

    Of all that is within the cone in front they leave out a sixth of the cone's half angle in pitch, but from
    0.02 to 0.1 rad, or a 64th of the widest swing.
    """
    levels = _levels(pitch, cone)[:0:-1]
    found = [Swing(half, span) for half in levels for span in _pitches_in_front(pitch, cone, half)]
    return tuple(found) or (Swing(0.0, (pitch, pitch)),)  # a cone of hardly any width


@lru_cache(maxsize=1024)
def swings_about(pitch: float, cone: float) -> tuple[Swing, ...]:
    """Swings and pitches that together hold all that is within a cone in front, the widest swing first."""
    levels = _levels(pitch, cone)
    pairs = list(zip(levels[:-1], levels[1:], strict=True))[::-1]
    return tuple(Swing(half, span) for less, half in pairs for span in _pitches_in_front(pitch, cone, less))


def _levels(pitch: float, cone: float) -> list[float]:
    """Swings from none to the widest, as few as may be, at which pitches within the cone hardly differ."""
    widest = _widest_swing(pitch, cone)
    step = min(max(OPTIONS.min_left_out, OPTIONS.left_out_share * cone), OPTIONS.max_left_out)
    narrow = OPTIONS.min_swing_share * widest
    levels = [0.0]
    for end in (min(widest, _widest_level_swing(pitch, cone)), widest):
        while end - levels[-1] > narrow:
            levels.append(_farthest(pitch, cone, levels[-1], end, step, narrow))
        levels += [end] if end > levels[-1] else []
    return levels


def _farthest(pitch: float, cone: float, swing: float, end: float, step: float, narrow: float) -> float:
    """Farthest swing up to an end that leaves out no more than a step of pitch, or that is narrow."""
    low, high = swing + narrow, end
    if _left_out(pitch, cone, swing, high) <= step:
        return end
    while high - low > narrow:
        middle = (low + high) / 2
        low, high = (low, middle) if _left_out(pitch, cone, swing, middle) > step else (middle, high)
    return low


def _left_out(pitch: float, cone: float, less: float, more: float) -> float:
    """Farthest that a pitch within the cone at a swing is from those within it at a wider one [rad]."""
    wide, kept = _pitches_in_front(pitch, cone, less), _pitches_in_front(pitch, cone, more)
    if not kept:
        return math.inf if wide else 0.0
    ends = [end for span in wide for end in span]
    ends += [(a[1] + b[0]) / 2 for a, b in zip(kept[:-1], kept[1:], strict=True)]
    inside = (end for end in ends if any(low <= end <= high for low, high in wide))
    return max((min(max(low - end, end - high, 0.0) for low, high in kept) for end in inside), default=0.0)
