"""Direct motions between two poses for each kind of base, and paths shortened by them.

What a base can do is a value for kernels: turn, drive straight and turn again; drive a car's curve; or slide,
turning on the way. A motion is at most five parts, each a signed length and a turn.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.driving.arcs import moved, wrapped
from regionik.planners.driving.footprint_scene import Room, rolls, slides
from regionik.planners.driving.reeds_shepp import PARTS, curves
from regionik.planners.geometry.flat import Index, compiled
from regionik.worlds.arrays import Array

SLIDE, SPIN_AHEAD, SPIN, DUBINS, REEDS_SHEPP = range(5)
MOST_WORDS = 8  # of a car's curves between two poses that are tried
NOTHING = 1e-12  # a part that moves or turns less than this is none [m], [rad]


class Base(NamedTuple):
    """What a base can do.

    Attributes
    ----------
    kind : int
        ``SLIDE`` every way, ``SPIN`` on the spot and drive straight (``SPIN_AHEAD`` never backwards), or the
        curves of a car, ``REEDS_SHEPP`` or ``DUBINS``.
    radius : float
        Of a car's curves [m].
    weight : float
        What turning on the spot or while sliding costs, as a length [m/rad].
    """

    kind: int
    radius: float
    weight: float


@compiled
def _slide(room: Room, base: Base, a: Array, b: Array, limit: float) -> float:
    cost = math.hypot(b[0] - a[0], b[1] - a[1]) + base.weight * abs(wrapped(b[2] - a[2]))
    return cost if cost < limit and slides(room, a, b) else np.inf


@compiled
def _all_roll(room: Room, a: Array, parts: Array) -> bool:
    """Whether every part of a motion is free."""
    here = a.copy()
    for k in range(len(parts)):
        length, turn = parts[k]
        if length != 0.0 or turn != 0.0:
            if not rolls(room, here, length, turn):
                return False
            here[0], here[1], here[2] = moved(here[0], here[1], here[2], length, turn)
    return True


@compiled
def _spin(room: Room, base: Base, a: Array, b: Array, limit: float, parts: Array) -> float:
    """Turn, drive and turn: nose first or tail first, whichever turns less and is free."""
    far = math.hypot(b[0] - a[0], b[1] - a[1])
    if far <= NOTHING:
        parts[:] = 0.0
        parts[0, 1] = wrapped(b[2] - a[2])
        cost = base.weight * abs(parts[0, 1])
        return cost if cost < limit and _all_roll(room, a, parts) else np.inf
    ahead = math.atan2(b[1] - a[1], b[0] - a[0])
    nose = abs(wrapped(ahead - a[2])) + abs(wrapped(b[2] - ahead))
    tail = abs(wrapped(ahead + math.pi - a[2])) + abs(wrapped(b[2] - ahead - math.pi))
    back_first = base.kind == SPIN and tail < nose - NOTHING
    for trial in range(2 if base.kind == SPIN else 1):
        back = (trial == 0) == back_first
        cost = far + base.weight * (tail if back else nose)
        if cost >= limit:
            break
        heading = ahead + math.pi if back else ahead
        parts[:] = 0.0
        parts[0, 1], parts[1, 0] = wrapped(heading - a[2]), -far if back else far
        parts[2, 1] = wrapped(b[2] - heading)
        if _all_roll(room, a, parts):
            return cost
    return np.inf


@compiled
def link(room: Room, base: Base, a: Array, b: Array, limit: float, parts: Array) -> float:
    """Cost of the cheapest free direct motion between two poses, infinite where none is below a limit.

    Parameters
    ----------
    room : Room
    base : Base
    a, b : (3,) array
        x, y [m], yaw [rad].
    limit : float
        [m]
    parts : (5, 2) array
        Overwritten with the signed length [m] and turn [rad] of each part; left alone by bases that slide.
    """
    if base.kind == SLIDE:
        return _slide(room, base, a, b, limit)
    if base.kind == SPIN or base.kind == SPIN_AHEAD:
        return _spin(room, base, a, b, limit, parts)
    if math.hypot(b[0] - a[0], b[1] - a[1]) >= limit:
        return np.inf
    words, lengths = curves(a, b, base.radius, base.kind == REEDS_SHEPP)
    for m in range(min(MOST_WORDS, len(words))):
        if lengths[m] >= limit:
            break
        if _all_roll(room, a, words[m]):
            parts[:] = words[m]
            return float(lengths[m])
    return np.inf


@compiled
def cheapest(room: Room, base: Base, poses: Array) -> tuple[Index, Array]:
    """Which poses of a path to keep so that the direct motions between them are the cheapest.

    Returns the kept indices and the cost up to each of them; infinite where the path does not hold.
    """
    n = len(poses)
    cost, before = np.full(n, np.inf), np.full(n, -1)
    cost[0] = 0.0
    parts = np.empty((PARTS, 2))
    for j in range(1, n):
        for i in range(j - 1, -1, -1):
            if cost[i] < cost[j]:
                new = cost[i] + link(room, base, poses[i], poses[j], cost[j] - cost[i], parts)
                if new < cost[j]:
                    cost[j], before[j] = new, i
    kept = np.empty(n, dtype=np.int64)
    count, k = 0, n - 1
    while k >= 0:
        kept[count] = k
        count, k = count + 1, before[k]
    kept = kept[:count][::-1].copy()
    return kept, cost[kept]
