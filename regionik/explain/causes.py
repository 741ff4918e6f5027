"""Irreducible causes: constraints that rule a task out together, and of which none can be left out."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from regionik.explain.constraints import Constraint
from regionik.planners.progress import track
from regionik.scene import Scene

Closed = Callable[[Scene], bool]


def irreducible(scene: Scene, constraints: Iterable[Constraint], closed: Closed) -> tuple[Constraint, ...]:
    """Constraints that rule a world's task out, and of which none can be left out; none where all can be.

    A deletion filter: constraints are dropped one by one, in their order, where the rest still rules the task
    out (``closed`` is True), all obstacles at once first. It is repeated until nothing more is dropped, as
    areas are rounded.
    """
    every = tuple(constraints)
    kept = tuple(one for one in every if one.kind != "obstacle")
    if not closed(relaxed(scene, every, kept)):
        kept = every
    before = None
    while kept != before:
        before = kept
        for one in track("causes", before):
            rest = tuple(other for other in kept if other is not one)
            if closed(relaxed(scene, every, rest)):
                kept = rest
    return kept


def relaxed(scene: Scene, constraints: Iterable[Constraint], kept: Iterable[Constraint]) -> Scene:
    """A world without the constraints that are not kept."""
    names = {(one.kind, one.name) for one in kept}
    for one in constraints:
        if (one.kind, one.name) not in names:
            scene = one.relax(scene)
    return scene
