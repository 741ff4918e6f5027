"""Random targets out of reach, and checks of what is said about them by other means than the search's."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import shapely

from regionik.explain.changes import repaired
from regionik.explain.constraints import constraints_of
from regionik.reachability.reach import reach
from regionik.regions import admissible_area, has_no_known_place, path_areas
from regionik.scene import scene_of
from regionik.worlds.errors import Explanation, Repair
from regionik.worlds.scene import World
from tests.test_random_worlds import random_world

SAMPLES = 12  # repairs along one direction, all smaller than what is told
NEAR = 0.05  # part by which a repair may be larger than the least of them
ROUNDING = 2e-4  # [m] or [rad]


def cases(seeds: Iterable[int]) -> list[World]:
    """Worlds with one set-point that is out of reach, the first of each random world that has one."""
    found = []
    for seed in seeds:
        world = random_world(seed)
        far = _first_shut(world)
        if far is not None:
            case = replace(world, task=(world.task[far],))
            if has_no_known_place(scene_of(case)) and not reach(case, case.task).reachable.any():
                found.append(case)
    return found


def _first_shut(world: World) -> int | None:
    areas = path_areas(scene_of(world))
    there = set(areas.target[shapely.area(areas.inner) > 0].tolist())
    return next((k for k in range(len(world.task)) if k not in there), None)


def proven_irreducible(world: World, found: Explanation) -> bool:
    """Whether the causes rule the target out with all else taken away, and no fewer of them do."""
    names = {cause.name for cause in found.causes if cause.kind != "reach"}
    outer = admissible_area(world, world.task[0]).outer.is_empty

    def ruled_out(kept: set[str]) -> bool:
        left = world
        for one in constraints_of(scene_of(world)):
            if one.name not in kept:
                left = one.relax(scene_of(left)).world
        area = admissible_area(left, left.task[0])
        return bool(area.outer.is_empty if outer else area.inner.area <= 0)

    return ruled_out(names) and not any(ruled_out(names - {name}) for name in names)


def as_small_as_brute_force(world: World, repair: Repair, near: float = NEAR) -> bool:
    """Whether no smaller repair along the same direction, of many, brings the target within reach.

    What leaves no inner area at every heading, or brings the target into a solid, does not. Of the others the
    areas know the base alone: from each the arm might touch something, so the target is asked for again.
    """
    return not any(_helps(world, less) for less in smaller(world, repair, near))


def smaller(world: World, repair: Repair, near: float = NEAR) -> list[World]:
    """The world with ever more of a repair made, up to a share ``near`` less than all of it."""
    if repair.kind == "lift-off":
        return [
            repaired(scene_of(world), replace(repair, amount=float(n))).world
            for n in range(round(repair.amount))
        ]
    size = _size(world, repair)
    least = (size - ROUNDING) / (1 + near)
    shares = np.linspace(0, least / size, SAMPLES + 1)[1:] if least > 0 else np.empty(0)
    return [repaired(scene_of(world), part_of(world, repair, share)).world for share in shares.tolist()]


def _size(world: World, repair: Repair) -> float:
    if repair.kind == "clearance":
        return world.rules.clearance - repair.amount
    return repair.amount - (world.task[0].cone if repair.kind == "cone" else 0.0)


def part_of(world: World, repair: Repair, share: float) -> Repair:
    """A share of a repair, or more than all of it."""
    before = {"clearance": world.rules.clearance, "cone": world.task[0].cone}.get(repair.kind, 0.0)
    vector = tuple(share * part for part in repair.vector)
    return replace(repair, amount=before + share * (repair.amount - before), vector=vector)


def _helps(before: World, after: World) -> bool:
    if not (shapely.area(path_areas(scene_of(after), after.task).inner) > 1e-7).any():
        return False
    here, there = before.task[0].position, after.task[0].position
    solids = zip(before.solids, after.solids, strict=True)
    if any(old.distance(here) >= 0 and new.distance(there) < 0 for old, new in solids):
        return False
    return bool(reach(after, after.task).reachable.all())
