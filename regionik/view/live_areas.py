"""What if: the areas of a world that changes a little, only what the change touches made anew.

An area hangs on its set-point, the robot, the rules, the floor, and the solids that its reach meets. As long
as the first stay, a solid that comes, goes or moves touches only the set-points whose reach meets its grown
shadow, where it was or where it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from regionik.areas.ground import GUARD, Geometries, ground_of, grow, shadow_of
from regionik.areas.standing import anywhere
from regionik.pruning import Pruned, cut_path, prune_path
from regionik.regions import PathAreas, path_areas, ways_to_stand
from regionik.worlds.errors import Explanation, NoPlanFound
from regionik.worlds.obstacles import Solid
from regionik.worlds.scene import World

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Look:
    """Areas and verdict of a world, before anything is planned in full.

    Attributes
    ----------
    world : World
    areas : PathAreas
        Of every set-point, over the arm's front and back, whatever the base's heading.
    pruned : Pruned or None
        What whole traversals use; None where there is none.
    why : Explanation or None
        Why there is none.
    touched : tuple of int
        Set-points whose areas were made anew.
    """

    world: World
    areas: PathAreas
    pruned: Pruned | None
    why: Explanation | None
    touched: tuple[int, ...]


def look(world: World, before: Look | None = None) -> Look:
    """Areas of a world with a task and whether they let the whole path be done.

    Parameters
    ----------
    world : World
    before : Look, optional
        Of the world as it was; what is still so is taken from there.

    Examples
    --------
    >>> from regionik.worlds.documents.world_file import load_world
    >>> first = look(load_world("pillar"))
    >>> first.why is None, len(first.touched), len(look(load_world("pillar"), first).touched)
    (True, 15, 0)
    """
    if before is not None:
        world = _settled(world, before.world)
    standing = anywhere(world)
    kept = {} if before is None else _still_so(before, world)
    touched = tuple(i for i in range(len(world.task)) if i not in kept)
    fresh = path_areas(world, [world.task[i] for i in touched], standing=standing)
    areas = _joined(fresh, touched, before.areas if before else fresh, kept)
    pruned, why = _cut(world, areas)
    return Look(world, areas, pruned, why, touched)


def _cut(world: World, areas: PathAreas) -> tuple[Pruned | None, Explanation | None]:
    """The plainest way to stand and to face that needs no lift-off, as plans choose it; or the fewest."""
    found: list[Pruned] = []
    why = None
    for standing, facings in ways_to_stand(world):
        try:
            if standing is anywhere:
                found.append(cut_path(world, standing(world), _facing(areas, facings)))
            else:
                found.append(prune_path(world, standing(world), facings)[1])
        except NoPlanFound as failure:
            why = failure.explanation
        else:
            if not found[-1].breaks:
                break
    return (min(found, key=lambda one: len(one.breaks)), None) if found else (None, why)


def _facing(areas: PathAreas, facings: Sequence[int]) -> PathAreas:
    """The areas of some facings alone."""
    return _rows(areas, np.flatnonzero([one.facing in facings for one in areas.family]))


def _settled(world: World, was: World) -> World:
    """The world with its parts that are as they were, the very same: what is kept of them is found again."""
    solids = _named(was)
    obstacles = tuple(
        next((twin for twin in solids.get(one.name, []) if alike(one, twin)), one) for one in world.obstacles
    )
    floor = was.floor if alike(world.floor, was.floor) else world.floor
    robot = was.robot if alike(world.robot, was.robot) else world.robot
    return replace(world, obstacles=obstacles, floor=floor, robot=robot)


def _named(world: World) -> dict[str, list[Solid]]:
    found: dict[str, list[Solid]] = {}
    for solid in world.obstacles:
        found.setdefault(solid.name, []).append(solid)
    return found


def _still_so(before: Look, world: World) -> dict[int, int]:
    """Set-points whose area is as it was, and which set-point of the world before they were."""
    was = before.world
    same = alike((was.robot, was.floor, was.rules), (world.robot, world.floor, world.rules))
    if not same or (world.rules.heading == "fixed" and not alike(was.start, world.start)):
        return {}
    changed = _changed(was, world)
    met = np.zeros(len(was.task), dtype=bool)
    if len(changed):
        rows, _ = shapely.STRtree(changed).query(before.areas.reach, predicate="intersects")
        met[before.areas.target[rows]] = True
    left = [i for i in range(len(was.task)) if not met[i]]
    kept: dict[int, int] = {}
    for i, target in enumerate(world.task):  # most stay where they are in the task
        options = [i] if i < len(was.task) and not met[i] else []
        for j in (*options, *left):
            if alike(was.task[j], target):
                kept[i] = j
                break
    return kept


def _changed(was: World, world: World) -> Geometries:
    """Grown shadows of the solids that are not in both worlds."""
    found = []
    for one, other in ((was, world), (world, was)):
        there = {id(solid) for solid in other.obstacles}
        by = ground_of(one).clearance + ground_of(one).far + GUARD
        gone = [solid for solid in one.obstacles if id(solid) not in there]
        shadows = [shadow_of(solid, one.robot.body_height) for solid in gone]
        found += [grow(shadow, by, inner=True) for shadow in shadows if shadow is not None]
    shapes: Geometries = np.array(found, dtype=object)
    return shapes


def _joined(fresh: PathAreas, touched: Sequence[int], before: PathAreas, kept: dict[int, int]) -> PathAreas:
    """Rows of the areas made anew and of those that are as they were, by set-point."""
    new = np.array(touched, dtype=np.intp)[fresh.target]
    old = [(i, row) for i, j in kept.items() for row in np.flatnonzero(before.target == j).tolist()]
    moved = np.array(old, dtype=np.intp).reshape(-1, 2)
    parts = _rows(before, moved[:, 1])
    target = np.concatenate([new, moved[:, 0]])
    order = np.argsort(target, kind="stable")
    families = (*fresh.family, *parts.family)
    return PathAreas(
        target[order],
        tuple(families[k] for k in order.tolist()),
        np.concatenate([fresh.side, parts.side])[order],
        np.concatenate([fresh.reach, parts.reach])[order],
        np.concatenate([fresh.inner, parts.inner])[order],
    )


def _rows(areas: PathAreas, rows: Index) -> PathAreas:
    family = tuple(areas.family[k] for k in rows.tolist())
    return PathAreas(areas.target[rows], family, areas.side[rows], areas.reach[rows], areas.inner[rows])


def alike(a: Any, b: Any) -> bool:
    """Whether two values are equal, dataclasses by their fields and arrays by their numbers."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return a.shape == b.shape and bool((a == b).all())
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(alike, a, b))
    if is_dataclass(a):
        return all(alike(getattr(a, field.name), getattr(b, field.name)) for field in fields(a))
    return bool(a == b)
