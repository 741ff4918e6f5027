"""Pose tracking by a differential base with a five-joint arm, after Xu et al. (paper 002), exact.

The arm takes the height and the vertical parts of the orientation, joint 1 and the heading share the rest,
and the base takes X and Y by rolling along one arc a step. All in closed form: every pose is met to rounding,
and no wheel slips sideways.

The paper sets the heading along the chord of the tool's path, on which its own drive law makes the base
slide; `chord_heading` gives that rule for comparison. Its base frame has Y ahead; here x is ahead (REP 103).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from regionik.planners.kernels import wrap
from regionik.worlds.arrays import Array
from regionik.worlds.errors import RegionikError

VERTICAL = 1e-9  # cosine of the tool's pitch below which it stands upright
ROUNDING = 1e-12


class PoseError(RegionikError):
    """A tool pose that the arm cannot take at any place of the base; ``index`` counts from 0."""

    def __init__(self, reason: str, index: int) -> None:
        super().__init__(reason)
        self.index = index


@dataclass(frozen=True)
class PitchArm:
    """Five joints: pivot, shoulder, elbow, and two rolls of which the last is kept at zero.

    Attributes
    ----------
    shoulder_out, shoulder_up : float
        From the arm's base frame to the shoulder: a1, d1 [m].
    upper, fore : float
        Shoulder to elbow, elbow to tool: a2, d4 + d6 [m].
    """

    shoulder_out: float
    shoulder_up: float
    upper: float
    fore: float


@dataclass(frozen=True, eq=False)
class Share:
    """What the arm takes of a pose, and what it leaves.

    Attributes
    ----------
    joints : (3,) array
        Shoulder, elbow, roll [rad]; the roll is that of joint 1 at ``turn`` where the tool stands upright.
    out : float
        Tool from the pivot axis, along the arm [m].
    turn : float
        Heading of the base plus joint 1 [rad]; where the tool stands upright, plus or minus the roll.
    upright : int
        +1 where the tool points down, -1 where up, 0 else: the sign with which the roll enters ``turn``.
    """

    joints: Array
    out: float
    turn: float
    upright: int


@dataclass(frozen=True, eq=False)
class Track:
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


def heights(arm: PitchArm, pitch_sine: float) -> tuple[float, float]:
    """Heights over the arm's base frame that the tool attains with ``sin`` of its pitch down given [m]."""
    middle = arm.shoulder_up - arm.fore * pitch_sine
    return middle - arm.upper, middle + arm.upper


def arm_share(
    arm: PitchArm, pose: Array, lift: float, index: int = 0, *, elbow: int = 1, facing: int = 1
) -> Share:
    """The arm's part of a tool pose (4, 4): height and vertical components of the orientation.

    Parameters
    ----------
    arm : PitchArm
    pose : (4, 4) array
        In the world.
    lift : float
        Height of the arm's base frame [m].
    index : int
        Of the pose, for the error.
    elbow : int
        +1 or -1: which of the two shoulder angles.
    facing : int
        -1 for a forearm that points back over the shoulder; of a leaning tool alone.

    Raises
    ------
    PoseError
        When the height is out of reach at this pitch; the attainable interval is named.
    """
    n, o, a, p = pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3]
    sine = -float(a[2])
    low, high = heights(arm, sine)
    rise = float(p[2]) - lift
    if not low - ROUNDING <= rise <= high + ROUNDING:
        raise PoseError(
            f"pose {index + 1}: height {p[2]:.5f} m cannot be taken with this tool direction, "
            f"attainable: {low + lift:.5f} to {high + lift:.5f} m",
            index,
        )
    lifted = float(np.clip((arm.shoulder_up - arm.fore * sine - rise) / arm.upper, -1.0, 1.0))
    shoulder = float(np.arcsin(lifted)) if elbow > 0 else np.pi - float(np.arcsin(lifted))
    flat = float(np.hypot(a[0], a[1]))
    if flat < VERTICAL:
        upright = 1 if sine > 0 else -1
        pitch = upright * np.pi / 2
        turn = float(np.arctan2(n[1], n[0])) - (0.0 if upright > 0 else np.pi)
        joints = np.array([shoulder, pitch - shoulder, 0.0])
        return Share(joints, arm.shoulder_out + arm.upper * np.cos(shoulder), wrap(turn), upright)
    pitch = float(np.arctan2(sine, facing * flat))
    roll = float(np.arctan2(-facing * o[2], facing * n[2]))
    out = arm.shoulder_out + arm.upper * np.cos(shoulder) + arm.fore * facing * flat
    turn = float(np.arctan2(facing * a[1], facing * a[0]))
    return Share(np.array([shoulder, pitch - shoulder, roll]), out, turn, 0)


def track(
    arm: PitchArm,
    poses: Sequence[Array],
    *,
    ahead: float,
    lift: float,
    pivot_limit: float = np.pi / 2,
    heading: float | None = None,
    elbow: int = 1,
) -> Track:
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
    PoseError
        When a pose is out of the arm's reach in height, or would need the base to turn on the spot.
    """
    spots = np.array([pose[:2, 3] for pose in poses])
    yaw = _first_heading(spots) if heading is None else heading
    ahead_turn = wrap(arm_share(arm, poses[0], lift, elbow=elbow).turn - yaw)
    facing = 1 if abs(ahead_turn) <= np.pi / 2 else -1
    shares = [arm_share(arm, pose, lift, k, elbow=elbow, facing=facing) for k, pose in enumerate(poses)]
    turns = np.unwrap([share.turn for share in shares])
    turns += yaw + wrap(turns[0] - yaw) - turns[0]
    if shares[0].upright == 0:
        yaw = float(turns[0] - np.clip(turns[0] - yaw, -pivot_limit, pivot_limit))
    first = float(np.clip(turns[0] - yaw, -pivot_limit, pivot_limit))
    base = [np.array([*(spots[0] - _lever(ahead, shares[0].out, first, yaw)), yaw])]
    joints, bends, arcs = [_joints(shares[0], first, turns[0] - yaw)], [0.0], [0.0]
    for k in range(1, len(poses)):
        bend, arc, pivot = _step(shares[k], turns[k], spots[k], base[-1], ahead, pivot_limit, k)
        base.append(rolled(base[-1], bend, arc))
        joints.append(_joints(shares[k], pivot, turns[k] - base[-1][2]))
        bends.append(bend)
        arcs.append(arc)
    return Track(np.array(base), np.array(joints), np.array(bends), np.array(arcs))


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
        raise PoseError(
            f"pose {index + 1}: joint 1 would stand at {np.degrees(pivot):.1f} deg, its limits are "
            f"{np.degrees(limit):.1f} deg to either side, and the base would have to turn on the spot",
            index,
        )
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


def _first_heading(spots: Array) -> float:
    way = spots[1] - spots[0] if len(spots) > 1 else np.array([1.0, 0.0])
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
