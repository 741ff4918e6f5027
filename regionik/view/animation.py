"""Key frames of a plan's motion, timed so that a viewer can follow it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regionik.values import Plan
from regionik.worlds.arrays import Array

SPEED = 0.25  # of base or tool, whichever moves farther [m/s]
SHORTEST, LONGEST = 10.0, 60.0  # [s]
REST = 1.5  # at the end, before the animation starts again [s]
MOST_FRAMES = 2000
_TURN_RADIUS = 0.2  # a turn counts as the motion of a point at this distance from the axis [m]
_LEAST_STEP = 0.002  # [m], so that no two states have the same time


@dataclass(frozen=True, eq=False)
class KeyFrames:
    """Key frames of a motion.

    Attributes
    ----------
    times : (n,) array
        [s], from 0.
    base : (n, 3) array
        Yaw is unwrapped, so that every turn takes the shorter direction.
    joints : (n, dof) array
    lifted : (n,) array of bool
        Whether the motion to the frame is a transit.
    passed : (k,) array
        When each set-point is reached [s].
    """

    times: Array
    base: Array
    joints: Array
    lifted: NDArray[np.bool_]
    passed: Array

    @property
    def duration(self) -> float:
        return float(self.times[-1]) + REST


def key_frames(plan: Plan) -> KeyFrames:
    """Return at most about `MOST_FRAMES` key frames, all set-points among them."""
    motion, drive = plan.motion, plan.world.robot.drive
    states = np.column_stack([motion.base[:, :2], np.unwrap(motion.base[:, 2])])
    clock = _display_times(states, motion.joints, plan.tools())
    index = drive.cuts(states)
    times, base = _interpolated(index, clock), drive.sampled(states, index)
    at_setpoint = np.isin(index, np.flatnonzero(motion.kind == "setpoint"))
    keep = _selected(at_setpoint)
    dof = motion.joints.shape[1]
    # A row between two states belongs to the motion to the second.
    lifted = (motion.kind == "transit")[np.ceil(index).astype(int)]
    table = np.column_stack([base, *(_interpolated(index, joint) for joint in motion.joints.T), lifted])[keep]
    fine = _refined(times[keep], table)
    return KeyFrames(
        times=fine[:, 0],
        base=fine[:, 1:4],
        joints=fine[:, 4 : 4 + dof],
        lifted=fine[:, -1] > 0.5,
        passed=times[at_setpoint],
    )


def _interpolated(index: Array, column: Array) -> Array:
    """A column of states, interpolated at fractional indices."""
    values: Array = np.interp(index, np.arange(len(column)), column)
    return values


def _display_times(base: Array, joints: Array, tools: Array) -> Array:
    """Times at which states are shown (n,) [s]."""
    moves = np.column_stack(
        [
            np.linalg.norm(np.diff(base[:, :2], axis=0), axis=1),
            np.linalg.norm(np.diff(tools, axis=0), axis=1),
            _TURN_RADIUS * np.abs(np.diff(base[:, 2])),
            _TURN_RADIUS * np.abs(np.diff(joints, axis=0)).max(axis=1),
        ]
    ).max(axis=1)
    times = np.concatenate([[0.0], np.cumsum(np.maximum(moves, _LEAST_STEP))]) / SPEED
    total = times[-1]
    scale = np.clip(total, SHORTEST, LONGEST) / total if total > 0 else 1.0
    scaled: Array = times * scale
    return scaled


def _selected(at_setpoint: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Indices of the states that become key frames."""
    n = len(at_setpoint)
    others = n if n <= MOST_FRAMES else max(2, MOST_FRAMES - int(at_setpoint.sum()))
    spread = np.linspace(0, n - 1, others).round().astype(np.intp)
    return np.union1d(spread, np.flatnonzero(at_setpoint))


def _refined(times: Array, table: Array) -> Array:
    """Rows of time and table, subdivided where an angle turns too far to interpolate quaternions."""
    turn = np.abs(np.diff(table[:, 2:-1], axis=0)).max(axis=1, initial=0.0)
    pieces = np.maximum(1, np.ceil(turn / (np.pi / 2)).astype(int))
    index = np.concatenate([k + np.arange(p) / p for k, p in enumerate(pieces)] + [[len(times) - 1.0]])
    columns = np.column_stack([times, table])
    fine: Array = np.column_stack([_interpolated(index, c) for c in columns.T])
    fine[:, -1] = table[np.ceil(index).astype(int), -1]
    return fine


def turn_quaternions(axis: Array, angles: Array) -> Array:
    """Return quaternions x, y, z, w (n, 4) of turns about a unit axis; continuous where the angles are."""
    half = np.asarray(angles)[:, None] / 2
    return np.hstack([np.sin(half) * axis, np.cos(half)])
