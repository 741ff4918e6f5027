"""Two small changes together, where no single one mends a failure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from regionik.explain.causes import irreducible
from regionik.explain.changes import Change, Move, both, share
from regionik.explain.constraints import Constraint
from regionik.explain.minimal_change import circle
from regionik.explain.options import EXPLAIN
from regionik.explain.questions import TargetQuestion
from regionik.planners.progress import track
from regionik.worlds.errors import Repair

OPTIONS = EXPLAIN.pairs


def pair(question: TargetQuestion, causes: Sequence[Constraint]) -> Repair | None:
    """The first of some small changes with which another mends a failure, and the smallest such other."""
    firsts = sorted(_firsts(question, causes), key=lambda one: share(question.scene, one[1]))
    for kind, first in track("pairs", firsts):
        changed = replace(question, scene=question.changed(first))
        found = [other for other in _seconds(changed, kind) if other is not None]
        if found:
            return both(first, min(found, key=lambda other: share(question.scene, other)))
    return None


def _firsts(question: TargetQuestion, causes: Sequence[Constraint]) -> Iterator[tuple[str, Repair]]:
    """Small changes, each with what is changed; the target itself is moved last or not at all."""
    for change in question.changes(causes):
        if isinstance(change, Change):
            for amount in sorted({min(change.most, small) for small in OPTIONS.amounts}):
                repair = change.repair(amount)
                yield _what(repair), repair
        elif isinstance(change, Move) and change.kind == "move-obstacle":
            for length in OPTIONS.amounts:
                for way in circle(OPTIONS.directions):
                    repair = change.repair(length * way)
                    yield _what(repair), repair


def _seconds(question: TargetQuestion, kind: str) -> Iterator[Repair | None]:
    """What mends a changed world by itself, but for more of the same change."""
    causes = irreducible(question.scene, question.constraints, question.closed)
    for change in question.changes(causes):
        if isinstance(change, Change):
            if _what(change.repair(change.most)) != kind:
                yield question.least(change)
        elif isinstance(change, Move) and f"{change.kind} {change.name}" != kind:
            yield question.shortest(change)


def _what(repair: Repair) -> str:
    return f"{repair.kind} {repair.name}"
