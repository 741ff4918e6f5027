"""Pose tracking by a differential base with a five-joint pitch arm, after Xu et al. (paper 002), exact.

The arm takes the height and the vertical parts of the orientation, joint 1 and the heading share the
direction, and the base takes X and Y by rolling along one arc a step. All in closed form: every pose is met
to rounding, and no wheel slips sideways.

The paper sets the heading along the chord of the tool's path, where its own drive law makes the base slide
(`benchmarks.tables.xu` measures that). Its base frame has Y ahead; here x is ahead (REP 103).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from regionik.papers.options import PAPERS
from regionik.papers.pitch_arm import ArmShare, PitchArm, arm_share
from regionik.planners.driving.arcs import arc_end
from regionik.planners.geometry.angles import wrap
from regionik.worlds.arrays import Array

OPTIONS = PAPERS.tracker

SLACK = 1e-9  # beyond a joint's limit, for rounding [rad]


@dataclass(frozen=True, eq=False)
class TrackingRobot:
    """A differential base with a pitch arm straight ahead of its wheels."""

    arm: PitchArm
    # ahead, lift: arm's base frame before and above the middle of the wheels [m]
    ahead: float
    lift: float
    # lower, upper: (5,) joint limits; joint 1 keeps within the nearer of its two to either side [rad]
    lower: Array
    upper: Array

    @property
    def pivot_limit(self) -> float:
        """Largest value of joint 1 to either side; beyond it the base turns instead [rad]."""
        return float(min(-self.lower[0], self.upper[0], np.pi))


@dataclass(frozen=True, eq=False)
class TrackedRun:
    """States that follow tool poses."""

    base: Array  # (n, 3) x, y [m], yaw [rad]
    joints: Array  # (n, 5)


_TrackedState = tuple[Array, Array]  # of a `TrackedRun`: base and joints


def _tracked_states(
    robot: TrackingRobot, poses: Sequence[Array], heading: float | None, elbow: int
) -> Iterator[_TrackedState]:
    """Rows of a run, one for each pose as long as joint 1 keeps its limits."""
    arm, lift, limit = robot.arm, robot.lift, robot.pivot_limit
    first = poses[1][:2, 3] - poses[0][:2, 3] if len(poses) > 1 else np.array([1.0, 0.0])
    yaw = float(np.arctan2(first[1], first[0])) if heading is None else heading
    facing = 1 if abs(wrap(arm_share(arm, poses[0], lift, elbow=elbow).turn - yaw)) <= np.pi / 2 else -1
    share = arm_share(arm, poses[0], lift, elbow=elbow, facing=facing)
    turn = yaw + wrap(share.turn - yaw)
    if not share.upright:
        yaw = float(turn - np.clip(turn - yaw, -limit, limit))
    pivot = float(np.clip(turn - yaw, -limit, limit))
    base = np.array([*(poses[0][:2, 3] - _lever(robot.ahead, share.out, pivot, yaw)), yaw])
    yield base, _joints(share, pivot, turn - yaw)
    for k in range(1, len(poses)):
        share = arm_share(arm, poses[k], lift, k, elbow=elbow, facing=facing)
        turn += wrap(share.turn - turn)
        found = _step(robot, share, turn, poses[k][:2, 3], base)
        if found is None:
            return
        step, length, pivot = found
        base = np.array(arc_end(base[0], base[1], base[2], length, step))
        yield base, _joints(share, pivot, turn - base[2])


def _run(robot: TrackingRobot, poses: Sequence[Array], heading: float | None, elbow: int) -> TrackedRun:
    """Rows up to the first that leaves the joint limits, if any."""
    lower, upper = robot.lower - SLACK, robot.upper + SLACK
    rows = _tracked_states(robot, poses, heading, elbow)
    found = list(takewhile(lambda row: not ((row[1] < lower) | (row[1] > upper)).any(), rows))
    base, joints = zip(*found, strict=True) if found else ((), ())
    return TrackedRun(np.array(base).reshape(-1, 3), np.array(joints).reshape(-1, 5))


def track_runs(
    robot: TrackingRobot,
    poses: Sequence[Array],
    *,
    heading: float | None = None,
    elbow: int = 1,
    most: float = np.inf,
) -> tuple[TrackedRun, ...]:
    """Follow tool poses in runs: a new one begins where a joint would leave its limits.

    Between two runs the tool must be lifted and the base driven from the last pose of one to the first of the
    next. The first run starts with ``heading``; each other with that of `start_headings` from which it goes
    farthest.

    Parameters
    ----------
    poses : sequence of (4, 4) array
        Of the tool, in the world.
    heading : float, optional
        Of the base at the first pose; by default along the tool's first step, or as near to it as joint 1
        allows [rad].
    elbow : int
        +1 or -1.
    most : float
        Number of runs.

    Returns
    -------
    tuple of TrackedRun
        Empty where some pose is beyond the limits from every heading, or more than ``most`` runs are needed.

    Raises
    ------
    HeightError
        When a pose is out of the arm's reach in height.
    """
    for k, pose in enumerate(poses):
        arm_share(robot.arm, pose, robot.lift, k, elbow=elbow)

    runs = [_run(robot, poses, heading, elbow)]
    done = len(runs[0].base)
    while runs[-1].base.size and done < len(poses):
        if len(runs) >= most:
            return ()
        tried = start_headings(robot, poses[done], elbow)
        ways = (_run(robot, poses[done:], yaw, elbow) for yaw in tried)
        runs.append(max(ways, key=lambda found: len(found.base)))
        done += len(runs[-1].base)
    return tuple(runs) if runs[-1].base.size else ()


def start_headings(robot: TrackingRobot, pose: Array, elbow: int = 1) -> tuple[float | None, ...]:
    """Headings of a base to start a run with: along the tool's first step (None), then all round.

    The nearer joint 1 is to zero, the earlier.
    """
    turn = arm_share(robot.arm, pose, robot.lift, elbow=elbow).turn
    aside = sorted(range(OPTIONS.start_headings), key=lambda k: min(k, OPTIONS.start_headings - k))
    return (None, *(float(wrap(turn + 2 * np.pi * k / OPTIONS.start_headings)) for k in aside))


def _step(
    robot: TrackingRobot, share: ArmShare, world_turn: float, spot: Array, base: Array
) -> tuple[float, float, float] | None:
    """Turn and length of the base's arc, and joint 1, that bring the tool to a spot.

    The lever from the wheels to the tool turns with the base by T; its end gets to (x, y), seen from the
    base, where the chord has the heading T / 2: tan(T / 2) = (y - lever_y) / (x + lever_x).

    None where joint 1 would leave its limits under a leaning tool. Its axis then stands still over the floor,
    and no wheels turn the base about a point ahead of them: the tool has to be lifted.
    """
    ahead, limit = robot.ahead, robot.pivot_limit
    x, y = _seen_from(base, spot)
    facing = world_turn - base[2]
    if share.upright:  # the roll takes what joint 1 leaves: it follows the heading before the step
        pivot = float(np.clip(facing, -limit, limit))
        lever = ahead + share.out * np.cos(pivot), share.out * np.sin(pivot)
        turn = 2 * _half_turn(y - lever[1], x + lever[0])
        return turn, _arc_length(x, y, *lever, turn), pivot
    # The arm keeps its direction in the world: the lever on the base is the mount alone.
    x, y = x - share.out * np.cos(facing), y - share.out * np.sin(facing)
    turn = 2 * _half_turn(y, x + ahead)
    pivot = facing - turn
    return (turn, _arc_length(x, y, ahead, 0.0, turn), pivot) if abs(pivot) <= limit else None


def _half_turn(y: float, x: float) -> float:
    """Half the turn, at most a right angle: the base turns the shorter way and rolls backwards if need be."""
    angle = float(np.arctan2(y, x))
    return angle - np.pi * np.sign(angle) if abs(angle) > np.pi / 2 else angle


def _arc_length(x: float, y: float, lever_x: float, lever_y: float, turn: float) -> float:
    """Length of the arc that carries the lever's end to (x, y), seen from the base."""
    c, s = np.cos(turn / 2), np.sin(turn / 2)
    chord = x * c + y * s - (lever_x * c - lever_y * s)
    return float(chord / np.sinc(turn / 2 / np.pi))


def _joints(share: ArmShare, pivot: float, turn: float) -> Array:
    """All five joints; under an upright tool the roll takes what joint 1 leaves of the turn."""
    shoulder, elbow, roll = share.joints
    if share.upright:
        roll = share.upright * (pivot - turn)
    return np.array([pivot, shoulder, elbow, roll, 0.0])


def _lever(ahead: float, out: float, pivot: float, yaw: float) -> Array:
    """Vector on the floor from the middle of the wheels to the tool, (2,)."""
    return np.array(
        [
            ahead * np.cos(yaw) + out * np.cos(yaw + pivot),
            ahead * np.sin(yaw) + out * np.sin(yaw + pivot),
        ]
    )


def _seen_from(base: Array, spot: Array) -> tuple[float, float]:
    """Coordinates of a spot in the frame of the base."""
    c, s = np.cos(base[2]), np.sin(base[2])
    dx, dy = spot - base[:2]
    return float(c * dx + s * dy), float(c * dy - s * dx)
