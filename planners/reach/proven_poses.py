"""Places from which any arm meets a tool direction or orientation, proven square by square.

A square holds places of the pivot axis. From a posture that meets the aim in its middle it is proven that one
does from every place of it (`square_proofs`). Squares that are not proven are quartered.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from regionik.planners.geometry.polygons import EVERYWHERE
from regionik.planners.kernels import compiled
from regionik.planners.reach.inverse_reachability import aim_at
from regionik.planners.reach.level_reach import Intervals, merged
from regionik.planners.reach.options import REACH
from regionik.planners.reach.pose_reach import DIGITS, PlacedPostures, PoseReach, pose_reach
from regionik.planners.reach.serial_criteria import PostureDemand, moved_within_thresholds
from regionik.planners.reach.square_proofs import EXACT, SquareTask, constraints, holds_about, square_task
from regionik.planners.solvers.damped_least_squares import DIRECTION, ORIENTATION, POSITION, Aim, polish
from regionik.worlds.arms import pivot_index
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain

OPTIONS = REACH.squares

STEPS_PER_METRE = 2.0**20  # steps a metre of the sides of squares
MAX_SOLVER_STEPS = 12  # of damped least squares
SPARE_SHARE = 0.3  # share of a threshold, by which postures are to meet it
CENTRING_SHARE = 0.3  # of the way to the middles of the joints' limits that the arm's self-motion goes

EVERY = -np.inf, np.inf
FIXED_COORDINATES = {POSITION: 3, DIRECTION: 5, ORIENTATION: 6}  # numbers that an aim fixes
CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])


class _Squares(NamedTuple):
    """Squares with a posture for every place, and how far the arm's azimuth is from known in each."""

    middles: Array  # (k, 2) [m]
    half: Array  # (k,) of the sides [m]
    azimuths: Array  # (k,) of the posture in the middle: its pivot, plus the heading of the base frame [rad]
    turns: Array  # (k,) that it differs by at other places, at most [rad]
    area: BaseGeometry

    def meeting(self, window: tuple[float, ...]) -> NDArray[np.bool_]:
        """Mask (k,) of the squares that meet a window."""
        low, high = self.middles - self.half[:, None], self.middles + self.half[:, None]
        return np.asarray(((low <= window[2:]) & (high >= window[:2])).all(axis=1))


def proven_pose_area(
    chain: Chain,
    height: float,
    aim: Aim,
    heading: float | None = None,
    span: tuple[float, float] = (-np.inf, np.inf),
    spare: float = 0.0,
    demand: PostureDemand | None = None,
    window: tuple[float, ...] = EVERYWHERE,
) -> BaseGeometry:
    """Return an area from all of which some posture within limits meets an aim.

    Parameters
    ----------
    chain : Chain
        Its first axis, but for a lift, is the vertical through its base frame.
    height : float
        Of the arm's base frame over the floor [m].
    aim : Aim
        In the world.
    heading : float, optional
        That the arm's base frame keeps, and postures are looked for at; see `pose_reach` [rad].
    span : (low, high), optional
        Headings that it may take, any one of them at each place [rad].
    spare : float, optional
        That the pivot keeps from its limits, for errors of the heading [rad].
    demand : PostureDemand, optional
        That the posture meets besides.
    window : (4,), optional
        Least x and y, and most, of places that matter: the area may lack others [m].

    Returns
    -------
    geometry
        Places of the pivot axis, as squares [m].
    """
    pivot = chain.active_joints[pivot_index(chain)]
    goal = _goal(aim)
    if heading is not None:
        kept = min(spare, 0.5 * (pivot.upper - pivot.lower))
        azimuths = heading + pivot.lower + kept, heading + pivot.upper - kept
        return _squares(chain, height, goal, heading, azimuths, demand).area
    found = _squares(chain, height, goal, None, EVERY, demand)
    lowest, wide = span[0] + pivot.lower + spare, span[1] - span[0] + pivot.upper - pivot.lower - 2 * spare
    if wide >= 2 * np.pi:
        return found.area
    behind = np.remainder(found.azimuths - found.turns - lowest, 2 * np.pi)
    able = (behind + 2 * found.turns <= wide) & found.meeting(window)
    return shapely.union_all(_boxes(found.middles[able], found.half[able]))


def likely_distances(chain: Chain, rise: float, demand: PostureDemand) -> Intervals:
    """Distances of pivot axis and a point at which postures that meet a demand were found, as intervals [m].

    The point is at a height ``rise`` over the arm's base frame; the base turns for the pivot.
    """
    return _along_ray(pose_reach(chain, 0.0, _point(rise), None, demand).area)


def proven_distances(chain: Chain, rise: float, demand: PostureDemand) -> Intervals:
    """`likely_distances` of those from all of which some posture is proven to meet the demand."""
    return _along_ray(_squares(chain, 0.0, _goal(_point(rise)), None, EVERY, demand, along_ray=True).area)


def _point(rise: float) -> Aim:
    return Aim(np.array([0.0, 0.0, rise]), POSITION, np.zeros((3, 3)))


def _goal(aim: Aim) -> tuple[float, ...]:
    """An aim as a key."""
    return (aim.kind, float(aim.cone), *aim.position.tolist(), *aim.turn.ravel().tolist())


def _along_ray(area: BaseGeometry) -> Intervals:
    """Intervals in which an area holds the positive x axis."""
    ends = [part.bounds[::2] for part in shapely.get_parts(area & _ray(area)) if part.length > 0]
    return merged(np.round(ends, DIGITS).tolist())


def _ray(area: BaseGeometry) -> BaseGeometry:
    """The positive x axis, as far as an area goes."""
    return shapely.LineString([(0.0, 0.0), (0.0 if area.is_empty else area.bounds[2], 0.0)])


@lru_cache(maxsize=256)
def _squares(
    chain: Chain,
    height: float,
    goal: tuple[float, ...],
    heading: float | None,
    azimuths: tuple[float, float],
    demand: PostureDemand | None,
    *,
    along_ray: bool = False,
) -> _Squares:
    kind, cone, *numbers = goal
    aim = Aim(np.array(numbers[:3]), int(kind), np.array(numbers[3:]).reshape(3, 3), cone)
    found = pose_reach(chain, height, aim, heading, demand)
    task = square_task(chain, height, aim, azimuths, demand)
    if along_ray:
        found = replace(found, area=found.area & _ray(found.area))
    rows = [np.empty((0, 5))]
    if (
        not found.area.is_empty
        and chain.dof >= FIXED_COORDINATES[aim.kind]
        and np.isfinite(task.levers).all()
    ):
        rows += _quartered(task, found)
    every = np.concatenate(rows)
    middles, half = every[:, :2], every[:, 2]
    return _Squares(middles, half, every[:, 3], every[:, 4], shapely.union_all(_boxes(middles, half)))


def _quartered(task: SquareTask, reach: PoseReach) -> Iterator[Array]:
    """The squares proven of each size: middle, half, azimuth and turn, (k, 5)."""
    grid, seeds = (_Nearest.of(some, task.pivot) for some in (reach.grid, reach.seeds))
    least = float(np.ceil(OPTIONS.min_half_share * task.reach * STEPS_PER_METRE)) / STEPS_PER_METRE
    half = least * 2.0**OPTIONS.max_quarterings
    middles = _first_squares(reach.area, half)
    for _ in range(OPTIONS.max_quarterings + 1):
        postures = grid.to(middles)
        turns = _judge(task, middles, half, postures)
        for k in range(min(OPTIONS.max_postures, len(seeds.postures))):
            left = np.flatnonzero(np.isinf(turns))
            others = seeds.to(middles[left], k)
            turns[left] = _judge(task, middles[left], half, others)
            postures[left] = others
        known = np.isfinite(turns)
        halves = np.full(np.count_nonzero(known), half)
        yield np.column_stack([middles[known], halves, postures[known, task.pivot], turns[known]])
        half /= 2
        middles = (middles[~known][:, None] + half * CORNERS).reshape(-1, 2)
        middles = middles[shapely.intersects(reach.area, _boxes(middles, half))]


class _Nearest(NamedTuple):
    """Postures (m, dof) of an arm at heading zero by their places."""

    places: cKDTree
    postures: Array

    @classmethod
    def of(cls, some: PlacedPostures, pivot: int) -> _Nearest:
        postures = some.postures.copy()
        postures[:, pivot] += some.yaws
        return cls(cKDTree(some.places), postures)

    def to(self, middles: Array, k: int = 0) -> Array:
        """Those at the places nearest to middles (n, 2), or at the k-th nearest but one: (n, dof)."""
        near: Array = self.postures[self.places.query(middles, [k + 1])[1][:, 0]]
        return near


def _first_squares(area: BaseGeometry, half: float) -> Array:
    """Middles (k, 2) of equal squares that cover an area.

    Like the sides they are whole parts of a power of two: edges of neighbours are the same to the last bit.
    """
    shapely.prepare(area)
    ends = np.reshape(area.bounds, (2, 2)) / (2 * half)
    x, y = (2 * half * (np.arange(np.floor(low), np.ceil(high) + 1) + 0.5) for low, high in ends.T)
    middles = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    near: Array = middles[shapely.intersects(area, _boxes(middles, half))]
    return near


def _boxes(middles: Array, half: float | Array) -> NDArray[np.object_]:
    """Squares (k,) about middles (k, 2)."""
    x, y = middles.T
    boxes: NDArray[np.object_] = shapely.box(x - half, y - half, x + half, y + half)
    return boxes


@compiled
def _judge(task: SquareTask, middles: Array, half: float, postures: Array) -> Array:
    """Turns of the pivot (k,) in squares, infinite where a square is not proven.

    Postures (k, n) are those to start from, overwritten by those in the middles.
    """
    turns = np.full(len(middles), np.inf)
    for k in range(len(middles)):
        dx, dy = middles[k, 0] - task.aim.position[0], middles[k, 1] - task.aim.position[1]
        aim = aim_at(task.aim, np.hypot(dx, dy), math.atan2(dy, dx), 0.0)
        if _centred(task, aim, postures[k]):
            turns[k] = holds_about(task, aim.kind, postures[k], half)
    return turns


@compiled
def _centred(task: SquareTask, aim: Aim, joints: Array) -> bool:
    """Come to an aim, and from there by self-motion away from limits; True where aim and demand are met."""
    if not _come_to(task, aim, joints):
        return False
    M, A, _, _, _ = constraints(task.arm, aim.kind, joints)
    if len(M) >= len(joints):
        return moved_within_thresholds(
            task.arm, task.thresholds, aim, joints, task.reach, EXACT, task.angle, SPARE_SHARE
        )
    lower, upper = task.arm.lower, task.arm.upper
    away, along, trial = np.zeros(len(joints)), np.zeros(len(M)), joints.copy()
    for k in range(len(joints)):
        if upper[k] - lower[k] < np.inf:
            away[k] = CENTRING_SHARE * (0.5 * (lower[k] + upper[k]) - joints[k])
        for r in range(len(M)):
            along[r] += M[r, k] * away[k]
    for k in range(len(joints)):
        step = away[k]
        for r in range(len(M)):
            step -= A[k, r] * along[r]
        trial[k] = min(max(joints[k] + step, lower[k]), upper[k])
    if _come_to(task, aim, trial):
        joints[:] = trial
    return moved_within_thresholds(
        task.arm, task.thresholds, aim, joints, task.reach, EXACT, task.angle, SPARE_SHARE
    )


@compiled
def _come_to(task: SquareTask, aim: Aim, joints: Array) -> bool:
    error, angle, _ = polish(task.arm, aim, joints, task.reach, EXACT, task.angle, MAX_SOLVER_STEPS)
    return bool(error <= EXACT and angle <= task.angle)
