"""Proof that a posture meets an aim from all places of a square about its own.

Led on by the right inverse of the Jacobian, the tool keeps to the aim but for a remainder of the second
order. Where a ball of corrections takes that remainder into itself, a posture is there (Brouwer's theorem).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.vectors import cross, row, squared
from regionik.planners.kernels import compiled
from regionik.planners.reach.options import REACH
from regionik.planners.reach.serial_criteria import (
    PostureDemand,
    SerialThresholds,
    margin_about,
    serial_thresholds,
)
from regionik.planners.search.motion_bounds import from_axis, longest_levers
from regionik.planners.solvers.damped_least_squares import DIRECTION, POSITION, Aim, solve_symmetric
from regionik.planners.solvers.rigid_bodies import span as span_of
from regionik.planners.solvers.serial_chain import (
    SerialArm,
    chain_frames,
    chain_jacobian,
    joint_axes,
    joint_changes,
    joint_jacobian,
    serial_arm,
)
from regionik.worlds.arms import pivot_index, with_pivot_limits
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain

EXACT = 1e-9  # [m]
PROOF_SLACK = 1e-9  # rounding that no proof may rest on [m], [rad]
MAX_INVERSE_ERROR = 1e-3  # error of a right inverse, beyond which nothing is proven
MAX_ENLARGEMENTS = 12  # times that the ball of corrections is made larger
ENLARGEMENT = 1.25


class SquareTask(NamedTuple):
    """What the judgement of a square reads; the arm stands on a base frame at heading zero."""

    arm: SerialArm  # its pivot within limits only where the base frame keeps a heading
    thresholds: SerialThresholds
    aim: Aim  # in the world, but for its height, which is over the arm's base frame
    angle: float  # that a posture may miss the aim's by [rad]
    reach: float  # length of the arm [m]
    levers: Array  # of all joints, longest of the tool's point
    pivot: int


def square_task(
    chain: Chain,
    height: float,
    aim: Aim,
    azimuths: tuple[float, float] = (-np.inf, np.inf),
    demand: PostureDemand | None = None,
) -> SquareTask:
    """Collect what the judgement of squares reads, the pivot within some azimuths; see `proven_pose_area`."""
    arm = serial_arm(with_pivot_limits(chain, *azimuths))
    aim = aim._replace(position=aim.position - [0.0, 0.0, height])
    levers = longest_levers(chain, len(chain.joints) - 1, chain.T_last_tool[:3, 3])[0]
    angle = max(REACH.pose.angle_share * aim.cone, EXACT)
    asked = serial_thresholds(demand, chain.dof)
    return SquareTask(arm, asked, aim, angle, span_of(arm), levers, pivot_index(chain))


@compiled
def constraints(arm: SerialArm, kind: int, joints: Array) -> tuple[Array, Array, Array, Array, Array]:
    """What the aim asks of joint speeds (m, n), a right inverse, room to limits (n,), frames and axes.

    The inverse moves joints the less the nearer to a limit they are; near a singular posture it is none.
    """
    n, rows = len(joints), 3 if kind == POSITION else (5 if kind == DIRECTION else 6)
    frames, axes = np.empty((len(arm.axis) + 1, 4, 4)), np.empty((len(arm.axis), 3))
    J = np.empty((6, n))
    chain_frames(arm, joints, frames)
    chain_jacobian(arm, frames, J)
    joint_axes(arm, frames, axes)
    M, A, room, weight = np.zeros((rows, n)), np.zeros((n, rows)), np.empty(n), np.empty(n)
    for k in range(n):
        room[k] = min(arm.upper[k] - joints[k], joints[k] - arm.lower[k])
        weight[k] = squared(min(max(room[k], 0.0), 1.0))
        for r in range(rows):
            if kind == DIRECTION and r >= 3:  # turns about two axes across the tool's
                for i in range(3):
                    M[r, k] += frames[-1, i, r - 3] * J[3 + i, k]
            else:
                M[r, k] = J[r, k]
    S, y = np.empty((rows, rows)), np.empty(rows)
    for column in range(rows):
        for a in range(rows):
            y[a] = 1.0 if a == column else 0.0
            for b in range(a + 1):
                S[a, b] = 0.0
                for k in range(n):
                    S[a, b] += M[a, k] * weight[k] * M[b, k]
        solve_symmetric(S, y)
        for k in range(n):
            for a in range(rows):
                A[k, column] += weight[k] * M[a, k] * y[a]
    return M, A, room, frames, axes


@compiled
def holds_about(task: SquareTask, kind: int, joints: Array, half: float) -> float:
    """Most that the pivot turns to meet an aim from all places of a square about its own; inf if not proven.

    The remainder is split into its quadratic form, which is known, and what is of the third order.
    """
    arm, n = task.arm, len(joints)
    M, A, room, frames, axes = constraints(arm, kind, joints)
    rounding = _inverse_error(M, A)
    if not rounding <= MAX_INVERSE_ERROR:
        return np.inf
    curved = _quadratic(arm, kind, frames, axes, A)
    fixed, slope, bend = _over_square(curved, half)
    off, needed, moves = np.empty(2), np.empty(2), np.empty(n)  # off: radii of corrections to place and turn
    off[0] = off[1] = PROOF_SLACK
    for _ in range(MAX_ENLARGEMENTS):
        for k in range(n):
            moves[k] = half * (abs(A[k, 0]) + abs(A[k, 1]))
            moves[k] += off[0] * _length(A[k], 0, 3) + off[1] * _length(A[k], 3, len(M))
            if not moves[k] <= room[k]:
                return np.inf
        needed[0], needed[1] = _third_order(arm, frames, axes, joint_changes(arm, moves), task.levers)
        for i in range(2):
            needed[i] += fixed[i] + EXACT + PROOF_SLACK + rounding * (2.0 * half + off[0] + off[1])
            for a in range(2):
                needed[i] += slope[i, a] * off[a]
                for b in range(2):
                    needed[i] += 0.5 * off[a] * bend[i, a, b] * off[b]
        if kind == POSITION:
            needed[1] = 0.0
        if needed[0] <= off[0] and needed[1] <= off[1]:
            return float(moves[task.pivot]) if _meets(task, joints, half * A[:, :2], moves) else np.inf
        for i in range(2):
            off[i] = max(off[i], ENLARGEMENT * needed[i])
    return np.inf


@compiled
def _meets(task: SquareTask, joints: Array, along: Array, moves: Array) -> bool:
    """True if all postures meet what is asked besides; turns of the vertical pivot do not matter for that."""
    along, moves = along.copy(), moves.copy()
    along[task.pivot], moves[task.pivot] = 0.0, 0.0
    off = moves - np.abs(along[:, 0]) - np.abs(along[:, 1])
    return bool(margin_about(task.arm, task.thresholds, joints, along, off, moves) > PROOF_SLACK)


@compiled
def _inverse_error(M: Array, A: Array) -> float:
    """Bound of what a right inverse of a matrix leaves of a unit vector."""
    error = 0.0
    for a in range(len(M)):
        for b in range(len(M)):
            value = -1.0 if a == b else 0.0
            for k in range(len(A)):
                value += M[a, k] * A[k, b]
            error += abs(value)
    return error


@compiled
def _length(values: Array, first: int, end: int) -> float:
    """Length of a part of a vector."""
    total = 0.0
    for k in range(first, end):
        total += squared(values[k])
    return math.sqrt(total)


@compiled
def _quadratic(arm: SerialArm, kind: int, frames: Array, axes: Array, A: Array) -> Array:
    """Second derivatives (m, m, m) of place and turn of the tool along columns of a right inverse (dof, m).

    The turn is the axial vector of its matrix, which is zero where nothing turns; of a direction, its
    parts across the tool's axis.
    """
    n, m = len(arm.axis), A.shape[1]
    J, second, along = np.empty((6, n)), np.zeros((6, n, n)), np.zeros((6, m, m))
    joint_jacobian(arm, frames, J)
    for i in range(n):
        for j in range(i, n):
            if arm.revolute[i]:
                place = cross(row(axes, i), (J[0, j], J[1, j], J[2, j]))
                turn = cross(row(axes, i), (J[3, j], J[4, j], J[5, j]))
                for r in range(3):
                    second[r, i, j] = second[r, j, i] = place[r]
                    second[3 + r, i, j] = second[3 + r, j, i] = 0.5 * turn[r]
    for r in range(6):
        for i in range(n):
            for b in range(m):
                value = 0.0
                for j in range(n):
                    value += second[r, i, j] * arm.ratio[j] * A[arm.leader[j], b]
                for a in range(m):
                    along[r, a, b] += arm.ratio[i] * A[arm.leader[i], a] * value
    curved = np.zeros((m, m, m))
    for r in range(m):
        for a in range(m):
            for b in range(m):
                if kind == DIRECTION and r >= 3:
                    for i in range(3):
                        curved[r, a, b] += frames[n, i, r - 3] * along[3 + i, a, b]
                else:
                    curved[r, a, b] = along[r, a, b]
    return curved


@compiled
def _over_square(curved: Array, half: float) -> tuple[Array, Array, Array]:
    """Bounds of the quadratic form of place and of turn.

    Over a square (2,), of its change by corrections (2, 2), and of its part in these alone (2, 2, 2).
    """
    m = len(curved)
    fixed, slope, bend = np.zeros(2), np.zeros((2, 2)), np.zeros((2, 2, 2))
    for i in range(2):
        first, end = (0, 3) if i == 0 else (3, m)
        form = np.zeros((2, 2))
        for r in range(first, end):
            for a in range(2):
                for b in range(2):
                    form[a, b] += squared(curved[r, a, b])
        for a in range(2):
            for b in range(2):
                fixed[i] += 0.5 * half * half * math.sqrt(form[a, b])
        for a in range(m):
            for b in range(m):
                for r in range(first, end):
                    bend[i, 1 if a >= 3 else 0, 1 if b >= 3 else 0] += squared(curved[r, a, b])
        for sign in (-1.0, 1.0):  # the change is largest at the square's corners
            change = np.zeros(2)
            for a in range(m):
                for r in range(first, end):
                    change[1 if a >= 3 else 0] += squared(half * (curved[r, 0, a] + sign * curved[r, 1, a]))
            for a in range(2):
                slope[i, a] = max(slope[i, a], math.sqrt(change[a]))
        for a in range(2):
            for b in range(2):
                bend[i, a, b] = math.sqrt(bend[i, a, b])
    return fixed, slope, bend


@compiled
def _third_order(
    arm: SerialArm, frames: Array, axes: Array, moves: Array, levers: Array
) -> tuple[float, float]:
    """Bounds of what place and turn of the tool differ from their Taylor series of the second order.

    Joint by joint, from the last to the first: see `motion_bounds.tool_displacement`.
    """
    n = len(moves)
    tool = frames[n, :3, 3]
    turned = moved = bent = left = 0.0
    for k in range(n - 1, -1, -1):
        d = moves[k]
        if arm.revolute[k]:
            lever = min(from_axis(frames[k], axes[k], tool) + moved, levers[k])
            left += d * d * d / 6.0 * lever + 0.5 * d * d * moved + d * bent
            bent += 0.5 * d * d * lever + d * moved
            moved += d * lever
            turned += d
        else:
            moved += d
    tail = turned * turned * turned / (6.0 - 1.5 * turned) if turned < 3.0 else np.inf  # of the exponential
    return left, tail
