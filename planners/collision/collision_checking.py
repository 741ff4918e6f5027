"""How far a motion goes before a link may come too near, compiled.

On a hop the base turns evenly while it moves straight or rolls along an arc, and joints move evenly. The gap
between two hulls now, less what is to be kept, is used up no sooner than (a) the fastest point needs to move
that far, or (b) a corner needs to cross the plane between them, given its velocity now and the most it can
accelerate. Either bound is proven, so the hop is gone along by the longer of the two steps until it ends or
the steps vanish.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.collision.contacts import ROUNDING, SHORTEST, exempt_for, touches, until_plane
from regionik.planners.collision.gjk import hull_gap
from regionik.planners.collision.robot_bodies import Exempt, Hulls, Movers
from regionik.planners.collision.robot_motion import BASE, WORLD, Hop, hop_between, pace, place, put, twist
from regionik.planners.geometry.polygons import Index, compiled
from regionik.planners.solvers.serial_chain import SerialArm
from regionik.worlds.arrays import Array

MOST_STEPS = 1000
CHORDS = 8  # most parts of a hop whose boxes bound where the links pass
CHORD = 0.2  # largest turn of base or joint in one of them, while they are fewer [rad]


@compiled
def advance(
    arm: SerialArm,
    mount: Array,
    movers: Movers,
    hulls: Hulls,
    hop: Hop,
    exempt: Exempt,
    k: int,
    m: int,
    keep: float,
) -> float:
    """Part of a hop over which solid k is proven to keep a distance from hull m; 1 or more is all of it."""
    A = movers.corners[movers.first[k] : movers.first[k + 1]]
    B = hulls.corners[hulls.first[m] : hulls.first[m + 1]]
    link, frame = movers.link[k], hulls.frame[m]
    speed, acceleration = pace(arm, mount, hop, link, frame, A)
    tool = arm.tool[:3, 3].copy().reshape(1, 3)
    pace_of_tool = pace(arm, mount, hop, len(arm.axis) - 1, frame, tool)[0]
    may_touch = frame == WORLD and movers.outermost[k]
    need = movers.radius[k] + hulls.ball[m] + keep + ROUNDING
    frames, placed = np.empty((len(arm.axis) + 2, 4, 4)), np.empty_like(A)
    way, spot, V, W = np.zeros(3), np.empty(3), np.empty(3), np.empty(3)
    s = 0.0
    for _ in range(MOST_STEPS):
        place(arm, mount, hop, s, frame, frames)
        put(frames[link], A, placed)
        free = hull_gap(placed, B, hulls.disc[m], way, spot)[0] - need
        step = 0.0
        if free > 0.0:
            twist(arm, hop, frames, s, link, frame, V, W)
            step = until_plane(placed, way, free, V, W, acceleration)
            step = max(step, free / speed if speed > 0.0 else np.inf)
        if may_touch:
            left = exempt_for(exempt, hulls.owner[m], frames[-2, :3, 3])
            if left >= 0.0:
                rest = min(1.0 - s, left / pace_of_tool if pace_of_tool > 0.0 else np.inf)
                step = max(step, touches(arm, mount, movers, hulls, hop, exempt, k, m, s, frames, rest))
        if s + step >= 1.0 or step < SHORTEST:
            return s + step if s + step >= 1.0 else s
        s += step
    return s


@compiled
def swept(arm: SerialArm, mount: Array, movers: Movers, hop: Hop, boxes: Array) -> None:
    """Write boxes (solids, 2, 3) along the world's axes that hold all that the solids' corners pass."""
    turn = abs(hop.drive[2])
    for k in range(len(hop.bend)):
        turn = max(turn, abs(hop.bend[k]))
    chords = min(max(1, math.ceil(turn / CHORD)), CHORDS)
    frames, placed = np.empty((len(arm.axis) + 2, 4, 4)), np.empty_like(movers.corners)
    for c in range(chords + 1):
        place(arm, mount, hop, c / chords, WORLD, frames)
        for k in range(len(movers.link)):
            a, b = movers.first[k], movers.first[k + 1]
            put(frames[movers.link[k]], movers.corners[a:b], placed[a:b])
            for d in range(3):
                low, high = (np.inf, -np.inf) if c == 0 else (boxes[k, 0, d], boxes[k, 1, d])
                for j in range(a, b):
                    low, high = min(low, placed[j, d]), max(high, placed[j, d])
                boxes[k, 0, d], boxes[k, 1, d] = low, high
    for k in range(len(movers.link)):
        points = movers.corners[movers.first[k] : movers.first[k + 1]]
        sag = pace(arm, mount, hop, movers.link[k], WORLD, points)[1] / (8 * chords * chords)
        for d in range(3):
            boxes[k, 0, d] -= sag
            boxes[k, 1, d] += sag


@compiled
def box_gap(a: Array, b: Array) -> float:
    """Distance between two boxes along the same axes, each (2, 3), low and high; 0 where they meet [m]."""
    square = 0.0
    for d in range(3):
        apart = max(0.0, a[0, d] - b[1, d], b[0, d] - a[1, d])
        square += apart * apart
    return math.sqrt(square)


@compiled
def _rests(hop: Hop, link: int, frame: int) -> bool:
    """Whether no joint between a frame of the robot and a link moves."""
    return not hop.bend[max(frame, BASE) + 1 : link + 1].any()


@compiled
def first_stop(
    arm: SerialArm,
    mount: Array,
    movers: Movers,
    hulls: Hulls,
    hop: Hop,
    exempt: Exempt,
    boxes: Array,
    keep: float,
    shown: bool,
) -> tuple[int, int, float]:
    """The first solid and hull not proven to keep a distance, and the part of the hop; -1, -1, 1 if all are.

    ``boxes`` (solids, 2, 3) is overwritten with where the solids pass. Where the hop's beginning is ``shown``
    to keep all distances, solids of the robot that rest against one another are not looked at again.
    """
    swept(arm, mount, movers, hop, boxes)
    for k in range(len(movers.link)):
        m = 0
        while m < len(hulls.frame):
            after, within, owner = hulls.next[m], movers.radius[k] + keep + ROUNDING, hulls.owner[m]
            if m < hulls.world:
                near = box_gap(boxes[k], hulls.boxes[m]) <= within
            else:
                near = movers.meets[k, m - hulls.world]
                near = near and not (shown and _rests(hop, movers.link[k], hulls.frame[m]))
                if near and owner >= 0:  # where that solid passes is known too
                    near = box_gap(boxes[k], boxes[owner]) <= within + hulls.disc[m] + hulls.ball[m]
            if near:
                s = advance(arm, mount, movers, hulls, hop, exempt, k, m, keep)
                if s < 1.0:
                    if after == m + 1:
                        return k, m, s
                    after = m + 1  # the hull bounds triangles: look at them
            m = after
    return -1, -1, 1.0


@compiled
def first_stop_on_way(
    arm: SerialArm,
    mount: Array,
    movers: Movers,
    hulls: Hulls,
    bases: Array,
    joints: Array,
    rolls: bool,
    exempt: Exempt,
    keep: float,
) -> tuple[int, int, int, float]:
    """As `first_stop`, for hops through states (n + 1, ...): which of them comes first, n where all hold."""
    boxes = np.empty((len(movers.link), 2, 3))
    for i in range(len(bases) - 1):
        hop = hop_between(bases[i], joints[i], bases[i + 1], joints[i + 1], rolls)
        k, m, s = first_stop(arm, mount, movers, hulls, hop, exempt, boxes, keep, i > 0)
        if k >= 0:
            return i, k, m, s
    return len(bases) - 1, -1, -1, 1.0


@compiled
def _may_touch(
    arm: SerialArm,
    mount: Array,
    movers: Movers,
    hulls: Hulls,
    still: Hop,
    exempt: Exempt,
    k: int,
    m: int,
    frames: Array,
) -> bool:
    """Whether solid k may touch hull m, and does so as it may, in a hop that goes nowhere."""
    if not movers.outermost[k] or exempt_for(exempt, hulls.owner[m], frames[-2, :3, 3]) < 0.0:
        return False
    return touches(arm, mount, movers, hulls, still, exempt, k, m, 0.0, frames, 1.0) >= 1.0


@compiled
def lower_bounds(
    arm: SerialArm,
    mount: Array,
    movers: Movers,
    hulls: Hulls,
    hop: Hop,
    exempt: Exempt,
    which: Index,
    within: float,
    lower: Array,
) -> float:
    """Write lower bounds of distances at the start of a hop, (solids, hulls); inf where none is looked at.

    Returns the smallest upper bound, or ``within``. Triangles of meshes are left to their hulls.
    """
    first_k, first_m, nearest = -1, -1, within
    frames, boxes = np.empty((len(arm.axis) + 2, 4, 4)), np.empty((len(movers.link), 2, 3))
    still = Hop(hop.base, np.zeros(3), 0.0, hop.joints, np.zeros(len(hop.joints)))
    swept(arm, mount, movers, still, boxes)
    place(arm, mount, still, 0.0, WORLD, frames)
    for k in range(len(movers.link)):
        for m in range(len(hulls.frame)):
            lower[k, m] = np.inf
    for k in which:
        m = 0
        while m < len(hulls.frame):
            if m >= hulls.world:
                lower[k, m] = -np.inf if movers.meets[k, m - hulls.world] else np.inf
            elif not _may_touch(arm, mount, movers, hulls, still, exempt, k, m, frames):
                lower[k, m] = box_gap(boxes[k], hulls.boxes[m]) - movers.radius[k]
                if lower[k, m] < nearest:
                    first_k, first_m, nearest = k, m, lower[k, m]
            m = hulls.next[m]
    best = within
    if first_k >= 0:  # with the distance of the row whose box is nearest, few others are looked at
        best = _tighten(arm, mount, movers, hulls, still, first_k, first_m, lower, best)
    for k in which:
        for m in range(len(hulls.frame)):
            if lower[k, m] < best and not (k == first_k and m == first_m):
                best = _tighten(arm, mount, movers, hulls, still, k, m, lower, best)
            elif lower[k, m] > best + ROUNDING:
                lower[k, m] = np.inf
    return best


@compiled
def _tighten(
    arm: SerialArm,
    mount: Array,
    movers: Movers,
    hulls: Hulls,
    hop: Hop,
    k: int,
    m: int,
    lower: Array,
    best: float,
) -> float:
    """Put the bound from the hulls in the place of that from boxes; returns the least upper bound so far."""
    A = movers.corners[movers.first[k] : movers.first[k + 1]]
    B = hulls.corners[hulls.first[m] : hulls.first[m + 1]]
    frames, placed = np.empty((len(arm.axis) + 2, 4, 4)), np.empty_like(A)
    place(arm, mount, hop, 0.0, hulls.frame[m], frames)
    put(frames[movers.link[k]], A, placed)
    low, high = hull_gap(placed, B, hulls.disc[m], np.zeros(3), np.empty(3))
    thick = movers.radius[k] + hulls.ball[m]
    lower[k, m] = low - thick
    return min(best, high - thick) if hulls.next[m] == m + 1 else best


class Keep(NamedTuple):
    """Solids that the arm keeps off, as `touching` has them.

    Attributes
    ----------
    arm : SerialArm
    mount : (4, 4) array
    movers : Movers
    hulls : Hulls
    within : float
        Distance that is kept [m].
    on : bool
        Whether it keeps off at all.
    exempt : Exempt
        How the last link may touch what the tool works on; its spots are not looked at.
    """

    arm: SerialArm
    mount: Array
    movers: Movers
    hulls: Hulls
    within: float
    on: bool
    exempt: Exempt


@compiled
def _gap(movers: Movers, hulls: Hulls, placed: Array, k: int, m: int) -> float:
    """Lower bound of the distance of a solid, its corners placed in the frame of a row, from that row."""
    A = placed[movers.first[k] : movers.first[k + 1]]
    B = hulls.corners[hulls.first[m] : hulls.first[m + 1]]
    low = hull_gap(A, B, hulls.disc[m], np.zeros(3), np.empty(3))[0]
    return float(low - movers.radius[k] - hulls.ball[m])


@compiled
def _clear_of_itself(keep: Keep, hop: Hop, frames: Array, placed: Array) -> bool:
    """True where solids keep their distance from one another and the base; both arrays are overwritten."""
    arm, mount, movers, hulls, within, _, _ = keep
    for m in range(hulls.world, len(hulls.frame)):
        seen = False
        for k in range(len(movers.link)):
            if movers.meets[k, m - hulls.world]:
                if not seen:
                    place(arm, mount, hop, 0.0, hulls.frame[m], frames)
                    seen = True
                a, b = movers.first[k], movers.first[k + 1]
                put(frames[movers.link[k]], movers.corners[a:b], placed[a:b])
                if _gap(movers, hulls, placed, k, m) < within:
                    return False
    return True


@compiled
def is_clear(keep: Keep, base: Array, q: Array, tool_on: int) -> bool:
    """True where every solid of the robot is proven to keep its distance; the tool works on ``tool_on``.

    Lower bounds decide, and meshes count as their hulls: what is clear by a hair may be refused.
    """
    arm, mount, movers, hulls, within, _, exempt = keep
    hop = Hop(base, np.zeros(3), 0.0, q, np.zeros(len(q)))
    frames, placed = np.empty((len(arm.axis) + 2, 4, 4)), np.empty_like(movers.corners)
    boxes, whole = np.empty((len(movers.link), 2, 3)), np.empty((2, 3))
    place(arm, mount, hop, 0.0, WORLD, frames)
    whole[0], whole[1] = np.inf, -np.inf
    for k in range(len(movers.link)):
        a, b = movers.first[k], movers.first[k + 1]
        put(frames[movers.link[k]], movers.corners[a:b], placed[a:b])
        for d in range(3):
            boxes[k, 0, d], boxes[k, 1, d] = np.inf, -np.inf
            for i in range(a, b):
                boxes[k, 0, d] = min(boxes[k, 0, d], placed[i, d] - movers.radius[k])
                boxes[k, 1, d] = max(boxes[k, 1, d], placed[i, d] + movers.radius[k])
            whole[0, d], whole[1, d] = min(whole[0, d], boxes[k, 0, d]), max(whole[1, d], boxes[k, 1, d])
    m = 0
    while m < hulls.world:
        if box_gap(whole, hulls.boxes[m]) <= within:
            for k in range(len(movers.link)):
                near = box_gap(boxes[k], hulls.boxes[m]) <= within
                if near and _gap(movers, hulls, placed, k, m) < within:
                    if not movers.outermost[k] or hulls.owner[m] != tool_on:
                        return False
                    if touches(arm, mount, movers, hulls, hop, exempt, k, m, 0.0, frames, 1.0) < 1.0:
                        return False
        m = hulls.next[m]
    return _clear_of_itself(keep, hop, frames, placed)
