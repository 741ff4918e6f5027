"""Steering: direct motions between two poses for each kind of base.

A base that turns on the spot turns, drives straight and turns again; a car drives a Reeds-Shepp or Dubins
curve; an omnidirectional base slides and turns on the way. A steered path is at most five motions, each a
signed length and a turn.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.driving.arcs import arc_end, wrapped
from regionik.planners.driving.footprint_scene import FootprintScene, arc_is_free, slide_is_free
from regionik.planners.driving.reeds_shepp import words_between
from regionik.planners.geometry.polygons import compiled
from regionik.worlds.arrays import Array

SLIDE, SPIN_AHEAD, SPIN, DUBINS, REEDS_SHEPP = range(5)
MOST_WORDS = 8  # of a car that are tried between two poses
NEGLIGIBLE = 1e-12  # shorter motions and smaller turns are none [m], [rad]


class Steering(NamedTuple):
    """Steering of a base, as values for kernels.

    Attributes
    ----------
    kind : int
        ``SLIDE`` in any direction, ``SPIN`` on the spot and drive straight (``SPIN_AHEAD`` never backwards),
        or drive the curves of a car, ``REEDS_SHEPP`` or ``DUBINS``.
    radius : float
        Turning radius of a car [m].
    weight : float
        Cost of turning on the spot or while sliding, as a length [m/rad].
    """

    kind: int
    radius: float
    weight: float


@compiled
def _slide(scene: FootprintScene, base: Steering, a: Array, b: Array, limit: float) -> float:
    """Cost of the straight slide from a to b, infinite where it is not free or dearer than a limit."""
    cost = math.hypot(b[0] - a[0], b[1] - a[1]) + base.weight * abs(wrapped(b[2] - a[2]))
    return cost if cost < limit and slide_is_free(scene, a, b) else np.inf


@compiled
def _path_is_free(scene: FootprintScene, a: Array, motions: Array) -> bool:
    """True if every motion of a path is free."""
    here = a.copy()
    for k in range(len(motions)):
        length, turn = motions[k]
        if length != 0.0 or turn != 0.0:
            if not arc_is_free(scene, here, length, turn):
                return False
            here[0], here[1], here[2] = arc_end(here[0], here[1], here[2], length, turn)
    return True


@compiled
def _spin(scene: FootprintScene, base: Steering, a: Array, b: Array, limit: float, motions: Array) -> float:
    """Cost of turn, drive, turn: nose first or tail first, whichever turns less and is free."""
    far = math.hypot(b[0] - a[0], b[1] - a[1])
    if far <= NEGLIGIBLE:
        motions[:] = 0.0
        motions[0, 1] = wrapped(b[2] - a[2])
        cost = base.weight * abs(motions[0, 1])
        return cost if cost < limit and _path_is_free(scene, a, motions) else np.inf
    ahead = math.atan2(b[1] - a[1], b[0] - a[0])
    nose = abs(wrapped(ahead - a[2])) + abs(wrapped(b[2] - ahead))
    tail = abs(wrapped(ahead + math.pi - a[2])) + abs(wrapped(b[2] - ahead - math.pi))
    back_first = base.kind == SPIN and tail < nose - NEGLIGIBLE
    for trial in range(2 if base.kind == SPIN else 1):
        back = (trial == 0) == back_first
        cost = far + base.weight * (tail if back else nose)
        if cost >= limit:
            break
        heading = ahead + math.pi if back else ahead
        motions[:] = 0.0
        motions[0, 1], motions[1, 0] = wrapped(heading - a[2]), -far if back else far
        motions[2, 1] = wrapped(b[2] - heading)
        if _path_is_free(scene, a, motions):
            return cost
    return np.inf


@compiled
def steer(scene: FootprintScene, base: Steering, a: Array, b: Array, limit: float, motions: Array) -> float:
    """Cost of the cheapest free steered path between two poses, infinite where none is below a limit.

    Parameters
    ----------
    scene : FootprintScene
    base : Steering
    a, b : (3,) array
        x, y [m], yaw [rad].
    limit : float
        [m]
    motions : (5, 2) array
        Overwritten with the signed length [m] and turn [rad] of each motion; left alone by bases that slide.
    """
    if base.kind == SLIDE:
        return _slide(scene, base, a, b, limit)
    if base.kind == SPIN or base.kind == SPIN_AHEAD:
        return _spin(scene, base, a, b, limit, motions)
    if math.hypot(b[0] - a[0], b[1] - a[1]) >= limit:
        return np.inf
    words, lengths = words_between(a, b, base.radius, base.kind == REEDS_SHEPP)
    for m in range(min(MOST_WORDS, len(words))):
        if lengths[m] >= limit:
            break
        if _path_is_free(scene, a, words[m]):
            motions[:] = words[m]
            return float(lengths[m])
    return np.inf
