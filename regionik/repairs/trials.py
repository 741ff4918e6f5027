"""A world with a repair made, and whether its target is then within reach: by areas, and by asking again."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from regionik.areas.relaxations import (
    ARM_CLEARANCE,
    with_arm_clearance,
    with_clearance,
    with_cone,
    with_lift_offs,
    with_mast,
    with_obstacle_moved,
    with_target_moved,
)
from regionik.areas.standing import LEAST_AREA, anywhere
from regionik.reach import reach
from regionik.reasons.causes import no_inner
from regionik.regions import path_areas
from regionik.repairs.least import confirmed
from regionik.seeking.witness import Quest
from regionik.worlds.errors import Repair
from regionik.worlds.scene import Target, World

Change = Callable[[float], World]


def repaired(world: World, repair: Repair, i: int = 0) -> World:
    """The world with a repair made.

    Parameters
    ----------
    world : World
    repair : Repair
    i : int
        Which set-point a moved target is.
    """
    by = np.array(repair.vector)
    match repair.kind:
        case "clearance" if repair.name == ARM_CLEARANCE:
            return with_arm_clearance(world, repair.amount)
        case "clearance":
            return with_clearance(world, repair.amount)
        case "cone":
            return with_cone(world, repair.amount)
        case "raise":
            return with_mast(world, repair.amount)
        case "move-target":
            return with_target_moved(world, i, by)
        case "move-obstacle":
            return with_obstacle_moved(world, repair.name, by)
        case "lift-off":
            allowed = (world.rules.max_lift_offs or 0) + round(repair.amount)
            return with_lift_offs(world, allowed)


def holds(before: World, after: World) -> bool:
    """Whether the target is reachable in a changed world, and not inside anything that it was not in."""
    if enters(before, after):
        return False
    if not opened(after, after.task)[0] and no_inner(after):  # sooner known than asked
        return False
    return bool(reach(after, after.task).reachable.all())


def sighted(before: World, after: World) -> bool:
    """Whether a configuration is found in the areas that hold at every heading: sooner known than `holds`.

    Where it is not, looking heading by heading and pitch by pitch may still find one.
    """
    if enters(before, after):
        return False
    areas, sides = path_areas(after), anywhere(after).sides
    quest = Quest(after, after.task[0])
    rows = np.flatnonzero(shapely.area(areas.inner) > LEAST_AREA)
    spans = [sides[areas.side[k]].span for k in rows]
    looked = zip(rows.tolist(), spans, strict=True)
    return any(quest.within(areas.inner[k], areas.family[k], span) is not None for k, span in looked)


def enters(before: World, after: World) -> bool:
    """Whether the target is in a solid that it was not in."""
    solids = zip(before.solids, after.solids, strict=True)
    old, new = before.task[0].position, after.task[0].position
    return any(a.distance(old) >= 0 and b.distance(new) < 0 for a, b in solids)


def checked(world: World, change: Change, amount: float | None, most: float) -> float | None:
    """An amount found by areas, confirmed by asking whether the target is reachable."""
    if amount is None:
        return None
    return confirmed(
        lambda one: holds(world, change(one)), amount, most, lambda one: sighted(world, change(one))
    )


def opened(world: World, targets: Sequence[Target]) -> NDArray[np.bool_]:
    """Whether each target has an inner area that holds at every heading, or at the one the rules fix."""
    areas = path_areas(world, targets)
    found = np.zeros(len(targets), dtype=bool)
    found[areas.target[shapely.area(areas.inner) > LEAST_AREA]] = True
    return found
