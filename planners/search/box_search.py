"""Branch and bound over boxes: queue, bisection, budget and verdict.

A *judge* decides whether one box, n intervals, is proven, ruled out or open. It may contract the box in place
to what is not ruled out. Open boxes wait in a queue; the one with the largest key is bisected, across the
side that its judge named, and both halves are judged. The intervals may be of joint values, distances,
headings, or of anything else a judge can bound.

`begin` and `explore` take any Python function as the judge. Kernels call them as `begin_in_kernel` and
`explore_in_kernel` with a compiled judge::

    @compiled
    def explore_disc(disc: Disc, boxes: Boxes, budget: int) -> Boxes:
        return explore_in_kernel(judge_disc, disc, boxes, budget, 1)

Source: set inversion by interval analysis (Jaulin and Walter, Automatica 29(4), 1993), best box first.

>>> import numpy as np
>>> def judge(least, low, high):  # where is x^2 at least so much?
...     if min(low[0] ** 2, high[0] ** 2) >= least:
...         return Verdict.PROVEN, 0.0, NO_SIDE
...     open_ = max(low[0] ** 2, high[0] ** 2) >= least
...     return Verdict.OPEN if open_ else Verdict.RULED_OUT, high[0] - low[0], 0
>>> boxes = begin(judge, 2.0, np.array([[0.0]]), np.array([[2.0]]))
>>> boxes = explore(judge, 2.0, boxes, budget=10, wanted=10)
>>> verdict_of(boxes).name, [boxes.low[slot].tolist() for slot in proven(boxes)]
('PROVEN', [[1.5], [1.4375]])
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from numba import njit
from numba.extending import register_jitable

from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index

_INITIAL_SLOTS = 16  # for boxes; doubled when they are full
NO_SIDE = -1  # in place of a side: the box is not to be bisected
PROOF_SLACK = 1e-10  # rounding that no proof may rest on [m] or [rad]
QUEUED, CLOSED, JUDGED, PROVEN = range(4)  # what is counted


class Verdict(IntEnum):
    """Verdict on a box, or on all that a search was asked about.

    RULED_OUT is a proof that there is no solution, PROVEN that there is one; OPEN is neither.
    """

    RULED_OUT = -1
    OPEN = 0
    PROVEN = 1


_Problem = TypeVar("_Problem")
Judge = Callable[[_Problem, Array, Array], tuple[Verdict, float, int]]
Function = TypeVar("Function", bound=Callable[..., Any])


class Boxes(NamedTuple):
    """The boxes of a search that are not ruled out, in c slots."""

    low: Array  # (c, n)
    high: Array  # (c, n)
    key: Array  # (c,) the largest is bisected first
    side: Index  # (c,) which one to bisect, or `NO_SIDE`
    verdict: Index  # (c,)
    order: Index  # (c,) slots: those queued, as a heap; free ones; from the end on those closed, in turn
    tally: Index  # (4,) boxes `QUEUED` and `CLOSED` now, `JUDGED` so far, and `PROVEN` among those closed


# For kernels as well as for Python. All that decides on rounding is stated, see `compiled`.
_shared = register_jitable(error_model="python", fastmath=False)


def begin(judge: Judge[_Problem], problem: _Problem, low: Array, high: Array) -> Boxes:
    """Judge the boxes (k, n) that a search starts from."""
    boxes = _empty(low.shape[1])
    for k in range(len(low)):
        boxes = _with_room(boxes)
        lower, upper = low[k].copy(), high[k].copy()
        verdict, key, side = judge(problem, lower, upper)
        _record(boxes, lower, upper, verdict, key, side)
    return boxes


def explore(judge: Judge[_Problem], problem: _Problem, boxes: Boxes, budget: int, wanted: int) -> Boxes:
    """Bisect the box with the largest key and judge both halves, again and again.

    Parameters
    ----------
    judge : callable
        Takes the problem and a box, as (n,), (n,) arrays that it may contract; returns verdict, key and the
        side to bisect.
    problem : anything
        Data for the judge.
    boxes : Boxes
        From `begin`, or from an earlier call; overwritten.
    budget : int
        Boxes judged, after which none is bisected.
    wanted : int
        Boxes proven, after which none is bisected.

    Returns
    -------
    Boxes
        With more slots where these were needed.
    """
    tally = boxes.tally
    while tally[QUEUED] > 0 and tally[JUDGED] < budget and tally[PROVEN] < wanted:
        boxes = _with_room(boxes)
        slot = _pop(boxes)
        side = boxes.side[slot]
        low, high = boxes.low[slot].copy(), boxes.high[slot].copy()
        middle = 0.5 * (low[side] + high[side])
        if not low[side] < middle < high[side]:
            _close(boxes)
            continue
        for half in range(2):
            lower, upper = low.copy(), high.copy()
            if half == 0:
                upper[side] = middle
            else:
                lower[side] = middle
            verdict, key, cut = judge(problem, lower, upper)
            _record(boxes, lower, upper, verdict, key, cut)
    return boxes


def _for_kernels(function: Function) -> Function:
    """Inline a function into kernels, so that they call the judge by its name.

    As a call it would take the judge's address, and numba caches nothing of that kind on disk.
    """
    kernel: Any = njit(inline="always", error_model="python", fastmath=False)(function)
    return cast(Function, kernel)


begin_in_kernel, explore_in_kernel = _for_kernels(begin), _for_kernels(explore)


@_shared
def verdict_of(boxes: Boxes) -> Verdict:
    """Verdict of a whole search."""
    if boxes.tally[PROVEN] > 0:
        return Verdict.PROVEN
    return Verdict.OPEN if boxes.tally[QUEUED] + boxes.tally[CLOSED] > 0 else Verdict.RULED_OUT


@_shared
def both(a: Verdict, b: Verdict) -> Verdict:
    """Verdict on two conditions together: ruled out where either is, proven where both are."""
    return a if a < b else b


def proven(boxes: Boxes) -> Index:
    """Slots of the boxes proven, in the order in which they were."""
    closed = boxes.order[::-1][: boxes.tally[CLOSED]]
    slots: Index = closed[boxes.verdict[closed] == Verdict.PROVEN]
    return slots


def left_open(boxes: Boxes) -> Index:
    """Slots of the boxes that are neither proven nor ruled out."""
    closed = boxes.order[::-1][: boxes.tally[CLOSED]]
    waiting = boxes.order[: boxes.tally[QUEUED]]
    return np.concatenate([closed[boxes.verdict[closed] == Verdict.OPEN], waiting])


def reopen(boxes: Boxes, slot: int) -> None:
    """Queue a proven box again, as its proof is not accepted."""
    order, tally = boxes.order, boxes.tally
    last = len(order) - tally[CLOSED]
    where = last + int(np.flatnonzero(order[last:] == slot)[0])
    order[last : where + 1] = np.roll(order[last : where + 1], 1)  # closed ones keep their order
    tally[CLOSED] -= 1
    tally[PROVEN] -= 1
    free = tally[QUEUED]
    order[free], order[last] = order[last], order[free]
    boxes.verdict[slot] = Verdict.OPEN
    if boxes.side[slot] == NO_SIDE:
        _close(boxes)
    else:
        _push(boxes)


@_shared
def _empty(sides: int) -> Boxes:
    n = _INITIAL_SLOTS
    low, high = np.zeros((n, sides)), np.zeros((n, sides))
    side, verdict = np.zeros(n, np.int64), np.zeros(n, np.int64)
    return Boxes(low, high, np.zeros(n), side, verdict, np.arange(n), np.zeros(4, np.int64))


@_shared
def _with_room(boxes: Boxes) -> Boxes:
    """The same boxes with two free slots at least."""
    n, closed = len(boxes.order), boxes.tally[CLOSED]
    if boxes.tally[QUEUED] + closed + 2 <= n:
        return boxes
    kept = n - closed
    return Boxes(
        np.concatenate((boxes.low, np.zeros_like(boxes.low))),
        np.concatenate((boxes.high, np.zeros_like(boxes.high))),
        np.concatenate((boxes.key, np.zeros_like(boxes.key))),
        np.concatenate((boxes.side, np.zeros_like(boxes.side))),
        np.concatenate((boxes.verdict, np.zeros_like(boxes.verdict))),
        np.concatenate((boxes.order[:kept], np.arange(n, 2 * n), boxes.order[kept:])),
        boxes.tally,
    )


@_shared
def _record(boxes: Boxes, low: Array, high: Array, verdict: Verdict, key: float, side: int) -> None:
    """Keep a box that was judged in the first free slot, unless it is ruled out."""
    boxes.tally[JUDGED] += 1
    if verdict == Verdict.RULED_OUT:
        return
    slot = boxes.order[boxes.tally[QUEUED]]
    boxes.low[slot], boxes.high[slot] = low, high
    boxes.key[slot], boxes.side[slot], boxes.verdict[slot] = key, side, verdict
    if verdict == Verdict.PROVEN or side == NO_SIDE:
        _close(boxes)
    else:
        _push(boxes)


@_shared
def _close(boxes: Boxes) -> None:
    """Set the box in the first free slot aside."""
    order, tally = boxes.order, boxes.tally
    first, last = tally[QUEUED], len(order) - 1 - tally[CLOSED]
    if boxes.verdict[order[first]] == Verdict.PROVEN:
        tally[PROVEN] += 1
    order[first], order[last] = order[last], order[first]
    tally[CLOSED] += 1


@_shared
def _push(boxes: Boxes) -> None:
    """Queue the box in the first free slot."""
    heap, key, k = boxes.order, boxes.key, boxes.tally[QUEUED]
    boxes.tally[QUEUED] += 1
    while k > 0:
        above = (k - 1) // 2
        if not key[heap[k]] > key[heap[above]]:
            break
        heap[k], heap[above] = heap[above], heap[k]
        k = above


@_shared
def _pop(boxes: Boxes) -> int:
    """Take the box with the largest key from the queue; its slot is the first free one."""
    heap, key = boxes.order, boxes.key
    last = boxes.tally[QUEUED] - 1
    boxes.tally[QUEUED] = last
    heap[0], heap[last] = heap[last], heap[0]
    k = 0
    while True:
        below = 2 * k + 1
        if below + 1 < last and key[heap[below + 1]] > key[heap[below]]:
            below += 1
        if below >= last or not key[heap[below]] > key[heap[k]]:
            return int(heap[last])
        heap[k], heap[below] = heap[below], heap[k]
        k = below


TWO_PI = 2.0 * np.pi
WORTHWHILE_SHARE = 0.9  # a contraction is repeated if it left less than this share of some side


@compiled
def interval_cos(low: float, high: float) -> tuple[float, float]:
    """Cosine of an interval of angles [rad]."""
    if high - low >= TWO_PI:
        return -1.0, 1.0
    a, b = math.cos(low), math.cos(high)
    least, most = min(a, b), max(a, b)
    if np.ceil(low / TWO_PI) * TWO_PI <= high:
        most = 1.0
    if np.ceil((low - np.pi) / TWO_PI) * TWO_PI + np.pi <= high:
        least = -1.0
    return least, most


@compiled
def interval_sin(low: float, high: float) -> tuple[float, float]:
    """Sine of an interval of angles [rad]."""
    return interval_cos(low - 0.5 * np.pi, high - 0.5 * np.pi)


@compiled
def interval_product(a: float, b: float, c: float, d: float) -> tuple[float, float]:
    """(a, b) times (c, d)."""
    p, q, r, s = a * c, a * d, b * c, b * d
    return min(min(p, q), min(r, s)), max(max(p, q), max(r, s))


@compiled
def interval_square(low: float, high: float) -> tuple[float, float]:
    """Square of an interval."""
    a, b = low * low, high * high
    return (0.0 if low <= 0.0 <= high else min(a, b)), max(a, b)


@compiled
def opening(own: float, other: float, low: float, high: float) -> tuple[float, float]:
    """Angle of a triangle between side ``own`` and a third side of a length in (low, high) > 0 [rad]."""
    spread = own * own - other * other
    a, b = (low + spread / low) / (2.0 * own), (high + spread / high) / (2.0 * own)
    least, most = min(a, b), max(a, b)
    if spread > 0.0 and low * low < spread < high * high:  # convex in the third side
        least = np.sqrt(spread) / own
    return math.acos(min(1.0, max(-1.0, most))), math.acos(min(1.0, max(-1.0, least)))


@compiled
def polar_angle(x0: float, x1: float, y0: float, y1: float) -> tuple[float, float]:
    """Angle of all points of a box, seen from the origin, as an interval that may pass pi [rad]."""
    if x0 <= 0.0 <= x1 and y0 <= 0.0 <= y1:
        return -np.pi, np.pi
    middle = math.atan2(0.5 * (y0 + y1), 0.5 * (x0 + x1))
    c, s = math.cos(middle), math.sin(middle)
    low = high = 0.0
    for x in (x0, x1):
        for y in (y0, y1):
            off = math.atan2(c * y - s * x, c * x + s * y)
            low, high = min(low, off), max(high, off)
    return middle + low, middle + high


@compiled
def within_limits(low: float, high: float, lower: float, upper: float, rounding: float) -> Verdict:
    """Verdict on an interval of angles against limits, whole turns aside [rad]."""
    if lower == -np.inf and upper == np.inf:
        return Verdict.PROVEN
    lower = lower if lower > -np.inf else -np.pi  # as `angles.fit` takes what has one end
    upper = upper if upper < np.inf else np.pi
    turn = np.round((0.5 * (low + high) - 0.5 * (lower + upper)) / TWO_PI)
    touches = False
    for n in (turn - 1.0, turn, turn + 1.0):
        a, b = low - TWO_PI * n, high - TWO_PI * n
        if lower <= a and b <= upper:
            return Verdict.PROVEN
        touches = touches or (a <= upper + rounding and b >= lower - rounding)
    return Verdict.OPEN if touches else Verdict.RULED_OUT


@compiled
def contract(shift: Array, row: Array, low: float, high: float) -> bool:
    """Contract a box (2, n) of x to low <= row . x <= high, side by side; False where nothing is left."""
    least = most = 0.0
    for k in range(len(row)):
        a, b = row[k] * shift[0, k], row[k] * shift[1, k]
        least += min(a, b)
        most += max(a, b)
    if least > high or most < low:
        return False
    for k in range(len(row)):
        c = row[k]
        if abs(c) < 1e-9:
            continue
        a, b = c * shift[0, k], c * shift[1, k]
        others_least, others_most = least - min(a, b), most - max(a, b)
        u, v = (low - others_most) / c, (high - others_least) / c
        shift[0, k] = max(shift[0, k], min(u, v))
        shift[1, k] = min(shift[1, k], max(u, v))
        if shift[0, k] > shift[1, k]:
            return False
        a, b = c * shift[0, k], c * shift[1, k]
        least, most = others_least + min(a, b), others_most + max(a, b)
    return True


@compiled
def cut_to(low: Array, high: Array, centre: Array, shift: Array) -> bool:
    """Cut a box down to what `contract` left of it, relative to its centre; True where that was much."""
    much = False
    for k in range(len(centre)):
        much = much or shift[1, k] - shift[0, k] < WORTHWHILE_SHARE * (high[k] - low[k])
        low[k] = max(low[k], centre[k] + shift[0, k])
        high[k] = min(high[k], centre[k] + shift[1, k])
    return much
