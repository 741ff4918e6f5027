"""Reach of any arm whose tool must also point or be turned, pose by pose.

The reach of such a target is not round: it is looked for on a polar grid about the target. From each pose
found, damped least squares leads on to its neighbours, so that the postures of one area hang together as far
as they can. A cell counts where postures were found at its corners and in its middle: sampled, not proven.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from regionik.planners.geometry.polygons import compiled
from regionik.planners.reach.level_reach import outer_reach
from regionik.planners.solvers.damped_least_squares import DIRECTION, Aim, polish
from regionik.planners.solvers.multistart_ik import Effort, solve_ik, spread_postures
from regionik.planners.solvers.rigid_bodies import RigidBodies, posing_bodies, span
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.pivoted_arm import pivot_index

DISTANCES, BEARINGS = 32, 48  # cells of the grid
FINER = 3  # times, where the reach is too thin for it
THIN = 0.25  # cells to a posture found, below which it is
EVERY = 4  # grid lines from one seed to the next
RESTARTS = 3
STEPS = 30  # of damped least squares from a neighbour
TOLERANCE = 1e-4  # [m]
ANGLE_SHARE = 0.1  # of the cone, which a posture may miss it by
DIGITS = 12  # of a turn: targets that differ by less are one

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class PoseReach:
    """Places of the pivot axis about one target, and a posture at each.

    Attributes
    ----------
    places : (m, 2) array
        On the floor [m].
    yaws : (m,) array
        Heading of the arm's base frame that the postures are counted from [rad].
    postures : (m, dof) array
    area : geometry
        Cells whose corners and middle were all found; a target stands still, as the base does.
    """

    places: Array
    yaws: Array
    postures: Array
    area: BaseGeometry


@dataclass(frozen=True, eq=False)
class _Grid:
    """Poses found about a target at the origin whose axis points along +x, seen from above."""

    distances: Array  # (r,)
    bearings: Array  # (b,)
    found: Mask  # (r, b)
    postures: Array  # (r, b, dof), from an arm's base frame that looks at the target
    area: BaseGeometry
    cells: int


def pose_reach(chain: Chain, height: float, aim: Aim) -> PoseReach:
    """Places of the pivot axis from which some posture meets an aim; the pivot turns without end.

    Parameters
    ----------
    chain : Chain
    height : float
        Of the arm's base frame over the floor [m].
    aim : Aim
        In the world, of kind DIRECTION or ORIENTATION.
    """
    turn, azimuth = _level(aim)
    key = tuple(np.round(turn, DIGITS).ravel().tolist())
    grid = _grid(chain, round(float(aim.position[2]) - height, DIGITS), aim.kind, key, float(aim.cone))
    r, b = np.nonzero(grid.found)
    away = azimuth + grid.bearings[b]
    places = aim.position[:2] + grid.distances[r, None] * np.column_stack([np.cos(away), np.sin(away)])
    c, s = np.cos(azimuth), np.sin(azimuth)
    area = shapely.transform(grid.area, lambda p: p @ np.array([[c, s], [-s, c]]) + aim.position[:2])
    return PoseReach(places, away + np.pi, grid.postures[r, b], area)


def _level(aim: Aim) -> tuple[Array, float]:
    """The aim's turn, brought about the vertical to azimuth zero, and its azimuth."""
    lead = aim.turn[:, 2] if np.hypot(*aim.turn[:2, 2]) > 1e-9 else aim.turn[:, 0]
    azimuth = float(np.arctan2(lead[1], lead[0]))
    return _about_z(-azimuth) @ aim.turn, azimuth


def _about_z(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@lru_cache(maxsize=256)
def _grid(chain: Chain, rise: float, kind: int, key: tuple[float, ...], cone: float) -> _Grid:
    turn = np.array(key).reshape(3, 3)
    quest = _Quest(*_prepared(chain, max(ANGLE_SHARE * cone, 1e-9)), rise, turn, kind, cone)
    bound = outer_reach(chain, rise)
    grid = _sampled(quest, bound[-1][1] if bound else 0.0, 1, None)
    if grid.found.any() and grid.cells < THIN * np.count_nonzero(grid.found):
        return _sampled(quest, bound[-1][1], FINER, grid)
    return grid


@dataclass(frozen=True, eq=False)
class _Quest:
    """Aim at a height over the arm's base frame, its axis at azimuth zero."""

    bodies: RigidBodies
    starts: Array
    effort: Effort
    rise: float
    turn: Array
    kind: int
    cone: float


def _sampled(quest: _Quest, far: float, finer: int, known: _Grid | None) -> _Grid:
    """The grid with its cells parted, gone on from what is known of a coarser one."""
    round_about = quest.kind == DIRECTION and np.hypot(*quest.turn[:2, 2]) < 1e-9
    rows, around = DISTANCES * finer + 1, BEARINGS * finer
    columns = 1 if round_about else around
    distances = np.linspace(0.0, far, rows)
    bearings = np.linspace(0.0, 2 * np.pi, around, endpoint=False)
    # An arm whose base frame looks at the target sees it ahead, and its axis turned by the bearing.
    turns = np.array([_about_z(-bearing - np.pi) @ quest.turn for bearing in bearings[:columns]])
    between = np.array([_about_z(-np.pi / around) @ one for one in turns]) if columns > 1 else turns
    found, middle = np.zeros((rows, columns), dtype=np.bool_), np.zeros((rows - 1, columns), dtype=np.bool_)
    postures = np.zeros((rows, columns, len(quest.bodies.slide)))
    if known is not None:
        found[::finer, ::finer] = known.found[:, : columns // finer or 1]
        postures[::finer, ::finer] = known.postures[:, : columns // finer or 1]
    ask = quest.rise, turns, quest.kind, quest.cone
    if far > 0.0:
        _look(quest.bodies, quest.starts, quest.effort, distances, *ask, finer * EVERY, found, postures)
        ask = quest.rise, between, quest.kind, quest.cone
        _look_between(quest.bodies, quest.effort, distances, *ask, found, postures, middle)
    if round_about:
        found, middle = np.repeat(found, around, axis=1), np.repeat(middle, around, axis=1)
        postures = np.repeat(postures, around, axis=1)
    area = _cells(distances, bearings, middle)
    return _Grid(distances, bearings, found, postures, area, int(np.count_nonzero(middle)))


@lru_cache(maxsize=32)
def _prepared(chain: Chain, angle_tolerance: float) -> tuple[RigidBodies, Array, Effort]:
    joints, pivot = list(chain.joints), pivot_index(chain)
    joints[pivot] = replace(joints[pivot], lower=-np.inf, upper=np.inf)
    endless = Chain(tuple(joints), chain.T_last_tool)
    bodies = posing_bodies(endless)
    effort = Effort(TOLERANCE, float(angle_tolerance), 60, span(bodies.arm), True)
    return bodies, spread_postures(endless, effort.reach, RESTARTS, 0), effort


@compiled
def _look(
    bodies: RigidBodies,
    starts: Array,
    effort: Effort,
    distances: Array,
    rise: float,
    turns: Array,
    kind: int,
    cone: float,
    every: int,
    found: Mask,
    postures: Array,
) -> None:
    """Seeds here and there by passes and restarts; from each found, on to the neighbours."""
    rows, columns, n = postures.shape
    todo = np.empty((rows * columns, 2), dtype=np.int64)
    trial, count = np.empty(n), 0
    for i in range(rows):
        for j in range(columns):
            if found[i, j]:
                todo[count, 0], todo[count, 1] = i, j
                count += 1
    for i in range(0, rows, every):
        for j in range(0, columns, every):
            aim = Aim(np.array([distances[i], 0.0, rise]), kind, turns[j], cone)
            if count == 0 and not found[i, j]:
                trial[:] = starts[0]
                error, angle, _, _, _ = solve_ik(bodies, aim, starts[1:], effort, trial)
                if error <= effort.tolerance and angle <= effort.angle_tolerance:
                    found[i, j], postures[i, j] = True, trial
                    todo[0, 0], todo[0, 1] = i, j
                    count = 1
            while count > 0:
                count = _spread(
                    bodies, effort, distances, rise, turns, kind, cone, found, postures, todo, count - 1
                )


@compiled
def _spread(
    bodies: RigidBodies,
    effort: Effort,
    distances: Array,
    rise: float,
    turns: Array,
    kind: int,
    cone: float,
    found: Mask,
    postures: Array,
    todo: NDArray[np.int64],
    count: int,
) -> int:
    """From a pose found to its four neighbours; what is new is to be gone on from."""
    rows, columns, _ = postures.shape
    i, j = todo[count, 0], todo[count, 1]
    for side in range(4):
        k = i + (1 if side == 0 else (-1 if side == 1 else 0))
        m = (j + (1 if side == 2 else (-1 if side == 3 else 0))) % columns
        if k < 0 or k >= rows or found[k, m]:
            continue
        aim = Aim(np.array([distances[k], 0.0, rise]), kind, turns[m], cone)
        trial = postures[i, j].copy()
        if _polished(bodies, aim, effort, trial):
            found[k, m], postures[k, m] = True, trial
            todo[count, 0], todo[count, 1] = k, m
            count += 1
    return count


@compiled
def _look_between(
    bodies: RigidBodies,
    effort: Effort,
    distances: Array,
    rise: float,
    turns: Array,
    kind: int,
    cone: float,
    found: Mask,
    postures: Array,
    middle: Mask,
) -> None:
    """Cells with a posture at every corner, and one in the middle come to from a corner."""
    rows, columns, _ = postures.shape
    for i in range(rows - 1):
        for j in range(columns):
            after = (j + 1) % columns
            if not (found[i, j] and found[i + 1, j] and found[i, after] and found[i + 1, after]):
                continue
            way = 0.5 * (distances[i] + distances[i + 1])
            aim = Aim(np.array([way, 0.0, rise]), kind, turns[j], cone)
            for corner in range(4):
                trial = postures[i + corner % 2, j if corner < 2 else after].copy()
                if not middle[i, j] and _polished(bodies, aim, effort, trial):
                    middle[i, j] = True


@compiled
def _polished(bodies: RigidBodies, aim: Aim, effort: Effort, joints: Array) -> bool:
    error, angle, _ = polish(
        bodies.arm, aim, joints, effort.reach, effort.tolerance, effort.angle_tolerance, STEPS
    )
    return bool(error <= effort.tolerance and angle <= effort.angle_tolerance)


def _cells(distances: Array, bearings: Array, middle: Mask) -> BaseGeometry:
    """Cells as one shape, straight from corner to corner."""
    i, j = np.nonzero(middle)
    unit = np.column_stack([np.cos(bearings), np.sin(bearings)])
    after = (j + 1) % len(bearings)
    corners = [
        distances[i, None] * unit[j],
        distances[i + 1, None] * unit[j],
        distances[i + 1, None] * unit[after],
        distances[i, None] * unit[after],
    ]
    return shapely.union_all(shapely.polygons(np.stack(corners, axis=1)))
