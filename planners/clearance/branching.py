"""Branch and bound over boxes of joint values: compiled inner loops, flat arrays only.

A box goes when the tool cannot reach the target anywhere in it, or when one link solid hits one obstacle,
another link solid or the base everywhere in it. What is left is shrunk by the reach condition, tried for a
posture, and halved.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.clearance.ownbody import own_clearance, surely_meets_itself
from regionik.planners.clearance.postures import Scratch, Task, clearance_of, pose, to_target
from regionik.planners.geometry.flat import Index, compiled
from regionik.planners.geometry.upright import distance_along, least_along
from regionik.planners.reach.sway import chords, sway, sway_from_tool, tool_sway
from regionik.planners.solvers.serial_chain import chain_jacobian
from regionik.worlds.arrays import Array

SLACK = 1e-10  # rounding that no proof may rest on [m]
PASSES = 4  # shrinkings of one box before it is halved
WORTH = 0.9  # another shrinking follows when the last one left less than this of some joint's range
SECTIONS = 10  # golden sections along a link where a proof is sought
DONE, FOUND, FULL, SPENT = 0, 1, 2, 3


class Boxes(NamedTuple):
    """A search between two calls: c slots for boxes, and a heap of those in use."""

    low: Array  # (c, n)
    high: Array  # (c, n)
    key: Array  # (c,) the least comes first
    heap: Index  # (c,) slots in use, in the order of a heap, then the free ones
    tally: Index  # (3,) boxes in the heap, boxes weighed, boxes too small to halve
    best: Array  # (1 + n,) largest clearance met below the wanted one, and the last posture found


@compiled
def shrink(task: Task, work: Scratch, bent: float) -> bool:
    """Cut off what the reach condition rules out, written into ``work.shift``; False where nothing is left.

    Along a unit direction u the condition reads |u . (tool - target) + sum u . J_k d_k| <= tolerance + bent.
    Directions square to two columns of the Jacobian, or to one column and its axis, leave few joints in it.
    """
    n = len(work.q)
    chain_jacobian(task.arm, work.frames, work.J)
    for k in range(n):
        work.shift[0, k], work.shift[1, k] = -work.half[k], work.half[k]
    u = np.empty(3)
    for i in range(n):
        for j in range(i, n):
            b = work.axes[i] if i == j else work.J[:3, j]
            a = work.J[:3, i]
            u[0], u[1], u[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
            size = np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
            if size > 1e-9:
                u /= size
                if not _shrink_along(task, work, u, bent):
                    return False
    return True


@compiled
def _shrink_along(task: Task, work: Scratch, u: Array, bent: float) -> bool:
    """`shrink` for one direction."""
    n = len(work.q)
    room = task.tolerance + bent + SLACK
    off = 0.0
    for i in range(3):
        off += u[i] * (work.frames[n, i, 3] - task.target[i])
    least = most = off
    for k in range(n):
        c = u[0] * work.J[0, k] + u[1] * work.J[1, k] + u[2] * work.J[2, k]
        low, high = c * work.shift[0, k], c * work.shift[1, k]
        least += min(low, high)
        most += max(low, high)
    if least > room or most < -room:
        return False
    for k in range(n):
        c = u[0] * work.J[0, k] + u[1] * work.J[1, k] + u[2] * work.J[2, k]
        if abs(c) < 1e-9:
            continue
        low, high = c * work.shift[0, k], c * work.shift[1, k]
        others_least, others_most = least - min(low, high), most - max(low, high)
        from_, to = (-room - others_most) / c, (room - others_least) / c
        work.shift[0, k] = max(work.shift[0, k], min(from_, to))
        work.shift[1, k] = min(work.shift[1, k], max(from_, to))
        if work.shift[0, k] > work.shift[1, k]:
            return False
        low, high = c * work.shift[0, k], c * work.shift[1, k]
        least, most = others_least + min(low, high), others_most + max(low, high)
    return True


@compiled
def surely_hits(task: Task, work: Scratch, off: float) -> bool:
    """Whether some solid comes too near to some obstacle wherever in the box the tool reaches the target."""
    arm, bones = task.arm, task.bones
    for s in range(len(bones.link)):
        link = bones.link[s]
        a, b = work.ends[s, 0], work.ends[s, 1]
        reach = bones.radius[s] + task.clearance - SLACK
        length = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
        known = False
        base_a = base_b = tool_a = tool_b = 0.0
        for k in range(len(task.solids.disc)):
            if distance_along(task.solids, k, a, b, 0.5) - 0.5 * length >= reach:
                continue
            if not known:  # as points of the arm, and as points near a tool that is at the target
                known = True
                base_a = sway(arm, work.frames, work.axes, work.chord, bones.levers[1 + 2 * s], link, 0, a)
                base_b = sway(arm, work.frames, work.axes, work.chord, bones.levers[2 + 2 * s], link, 0, b)
                tool = bones.levers[0]
                near = off + task.tolerance
                tool_a = near + sway_from_tool(arm, work.frames, work.axes, work.chord, tool, link, a)
                tool_b = near + sway_from_tool(arm, work.frames, work.axes, work.chord, tool, link, b)
            if (base_a < tool_a or base_b < tool_b) and (
                least_along(task.solids, k, a, b, base_a, base_b, reach, reach, SECTIONS) < reach
            ):
                return True
            if (tool_a < base_a or tool_b < base_b) and (
                least_along(task.solids, k, a, b, tool_a, tool_b, reach, reach, SECTIONS) < reach
            ):
                return True
    return False


@compiled
def weigh(task: Task, work: Scratch, low: Array, high: Array) -> bool:
    """Shrink a box in place; False where it holds no free posture."""
    n = len(low)
    for _ in range(PASSES):
        for k in range(n):
            work.q[k] = 0.5 * (low[k] + high[k])
            work.half[k] = 0.5 * (high[k] - low[k])
        off = pose(task, work)
        chords(task.arm, work.half, work.chord)
        moved, bent = tool_sway(task.arm, work.frames, work.axes, work.chord, work.half, task.bones.levers[0])
        if off > task.tolerance + moved + SLACK or not shrink(task, work, bent):
            return False
        again = False
        for k in range(n):
            centre = work.q[k]
            if work.shift[1, k] - work.shift[0, k] < WORTH * (high[k] - low[k]):
                again = True
            low[k] = max(low[k], centre + work.shift[0, k])
            high[k] = min(high[k], centre + work.shift[1, k])
        if not again:
            break
    for k in range(n):
        work.q[k] = 0.5 * (low[k] + high[k])
        work.half[k] = 0.5 * (high[k] - low[k])
    off = pose(task, work)
    chords(task.arm, work.half, work.chord)
    return not (
        surely_hits(task, work, off)
        or surely_meets_itself(
            task.arm, task.bones, task.own, work.frames, work.axes, work.chord, work.ends, SLACK
        )
    )


@compiled
def admit(task: Task, work: Scratch, boxes: Boxes, box: int) -> bool:
    """Weigh a box in a free slot, keep it if it may hold a free posture; True where it yields one."""
    boxes.tally[1] += 1
    if not weigh(task, work, boxes.low[box], boxes.high[box]):
        return False
    reaches = to_target(task, work) <= task.tolerance
    clear = min(clearance_of(task, work), own_clearance(task.bones, task.own, work.ends) + task.clearance)
    boxes.key[box] = -clear
    _rise(boxes.heap, boxes.key, boxes.tally, box)
    if not reaches:
        return False
    if clear < task.clearance:
        boxes.best[0] = max(boxes.best[0], clear)
        return False
    boxes.best[1:] = work.q
    return True


@compiled
def explore(task: Task, work: Scratch, boxes: Boxes, longest: Array, most: int) -> int:
    """Halve the most promising box and admit the halves, until there is something to say.

    ``longest`` (n,) are the levers that choose the joint to halve. After FOUND, with a posture in
    ``boxes.best``, another call goes on; FULL asks for more slots.
    """
    low, high, tally = boxes.low, boxes.high, boxes.tally
    while tally[0] > 0:
        if tally[1] >= most:
            return SPENT
        if tally[0] >= len(boxes.heap):
            return FULL
        slot, other = boxes.heap[0], boxes.heap[tally[0]]
        split, weight = 0, 0.0
        for k in range(low.shape[1]):
            if longest[k] * (high[slot, k] - low[slot, k]) > weight:
                split, weight = k, longest[k] * (high[slot, k] - low[slot, k])
        middle = 0.5 * (low[slot, split] + high[slot, split])
        _sink(boxes.heap, boxes.key, tally)
        if weight < SLACK or not low[slot, split] < middle < high[slot, split]:
            tally[2] += 1
            continue
        low[other], high[other] = low[slot], high[slot]
        high[slot, split] = low[other, split] = middle
        one = admit(task, work, boxes, slot)
        if admit(task, work, boxes, other) or one:
            return FOUND
    return DONE


@compiled
def _rise(heap: Index, key: Array, tally: Index, box: int) -> None:
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
        if not key[heap[n]] < key[heap[up]]:
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
        if down + 1 < last and key[heap[down + 1]] < key[heap[down]]:
            down += 1
        if down >= last or not key[heap[down]] < key[heap[n]]:
            break
        heap[n], heap[down] = heap[down], heap[n]
        n = down
