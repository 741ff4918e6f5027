"""Kernels of FABRIK's iterative rivals, compiled as it is: pseudo-inverse, transpose, CCD.

Damped least squares is `regionik.planners.solvers.damped_least_squares`. Each keeps the joint limits, and
each step is taken only as far as it brings the tool nearer.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.planners.geometry.flat import compiled
from regionik.planners.geometry.vectors import Vector, cross, dot, minus, plus, rotated, turned
from regionik.planners.solvers.damped_least_squares import (
    DIRECTION,
    POSITION,
    Aim,
    limited_step,
    polish,
    tool_misses,
    weigh,
)
from regionik.planners.solvers.joint_turns import held
from regionik.planners.solvers.serial_chain import SerialArm, chain_frames, chain_jacobian
from regionik.worlds.arrays import Array

TRACE = 1e-12  # of the squared reach; in the place of a decision on the rank of the pseudo-inverse
HALVINGS = 12  # of a step that does not help, before it is given up
STALLED = 1e-6  # share of what is left by which a sweep of CCD must at least improve

PSEUDO_INVERSE, DAMPED, TRANSPOSE, CYCLIC = range(4)  # which method a kernel shall take

Counts = NDArray[np.int64]


class DescentEffort(NamedTuple):
    """When to be content [m], [rad], most steps from each start, and the length of the arm [m]."""

    tolerance: float
    angle_tolerance: float
    most: int
    reach: float


class Tried(NamedTuple):
    """What a kernel came to: misses [m], [rad], steps in all, restarts."""

    error: float
    angle: float
    steps: int
    restarts: int


@compiled
def pseudo_inverse(
    arm: SerialArm, aim: Aim, joints: Array, reach: float, tolerance: float, angle_tolerance: float, most: int
) -> tuple[float, float, int]:
    """Full Newton steps by J^T (J J^T)^-1, halved until they help; see `damped_least_squares.polish`."""
    return _descend(arm, aim, joints, reach, tolerance, angle_tolerance, most, True)


@compiled
def transpose(
    arm: SerialArm, aim: Aim, joints: Array, reach: float, tolerance: float, angle_tolerance: float, most: int
) -> tuple[float, float, int]:
    """Steps along J^T e, as long as the linear model likes (Wolovich and Elliott), halved until they help.

    Arguments and answer are those of `regionik.planners.solvers.damped_least_squares.polish`.
    """
    return _descend(arm, aim, joints, reach, tolerance, angle_tolerance, most, False)


@compiled
def _descend(
    arm: SerialArm,
    aim: Aim,
    joints: Array,
    reach: float,
    tolerance: float,
    angle_tolerance: float,
    most: int,
    inverse: bool,
) -> tuple[float, float, int]:
    n, rows, weight = len(joints), 3 if aim.kind == POSITION else 6, 0.5 * reach
    frames, J, miss, left = np.empty((n + 1, 4, 4)), np.empty((6, n)), np.empty(6), np.empty(6)
    trial, step = np.empty(n), np.empty(n)
    error, angle = tool_misses(arm, aim, joints, frames, miss)
    tried = 0
    while tried < most and (error > tolerance or angle > angle_tolerance):
        chain_frames(arm, joints, frames)
        chain_jacobian(arm, frames, J)
        weigh(frames[n], aim.kind, weight, J)
        for i in range(6):
            left[i] = miss[i] if i < 3 else weight * miss[i]
        if inverse:
            limited_step(arm, J, left, rows, TRACE * reach * reach, joints, step)
        else:
            _along_transpose(arm, J, left, rows, joints, step)
        before, helped = error**2 + (weight * angle) ** 2, False
        for _ in range(HALVINGS):
            tried += 1
            for k in range(n):
                trial[k] = min(max(joints[k] + step[k], arm.lower[k]), arm.upper[k])
            new_error, new_angle = tool_misses(arm, aim, trial, frames, left)
            if new_error**2 + (weight * new_angle) ** 2 < before:
                joints[:], miss[:] = trial, left
                error, angle, helped = new_error, new_angle, True
                break
            if tried == most:
                break
            step *= 0.5
        if not helped:
            break
    return error, angle, tried


@compiled
def _along_transpose(arm: SerialArm, J: Array, miss: Array, rows: int, joints: Array, step: Array) -> None:
    """J^T e, as long as the linear model likes, without joints that stand at a limit and would leave it."""
    moved = np.zeros(rows)
    for k in range(len(joints)):
        step[k] = 0.0
        for i in range(rows):
            step[k] += J[i, k] * miss[i]
        if (step[k] > 0 and joints[k] >= arm.upper[k]) or (step[k] < 0 and joints[k] <= arm.lower[k]):
            step[k] = 0.0
        for i in range(rows):
            moved[i] += J[i, k] * step[k]
    along, length = 0.0, 0.0
    for i in range(rows):
        along += miss[i] * moved[i]
        length += moved[i] * moved[i]
    step *= along / length if length > 0.0 else 0.0


@compiled
def cyclic_descent(
    arm: SerialArm, aim: Aim, joints: Array, reach: float, tolerance: float, angle_tolerance: float, most: int
) -> tuple[float, float, int]:
    """CCD (Wang and Chen): from the tool to the base, every joint takes what is best for it alone.

    Arguments and answer are those of `damped_least_squares.polish`; a step is a sweep over all joints.
    """
    n, weight = len(joints), 0.5 * reach
    frames, miss = np.empty((n + 1, 4, 4)), np.empty(6)
    error, angle = tool_misses(arm, aim, joints, frames, miss)
    for sweep in range(most):
        if error <= tolerance and angle <= angle_tolerance:
            return error, angle, sweep
        before = error**2 + (weight * angle) ** 2
        tool = frames[n]
        for k in range(n - 1, -1, -1):
            _best_alone(arm, aim, frames[k], k, weight, joints, tool)
        error, angle = tool_misses(arm, aim, joints, frames, miss)
        if error**2 + (weight * angle) ** 2 > (1.0 - STALLED) * before:
            return error, angle, sweep + 1
    return error, angle, most


@compiled
def _best_alone(
    arm: SerialArm, aim: Aim, frame: Array, k: int, weight: float, joints: Array, tool: Array
) -> None:
    """Put joint k where the tool comes nearest, in closed form; ``tool`` (4, 4) goes along."""
    local, now = arm.axis[k], joints[k]
    axis = turned(frame, (local[0], local[1], local[2]))
    spot = (frame[0, 3], frame[1, 3], frame[2, 3])
    goal = (aim.position[0], aim.position[1], aim.position[2])
    tip = (tool[0, 3], tool[1, 3], tool[2, 3])
    if not arm.revolute[k]:
        slid = min(max(now + dot(axis, minus(goal, tip)), arm.lower[k]), arm.upper[k])
        for i in range(3):
            tool[i, 3] += axis[i] * (slid - now)
        joints[k] = slid
        return
    lever = minus(tip, spot)
    c, s = _swing(axis, lever, minus(goal, spot))
    if aim.kind != POSITION:  # a square of the angle counts as a square of length, as in `polish`
        for j in range(2 if aim.kind == DIRECTION else 0, 3):
            share = weight * weight * (1.0 if aim.kind == DIRECTION else 0.5)
            own = (tool[0, j], tool[1, j], tool[2, j])
            more_c, more_s = _swing(axis, own, (aim.turn[0, j], aim.turn[1, j], aim.turn[2, j]))
            c, s = c + share * more_c, s + share * more_s
    if c == 0.0 and s == 0.0:
        return
    value = held(now + np.arctan2(s, c), now, arm.lower[k], arm.upper[k])
    joints[k] = value
    tip = plus(spot, rotated(axis, value - now, lever))
    for i in range(3):
        tool[i, 3] = tip[i]
    for j in range(3):
        column = rotated(axis, value - now, (tool[0, j], tool[1, j], tool[2, j]))
        for i in range(3):
            tool[i, j] = column[i]


@compiled
def _swing(axis: Vector, own: Vector, wanted: Vector) -> tuple[float, float]:
    """``wanted`` times ``own`` turned by t is c cos t + s sin t, and a constant: c, s."""
    return dot(wanted, own) - dot(axis, wanted) * dot(axis, own), dot(wanted, cross(axis, own))


@compiled
def search(
    which: int, arm: SerialArm, aim: Aim, starts: Array, effort: DescentEffort, joints: Array
) -> Tried:
    """A method from ``joints``, then from each of ``starts`` (r, dof), until the aim is met.

    ``joints`` (dof,) becomes the answer, or the nearest end.
    """
    nearest, best, trial = np.inf, Tried(np.inf, np.inf, 0, 0), joints.copy()
    steps = 0
    for i in range(len(starts) + 1):
        if i > 0:
            trial[:] = starts[i - 1]
        error, angle, used = _descend_by(which, arm, aim, trial, effort)
        steps += used
        share = max(error / effort.tolerance, angle / effort.angle_tolerance)
        if share < nearest:
            nearest, best = share, Tried(error, angle, steps, i)
            joints[:] = trial
        if share <= 1.0:
            break
    return Tried(best.error, best.angle, steps, best.restarts)


@compiled
def _descend_by(
    which: int, arm: SerialArm, aim: Aim, joints: Array, effort: DescentEffort
) -> tuple[float, float, int]:
    reach, most = effort.reach, effort.most
    if which == PSEUDO_INVERSE:
        return pseudo_inverse(arm, aim, joints, reach, effort.tolerance, effort.angle_tolerance, most)
    if which == DAMPED:
        return polish(arm, aim, joints, reach, effort.tolerance, effort.angle_tolerance, most)
    if which == TRANSPOSE:
        return transpose(arm, aim, joints, reach, effort.tolerance, effort.angle_tolerance, most)
    return cyclic_descent(arm, aim, joints, reach, effort.tolerance, effort.angle_tolerance, most)


@compiled
def search_each(
    which: int,
    arm: SerialArm,
    positions: Array,
    starts: Array,
    effort: DescentEffort,
    joints: Array,
    errors: Array,
    counts: Counts,
) -> None:
    """`search` for each row: positions (m, 3) [m], joints (m, dof), errors (m,) [m], counts (m, 2)."""
    for i in range(len(positions)):
        tried = search(which, arm, Aim(positions[i], POSITION, np.eye(3), 0.0), starts, effort, joints[i])
        errors[i], counts[i, 0], counts[i, 1] = tried.error, tried.steps, tried.restarts
