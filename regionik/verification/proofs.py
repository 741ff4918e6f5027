"""Proofs by bisection over parts of segments, and the findings that checks report."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from regionik.values import Motion, Violation
from regionik.verification.motion import Indices, Mask
from regionik.verification.options import VERIFICATION
from regionik.worlds.arrays import Array

OPTIONS = VERIFICATION.proofs


class Intervals(NamedTuple):
    """Parts of segments: from ``low`` to ``high`` in [0, 1] of the segment that belongs to ``item``."""

    item: Indices
    low: Array
    high: Array

    @property
    def middle(self) -> Array:
        return (self.low + self.high) / 2

    @property
    def length(self) -> Array:
        return self.high - self.low

    def take(self, which: Mask | slice) -> Intervals:
        return Intervals(self.item[which], self.low[which], self.high[which])

    def halves(self) -> Intervals:
        return Intervals(
            np.concatenate([self.item, self.item]),
            np.concatenate([self.low, self.middle]),
            np.concatenate([self.middle, self.high]),
        )


class IntervalVerdicts(NamedTuple):
    """Verdicts on intervals; one that is neither proven nor refuted is halved unless it is too short."""

    proven: Mask
    refuted: Mask
    too_short: Mask


def bisect(count: int, examine: Callable[[Intervals], IntervalVerdicts]) -> dict[int, float]:
    """Bisect items, each a whole segment, until every part is proven, refuted or too short.

    Parts of a refuted item are not examined again. Returned is where each item that is not proven failed, as
    a share of its segment: first the refuted ones.
    """
    refuted: dict[int, float] = {}
    given_up: dict[int, float] = {}
    intervals = Intervals(np.arange(count), np.zeros(count), np.ones(count))
    while len(intervals.item):
        starts = range(0, len(intervals.item), OPTIONS.intervals_at_once)
        blocks = [intervals.take(slice(k, k + OPTIONS.intervals_at_once)) for k in starts]
        columns = zip(*(examine(block) for block in blocks), strict=True)
        verdicts = IntervalVerdicts(*(np.concatenate(column) for column in columns))
        failed = verdicts.refuted & ~verdicts.proven
        short = verdicts.too_short & ~verdicts.proven & ~failed
        for found, which in ((refuted, failed), (given_up, short)):
            rows = zip(intervals.item[which].tolist(), intervals.middle[which].tolist(), strict=True)
            for item, s in rows:
                found.setdefault(item, s)
        still_open = ~verdicts.proven & ~short & ~np.isin(intervals.item, list(refuted))
        intervals = intervals.take(still_open).halves()
    return refuted | {item: s for item, s in given_up.items() if item not in refuted}


class Finding(NamedTuple):
    """The result of one check; ``margin`` is infinite where there was nothing to measure."""

    kind: str
    margin: float  # [m] or [rad]
    violations: tuple[Violation, ...]


def finding(kind: str, margin: float, violations: Iterable[Violation]) -> Finding:
    """Finding with its violations in the order of the motion; those past the first 20 become one."""
    found = sorted(violations, key=lambda v: -1 if v.state is None else v.state)
    least = min([margin, *(-v.amount for v in found)])
    rest = found[OPTIONS.max_violations :]
    if rest:
        worst = max(rest, key=lambda v: v.amount)
        text = f"{len(rest)} more violations of this kind ({kind}); the worst of them: {worst.text}"
        more = Violation(kind, worst.state, worst.setpoint, worst.amount, text)
        found = [*found[: OPTIONS.max_violations], more]
    return Finding(kind, least, tuple(found))


class StateNames(NamedTuple):
    """Names of states and set-points in messages, which count from 1."""

    motion: Motion
    total: int  # set-points of the task

    def setpoint(self, i: int) -> str:
        return f"set-point {i + 1} of {self.total}"

    def owner(self, state: int) -> int | None:
        """The set-point that a state belongs to, or else the next one."""
        owners = self.motion.setpoint[state:]
        known = owners[owners >= 0]
        return int(known[0]) if len(known) else None

    def state(self, state: int) -> str:
        return self._near_setpoint(f"at state {state + 1} of {len(self.motion)}", state)

    def segment(self, state: int) -> str:
        where = f"between states {state + 1} and {state + 2} of {len(self.motion)}"
        return self._near_setpoint(where, state)

    def _near_setpoint(self, where: str, state: int) -> str:
        i = self.owner(state)
        if i is None:
            return where
        if self.motion.kind[state] == "setpoint":
            return f"{where} ({self.setpoint(i)})"
        near = "before" if int(self.motion.setpoint[state]) < 0 else "near"
        return f"{where} ({near} {self.setpoint(i)})"
