"""Where an arm in one plane reaches with postures that meet thresholds: proven to, and not ruled out.

At a height a posture is told by how far out the tool is, the pitch of the last link and the side of the
elbow. Bounds of everything that is asked over boxes of distance and pitch settle these: a box all of whose
postures meet it proves its distances, and distances are ruled out with the last box of their pitches. What
neither settles is halved until it is `FINEST` wide.
"""

from __future__ import annotations

import numpy as np

from regionik.planners.geometry.flat import compiled
from regionik.planners.geometry.spans import cosine, direction, held, opening, product, sine, square
from regionik.planners.solvers.planar_arm import LIMIT_SLACK, PlaneArm
from regionik.planners.solvers.posture_criteria import Thresholds
from regionik.worlds.arrays import Array

FINEST = 2.5e-4  # of distances that are left undecided [m]
RELATIVE = 0.3  # what a box of pitches may move the tool, against the width of its distances
DEEP = 64  # halvings of pitches that may wait
ROUNDING = 1e-12
RULED_OUT, UNDECIDED, PROVEN = -1, 0, 1


def paved(
    arm: PlaneArm, asked: Thresholds, pitches: tuple[float, float], z: float, known: Array
) -> tuple[Array, Array]:
    """Signed distances at a height whose postures meet all that is asked.

    Parameters
    ----------
    arm : PlaneArm
    asked : Thresholds
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
    ends = [_pave(arm, asked, low, high, z, a, b, FINEST) for a, b in known.tolist()]
    inner, outer = ([one[side] for one in ends] for side in (0, 1))
    none = np.empty((0, 2))
    return np.concatenate([none, *inner]), np.concatenate([none, *outer])


@compiled
def _pave(
    arm: PlaneArm, asked: Thresholds, low: float, high: float, z: float, a: float, b: float, finest: float
) -> tuple[Array, Array]:
    """The inner and outer intervals in (a, b), distances in ascending order."""
    waiting = np.empty((DEEP, 2))
    waiting[0, 0], waiting[0, 1] = a, b
    n, count_in, count_out = 1, 0, 0
    most = 2 + int((b - a) / finest) * 2
    inner, outer = np.empty((most, 2)), np.empty((most, 2))
    while n > 0:
        n -= 1
        near, far = waiting[n]
        verdict = _settle(arm, asked, low, high, z, near, far)
        if verdict == UNDECIDED and far - near > finest and n + 2 <= DEEP:
            middle = 0.5 * (near + far)
            waiting[n, 0], waiting[n, 1] = middle, far
            waiting[n + 1, 0], waiting[n + 1, 1] = near, middle
            n += 2
            continue
        if verdict == PROVEN:
            count_in = _append(inner, count_in, near, far)
        if verdict != RULED_OUT:
            count_out = _append(outer, count_out, near, far)
    return inner[:count_in].copy(), outer[:count_out].copy()


@compiled
def _append(rows: Array, count: int, near: float, far: float) -> int:
    if count > 0 and rows[count - 1, 1] == near:
        rows[count - 1, 1] = far
        return count
    rows[count, 0], rows[count, 1] = near, far
    return count + 1


@compiled
def _settle(
    arm: PlaneArm, asked: Thresholds, low: float, high: float, z: float, near: float, far: float
) -> int:
    """One pitch that serves all distances from near to far, or the proof that none serves any of them."""
    waiting = np.empty((DEEP, 3))
    n = 0
    for elbow in (-1.0, 1.0):
        waiting[n, 0], waiting[n, 1], waiting[n, 2] = low, high, elbow
        n += 1
    left = False
    while n > 0:
        n -= 1
        a, b, elbow = waiting[n]
        verdict = weigh(arm, asked, z, near, far, a, b, elbow)
        if verdict == RULED_OUT:
            continue
        middle = 0.5 * (a + b)
        if verdict == PROVEN or weigh(arm, asked, z, near, far, middle, middle, elbow) == PROVEN:
            return PROVEN
        if arm.lengths[2] * (b - a) <= RELATIVE * (far - near) or n + 2 > DEEP:
            left = True
            continue
        waiting[n, 0], waiting[n, 1], waiting[n, 2] = a, middle, elbow
        waiting[n + 1, 0], waiting[n + 1, 1], waiting[n + 1, 2] = middle, b, elbow
        n += 2
    return UNDECIDED if left else RULED_OUT


@compiled
def weigh(
    arm: PlaneArm, asked: Thresholds, z: float, near: float, far: float, low: float, high: float, elbow: float
) -> int:
    """Whether the postures of a box of distances and pitches all meet what is asked, or none does."""
    a, b, c = arm.lengths[0], arm.lengths[1], arm.lengths[2]
    cos0, cos1 = cosine(low, high)
    sin0, sin1 = sine(low, high)
    x0, x1 = near - arm.shoulder_r, far - arm.shoulder_r
    y = z - arm.shoulder_z
    wx0, wx1, wy0, wy1 = x0 - c * cos1, x1 - c * cos0, y - c * sin1, y - c * sin0
    sx0, sx1 = square(wx0, wx1)
    sy0, sy1 = square(wy0, wy1)
    d0, d1 = np.sqrt(sx0 + sy0), np.sqrt(sx1 + sy1)
    if d0 > a + b + ROUNDING or d1 < abs(a - b) - ROUNDING:
        return RULED_OUT
    sure = d0 >= abs(a - b) + ROUNDING and d1 <= a + b - ROUNDING
    d0 = min(max(d0, abs(a - b), ROUNDING), a + b)
    d1 = max(min(d1, a + b), d0)
    lead0, lead1 = direction(wx0, wx1, wy0, wy1)
    root0, root1 = opening(a, b, d0, d1)
    tip0, tip1 = opening(b, a, d0, d1)
    if elbow > 0.0:
        first0, first1, second0, second1 = lead0 + root0, lead1 + root1, lead0 - tip1, lead1 - tip0
    else:
        first0, first1, second0, second1 = lead0 - root1, lead1 - root0, lead0 + tip0, lead1 + tip1
    # The bend at the elbow is the third side's alone: pi less the angle across from it.
    across0, across1 = _across(a, b, d0, d1)
    bend0, bend1 = (-across1, -across0) if elbow > 0.0 else (across0, across1)
    verdict = min(
        held(first0, first1, arm.lower[0], arm.upper[0], LIMIT_SLACK),
        held(bend0, bend1, arm.lower[1], arm.upper[1], LIMIT_SLACK),
        held(low - second1, high - second0, arm.lower[2], arm.upper[2], LIMIT_SLACK),
    )
    if verdict == RULED_OUT:
        return RULED_OUT
    verdict = min(verdict, 1 if sure else 0)
    verdict = min(verdict, _bends_well(arm, asked, x0, x1, y, first0, first1, second0, second1, low, high))
    if verdict == RULED_OUT:
        return RULED_OUT
    return min(verdict, _lifts(asked, first0, first1, second0, second1, low, high))


@compiled
def _across(a: float, b: float, d0: float, d1: float) -> tuple[float, float]:
    """By how much two links bend whose ends are (d0, d1) apart: 0 when stretched, pi when folded [rad]."""
    low = (d1 * d1 - a * a - b * b) / (2.0 * a * b)
    high = (d0 * d0 - a * a - b * b) / (2.0 * a * b)
    return np.arccos(min(1.0, max(-1.0, low))), np.arccos(min(1.0, max(-1.0, high)))


@compiled
def _bends_well(
    arm: PlaneArm, asked: Thresholds, x0: float, x1: float, y: float,
    first0: float, first1: float, second0: float, second1: float, low: float, high: float,
) -> int:  # fmt: skip
    """Manipulability of a box against its threshold."""
    if asked.least <= 0.0:
        return PROVEN
    a, b, c = arm.lengths[0], arm.lengths[1], arm.lengths[2]
    p0, p1 = cosine(first0, first1)
    q0, q1 = product(*sine(first0, first1), x0, x1)
    u0, u1 = square(a * (min(p0 * y, p1 * y) - q1), a * (max(p0 * y, p1 * y) - q0))
    p0, p1 = cosine(low, high)
    q0, q1 = product(*sine(low, high), x0, x1)
    v0, v1 = square(c * (q0 - max(p0 * y, p1 * y)), c * (q1 - min(p0 * y, p1 * y)))
    w0, w1 = sine(low - second1, high - second0)
    w0, w1 = square(b * c * w0, b * c * w1)
    r0, r1 = square(x0 + arm.shoulder_r, x1 + arm.shoulder_r)
    wanted = asked.least * asked.least
    if r1 * (u1 + v1 + w1) < wanted * (1.0 - ROUNDING):
        return RULED_OUT
    return PROVEN if r0 * (u0 + v0 + w0) > wanted * (1.0 + ROUNDING) else UNDECIDED


@compiled
def _lifts(
    asked: Thresholds, first0: float, first1: float, second0: float, second1: float, low: float, high: float
) -> int:
    """Torques of a box against their limits."""
    verdict, least, most = PROVEN, 0.0, 0.0
    for k in range(2, -1, -1):
        from_ = first0 if k == 0 else (second0 if k == 1 else low)
        to = first1 if k == 0 else (second1 if k == 1 else high)
        pull, turn = asked.pull[k]
        p0, p1 = cosine(from_ + turn, to + turn)
        least, most = least + pull * p0, most + pull * p1
        limit = asked.most[k]
        if limit < np.inf:
            if least > limit + ROUNDING or most < -limit - ROUNDING:
                return RULED_OUT
            if most > limit - ROUNDING or least < -limit + ROUNDING:
                verdict = UNDECIDED
    return verdict
