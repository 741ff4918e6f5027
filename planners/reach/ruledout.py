"""Distances at which an arm cannot have its tool at a height: branch and bound over boxes of joint values.

A box goes when no posture of it has its tool at the height and at a distance that is still in question. What
is left is shrunk by both conditions and halved; the box whose distances stick out farthest comes first, so
that the bound is as good as the work spent on it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.flat import Index, compiled
from regionik.planners.reach.boxreach import Box, box_for, shrink, spanned, to_halve, weigh
from regionik.planners.reach.meridian import Meridian
from regionik.worlds.arrays import Array

PASSES = 3  # weighings of one box, each but the last with a shrinking, before it is halved
WORTH = 0.9  # another shrinking follows when the last one left less than this of some joint's range


class Boxes(NamedTuple):
    """A search: c slots for boxes, and a heap of those in use."""

    low: Array  # (c, m)
    high: Array  # (c, m)
    span: Array  # (c, 2) distances in question that the box may have [m]
    key: Array  # (c,) how far they stick out, the largest comes first [m]
    split: Index  # (c,) which joint to halve
    heap: Index  # (c,) slots in use, in the order of a heap, then the free ones
    tally: Index  # (2,) boxes in the heap, boxes weighed


def bounded(
    meridian: Meridian, z: float, low: Array, high: Array, known: Array, cap: float, enough: float, most: int
) -> Array:
    """Distances left in question, as intervals (k, 2); outside them and the known ones there are none.

    Parameters
    ----------
    meridian : Meridian
    z : float
        Height of the tool over the arm's base frame [m].
    low, high : (m,) array
        The box of all postures.
    known : (k, 2) array
        Distances known to be in reach, as ascending intervals [m].
    cap : float
        No posture is farther out [m].
    enough : float
        How far from the known ones what is left may be for the search to end [m].
    most : int
        Budget of boxes.
    """
    m, slots = len(low), most + 2
    boxes = Boxes(
        np.zeros((slots, m)), np.zeros((slots, m)), np.zeros((slots, 2)), np.zeros(slots),
        np.zeros(slots, np.int64), np.arange(slots), np.zeros(2, np.int64),
    )  # fmt: skip
    boxes.low[0], boxes.high[0], boxes.span[0] = low, high, (0.0, cap)
    box = box_for(meridian)
    admit(meridian, z, known, boxes, 0, box)
    explore(meridian, z, known, boxes, enough, most, box)
    left: Array = boxes.span[boxes.heap[: boxes.tally[0]]]
    return left


@compiled
def explore(
    meridian: Meridian, z: float, known: Array, boxes: Boxes, enough: float, most: int, box: Box
) -> None:
    """Halve the box that sticks out farthest, until none does more than ``enough`` or the work is spent."""
    low, high, tally = boxes.low, boxes.high, boxes.tally
    while tally[0] > 0 and tally[1] < most:
        slot, other = boxes.heap[0], boxes.heap[tally[0]]
        if boxes.key[slot] <= enough:
            break
        k = boxes.split[slot]
        middle = 0.5 * (low[slot, k] + high[slot, k])
        if not low[slot, k] < middle < high[slot, k]:
            break
        _sink(boxes.heap, boxes.key, tally)
        low[other], high[other], boxes.span[other] = low[slot], high[slot], boxes.span[slot]
        high[slot, k] = low[other, k] = middle
        admit(meridian, z, known, boxes, slot, box)
        admit(meridian, z, known, boxes, other, box)


@compiled
def admit(meridian: Meridian, z: float, known: Array, boxes: Boxes, slot: int, box: Box) -> None:
    """Weigh a box in a free slot; keep it where it may have distances in question."""
    boxes.tally[1] += 1
    low, high, span = boxes.low[slot], boxes.high[slot], boxes.span[slot]
    tells_low = tells_high = -1
    for i in range(PASSES):
        weigh(meridian, low, high, box)
        near, far, tells_low, tells_high = spanned(box, z)
        span[0], span[1] = in_question(known, max(near, span[0]), min(far, span[1]))
        if span[0] > span[1]:
            return
        if i == PASSES - 1:
            break
        if not shrink(box, z, span[0], span[1]):
            return
        again = False
        for k in range(len(low)):
            again = again or box.shift[1, k] - box.shift[0, k] < WORTH * (high[k] - low[k])
            low[k] = max(low[k], box.q[k] + box.shift[0, k])
            high[k] = min(high[k], box.q[k] + box.shift[1, k])
        if not again:
            break
    outwards = len(known) == 0 or span[1] > known[0, 0]
    boxes.split[slot] = to_halve(meridian, box, tells_high if outwards else tells_low)
    boxes.key[slot] = sticks_out(known, span[0], span[1])
    _rise(boxes.heap, boxes.key, boxes.tally, slot)


@compiled
def in_question(known: Array, low: float, high: float) -> tuple[float, float]:
    """An interval less what known intervals (k, 2), ascending, cover at its ends; low > high for nothing."""
    for k in range(len(known)):
        if known[k, 0] <= low <= known[k, 1]:
            low = known[k, 1]
            break
    for k in range(len(known)):
        if known[k, 0] <= high <= known[k, 1]:
            high = known[k, 0]
            break
    return low, high


@compiled
def sticks_out(known: Array, low: float, high: float) -> float:
    """How far the distances of an interval are from all known ones, at most; infinite where none is known."""
    if len(known) == 0:
        return np.inf
    most = max(known[0, 0] - low, high - known[-1, 1])
    for k in range(len(known) - 1):
        a, b = max(low, known[k, 1]), min(high, known[k + 1, 0])
        if a < b:
            near = max(a, min(b, 0.5 * (known[k, 1] + known[k + 1, 0])))
            most = max(most, min(near - known[k, 1], known[k + 1, 0] - near))
    return float(most)


@compiled
def _rise(heap: Index, key: Array, tally: Index, slot: int) -> None:
    """Push a box; the free slot that stands in its place goes where the box stood."""
    n = tally[0]
    for k in range(n, len(heap)):
        if heap[k] == slot:
            heap[k] = heap[n]
            break
    heap[n] = slot
    tally[0] = n + 1
    while n > 0:
        up = (n - 1) // 2
        if not key[heap[n]] > key[heap[up]]:
            break
        heap[n], heap[up] = heap[up], heap[n]
        n = up


@compiled
def _sink(heap: Index, key: Array, tally: Index) -> None:
    """Pop the first box; its slot becomes the first free one."""
    last = tally[0] - 1
    heap[0], heap[last] = heap[last], heap[0]
    tally[0] = last
    n = 0
    while True:
        down = 2 * n + 1
        if down + 1 < last and key[heap[down + 1]] > key[heap[down]]:
            down += 1
        if down >= last or not key[heap[down]] > key[heap[n]]:
            break
        heap[n], heap[down] = heap[down], heap[n]
        n = down
