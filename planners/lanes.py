"""M-FABRIK for many targets abreast: 32 lanes of one flat buffer, each refilled once its target is met.

A pass is the same for every lane and has no branch, so that the processor takes several lanes a step. Only
the first start of every target is followed, on a free floor with the pitch free; the caller does the rest.
"""

from __future__ import annotations

import numpy as np

from regionik.planners.fabrik import PATIENCE, STALLED, STRAIGHT
from regionik.planners.flat import Index
from regionik.planners.passes import Links, fast, inwards, outwards, placed
from regionik.worlds.arrays import Array

LANES = 32
# Rows of the buffer: knots, the target's r and z, the way of the axis along the first direction of the plane,
# whether the plane has turned round, the error.
_R1, _Z1, _R2, _Z2, _R3, _Z3, _RT, _ZT, _WAY, _SIDE, _ERROR = range(0, 11 * LANES, LANES)
_SIZE = 11 * LANES


@fast
def _pass(links: Links, facing: float, lane: Array) -> None:
    """One pass in every lane."""
    shoulder, lengths, limits = links.shoulder, links.lengths, links.holds
    for i in range(LANES):
        knots = (
            lane[_R1 + i], lane[_Z1 + i], lane[_R2 + i], lane[_Z2 + i], lane[_R3 + i], lane[_Z3 + i],
        )  # fmt: skip
        before, z, side = lane[_RT + i], lane[_ZT + i], lane[_SIDE + i]
        inner = inwards(shoulder, lengths, limits[1], limits[2], (0.0, 0.0), (before, z), knots)
        shift = inner[0] - shoulder[0]
        r = before - shift
        turned = r * facing < 0.0
        r = -r if turned else r
        knots = outwards(shoulder, lengths, limits, (0.0, 0.0), (r, z), inner, r - before)
        er, ez = knots[4] - r, knots[5] - z
        lane[_R1 + i], lane[_Z1 + i], lane[_R2 + i] = knots[0], knots[1], knots[2]
        lane[_Z2 + i], lane[_R3 + i], lane[_Z3 + i] = knots[3], knots[4], knots[5]
        lane[_RT + i], lane[_WAY + i] = r, lane[_WAY + i] + side * shift
        lane[_SIDE + i] = -side if turned else side
        lane[_ERROR + i] = np.sqrt(er * er + ez * ez)


@fast
def abreast(
    links: Links,
    facing: int,
    tolerance: float,
    most: int,
    targets: Array,
    axes: Array,
    planes: Array,
    bends: Array,
    errors: Array,
    passes: Index,
) -> None:
    """Follow the first start of every target.

    Parameters
    ----------
    links : Links
    facing : +1 or -1
    tolerance : float
        [m]
    most : int
        Passes after which a target is left.
    targets : (n, 3) array
        [m]
    axes : (n, 2), planes : (n,), bends : (n, 3) arrays
        Arm axis [m], direction of its plane, bends [rad]; overwritten where a target is met.
    errors, passes : (n,) arrays
        Overwritten: [m], above the tolerance where a target is left; passes.
    """
    lane, owner = np.zeros(_SIZE), np.full(LANES, -1)
    ux, uy, mark = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
    used = np.zeros(LANES, dtype=np.int64)
    following, waiting, active = 0, len(targets), 0
    while True:
        for i in range(LANES):
            k = owner[i]
            if k >= 0:
                used[i] += 1
                met = lane[_ERROR + i] <= tolerance
                if not met and used[i] < most:
                    if used[i] % PATIENCE != PATIENCE - 1:
                        continue
                    if lane[_ERROR + i] <= STALLED * mark[i]:
                        mark[i] = lane[_ERROR + i]
                        continue
                errors[k], passes[k] = lane[_ERROR + i], used[i]
                if met:
                    way, side = lane[_WAY + i], lane[_SIDE + i]
                    axes[k, 0] += way * ux[i]
                    axes[k, 1] += way * uy[i]
                    planes[k] = np.arctan2(side * uy[i], side * ux[i])
                    _bends(links.shoulder, lane, i, bends[k])
                owner[i] = -1
                active -= 1
            while following < waiting:
                k = following
                following += 1
                ux[i], uy[i] = _fill(links, facing, targets[k], axes[k], planes[k], bends[k], lane, i)
                if lane[_ERROR + i] > tolerance:
                    owner[i], used[i], mark[i] = k, 0, np.inf
                    active += 1
                    break
                errors[k], passes[k] = lane[_ERROR + i], 0
        if active == 0:
            return
        _pass(links, float(facing), lane)


@fast
def _fill(
    links: Links, facing: int, target: Array, axis: Array, plane: float, bends: Array, lane: Array, i: int
) -> tuple[float, float]:
    """Put a target into lane ``i``; returns the direction of the plane that sees it."""
    knots = placed(links.shoulder, links.lengths, bends[0], bends[1], bends[2])
    ux, uy = np.cos(plane), np.sin(plane)
    dx, dy, z = target[0] - axis[0], target[1] - axis[1], target[2]
    ex, ey, ez = knots[4] * ux - dx, knots[4] * uy - dy, knots[5] - z
    lane[_ERROR + i] = np.sqrt(ex * ex + ey * ey + ez * ez)
    rho = np.sqrt(dx * dx + dy * dy)
    if rho > STRAIGHT:
        ux, uy = facing * dx / rho, facing * dy / rho
    lane[_R1 + i], lane[_Z1 + i], lane[_R2 + i] = knots[0], knots[1], knots[2]
    lane[_Z2 + i], lane[_R3 + i], lane[_Z3 + i] = knots[3], knots[4], knots[5]
    lane[_RT + i], lane[_ZT + i], lane[_WAY + i], lane[_SIDE + i] = facing * rho, z, 0.0, 1.0
    return ux, uy


@fast
def _bends(shoulder: tuple[float, float], lane: Array, i: int, bends: Array) -> None:
    """Bends of the links in lane ``i``, not yet taken to the turn that lies within their limits."""
    r1, z1, r2, z2 = lane[_R1 + i], lane[_Z1 + i], lane[_R2 + i], lane[_Z2 + i]
    first = np.arctan2(z1 - shoulder[1], r1 - shoulder[0])
    second = np.arctan2(z2 - z1, r2 - r1)
    bends[0], bends[1] = first, second - first
    bends[2] = np.arctan2(lane[_Z3 + i] - z2, lane[_R3 + i] - r2) - second
