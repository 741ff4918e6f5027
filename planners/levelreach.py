"""Reach of any arm on a vertical pivot at one height: distances proven to be in reach, and those that may be.

The pivot turns without end, as the base turns where it cannot, so reach is a matter of distance from the
pivot axis. Lifts before the pivot are joints like the others.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from regionik.planners.levelwalk import walks
from regionik.planners.meridian import Meridian, meridian_of, tool_for
from regionik.planners.ruledout import bounded
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.pivot import span_of

Intervals = tuple[tuple[float, float], ...]

BATCH, MOST_BATCHES = 24, 6  # postures that walks start from; the last batch is one that adds nothing
NEWS = 1e-4  # what a batch must add for another to follow [m]
MOST_STEPS = 300  # of one walk
MOST_BOXES = 20_000  # weighed for an outer bound, a few microseconds each
ENOUGH = 1e-3  # what the outer bound may stand off from the inner one [m]


@lru_cache(maxsize=4096)
def inner_reach(chain: Chain, height: float, z: float) -> Intervals:
    """Distances between pivot axis and target that are proven to be in reach, as ascending intervals.

    Every distance of an interval is that of some posture within the limits (`planners.levelwalk`), but for
    rounding far below a nanometre. What walks from some 50 to 150 postures have not met is missing.

    Parameters
    ----------
    chain : Chain
    height : float
        Of the arm's base frame over the floor [m].
    z : float
        Height of the target over the floor [m].

    Raises
    ------
    InputError
        When the arm has no vertical pivot, or a sliding joint has no end.

    Examples
    --------
    >>> from regionik.worlds.bundled import robot_named
    >>> [[round(end, 3) for end in ring] for ring in inner_reach(robot_named("hinge5").chain, 0.0, 0.068)]
    [[0.0, 0.272]]
    """
    meridian = _meridian(chain)
    if meridian is None:
        return ()
    tool, rng = tool_for(meridian), np.random.default_rng(0)
    low, high = finite_limits(meridian)
    found: Intervals = ()
    for _ in range(MOST_BATCHES):
        passed = np.empty((BATCH, 2))
        starts = rng.uniform(low, high, (BATCH, len(low)))
        count = walks(meridian, z - height, starts, tool, MOST_STEPS, passed)
        more = merged([*found, *passed[:count].tolist()])
        news = _length(more) - _length(found)
        found = more
        if found and news < NEWS:
            break
    return found


@lru_cache(maxsize=4096)
def outer_reach(chain: Chain, height: float, z: float) -> Intervals:
    """Distances between pivot axis and target that are not proven to be out of reach; see `inner_reach`.

    No posture within the limits has any other distance. A budget of boxes (`planners.ruledout`) bounds the
    work: with it spent, what is undecided stays in.
    """
    meridian, span = _meridian(chain), span_of(chain)
    square = span.length**2 - (z - height - span.height) ** 2
    if square < 0:
        return ()
    cap = span.radius + float(np.sqrt(square))
    known = np.array(inner_reach(chain, height, z)).reshape(-1, 2)
    if meridian is None:
        return ((0.0, cap),)
    low, high = finite_limits(meridian)
    left = bounded(meridian, z - height, low, high, known, cap, ENOUGH, MOST_BOXES)
    return merged([*known.tolist(), *left.tolist()])


def finite_limits(meridian: Meridian) -> tuple[Array, Array]:
    """The limits, with one turn for joints that turn all round."""
    return (
        np.where(np.isfinite(meridian.lower), meridian.lower, -np.pi),
        np.where(np.isfinite(meridian.upper), meridian.upper, np.pi),
    )


def merged(intervals: list[list[float]] | list[tuple[float, float]]) -> Intervals:
    """The union of intervals, ascending and apart."""
    union: list[tuple[float, float]] = []
    for low, high in sorted((float(low), float(high)) for low, high in intervals):
        if union and low <= union[-1][1]:
            union[-1] = union[-1][0], max(high, union[-1][1])
        else:
            union.append((low, high))
    return tuple(union)


def _meridian(chain: Chain) -> Meridian | None:
    span_of(chain)  # refuses what has no bound
    return meridian_of(chain)


def _length(intervals: Intervals) -> float:
    return sum(high - low for low, high in intervals)
