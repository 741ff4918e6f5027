"""Posture families of an arm in one vertical plane, and its roll.

A family is a facing, a direction of the arm's plane and a pitch of the last link that suit a target. They
take the tool's axis; what is left of an orientation is a turn about it, for the roll joint if there is one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.angles import TWO_PI, wrap
from regionik.planners.geometry.cones import swings_about, swings_within
from regionik.planners.reach.rings import FREE
from regionik.worlds.arms import PlanarArm
from regionik.worlds.arrays import Array
from regionik.worlds.chain import rot_y, rot_z
from regionik.worlds.scene import Target

FRONT, BACK = 1, -1
ROUNDING = 1e-6  # by which inner families keep within their cone, and outer ones go beyond it [rad]
PITCH_DIGITS = 12  # of a pitch: families whose pitches differ by less have the same bands


class Band(NamedTuple):
    """Directions of an arm's plane, and pitches of the last link that go with each of them."""

    azimuth: float = 0.0  # the plane may point within ``half`` of ``azimuth``, seen from above [rad]
    half: float = np.pi
    pitches: tuple[float, float] = FREE  # lowest and highest [rad]


@dataclass(frozen=True)
class Family:
    """Postures of one kind for one target."""

    facing: int  # `FRONT` where the target lies ahead in the arm's plane (r > 0), `BACK` where behind (r < 0)
    # Angle at which the solver holds the last link in the plane where it can [rad]; NaN where it is free
    pitch: float = np.nan
    bands: tuple[Band, ...] = (Band(),)  # that the reach allows, the widest swing first


@lru_cache(maxsize=4096)
def families(
    direction: tuple[float, float, float] | None, cone: float, facings: tuple[int, ...], inner: bool
) -> tuple[Family, ...]:
    """Posture families that may reach a target.

    A given tool direction sets the last link's pitch: with the plane along the direction seen from above,
    or against it. Bands of swings and pitches are those within the cone: inner ones lie in it, outer ones
    about it. Where the cone holds the vertical one family has both, as the last link leads from one to the
    other.
    """
    if direction is None:
        return tuple(Family(facing) for facing in facings)
    x, y, z = direction
    flat = float(np.hypot(x, y))
    pitch, azimuth = float(np.arctan2(z, flat)), float(np.arctan2(y, x)) if flat > 0 else 0.0
    swings = swings_within if inner else swings_about
    within = within_cone(cone) if inner else min(cone + ROUNDING, np.pi)
    along = tuple(Band(azimuth, *swing) for swing in swings(round(pitch, PITCH_DIGITS), within))
    against = tuple(_mirrored(band) for band in along)
    kinds = [(pitch, along), (np.pi - pitch, against)]
    if inner and along[0].half >= np.pi:
        kinds = [(pitch, along + against)]
    return tuple(Family(facing, *kind) for facing in facings for kind in kinds)


def within_cone(cone: float) -> float:
    """A cone as inner areas and postures keep to it [rad]."""
    return max(cone - ROUNDING, cone / 2)


def families_along(
    azimuth: float, pitch: float, half: float, pitches: tuple[float, float]
) -> tuple[Family, Family]:
    """Families that face a target, the plane along a direction and against it."""
    band = Band(azimuth, half, pitches)
    return Family(FRONT, pitch, (band,)), Family(FRONT, np.pi - pitch, (_mirrored(band),))


def _mirrored(band: Band) -> Band:
    """The same directions of the tool with the plane turned round."""
    low, high = band.pitches
    return Band(band.azimuth + np.pi, band.half, (np.pi - high, np.pi - low))


def families_of(
    arm: PlanarArm, target: Target, facings: tuple[int, ...], *, inner: bool
) -> tuple[Family, ...]:
    """Posture families that may reach a target, its full orientation included."""
    direction = None if target.direction is None else tuple(target.direction.tolist())
    kinds = families(direction, target.cone, facings, inner)
    if target.orientation is None:
        return kinds
    turn, cone = target.orientation, target.cone
    if not inner:
        wide = [(kind, kind.bands[0]) for kind in kinds]
        return tuple(
            kind
            for kind, band in wide
            if not out_of_roll(arm, band.azimuth, kind.pitch, band.half, turn, cone)
        )
    rows = [_within_roll_rate(arm, kind, turn, 0.0) for kind in kinds]
    # A turn keeps to its cone where tilt and part about the axis keep to one narrower by a root of 2.
    if rows != [[kind] for kind in kinds]:
        narrow = cone / np.sqrt(2)
        rows += [
            _within_roll_rate(arm, kind, turn, narrow) for kind in families(direction, narrow, facings, inner)
        ]
    return tuple(kind for row in rows for kind in row)


def _within_roll_rate(arm: PlanarArm, kind: Family, turn: Array, slack: float) -> list[Family]:
    """A family cut to where the roll joint keeps up with its bands, one for each turn that this takes."""
    if arm.roll_upper - arm.roll_lower + 2 * slack >= TWO_PI:
        return [kind]
    found: dict[int, list[Band]] = {}
    for band in kind.bands:
        pitch = _in_front(kind.pitch) if band.pitches[0] < np.pi / 2 else np.pi - _in_front(kind.pitch)
        for k, middle, half in swings(arm, band.azimuth, pitch, band.half, turn, slack, band.pitches):
            found.setdefault(k, []).append(Band(band.azimuth + middle, half, band.pitches))
    return [replace(kind, bands=tuple(found[k])) for k in sorted(found)]


def _in_front(pitch: float) -> float:
    """The pitch of the same rise that lies in front [rad]."""
    return float(np.arctan2(np.sin(pitch), abs(np.cos(pitch))))


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
    arm: PlanarArm,
    yaw: float,
    pitch: float,
    half: float,
    turn: Array,
    slack: float = 0.0,
    pitches: tuple[float, float] | None = None,
) -> tuple[tuple[int, float, float], ...]:
    """Swings of the plane about ``yaw`` with which the roll joint keeps up, within its limits.

    With the tool's axis along ``turn``'s at ``yaw`` and ``pitch``, a swing s of the plane about the vertical
    and a pitch p' turn the tool about its own axis by w beyond the shortest turn between both axes, where
    tan(w / 2) = tan(s / 2) sin((p + p') / 2) / cos((p - p') / 2), which grows with p'.
    Swings from -half to half at all ``pitches`` of a range are considered, by default at that of the axis,
    and the roll may miss the wanted orientation by ``slack`` [rad].
    Returns whole turns of the roll, the middle of the swing and half its width, one row an interval [rad].
    """
    rolls = arm.roll_upper - arm.roll_lower + 2 * slack
    if rolls >= TWO_PI:
        return ((0, 0.0, half),)
    middle = (arm.roll_lower + arm.roll_upper) / 2
    away = float(wrap(middle - roll_for(arm, yaw, pitch, turn))) * (-1.0 if arm.roll_sign >= 0.0 else 1.0)
    low, high = pitches or (pitch, pitch)
    spans = []
    for k in (-1, 0, 1):
        twists = away + k * TWO_PI - rolls / 2, away + k * TWO_PI + rolls / 2
        ends = [_swings(twists, _lean(pitch, one)) for one in (low, high)]
        first = max(-half, *(one for one, _ in ends))
        last = min(half, *(one for _, one in ends))
        if last > first:
            spans.append((k, (first + last) / 2, (last - first) / 2))
    return tuple(spans)


def _lean(axis: float, pitch: float) -> float:
    """Twist of the tool for a small swing of the plane, its axis and its last link at two pitches."""
    return float(np.sin((axis + pitch) / 2) / max(np.cos((axis - pitch) / 2), 1e-12))


def _swings(twists: tuple[float, float], lean: float) -> tuple[float, float]:
    """Swings of the plane that turn the tool about its own axis by twists of a range, none if descending."""
    if abs(lean) < 1e-9:  # the plane swings about an axis square to the tool's
        return (-np.pi, np.pi) if twists[0] <= 0.0 <= twists[1] else (np.pi, -np.pi)
    low, high = twists if lean > 0.0 else (-twists[1], -twists[0])
    return _swing(low, lean), _swing(high, lean)


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
