"""Places from which any arm meets a tool direction or orientation, proven square by square.

A square holds places of the pivot axis. In its middle a posture meets the aim. Led on by the right inverse of
its Jacobian, the tool keeps to the aim all over the square, but for a remainder of the second order. Where a
ball of corrections takes that remainder into itself, and no joint leaves its limits, a posture meets the aim
from every place of the square (Brouwer's theorem). Squares that are not proven are quartered.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from regionik.planners.geometry.vectors import cross, row
from regionik.planners.kernels import compiled
from regionik.planners.reach.inverse_reachability import aim_at
from regionik.planners.reach.pose_reach import ANGLE_SHARE, PoseReach, endless, pose_reach
from regionik.planners.search.motion_bounds import from_axis, longest_levers
from regionik.planners.solvers.damped_least_squares import (
    DIRECTION,
    ORIENTATION,
    POSITION,
    Aim,
    polish,
    solve_symmetric,
)
from regionik.planners.solvers.rigid_bodies import span as span_of
from regionik.planners.solvers.serial_chain import (
    SerialArm,
    chain_frames,
    chain_jacobian,
    joint_axes,
    serial_arm,
)
from regionik.worlds.arms import pivot_index
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain

LEAST = 0.005  # half the side of squares that are not quartered, as a share of the arm's length
QUARTERED = 5  # times, from the first squares to the least
EXACT = 1e-9  # [m]
STEPS = 12  # of damped least squares
SLACK = 1e-9  # rounding that no proof may rest on [m], [rad]
COARSE = 1e-3  # error of a right inverse, beyond which nothing is proven
CORRECTED = 12  # times that the ball of corrections is made larger
LARGER = 1.25
CENTRED = 0.3  # of the way to the middles of the joints' limits that the arm's self-motion goes

ASKED = {POSITION: 3, DIRECTION: 5, ORIENTATION: 6}  # numbers that an aim fixes
CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])

Mask = NDArray[np.bool_]


class SquareTask(NamedTuple):
    """What the judgement of a square reads; the arm stands on a base frame at heading zero."""

    arm: SerialArm  # its pivot without limits
    aim: Aim  # in the world, but for its height, which is over the arm's base frame
    angle: float  # that a posture may miss the aim's by [rad]
    reach: float  # length of the arm [m]
    levers: Array  # (n,) longest of the tool's point
    pivot: int


class _Squares(NamedTuple):
    """Squares with a posture for every place, and how far the arm's azimuth is from known in each."""

    middles: Array  # (k, 2) [m]
    half: Array  # (k,) of the sides [m]
    azimuths: Array  # (k,) of the posture in the middle: its pivot, plus the heading of the base frame [rad]
    turns: Array  # (k,) that it differs by at other places, at most [rad]
    area: BaseGeometry


def proven_pose_area(
    chain: Chain,
    height: float,
    aim: Aim,
    heading: float | None = None,
    span: tuple[float, float] = (-np.inf, np.inf),
    guard: float = 0.0,
) -> BaseGeometry:
    """Return an area from all of which some posture within limits meets an aim.

    Parameters
    ----------
    chain : Chain
        Its first axis, but for a lift, is the vertical through its base frame.
    height : float
        Of the arm's base frame over the floor [m].
    aim : Aim
        In the world; of kind POSITION only with a heading.
    heading : float, optional
        That the arm's base frame keeps, and postures are looked for at; see `pose_reach` [rad].
    span : (low, high), optional
        Headings that it may take, any one of them at each place [rad].
    guard : float, optional
        That the pivot keeps from its limits, for errors of the heading [rad].

    Returns
    -------
    geometry
        Places of the pivot axis, as squares [m].
    """
    low, high = span if heading is None else (heading, heading)
    goal = (*aim.position.tolist(), *aim.turn.ravel().tolist())
    found = _squares(chain, height, aim.kind, goal, float(aim.cone), heading)
    pivot = chain.joints[pivot_index(chain)]
    lowest, wide = low + pivot.lower + guard, high - low + pivot.upper - pivot.lower - 2 * guard
    if wide >= 2 * np.pi:
        return found.area
    behind = np.remainder(found.azimuths - found.turns - lowest, 2 * np.pi)
    missed = behind + 2 * found.turns > wide
    return found.area - shapely.union_all(_boxes(found.middles[missed], found.half[missed]))


@lru_cache(maxsize=16)
def _squares(
    chain: Chain, height: float, kind: int, goal: tuple[float, ...], cone: float, heading: float | None
) -> _Squares:
    aim = Aim(np.array(goal[:3]), kind, np.array(goal[3:]).reshape(3, 3), cone)
    found, task = pose_reach(chain, height, aim, heading), square_task(chain, height, aim)
    rows = [np.empty((0, 5))]
    if not found.area.is_empty and chain.dof >= ASKED[kind] and np.isfinite(task.levers).all():
        rows += _quartered(task, found)
    every = np.concatenate(rows)
    middles, half = every[:, :2], every[:, 2]
    return _Squares(middles, half, every[:, 3], every[:, 4], shapely.union_all(_boxes(middles, half)))


def _quartered(task: SquareTask, found: PoseReach) -> Iterator[Array]:
    """The squares proven of each size: middle, half, azimuth and turn, (k, 5)."""
    places, postures = cKDTree(found.places), found.postures.copy()
    postures[:, task.pivot] += found.yaws
    half = LEAST * task.reach * 2.0**QUARTERED
    middles = _first_squares(found.area, half)
    seeds = postures[places.query(middles)[1]]
    for _ in range(QUARTERED + 1):
        met, turns = _judge(task, middles, half, seeds)
        known = np.isfinite(turns)
        azimuths, halves = seeds[known, task.pivot], np.full(np.count_nonzero(known), half)
        yield np.column_stack([middles[known], halves, azimuths, turns[known]])
        half /= 2
        middles, seeds, met = (np.repeat(part[~known], 4, axis=0) for part in (middles, seeds, met))
        middles += half * np.tile(CORNERS, (len(middles) // 4, 1))
        near = shapely.intersects(found.area, _boxes(middles, half))
        middles, seeds, met = middles[near], seeds[near], met[near]
        if not met.all():
            seeds[~met] = postures[places.query(middles[~met])[1]]


def square_task(chain: Chain, height: float, aim: Aim) -> SquareTask:
    """Collect what the judgement of squares reads; see `proven_pose_area`."""
    arm, pivot = serial_arm(endless(chain)), pivot_index(chain)
    aim = aim._replace(position=aim.position - [0.0, 0.0, height])
    levers = longest_levers(chain, chain.dof - 1, chain.T_last_tool[:3, 3])[0]
    return SquareTask(arm, aim, max(ANGLE_SHARE * aim.cone, EXACT), span_of(arm), levers, pivot)


def _first_squares(area: BaseGeometry, half: float) -> Array:
    """Middles (k, 2) of equal squares that cover an area."""
    shapely.prepare(area)
    x0, y0, x1, y1 = area.bounds
    x, y = (np.arange(low + half, high + 2 * half, 2 * half) for low, high in ((x0, x1), (y0, y1)))
    middles = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    near: Array = middles[shapely.intersects(area, _boxes(middles, half))]
    return near


def _boxes(middles: Array, half: float | Array) -> NDArray[np.object_]:
    """Squares (k,) about middles (k, 2)."""
    x, y = middles.T
    boxes: NDArray[np.object_] = shapely.box(x - half, y - half, x + half, y + half)
    return boxes


@compiled
def _judge(task: SquareTask, middles: Array, half: float, seeds: Array) -> tuple[Mask, Array]:
    """Mask (k,) of the squares with a posture in their middle; turns of the pivot (k,), inf if not proven.

    Seeds (k, n) are postures to start from, overwritten by those in the middles.
    """
    met, turns = np.zeros(len(middles), dtype=np.bool_), np.full(len(middles), np.inf)
    for k in range(len(middles)):
        joints = seeds[k].copy()
        dx, dy = middles[k, 0] - task.aim.position[0], middles[k, 1] - task.aim.position[1]
        aim = aim_at(task.aim, np.hypot(dx, dy), math.atan2(dy, dx), 0.0)
        met[k] = _centred(task, aim, joints)
        if met[k]:
            turns[k] = holds_about(task, aim.kind, joints, half)
            seeds[k] = joints
    return met, turns


@compiled
def _middle(arm: SerialArm, k: int) -> float:
    finite = np.isfinite(arm.lower[k]) and np.isfinite(arm.upper[k])
    return 0.5 * (arm.lower[k] + arm.upper[k]) if finite else 0.0


@compiled
def _centred(task: SquareTask, aim: Aim, joints: Array) -> bool:
    """Come to an aim, and from there by self-motion away from limits; True where it is met."""
    if not _come_to(task, aim, joints):
        return False
    M, A, _, _, _ = _constraints(task.arm, aim.kind, joints)
    if len(M) < len(joints):
        away = np.zeros(len(joints))
        for k in range(len(joints)):
            if np.isfinite(task.arm.lower[k]) and np.isfinite(task.arm.upper[k]):
                away[k] = CENTRED * (_middle(task.arm, k) - joints[k])
        trial = joints + away - A @ (M @ away)
        trial = np.minimum(np.maximum(trial, task.arm.lower), task.arm.upper)
        if _come_to(task, aim, trial):
            joints[:] = trial
    return True


@compiled
def _come_to(task: SquareTask, aim: Aim, joints: Array) -> bool:
    error, angle, _ = polish(task.arm, aim, joints, task.reach, EXACT, task.angle, STEPS)
    return bool(error <= EXACT and angle <= task.angle)


@compiled
def _constraints(arm: SerialArm, kind: int, joints: Array) -> tuple[Array, Array, Array, Array, Array]:
    """What the aim asks of joint speeds (m, n), a right inverse, room to limits (n,), frames and axes.

    The inverse moves joints the less the nearer to a limit they are; near a singular posture it is none.
    """
    n = len(joints)
    frames, J, axes = np.empty((n + 1, 4, 4)), np.empty((6, n)), np.empty((n, 3))
    chain_frames(arm, joints, frames)
    chain_jacobian(arm, frames, J)
    joint_axes(arm, frames, axes)
    M = J[: 3 if kind == POSITION else 6].copy()
    if kind == DIRECTION:  # turns about two axes across the tool's
        M = M[:5]
        M[3:] = np.ascontiguousarray(frames[n, :3, :2].T) @ np.ascontiguousarray(J[3:])
    room = np.minimum(arm.upper - joints, joints - arm.lower)
    weight = np.square(np.minimum(np.maximum(room, 0.0), 1.0))
    S, A = np.empty((len(M), len(M))), np.empty((n, len(M)))
    for j in range(len(M)):
        y = np.zeros(len(M))
        y[j] = 1.0
        for a in range(len(M)):
            for b in range(a + 1):
                S[a, b] = (M[a] * weight * M[b]).sum()
        solve_symmetric(S, y)
        for k in range(n):
            A[k, j] = weight[k] * (M[:, k] * y).sum()
    return M, A, room, frames, axes


@compiled
def holds_about(task: SquareTask, kind: int, joints: Array, half: float) -> float:
    """Most that the pivot turns to meet an aim from all places of a square about its own; inf if not proven.

    The remainder is split into its quadratic form, which is known, and what is of the third order.
    """
    arm, n = task.arm, len(joints)
    M, A, room, frames, axes = _constraints(arm, kind, joints)
    rounding = np.abs(M @ A - np.eye(len(M))).sum()
    if not rounding <= COARSE:
        return np.inf
    moved = half * (np.abs(A[:, 0]) + np.abs(A[:, 1]))
    curved = _quadratic(arm, kind, frames, axes, A)
    fixed, slope = _over_square(curved, half)
    bend = np.zeros((2, 2, 2))
    for i in range(2):
        for j in range(2):
            for k in range(2):
                bend[i, j, k] = _length(_block(_block(_block(curved, 0, i), 1, j), 2, k))
    off, moves = np.full(2, SLACK), np.empty(n)  # radii of the balls of corrections, in place and in turn
    for _ in range(CORRECTED):
        for k in range(n):
            moves[k] = moved[k] + off[0] * _length(A[k, :3]) + off[1] * _length(A[k, 3:])
        if not (moves <= room).all():
            return np.inf
        needed = fixed + slope @ off + _third_order(arm, frames, axes, moves, task.levers)
        for i in range(2):
            needed[i] += 0.5 * (off @ bend[i] @ off) + EXACT + SLACK + rounding * (2.0 * half + off.sum())
        if kind == POSITION:
            needed[1] = 0.0
        if (needed <= off).all():
            return float(moves[task.pivot])
        off = np.maximum(off, LARGER * needed)
    return np.inf


@compiled
def _block(values: Array, axis: int, part: int) -> Array:
    """What of one axis of an array (m, m, m) is of place, part 0, or of turn, part 1."""
    low, high = (0, 3) if part == 0 else (3, values.shape[axis])
    if axis == 0:
        return values[low:high]
    return values[:, low:high] if axis == 1 else values[:, :, low:high]


@compiled
def _length(values: Array) -> float:
    return float(np.sqrt(np.square(values).sum()))


@compiled
def _quadratic(arm: SerialArm, kind: int, frames: Array, axes: Array, A: Array) -> Array:
    """Second derivatives (m, m, m) of place and turn of the tool along the columns of a right inverse (n, m).

    The turn is the axial vector of its matrix, which is zero where nothing turns; of a direction, its
    parts across the tool's axis.
    """
    n, m = A.shape
    J = np.empty((6, n))
    chain_jacobian(arm, frames, J)
    second = np.zeros((6, n, n))
    for i in range(n):
        if not arm.revolute[i]:
            continue
        for j in range(i, n):
            place = cross(row(axes, i), (J[0, j], J[1, j], J[2, j]))
            turn = cross(row(axes, i), (J[3, j], J[4, j], J[5, j]))
            for r in range(3):
                second[r, i, j] = second[r, j, i] = place[r]
                second[3 + r, i, j] = second[3 + r, j, i] = 0.5 * turn[r]
    along = np.empty((6, m, m))
    for r in range(6):
        along[r] = np.ascontiguousarray(A.T) @ second[r] @ A
    if kind != DIRECTION:
        return along[:m]
    across_tool = along[:5].copy()
    for r in range(2):
        across_tool[3 + r] = 0.0
        for k in range(3):
            across_tool[3 + r] += frames[n, k, r] * along[3 + k]
    return across_tool


@compiled
def _over_square(curved: Array, half: float) -> tuple[Array, Array]:
    """Bounds of the quadratic form over a square: itself (2,), and its change by corrections (2, 2)."""
    fixed, slope = np.zeros(2), np.zeros((2, 2))
    for i in range(2):
        parts = _block(curved, 0, i)
        along, apart = _length(parts[:, 0, 0]) + _length(parts[:, 1, 1]), _length(parts[:, 0, 1])
        fixed[i] = 0.5 * half * half * (along + 2.0 * apart)
        for sign in (-1.0, 1.0):  # the change is largest at the square's corners
            change = half * (parts[:, 0] + sign * parts[:, 1])
            slope[i, 0] = max(slope[i, 0], _length(change[:, :3]))
            slope[i, 1] = max(slope[i, 1], _length(change[:, 3:]))
    return fixed, slope


@compiled
def _third_order(arm: SerialArm, frames: Array, axes: Array, moves: Array, levers: Array) -> Array:
    """Bounds (2,) of what place and turn of the tool differ from their Taylor series of the second order.

    Joint by joint, from the last to the first: see `motion_bounds.tool_displacement`.
    """
    n = len(moves)
    tool = frames[n, :3, 3]
    turned = moved = bent = left = 0.0
    for k in range(n - 1, -1, -1):
        d = moves[k]
        if arm.revolute[k]:
            lever = min(from_axis(frames[k], axes[k], tool) + moved, levers[k])
            left += d * d * d / 6.0 * lever + 0.5 * d * d * moved + d * bent
            bent += 0.5 * d * d * lever + d * moved
            moved += d * lever
            turned += d
        else:
            moved += d
    return np.array([left, turned * turned * turned / 6.0 * math.exp(turned)])
