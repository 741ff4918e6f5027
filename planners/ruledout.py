"""Distances at which an arm cannot have its tool at a height: branch and bound over boxes of joint values.

A box goes when no posture of it has its tool at the height and at a distance that is still in question. What
is left is shrunk by both conditions and halved; the box whose distances stick out farthest comes first, so
that the bound is as good as the work spent on it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.flat import Index, compiled
from regionik.planners.meridian import Meridian, Tool, look, tool_for
from regionik.planners.sway import chords, tool_sway
from regionik.worlds.arrays import Array

SLACK = 1e-10  # rounding that no proof may rest on [m]
PASSES = 3  # shrinkings of one box before it is halved
WORTH = 0.9  # another shrinking follows when the last one left less than this of some joint's range


class Boxes(NamedTuple):
    """A search: c slots for boxes, and a heap of those in use."""

    low: Array  # (c, m)
    high: Array  # (c, m)
    span: Array  # (c, 2) distances in question that the box may have [m]
    key: Array  # (c,) how far they stick out, the largest comes first [m]
    heap: Index  # (c,) slots in use, in the order of a heap, then the free ones
    tally: Index  # (2,) boxes in the heap, boxes weighed


class Room(NamedTuple):
    """Room to work in for m joints."""

    q: Array  # (m,)
    half: Array  # (m,)
    chord: Array  # (m,)
    row: Array  # (m,) coefficients of one condition
    shift: Array  # (2, m) a shrunken box, against its centre


def bounded(
    meridian: Meridian,
    z: float,
    low: Array,
    high: Array,
    known: Array,
    cap: float,
    enough: float,
    most: int,
) -> Array:
    """Distances that are left in question, as intervals (k, 2); outside them and the known ones there are none.

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
    m = len(low)
    slots = most + 2
    boxes = Boxes(
        np.zeros((slots, m)), np.zeros((slots, m)), np.zeros((slots, 2)), np.zeros(slots), np.arange(slots),
        np.zeros(2, np.int64),
    )  # fmt: skip
    boxes.low[0], boxes.high[0], boxes.span[0] = low, high, (0.0, cap)
    tool, room = tool_for(meridian), Room(*(np.zeros(m) for _ in range(4)), np.zeros((2, m)))
    admit(meridian, z, known, boxes, 0, tool, room)
    explore(meridian, z, known, boxes, enough, most, tool, room)
    return boxes.span[boxes.heap[: boxes.tally[0]]]


@compiled
def in_question(known: Array, low: float, high: float) -> tuple[float, float]:
    """The part of an interval that known intervals (k, 2), ascending, leave at its ends; low > high for none."""
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
    """How far some distance of an interval is from all known ones, at most."""
    if len(known) == 0:
        return high - low + 1.0
    most = max(known[0, 0] - low, high - known[-1, 1])
    for k in range(len(known) - 1):
        a, b = max(low, known[k, 1]), min(high, known[k + 1, 0])
        if a < b:
            middle = 0.5 * (known[k, 1] + known[k + 1, 0])
            near = max(a, min(b, middle))
            most = max(most, min(near - known[k, 1], known[k + 1, 0] - near))
    return most


@compiled
def spanned(meridian: Meridian, tool: Tool, room: Room, z: float, bent: float, moved: float) -> tuple[float, float]:
    """Distances that postures of the box at the height may have; low > high where there are none.

    Outwards the tool moves by out . d plus at most ``bent``, upwards by up . d likewise, and upwards by just
    what the height asks. For any share s, out - s up bounds how far outwards it may go: one s for each joint
    is tried, which is where the bound can be least.
    """
    m, c = len(room.q), z - tool.at[1]
    rise = aside = 0.0
    for k in range(m):
        rise += room.half[k] * abs(tool.up[k])
        aside += room.half[k] * abs(tool.aside[k])
    if abs(c) > rise + bent:
        return 1.0, 0.0
    least = most = moved
    for i in range(m + 1):
        s = 0.0
        if i < m:
            if abs(tool.up[i]) < 1e-9:
                continue
            s = tool.out[i] / tool.up[i]
        total = bent * np.sqrt(1.0 + s * s)
        for k in range(m):
            total += room.half[k] * abs(tool.out[k] - s * tool.up[k])
        most = min(most, total + s * c)
        least = min(least, total - s * c)
    if least < -most:
        return 1.0, 0.0
    aside = min(aside + bent, moved)
    low = max(0.0, tool.at[0] - least)
    high = np.sqrt(max(0.0, tool.at[0] + most) ** 2 + aside * aside)
    return low - SLACK, high + SLACK


@compiled
def shrink(meridian: Meridian, tool: Tool, room: Room, z: float, bent: float, moved: float, low: float, high: float) -> bool:
    """Cut off what height and distances in question rule out, into ``room.shift``; False where nothing is left."""
    m, c = len(room.q), z - tool.at[1]
    aside = 0.0
    for k in range(m):
        room.shift[0, k], room.shift[1, k] = -room.half[k], room.half[k]
        aside += room.half[k] * abs(tool.aside[k])
        room.row[k] = tool.up[k]
    if not cut(room, c - bent - SLACK, c + bent + SLACK):
        return False
    # r <= hypot(r at the centre + outwards, aside) gives outwards from below; r >= the former from above
    aside = min(aside + bent, moved)
    from_ = -moved
    if tool.at[0] > moved and low > aside:
        from_ = max(from_, np.sqrt(low * low - aside * aside) - tool.at[0])
    to = min(moved, high - tool.at[0])
    for i in range(m + 1):
        s = 0.0
        if i < m:
            if abs(tool.up[i]) < 1e-9 or (abs(tool.out[i]) > 1e3 * abs(tool.up[i])):
                continue
            s = tool.out[i] / tool.up[i]
        for k in range(m):
            room.row[k] = tool.out[k] - s * tool.up[k]
        slack = bent * np.sqrt(1.0 + s * s) + SLACK
        if not cut(room, from_ - s * c - slack, to - s * c + slack):
            return False
    return True


@compiled
def cut(room: Room, from_: float, to: float) -> bool:
    """Shrink ``room.shift`` by from_ <= row . d <= to; False where nothing is left."""
    m = len(room.row)
    least = most = 0.0
    for k in range(m):
        a, b = room.row[k] * room.shift[0, k], room.row[k] * room.shift[1, k]
        least += min(a, b)
        most += max(a, b)
    if least > to or most < from_:
        return False
    for k in range(m):
        c = room.row[k]
        if abs(c) < 1e-9:
            continue
        a, b = c * room.shift[0, k], c * room.shift[1, k]
        others_least, others_most = least - min(a, b), most - max(a, b)
        u, v = (from_ - others_most) / c, (to - others_least) / c
        room.shift[0, k] = max(room.shift[0, k], min(u, v))
        room.shift[1, k] = min(room.shift[1, k], max(u, v))
        if room.shift[0, k] > room.shift[1, k]:
            return False
        a, b = c * room.shift[0, k], c * room.shift[1, k]
        least, most = others_least + min(a, b), others_most + max(a, b)
    return True


@compiled
def admit(meridian: Meridian, z: float, known: Array, boxes: Boxes, box: int, tool: Tool, room: Room) -> None:
    """Weigh a box in a free slot; keep it where it may have distances in question."""
    boxes.tally[1] += 1
    low, high = boxes.low[box], boxes.high[box]
    m = len(low)
    near, far = boxes.span[box]
    for i in range(PASSES):
        for k in range(m):
            room.q[k], room.half[k] = 0.5 * (low[k] + high[k]), 0.5 * (high[k] - low[k])
        look(meridian, room.q, tool)
        chords(meridian.arm, room.half, room.chord)
        moved, bent = tool_sway(meridian.arm, tool.frames, tool.axes, room.chord, room.half, meridian.levers)
        bent = min(bent, 2.0 * moved)
        a, b = spanned(meridian, tool, room, z, bent, moved)
        near, far = in_question(known, max(a, near), min(b, far))
        if near > far:
            return
        if i == PASSES - 1:
            break
        if not shrink(meridian, tool, room, z, bent, moved, near, far):
            return
        again = False
        for k in range(m):
            again = again or room.shift[1, k] - room.shift[0, k] < WORTH * (high[k] - low[k])
            low[k] = max(low[k], room.q[k] + room.shift[0, k])
            high[k] = min(high[k], room.q[k] + room.shift[1, k])
        if not again:
            break
    boxes.span[box, 0], boxes.span[box, 1] = near, far
    boxes.key[box] = sticks_out(known, near, far)
    rise(boxes.heap, boxes.key, boxes.tally, box)


@compiled
def explore(meridian: Meridian, z: float, known: Array, boxes: Boxes, enough: float, most: int, tool: Tool, room: Room) -> None:
    """Halve the box that sticks out farthest, until none does by more than ``enough`` or the work is spent."""
    low, high, tally = boxes.low, boxes.high, boxes.tally
    while tally[0] > 0 and tally[1] < most and tally[0] < len(boxes.heap):
        slot, other = boxes.heap[0], boxes.heap[tally[0]]
        if boxes.key[slot] <= enough:
            break
        split, weight = 0, -1.0
        for k in range(low.shape[1]):
            size = meridian.levers[k] * (high[slot, k] - low[slot, k])
            if size > weight:
                split, weight = k, size
        middle = 0.5 * (low[slot, split] + high[slot, split])
        if not low[slot, split] < middle < high[slot, split]:
            break
        sink(boxes.heap, boxes.key, tally)
        low[other], high[other], boxes.span[other] = low[slot], high[slot], boxes.span[slot]
        high[slot, split] = low[other, split] = middle
        admit(meridian, z, known, boxes, slot, tool, room)
        admit(meridian, z, known, boxes, other, tool, room)


@compiled
def rise(heap: Index, key: Array, tally: Index, box: int) -> None:
    """Push a box; the free slot that stands in its place goes where the box stood."""
    n = tally[0]
    for k in range(n, len(heap)):
        if heap[k] == box:
            heap[k] = heap[n]
            break
    heap[n] = box
    tally[0] = n + 1
    while n > 0:
        up = (n - 1) // 2
        if not key[heap[n]] > key[heap[up]]:
            break
        heap[n], heap[up] = heap[up], heap[n]
        n = up


@compiled
def sink(heap: Index, key: Array, tally: Index) -> None:
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
