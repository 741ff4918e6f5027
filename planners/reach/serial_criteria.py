"""Manipulability of any arm, gravity's torques in its joints, and postures led to meet thresholds of both.

Neither depends on where the vertical pivot is turned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.vectors import cross, minus, plus, row, squared, turned
from regionik.planners.kernels import compiled
from regionik.planners.search.motion_bounds import longest_levers, second_derivatives
from regionik.planners.solvers.damped_least_squares import Aim, Aims, polish
from regionik.planners.solvers.posture_criteria import COMFORT, THRESHOLD_SLACK
from regionik.planners.solvers.serial_chain import SerialArm, chain_frames, joint_changes, serial_arm
from regionik.worlds.arms import with_pivot
from regionik.worlds.arrays import Array, Index
from regionik.worlds.limits import Criteria
from regionik.worlds.prepared import made_once
from regionik.worlds.robot import GRAVITY, Robot, check_criteria

MAX_THRESHOLD_STEPS = 30  # steps that lead a posture to better ones
MAX_STEP, MIN_STEP = 0.3, 0.005  # of these [rad] or [m]
MAX_SOLVER_STEPS = 8  # of damped least squares after each
DIFFERENCE_SHARE = 1e-4  # share of motions by which slopes are told
PROBE_STEP = 1e-6  # by which joints are moved to see what that changes [rad] or [m]


class SerialThresholds(NamedTuple):
    """Thresholds of any arm behind its pivot, for kernels.

    Points are the tool's, then the centers of the masses; without points nothing is asked.
    """

    first: int  # of the joints that count: a pivot that stands for the base's turn does not
    least: float  # manipulability [m3]
    most: Array  # (dof,) torques [N m] and forces [N]; infinite where there is no limit
    links: Index  # (m,) that points move with
    points: Array  # (m, 3) in their links' frames [m]
    weights: Array  # (m,) at points [N]
    bends: Array  # (m, dof, dof) bounds of the second derivatives of points


@dataclass(frozen=True)
class PostureDemand:
    """What criteria ask of a robot's postures besides limits."""

    robot: Robot
    criteria: Criteria

    @property
    def thresholds(self) -> SerialThresholds:
        return _thresholds(self.robot, self.criteria)

    def is_met_by(self, joints: Array) -> bool:
        """True for a posture (dof,) of the arm behind its pivot that meets the thresholds."""
        arm = serial_arm(with_pivot(self.robot.chain))
        return bool(serial_margin(arm, self.thresholds, joints) > 0.0)


def demand_of(robot: Robot, criteria: Criteria | None) -> PostureDemand | None:
    """Return what criteria ask besides limits; None for nothing.

    Raises
    ------
    InputError
        For criteria that the robot cannot be held to.
    """
    if criteria is None or not criteria.beyond_limits:
        return None
    check_criteria(criteria, robot)
    return PostureDemand(robot, criteria)


def serial_thresholds(demand: PostureDemand | None, dof: int) -> SerialThresholds:
    """Thresholds of a demand, or none for ``dof`` joints."""
    if demand is not None:
        return demand.thresholds
    nothing = np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty(0), np.empty((0, dof, dof))
    return SerialThresholds(0, 0.0, np.full(dof, np.inf), *nothing)


@made_once
def _thresholds(robot: Robot, criteria: Criteria) -> SerialThresholds:
    chain = with_pivot(robot.chain)
    more = chain.dof - robot.chain.dof
    loads = robot.loads if criteria.effort is not None else ()
    points = [(len(chain.joints) - 1, chain.T_last_tool[:3, 3])]
    points += [(load.link + more, load.center) for load in loads]
    return SerialThresholds(
        more,
        criteria.manipulability or 0.0,
        np.concatenate([np.full(more, np.inf), criteria.efforts(robot.chain.dof)]),
        np.array([link for link, _ in points], dtype=np.int64),
        np.array([point for _, point in points]),
        np.array([0.0, *(GRAVITY * load.mass for load in loads)]),
        np.array([second_derivatives(chain, longest_levers(chain, *point)[0]) for point in points]),
    )


@compiled
def serial_margin(arm: SerialArm, thresholds: SerialThresholds, joints: Array) -> float:
    """Least margin of a posture (dof,) to the thresholds, as a share of them; infinite where none is set."""
    margin, torques = np.inf, np.zeros(len(joints))
    if len(thresholds.points) == 0:
        return margin
    frames, speeds = np.empty((len(arm.axis) + 1, 4, 4)), np.empty((len(joints), 3))
    chain_frames(arm, joints, frames)
    for p in range(len(thresholds.points)):
        _point_speeds(arm, frames, thresholds, p, speeds)
        if p == 0 and thresholds.least > 0.0:
            margin = _volume(speeds[thresholds.first :])[0] / thresholds.least - 1.0
        torques += thresholds.weights[p] * speeds[:, 2]
    for k in range(len(joints)):
        if thresholds.most[k] < np.inf:
            margin = min(margin, 1.0 - abs(torques[k]) / thresholds.most[k])
    return margin


@compiled
def margin_about(
    arm: SerialArm, thresholds: SerialThresholds, joints: Array, along: Array, off: Array, moves: Array
) -> float:
    """Bound of `serial_margin` for postures about a given one.

    Parameters
    ----------
    joints : (dof,) array
        The given posture.
    along : (dof, 2) array
        Two motions, of which any share from -1 to 1 is added to it.
    off : (dof,) array
        What joints then differ by, at most.
    moves : (dof,) array
        The most that each of them differs by, all in all.
    """
    margin, n = np.inf, len(joints)
    if len(thresholds.points) == 0:
        return margin
    frames, speeds = np.empty((5, len(arm.axis) + 1, 4, 4)), np.empty((5, n, 3))
    torques, changes = np.zeros(n), np.zeros(n)
    slopes, left = np.empty((2, n, 3)), np.empty(n)
    moved = 0.0
    for change in joint_changes(arm, moves):
        moved += change
    for s in range(5):
        way = 0.0 if s == 0 else (DIFFERENCE_SHARE if s % 2 else -DIFFERENCE_SHARE)
        chain_frames(arm, joints + way * along[:, s // 3], frames[s])
    for p in range(len(thresholds.points)):
        for s in range(5):
            _point_speeds(arm, frames[s], thresholds, p, speeds[s])
        for k in range(n):
            left[k] = 0.0  # beyond the first order
            for j in range(n):
                left[k] += thresholds.bends[p, k, j] * (off[j] + moved * moves[j])
            for a in range(2):
                for i in range(3):
                    slopes[a, k, i] = (speeds[1 + 2 * a, k, i] - speeds[2 + 2 * a, k, i]) / (
                        2.0 * DIFFERENCE_SHARE
                    )
            torques[k] += thresholds.weights[p] * speeds[0, k, 2]
            changes[k] += thresholds.weights[p] * (left[k] + abs(slopes[0, k, 2]) + abs(slopes[1, k, 2]))
        if p == 0 and thresholds.least > 0.0:
            first = thresholds.first
            margin = (
                _least_volume(speeds[0, first:], slopes[:, first:], left[first:]) / thresholds.least - 1.0
            )
    for k in range(n):
        if thresholds.most[k] < np.inf:
            margin = min(margin, 1.0 - (abs(torques[k]) + changes[k]) / thresholds.most[k])
    return margin


@compiled
def _point_speeds(arm: SerialArm, frames: Array, thresholds: SerialThresholds, p: int, speeds: Array) -> None:
    """Write the velocity of a point for the unit speed of each active joint, (dof, 3)."""
    link = thresholds.links[p]
    point = plus(frames[link, :3, 3], turned(frames[link], row(thresholds.points, p)))
    speeds[:] = 0.0
    for k in range(link + 1):
        axis = turned(frames[k], row(arm.axis, k))
        velocity = cross(axis, minus(point, frames[k, :3, 3])) if arm.revolute[k] else axis
        for i in range(3):
            speeds[arm.leader[k], i] += arm.ratio[k] * velocity[i]


@compiled
def _volume(speeds: Array) -> tuple[float, Array]:
    """Manipulability sqrt(det(J J^T)) of a Jacobian's columns (n, 3), and the inverse of J J^T, (3, 3).

    Source: T. Yoshikawa, Int. J. Robotics Research 4 (1985).
    """
    G, inverse, square = np.zeros((3, 3)), np.empty((3, 3)), 0.0
    for k in range(len(speeds)):
        for i in range(3):
            for j in range(3):
                G[i, j] += speeds[k, i] * speeds[k, j]
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            c, d = (j + 1) % 3, (j + 2) % 3
            inverse[j, i] = G[a, c] * G[b, d] - G[a, d] * G[b, c]
    for j in range(3):
        square += G[0, j] * inverse[j, 0]
    square = max(square, 0.0)
    return math.sqrt(square), inverse / max(square, 1e-300)


@compiled
def _least_volume(speeds: Array, slopes: Array, left: Array) -> float:
    """Bound of the manipulability about a Jacobian, by its columns (n, 3).

    They change by any share from -1 to 1 of two ``slopes`` (2, n, 3), and by what is ``left`` (n,).

    With V the right singular vectors of J, that of J + E is at least |det((J + E) V)|, which is that of J
    times det(1 + X), X = (J V)^-1 E V. The trace of X is that of E times the pseudoinverse, and det(1 + X) is
    at least 1 + tr X - 2 |X|^2 - |X|^3 by the Frobenius norm.
    """
    volume, inverse = _volume(speeds)
    size, rest, steep, traces = 0.0, 0.0, np.zeros(2), np.zeros(2)
    for k in range(len(speeds)):
        rest += squared(left[k])
        for i in range(3):
            pseudo = 0.0
            for j in range(3):
                pseudo += speeds[k, j] * inverse[j, i]
            size += squared(pseudo)
            for a in range(2):
                traces[a] += pseudo * slopes[a, k, i]
                steep[a] += squared(slopes[a, k, i])
    size, rest = math.sqrt(size), math.sqrt(rest)
    trace = abs(traces[0]) + abs(traces[1]) + size * rest
    norm = size * (math.sqrt(steep[0]) + math.sqrt(steep[1]) + rest)
    return volume * (1.0 - trace - 2.0 * norm * norm - norm * norm * norm)


@compiled
def moved_within_thresholds(
    arm: SerialArm,
    thresholds: SerialThresholds,
    aim: Aim,
    joints: Array,
    reach: float,
    tolerance: float,
    angle_tolerance: float,
    enough: float = COMFORT,
) -> bool:
    """Lead a posture on an aim to one on it that meets the thresholds by ``enough``, or else by less.

    False where it comes to none that meets them at all.

    It goes up the gradient of the margin and back to the aim by damped least squares, see `polish`.
    ``joints`` (dof,) are overwritten.
    """
    n, stride = len(joints), MAX_STEP
    margin = serial_margin(arm, thresholds, joints)
    slope, trial = np.empty(n), np.empty(n)
    for _ in range(MAX_THRESHOLD_STEPS):
        if margin > enough:
            return True
        steepest = 0.0
        for k in range(n):
            trial[:] = joints
            trial[k] += PROBE_STEP
            slope[k] = serial_margin(arm, thresholds, trial) - margin
            steepest = max(steepest, abs(slope[k]))
        if steepest == 0.0:
            break
        better = -np.inf
        while not better > margin and stride > MIN_STEP:
            for k in range(n):
                trial[k] = min(max(joints[k] + stride * slope[k] / steepest, arm.lower[k]), arm.upper[k])
            error, angle, _ = polish(arm, aim, trial, reach, tolerance, angle_tolerance, MAX_SOLVER_STEPS)
            if error <= tolerance and angle <= angle_tolerance:
                better = serial_margin(arm, thresholds, trial)
            if not better > margin:
                stride *= 0.5
        if not better > margin:
            break
        joints[:], margin = trial, better
        stride = min(2.0 * stride, MAX_STEP)
    return margin > THRESHOLD_SLACK


@compiled
def carried_along(
    arm: SerialArm,
    thresholds: SerialThresholds,
    aims: Aims,
    reach: float,
    tolerance: float,
    most: int,
    joints: Array,
) -> int:
    """Carry a posture from aim to aim, each by `polish` from the one before and led to meet thresholds.

    The first row of ``joints`` (m, n) is a posture at the first aim; overwritten with one for each aim that
    is met. Returns the number of aims met before the first that is not.
    """
    for i in range(len(aims.positions)):
        if i > 0:
            joints[i] = joints[i - 1]
        aim = Aim(aims.positions[i], aims.kinds[i], aims.turns[i], aims.cones[i])
        widest = aims.angle_tolerances[i]
        error, angle, _ = polish(arm, aim, joints[i], reach, tolerance, widest, most)
        if error > tolerance or angle > widest:
            return i
        if not moved_within_thresholds(arm, thresholds, aim, joints[i], reach, tolerance, widest):
            return i
    return len(aims.positions)
