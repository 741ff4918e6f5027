"""Damped least squares on the joints of any serial chain, limits kept: the last step of inverse kinematics.

Levenberg's and Marquardt's method: a step is taken only when it brings the tool nearer. Joints that stand at
a limit and would be pushed through it are held while the others move.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.vectors import Vector, cross, dot, norm, scaled, squared
from regionik.planners.kernels import compiled
from regionik.planners.solvers.serial_chain import SerialArm, chain_frames, chain_jacobian
from regionik.worlds.arrays import Array, Index

POSITION, DIRECTION, ORIENTATION = 0, 1, 2
MIN_DAMPING, MAX_DAMPING = 1e-14, 1e8  # of the squared reach
MAX_STEP = 1.0  # [rad] or [m]
# of turns within a cone, which keeps those of an arm of six joints that need not be made
MIN_TURN_SHARE = 0.2


class Aim(NamedTuple):
    """Goal of the tool, for kernels."""

    position: Array  # (3,) [m]
    kind: int  # POSITION alone, tool z axis in a DIRECTION with free roll, or full ORIENTATION
    turn: Array  # (3, 3) wanted tool frame; a direction is its last column
    cone: float = 0.0  # deviation from direction or orientation that counts as none [rad]


class Aims(NamedTuple):
    """Goals of the tool one after the other, for kernels; see `Aim`."""

    positions: Array  # (m, 3)
    kinds: Index  # (m,)
    turns: Array  # (m, 3, 3)
    cones: Array  # (m,)
    angle_tolerances: Array  # (m,) what may be left of each direction or orientation beyond its cone [rad]

    def part(self, rows: slice | Index) -> Aims:
        """Some of the goals."""
        return Aims._make(column[rows] for column in self)


@compiled
def pose_error(position: Vector, turn: Array, aim: Aim, miss: Array) -> tuple[float, float]:
    """Write the twist that is left (6,) into ``miss``; returns its lengths [m], [rad]."""
    for i in range(3):
        miss[i] = aim.position[i] - position[i]
        miss[3 + i] = 0.0
    if aim.kind == DIRECTION:
        _turn_between(
            (turn[0, 2], turn[1, 2], turn[2, 2]), (aim.turn[0, 2], aim.turn[1, 2], aim.turn[2, 2]), miss
        )
    elif aim.kind == ORIENTATION:
        _turn_vector(turn, aim.turn, miss)
    angle = norm((miss[3], miss[4], miss[5]))
    if aim.cone > 0.0 and angle > 0.0:  # only to the cone's edge
        beyond = max(0.0, angle - aim.cone)
        for i in range(3):
            miss[3 + i] *= beyond / angle
        angle = beyond
    return norm((miss[0], miss[1], miss[2])), angle


@compiled
def polish(
    arm: SerialArm, aim: Aim, joints: Array, reach: float, tolerance: float, angle_tolerance: float, most: int
) -> tuple[float, float, int]:
    """Move the joints until the tool is within the tolerances or no step helps; overwrites ``joints`` (n,).

    Parameters
    ----------
    reach : float
        Length of the arm, which weighs angles against lengths [m].
    most : int
        Most trial steps.

    Returns
    -------
    error [m], angle error [rad], steps tried
    """
    n, rows = len(joints), 3 if aim.kind == POSITION else 6
    frames, J = np.empty((len(arm.axis) + 1, 4, 4)), np.empty((6, n))
    miss, left = np.empty(6), np.empty(6)
    trial, step = np.empty(n), np.empty(n)
    weight, damping = 0.5 * reach, 1e-3
    error, angle = tool_error(arm, aim, joints, frames, miss)
    moved = True
    for tried in range(most):
        if (error <= tolerance and angle <= angle_tolerance) or damping > MAX_DAMPING:
            return error, angle, tried
        if moved:  # the frames are those of the joints
            chain_jacobian(arm, frames, J)
            scale_angles(frames[-1], aim.kind, weight, J)
            loosen_turns(miss, aim.cone, J)
        for i in range(6):
            left[i] = miss[i] if i < 3 else weight * miss[i]
        limited_step(arm, J, left, rows, damping * reach * reach, joints, step)
        for k in range(n):
            trial[k] = min(max(joints[k] + step[k], arm.lower[k]), arm.upper[k])
        new_error, new_angle = tool_error(arm, aim, trial, frames, left)
        moved = squared(new_error) + squared(weight * new_angle) < squared(error) + squared(weight * angle)
        if moved:
            joints[:], miss[:] = trial, left
            error, angle = new_error, new_angle
            damping = max(0.2 * damping, MIN_DAMPING)
        else:
            damping *= 8.0
    return error, angle, most


@compiled
def polish_each(
    arm: SerialArm, aim: Aim, joints: Array, reach: float, tolerance: float, angle_tolerance: float, most: int
) -> tuple[Array, Array]:
    """`polish` each row of ``joints`` (m, n), overwritten: errors [m] and angle errors [rad], (m,)."""
    errors, angles = np.empty(len(joints)), np.empty(len(joints))
    for i in range(len(joints)):
        errors[i], angles[i], _ = polish(arm, aim, joints[i], reach, tolerance, angle_tolerance, most)
    return errors, angles


@compiled
def tool_error(arm: SerialArm, aim: Aim, joints: Array, frames: Array, miss: Array) -> tuple[float, float]:
    chain_frames(arm, joints, frames)
    tool = frames[-1]
    return pose_error((tool[0, 3], tool[1, 3], tool[2, 3]), tool[:3, :3], aim, miss)


@compiled
def scale_angles(tool: Array, kind: int, weight: float, J: Array) -> None:
    """Turn the Jacobian's angles into lengths; a free roll about the tool's axis is left out."""
    axis = (tool[0, 2], tool[1, 2], tool[2, 2])
    for k in range(J.shape[1]):
        roll = dot(axis, (J[3, k], J[4, k], J[5, k])) if kind == DIRECTION else 0.0
        for i in range(3):
            J[3 + i, k] = weight * (J[3 + i, k] - roll * axis[i])


@compiled
def loosen_turns(miss: Array, cone: float, J: Array) -> None:
    """Leave of the Jacobian's turns (6, n) what they change of the angle beyond a cone.

    That is the part along the turn that is left, and a share of the others: a posture goes round within the
    cone and along its edge, which an arm of few joints cannot do without.
    """
    if cone <= 0.0:
        return
    beyond = norm((miss[3], miss[4], miss[5]))
    share = max(beyond / (beyond + cone), MIN_TURN_SHARE)
    for k in range(J.shape[1]):
        along = 0.0
        if beyond > 0.0:
            along = (1.0 - share) * dot((miss[3], miss[4], miss[5]), (J[3, k], J[4, k], J[5, k]))
            along /= squared(beyond)
        for i in range(3):
            J[3 + i, k] = share * J[3 + i, k] + along * miss[3 + i]


@compiled
def limited_step(
    arm: SerialArm, J: Array, miss: Array, rows: int, damping: float, joints: Array, step: Array
) -> None:
    """Damped least squares step (n,); joints that would leave their limits are held, then the rest solved."""
    n = len(joints)
    free, A, y = np.ones(n, dtype=np.bool_), np.empty((rows, rows)), np.empty(rows)
    for _ in range(n + 1):
        for i in range(rows):
            for j in range(i + 1):
                A[i, j] = damping if i == j else 0.0
                for k in range(n):
                    if free[k]:
                        A[i, j] += J[i, k] * J[j, k]
        y[:] = miss[:rows]
        solve_symmetric(A, y)
        blocked, longest = False, 0.0
        for k in range(n):
            step[k] = 0.0
            if free[k]:
                for i in range(rows):
                    step[k] += J[i, k] * y[i]
                longest = max(longest, abs(step[k]))
                if (step[k] > 0 and joints[k] >= arm.upper[k]) or (step[k] < 0 and joints[k] <= arm.lower[k]):
                    free[k], blocked = False, True
        if not blocked:
            if longest > MAX_STEP:
                step *= MAX_STEP / longest
            return


@compiled
def solve_symmetric(A: Array, y: Array) -> None:
    """Solve A x = y for a positive definite A given by its lower half; both are overwritten (Cholesky)."""
    n = len(y)
    for j in range(n):
        for k in range(j):
            A[j, j] -= A[j, k] * A[j, k]
        A[j, j] = np.sqrt(A[j, j]) if A[j, j] > 1e-300 else 1e-150
        for i in range(j + 1, n):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            A[i, j] /= A[j, j]
        for k in range(j):
            y[j] -= A[j, k] * y[k]
        y[j] /= A[j, j]
    for j in range(n - 1, -1, -1):
        for k in range(j + 1, n):
            y[j] -= A[k, j] * y[k]
        y[j] /= A[j, j]


@compiled
def turns_left(kinds: Index, wanted: Array, turns: Array) -> Array:
    """Rotation vectors (n, 3) from frames (n, 3, 3) to what aims want of them; zero where that is nothing."""
    left = np.zeros((len(kinds), 6))
    for n in range(len(kinds)):
        if kinds[n] == DIRECTION:
            z, axis = turns[n, :, 2], wanted[n, :, 2]
            _turn_between((z[0], z[1], z[2]), (axis[0], axis[1], axis[2]), left[n])
        elif kinds[n] == ORIENTATION:
            _turn_vector(turns[n], wanted[n], left[n])
    return left[:, 3:]


@compiled
def _turn_between(z: Vector, wanted: Vector, miss: Array) -> None:
    """Shortest turn that takes one unit vector to another, as a rotation vector in ``miss[3:]``."""
    axis, c = cross(z, wanted), dot(z, wanted)
    s = norm(axis)
    if s < 1e-15 and c < 0.0:  # half a turn, about any normal
        axis = cross(z, (1.0, 0.0, 0.0) if abs(z[0]) < 0.7 else (0.0, 1.0, 0.0))
        s, c = norm(axis), -np.inf
    if s > 0.0:
        factor = (np.pi if c == -np.inf else math.atan2(s, c)) / s
        miss[3], miss[4], miss[5] = scaled(axis, factor)


@compiled
def _turn_vector(turn: Array, wanted: Array, miss: Array) -> None:
    """Rotation vector of ``wanted`` against ``turn``, in the base frame, in ``miss[3:]``: by quaternions."""
    M = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                M[i, j] += wanted[i, k] * turn[j, k]
    trace = M[0, 0] + M[1, 1] + M[2, 2]
    big = 0
    for i in range(1, 3):
        if M[i, i] > M[big, big]:
            big = i
    q = np.empty(4)
    if trace > M[big, big]:
        q[0] = 1.0 + trace
        q[1], q[2], q[3] = M[2, 1] - M[1, 2], M[0, 2] - M[2, 0], M[1, 0] - M[0, 1]
    else:
        i, j, k = big, (big + 1) % 3, (big + 2) % 3
        q[0] = M[k, j] - M[j, k]
        q[1 + i] = 1.0 + M[i, i] - M[j, j] - M[k, k]
        q[1 + j], q[1 + k] = M[i, j] + M[j, i], M[i, k] + M[k, i]
    if q[0] < 0.0:
        q *= -1.0
    axis = (q[1], q[2], q[3])
    s = norm(axis)
    if s > 0.0:
        miss[3], miss[4], miss[5] = scaled(axis, 2.0 * math.atan2(s, q[0]) / s)
