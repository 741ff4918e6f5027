"""Irreducible causes: constraints that rule a task out together, and of which none can be left out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from typing import TypeVar

from regionik.explain.constraints import Constraint
from regionik.planners.progress import tell
from regionik.scene import Scene

Closed = Callable[[Scene], bool]
Item = TypeVar("Item")


def irreducible(scene: Scene, constraints: Iterable[Constraint], closed: Closed) -> tuple[Constraint, ...]:
    """Constraints that rule a world's task out, and of which none can be left out; none where all can be.

    A task is ruled out where ``closed`` is True. All obstacles are left out at once first, where that goes.
    """
    every = tuple(constraints)
    bare = tuple(one for one in every if one.kind != "obstacle")

    def rules_out(remaining: Sequence[Constraint]) -> bool:
        return closed(relaxed(scene, every, remaining))

    return deletion_filter(bare if rules_out(bare) else every, rules_out)


def deletion_filter(items: Sequence[Item], holds: Callable[[Sequence[Item]], bool]) -> tuple[Item, ...]:
    """Items of which still holds what does of all, and of no part that lacks one of them.

    A deletion filter: items are left out in their order, many at once where that goes, by halves. Then one by
    one until nothing more is left out, as areas are rounded: what holds of few items need not of more.

    Examples
    --------
    >>> deletion_filter(range(100), lambda left: 7 in left and 40 in left)
    (7, 40)
    """

    @cache
    def holds_at(places: tuple[int, ...]) -> bool:
        return holds([items[k] for k in places])

    def left(remaining: tuple[int, ...], some: tuple[int, ...]) -> tuple[int, ...]:
        """What is kept when as many of some of it as can be are left out."""
        rest = tuple(k for k in remaining if k not in some)
        if holds_at(rest):
            remaining = rest
        elif len(some) > 1:
            half = len(some) // 2
            return left(left(remaining, some[:half]), some[half:])
        tell("causes", some[-1] + 1, len(items))
        return remaining

    every, before = tuple(range(len(items))), None
    remaining = left(every, every) if every else every
    while remaining != before:
        before = remaining
        for k in before:
            remaining = left(remaining, (k,))
    return tuple(items[k] for k in remaining)


def relaxed(scene: Scene, constraints: Iterable[Constraint], remaining: Iterable[Constraint]) -> Scene:
    """A world without the constraints that are not kept."""
    names = {(one.kind, one.name) for one in remaining}
    for one in constraints:
        if (one.kind, one.name) not in names:
            scene = one.relax(scene)
    return scene
