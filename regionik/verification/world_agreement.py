"""A plan's own world against one from outside: what holds in the one holds in the other where they agree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from regionik.values import Plan, Violation
from regionik.verification.derived_fields import is_order
from regionik.verification.proofs import Finding, finding
from regionik.verification.tolerances import EXACT
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.readers.text import clip
from regionik.worlds.scene import Target, World
from regionik.worlds.strokes import within_strokes

PARTS = ("robot", "floor", "obstacles", "zones", "start", "rules")
# what is only drawn; what was left out is told by itself; a plan holds however it was made
PASSED_OVER = ("visuals", "skip_unreachable", "smooth")
_MISSING = object()


def verify_world(plan: Plan, world: World) -> Finding:
    """The plan's world is the one given, in all that a plan has to hold in.

    Names, pictures and what messages are called do not matter, nor do speeds that the world leaves open or
    that a plan without times does not have. Where the rules allow any order the set-points may have changed
    places.
    """
    texts = [*_different_parts(plan, world), *_different_tasks(plan, world)]
    return finding("world", np.inf, [Violation("world", None, None, 0.0, text) for text in texts])


def _different_parts(plan: Plan, world: World) -> Iterator[str]:
    ours, theirs = world_to_document(plan.world), world_to_document(world)
    for part in PARTS:
        yield from _differences(part, ours.get(part, _MISSING), theirs.get(part, _MISSING))
    if world.speeds is not None and not np.isnan(plan.motion.time).all():
        yield from _differences("speeds", ours.get("speeds", _MISSING), theirs["speeds"])


def _differences(place: str, ours: Any, theirs: Any) -> Iterator[str]:
    """What differs between plain values, place by place."""
    if ours is _MISSING or theirs is _MISSING:
        if ours is not theirs:
            yield f"{place}: only in the {'world' if ours is _MISSING else 'plan'}"
    elif isinstance(ours, Mapping) and isinstance(theirs, Mapping):
        for key in [*ours, *(key for key in theirs if key not in ours)]:
            if key not in PASSED_OVER:
                yield from _differences(f"{place}.{key}", ours.get(key, _MISSING), theirs.get(key, _MISSING))
    elif _are_named(ours) and _are_named(theirs):
        yield from _differences(place, *({one["name"]: one for one in some} for some in (ours, theirs)))
    elif isinstance(ours, list) and isinstance(theirs, list) and len(ours) == len(theirs):
        for k, (one, other) in enumerate(zip(ours, theirs, strict=True)):
            yield from _differences(f"{place}[{k}]", one, other)
    elif not _same(ours, theirs):
        yield f"{place}: {_said(ours)} in the plan, {_said(theirs)} in the world"


def _are_named(values: Any) -> bool:
    """Return whether values are a list of parts, each of a name of its own."""
    if not isinstance(values, list) or not all(isinstance(one, Mapping) and "name" in one for one in values):
        return False
    return len({one["name"] for one in values}) == len(values)


def _same(ours: Any, theirs: Any) -> bool:
    numbers = all(isinstance(one, int | float) and not isinstance(one, bool) for one in (ours, theirs))
    return abs(ours - theirs) <= EXACT if numbers else bool(ours == theirs)


def _said(value: Any) -> str:
    if isinstance(value, list):
        return f"{len(value)} of them"
    return "none" if value is None else clip(value)


def _different_tasks(plan: Plan, world: World) -> Iterator[str]:
    ours, theirs = [*plan.world.task, *(one.target for one in plan.skipped)], world.task
    if len(ours) != len(theirs):
        yield f"task: {len(ours)} set-points in the plan, {len(theirs)} in the world"
        return
    order = _order(plan, ours, theirs)
    yield from _different_strokes(plan, order, world)
    yield from _differently_worked(plan, order, world)
    for k, (i, target) in enumerate(zip(order, ours, strict=True)):
        asked = theirs[i]
        for what in ("position", "direction", "orientation", "cone"):
            one, other = getattr(target, what), getattr(asked, what)
            if (one is None) != (other is None) or (one is not None and np.abs(one - other).max() > EXACT):
                said = (
                    clip(None if value is None else np.round(value, 9).tolist()) for value in (one, other)
                )
                yield f"task: set-point {k + 1}: {what}: {next(said)} in the plan, {next(said)} in the world"


def _different_strokes(plan: Plan, order: Sequence[int], world: World) -> Iterator[str]:
    """Where the tool works its way from one set-point to the next in the plan or the world alone."""
    task = plan.world.task
    ours, theirs = (within_strokes([one.stroke for one in some]) for some in (task, world.task))
    for k, (i, target) in enumerate(zip(order[: len(task)], task, strict=True)):
        kinds = [None if one.stroke is None else one.stroke > 0 for one in (target, world.task[i])]
        follows = k > 0 and order[k - 1] == i - 1
        if kinds[0] != kinds[1] or ours[k] != (follows and theirs[i]):
            said = [one.stroke for one in (target, world.task[i])]
            yield f"task: set-point {k + 1}: stroke: {said[0]} in the plan, {said[1]} in the world"


def _differently_worked(plan: Plan, order: Sequence[int], world: World) -> Iterator[str]:
    """Where the plan has another flow to a set-point than the world or, if it is timed, another speed."""
    kinds = ("flow", "lead") if np.isnan(plan.motion.time).all() else ("flow", "lead", "speed")
    for k, (i, target) in enumerate(zip(order, plan.world.task, strict=False)):
        for what in kinds:
            one, other = getattr(target, what), getattr(world.task[i], what)
            if one != other:
                said = f"{_said(one)} in the plan, {_said(other)} in the world"
                yield f"task: set-point {k + 1}: {what}: {said}"


def _order(plan: Plan, done: Sequence[Target], task: Sequence[Target]) -> Sequence[int]:
    """Index in a task of each set-point, done or left out: as the plan says, or else by where they lie."""
    order = plan.stats.get("order")
    if order is not None and is_order(said := [*order, *(one.setpoint for one in plan.skipped)], len(task)):
        return said
    if plan.world.rules.order == "given":
        return range(len(task))
    ours, theirs = ([(*one.position.tolist(), k) for k, one in enumerate(some)] for some in (done, task))
    found = dict(zip((k for *_, k in sorted(ours)), (k for *_, k in sorted(theirs)), strict=True))
    return [found[k] for k in range(len(task))]
