"""M-FABRIK from base and joints to base and joints for many rows, those on a free floor abreast in lanes.

What comes before the passes and after them is done for a block of rows, a quantity after the other and
without a branch, so that the processor takes sines, arctangents and roots of several rows a step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regionik.planners.geometry.flat import Index
from regionik.planners.geometry.trigonometry import LARGEST, cosine_sine, direction
from regionik.planners.solvers import lanes
from regionik.planners.solvers.callsheet import effort_in, free_in, hinges_in, links_in, seat_in
from regionik.planners.solvers.fabrik import STRAIGHT, bends_between
from regionik.planners.solvers.lanes import BLOCK, SIZE, abreast
from regionik.planners.solvers.onecall import alone, joint_of, offset, shared_turn, within_limits
from regionik.planners.solvers.passes import fast, placed, sight
from regionik.worlds.arrays import Array


@fast
def answer_all(
    call: Array, targets: Array, bases: Array, joints: Array,
    new_bases: Array, new_joints: Array, errors: Array, passes: Index, met: NDArray[np.bool_],
) -> None:  # fmt: skip
    """The call of `onecall` for many rows, all finite; 32 of them abreast where floor and pitch are free.

    Fills bases (n, 3), joints (n, dof), errors [m], passes and whether a target is met (n,).
    """
    tolerance, block = effort_in(call).tolerance, np.empty(SIZE)
    for begin in range(0, len(targets), BLOCK):
        rows = slice(begin, begin + BLOCK)
        if free_in(call):
            begun(call, targets[rows], bases[rows], joints[rows], block)
            abreast(links_in(call), effort_in(call), len(targets[rows]), block, errors[rows], passes[rows])
            ended(call, passes[rows], block)
            _write(block, joints[rows], new_bases[rows], new_joints[rows], met[rows])
        else:
            errors[rows] = np.inf
        for k in range(begin, min(begin + BLOCK, len(targets))):
            if not errors[k] <= tolerance:
                errors[k], passes[k], met[k] = alone(
                    call, targets[k], bases[k], joints[k], new_bases[k], new_joints[k]
                )


@fast
def begun(call: Array, targets: Array, bases: Array, joints: Array, block: Array) -> None:
    """Fill a block of lanes from rows, the miss NaN where an angle is too large to be turned by at once."""
    for k in range(len(targets)):
        block[lanes.X + k], block[lanes.Y + k], block[lanes.HEADING + k] = (
            bases[k, 0],
            bases[k, 1],
            bases[k, 2],
        )
        block[lanes.PIVOT + k], block[lanes.FIRST + k] = joints[k, 0], joints[k, 1]
        block[lanes.SECOND + k], block[lanes.THIRD + k] = joints[k, 2], joints[k, 3]
        block[lanes.U + k], block[lanes.V + k], block[lanes.Z_T + k] = (
            targets[k, 0],
            targets[k, 1],
            targets[k, 2],
        )
    links, seat, facing = links_in(call), seat_in(call), float(effort_in(call).facing)
    hinges = hinges_in(call)
    for k in range(len(targets)):
        a = hinges[0].sign * block[lanes.FIRST + k] + hinges[0].offset
        b = hinges[1].sign * block[lanes.SECOND + k] + hinges[1].offset
        c = hinges[2].sign * block[lanes.THIRD + k] + hinges[2].offset
        block[lanes.FIRST + k], block[lanes.SECOND + k], block[lanes.THIRD + k] = a, b, c
        knots = placed(
            links.shoulder, links.lengths, cosine_sine(a), cosine_sine(a + b), cosine_sine(a + b + c)
        )
        heading, pivot = block[lanes.HEADING + k], block[lanes.PIVOT + k]
        yaw, away = heading + seat.zero + pivot, offset(seat, cosine_sine(heading))
        block[lanes.YAW + k], plane = yaw, cosine_sine(yaw)
        x, y, z = block[lanes.X + k] + away[0], block[lanes.Y + k] + away[1], block[lanes.Z_T + k]
        block[lanes.X + k], block[lanes.Y + k] = x, y
        dx, dy = block[lanes.U + k] - x, block[lanes.V + k] - y
        ex, ey, ez = knots[4] * plane[0] - dx, knots[4] * plane[1] - dy, knots[5] - z
        rho = np.sqrt(dx * dx + dy * dy)
        above = rho <= STRAIGHT
        scale = facing / (1.0 if above else rho)
        block[lanes.U + k], block[lanes.V + k] = (
            (plane[0] if above else dx * scale),
            (plane[1] if above else dy * scale),
        )
        seen = sight((0.0, 0.0), (facing * rho, z), knots)
        block[lanes.SIGHT_R + k], block[lanes.SIGHT_Z + k] = seen[0], seen[1]
        block[lanes.R1 + k], block[lanes.Z1 + k], block[lanes.R_T + k] = knots[0], knots[1], facing * rho
        sure = abs(heading) + abs(pivot) + abs(a) + abs(b) + abs(c) <= LARGEST
        block[lanes.MISS2 + k] = ex * ex + ey * ey + ez * ez if sure else np.nan


@fast
def ended(call: Array, passes: Index, block: Array) -> None:
    """Turn knots to joint values in the place of bends, and the axis and its plane to base and pivot.

    Whether the heading fits stands in the place of the miss, as 1 or 0.
    """
    shoulder, seat = links_in(call).shoulder, seat_in(call)
    hinges = hinges_in(call)
    for k in range(len(passes)):
        first, second = (block[lanes.R1 + k], block[lanes.Z1 + k]), (block[lanes.R2 + k], block[lanes.Z2 + k])
        knots = (*first, *second, block[lanes.R3 + k], block[lanes.Z3 + k])
        bends, moved = bends_between(shoulder, knots), passes[k] > 0
        before = block[lanes.FIRST + k], block[lanes.SECOND + k], block[lanes.THIRD + k]
        a = within_limits(hinges[0], bends[0]) if moved else before[0]
        b = within_limits(hinges[1], bends[1]) if moved else before[1]
        c = within_limits(hinges[2], bends[2]) if moved else before[2]
        block[lanes.FIRST + k] = joint_of(hinges[0], a, before[0])
        block[lanes.SECOND + k] = joint_of(hinges[1], b, before[1])
        block[lanes.THIRD + k] = joint_of(hinges[2], c, before[2])
        plane = direction(block[lanes.V + k], block[lanes.U + k])
        plane = plane if moved else block[lanes.YAW + k]
        pivot, yaw, fits = shared_turn(
            plane - seat.zero, block[lanes.HEADING + k], block[lanes.PIVOT + k], seat.turning
        )
        away = offset(seat, cosine_sine(yaw))
        block[lanes.PIVOT + k], block[lanes.HEADING + k] = pivot, yaw
        block[lanes.X + k], block[lanes.Y + k] = block[lanes.X + k] - away[0], block[lanes.Y + k] - away[1]
        block[lanes.MISS2 + k] = 1.0 if fits else 0.0


@fast
def _write(block: Array, joints: Array, new_bases: Array, new_joints: Array, met: NDArray[np.bool_]) -> None:
    """Take rows out of a block."""
    for k in range(len(met)):
        new_bases[k, 0], new_bases[k, 1], new_bases[k, 2] = (
            block[lanes.X + k],
            block[lanes.Y + k],
            block[lanes.HEADING + k],
        )
        new_joints[k, 0], new_joints[k, 1] = block[lanes.PIVOT + k], block[lanes.FIRST + k]
        new_joints[k, 2], new_joints[k, 3] = block[lanes.SECOND + k], block[lanes.THIRD + k]
        for j in range(4, joints.shape[1]):
            new_joints[k, j] = joints[k, j]
        met[k] = block[lanes.MISS2 + k] > 0.0
