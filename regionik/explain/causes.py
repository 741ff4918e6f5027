"""Irreducible causes: constraints that together rule something out, and no fewer of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from regionik.areas.standing import LEAST_AREA, anywhere, by_heading, turns_matter
from regionik.explain.relaxations import Constraint
from regionik.postures.families import BACK, FRONT
from regionik.regions import outer_areas, path_areas
from regionik.worlds.errors import Cause, Explanation
from regionik.worlds.scene import Target, World

Closed = Callable[[World], bool]


def irreducible(world: World, constraints: Iterable[Constraint], closed: Closed) -> tuple[Constraint, ...]:
    """Constraints that rule a world's task out when all others are taken away; without any of them it is not.

    A deletion filter: constraints go one by one where the rest still rules it out, all obstacles at once
    first. It is run until nothing more goes, for areas are rounded, and a pass need not have the last word.

    Parameters
    ----------
    world : World
    constraints : iterable of Constraint
        In the order in which they are to go.
    closed : callable
        Whether a world's task is ruled out; must be so of this one.

    Returns
    -------
    tuple of Constraint
        Empty where it is ruled out with all of them taken away.
    """
    every = tuple(constraints)
    kept = tuple(one for one in every if one.kind != "obstacle")
    if not closed(relaxed(world, every, kept)):
        kept = every
    before = None
    while kept != before:
        before = kept
        for one in before:
            rest = tuple(other for other in kept if other is not one)
            if closed(relaxed(world, every, rest)):
                kept = rest
    return kept


def relaxed(world: World, constraints: Iterable[Constraint], kept: Iterable[Constraint]) -> World:
    """A world without the constraints that are not kept."""
    names = {(one.kind, one.name) for one in kept}
    for one in constraints:
        if (one.kind, one.name) not in names:
            world = one.relax(world)
    return world


def cause_of(one: Constraint, quick: Explanation) -> Cause:
    """A constraint as a cause, with what is known to be missing [m]."""
    margins = {cause.name: cause.margin for cause in quick.causes}
    kinds = {cause.kind: cause.margin for cause in quick.causes if cause.kind in ("floor", "obstacle")}
    if one.kind == "clearance":
        return Cause(one.kind, one.name, kinds.get("obstacle"))
    return Cause(one.kind, one.name, kinds.get("floor") if one.kind == "floor" else margins.get(one.name))


def arm_too_short(world: World, quick: Explanation) -> Cause:
    """The cause where nothing that can be taken away is one."""
    margin = next((cause.margin for cause in quick.causes if cause.kind == "reach"), None)
    return Cause("reach", world.robot.name, margin)


def no_outer(world: World) -> bool:
    """Return True where the first set-point is proven to be out of reach: its outer area is empty."""
    return bool(outer_areas(world, world.task[:1])[0].is_empty)


def no_inner(world: World) -> bool:
    """Return True where no place for the base is known for the first set-point, which proves nothing."""
    ways = [anywhere, by_heading] if turns_matter(world) else [anywhere]
    every = (path_areas(world, world.task[:1], (FRONT, BACK), standing(world)) for standing in ways)
    return not any(area.area > 0 for areas in every for area in areas.inner)


def opened(world: World, targets: Sequence[Target]) -> NDArray[np.bool_]:
    """Return for each target if it has an inner area at every heading, or at the one the rules fix."""
    areas = path_areas(world, targets)
    found = np.zeros(len(targets), dtype=bool)
    found[areas.target[shapely.area(areas.inner) > LEAST_AREA]] = True
    return found
