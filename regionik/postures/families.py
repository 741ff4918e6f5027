"""Posture families of an arm in one vertical plane: how its plane and its last link may lie for a target."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from regionik.planners.reach.rings import FREE
from regionik.planners.reach.tool_roll import out_of_roll, swings
from regionik.worlds.arms import PlanarArm
from regionik.worlds.scene import Target

FRONT, BACK = 1, -1
ROUNDING = 1e-6  # by which inner families keep within their cone [rad]


@dataclass(frozen=True)
class Family:
    """Postures of one kind for one target: how the arm's plane and last link lie.

    Attributes
    ----------
    facing : int
        `FRONT` where the target lies ahead in the arm's plane (r > 0), `BACK` where behind (r < 0).
    pitch : float
        Angle at which the solver holds the last link in the plane [rad]; NaN where it is free.
    azimuth, half : float
        The plane may point within ``half`` of ``azimuth``, seen from above [rad].
    pitches : (low, high)
        Pitches that the reach allows [rad].
    """

    facing: int
    pitch: float = np.nan
    azimuth: float = 0.0
    half: float = np.pi
    pitches: tuple[float, float] = FREE


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
    low, high = max(pitch - spread, -np.pi / 2), min(pitch + spread, np.pi / 2)
    along = Family(FRONT, pitch, azimuth, half, (low, high))
    against = Family(FRONT, np.pi - pitch, azimuth + np.pi, half, (np.pi - high, np.pi - low))
    kinds = [along] if inner and half >= np.pi else [along, against]
    return tuple(replace(kind, facing=facing) for facing in facings for kind in kinds)


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
