"""Areas of a world that changes a little: only what a change affects is computed again.

The area of a set-point depends on the set-point, the robot, the rules, the floor, and the obstacles within
its reach. While the others stay, an obstacle that is added, removed or moved affects only the set-points
whose reach meets its grown shadow, before or after.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from regionik.areas.ground import GUARD, Geometries, ground_of, grow, shadow_of
from regionik.areas.standing import PathAreas, anywhere
from regionik.pruning import Pruned, cut_path, prune_path
from regionik.regions import path_areas, ways_to_stand
from regionik.worlds.errors import Explanation, NoPlanFound
from regionik.worlds.obstacles import Solid
from regionik.worlds.scene import World

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class LiveAreas:
    """Areas and verdict of a world, before anything is planned in full.

    Attributes
    ----------
    world : World
    areas : PathAreas
        Of every set-point, over the arm's front and back, at any heading of the base.
    pruned : Pruned or None
        What whole traversals use; None where there is none.
    explanation : Explanation or None
        Why there is none.
    recomputed : tuple of int
        Set-points whose areas were computed anew.
    """

    world: World
    areas: PathAreas
    pruned: Pruned | None
    explanation: Explanation | None
    recomputed: tuple[int, ...]


def live_areas(world: World, before: LiveAreas | None = None) -> LiveAreas:
    """Return the areas of a world with a task, and whether they admit the whole path.

    Parameters
    ----------
    world : World
    before : LiveAreas, optional
        Of an earlier version of the world; what has not changed is taken from there.

    Examples
    --------
    >>> from regionik.worlds.documents.world_file import load_world
    >>> first = live_areas(load_world("pillar"))
    >>> again = live_areas(load_world("pillar"), first)
    >>> first.explanation is None, len(first.recomputed), len(again.recomputed)
    (True, 15, 0)
    """
    if before is not None:
        world = _with_unchanged_parts(world, before.world)
    standing = anywhere(world)
    kept = {} if before is None else _kept_targets(before, world)
    recomputed = tuple(i for i in range(len(world.task)) if i not in kept)
    fresh = path_areas(world, [world.task[i] for i in recomputed], standing=standing)
    areas = _combined(fresh, recomputed, before.areas if before else fresh, kept)
    pruned, explanation = _prune(world, areas)
    return LiveAreas(world, areas, pruned, explanation, recomputed)


def _prune(world: World, areas: PathAreas) -> tuple[Pruned | None, Explanation | None]:
    """The plainest way to stand and to face that needs no lift-off, as plans choose it; or the fewest."""
    found: list[Pruned] = []
    explanation = None
    for standing, facings in ways_to_stand(world):
        try:
            if standing is anywhere:
                rows = np.flatnonzero([family.facing in facings for family in areas.family])
                found.append(cut_path(world, standing(world), _select(areas, rows)))
            else:
                found.append(prune_path(world, standing(world), facings)[1])
        except NoPlanFound as failure:
            explanation = failure.explanation
        else:
            if not found[-1].breaks:
                break
    return (min(found, key=lambda one: len(one.breaks)), None) if found else (None, explanation)


def _with_unchanged_parts(world: World, before: World) -> World:
    """The world with parts equal to those before replaced by them: caches know them by identity."""
    solids: dict[str, list[Solid]] = {}
    for solid in before.obstacles:
        solids.setdefault(solid.name, []).append(solid)
    obstacles = tuple(
        next((twin for twin in solids.get(one.name, []) if is_equal(one, twin)), one)
        for one in world.obstacles
    )
    floor = before.floor if is_equal(world.floor, before.floor) else world.floor
    robot = before.robot if is_equal(world.robot, before.robot) else world.robot
    return replace(world, obstacles=obstacles, floor=floor, robot=robot)


def _kept_targets(before: LiveAreas, world: World) -> dict[int, int]:
    """Set-points whose area has not changed, each with its index before."""
    old = before.world
    same = is_equal((old.robot, old.floor, old.rules), (world.robot, world.floor, world.rules))
    if not same or (world.rules.heading == "fixed" and not is_equal(old.start, world.start)):
        return {}
    changed = _changed_shadows(old, world)
    affected = np.zeros(len(old.task), dtype=bool)
    if len(changed):
        rows, _ = shapely.STRtree(changed).query(before.areas.reach, predicate="intersects")
        affected[before.areas.target[rows]] = True
    others = np.flatnonzero(~affected).tolist()
    kept: dict[int, int] = {}
    for i, target in enumerate(world.task):
        first = [i] if i < len(old.task) and not affected[i] else []  # most keep their index
        for j in (*first, *others):
            if is_equal(old.task[j], target):
                kept[i] = j
                break
    return kept


def _changed_shadows(before: World, after: World) -> Geometries:
    """Grown shadows of the obstacles that are not in both worlds."""
    shadows = []
    for one, other in ((before, after), (after, before)):
        shared = {id(solid) for solid in other.obstacles}
        distance = ground_of(one).clearance + ground_of(one).far + GUARD
        for solid in one.obstacles:
            shadow = None if id(solid) in shared else shadow_of(solid, one.robot.body_height)
            if shadow is not None:
                shadows.append(grow(shadow, distance, inner=True))
    shapes: Geometries = np.array(shadows, dtype=object)
    return shapes


def _combined(
    fresh: PathAreas, recomputed: Sequence[int], before: PathAreas, kept: dict[int, int]
) -> PathAreas:
    """Rows of the areas computed anew and of those kept, by set-point."""
    new = np.array(recomputed, dtype=np.intp)[fresh.target]
    old = [(i, row) for i, j in kept.items() for row in np.flatnonzero(before.target == j).tolist()]
    pairs = np.array(old, dtype=np.intp).reshape(-1, 2)
    parts = _select(before, pairs[:, 1])
    target = np.concatenate([new, pairs[:, 0]])
    order = np.argsort(target, kind="stable")
    families = (*fresh.family, *parts.family)
    return PathAreas(
        target[order],
        tuple(families[k] for k in order.tolist()),
        np.concatenate([fresh.side, parts.side])[order],
        np.concatenate([fresh.reach, parts.reach])[order],
        np.concatenate([fresh.inner, parts.inner])[order],
    )


def _select(areas: PathAreas, rows: Index) -> PathAreas:
    family = tuple(areas.family[k] for k in rows.tolist())
    return PathAreas(areas.target[rows], family, areas.side[rows], areas.reach[rows], areas.inner[rows])


def is_equal(a: Any, b: Any) -> bool:
    """Compare two values, dataclasses by their fields and arrays by their numbers."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return a.shape == b.shape and bool((a == b).all())
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(is_equal, a, b))
    if is_dataclass(a):
        return all(is_equal(getattr(a, field.name), getattr(b, field.name)) for field in fields(a))
    return bool(a == b)
