"""Rows of the table of speeds: what was timed, how it spreads, and whether it is what was wanted.

A claim of speed is a ratio of two things timed in turns in one process, so that whatever else the machine
does slows both. A row holds the spread of that ratio over the rounds, not a ratio of two spreads.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

Work = Callable[[], object]
SECONDS = 0.05  # a round of one side lasts at least about this long, calls repeated as it takes


@dataclass(frozen=True)
class Spread:
    """Median and quartiles over the rounds."""

    median: float
    low: float
    high: float
    rounds: int

    @classmethod
    def of(cls, values: list[float]) -> Spread:
        low, median, high = np.percentile(values, [25, 50, 75])
        return cls(float(median), float(low), float(high), len(values))


@dataclass(frozen=True)
class Wanted:
    """A bound that the figure of a row must keep; ``unit`` follows the figure in the table."""

    bound: float
    at_least: bool = True
    unit: str = "×"

    def met(self, figure: float) -> bool:
        return figure >= self.bound if self.at_least else figure <= self.bound

    @property
    def text(self) -> str:
        return f"at {'least' if self.at_least else 'most'} {self.bound:,.6g} {self.unit}".rstrip()


@dataclass(frozen=True)
class Row:
    """One row: seconds of ours and theirs for one piece of work, and the figure that is judged.

    ``ours``, ``theirs`` and ``figure`` are None where they were not measured; ``note`` then says why. A
    missed row says in ``note`` where the time goes.
    """

    what: str
    rival: str
    ours: Spread | None
    theirs: Spread | None
    figure: Spread | None
    wanted: Wanted | None
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the median is what was wanted; None where nothing was wanted or measured."""
        if self.wanted is None or self.figure is None:
            return None
        return self.wanted.met(self.figure.median)


@dataclass(frozen=True)
class Size:
    """How much is measured: rounds of every pair, and the share of the full amount of work."""

    rounds: int = 15
    share: float = 1.0

    def count(self, full: int) -> int:
        """``full`` cases, or the share of them, one at least."""
        return max(1, round(self.share * full))


Rows = Callable[[Size], Iterator[Row]]


def against(
    what: str,
    rival: str,
    ours: Work,
    theirs: Work,
    wanted: Wanted | None,
    size: Size,
    *,
    pieces: tuple[int, int] = (1, 1),
    note: str = "",
) -> Row:
    """Time two things in turns.

    Parameters
    ----------
    what, rival, note : str
    ours, theirs : callable
        Each does its work once; they need not do equally many pieces.
    wanted : Wanted or None
        Bound of theirs / ours.
    size : Size
    pieces : (int, int)
        Pieces of work that a call of ours and of theirs does; seconds are of one piece.
    """
    repeats = [_repeats(work) for work in (ours, theirs)]
    spent: tuple[list[float], list[float]] = ([], [])
    for k in range(size.rounds):
        for side in (0, 1) if k % 2 == 0 else (1, 0):  # neither always comes second
            work = (ours, theirs)[side]
            spent[side].append(_timed(work, repeats[side]) / (repeats[side] * pieces[side]))
    ratios = [b / a for a, b in zip(*spent, strict=True)]
    return Row(what, rival, Spread.of(spent[0]), Spread.of(spent[1]), Spread.of(ratios), wanted, note)


def timed(what: str, rival: str, ours: Work, wanted: Wanted | None, size: Size, note: str = "") -> Row:
    """Seconds of one thing alone, judged as they are."""
    repeats = _repeats(ours)
    spread = Spread.of([_timed(ours, repeats) / repeats for _ in range(size.rounds)])
    return Row(what, rival, spread, None, spread, wanted, note)


def counted(what: str, rival: str, values: list[float], wanted: Wanted | None, note: str = "") -> Row:
    """Figures that are no times: lengths, slopes, bytes."""
    return Row(what, rival, None, None, Spread.of(values), wanted, note)


def absent(what: str, rival: str, wanted: Wanted | None, why: str) -> Row:
    """A row that could not be measured here."""
    return Row(what, rival, None, None, None, wanted, f"absent: {why}")


def _repeats(work: Work) -> int:
    """Calls that fill a round; the first calls also compile and warm."""
    work()
    count = 1
    while (spent := _timed(work, count)) < SECONDS / 4:
        count *= 2
    return max(1, round(count * SECONDS / spent))


def _timed(work: Work, repeats: int) -> float:
    collected = gc.isenabled()
    gc.disable()
    try:
        begun = time.perf_counter()
        for _ in range(repeats):
            work()
        return time.perf_counter() - begun
    finally:
        if collected:
            gc.enable()
