"""Poses of the whole robot, and states of a motion that is being built."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from regionik.values import Configuration, Motion
from regionik.worlds.arms import has_pivot, pivot_index
from regionik.worlds.arrays import Array
from regionik.worlds.drives import BaseDrive
from regionik.worlds.robot import Robot

MAX_JOINT_CHANGE = 0.5  # change of a joint between two states above which the arm has jumped [rad]
SAME_POSE = 1e-8  # poses that are nearer are one [m], [rad]


@dataclass(frozen=True, eq=False)
class Pose:
    """Pose of the base and joints of the arm."""

    base: Array  # (3,) x, y [m], yaw [rad]
    joints: Array  # (dof,)


@dataclass(frozen=True, eq=False)
class MotionState:
    """A state of a motion that is being built."""

    pose: Pose
    kind: str
    setpoint: int


def configuration_pose(configuration: Configuration) -> Pose:
    """Return the pose of a configuration."""
    return Pose(configuration.base, configuration.joints)


def pose_between(here: Pose, there: Pose, share: float, drive: BaseDrive) -> Pose:
    """Return a pose on the way between two states, as every reader of a plan interpolates it."""
    base = drive.between(here.base, there.base, share)
    return Pose(base, here.joints + share * (there.joints - here.joints))


def lifted_states(
    here: Pose, way: Sequence[Pose], there: Pose, owner: int, drive: BaseDrive
) -> list[MotionState]:
    """Return the states strictly between two poses with the tool lifted, at least one if it leaves its path.

    The ``owner`` is the set-point that it leaves, -1 where the robot starts.
    """
    states = distinct([here, *way, there])[1:-1]
    if not states and owner >= 0:
        states = [pose_between(here, there, 0.5, drive)]
    return [MotionState(pose, "transit", owner) for pose in states]


def distinct(poses: Sequence[Pose]) -> list[Pose]:
    """Return poses without those that equal the one before but for rounding; the last one stays."""
    states = np.hstack(arrays(poses)) if len(poses) > 1 else np.empty((0, 0))
    if (np.abs(np.diff(states, axis=0)).max(axis=1) > SAME_POSE).all():
        return list(poses)
    kept = list(poses[:1])
    for pose in poses[1:]:
        if _apart(pose, kept[-1]):
            kept.append(pose)
        elif pose is poses[-1] and len(kept) > 1:
            kept[-1:] = [pose]
    return kept


def _apart(one: Pose, other: Pose) -> bool:
    base, joints = np.abs(one.base - other.base).max(), np.abs(one.joints - other.joints).max()
    return bool(base > SAME_POSE or joints > SAME_POSE)


def arrays(poses: Sequence[Pose]) -> tuple[Array, Array]:
    """Return poses as arrays, base (n, 3) and joints (n, dof)."""
    return np.array([one.base for one in poses]), np.array([one.joints for one in poses])


def untimed_motion(states: Sequence[MotionState]) -> Motion:
    """Return states as a motion that is not timed."""
    base, joints = arrays([state.pose for state in states])
    return Motion(
        base=base,
        joints=joints,
        kind=np.array([state.kind for state in states]),
        setpoint=np.array([state.setpoint for state in states], dtype=np.int64),
        time=np.full(len(states), np.nan),
    )


def lift_offs(motion: Motion) -> int:
    """Return the number of runs of states with the tool lifted after the first set-point."""
    lifted = np.concatenate([[False], motion.kind == "transit", [False]]).astype(int)
    first = int(np.argmax(motion.kind == "setpoint"))
    return int(np.count_nonzero(np.diff(lifted[first + 1 :]) == 1))


def transits(motion: Motion) -> Iterator[slice]:
    """Yield the states with the tool lifted between two others; the start is one of these others."""
    lifted = np.concatenate([[False], motion.kind == "transit", [False]])
    for first, end in np.flatnonzero(np.diff(lifted)).reshape(-1, 2).tolist():
        yield slice(max(first, 1), end)


def motion_stats(
    drive: BaseDrive, setpoints: Sequence[Configuration], motion: Motion, methods: dict[str, int]
) -> dict[str, Any]:
    """Return figures of a motion for `regionik.values.Plan.stats`."""
    return {
        "setpoints": len(setpoints),
        "iterations": int(sum(found.iterations for found in setpoints)),
        "states": len(motion),
        "base_travel": drive.travel(motion.base),
        "base_moves": methods,
        "largest_error": float(max(found.error for found in setpoints)),
    }


def axis_of(robot: Robot, base: Array) -> Array:
    """Return the arm axis on the floor (..., 2) for base poses (..., 3)."""
    x, y = robot.mount[0], robot.mount[1]
    if x == 0.0 and y == 0.0:
        return np.array(base[..., :2])
    c, s = np.cos(base[..., 2]), np.sin(base[..., 2])
    return base[..., :2] + np.stack([c * x - s * y, s * x + c * y], axis=-1)


def pose_of(robot: Robot, axis: Array, yaw: float) -> Array:
    """Return the base pose (3,) that puts the arm axis on a spot with a heading."""
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = robot.mount[0], robot.mount[1]
    return np.array([axis[0] - (c * x - s * y), axis[1] - (s * x + c * y), yaw])


def facing(robot: Robot, at: Pose) -> Pose:
    """Return a pose with the base turned under the arm until the pivot is as near to zero as limits allow.

    The same pose where the arm has no pivot of its own.
    """
    if not has_pivot(robot.chain):
        return at
    pivot = pivot_index(robot.chain)
    ahead = np.clip(0.0, robot.chain.lower[pivot], robot.chain.upper[pivot])
    yaw = float(at.base[2] + at.joints[pivot] - ahead)
    joints = np.where(np.arange(robot.chain.dof) == pivot, ahead, at.joints)
    return Pose(pose_of(robot, axis_of(robot, at.base), yaw), joints)


def arm_states(here: Pose, there: Pose) -> list[Pose]:
    """Return the states strictly between two postures on a stationary base."""
    change = there.joints - here.joints
    count = max(1, int(np.ceil(float(np.abs(change).max()) / MAX_JOINT_CHANGE * 1.001)))
    return [Pose(here.base, here.joints + k / count * change) for k in range(1, count)]
