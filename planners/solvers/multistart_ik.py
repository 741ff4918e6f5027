"""FABRIK-R from many starts: a start that stalls is polished, then the next one is taken; compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.angles import wrap
from regionik.planners.geometry.vectors import squared
from regionik.planners.kernels import compiled
from regionik.planners.solvers.damped_least_squares import (
    DIRECTION,
    POSITION,
    Aim,
    polish,
    pose_error,
    tool_error,
)
from regionik.planners.solvers.fabrikr import (
    Posture,
    backward_pass,
    forward_pass,
    forward_start_posed,
    forward_step,
    matmul3,
    matmul3_transposed,
    posture_of,
)
from regionik.planners.solvers.rigid_bodies import RigidBodies, arm_model, span
from regionik.planners.solvers.serial_chain import rotate_about
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, spread_postures
from regionik.worlds.errors import InputError

PROGRESS_WINDOW = 5  # passes over which progress is judged
MAX_REMAINING_PASSES = 40  # passes that a start may still need at its present pace
MAX_POLISH_STEPS = 60  # of polishing one start


class Effort(NamedTuple):
    """Tolerances and limits of a solve."""

    # tolerance, angle_tolerance: [m], [rad]
    tolerance: float
    angle_tolerance: float
    most_passes: int  # from each start; 0 for arms with joints that mimic others, which passes take as free
    reach: float  # length of the arm [m]
    polishing: bool


@compiled
def solve_ik(
    bodies: RigidBodies, aim: Aim, starts: Array, effort: Effort, joints: Array
) -> tuple[float, float, int, int, bool]:
    """Bring the tool to its aim: passes from ``joints``, then from each of ``starts``, each end polished.

    Polishing before a restart is what makes real arms fast: on most of them passes alone stall at their
    offsets, within a few steps of an answer.

    Parameters
    ----------
    bodies : RigidBodies
        Pointing ones for a position, posing ones for more.
    starts : (r, n) array
        Postures to start again from.
    joints : (dof,) array
        Start, within limits; overwritten with the answer, or with the nearest posture found. Joints beyond
        the bodies' n keep their values.

    Returns
    -------
    error [m], angle error [rad], passes in all, restarts, whether it was polished
    """
    n, count = len(bodies.arm.lower), len(starts) + 1
    still = Effort(effort.tolerance, effort.angle_tolerance, 0, effort.reach, effort.polishing)
    best, best_error, best_angle, passes = np.inf, np.inf, np.inf, 0
    answer, end = np.empty(n), np.empty(n)
    # Passes may lead every start into one corner of the limits: last of all, starts are polished as they are.
    for i in range(2 * count - 1 if effort.polishing and effort.most_passes > 0 else count):
        drawn = i - 1 if i < count else i - count
        end[:] = joints[:n] if i == 0 else starts[drawn]
        error, angle, used = _passes_from(bodies, aim, effort if i < count else still, end, i == count - 1)
        passes += used
        polished = effort.polishing and tolerance_share(error, angle, effort) > 1.0
        if polished:
            error, angle, _ = polish(
                bodies.arm, aim, end, effort.reach, effort.tolerance, effort.angle_tolerance, MAX_POLISH_STEPS
            )
        share = tolerance_share(error, angle, effort)
        if share < best:
            best, best_error, best_angle = share, error, angle
            answer[:] = end
        if share <= 1.0:
            _unwind(bodies, answer, joints)
            return error, angle, passes, min(i, count - 1), polished
    _unwind(bodies, answer, joints)
    return best_error, best_angle, passes, count - 1, effort.polishing


@compiled
def _passes_from(
    bodies: RigidBodies, aim: Aim, effort: Effort, joints: Array, to_the_end: bool
) -> tuple[float, float, int]:
    """Passes from one start; ``joints`` (n,) becomes the best posture met.

    A start is dropped when it would need more than `MAX_REMAINING_PASSES` passes at its present pace, the
    last one (``to_the_end``) only when it makes no progress at all.
    """
    miss = np.empty(6)
    if effort.most_passes == 0:
        error, angle = tool_error(bodies.arm, aim, joints, np.empty((len(bodies.arm.axis) + 1, 4, 4)), miss)
        return error, angle, 0
    posture = posture_of(bodies, joints)
    trail = np.empty(effort.most_passes + 1)
    best, best_error, best_angle, used = np.inf, np.inf, np.inf, 0
    for used in range(effort.most_passes + 1):
        error, angle = posture_error(bodies, aim, posture, miss)
        share = tolerance_share(error, angle, effort)
        if share < best:
            best, best_error, best_angle = share, error, angle
            joints[:] = posture.joints
        trail[used] = best
        if best <= 1.0:
            break
        if stalled(trail, used, to_the_end):
            break
        if used < effort.most_passes:
            inward_pass(bodies, aim, posture)
            backward_pass(bodies, posture)
    return best_error, best_angle, used


@compiled
def stalled(trail: Array, used: int, to_the_end: bool) -> bool:
    """True where passes are to be given up by their `tolerance_share` so far, the least at each: its trail.

    They would need more than `MAX_REMAINING_PASSES` passes at their present pace, or, where they go on
    ``to_the_end``, make no progress at all.
    """
    if used < PROGRESS_WINDOW + 2:
        return False
    gain = math.log(trail[used - PROGRESS_WINDOW] / trail[used])
    return gain <= 1e-4 or (
        not to_the_end and gain * MAX_REMAINING_PASSES < PROGRESS_WINDOW * math.log(trail[used])
    )


@compiled
def inward_pass(bodies: RigidBodies, aim: Aim, posture: Posture) -> None:
    """From the target in to the root, the last body turned as the aim asks."""
    if aim.kind == POSITION:
        forward_pass(bodies, aim.position, posture)
        return
    turn = np.empty((3, 3))
    _wanted_last(bodies, aim, posture, turn)
    forward_start_posed(bodies, aim.position, turn, posture)
    for k in range(len(posture.joints) - 1, 0, -1):
        forward_step(bodies, k, posture)


@compiled
def _wanted_last(bodies: RigidBodies, aim: Aim, posture: Posture, turn: Array) -> None:
    """Orientation of the last link that the aim asks for; of many, the one nearest to the present."""
    last, wanted = posture.turns[len(posture.joints) - 1], aim.turn.copy()
    if aim.kind == DIRECTION or aim.cone > 0.0:
        now, miss, spin = np.empty((3, 3)), np.empty(6), np.empty((3, 3))
        matmul3(last, bodies.arm.tool, now)
        pose_error((0.0, 0.0, 0.0), now, aim, miss)
        angle = np.sqrt(squared(miss[3]) + squared(miss[4]) + squared(miss[5]))
        wanted[:] = now
        if angle > 0.0:
            rotate_about(miss[3:] / angle, angle, spin)
            matmul3(spin, now, wanted)
    matmul3_transposed(wanted, bodies.arm.tool, turn)


@compiled
def posture_error(bodies: RigidBodies, aim: Aim, posture: Posture, miss: Array) -> tuple[float, float]:
    """Error of the tool [m], [rad]; ``miss`` (6,) becomes the twist that is left."""
    n = len(posture.joints)
    position = (posture.outer[n, 0], posture.outer[n, 1], posture.outer[n, 2])
    turn = posture.turns[n - 1].copy()
    if aim.kind != POSITION:
        matmul3(posture.turns[n - 1], bodies.arm.tool, turn)
    return pose_error(position, turn, aim, miss)


@compiled
def tolerance_share(error: float, angle: float, effort: Effort) -> float:
    """Larger of both errors as a share of its tolerance, rounded up so that it cannot exceed 1 later."""
    return (1.0 + 1e-9) * max(error / effort.tolerance, angle / effort.angle_tolerance)


@compiled
def _unwind(bodies: RigidBodies, answer: Array, joints: Array) -> None:
    """Write the answer; joints without limits by the turn nearest to where they were."""
    for k in range(len(answer)):
        value = answer[k]
        if bodies.arm.revolute[k] and np.isinf(bodies.arm.lower[k]) and np.isinf(bodies.arm.upper[k]):
            value = joints[k] + wrap(value - joints[k])
        joints[k] = value


class ArmSolver:
    """A chain prepared for many goals.

    Parameters
    ----------
    tolerance, angle_tolerance : float [m], [rad]
    most_passes : int
        From each start.
    restarts : int
        Other postures to start from, drawn once within the limits.
    polish : bool
        Whether damped least squares may finish what passes do not.

    Examples
    --------
    >>> from regionik.worlds.bundled import robot_named
    >>> robot = robot_named("pioneer7")
    >>> joints = robot.carry.copy()
    >>> error, _, _, restarts, polished = ArmSolver(robot.chain).solve(
    ...     Aim(np.array([0.3, 0.0, 0.15]), POSITION, np.eye(3)), joints
    ... )
    >>> error < 1e-3, restarts, polished
    (True, 0, False)
    """

    def __init__(
        self,
        chain: Chain,
        tolerance: float = 1e-3,
        angle_tolerance: float = 1e-3,
        most_passes: int = 300,
        restarts: int = 10,
        polish: bool = True,
    ) -> None:
        for name, value in (("tolerance", tolerance), ("angle_tolerance", angle_tolerance)):
            if not 0.0 < value < np.inf:
                raise InputError(f"{name}: expected a number above 0, got {value}")
        for name, count in (("most_passes", most_passes), ("restarts", restarts)):
            if count < 0:
                raise InputError(f"{name}: expected 0 or more, got {count}")
        self.chain = chain
        self.pointing, self.posing = arm_model(chain).pointing, arm_model(chain).posing
        passes = 0 if chain.has_mimics else int(most_passes)
        self.effort = Effort(
            float(tolerance), float(angle_tolerance), passes, span(self.posing.arm), bool(polish)
        )
        self.starts = spread_postures(chain, self.effort.reach, restarts, 0)

    def bodies(self, kind: int) -> RigidBodies:
        """The bodies that the kernel `solve_ik` needs for a kind of aim."""
        return self.pointing if kind == POSITION else self.posing

    def solve(self, aim: Aim, joints: Array) -> tuple[float, float, int, int, bool]:
        """`solve_ik` of the chain; overwrites ``joints`` (dof,), which are within the limits."""
        bodies = self.bodies(aim.kind)
        starts = np.ascontiguousarray(self.starts[:, : len(bodies.arm.lower)])
        found: tuple[float, float, int, int, bool] = solve_ik(bodies, aim, starts, self.effort, joints)
        return found
