"""What can be done of a task: set-points that cannot are left out, refusal by refusal, or all named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from regionik.explain.several import failures_of, in_order, naming_all, numbered, renumbered, together
from regionik.scene import Scene
from regionik.values import Plan, Skipped
from regionik.worlds.errors import Explanation, NoPlanFound, SetpointFailure
from regionik.worlds.strokes import split_strokes

T = TypeVar("T")
Explained = Callable[[Scene, Explanation], Explanation]  # of the world that an explanation is about


def leaving_out(
    scene: Scene, attempt: Callable[[Scene], T], explained: Explained
) -> tuple[T, tuple[Skipped, ...]]:
    """Return what an attempt makes of the set-points of a world that can be done, and the others.

    Raises
    ------
    NoPlanFound
        Where none can be done, or where it is not set-points by themselves that cannot, ``explained``.
    """
    failures = tuple[SetpointFailure, ...]()
    while True:
        left, remaining = _without(scene, failures)
        try:
            return attempt(left), tuple(_skipped(scene, one) for one in failures)
        except NoPlanFound as no:
            found = failures_of(renumbered(no.explanation, remaining, len(scene.task)))
            if not found or len(found) == len(remaining):
                refusal = explained(left, no.explanation)
                raise NoPlanFound(_of_all(scene, failures, refusal, remaining)) from None
            failures = in_order([*failures, *found])


def naming_each(scene: Scene, first: Explanation, attempt: Callable[[Scene], object]) -> Explanation:
    """The first refusal of an attempt, with all the set-points that it refuses, one time after the other."""
    found = [first]
    while failures := failures_of(together(found)):
        left, remaining = _without(scene, failures)
        if not remaining:
            break
        try:
            attempt(left)
            break
        except NoPlanFound as no:
            found.append(renumbered(no.explanation, remaining, len(scene.task)))
            if not failures_of(found[-1]):
                break
    return replace(first, failures=failures)


def as_given(count: int, skipped: Sequence[Skipped]) -> list[int]:
    """Index in a task of ``count`` set-points of each that is not skipped."""
    gone = {one.setpoint for one in skipped}
    return [i for i in range(count) if i not in gone]


def with_skipped(planned: Plan, skipped: tuple[Skipped, ...]) -> Plan:
    """The plan with the set-points that it leaves out, and the index as given of those that it does."""
    if not skipped:
        return planned
    remaining = as_given(len(planned.world.task) + len(skipped), skipped)
    order = [remaining[i] for i in planned.stats.get("order", range(len(remaining)))]
    return replace(planned, stats={**planned.stats, "order": order}, skipped=skipped)


def _without(scene: Scene, failures: Sequence[SetpointFailure]) -> tuple[Scene, list[int]]:
    """The world without some set-points, and the index as given of each that is left.

    Those of a stroke on either side of one that is left out are two strokes.
    """
    gone = {one.setpoint for one in failures}
    remaining = [i for i in range(len(scene.task)) if i not in gone]
    if not gone:
        return scene, remaining
    strokes = split_strokes([target.stroke for target in scene.task], remaining)
    left = (replace(scene.task[i], stroke=stroke) for i, stroke in zip(remaining, strokes, strict=True))
    return scene.changed(task=tuple(left)), remaining


def _skipped(scene: Scene, failure: SetpointFailure) -> Skipped:
    target = scene.task[failure.setpoint]
    split = f" Stroke {target.stroke} is not worked to and from it." * bool(target.stroke)
    return Skipped(failure.setpoint, target, failure.verdict, f"{failure.reason}{split}", failure.code)


def _of_all(
    scene: Scene, failures: Sequence[SetpointFailure], refusal: Explanation, remaining: Sequence[int]
) -> Explanation:
    """A refusal of the set-points that are left, with those that were left out."""
    count = len(scene.task)
    if not failures:
        return refusal
    told = renumbered(refusal, remaining, count)
    out, be = numbered([one.setpoint for one in failures], count), "are" if len(failures) > 1 else "is"
    every = in_order([*failures, *failures_of(told)])
    if len(every) == count:
        return naming_all(replace(told, failures=every), count)
    return replace(told, reason=f"{out} {be} left out. {told.reason}", failures=every)
