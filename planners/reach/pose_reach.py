"""Reach of any arm for a tool direction or orientation, sampled on a polar grid about the target.

From each pose found, damped least squares leads on to its neighbours, so that the postures of one area are
connected as far as they can be. A cell counts where postures were found at its corners and in its middle:
this is sampled, not proven.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from regionik.planners.kernels import compiled
from regionik.planners.reach.level_reach import outer_reach
from regionik.planners.solvers.damped_least_squares import DIRECTION, Aim, polish
from regionik.planners.solvers.multistart_ik import Effort, solve_ik, spread_postures
from regionik.planners.solvers.rigid_bodies import RigidBodies, posing_bodies, span
from regionik.worlds.arms import pivot_index
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain

DISTANCES, BEARINGS = 32, 48  # cells of the grid
FINER = 3  # times as many cells, where the reach is thin
THIN = 0.25  # cells for each posture found, below which the reach counts as thin
SEED_SPACING = 4  # grid lines from one seed to the next
RESTARTS = 3
STEPS = 30  # of damped least squares from a neighbour
TOLERANCE = 1e-4  # [m]
ANGLE_SHARE = 0.1  # of the cone, which a posture may miss it by
DIGITS = 12  # of a turn: targets that differ by less are one

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class PoseReach:
    """Reach of one target: places of the pivot axis, and a posture at each.

    Attributes
    ----------
    places : (m, 2) array
        On the floor [m].
    yaws : (m,) array
        Heading of the arm's base frame that the postures are counted from [rad].
    postures : (m, dof) array
    area : geometry
        Cells whose corners and middle were all found.
    """

    places: Array
    yaws: Array
    postures: Array
    area: BaseGeometry


@dataclass(frozen=True, eq=False)
class _Grid:
    """Poses found about a target at the origin, its axis along +x as seen from above."""

    distances: Array  # (r,)
    bearings: Array  # (b,)
    found: Mask  # (r, b)
    postures: Array  # (r, b, dof), from an arm's base frame that faces the target
    area: BaseGeometry
    cells: int


def pose_reach(chain: Chain, height: float, aim: Aim) -> PoseReach:
    """Return the places of the pivot axis from which some posture meets an aim; the pivot has no limits.

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
    problem = _Problem(*_prepared(chain, max(ANGLE_SHARE * cone, 1e-9)), rise, kind, cone)
    bound = outer_reach(chain, rise)
    grid = _sampled(problem, turn, bound[-1][1] if bound else 0.0, 1, None)
    if grid.found.any() and grid.cells < THIN * np.count_nonzero(grid.found):
        return _sampled(problem, turn, bound[-1][1], FINER, grid)
    return grid


class _Problem(NamedTuple):
    """Aim at a height over the arm's base frame, and the solver for it."""

    bodies: RigidBodies
    starts: Array
    effort: Effort
    rise: float
    kind: int
    cone: float


class _Lattice(NamedTuple):
    """Grid points while they are sampled."""

    distances: Array  # (r,) [m]
    turns: Array  # (b, 3, 3) wanted tool frame at each bearing
    found: Mask  # (r, b) overwritten
    postures: Array  # (r, b, n) overwritten


def _sampled(problem: _Problem, turn: Array, far: float, finer: int, known: _Grid | None) -> _Grid:
    """Sample a grid with its cells divided, continued from a coarser one."""
    round_about = problem.kind == DIRECTION and np.hypot(*turn[:2, 2]) < 1e-9
    rows, around = DISTANCES * finer + 1, BEARINGS * finer
    columns = 1 if round_about else around
    distances = np.linspace(0.0, far, rows)
    bearings = np.linspace(0.0, 2 * np.pi, around, endpoint=False)
    # An arm whose base frame faces the target sees it ahead, and its axis turned by the bearing.
    turns = np.array([_about_z(-bearing - np.pi) @ turn for bearing in bearings[:columns]])
    found, middle = np.zeros((rows, columns), dtype=np.bool_), np.zeros((rows - 1, columns), dtype=np.bool_)
    postures = np.zeros((rows, columns, len(problem.bodies.slide)))
    if known is not None:
        found[::finer, ::finer] = known.found[:, : columns // finer or 1]
        postures[::finer, ::finer] = known.postures[:, : columns // finer or 1]
    if far > 0.0:
        _sample_corners(problem, _Lattice(distances, turns, found, postures), finer * SEED_SPACING)
        turns = np.array([_about_z(-np.pi / around) @ one for one in turns]) if columns > 1 else turns
        _sample_middles(problem, _Lattice(distances, turns, found, postures), middle)
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
def _aim_at(problem: _Problem, distance: float, turn: Array) -> Aim:
    return Aim(np.array([distance, 0.0, problem.rise]), problem.kind, turn, problem.cone)


@compiled
def _sample_corners(problem: _Problem, lattice: _Lattice, spacing: int) -> None:
    """Seed the grid here and there by passes and restarts, and spread from each pose found."""
    rows, columns, n = lattice.postures.shape
    found, postures, effort = lattice.found, lattice.postures, problem.effort
    todo = np.empty((rows * columns, 2), dtype=np.int64)
    trial, count = np.empty(n), 0
    for i in range(rows):
        for j in range(columns):
            if found[i, j]:
                todo[count, 0], todo[count, 1] = i, j
                count += 1
    for i in range(0, rows, spacing):
        for j in range(0, columns, spacing):
            if count == 0 and not found[i, j]:
                aim = _aim_at(problem, lattice.distances[i], lattice.turns[j])
                trial[:] = problem.starts[0]
                error, angle, _, _, _ = solve_ik(problem.bodies, aim, problem.starts[1:], effort, trial)
                if error <= effort.tolerance and angle <= effort.angle_tolerance:
                    found[i, j], postures[i, j] = True, trial
                    todo[0, 0], todo[0, 1] = i, j
                    count = 1
            while count > 0:
                count = _spread(problem, lattice, todo, count - 1)


@compiled
def _spread(problem: _Problem, lattice: _Lattice, todo: NDArray[np.int64], count: int) -> int:
    """Go on from a pose found to its four neighbours, which are queued where they are found."""
    rows, columns, _ = lattice.postures.shape
    i, j = todo[count, 0], todo[count, 1]
    for side in range(4):
        k = i + (1 if side == 0 else (-1 if side == 1 else 0))
        m = (j + (1 if side == 2 else (-1 if side == 3 else 0))) % columns
        if k < 0 or k >= rows or lattice.found[k, m]:
            continue
        trial = lattice.postures[i, j].copy()
        if _polished(problem, _aim_at(problem, lattice.distances[k], lattice.turns[m]), trial):
            lattice.found[k, m], lattice.postures[k, m] = True, trial
            todo[count, 0], todo[count, 1] = k, m
            count += 1
    return count


@compiled
def _sample_middles(problem: _Problem, lattice: _Lattice, middle: Mask) -> None:
    """Mark the cells with a posture at every corner, and one in the middle come to from a corner."""
    rows, columns, _ = lattice.postures.shape
    found, distances = lattice.found, lattice.distances
    for i in range(rows - 1):
        for j in range(columns):
            after = (j + 1) % columns
            if not (found[i, j] and found[i + 1, j] and found[i, after] and found[i + 1, after]):
                continue
            aim = _aim_at(problem, 0.5 * (distances[i] + distances[i + 1]), lattice.turns[j])
            for corner in range(4):
                trial = lattice.postures[i + corner % 2, j if corner < 2 else after].copy()
                if not middle[i, j] and _polished(problem, aim, trial):
                    middle[i, j] = True


@compiled
def _polished(problem: _Problem, aim: Aim, joints: Array) -> bool:
    effort = problem.effort
    error, angle, _ = polish(
        problem.bodies.arm, aim, joints, effort.reach, effort.tolerance, effort.angle_tolerance, STEPS
    )
    return bool(error <= effort.tolerance and angle <= effort.angle_tolerance)


def _cells(distances: Array, bearings: Array, middle: Mask) -> BaseGeometry:
    """Return the cells as one shape, straight from corner to corner."""
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
