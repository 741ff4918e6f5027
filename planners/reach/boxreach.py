"""Where the tool of an arm may be while its joints stay within a box: bounds that hold for every posture.

Two kinds of bound go together. Near the centre of a box the tool moves as its speeds say, but for a bound of
what they change by. And it keeps its distance from a point on each joint's axis, however the joints before
that point turn: boxes that leave those joints free are weighed by it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.flat import compiled
from regionik.planners.reach.meridian import Meridian, Tool, look, tool_for
from regionik.planners.reach.sway import chords, from_axis, sway
from regionik.worlds.arrays import Array

SLACK = 1e-10  # rounding that no proof may rest on [m]
EVEN = 0.1  # weight of a joint's own lever when a joint to halve is chosen


class Box(NamedTuple):
    """A box of m joints and what is known of its postures; room that `weigh` fills.

    Attributes
    ----------
    q, half : (m,) array
        Its centre and half widths.
    chord : (m,) array
    moved, bent : (m + 1,) array
        Most that joints k and after move the tool, and most that this differs from what the speeds say [m].
    hub : (m, 3) array
        Point on each axis, in the arm's base frame [m].
    loose : (m,) array
        Most that the joints move it [m].
    keeps : (m, 2) array
        Least and largest distance of the tool from where the hub is at the centre [m].
    along : (m, m) array
        Speed of the tool away from each hub for each joint's unit speed.
    row : (m,) array
        Coefficients of one condition.
    shift : (2, m) array
        A shrunken box, against its centre.
    endless : (m,) array
        Levers without bound.
    """

    tool: Tool
    q: Array
    half: Array
    chord: Array
    moved: Array
    bent: Array
    hub: Array
    loose: Array
    keeps: Array
    along: Array
    row: Array
    shift: Array
    endless: Array


def box_for(meridian: Meridian) -> Box:
    """Room for what `weigh` finds."""
    m = len(meridian.levers)
    return Box(
        tool_for(meridian), np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m + 1), np.zeros(m + 1),
        np.zeros((m, 3)), np.zeros(m), np.zeros((m, 2)), np.zeros((m, m)), np.zeros(m), np.zeros((2, m)),
        np.full(m, np.inf),
    )  # fmt: skip


@compiled
def weigh(meridian: Meridian, low: Array, high: Array, box: Box) -> None:
    """Find the bounds of a box of joint values."""
    m, tool, arm = len(low), box.tool, meridian.arm
    for k in range(m):
        box.q[k], box.half[k] = 0.5 * (low[k] + high[k]), 0.5 * (high[k] - low[k])
    look(meridian, box.q, tool)
    chords(arm, box.half, box.chord)
    p = tool.frames[m, :3, 3]
    for k in range(m - 1, -1, -1):  # as `sway.tool_sway`, kept for each joint
        moved, bent, half = box.moved[k + 1], box.bent[k + 1], box.half[k]
        off = 1.0
        if arm.revolute[k]:
            off = min(from_axis(tool.frames[k], tool.axes[k], p) + moved, meridian.levers[k])
            bent += 0.5 * half * half * off + half * moved
        box.moved[k] = moved + box.chord[k] * off
        box.bent[k] = min(bent, 2.0 * box.moved[k])
        for i in range(3):
            box.hub[k, i] = tool.frames[k, i, 3] + meridian.hub[k] * tool.axes[k, i]
        box.loose[k] = sway(arm, tool.frames, tool.axes, box.chord, box.endless, k, 0, box.hub[k])
        _keep(box, k, p)


@compiled
def _keep(box: Box, k: int, p: Array) -> None:
    """Bound the tool's distance from a hub."""
    m, J = len(box.q), box.tool.J
    x, y, z = p[0] - box.hub[k, 0], p[1] - box.hub[k, 1], p[2] - box.hub[k, 2]
    length = np.sqrt(x * x + y * y + z * z)
    if length > 1e-9:
        x, y, z = x / length, y / length, z / length
    out = box.bent[k + 1]
    for j in range(m):
        box.along[k, j] = x * J[0, j] + y * J[1, j] + z * J[2, j] if j > k else 0.0
        out += box.half[j] * abs(box.along[k, j])
    moved = box.moved[k + 1]
    out = min(out, moved)
    box.keeps[k, 0] = max(0.0, length - out - box.loose[k])
    box.keeps[k, 1] = min(np.sqrt((length + out) ** 2 + moved * moved), length + moved) + box.loose[k]


@compiled
def aside(box: Box) -> float:
    """Most that the tool leaves the plane in which it stands at the centre [m]."""
    total = box.bent[0]
    for k in range(len(box.q)):
        total += box.half[k] * abs(box.tool.aside[k])
    return float(min(total, box.moved[0]))


@compiled
def spanned(box: Box, z: float) -> tuple[float, float, int, int]:
    """Distances that the tool may have at a height, and the hubs that tell: low > high where there are none.

    Outwards the tool moves by out . d, upwards by up . d, and upwards by just what the height asks. For any
    share s, out - s up bounds how far outwards it may go; one s for each joint is tried, as the least bound
    is at one of them. Where these tell, the hub is -1.
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
        most, least = min(most, total + s * c), min(least, total - s * c)
    if abs(c) > rise + SLACK or most + least < -SLACK:
        return 1.0, 0.0, -1, -1
    # Past the pivot axis the tool is on the other side, as far away as it went beyond.
    low = max(0.0, tool.at[0] - least)
    high = np.hypot(max(0.0, tool.at[0] + most, least - tool.at[0]), aside(box))
    tells_low = tells_high = -1
    for k in range(m):
        r, rise = np.hypot(box.hub[k, 0], box.hub[k, 1]), z - box.hub[k, 2]
        square = box.keeps[k, 1] ** 2 - rise * rise
        if square < -SLACK:
            return 1.0, 0.0, -1, -1
        wide = np.sqrt(max(0.0, square))
        narrow = np.sqrt(max(0.0, box.keeps[k, 0] ** 2 - rise * rise))
        if r + wide < high:
            high, tells_high = r + wide, k
        if max(narrow - r, r - wide) > low:
            low, tells_low = max(narrow - r, r - wide), k
    return low - SLACK, high + SLACK, tells_low, tells_high


@compiled
def to_halve(meridian: Meridian, box: Box, hub: int) -> int:
    """Which joint to halve so that the bound which a hub tells (-1: the speeds) gains most."""
    best, weight = 0, -1.0
    for j in range(len(box.q)):
        size = meridian.levers[j] * box.half[j]
        if hub >= 0:
            size *= EVEN
            if j > hub:
                size += box.moved[j] - box.moved[j + 1]
            else:
                frame, axis = box.tool.frames[j], box.tool.axes[j]
                size += box.chord[j] * (
                    from_axis(frame, axis, box.hub[hub]) if meridian.arm.revolute[j] else 1.0
                )
        if size > weight:
            best, weight = j, size
    return best


@compiled
def shrink(box: Box, z: float, low: float, high: float) -> bool:
    """Cut off what height and distances rule out, into ``box.shift``; False where nothing is left."""
    m, tool, row = len(box.q), box.tool, box.row
    c, bent, moved = z - tool.at[1], box.bent[0] + SLACK, box.moved[0]
    for k in range(m):
        box.shift[0, k], box.shift[1, k] = -box.half[k], box.half[k]
        row[k] = tool.up[k]
    if not _cut(box, c - bent, c + bent):
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
        slack = bent * np.sqrt(1.0 + s * s)
        if not _cut(box, from_ - s * c - slack, to - s * c + slack):
            return False
    return _shrink_by_hubs(box, z, low, high)


@compiled
def _shrink_by_hubs(box: Box, z: float, low: float, high: float) -> bool:
    """Cut off what would take the tool too near to a hub, or too far from it."""
    m = len(box.q)
    p = box.tool.frames[m, :3, 3]
    for k in range(m - 1):
        r, rise = np.hypot(box.hub[k, 0], box.hub[k, 1]), z - box.hub[k, 2]
        length = np.sqrt(((p - box.hub[k]) ** 2).sum())
        moved, slack = box.moved[k + 1], box.bent[k + 1] + box.loose[k] + SLACK
        if slack > length or moved > length:
            continue
        most = np.hypot(high + r, rise)
        least = np.hypot(max(0.0, max(low - r, r - high)), rise) - box.loose[k]
        least = np.sqrt(max(0.0, least * least - moved * moved)) if least > 0.0 else 0.0
        box.row[:] = box.along[k]
        if not _cut(box, least - length - box.bent[k + 1] - SLACK, most - length + slack):
            return False
    return True


@compiled
def _cut(box: Box, from_: float, to: float) -> bool:
    """Shrink ``box.shift`` by from_ <= row . d <= to; False where nothing is left."""
    m, shift = len(box.row), box.shift
    least = most = 0.0
    for k in range(m):
        a, b = box.row[k] * shift[0, k], box.row[k] * shift[1, k]
        least += min(a, b)
        most += max(a, b)
    if least > to or most < from_:
        return False
    for k in range(m):
        c = box.row[k]
        if abs(c) < 1e-9:
            continue
        a, b = c * shift[0, k], c * shift[1, k]
        others_least, others_most = least - min(a, b), most - max(a, b)
        u, v = (from_ - others_most) / c, (to - others_least) / c
        shift[0, k] = max(shift[0, k], min(u, v))
        shift[1, k] = min(shift[1, k], max(u, v))
        if shift[0, k] > shift[1, k]:
            return False
        a, b = c * shift[0, k], c * shift[1, k]
        least, most = others_least + min(a, b), others_most + max(a, b)
    return True
