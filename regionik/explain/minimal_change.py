"""Least amount of a change that helps: a scan, a bisection, and a check by the deciding oracle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regionik.explain.options import EXPLAIN
from regionik.worlds.arrays import Array

OPTIONS = EXPLAIN.amounts


Opens = Callable[[Array], NDArray[np.bool_]]  # mask of the amounts (n,), or steps (n, d), that help
Holds = Callable[[float], bool]  # True for an amount that helps


def least_open(opens: Opens, most: float) -> float | None:
    """Least amount that helps, to the grid; None where none of those looked at does.

    More need not help more: a first scan takes every 64th of ``most``, and amounts below the one found are
    scanned again in steps of a hundredth of it.

    Examples
    --------
    >>> round(least_open(lambda amounts: amounts > 0.3, 2.0), 3)
    0.3
    """
    found = _first(opens, 0.0, most, OPTIONS.scan_steps)
    while found is not None:
        low, high = found
        while high - low > EXPLAIN.grid / 2:
            low, high = _first(opens, low, high, OPTIONS.refined_steps) or (high, high)
        below, steps = high * (1 - OPTIONS.recheck_share), round(1 / OPTIONS.recheck_share)
        found = _first(opens, 0.0, below, steps) if high > EXPLAIN.grid else None
        if found is None:
            return high
    return None


def _first(opens: Opens, low: float, high: float, steps: int) -> tuple[float, float] | None:
    """The first of even steps that helps, and the one before it."""
    amounts = np.linspace(low, high, steps + 1)
    helps = opens(amounts[1:])
    if not helps.any():
        return None
    k = int(np.argmax(helps))
    return float(amounts[k]), float(amounts[k + 1])


def grid_above(amount: float) -> float:
    """The next amount on the grid."""
    return round(float(np.ceil(amount / EXPLAIN.grid - 1e-6)) * EXPLAIN.grid, 6)


@dataclass(frozen=True)
class Scan:
    """A scan of even amounts until one helps, and a bisection down from there."""

    steps: int
    fine: float  # width at which the bisection ends
    close: float  # the same as a part of the amount, where that is more
    # Rounding of an amount to the one that is tried, such as the next on a grid
    snap: Callable[[float], float] = float

    def first(self, helps: Holds, most: float) -> float | None:
        """Return the least amount up to ``most`` found to help; None where none of the even ones does.

        Examples
        --------
        >>> round(Scan(24, 1e-3, 0.0).first(lambda amount: amount > 0.3, 2.0), 2)
        0.3
        """
        step = most / self.steps
        tried = [k * step for k in range(self.steps + 1)]
        k = next((k for k in range(1, self.steps + 1) if helps(self.snap(tried[k]))), None)
        return None if k is None else self.narrowed(helps, tried[k - 1], self.snap(tried[k]))

    def narrowed(self, helps: Holds, low: float, high: float) -> float:
        """Return the least amount by bisection between one that does not help and one that does."""
        while high - low > max(self.fine, self.close * high):
            middle = self.snap((low + high) / 2)
            low, high = (low, middle) if helps(middle) else (middle, high)
        return high


GRID_SCAN = Scan(OPTIONS.steps_per_direction, 1.5 * EXPLAIN.grid, OPTIONS.missed_share, grid_above)


def confirmed(holds: Holds, amount: float, most: float, seen: Holds | None = None) -> float | None:
    """Least amount near to a given one that holds, on the grid but for ``most`` itself.

    ``holds`` decides; it is more expensive than the test that the amount was found by, above all where it
    fails, and may be stricter or laxer. Where ``seen`` is given, a faster and stricter test, that leads to an
    amount, and ``holds`` is asked for that one and for a little less. A few hundredths less than what is
    found do not hold. None where up to twice the amount, or the most that is tried, nothing does.
    """
    tried = sorted({min(grid_above(amount * factor), most) for factor in OPTIONS.growth})
    if seen is not None:
        tried = _holding_amounts(seen, tried)
    k = next((k for k, one in enumerate(tried) if holds(one)), len(tried))
    if k == len(tried):
        return None
    if k:
        return GRID_SCAN.narrowed(holds, tried[k - 1], tried[k])
    below = grid_above(OPTIONS.confirmed_share * tried[0] - EXPLAIN.grid)
    if below <= 0 or below >= tried[0] or not holds(below):
        return tried[0]
    return GRID_SCAN.narrowed(holds, 0.0, below)


def _holding_amounts(seen: Holds, tried: list[float]) -> list[float]:
    """Amounts from the least on that is seen to hold; the most of all where none is."""
    k = next((k for k, one in enumerate(tried) if seen(one)), None)
    if k is None:
        return tried[-1:]
    return [GRID_SCAN.narrowed(seen, tried[k - 1] if k else 0.0, tried[k]), *tried[k + 1 :]]


def shortest_step(opens: Opens, directions: Array, most: float) -> tuple[float, Array] | None:
    """Length and direction of a short step that helps: along one of some, or beside the best of them.

    Directions (m, d) have length 1, d is 2 or 3, and ``most`` bounds the step. The length is least along its
    direction, as `least_open` has it; no direction is proven to be best.
    """
    low, high = 0.0, most
    first = _coarse(opens, directions, low, high)
    if first.min() == OPTIONS.steps_per_direction:
        return None
    while True:
        step = (high - low) / OPTIONS.steps_per_direction
        low, high = low + step * first.min(), low + step * (first.min() + 1)
        if (first == first.min()).sum() <= OPTIONS.max_close_directions or step < EXPLAIN.grid:
            break
        first = _coarse(opens, directions, low, high)  # look closer, until few are foremost
    best, way = high, directions[int(np.argmin(first))]
    for other in directions[np.argsort(first, kind="stable")[: OPTIONS.max_close_directions]]:
        best, way = _shorter(opens, other, best, way)
    for turn in OPTIONS.turns:
        beside = _beside(way, turn)
        for other in beside[opens(best * (1 - OPTIONS.recheck_share) * beside)]:
            best, way = _shorter(opens, other, best, way)
    return best, way


def first_seen(
    opens: Opens, sees: Callable[[Array], bool], directions: Array, low: float, high: float
) -> tuple[float, Array] | None:
    """Length and direction of a step between two lengths that passes an expensive test, if one does.

    ``sees`` is asked of a few steps (d,) of each length, evenly chosen among those (n, d) that ``opens``.
    """
    for length in np.geomspace(low, high, OPTIONS.slow_lengths + 2)[1:-1].tolist():
        ways = directions[opens(length * directions)]
        for way in ways[:: max(1, -(-len(ways) // OPTIONS.max_slow_tests))]:
            if sees(length * way):
                return length, way
    return None


def _coarse(opens: Opens, directions: Array, low: float, high: float) -> NDArray[np.intp]:
    """First of even steps along each direction that helps; the number of steps where none does."""
    count = OPTIONS.steps_per_direction
    steps = np.linspace(low, high, count + 1)[1:, None] * directions[:, None, :]
    table = opens(steps.reshape(-1, directions.shape[1])).reshape(len(directions), count)
    return np.where(table.any(axis=1), table.argmax(axis=1), count)


def _shorter(opens: Opens, other: Array, best: float, way: Array) -> tuple[float, Array]:
    """The shorter of the best step so far and the least along another direction."""
    found = least_open(lambda amounts: opens(amounts[:, None] * other), best)
    return (best, way) if found is None or found >= best else (found, other)


def _beside(way: Array, turn: float) -> Array:
    """Directions at an angle from one: two on the floor, eight in space."""
    if len(way) == 2:
        across = np.array([[-way[1], way[0]], [way[1], -way[0]]])
    else:
        u = np.cross(way, np.eye(3)[int(np.argmin(np.abs(way)))])
        u /= np.linalg.norm(u)
        c = circle(8)
        across = c[:, :1] * u + c[:, 1:] * np.cross(way, u)
    return np.cos(turn) * way + np.sin(turn) * across


def circle(count: int) -> Array:
    """Even directions on the floor, (count, 2)."""
    turn = 2 * np.pi / count * np.arange(count)
    return np.column_stack([np.cos(turn), np.sin(turn)])


def sphere(count: int) -> Array:
    """Nearly even directions in space, (count + 2, 3): up, down, and a spiral of golden angles."""
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    flat = np.sqrt(1 - z**2)
    spiral = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    return np.vstack([[[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], spiral])
