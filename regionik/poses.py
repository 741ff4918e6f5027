"""Poses of the whole robot, and rows of a motion under construction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from regionik.plan import Configuration, Motion
from regionik.planners import kernels
from regionik.rolling import on_way
from regionik.worlds.arrays import Array
from regionik.worlds.robot import BaseKind

LARGEST_BEND = 0.5  # change of a joint between two states above which the arm has jumped [rad]


@dataclass(frozen=True, eq=False)
class Pose:
    """Where base and arm are."""

    base: Array  # (3,) x, y [m], yaw [rad]
    joints: Array  # (dof,)


@dataclass(frozen=True, eq=False)
class Row:
    """One state under construction."""

    pose: Pose
    kind: str
    setpoint: int


def pose(configuration: Configuration) -> Pose:
    """Base and arm of a configuration."""
    return Pose(configuration.base, configuration.joints)


def turn_to(here: Array, there: Array) -> Array:
    """From one base pose (3,) to another, yaw the shorter way."""
    step = there - here
    return np.array([step[0], step[1], kernels.wrap(step[2])])


def between(here: Pose, there: Pose, share: float, kind: BaseKind = "omni") -> Pose:
    """Part of the way between two states, as every reader of a plan fills it in."""
    base = on_way(kind, here.base, there.base, share)
    return Pose(base, here.joints + share * (there.joints - here.joints))


def columns(rows: Sequence[Row]) -> Motion:
    """Rows as the columns of a motion that is not timed."""
    return Motion(
        base=np.array([row.pose.base for row in rows]),
        joints=np.array([row.pose.joints for row in rows]),
        kind=np.array([row.kind for row in rows]),
        setpoint=np.array([row.setpoint for row in rows], dtype=np.int64),
        time=np.full(len(rows), np.nan),
    )
