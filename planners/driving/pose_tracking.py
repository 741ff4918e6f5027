"""Pose tracking by a differential base with a five-joint arm, after Xu et al. (paper 002), exact.

The arm takes the height and the vertical parts of the orientation, joint 1 and the heading share the rest,
and the base takes X and Y by rolling along one arc a step. All in closed form: every pose is met to rounding,
and no wheel slips sideways.

The paper sets the heading along the chord of the tool's path, on which its own drive law makes the base
slide; `chord_heading` gives that rule for comparison. Its base frame has Y ahead; here x is ahead (REP 103).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from regionik.planners.driving.pitch_arm import PitchArm, PoseError, Share, arm_share
from regionik.planners.solvers.kernels import wrap
from regionik.worlds.arrays import Array

SLACK = 1e-9  # beyond a joint's limit, for rounding [rad]
SPREAD = 24  # headings round a base that may begin with any


class SaturationError(PoseError):
    """A leaning tool that joint 1 cannot hold any longer, whatever the base does; ``index`` counts from 0."""

    def __init__(self, index: int, pivot: float, limit: float) -> None:
        super().__init__(
            f"pose {index + 1}: joint 1 would stand at {np.degrees(pivot):.1f} deg, its limits are "
            f"{np.degrees(limit):.1f} deg to either side; the tool must be lifted for the base to turn",
            index,
        )


@dataclass(frozen=True, eq=False)
class TrackedRun:
    """How the robot follows poses; a step leads to the pose of its row.

    Attributes
    ----------
    base : (n, 3) array
        x, y [m], yaw [rad].
    joints : (n, 5) array
    bend : (n,) array
        Turn of the base over the step [rad].
    arc : (n,) array
        Way of the base over the step, along one arc [m]; the first row has none.
    """

    base: Array
    joints: Array
    bend: Array
    arc: Array

    def wheels(self, gauge: float) -> Array:
        """Way of the left and right wheel over each step, (n, 2), for wheels ``gauge`` apart [m]."""
        turn = self.bend * gauge / 2
        return np.column_stack([self.arc - turn, self.arc + turn])


class _Row(NamedTuple):
    """One row of a `TrackedRun`."""

    base: Array
    joints: Array
    bend: float
    arc: float


def track(
    arm: PitchArm,
    poses: Sequence[Array],
    *,
    ahead: float,
    lift: float,
    pivot_limit: float = np.pi / 2,
    heading: float | None = None,
    elbow: int = 1,
) -> TrackedRun:
    """Follow tool poses with a base that rolls along arcs.

    Parameters
    ----------
    arm : PitchArm
    poses : sequence of (4, 4) array
        Of the tool, in the world.
    ahead, lift : float
        Arm's base frame before and above the middle of the wheels [m].
    pivot_limit : float
        Joint 1 stays within plus and minus this; where it would leave, the base turns for it [rad].
    heading : float, optional
        Of the base at the first pose; by default along the tool's first step, or as near to it as joint 1
        allows [rad].
    elbow : int
        +1 or -1.

    Raises
    ------
    HeightError
        When a pose is out of the arm's reach in height.
    SaturationError
        When joint 1 would leave its limits under a leaning tool. Its pivot then stands still over the floor,
        and no wheels can turn the base about a point ahead of them: the tool has to be lifted.
    """
    return _track_of(_rows(arm, poses, ahead, lift, pivot_limit, heading, elbow))


def _rows(
    arm: PitchArm,
    poses: Sequence[Array],
    ahead: float,
    lift: float,
    limit: float,
    heading: float | None,
    elbow: int,
) -> Iterator[_Row]:
    """The rows of a track, one a pose."""
    yaw = _first_heading(poses) if heading is None else heading
    facing = 1 if abs(wrap(arm_share(arm, poses[0], lift, elbow=elbow).turn - yaw)) <= np.pi / 2 else -1
    share = arm_share(arm, poses[0], lift, elbow=elbow, facing=facing)
    turn = yaw + wrap(share.turn - yaw)
    if not share.upright:
        yaw = float(turn - np.clip(turn - yaw, -limit, limit))
    pivot = float(np.clip(turn - yaw, -limit, limit))
    base = np.array([*(poses[0][:2, 3] - _lever(ahead, share.out, pivot, yaw)), yaw])
    yield _Row(base, _joints(share, pivot, turn - yaw), 0.0, 0.0)
    for k in range(1, len(poses)):
        share = arm_share(arm, poses[k], lift, k, elbow=elbow, facing=facing)
        turn += wrap(share.turn - turn)
        bend, arc, pivot = _step(share, turn, poses[k][:2, 3], base, ahead, limit, k)
        base = rolled(base, bend, arc)
        yield _Row(base, _joints(share, pivot, turn - base[2]), bend, arc)


def _track_of(rows: Iterable[_Row]) -> TrackedRun:
    found = list(rows)
    base, joints, bend, arc = zip(*found, strict=True) if found else ((),) * 4
    return TrackedRun(
        np.array(base).reshape(-1, 3), np.array(joints).reshape(-1, 5), np.array(bend), np.array(arc)
    )


def track_runs(
    arm: PitchArm,
    poses: Sequence[Array],
    *,
    ahead: float,
    lift: float,
    lower: Array,
    upper: Array,
    heading: float | None = None,
    elbow: int = 1,
    most: float = np.inf,
) -> tuple[TrackedRun, ...]:
    """Follow tool poses in runs: a new one begins where a joint cannot follow any longer.

    Between two runs the tool must be lifted and the base brought from the last pose of the one to the first
    of the other. Each run but the first, whose ``heading`` may be given, goes on as long as from any of
    `headings`. ``lower`` and ``upper`` (5,) are the joints' limits [rad]; the rest is as for `track`.

    Returns
    -------
    tuple of TrackedRun
        None at all where some pose is beyond the limits from every heading, or more than ``most`` runs would
        be needed.
    """
    for k, pose in enumerate(poses):
        arm_share(arm, pose, lift, k, elbow=elbow)
    limit = float(min(-lower[0], upper[0], np.pi))

    def within(rows: Iterator[_Row]) -> Iterator[_Row]:
        with suppress(SaturationError):
            for row in rows:
                if (row.joints < lower - SLACK).any() or (row.joints > upper + SLACK).any():
                    return
                yield row

    def run(first: int, yaw: float | None) -> TrackedRun:
        return _track_of(within(_rows(arm, poses[first:], ahead, lift, limit, yaw, elbow)))

    runs = [run(0, heading)]
    done = len(runs[0].base)
    while runs[-1].base.size and done < len(poses):
        if len(runs) >= most:
            return ()
        tried = headings(arm, poses[done], lift, elbow)
        runs.append(max((run(done, yaw) for yaw in tried), key=lambda found: len(found.base)))
        done += len(runs[-1].base)
    return tuple(runs) if runs[-1].base.size else ()


def headings(arm: PitchArm, pose: Array, lift: float, elbow: int = 1) -> tuple[float | None, ...]:
    """Headings of a base that is to begin with a pose: along the tool's first step, then all round.

    The nearer joint 1 is to zero, the earlier.
    """
    turn = arm_share(arm, pose, lift, elbow=elbow).turn
    aside = sorted(range(SPREAD), key=lambda k: min(k, SPREAD - k))
    return (None, *(float(wrap(turn + 2 * np.pi * k / SPREAD)) for k in aside))


def rolled(base: Array, bend: float, arc: float) -> Array:
    """Base pose (3,) after rolling along an arc: the chord lies half the bend off the heading."""
    half = bend / 2
    chord = arc * float(np.sinc(half / np.pi))
    way = base[2] + half
    return np.array([base[0] + chord * np.cos(way), base[1] + chord * np.sin(way), base[2] + bend])


def _step(
    share: Share, world_turn: float, spot: Array, base: Array, ahead: float, limit: float, index: int
) -> tuple[float, float, float]:
    """Bend, arc and joint 1 that bring the tool to a spot: joint 1 follows the pose, or stands at a limit."""
    x, y = _seen(spot, base)
    turn = world_turn - base[2]
    if share.upright:  # the roll takes what joint 1 leaves: it follows the heading before the step
        pivot = float(np.clip(turn, -limit, limit))
        lever = ahead + share.out * np.cos(pivot), share.out * np.sin(pivot)
        bend = 2 * _half(y - lever[1], x + lever[0])
        return bend, _arc(x, y, *lever, bend), pivot
    # The arm keeps its direction in the world: the lever on the base is the mount alone.
    x, y = x - share.out * np.cos(turn), y - share.out * np.sin(turn)
    bend = 2 * _half(y, x + ahead)
    pivot = turn - bend
    if abs(pivot) > limit:
        raise SaturationError(index, pivot, limit)
    return bend, _arc(x, y, ahead, 0.0, bend), pivot


def _half(y: float, x: float) -> float:
    """Half the bend, at most a quarter turn: the base rolls the shorter way, backwards where need be."""
    angle = float(np.arctan2(y, x))
    return angle - np.pi * np.sign(angle) if abs(angle) > np.pi / 2 else angle


def _arc(x: float, y: float, lever_x: float, lever_y: float, bend: float) -> float:
    """Way along the arc that carries the lever's end to (x, y), seen from the base."""
    c, s = np.cos(bend / 2), np.sin(bend / 2)
    chord = x * c + y * s - (lever_x * c - lever_y * s)
    return float(chord / np.sinc(bend / 2 / np.pi))


def _joints(share: Share, pivot: float, turn: float) -> Array:
    """All five joints; where the tool stands upright the roll takes what joint 1 leaves of the turn."""
    shoulder, elbow, roll = share.joints
    if share.upright:
        roll = share.upright * (pivot - turn)
    return np.array([pivot, shoulder, elbow, roll, 0.0])


def _lever(ahead: float, out: float, pivot: float, yaw: float) -> Array:
    """From the middle of the wheels to the tool, on the floor."""
    return np.array(
        [
            ahead * np.cos(yaw) + out * np.cos(yaw + pivot),
            ahead * np.sin(yaw) + out * np.sin(yaw + pivot),
        ]
    )


def _seen(spot: Array, base: Array) -> tuple[float, float]:
    c, s = np.cos(base[2]), np.sin(base[2])
    dx, dy = spot - base[:2]
    return float(c * dx + s * dy), float(c * dy - s * dx)


def _first_heading(poses: Sequence[Array]) -> float:
    way = poses[1][:2, 3] - poses[0][:2, 3] if len(poses) > 1 else np.array([1.0, 0.0])
    return float(np.arctan2(way[1], way[0]))


def chord_heading(arm: PitchArm, poses: Sequence[Array], *, ahead: float, lift: float) -> Array:
    """Sideways slip of each step under the paper's own rule, (n - 1,) [m].

    The heading at a pose lies along the chord of the tool's path that led there, and joint 1 stands at zero;
    what the base then moves across the mean of its two headings, no wheel can roll.
    """
    shares = [arm_share(arm, pose, lift, k) for k, pose in enumerate(poses)]
    spots = np.array([pose[:2, 3] for pose in poses])
    way = np.diff(spots, axis=0)
    yaw = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
    yaw = np.insert(yaw, 0, yaw[0] - (yaw[1] - yaw[0] if len(yaw) > 1 else 0.0))
    out = np.array([share.out for share in shares])[:, None]
    base = spots - (ahead + out) * np.column_stack([np.cos(yaw), np.sin(yaw)])
    mean = (yaw[1:] + yaw[:-1]) / 2
    moved = np.diff(base, axis=0)
    slip: Array = moved[:, 1] * np.cos(mean) - moved[:, 0] * np.sin(mean)
    return slip
