"""M-FABRIK's passes for many targets abreast: 32 lanes of one flat buffer, refilled as targets are met.

A pass is the same for every lane and has no branch, so that the processor takes several lanes a step. Targets
come and go in blocks of one flat array each, a quantity after the other, on a free floor with the pitch free.
A start that stalls is left for the next one, as one target alone leaves it; what none of them meets in a
hurry is the caller's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.flat import Index
from regionik.planners.geometry.trigonometry import turned
from regionik.planners.solvers.fabrik import PATIENCE, STALLED
from regionik.planners.solvers.passes import Links, Pair, fast, inwards, outwards, placed, sight
from regionik.worlds.arrays import Array

LANES = 32
BLOCK = 4000  # targets; no power of two, lest all quantities of a target lie in the same lines of the cache
# Of every target: the knots between the links, the tool, the line of sight from the last hinge, the target's
# r and z, first direction of the plane, the square of the miss, the arm axis, direction of the plane now,
# heading of the base, pivot, bends.
R1, Z1, R2, Z2, R3, Z3, SIGHT_R, SIGHT_Z, R_T, Z_T = range(0, 10 * BLOCK, BLOCK)
U, V, MISS2, X, Y, YAW, HEADING, PIVOT, FIRST, SECOND, THIRD = range(10 * BLOCK, 21 * BLOCK, BLOCK)
SIZE = 21 * BLOCK

# Of every lane: as of a target; the way of the axis along the plane's first direction, its side of it now.
_R1, _Z1, _R2, _Z2, _R3, _Z3, _SIGHT_R, _SIGHT_Z, _R_T, _Z_T = range(0, 10 * LANES, LANES)
_MISS2, _WAY, _SIDE = range(10 * LANES, 13 * LANES, LANES)
_SIZE = 13 * LANES


class Effort(NamedTuple):
    """Side that the arm faces, tolerance [m], most passes from each start, further starts (k, 3) [rad]."""

    facing: int
    tolerance: float
    most: int
    postures: Array


@fast
def _pass(links: Links, facing: float, lane: Array) -> None:
    """One pass in every lane."""
    shoulder, lengths, limits = links.shoulder, links.lengths, links.holds
    for i in range(LANES):
        knots = (lane[_R1 + i], lane[_Z1 + i], 0.0, 0.0, 0.0, 0.0)
        seen, before, z = (lane[_SIGHT_R + i], lane[_SIGHT_Z + i]), lane[_R_T + i], lane[_Z_T + i]
        inner = inwards(shoulder, lengths, limits[1], limits[2], seen, (before, z), knots)
        side, shift = lane[_SIDE + i], inner.root - shoulder[0]
        r = before - shift
        beyond = r * facing < 0.0  # the axis has passed below the target
        r = -r if beyond else r
        knots, seen = outwards(shoulder, lengths, limits, (0.0, 0.0), (r, z), inner, r - before)
        er, ez = knots[4] - r, knots[5] - z
        lane[_R1 + i], lane[_Z1 + i], lane[_R2 + i] = knots[0], knots[1], knots[2]
        lane[_Z2 + i], lane[_R3 + i], lane[_Z3 + i] = knots[3], knots[4], knots[5]
        lane[_SIGHT_R + i], lane[_SIGHT_Z + i] = seen[0], seen[1]
        lane[_R_T + i], lane[_WAY + i] = r, lane[_WAY + i] + side * shift
        lane[_SIDE + i] = -side if beyond else side
        lane[_MISS2 + i] = er * er + ez * ez


@fast
def abreast(links: Links, effort: Effort, count: int, block: Array, errors: Array, passes: Index) -> None:
    """Follow the starts of every target of a block.

    Parameters
    ----------
    links : Links
    effort : Effort
    count : int
        Targets in the block.
    block : (`SIZE`,) array
        Everything but the outer knots is given; of targets that are met the knots, the axis and the plane's
        direction are overwritten, the latter in the place of its first direction.
    errors, passes : (count,) arrays
        Overwritten: [m], infinite where a target is left; passes, none where a target was met before.
    """
    lane, owner = np.zeros(_SIZE), np.full(LANES, -1)
    used, total, start = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    mark = np.zeros(LANES)
    following, active, near2 = 0, 0, effort.tolerance * effort.tolerance
    while True:
        for i in range(LANES):
            k = owner[i]
            if k >= 0:
                used[i] += 1
                miss2 = lane[_MISS2 + i]
                if miss2 > near2:
                    if used[i] < effort.most:
                        if used[i] % PATIENCE != PATIENCE - 1:
                            continue
                        if miss2 <= STALLED * STALLED * mark[i]:
                            mark[i] = miss2
                            continue
                    if start[i] < len(effort.postures) and _again(links, effort, start[i], block, k, lane, i):
                        total[i], used[i], mark[i], start[i] = total[i] + used[i], 0, np.inf, start[i] + 1
                        continue
                    errors[k] = np.inf
                else:
                    errors[k], passes[k] = np.sqrt(miss2), total[i] + used[i]
                    _take(lane, i, block, k)
                owner[i] = -1
                active -= 1
            while following < count:
                k = following
                following += 1
                if block[MISS2 + k] > near2:
                    _fill(block, k, lane, i)
                    owner[i], used[i], total[i], mark[i], start[i] = k, 0, 0, np.inf, 0
                    active += 1
                    break
                errors[k], passes[k] = np.sqrt(block[MISS2 + k]), 0
        if active == 0:
            return
        _pass(links, float(effort.facing), lane)


@fast
def _fill(block: Array, k: int, lane: Array, i: int) -> None:
    """Put target k into lane i."""
    lane[_R1 + i], lane[_Z1 + i] = block[R1 + k], block[Z1 + k]
    lane[_SIGHT_R + i], lane[_SIGHT_Z + i] = block[SIGHT_R + k], block[SIGHT_Z + k]
    lane[_R_T + i], lane[_Z_T + i], lane[_WAY + i], lane[_SIDE + i] = block[R_T + k], block[Z_T + k], 0.0, 1.0


@fast
def _take(lane: Array, i: int, block: Array, k: int) -> None:
    """Take the answer to target k out of lane i."""
    block[R1 + k], block[Z1 + k], block[R2 + k] = lane[_R1 + i], lane[_Z1 + i], lane[_R2 + i]
    block[Z2 + k], block[R3 + k], block[Z3 + k] = lane[_Z2 + i], lane[_R3 + i], lane[_Z3 + i]
    way, side, u, v = lane[_WAY + i], lane[_SIDE + i], block[U + k], block[V + k]
    block[X + k], block[Y + k] = block[X + k] + way * u, block[Y + k] + way * v
    block[U + k], block[V + k] = side * u, side * v


@fast
def _again(links: Links, effort: Effort, start: int, block: Array, k: int, lane: Array, i: int) -> bool:
    """Put target k into lane i again, from another posture; False where that is on target without a pass."""
    first = effort.postures[start, 0]
    second = first + effort.postures[start, 1]
    directions = turned(first), turned(second), turned(second + effort.postures[start, 2])
    knots = placed(links.shoulder, links.lengths, directions[0], directions[1], directions[2])
    aim: Pair = (block[R_T + k], block[Z_T + k])
    seen = sight((0.0, 0.0), aim, knots)
    block[SIGHT_R + k], block[SIGHT_Z + k] = seen
    block[R1 + k], block[Z1 + k] = knots[0], knots[1]
    _fill(block, k, lane, i)
    u, v = turned(block[YAW + k])
    ex, ey = knots[4] * u - aim[0] * block[U + k], knots[4] * v - aim[0] * block[V + k]
    miss2: float = ex * ex + ey * ey + (knots[5] - aim[1]) ** 2
    return miss2 > effort.tolerance * effort.tolerance
