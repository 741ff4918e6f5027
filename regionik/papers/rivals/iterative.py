"""Iterative methods with compiled kernels: pseudo-inverse, transpose, damped least squares, CCD.

Each keeps the joint limits, and restarts from the same postures as FABRIK. None knows of obstacles or areas.
The kernel of damped least squares is `regionik.planners.solvers.damped_least_squares`.

Sources: Wolovich and Elliott (1984) for the transpose, Wang and Chen (1991) for CCD.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np

from regionik.papers.options import PAPERS
from regionik.papers.rivals.method import ArmMethod, SearchResult, arm_length
from regionik.planners.geometry.vectors import Vector, cross, dot, minus, plus, rotated, squared, turned
from regionik.planners.kernels import compiled
from regionik.planners.solvers.damped_least_squares import (
    DIRECTION,
    POSITION,
    Aim,
    limited_step,
    polish,
    scale_angles,
    tool_error,
)
from regionik.planners.solvers.fabrikr import clamped_turn
from regionik.planners.solvers.serial_chain import SerialArm, chain_frames, chain_jacobian, serial_arm
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, spread_postures

OPTIONS = PAPERS.comparison

TRACE = 1e-12  # of the squared reach, in place of a decision on the rank of the pseudo-inverse
HALVINGS = 12  # of a step that does not help, before it is given up
STALLED = 1e-6  # share of the rest by which a sweep of CCD must at least improve

PSEUDO_INVERSE, DAMPED, TRANSPOSE, CYCLIC = range(4)


class DescentLimits(NamedTuple):
    """Tolerances [m], [rad], most steps from each start, the length of the arm [m], and the gain.

    That is the constant share of each step of a line search that is taken; 0 for all of it, halved until it
    helps.
    """

    tolerance: float
    angle_tolerance: float
    steps: int
    reach: float
    gain: float


class IterativeMethod(ArmMethod):
    """An iterative method with restarts, known by its kernel.

    Parameters
    ----------
    tolerance, angle_tolerance : float [m], [rad]
    max_iterations : int
        Steps from each start.
    restarts : int
        Other postures to start from.
    """

    kernel: ClassVar[int]
    gain: ClassVar[float] = 0.0

    def __init__(
        self,
        chain: Chain,
        tolerance: float = 1e-3,
        angle_tolerance: float = 1e-3,
        max_iterations: int = OPTIONS.max_iterations,
        restarts: int = OPTIONS.restarts,
    ) -> None:
        super().__init__(chain, tolerance, angle_tolerance)
        self.arm, reach = serial_arm(chain), arm_length(chain)
        most = int(max_iterations)
        self.limits = DescentLimits(self.tolerance, self.angle_tolerance, most, reach, self.gain)
        self.starts = spread_postures(chain, reach, restarts, 0)

    def search(self, aim: Aim, joints: Array) -> SearchResult:
        """Descend from the joints, then from the starts, until the aim is met; return the nearest end."""
        q = np.array(joints)
        error, angle, steps, restarts = descend(self.kernel, self.arm, aim, self.starts, self.limits, q)
        return SearchResult(q, float(error), float(angle), int(steps), int(restarts))


class PseudoInverse(IterativeMethod):
    """Jacobian pseudo-inverse: full Newton steps by J^T (J J^T)^-1, halved until they help."""

    name, kernel = "pinv", PSEUDO_INVERSE


class SmallSteps(PseudoInverse):
    """The pseudo-inverse in small steps, all of one gain: what is missed shrinks by it, whatever the arm.

    Its gain is that of the rivals in Santos et al. (IEEE Access 2020), table 3: 44.2 iterations a decade.
    """

    name, gain = "pinv-small", OPTIONS.small_gain


class DampedLeastSquares(IterativeMethod):
    """Damped least squares of Levenberg and Marquardt, the kernel that polishes our own answers."""

    name, kernel = "dls", DAMPED


class Transpose(IterativeMethod):
    """Jacobian transpose: steps along J^T e of the length best in the linear model, halved as needed."""

    name, kernel = "transpose", TRANSPOSE


class CyclicDescent(IterativeMethod):
    """Cyclic coordinate descent: from tool to base, each joint moves to what is best for it alone."""

    name, kernel = "ccd", CYCLIC


@compiled
def descend(
    kernel: int, arm: SerialArm, aim: Aim, starts: Array, limits: DescentLimits, joints: Array
) -> tuple[float, float, int, int]:
    """Descend from ``joints``, then from each of ``starts`` (r, dof), until the aim is met.

    ``joints`` (dof,) becomes the answer, or the nearest end. Misses [m], [rad], steps in all, restarts.
    """
    nearest, best, trial = np.inf, (np.inf, np.inf, 0), joints.copy()
    steps = 0
    for i in range(len(starts) + 1):
        if i > 0:
            trial[:] = starts[i - 1]
        error, angle, used = _descend(kernel, arm, aim, trial, limits)
        steps += used
        share = max(error / limits.tolerance, angle / limits.angle_tolerance)
        if share < nearest:
            nearest, best = share, (error, angle, i)
            joints[:] = trial
        if share <= 1.0:
            break
    return best[0], best[1], steps, best[2]


@compiled
def _descend(
    kernel: int, arm: SerialArm, aim: Aim, joints: Array, limits: DescentLimits
) -> tuple[float, float, int]:
    """Misses [m], [rad] and steps of a method from ``joints``, which become its end."""
    if kernel == CYCLIC:
        return _cyclic_descent(arm, aim, joints, limits)
    if kernel == DAMPED:
        tolerance, angle_tolerance = limits.tolerance, limits.angle_tolerance
        return polish(arm, aim, joints, limits.reach, tolerance, angle_tolerance, limits.steps)
    return _line_search(kernel, arm, aim, joints, limits)


@compiled
def _line_search(
    kernel: int, arm: SerialArm, aim: Aim, joints: Array, limits: DescentLimits
) -> tuple[float, float, int]:
    """Steps of the pseudo-inverse or the transpose, each halved until it helps, or all of one gain."""
    n, rows, weight = len(joints), 3 if aim.kind == POSITION else 6, 0.5 * limits.reach
    frames, J, miss, left = np.empty((n + 1, 4, 4)), np.empty((6, n)), np.empty(6), np.empty(6)
    trial, step = np.empty(n), np.empty(n)
    error, angle = tool_error(arm, aim, joints, frames, miss)
    tried = 0
    while tried < limits.steps and (error > limits.tolerance or angle > limits.angle_tolerance):
        chain_frames(arm, joints, frames)
        chain_jacobian(arm, frames, J)
        scale_angles(frames[n], aim.kind, weight, J)
        for i in range(6):
            left[i] = miss[i] if i < 3 else weight * miss[i]
        if kernel == PSEUDO_INVERSE:
            limited_step(arm, J, left, rows, TRACE * limits.reach * limits.reach, joints, step)
        else:
            _transpose_step(arm, J, left, rows, joints, step)
        if limits.gain > 0.0:
            tried += 1
            for k in range(n):
                joints[k] = min(max(joints[k] + limits.gain * step[k], arm.lower[k]), arm.upper[k])
            error, angle = tool_error(arm, aim, joints, frames, miss)
            continue
        before, helped = squared(error) + squared(weight * angle), False
        for _ in range(HALVINGS):
            tried += 1
            for k in range(n):
                trial[k] = min(max(joints[k] + step[k], arm.lower[k]), arm.upper[k])
            new_error, new_angle = tool_error(arm, aim, trial, frames, left)
            if squared(new_error) + squared(weight * new_angle) < before:
                joints[:], miss[:] = trial, left
                error, angle, helped = new_error, new_angle, True
                break
            if tried == limits.steps:
                break
            step *= 0.5
        if not helped:
            break
    return error, angle, tried


@compiled
def _transpose_step(arm: SerialArm, J: Array, miss: Array, rows: int, joints: Array, step: Array) -> None:
    """J^T e, of the length best in the linear model, without joints that a limit stops."""
    moved = np.zeros(rows)
    for k in range(len(joints)):
        step[k] = 0.0
        for i in range(rows):
            step[k] += J[i, k] * miss[i]
        if (step[k] > 0 and joints[k] >= arm.upper[k]) or (step[k] < 0 and joints[k] <= arm.lower[k]):
            step[k] = 0.0
        for i in range(rows):
            moved[i] += J[i, k] * step[k]
    inner, squared = 0.0, 0.0
    for i in range(rows):
        inner += miss[i] * moved[i]
        squared += moved[i] * moved[i]
    step *= inner / squared if squared > 0.0 else 0.0


@compiled
def _cyclic_descent(
    arm: SerialArm, aim: Aim, joints: Array, limits: DescentLimits
) -> tuple[float, float, int]:
    """Sweeps over all joints, from the tool to the base; a step is a sweep."""
    n, weight = len(joints), 0.5 * limits.reach
    frames, miss = np.empty((n + 1, 4, 4)), np.empty(6)
    error, angle = tool_error(arm, aim, joints, frames, miss)
    for sweep in range(limits.steps):
        if error <= limits.tolerance and angle <= limits.angle_tolerance:
            return error, angle, sweep
        before = squared(error) + squared(weight * angle)
        tool = frames[n]
        for k in range(n - 1, -1, -1):
            _move_joint(arm, aim, frames[k], k, weight, joints, tool)
        error, angle = tool_error(arm, aim, joints, frames, miss)
        if squared(error) + squared(weight * angle) > (1.0 - STALLED) * before:
            return error, angle, sweep + 1
    return error, angle, limits.steps


@compiled
def _move_joint(
    arm: SerialArm, aim: Aim, frame: Array, k: int, weight: float, joints: Array, tool: Array
) -> None:
    """Move joint k to where the tool is nearest, in closed form; ``tool`` (4, 4) moves with it."""
    local, now = arm.axis[k], joints[k]
    axis = turned(frame, (local[0], local[1], local[2]))
    origin = (frame[0, 3], frame[1, 3], frame[2, 3])
    goal = (aim.position[0], aim.position[1], aim.position[2])
    tip = (tool[0, 3], tool[1, 3], tool[2, 3])
    if not arm.revolute[k]:
        value = min(max(now + dot(axis, minus(goal, tip)), arm.lower[k]), arm.upper[k])
        for i in range(3):
            tool[i, 3] += axis[i] * (value - now)
        joints[k] = value
        return
    lever = minus(tip, origin)
    c, s = _harmonic(axis, lever, minus(goal, origin))
    if aim.kind != POSITION:  # a square of the angle counts as a square of length, as in `polish`
        for j in range(2 if aim.kind == DIRECTION else 0, 3):
            share = weight * weight * (1.0 if aim.kind == DIRECTION else 0.5)
            vector = (tool[0, j], tool[1, j], tool[2, j])
            dc, ds = _harmonic(axis, vector, (aim.turn[0, j], aim.turn[1, j], aim.turn[2, j]))
            c, s = c + share * dc, s + share * ds
    if c == 0.0 and s == 0.0:
        return
    value = clamped_turn(now + math.atan2(s, c), now, arm.lower[k], arm.upper[k])
    joints[k] = value
    tip = plus(origin, rotated(axis, value - now, lever))
    for i in range(3):
        tool[i, 3] = tip[i]
    for j in range(3):
        column = rotated(axis, value - now, (tool[0, j], tool[1, j], tool[2, j]))
        for i in range(3):
            tool[i, j] = column[i]


@compiled
def _harmonic(axis: Vector, vector: Vector, wanted: Vector) -> tuple[float, float]:
    """C and s of wanted . (vector turned by t about the axis) = c cos t + s sin t + constant."""
    return dot(wanted, vector) - dot(axis, wanted) * dot(axis, vector), dot(wanted, cross(axis, vector))
