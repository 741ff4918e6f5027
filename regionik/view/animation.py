"""A plan's motion as key frames that a viewer plays at a readable speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from regionik.values import Plan
from regionik.worlds.arrays import Array

SPEED = 0.25  # of base or tool, whichever moves more [m/s]
SHORTEST, LONGEST = 10.0, 60.0  # [s]
REST = 1.5  # at the end, before the animation starts again [s]
MOST_FRAMES = 2000
# What a turn counts for, as if something moved at this distance from its axis [m].
_LEVER = 0.2
_LEAST_STEP = 0.002  # [m], so that no two states fall on the same moment

TrackKind = Literal["position", "turn", "color", "faces"]


@dataclass(frozen=True, eq=False)
class Track:
    """How one property of one node changes.

    Attributes
    ----------
    path : str
    kind : {"position", "turn", "color", "faces"}
        Places and turns of a node change evenly from key to key; the colour of a body, and which of its
        faces are drawn, jump at their keys.
    times : (n,) array
        [s]
    values : (n, k) array
        x, y, z [m]; quaternion x, y, z, w; red, green, blue from 0 to 1; first face and count.
    """

    path: str
    kind: TrackKind
    times: Array
    values: Array | NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Frames:
    """Key frames of a motion.

    Attributes
    ----------
    times : (n,) array
        [s], from 0.
    base : (n, 3) array
        Yaw runs on beyond a full turn, so that every turn goes the shorter way.
    joints : (n, dof) array
    lifted : (n,) array of bool
        Whether the motion that arrives at the frame is a transit.
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


def key_frames(plan: Plan) -> Frames:
    """At most about ``MOST_FRAMES`` key frames; states that are set-points are always among them."""
    motion, drive = plan.motion, plan.world.robot.drive
    states = np.column_stack([motion.base[:, :2], np.unwrap(motion.base[:, 2])])
    clock = _clock(states, motion.joints, plan.tools())
    index = drive.cuts(states)
    times, base = _at(index, clock), drive.sampled(states, index)
    at_setpoint = np.isin(index, np.flatnonzero(motion.kind == "setpoint"))
    keep = _chosen(at_setpoint)
    dof = motion.joints.shape[1]
    # A row between states belongs to the motion that arrives at the next.
    lifted = (motion.kind == "transit")[np.ceil(index).astype(int)]
    table = np.column_stack([base, *(_at(index, joint) for joint in motion.joints.T), lifted])[keep]
    fine = _refined(times[keep], table)
    return Frames(
        times=fine[:, 0],
        base=fine[:, 1:4],
        joints=fine[:, 4 : 4 + dof],
        lifted=fine[:, -1] > 0.5,
        passed=times[at_setpoint],
    )


def _at(index: Array, column: Array) -> Array:
    """A column of states between them."""
    values: Array = np.interp(index, np.arange(len(column)), column)
    return values


def _clock(base: Array, joints: Array, tools: Array) -> Array:
    """When every state is shown (n,) [s]."""
    moves = np.column_stack(
        [
            np.linalg.norm(np.diff(base[:, :2], axis=0), axis=1),
            np.linalg.norm(np.diff(tools, axis=0), axis=1),
            _LEVER * np.abs(np.diff(base[:, 2])),
            _LEVER * np.abs(np.diff(joints, axis=0)).max(axis=1),
        ]
    ).max(axis=1)
    times = np.concatenate([[0.0], np.cumsum(np.maximum(moves, _LEAST_STEP))]) / SPEED
    total = times[-1]
    scale = np.clip(total, SHORTEST, LONGEST) / total if total > 0 else 1.0
    scaled: Array = times * scale
    return scaled


def _chosen(at_setpoint: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Indices of the states that become key frames."""
    n = len(at_setpoint)
    spread = np.linspace(0, n - 1, min(n, MOST_FRAMES)).round().astype(np.intp)
    if n > MOST_FRAMES:
        room = max(2, MOST_FRAMES - int(at_setpoint.sum()))
        spread = np.linspace(0, n - 1, room).round().astype(np.intp)
    return np.union1d(spread, np.flatnonzero(at_setpoint))


def _refined(times: Array, table: Array) -> Array:
    """Rows of time and table, with rows between where an angle would turn too far for a quaternion."""
    turn = np.abs(np.diff(table[:, 2:-1], axis=0)).max(axis=1, initial=0.0)
    pieces = np.maximum(1, np.ceil(turn / (np.pi / 2)).astype(int))
    index = np.concatenate([k + np.arange(p) / p for k, p in enumerate(pieces)] + [[len(times) - 1.0]])
    columns = np.column_stack([times, table])
    fine: Array = np.column_stack([_at(index, c) for c in columns.T])
    fine[:, -1] = table[np.ceil(index).astype(int), -1]
    return fine


def turning(axis: Array, angles: Array) -> Array:
    """Quaternions x, y, z, w (n, 4) of turns about a unit axis; continuous where the angles are."""
    half = np.asarray(angles)[:, None] / 2
    return np.hstack([np.sin(half) * axis, np.cos(half)])
