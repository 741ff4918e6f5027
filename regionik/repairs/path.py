"""Why a path cannot be done: an irreducible set of causes, and the smallest repairs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from regionik.areas.relaxations import (
    LIFT_OFFS,
    START,
    Constraint,
    constraints_of,
    with_clearance,
    with_lift_offs,
    with_mast,
    with_obstacle_moved,
    without_start,
)
from regionik.areas.standing import turns_matter
from regionik.reasons.causes import irreducible
from regionik.repairs.least import FINE, circle
from regionik.repairs.moves import obstacle_repair, on_grid
from regionik.repairs.smallest import clearance_repair, left, raise_repair, smallest_first
from regionik.repairs.target import arm_too_short, cause_of, mended, together
from regionik.repairs.trials import repaired
from regionik.worlds.errors import Explanation, Repair
from regionik.worlds.pivoted_arm import reach_bound
from regionik.worlds.scene import World

_DIRECTIONS = 8  # in which obstacles are moved
_STEPS = 12
_SLACK = (1.0, 1.05)  # of what areas ask for, tried in plans

Asked = Callable[[World], bool]


def why_path(world: World, quick: Explanation, spans: Asked, holds: Asked) -> Explanation:
    """Causes and repairs of a path that the ladder of areas does not span.

    Parameters
    ----------
    world : World
    quick : Explanation
        What is known of it already; its reason stays, and its margins.
    spans, holds : callable
        Whether the areas of a world span its path, and whether it can be planned.
    """
    every = list(constraints_of(world))
    if world.start is not None and world.rules.heading != "fixed":
        every.insert(0, Constraint("floor", START, without_start))
    if world.rules.max_lift_offs is not None:
        every.insert(0, Constraint("path", LIFT_OFFS, lambda before: with_lift_offs(before, None)))
    kept = irreducible(world, every, lambda changed: not spans(changed))
    found = [one for one in _repairs(world, quick, kept, spans) if holds(repaired(world, one))]
    first = {(one.kind, one.name): one for one in reversed(found)}
    repairs = smallest_first(world, list(first.values()))
    causes = tuple(cause_of(one, quick) for one in kept) or (arm_too_short(world, quick),)
    reason = " ".join([quick.reason, together(world, kept, proven=False), mended(repairs)]).strip()
    return replace(quick, reason=reason, causes=causes, repairs=repairs)


def _repairs(world: World, quick: Explanation, kept: Sequence[Constraint], spans: Asked) -> Iterator[Repair]:
    """Single changes after which the areas span the path; of each kind and name first the smallest.

    Where headings decide on where the base may stand a look at a path takes seconds: then obstacles and the
    mount stay where they are.
    """
    yield from _lift_offs(world, quick, kept, spans)
    yield from _clearances(world, spans)
    if turns_matter(world):
        return
    for one in kept:
        if one.kind == "obstacle" and spans(one.relax(world)):
            yield from _moves(world, one.name, spans)
    rise = _least(lambda rise: spans(with_mast(world, rise)), reach_bound(world.robot.chain).length)
    if rise is not None:
        yield from (raise_repair(world, float(on_grid(np.array(rise * slack)))) for slack in _SLACK)


def _lift_offs(
    world: World, quick: Explanation, kept: Sequence[Constraint], spans: Asked
) -> Iterator[Repair]:
    """As many more lift-offs as it takes."""
    allowed = world.rules.max_lift_offs
    if all(one.name != LIFT_OFFS for one in kept) or allowed is None or quick.setpoint is None:
        return
    counts = range(1, len(world.task) - allowed)
    more = next((n for n in counts if spans(with_lift_offs(world, allowed + n))), None)
    if more is not None:
        at = f"set-point {quick.setpoint + 1}"
        text = f"allow a lift-off before {at}" if more == 1 else f"allow {more} more, the first before {at}"
        yield Repair("lift-off", at, float(more), text, "1")


def _clearances(world: World, spans: Asked) -> Iterator[Repair]:
    most = world.rules.clearance
    if most == 0 or not world.solids or not spans(with_clearance(world, 0.0)):
        return
    low, high = 0.0, most
    while high - low > max(FINE, 0.01 * high):  # the less, the more room
        middle = (low + high) / 2
        low, high = (low, middle) if spans(with_clearance(world, left(most, middle))) else (middle, high)
    yield from (clearance_repair(world, left(most, min(most, high * slack))) for slack in _SLACK)


def _moves(world: World, name: str, spans: Asked) -> Iterator[Repair]:
    """An obstacle moved in the direction in which that helps first."""
    x0, y0, x1, y1 = world.floor.polygon.bounds
    far = float(np.hypot(x1 - x0, y1 - y0)) / 2
    best, way = far, None
    for other in circle(_DIRECTIONS):

        def opens(length: float, other: np.ndarray = other) -> bool:
            return spans(with_obstacle_moved(world, name, on_grid(length * other)))

        found = _least(opens, best)
        if found is not None and (way is None or found < best):
            best, way = found, other
    if way is not None:
        yield from (obstacle_repair(name, on_grid(best * slack * way)) for slack in _SLACK)


def _least(opens: Callable[[float], bool], most: float) -> float | None:
    """Least length that helps, by a scan and bisection, for what is dear to ask."""
    step = most / _STEPS
    k = next((k for k in range(1, _STEPS + 1) if opens(k * step)), None)
    if k is None:
        return None
    low, high = (k - 1) * step, k * step
    while high - low > max(FINE, 0.01 * high):
        middle = (low + high) / 2
        low, high = (low, middle) if opens(middle) else (middle, high)
    return high
