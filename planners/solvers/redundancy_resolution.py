"""Joints of an arm along poses of its tool, the base held: redundancy resolved over the whole path.

A posture that is only carried on from pose to pose ends at a joint's limit, or at an obstacle, which another
would have passed. So many are carried on at once. Each goes on to the next pose by the least motion, and with
some of its self-motion either way; of those that come to lie together the one with the shortest way is kept.

Source: the layered graph of joint solutions along a path of Descartes, and of CppFlow (Morgan, Millard and
Sukhatme, RA-L 2024), its layers made one from the other, as no closed form is needed for that.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from regionik.planners.kernels import compiled
from regionik.planners.solvers.damped_least_squares import (
    POSITION,
    Aim,
    Aims,
    limited_step,
    polish,
    scale_angles,
    tool_error,
)
from regionik.planners.solvers.serial_chain import SerialArm, chain_jacobian
from regionik.worlds.arrays import Array, Index

STEPS = 12  # of damped least squares from one pose to the next
DRIFT = 0.7  # of the largest change of joints, spent on self-motion
DAMPING = 1e-6  # of the squared reach, where self-motion is told from motion of the tool
NO_REDUNDANCY = 0.02  # part of a motion of the joints that is left as self-motion, and counts as none
WIDER = 1.5  # times as wide become the cells that are too many

Clear = Callable[[Array, Array], bool]  # joints (n,) at an aim, and at the next one


class PathSolving(NamedTuple):
    """Parameters of `resolve_redundancy`."""

    reach: float  # length of the arm [m]
    tolerance: float  # [m]
    longest: Array  # (n,) largest change of each joint from one aim to the next [rad] or [m]
    most: int  # postures that are carried on at once


class _Layer(NamedTuple):
    """Postures at one aim: joints (k, n), the one each comes from (k,), and costs (k,)."""

    joints: Array
    parent: Index
    cost: Array


def resolve_redundancy(
    arm: SerialArm, aims: Aims, starts: Array, solving: PathSolving, clear: Clear
) -> Array:
    """Return joints along aims, as far as some posture gets, with the least motion among those found.

    Parameters
    ----------
    starts : (k, n) array
        Postures at the first aim.
    clear : callable
        True for joints at an aim and at the next one that the arm may go between; at the first aim it is
        asked about the same joints twice.

    Returns
    -------
    (m, n) array
        At the first m aims; each changes by no more than ``solving.longest`` from the one before.
    """
    rng = np.random.default_rng(0)
    first = _Layer(starts, np.full(len(starts), -1), np.zeros(len(starts)))
    layers = [_thinned(first, starts, solving, clear)]
    for i in range(1, len(aims.positions)):
        onward = _onward(arm, aims, i, layers[-1], solving, rng.normal(size=len(arm.lower)))
        kept = _thinned(onward, layers[-1].joints[onward.parent], solving, clear)
        if not len(kept.joints):
            break
        layers.append(kept)
    return _traced(layers)


def _onward(arm: SerialArm, aims: Aims, i: int, last: _Layer, solving: PathSolving, way: Array) -> _Layer:
    """Postures at aim i that those at the one before lead to."""
    aim = Aim(aims.positions[i], aims.kinds[i], aims.turns[i], aims.cones[i])
    n = last.joints.shape[1]
    joints, parent = np.empty((3 * len(last.joints), n)), np.empty(3 * len(last.joints), dtype=np.int64)
    count = _led_on(arm, aim, aims.angle_tolerances[i], solving, way, last.joints, joints, parent)
    joints, parent = joints[:count], parent[:count]
    steps = np.square((joints - last.joints[parent]) / solving.longest)
    return _Layer(joints, parent, last.cost[parent] + (steps + np.square(steps)).sum(axis=1))


def _thinned(layer: _Layer, before: Array, solving: PathSolving, clear: Clear) -> _Layer:
    """Of the postures in each cell of joints the one of least cost, if it is clear; not too many.

    ``before`` has the joints that each comes from, (k, n).
    """
    if not len(layer.joints):
        return layer
    order = np.argsort(layer.cost, kind="stable")
    width = DRIFT * solving.longest
    while True:
        cells = np.rint(layer.joints[order] / width)
        chosen = np.sort(np.unique(cells, axis=0, return_index=True)[1])
        if len(chosen) <= solving.most:
            break
        width = WIDER * width
    likely = order[chosen]
    kept = likely[[clear(before[k], layer.joints[k]) for k in likely]]
    return _Layer(layer.joints[kept], layer.parent[kept], layer.cost[kept])


def _traced(layers: list[_Layer]) -> Array:
    """The posture of least cost in the last layer, and those that it comes from, (m, n)."""
    if not len(layers[-1].joints):
        return layers[-1].joints
    k = int(np.argmin(layers[-1].cost))
    rows = []
    for layer in reversed(layers):
        rows.append(layer.joints[k])
        k = int(layer.parent[k])
    return np.array(rows[::-1])


@compiled
def _led_on(
    arm: SerialArm,
    aim: Aim,
    angle_tolerance: float,
    solving: PathSolving,
    way: Array,
    joints: Array,
    onward: Array,
    parent: Index,
) -> int:
    """Lead postures (k, n) on to an aim, as they are and with self-motion along and against a way (n,).

    What is met without a joint that changes too much is written into ``onward`` and ``parent``; returns how
    many there are.
    """
    count, drift = 0, np.empty(len(arm.lower))
    for k in range(len(joints)):
        drifts = self_motion_along(arm, aim, solving.reach, way, joints[k], drift)
        largest = 1e-300
        for j in range(len(drift)):
            largest = max(largest, abs(drift[j]) / solving.longest[j])
        for side in range(3 if drifts else 1):
            share = 0.0 if side == 0 else (DRIFT if side == 1 else -DRIFT) / largest
            trial = np.minimum(np.maximum(joints[k] + share * drift, arm.lower), arm.upper)
            error, angle, _ = polish(
                arm, aim, trial, solving.reach, solving.tolerance, angle_tolerance, STEPS
            )
            near = error <= solving.tolerance and angle <= angle_tolerance
            for j in range(len(trial)):
                near = near and abs(trial[j] - joints[k, j]) <= solving.longest[j]
            if near:
                onward[count], parent[count] = trial, k
                count += 1
    return count


@compiled
def self_motion_along(
    arm: SerialArm, aim: Aim, reach: float, way: Array, joints: Array, drift: Array
) -> bool:
    """Write the part of a motion of the joints (n,) that leaves the tool in place into ``drift`` (n,).

    False where nothing of it is left.
    """
    n, rows = len(joints), 3 if aim.kind == POSITION else 6
    frames, J, miss = np.empty((len(arm.axis) + 1, 4, 4)), np.empty((6, n)), np.empty(6)
    tool_error(arm, aim, joints, frames, miss)
    chain_jacobian(arm, frames, J)
    scale_angles(frames[-1], aim.kind, 0.5 * reach, J)
    size = 0.0
    for k in range(n):
        size = max(size, abs(way[k]))
    for i in range(6):
        miss[i] = 0.0
        for k in range(n):
            miss[i] += J[i, k] * (0.5 * way[k] / size)
    limited_step(arm, J, miss, rows, DAMPING * reach * reach, joints, drift)
    left = 0.0
    for k in range(n):
        drift[k] = 0.5 * way[k] / size - drift[k]
        left = max(left, abs(drift[k]))
    return left > NO_REDUNDANCY * 0.5
