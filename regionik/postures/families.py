"""Posture families of an arm in one vertical plane, and its roll.

A family is a facing, a direction of the arm's plane and a pitch of the last link that suit a target. They
take the tool's axis; what is left of an orientation is a turn about it, for the roll joint if there is one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from regionik.planners.geometry.angles import TWO_PI, wrap
from regionik.planners.reach.rings import FREE
from regionik.worlds.arms import PlanarArm
from regionik.worlds.arrays import Array
from regionik.worlds.chain import rot_y, rot_z
from regionik.worlds.scene import Target

FRONT, BACK = 1, -1
ROUNDING = 1e-6  # by which inner families keep within their cone [rad]


@dataclass(frozen=True)
class Family:
    """Postures of one kind for one target."""

    facing: int  # `FRONT` where the target lies ahead in the arm's plane (r > 0), `BACK` where behind (r < 0)
    # Angle at which the solver holds the last link in the plane [rad]; NaN where it is free
    pitch: float = np.nan
    azimuth: float = 0.0  # the plane may point within ``half`` of ``azimuth``, seen from above [rad]
    half: float = np.pi
    pitches: tuple[float, float] = FREE  # (low, high) pitches that the reach allows [rad]


@lru_cache(maxsize=4096)
def families(
    direction: tuple[float, float, float] | None, cone: float, facings: tuple[int, ...], inner: bool
) -> tuple[Family, ...]:
    """Posture families that may reach a target.

    A given tool direction sets the last link's pitch: with the plane along the direction seen from above,
    or against it. Inner areas hold the pitch itself and let the plane swing within the cone; outer areas
    take every pitch and every swing that the cone lets through, each by itself.
    """
    if direction is None:
        return tuple(Family(facing) for facing in facings)
    x, y, z = direction
    flat = float(np.hypot(x, y))
    pitch = float(np.arctan2(z, flat))
    azimuth = float(np.arctan2(y, x)) if flat > 0 else 0.0
    if inner:
        # cos(cone) = cos^2(pitch) cos(swing) + sin^2(pitch)
        swing = np.cos(cone) - z * z
        half = np.pi if swing <= -flat * flat else max(0.0, float(np.arccos(swing / flat**2)) - ROUNDING)
        spread = 0.0
    else:
        # The widest swing of the cone's edge, unless the cone holds the vertical.
        half = float(np.arcsin(np.sin(cone) / flat)) if cone < np.pi / 2 and np.sin(cone) < flat else np.pi
        spread = cone
    pitches = max(pitch - spread, -np.pi / 2), min(pitch + spread, np.pi / 2)
    both = families_along(azimuth, pitch, half, pitches)
    kinds = both[:1] if inner and half >= np.pi else both
    return tuple(replace(kind, facing=facing) for facing in facings for kind in kinds)


def families_along(
    azimuth: float, pitch: float, half: float, pitches: tuple[float, float]
) -> tuple[Family, Family]:
    """Families that face a target, the plane along a direction and against it."""
    low, high = pitches
    along = Family(FRONT, pitch, azimuth, half, pitches)
    return along, Family(FRONT, np.pi - pitch, azimuth + np.pi, half, (np.pi - high, np.pi - low))


def families_of(
    arm: PlanarArm, target: Target, facings: tuple[int, ...], *, inner: bool
) -> tuple[Family, ...]:
    """Posture families that may reach a target, its full orientation included."""
    direction = None if target.direction is None else tuple(target.direction.tolist())
    kinds = families(direction, target.cone, facings, inner)
    if target.orientation is None:
        return kinds
    if inner:
        narrow = families(direction, target.cone / np.sqrt(2), facings, inner)
        rows = [_kept_up(arm, kind, target, 0.0) for kind in kinds]
        # A turn keeps to its cone where tilt and part about the axis keep to one narrower by a root of 2.
        if rows != [[kind] for kind in kinds]:
            rows += [_kept_up(arm, kind, target, target.cone / np.sqrt(2)) for kind in narrow]
        return tuple(kind for row in rows for kind in row)
    turn, cone = target.orientation, target.cone
    return tuple(
        kind for kind in kinds if not out_of_roll(arm, kind.azimuth, kind.pitch, kind.half, turn, cone)
    )


def _kept_up(arm: PlanarArm, kind: Family, target: Target, slack: float) -> list[Family]:
    """A family cut to where the roll joint keeps up with its swing."""
    assert target.orientation is not None
    spans = swings(arm, kind.azimuth, kind.pitch, kind.half, target.orientation, slack)
    return [replace(kind, azimuth=kind.azimuth + middle, half=half) for middle, half in spans]


def tool_turn(arm: PlanarArm, yaw: float, pitch: float, roll: float) -> Array:
    """Tool orientation (3, 3) with the plane in direction ``yaw``, the last link at ``pitch`` [rad]."""
    spin = rot_z(arm.roll_sign * roll)
    return (rot_z(yaw) @ rot_y(-pitch))[:3, :3] @ arm.tool_turn @ spin[:3, :3]


def roll_for(arm: PlanarArm, yaw: float, pitch: float, turn: Array) -> float:
    """Value of the roll joint that brings the tool nearest to an orientation, limits aside [rad].

    What is left is the turn that takes one axis to the other the shortest way.
    """
    left = tool_turn(arm, yaw, pitch, 0.0).T @ turn
    twist = float(np.arctan2(left[1, 0] - left[0, 1], left[0, 0] + left[1, 1]))
    return twist if arm.roll_sign >= 0.0 else -twist


def roll_within_limits(arm: PlanarArm, roll: float, near: float) -> float:
    """The turn of a roll that lies within its limits, near where the joint is; else a limit [rad]."""
    first = near + float(wrap(roll - near))
    for turn in (first, first - TWO_PI, first + TWO_PI):
        if arm.roll_lower <= turn <= arm.roll_upper:
            return turn
    return min((arm.roll_lower, arm.roll_upper), key=lambda end: abs(float(wrap(end - roll))))


def swings(
    arm: PlanarArm, yaw: float, pitch: float, half: float, turn: Array, slack: float = 0.0
) -> tuple[tuple[float, float], ...]:
    """Swings of the plane about ``yaw`` with which the roll joint keeps up, within its limits.

    With the tool's axis along ``turn``'s at ``yaw``, a swing s of the plane about the vertical turns the tool
    about its own axis by w, tan(w / 2) = tan(s / 2) sin(pitch), beyond the shortest turn between both axes.
    Swings from -half to half are considered, and the roll may miss the wanted orientation by ``slack`` [rad].
    Returns the middle of the swing and half its width, one row an interval [rad].
    """
    rolls = arm.roll_upper - arm.roll_lower + 2 * slack
    if rolls >= TWO_PI:
        return ((0.0, half),)
    at_rest, lean = roll_for(arm, yaw, pitch, turn), float(np.sin(pitch))
    away = float(wrap((arm.roll_lower + arm.roll_upper) / 2 - at_rest))
    if abs(lean) < 1e-9:  # the plane swings about an axis square to the tool's
        return ((0.0, half),) if abs(away) <= rolls / 2 else ()
    side = -np.sign(lean) * (arm.roll_sign if arm.roll_sign != 0.0 else 1.0)
    spans = []
    for middle in (side * away - TWO_PI, side * away, side * away + TWO_PI):
        low = max(-half, _swing(middle - rolls / 2, lean))
        high = min(half, _swing(middle + rolls / 2, lean))
        if high > low:
            spans.append(((low + high) / 2, (high - low) / 2))
    return tuple(spans)


def _swing(twist: float, lean: float) -> float:
    """Swing of the plane that turns the tool about its own axis by a twist, to half a turn at most."""
    if abs(twist) >= np.pi:
        return float(np.copysign(np.pi, twist))
    return float(2 * np.arctan(np.tan(twist / 2) / abs(lean)))


def out_of_roll(arm: PlanarArm, yaw: float, pitch: float, half: float, turn: Array, cone: float) -> bool:
    """True only where no posture of a kind turns the tool within ``cone`` of an orientation.

    The plane may swing to ``half`` either side of ``yaw``, the last link's pitch differ by ``cone``. A swing
    s at pitch p' turns the tool about its own axis by w, tan(w / 2) = tan(s / 2) sin((p + p') / 2) /
    cos((p - p') / 2), which grows with p'; and no turn is smaller than its part about an axis.
    """
    lean = float(np.arcsin(np.clip(np.sin(pitch), -1.0, 1.0)))
    ends = np.clip([lean - cone, lean + cone], -np.pi / 2, np.pi / 2)
    most = float(np.abs(np.sin((lean + ends) / 2) / np.cos((lean - ends) / 2)).max())
    twist = 2 * np.arctan(np.tan(half / 2) * most) if half < np.pi else np.pi
    middle, reach = (arm.roll_lower + arm.roll_upper) / 2, (arm.roll_upper - arm.roll_lower) / 2
    away = abs(float(wrap(middle - roll_for(arm, yaw, pitch, turn))))
    return away > reach + twist + cone
