"""Outer reach of an arm at a height: distances that no posture has, by branch and bound over joint values.

A box of joint values, and of the distances they may give, is ruled out when no posture of it has its tool at
the height and at a distance still in question. Other boxes are contracted by both conditions. The box whose
distances are farthest from the known ones is bisected first, so that the bound is as good as the work spent.

Two kinds of bounds are used. Near the centre of a box the tool moves linearly in the joints, but for a bound
of the second order. And its distance from a point on each joint's axis, a hub, does not depend on the joints
before that point: it bounds boxes in which those are free.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.vectors import minus, norm, row, squared
from regionik.planners.kernels import compiled
from regionik.planners.reach.meridian import Meridian, MeridianTool, tool_for, tool_motion
from regionik.planners.search.box_search import (
    NO_SIDE,
    PROOF_SLACK,
    Boxes,
    Verdict,
    begin,
    contract,
    cut_to,
    explore_in_kernel,
    left_open,
)
from regionik.planners.search.motion_bounds import chords, displacement, from_axis
from regionik.planners.solvers.serial_chain import SerialArm, joint_changes
from regionik.worlds.arrays import Array

MAX_PASSES = 3  # times that one box is bounded, and contracted but for the last time, before it is bisected
OWN_LEVER_WEIGHT = 0.1  # weight of a joint's own lever when a joint to bisect is chosen


class ToolBounds(NamedTuple):
    """Bounds of the tool over a box of n joints, m of them active; scratch space that `bound` fills."""

    tool: MeridianTool
    q: Array  # (m,) its centre
    half: Array  # (m,) half widths
    chord: Array  # (n,)
    moved: Array  # (n + 1,) most that joints k and after move the tool [m]
    bent: Array  # (n + 1,) most that this differs from the linear motion [m]
    hub: Array  # (n, 3) point on each axis, in the arm's base frame [m]
    loose: Array  # (n,) most that the joints move it [m]
    keeps: Array  # (n, 2) least and largest distance of the tool from where the hub is at the centre [m]
    # (n, m) speed of the tool away from each hub, by the joints after it, for each active joint's unit speed
    along: Array
    row: Array  # (m,) coefficients of one condition
    shift: Array  # (2, m) a box contracted, against its centre
    endless: Array  # (n,) levers without bound


class OuterReach(NamedTuple):
    """Distances in question at a height."""

    meridian: Meridian
    z: float  # height of the tool over the arm's base frame [m]
    half: float  # by which it may be above or below [m]
    known: Array  # (k, 2) distances known to be in reach, as ascending intervals [m]
    enough: float  # boxes that stick out by no more than this are not bisected [m]
    bounds: ToolBounds  # overwritten


def outer_distances(
    meridian: Meridian,
    heights: tuple[float, float],
    limits: tuple[Array, Array],
    known: Array,
    cap: float,
    enough: float,
    most: int,
) -> Array:
    """Distances left open, as intervals (k, 2); no posture has any outside them and the known ones.

    Parameters
    ----------
    heights : (low, high)
        Of the tool over the arm's base frame, the same or rising [m].
    limits : (low, high) arrays (m,)
        The box of all postures.
    known : (k, 2) array
        Distances known to be in reach, as ascending intervals [m].
    cap : float
        No posture is farther out [m].
    enough : float
        Distance from the known ones within which the search does not go on [m].
    most : int
        Budget of boxes.
    """
    (bottom, top), (low, high) = heights, limits
    task = OuterReach(
        meridian, 0.5 * (bottom + top), 0.5 * (top - bottom), known, enough, bounds_for(meridian)
    )
    boxes = begin(_judge_reach, task, np.array([[*low, 0.0]]), np.array([[*high, cap]]))
    boxes = _explore(task, boxes, most)
    slots = left_open(boxes)
    return np.column_stack([boxes.low[slots, -1], boxes.high[slots, -1]])


@compiled
def _explore(task: OuterReach, boxes: Boxes, budget: int) -> Boxes:
    return explore_in_kernel(_judge_reach, task, boxes, budget, 1)  # none is ever proven


@compiled
def _judge_reach(task: OuterReach, low: Array, high: Array) -> tuple[Verdict, float, int]:
    """Contract a box of m joint values and, last, of distances; its key is their largest excess."""
    m, z, half, known, box = len(low) - 1, task.z, task.half, task.known, task.bounds
    tells_low = tells_high = -1
    for i in range(MAX_PASSES):
        bound(task.meridian, low[:m], high[:m], box)
        near, far, tells_low, tells_high = spanned(box, z, half)
        low[m], high[m] = in_question(known, max(near, low[m]), min(far, high[m]))
        if low[m] > high[m]:
            return Verdict.RULED_OUT, 0.0, NO_SIDE
        if i == MAX_PASSES - 1:
            break
        if not contract_to(box, z, half, low[m], high[m]):
            return Verdict.RULED_OUT, 0.0, NO_SIDE
        if not cut_to(low, high, box.q, box.shift):
            break
    sticks = sticks_out(known, low[m], high[m])
    if sticks <= task.enough:
        return Verdict.OPEN, sticks, NO_SIDE
    outwards = len(known) == 0 or high[m] > known[0, 0]
    return Verdict.OPEN, sticks, _to_bisect(task.meridian, box, tells_high if outwards else tells_low)


def bounds_for(meridian: Meridian) -> ToolBounds:
    """Scratch space for `bound`."""
    n, m = len(meridian.levers), len(meridian.speeds)
    return ToolBounds(
        tool_for(meridian), np.zeros(m), np.zeros(m), np.zeros(n), np.zeros(n + 1), np.zeros(n + 1),
        np.zeros((n, 3)), np.zeros(n), np.zeros((n, 2)), np.zeros((n, m)), np.zeros(m), np.zeros((2, m)),
        np.full(n, np.inf),
    )  # fmt: skip


@compiled
def bound(meridian: Meridian, low: Array, high: Array, box: ToolBounds) -> None:
    """Bound the tool over a box of joint values."""
    n, tool, arm = len(box.chord), box.tool, meridian.arm
    for k in range(len(low)):
        box.q[k], box.half[k] = 0.5 * (low[k] + high[k]), 0.5 * (high[k] - low[k])
    tool_motion(meridian, box.q, tool)
    spread = joint_changes(arm, box.half)
    chords(arm, spread, box.chord)
    p = tool.frames[n, :3, 3]
    for k in range(n - 1, -1, -1):  # as `tool_displacement`, kept for each joint
        moved, bent, half = box.moved[k + 1], box.bent[k + 1], spread[k]
        off = 1.0
        if arm.revolute[k]:
            off = min(from_axis(tool.frames[k], tool.axes[k], p) + moved, meridian.levers[k])
            bent += 0.5 * half * half * off + half * moved
        box.moved[k] = moved + box.chord[k] * off
        box.bent[k] = min(bent, 2.0 * box.moved[k])
        for i in range(3):
            box.hub[k, i] = tool.frames[k, i, 3] + meridian.hub[k] * tool.axes[k, i]
        box.loose[k] = displacement(arm, tool.frames, tool.axes, box.chord, box.endless, k, 0, box.hub[k])
        _keep(arm, box, k, p)


@compiled
def _keep(arm: SerialArm, box: ToolBounds, k: int, p: Array) -> None:
    """Bound the tool's distance from a hub."""
    J = box.tool.J
    x, y, z = p[0] - box.hub[k, 0], p[1] - box.hub[k, 1], p[2] - box.hub[k, 2]
    length = np.sqrt(x * x + y * y + z * z)
    if length > 1e-9:
        x, y, z = x / length, y / length, z / length
    out = box.bent[k + 1]
    box.along[k] = 0.0
    for j in range(k + 1, len(arm.axis)):
        box.along[k, arm.leader[j]] += arm.ratio[j] * (x * J[0, j] + y * J[1, j] + z * J[2, j])
    for j in range(len(box.half)):
        out += box.half[j] * abs(box.along[k, j])
    moved = box.moved[k + 1]
    out = min(out, moved)
    box.keeps[k, 0] = max(0.0, length - out - box.loose[k])
    box.keeps[k, 1] = min(np.sqrt(squared(length + out) + moved * moved), length + moved) + box.loose[k]


@compiled
def aside(box: ToolBounds) -> float:
    """Most that the tool leaves the plane in which it stands at the centre [m]."""
    total = box.bent[0]
    for k in range(len(box.q)):
        total += box.half[k] * abs(box.tool.aside[k])
    return float(min(total, box.moved[0]))


@compiled
def spanned(box: ToolBounds, z: float, half: float) -> tuple[float, float, int, int]:
    """Distances that the tool may have within ``half`` of a height, and the hubs that bound them.

    None where low > high.

    Outwards the tool moves by out . d and upwards by up . d, which the height fixes. For any factor s,
    out - s up bounds the motion outwards; one s for each joint is tried, as the least bound is at one of
    them. Where these bounds are the tightest the hub is -1.
    """
    m, tool = len(box.q), box.tool
    c, bent = z - tool.at[1], box.bent[0]
    least = most = box.moved[0]
    rise = bent
    for i in range(m + 1):
        s = 0.0
        if i < m:
            rise += box.half[i] * abs(tool.up[i])
            if abs(tool.up[i]) < 1e-9:
                continue
            s = tool.out[i] / tool.up[i]
        total = bent * np.sqrt(1.0 + s * s)
        for k in range(m):
            total += box.half[k] * abs(tool.out[k] - s * tool.up[k])
        total += abs(s) * half
        most, least = min(most, total + s * c), min(least, total - s * c)
    if abs(c) > rise + half + PROOF_SLACK or most + least < -PROOF_SLACK:
        return 1.0, 0.0, -1, -1
    # Past the pivot axis the tool is on the other side, as far away as it went beyond.
    low = max(0.0, tool.at[0] - least)
    high = np.hypot(max(0.0, tool.at[0] + most, least - tool.at[0]), aside(box))
    tells_low = tells_high = -1
    for k in range(len(box.hub)):
        r, rise = np.hypot(box.hub[k, 0], box.hub[k, 1]), abs(z - box.hub[k, 2])
        over = squared(box.keeps[k, 1]) - squared(max(0.0, rise - half))
        if over < -PROOF_SLACK:
            return 1.0, 0.0, -1, -1
        wide = np.sqrt(max(0.0, over))
        narrow = np.sqrt(max(0.0, squared(box.keeps[k, 0]) - squared(rise + half)))
        if r + wide < high:
            high, tells_high = r + wide, k
        if max(narrow - r, r - wide) > low:
            low, tells_low = max(narrow - r, r - wide), k
    return low - PROOF_SLACK, high + PROOF_SLACK, tells_low, tells_high


@compiled
def _to_bisect(meridian: Meridian, box: ToolBounds, hub: int) -> int:
    """The active joint to bisect, which improves the bound by a hub (-1: the linear one) most."""
    sizes = meridian.speeds * box.half
    if hub >= 0:
        sizes *= OWN_LEVER_WEIGHT
        for j in range(len(box.hub)):
            if j > hub:
                size = box.moved[j] - box.moved[j + 1]
            else:
                frame, axis = box.tool.frames[j], box.tool.axes[j]
                size = box.chord[j] * (
                    from_axis(frame, axis, box.hub[hub]) if meridian.arm.revolute[j] else 1.0
                )
            sizes[meridian.arm.leader[j]] += size
    return int(np.argmax(sizes))


@compiled
def contract_to(box: ToolBounds, z: float, half: float, low: float, high: float) -> bool:
    """Contract ``box.shift`` to heights within ``half`` of z and distances in (low, high).

    False where nothing is left.
    """
    m, tool, row = len(box.q), box.tool, box.row
    c, bent, moved = z - tool.at[1], box.bent[0] + PROOF_SLACK, box.moved[0]
    for k in range(m):
        box.shift[0, k], box.shift[1, k] = -box.half[k], box.half[k]
        row[k] = tool.up[k]
    if not contract(box.shift, box.row, c - bent - half, c + bent + half):
        return False
    from_, to, wide = -moved, min(moved, high - tool.at[0]), aside(box)
    if tool.at[0] > moved and low > wide:
        from_ = max(from_, np.sqrt(low * low - wide * wide) - tool.at[0])
    for i in range(m + 1):
        s = 0.0
        if i < m:
            if abs(tool.out[i]) > 1e3 * abs(tool.up[i]) or abs(tool.up[i]) < 1e-9:
                continue
            s = tool.out[i] / tool.up[i]
        for k in range(m):
            row[k] = tool.out[k] - s * tool.up[k]
        slack = bent * np.sqrt(1.0 + s * s) + abs(s) * half
        if not contract(box.shift, box.row, from_ - s * c - slack, to - s * c + slack):
            return False
    return _contract_by_hubs(box, z, half, low, high)


@compiled
def _contract_by_hubs(box: ToolBounds, z: float, half: float, low: float, high: float) -> bool:
    """Contract by how near to each hub the tool may come, and how far from it."""
    n = len(box.hub)
    p = box.tool.frames[n, :3, 3]
    for k in range(n - 1):
        r, rise = np.hypot(box.hub[k, 0], box.hub[k, 1]), abs(z - box.hub[k, 2])
        length = norm(minus((p[0], p[1], p[2]), row(box.hub, k)))
        moved, slack = box.moved[k + 1], box.bent[k + 1] + box.loose[k] + PROOF_SLACK
        if slack > length or moved > length:
            continue
        most = np.hypot(high + r, rise + half)
        least = np.hypot(max(0.0, max(low - r, r - high)), max(0.0, rise - half)) - box.loose[k]
        least = np.sqrt(max(0.0, least * least - moved * moved)) if least > 0.0 else 0.0
        box.row[:] = box.along[k]
        if not contract(
            box.shift, box.row, least - length - box.bent[k + 1] - PROOF_SLACK, most - length + slack
        ):
            return False
    return True


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
    """Most that a distance of an interval is off all known ones; infinite where none is known [m]."""
    if len(known) == 0:
        return np.inf
    most = max(known[0, 0] - low, high - known[-1, 1])
    for k in range(len(known) - 1):
        a, b = max(low, known[k, 1]), min(high, known[k + 1, 0])
        if a < b:
            near = max(a, min(b, 0.5 * (known[k, 1] + known[k + 1, 0])))
            most = max(most, min(near - known[k, 1], known[k + 1, 0] - near))
    return float(most)
