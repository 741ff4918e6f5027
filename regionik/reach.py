"""Whether targets can be reached, and from where: arrays in, arrays out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from regionik import explain
from regionik.demand import misses
from regionik.mfabrik import axis_of, pose_of, solver_for
from regionik.regions import PathAreas, outer_areas, path_areas
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.scene import Target, World


@dataclass(frozen=True, eq=False)
class Answer:
    """Reachability of n targets.

    Attributes
    ----------
    targets : (n, 3) array
        [m]
    reachable : (n,) array of bool
    verdict : (n,) array of str
        "reachable": base and arm were found and checked by forward kinematics. "unreachable": the outer area
        is empty, which is a proof in the model. "undecided": neither.
    base : (n, 3) array
        x, y [m], yaw [rad]; NaN where there is none.
    joints : (n, dof) array
        NaN where there is none.
    reason : list of str
        One for each target; empty where it is reachable.
    """

    targets: Array
    reachable: NDArray[np.bool_]
    verdict: NDArray[np.str_]
    base: Array
    joints: Array
    reason: list[str]


def reach(world: World, targets: ArrayLike | Sequence[Target]) -> Answer:
    """Ask for many targets whether the tool can get there, and from where.

    Base and arm are found by M-FABRIK inside the admissible area, from its place nearest to the start.
    Obstacles bind the base; whether the arm would touch one on the way is for a plan to say.

    Parameters
    ----------
    world : World
    targets : (n, 3) array_like or sequence of Target
        Bare points leave the tool direction free [m].

    Raises
    ------
    InputError
        For targets that are not n rows of three finite numbers.

    Examples
    --------
    >>> from regionik.worlds.format import load_world
    >>> reach(load_world("pillar"), [[0.5, 0, 0.25], [0.5, 0, 2.0]]).verdict.tolist()
    ['reachable', 'unreachable']
    """
    asked = _as_targets(targets)
    n, dof = len(asked), world.robot.chain.dof
    positions = np.array([target.position for target in asked]).reshape(-1, 3)
    base, joints = np.full((n, 3), np.nan), np.full((n, dof), np.nan)
    reachable = np.zeros(n, dtype=bool)
    areas = path_areas(world, asked)
    for i, row in _nearest_rows(world, areas, n).items():
        found = _solve(world, asked[i], areas, row)
        if found is not None:
            base[i], joints[i] = found
            reachable[i] = True
    verdict = np.where(reachable, "reachable", "undecided").astype("<U11")
    rest = np.flatnonzero(~reachable)
    outer = outer_areas(world, [asked[i] for i in rest])
    reason = [""] * n
    for i, area in zip(rest.tolist(), outer, strict=True):
        if area.is_empty:
            verdict[i] = "unreachable"
        reason[i] = explain.unreachable(world, 0, [asked[i]]).reason
    return Answer(positions, reachable, verdict, base, joints, reason)


def _as_targets(targets: ArrayLike | Sequence[Target]) -> list[Target]:
    if isinstance(targets, Sequence) and all(isinstance(target, Target) for target in targets):
        return [target for target in targets if isinstance(target, Target)]
    return [Target(row) for row in frozen(np.atleast_2d(np.asarray(targets)), (None, 3), "targets")]


def _nearest_rows(world: World, areas: PathAreas, n: int) -> dict[int, int]:
    """For each target with an area, the row of it that is nearest to where the robot starts."""
    spot = shapely.Point(axis_of(world.robot, _start(world)[0]))
    gaps = np.where(shapely.is_empty(areas.inner), np.inf, shapely.distance(areas.inner, spot))
    best: dict[int, int] = {}
    for row, i in enumerate(areas.target.tolist()):
        if np.isfinite(gaps[row]) and (i not in best or gaps[row] < gaps[best[i]]):
            best[i] = row
    return best


def _solve(world: World, target: Target, areas: PathAreas, row: int) -> tuple[Array, Array] | None:
    """Base and joints inside one row's area, confirmed by forward kinematics."""
    area = areas.inner[row]
    base, joints = _start(world)
    near = shapely.shortest_line(area, shapely.Point(axis_of(world.robot, base)))
    spot = np.array(near.coords[0])
    solver = solver_for(world, areas.family[row], area)
    found = solver(target, pose_of(world.robot, spot, base[2]), joints)
    error, angle = misses(target, world.robot.tool(found.base, found.joints))
    close = error <= world.rules.tolerance + 1e-9 and angle <= target.cone + 1e-9
    return (found.base, found.joints) if found.converged and close else None


def _start(world: World) -> tuple[Array, Array]:
    if world.start is not None:
        return world.start.base, world.start.joints
    return np.zeros(3), world.robot.carry
