"""A five-joint arm that tilts its tool in one vertical plane and rolls it, after Xu et al. (paper 002).

A pivot, a shoulder and an elbow that pitch, a roll along the forearm, and a last joint that is kept at zero.
Of a tool pose it takes the height and the vertical parts of the orientation; the base takes the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regionik.planners.geometry.angles import wrap
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.errors import RegionikError

VERTICAL = 1e-9  # horizontal part of the tool axis below which it is upright
ROUNDING = 1e-12
ALIKE = 1e-9  # tolerance to which a chain must be such an arm [m]
_POSTURES = np.array([[0.0, 0.0, 0.0, 0.0, 0.0], [0.7, -0.4, 0.9, 1.1, 0.0], [-1.9, 0.8, -1.3, -0.6, 0.0]])


class HeightError(RegionikError):
    """A tool pose, counted from 0, at a height that the arm attains nowhere; heights over the floor [m]."""

    def __init__(self, index: int, height: float, low: float, high: float) -> None:
        super().__init__(
            f"pose {index + 1}: height {height:.5f} m cannot be taken with this tool direction, "
            f"attainable: {low:.5f} to {high:.5f} m"
        )
        self.index, self.height, self.low, self.high = index, height, low, high


@dataclass(frozen=True)
class PitchArm:
    """Five joints: pivot, shoulder, elbow, and two rolls of which the last is kept at zero."""

    # shoulder_out, shoulder_up: from the arm's base frame to the shoulder: a1, d1 [m]
    shoulder_out: float
    shoulder_up: float
    # upper, fore: shoulder to elbow, elbow to tool: a2, d4 + d6 [m]
    upper: float
    fore: float


@dataclass(frozen=True, eq=False)
class ArmShare:
    """Part of a tool pose that the arm takes, and the rest that is left to the base."""

    # (3,) shoulder, elbow, roll [rad]; the roll is that of joint 1 at ``turn`` where the tool stands upright
    joints: Array
    out: float  # tool from the pivot axis, along the arm [m]
    # heading of the base plus joint 1 [rad]; where the tool stands upright, plus or minus the roll
    turn: float
    # +1 where the tool points down, -1 where up, 0 else: the sign with which the roll enters ``turn``
    upright: int


def pitch_arm(chain: Chain) -> PitchArm | None:
    """Lengths of a chain that is such an arm with the paper's angles; None for any other.

    Joint values are those of the table (q1, d1, a1, -90), (q2, 0, a2, 0), (q3 - 90, 0, 0, -90),
    (q4, d4, 0, 90), (q5, 0, 0, -90) [deg], and d6 to the tool along its z axis.
    """
    if chain.has_mimics or chain.dof != 5 or any(joint.kind != "revolute" for joint in chain.joints):
        return None
    first, elbow, *_, tool = chain.frames(np.zeros(5))[1:, :3, 3]
    arm = PitchArm(
        shoulder_out=float(first[0]),
        shoulder_up=float(first[2]),
        upper=float(elbow[0] - first[0]),
        fore=float(tool[0] - elbow[0]),
    )
    apart = np.abs(chain.forward(_POSTURES) - _chain_of(arm).forward(_POSTURES)).max()
    return arm if apart < ALIKE and arm.upper > 0 else None


def _chain_of(arm: PitchArm) -> Chain:
    """Chain of the table with the arm's lengths."""
    h, inf = np.pi / 2, np.inf
    rows = [
        (0, arm.shoulder_up, arm.shoulder_out, -h),
        (0, 0, arm.upper, 0),
        (-h, 0, 0, -h),
        (0, arm.fore, 0, h),
        (0, 0, 0, -h),
    ]
    return Chain.from_dh([(*row, -inf, inf) for row in rows])


def heights(arm: PitchArm, pitch_sine: float) -> tuple[float, float]:
    """Least and greatest tool height over the arm's base frame for a sine of the pitch down [m]."""
    middle = arm.shoulder_up - arm.fore * pitch_sine
    return middle - arm.upper, middle + arm.upper


def arm_share(
    arm: PitchArm, pose: Array, lift: float, index: int = 0, *, elbow: int = 1, facing: int = 1
) -> ArmShare:
    """Return the arm's part of a tool pose: height and vertical components of the orientation.

    Parameters
    ----------
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
    HeightError
        When the height is out of reach at this pitch.
    """
    n, o, a, p = pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3]
    sine = -float(a[2])
    low, high = heights(arm, sine)
    rise = float(p[2]) - lift
    if not low - ROUNDING <= rise <= high + ROUNDING:
        raise HeightError(index, float(p[2]), low + lift, high + lift)
    lifted = float(np.clip((arm.shoulder_up - arm.fore * sine - rise) / arm.upper, -1.0, 1.0))
    shoulder = float(np.arcsin(lifted)) if elbow > 0 else np.pi - float(np.arcsin(lifted))
    flat = float(np.hypot(a[0], a[1]))
    if flat < VERTICAL:
        upright = 1 if sine > 0 else -1
        pitch = upright * np.pi / 2
        turn = float(np.arctan2(n[1], n[0])) - (0.0 if upright > 0 else np.pi)
        joints = np.array([shoulder, pitch - shoulder, 0.0])
        return ArmShare(joints, arm.shoulder_out + arm.upper * np.cos(shoulder), wrap(turn), upright)
    pitch = float(np.arctan2(sine, facing * flat))
    roll = float(np.arctan2(-facing * o[2], facing * n[2]))
    out = arm.shoulder_out + arm.upper * np.cos(shoulder) + arm.fore * facing * flat
    turn = float(np.arctan2(facing * a[1], facing * a[0]))
    return ArmShare(np.array([shoulder, pitch - shoulder, roll]), out, turn, 0)
