"""Corners of a motion rounded: least jerk at the asked speeds, every point within a distance of the motion.

States are laid out by the time that they take at the limits of speed. A smoothing spline through them has
least jerk; what a state weighs in it grows where the spline is too far from the motion, and shrinks where it
is nearer than need be.
Source: Eilers, A perfect smoother (Analytical Chemistry 2003), with the third differences of uneven instants.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np
from scipy.linalg import solveh_banded

from regionik.planners.search.motion_bounds import longest_levers
from regionik.timing.inserted_states import graded, periods, with_states
from regionik.timing.limits import MotionLimits
from regionik.timing.options import TIMING
from regionik.timing.parametrization import path_of
from regionik.values import Motion
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.robot import Robot

OPTIONS = TIMING.rounding


def rounded(limits: MotionLimits, motion: Motion, room: Array, most: Array, kept: Mask) -> Motion:
    """Motion whose corners are rounded, with more states there.

    Parameters
    ----------
    limits : MotionLimits
        Of a robot that does not roll.
    motion : Motion
        Both ends of its runs stay where they are.
    room : (n,) array
        By which any point may leave the motion about each state [m].
    most : (n,) array
        By which at most in the state itself; it stays where it is if that is hardly anything [m].
    kept : (n, 3 + dof) array of bool
        Coordinates of states that stay as they are.
    """
    if len(motion) == 1:
        return motion
    path = path_of(limits.robot, motion)
    q, moving = path.coordinates, path.lengths > 0
    change = np.diff(q, axis=0)
    fastest = limits.largest_squared_velocity(q[:-1] + change / 2, change, limits.tool_speeds(motion))
    near = np.maximum(np.minimum(room[:-1], room[1:]), limits.blend)
    slowest = limits.displacement(q[:-1], q[1:]) / near * OPTIONS.min_ramp  # slower is rounded no better
    span = np.minimum(1 / np.sqrt(fastest), slowest)
    span = np.where(moving, np.maximum(span, OPTIONS.min_segment_time), 0.0)
    inserted, between = graded(periods(span, OPTIONS.period), np.ones(len(q), dtype=bool))
    count = 1 + np.bincount(inserted, minlength=len(span))
    own, segment = np.concatenate([[0], np.cumsum(count)]), np.repeat(np.arange(len(count)), count)
    share = np.zeros(own[-1])
    share[np.setdiff1d(np.arange(own[-1]), own)] = between
    before = np.vstack([q[segment] + share[:, None] * change[segment], q[-1:]])
    way = np.append(segment + share, len(span))
    time = np.append((np.cumsum(span) - span)[segment] + share * span[segment], span.sum())
    allowed = np.append(np.minimum(room[:-1], room[1:])[segment], 0.0)
    allowed[own] = np.minimum(room, most)
    held = np.zeros(before.shape, dtype=np.bool_)
    held[own] = kept | (allowed[own] <= TIMING.corners.min_rounded_share * limits.blend)[:, None]
    after = before.copy()
    for a, b in path.runs:
        rows = slice(int(own[a]), int(own[b]) + 1)
        after[rows] = _smoothed(limits, before[rows], time[rows], allowed[rows], held[rows])
    moved = after - before
    some = _between(limits, after, way, own, OPTIONS.straight_share * limits.blend)
    found = replace(motion, base=motion.base + moved[own, :3], joints=motion.joints + moved[own, 3:])
    return with_states(found, segment[some], after[some, :3], after[some, 3:])


def _between(limits: MotionLimits, q: Array, way: Array, own: Index, near: float) -> Index:
    """Rows of states (n, m) that a motion needs besides its own, for lines between them to be near all.

    States are at ways (n,), which rise.
    """
    kept, rows = own, np.arange(len(q))
    while True:
        part = np.clip(np.searchsorted(kept, rows, side="right") - 1, 0, len(kept) - 2)
        share = (way - way[kept[part]]) / np.diff(way[kept])[part]
        straight = q[kept[part]] + share[:, None] * (q[kept[part + 1]] - q[kept[part]])
        bent = np.unique(part[limits.displacement(straight, q) > near])
        if not len(bent):
            return np.setdiff1d(kept, own)
        kept = np.union1d(kept, (kept[bent] + kept[bent + 1]) // 2)


def _smoothed(limits: MotionLimits, q: Array, time: Array, allowed: Array, held: Mask) -> Array:
    """States (n, m) at times (n,) of least jerk within distances (n,); the same where none is found.

    Coordinates that are ``held`` (n, m) stay, and so do both ends.
    """
    held = held.copy()
    held[[0, -1]] = True
    fixed, widest = held.all(axis=1), allowed.max(initial=0.0)
    if fixed.all() or len(q) < 4:
        return q
    s, chain = limits.speeds, limits.robot.chain
    least = np.array([s.base_acceleration, s.base_acceleration, s.turn_acceleration])
    pull = (np.concatenate([least, limits.joint_acceleration]) * _levers(limits.robot) / widest) ** 2
    lower, upper = np.minimum(chain.lower, q[:, 3:]), np.maximum(chain.upper, q[:, 3:])
    form, best = _jerk_form(time) * max(limits.ramp, OPTIONS.min_ramp) ** 2, q
    frames = limits.robot.frames(q[:, :3], q[:, 3:])
    weight = (widest / np.where(fixed, widest, allowed)) ** 2
    for k in range(OPTIONS.max_rounds):
        weights = np.where(held, OPTIONS.max_weight, weight[:, None])
        try:
            found = _weighed(form, q, pull[:, None] * weights.T)
        except np.linalg.LinAlgError:  # states too unevenly spaced to be told apart: what is found stands
            break
        found[:, 3:] = np.clip(found[:, 3:], lower, upper)
        found[held] = q[held]
        share = limits.displacement_from(q, frames, found) / np.where(fixed, 1.0, allowed)
        if share.max() <= 1:
            best = found
            if k >= OPTIONS.min_rounds:
                break
        share = np.clip(share / OPTIONS.aimed_share, OPTIONS.min_share, OPTIONS.max_share)
        weight = np.clip(weight * share**OPTIONS.exponent, OPTIONS.min_weight, OPTIONS.max_weight)
    return best


def _weighed(form: Array, q: Array, weights: Array) -> Array:
    """States (n, m) that a form (4, n) is least for, drawn to q (n, m) by weights (m, n)."""
    columns = [
        solveh_banded(np.vstack([form[:1] + one, form[1:]]), one * column, lower=True)
        for one, column in zip(weights, q.T, strict=True)
    ]
    return np.column_stack(columns)


def _levers(robot: Robot) -> Array:
    """Upper bounds for the motion of any point per unit of each coordinate, (3 + dof,) [m]."""
    chain = robot.chain
    levers, reach = longest_levers(chain, len(chain.joints) - 1, chain.T_last_tool[:3, 3])
    corners, mount = np.hypot(*robot.footprint.T).max(), np.hypot(*robot.mount[:2])
    joints = np.abs(chain.coupling).T @ levers
    return np.maximum([1.0, 1.0, max(mount + reach, corners), *joints], OPTIONS.min_lever)


def _jerk_form(time: Array) -> Array:
    """Integral of squared third derivatives of values at times (n,), lower bands of a form, (4, n)."""
    n = len(time) - 3
    t = np.stack([time[i : n + i] for i in range(4)])
    factor = np.sqrt((t[3] - t[0]) / 3) * 6  # third differences over their mean width
    rates = [factor / np.prod([t[i] - t[j] for j in range(4) if j != i], axis=0) for i in range(4)]
    form = np.zeros((4, len(time)))
    for i, j in combinations_with_replacement(range(4), 2):
        form[j - i, i : n + i] += rates[i] * rates[j]
    return form
