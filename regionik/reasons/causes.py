"""Irreducible causes: constraints that together rule something out, and no fewer of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from regionik.areas.relaxations import Constraint
from regionik.areas.standing import Standing, anywhere, by_heading, turns_matter
from regionik.postures.families import BACK, FRONT
from regionik.regions import outer_areas, path_areas
from regionik.worlds.scene import World

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


def no_outer(world: World) -> bool:
    """Whether the first set-point of a world is proven to be out of reach: its outer area is empty."""
    return bool(outer_areas(world, world.task[:1])[0].is_empty)


def no_inner(world: World) -> bool:
    """Whether no place of the base is known to serve the first set-point: no proof that there is none."""
    return all(_nothing(world, standing(world)) for standing in _standings(world))


def _standings(world: World) -> list[Callable[[World], Standing]]:
    return [anywhere, by_heading] if turns_matter(world) else [anywhere]


def _nothing(world: World, standing: Standing) -> bool:
    return not any(area.area > 0 for area in path_areas(world, world.task[:1], (FRONT, BACK), standing).inner)
