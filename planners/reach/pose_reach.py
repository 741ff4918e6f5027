"""Reach of any arm for a tool direction or orientation, at one heading, or under criteria, sampled on a grid.

The grid lies about the target. Samples of the arm's postures are moved to it (`inverse_reachability`); from
each that meets it, and from each grid point found, damped least squares leads on to the neighbours, so that
the postures of one area are connected as far as they can be. Where a grid point is found and its neighbour is
not, the edge is halved a few times. A cell, cut at these points, counts where a posture was found at its
corners and in its middle: this is sampled, not proven. Where damped least squares finds none, the closed form
of an arm that has one is asked for other branches (`closed_form_cells`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from shapely import transform
from shapely.geometry.base import BaseGeometry

from regionik.planners.kernels import compiled
from regionik.planners.reach.inverse_reachability import Tolerances, aim_at, posture_samples, posture_seeds
from regionik.planners.reach.options import REACH
from regionik.planners.reach.polar_cells import PolarCells, can_ask, closed_form_cells
from regionik.planners.reach.serial_criteria import (
    PostureDemand,
    SerialThresholds,
    moved_within_thresholds,
    serial_thresholds,
)
from regionik.planners.solvers.closed_form import Polish
from regionik.planners.solvers.damped_least_squares import ORIENTATION, POSITION, Aim, polish
from regionik.planners.solvers.rigid_bodies import span
from regionik.planners.solvers.serial_chain import SerialArm, serial_arm
from regionik.worlds.arms import pivot_index, reach_bound, with_pivot_limits
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.chain import Chain, rot_z
from regionik.worlds.joints import nearest_turn

OPTIONS = REACH.pose

MAX_SOLVER_STEPS = 8  # of damped least squares from a neighbour
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)  # multiples of it, but for whole ones, are spread evenly
DIGITS = 12  # of a turn: targets that differ by less are one


class PlacedPostures(NamedTuple):
    """Postures at places of the pivot axis."""

    places: Array  # (m, 2) on the floor [m]
    yaws: Array  # (m,) heading of the arm's base frame that the postures are counted from [rad]
    postures: Array  # (m, dof)


@dataclass(frozen=True, eq=False)
class PoseReach:
    """Reach of one target."""

    grid: PlacedPostures  # grid points that were found, a posture at each
    seeds: PlacedPostures  # from which that began
    area: BaseGeometry  # cells whose corners and middle were all found


class _Sampled(NamedTuple):
    """Reach of a target at the origin: its axis along +x as seen from above, or the heading kept zero.

    Places (m, 2) are distance [m] and bearing [rad] of the pivot axis, postures (m, dof) those from an arm's
    base frame that faces the target, or at the heading kept: of the grid, then of seeds.
    """

    grid: tuple[Array, Array]
    seeds: tuple[Array, Array]
    area: BaseGeometry


def pose_reach(
    chain: Chain, height: float, aim: Aim, heading: float | None = None, demand: PostureDemand | None = None
) -> PoseReach:
    """Return the places of the pivot axis from which some posture meets an aim.

    Parameters
    ----------
    height : float
        Of the arm's base frame over the floor [m].
    aim : Aim
        In the world.
    heading : float, optional
        That the arm's base frame keeps, the pivot within its limits; without, the base turns for the pivot,
        which has none [rad].
    demand : PostureDemand, optional
        That postures meet besides.
    """
    fixed_heading = heading is not None
    turn, azimuth = _level(aim) if heading is None else (rot_z(-heading)[:3, :3] @ aim.turn, heading)
    key = tuple(np.round(turn, DIGITS).ravel().tolist())
    rise = round(float(aim.position[2]) - height, DIGITS)
    found = _sampled(chain, rise, aim.kind, key, float(aim.cone), fixed_heading, demand)
    grid, seeds = (_placed(*rows, aim, azimuth, heading) for rows in (found.grid, found.seeds))
    c, s = np.cos(azimuth), np.sin(azimuth)
    area = transform(found.area, lambda p: p @ np.array([[c, s], [-s, c]]) + aim.position[:2])
    return PoseReach(grid, seeds, area)


def _placed(polar: Array, postures: Array, aim: Aim, azimuth: float, heading: float | None) -> PlacedPostures:
    """Postures at distances and bearings from an aim, (m, 2), on the floor."""
    away = azimuth + polar[:, 1]
    places = aim.position[:2] + polar[:, :1] * np.column_stack([np.cos(away), np.sin(away)])
    yaws = away + np.pi if heading is None else np.full(len(places), heading)
    return PlacedPostures(places, yaws, postures)


def _level(aim: Aim) -> tuple[Array, float]:
    """The aim's turn, brought about the vertical to azimuth zero, and its azimuth."""
    lead = aim.turn[:, 2] if np.hypot(*aim.turn[:2, 2]) > 1e-9 else aim.turn[:, 0]
    azimuth = float(np.arctan2(lead[1], lead[0]))
    return rot_z(-azimuth)[:3, :3] @ aim.turn, azimuth


@lru_cache(maxsize=4096)  # some 30 kB each
def _sampled(
    chain: Chain,
    rise: float,
    kind: int,
    key: tuple[float, ...],
    cone: float,
    fixed_heading: bool,
    demand: PostureDemand | None,
) -> _Sampled:
    turning = with_pivot_limits(chain, -np.inf, np.inf)
    arm = serial_arm(chain if fixed_heading else turning)
    within = Tolerances(OPTIONS.tolerance, max(OPTIONS.angle_share * cone, 1e-9), span(arm))
    aim = Aim(np.array([0.0, 0.0, rise]), kind, np.array(key).reshape(3, 3), cone)
    samples = posture_samples(turning, within.reach)
    bound = reach_bound(chain)
    far = bound.radius + np.sqrt(max(bound.length**2 - (rise - bound.height) ** 2, 0.0))
    thresholds = serial_thresholds(demand, chain.dof)
    grid = _grid(arm, thresholds, aim, within, far, 1, fixed_heading)
    for count in (OPTIONS.more,) if fixed_heading else (OPTIONS.nearest, OPTIONS.more):
        seeds = posture_seeds(turning, samples, rise, aim, within, count)
        seeds = _at_heading(chain, aim, *seeds) if fixed_heading else seeds
        if demand is not None:
            met = _meet_thresholds(grid, *seeds)
            seeds = seeds[0][met], seeds[1][met]
        _fill(grid, *seeds)
        if np.count_nonzero(grid.filled) >= OPTIONS.small_share * grid.filled.size:
            break
    branches = chain if fixed_heading else turning
    known = branches if demand is None and can_ask(branches, kind) else None
    cells = _cells(grid, known)
    for finer in OPTIONS.finer if len(seeds[0]) else ():
        if cells.whole >= max(1.0, OPTIONS.thin_share * np.count_nonzero(grid.filled)):
            break
        grid = _grid(arm, thresholds, aim, within, far, finer, fixed_heading)
        _fill(grid, *seeds)
        cells = _cells(grid, known)
    r, b = np.nonzero(grid.filled)
    places = np.column_stack([grid.distances[r], grid.bearings[b]])
    return _Sampled((places, grid.postures[r, b]), (seeds[1], seeds[0]), cells.area)


def _at_heading(chain: Chain, aim: Aim, postures: Array, places: Array) -> tuple[Array, Array]:
    """Seeds as of `posture_seeds` for a base frame at heading zero, their pivot within its limits.

    A point is met at any turn of the whole arm about the vertical through it, a pose nearly at a small one.
    """
    pivot = pivot_index(chain)
    lower, upper = float(chain.lower[pivot]), float(chain.upper[pivot])
    turned = postures[:, pivot] + places[:, 1] + np.pi
    if aim.kind == POSITION:
        fitting = lower + (GOLDEN * np.arange(len(postures))) % 1.0 * (upper - lower)
    else:
        middle = (lower + upper) / 2
        turned = nearest_turn(turned, middle)
        fitting = np.clip(turned, lower, upper)
    near = (np.abs(fitting - turned) <= OPTIONS.max_heading_miss) | (aim.kind == POSITION)
    postures, places = postures.copy(), places.copy()
    postures[:, pivot], places[:, 1] = fitting, np.mod(places[:, 1] + fitting - turned, 2 * np.pi)
    return postures[near], places[near]


class _Grid(NamedTuple):
    """Poses found about a target, by distance and bearing of the pivot axis.

    With a point or a direction that is vertical no bearing differs from another, and there is one column.
    """

    arm: SerialArm
    thresholds: SerialThresholds
    aim: Aim
    within: Tolerances
    distances: Array  # (r,) [m]
    bearings: Array  # (b,) [rad]
    filled: Mask  # (r, b) overwritten
    postures: Array  # (r, b, n) overwritten, from an arm's base frame that faces the target, or as it is kept
    fixed_heading: bool  # at heading zero


def _grid(
    arm: SerialArm,
    thresholds: SerialThresholds,
    aim: Aim,
    within: Tolerances,
    far: float,
    finer: int,
    fixed_heading: bool,
) -> _Grid:
    """An empty grid, its cells divided."""
    upright = aim.kind != ORIENTATION and np.hypot(*aim.turn[:2, 2]) < 1e-9
    round_about = upright and not fixed_heading
    rows, columns = OPTIONS.distances * finer + 1, 1 if round_about else OPTIONS.bearings * finer
    return _Grid(
        arm,
        thresholds,
        aim,
        within,
        np.linspace(0.0, far, rows),
        np.linspace(0.0, 2 * np.pi, columns, endpoint=False),
        np.zeros((rows, columns), dtype=np.bool_),
        np.zeros((rows, columns, len(arm.lower))),
        fixed_heading,
    )


@compiled
def _meet_thresholds(grid: _Grid, seeds: Array, places: Array) -> Mask:
    """Lead seeds (k, n) to meet what is asked from their places (k, 2), and tell which do; overwritten."""
    met = np.empty(len(seeds), dtype=np.bool_)
    for k in range(len(seeds)):
        met[k] = _come_to(grid, places[k, 0], places[k, 1], seeds[k])
    return met


@compiled
def _fill(grid: _Grid, seeds: Array, places: Array) -> None:
    """Spread from the postures of seeds (k, n) at their distances and bearings (k, 2)."""
    rows, columns, _ = grid.postures.shape
    wide, turn = grid.distances[1], 2 * np.pi / columns
    todo = np.empty((rows * columns, 2), dtype=np.int64)
    for k in range(len(seeds)):
        near, beside = int(places[k, 0] / wide), int(places[k, 1] / turn)
        for corner in range(4):
            i, j = near + corner % 2, (beside + corner // 2) % columns
            if i < rows and not grid.filled[i, j] and _extend_to(grid, i, j, seeds[k]):
                todo[0, 0], todo[0, 1] = i, j
                count = 1
                while count > 0:
                    count = _spread(grid, todo, count - 1)


@compiled
def _spread(grid: _Grid, todo: Index, count: int) -> int:
    """Go on from a pose found to its four neighbours, which are queued where they are found."""
    rows, columns, _ = grid.postures.shape
    i, j = todo[count, 0], todo[count, 1]
    for down, on in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        k, m = i + down, (j + on) % columns
        if 0 <= k < rows and not grid.filled[k, m] and _extend_to(grid, k, m, grid.postures[i, j]):
            todo[count, 0], todo[count, 1] = k, m
            count += 1
    return count


@compiled
def _extend_to(grid: _Grid, i: int, j: int, posture: Array) -> bool:
    """Come to a grid point from a posture nearby; it is kept where that is done."""
    trial = posture.copy()
    if not _come_to(grid, grid.distances[i], grid.bearings[j], trial):
        return False
    grid.filled[i, j], grid.postures[i, j] = True, trial
    return True


@compiled
def _come_to(grid: _Grid, distance: float, bearing: float, joints: Array) -> bool:
    within = grid.within
    aim = aim_at(grid.aim, distance, bearing, 0.0 if grid.fixed_heading else bearing + np.pi)
    error, angle, _ = polish(
        grid.arm, aim, joints, within.reach, within.error, within.angle, MAX_SOLVER_STEPS
    )
    if error > within.error or angle > within.angle:
        return False
    return moved_within_thresholds(
        grid.arm, grid.thresholds, aim, joints, within.reach, within.error, within.angle
    )


def _cells(grid: _Grid, known: Chain | None) -> PolarCells:
    """Cells cut where edges leave the reach, each kept if a posture was found in its middle.

    A chain that is ``known`` in closed form is asked about what was not found.
    """
    cuts = _cut_edges(grid, OPTIONS.halvings if known is None else OPTIONS.halvings - 1)
    cells = PolarCells(grid.distances, grid.bearings, grid.filled, *cuts)
    r, b, middles = cells.middles
    met = _cells_with_posture(grid, r, b, middles)
    if known is None:
        return cells.selected(met)
    return closed_form_cells(
        known, grid.aim, Polish(grid.within.error, grid.within.angle, MAX_SOLVER_STEPS), cells, met
    )


@compiled
def _cut_edges(grid: _Grid, halvings: int) -> tuple[Array, Array]:
    """Where edges leave the reach, as shares of them: outward (r - 1, b) and to the next bearing (r, b)."""
    rows, columns, _ = grid.postures.shape
    outward, onward = np.zeros((rows - 1, columns)), np.zeros((rows, columns))
    for i in range(rows):
        for j in range(columns):
            if i + 1 < rows and grid.filled[i, j] != grid.filled[i + 1, j]:
                outward[i, j] = _cut(grid, halvings, i, j, i + 1, j)
            after = (j + 1) % columns
            if grid.filled[i, j] != grid.filled[i, after]:
                onward[i, j] = _cut(grid, halvings, i, j, i, after)
    return outward, onward


@compiled
def _cut(grid: _Grid, halvings: int, i: int, j: int, k: int, m: int) -> float:
    """Share of the edge from one grid point to the next at which the reach ends or begins."""
    turn = 2 * np.pi / len(grid.bearings)
    inside = grid.filled[i, j]
    joints = (grid.postures[i, j] if inside else grid.postures[k, m]).copy()
    low, high = 0.0, 1.0  # from the end within reach
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        share = middle if inside else 1.0 - middle
        distance = grid.distances[i] + share * (grid.distances[k] - grid.distances[i])
        trial = joints.copy()
        if _come_to(grid, distance, grid.bearings[j] + (share * turn if m != j else 0.0), trial):
            low, joints = middle, trial
        else:
            high = middle
    return low if inside else 1.0 - low


@compiled
def _cells_with_posture(grid: _Grid, r: Index, b: Index, middles: Array) -> Mask:
    """Mask (m,) of the cells with a posture in their middle (m, 2), come to from a corner."""
    columns = len(grid.bearings)
    met = np.zeros(len(r), dtype=np.bool_)
    for k in range(len(r)):
        for corner in range(4):
            i, j = r[k] + corner % 2, (b[k] + corner // 2) % columns
            if grid.filled[i, j] and not met[k]:
                met[k] = _come_to(grid, middles[k, 0], middles[k, 1], grid.postures[i, j].copy())
    return met
