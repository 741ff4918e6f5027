"""The capsules of an arm in one plane, judged all over a cell of its postures.

A capsule lies near where it lies in the middle of the cell: on the last link it turns about the tool, on the
middle link about the wrist, on the first link about the shoulder, and with the plane about the target or the
pivot axis.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.planners.clearance.ownbody import between
from regionik.planners.clearance.planecell import (
    AWAY,
    CLEAR,
    DOUBT,
    GONE,
    NEAR,
    PITCH,
    SLACK,
    TURN,
    YAW,
    Frame,
    Look,
    chord,
)
from regionik.planners.geometry.flat import Index, compiled
from regionik.planners.geometry.upright import Uprights, distance_along, least_along
from regionik.worlds.arrays import Array

PIVOT, UPPER, MIDDLE, LAST = range(4)  # which link of the plane carries a solid
SECTIONS = 6  # golden sections along a solid where a proof is sought


class Cores(NamedTuple):
    """The capsules of an arm, held by links of its plane.

    Attributes
    ----------
    rank : (s,) array of int
        `PIVOT`, `UPPER`, `MIDDLE` or `LAST`.
    ends : (s, 2, 3) array
        Along the link, square to it in the plane, and off the plane; seen from the pivot axis at the floor,
        the shoulder, the wrist and the tool [m].
    radius : (s,) array
        [m]
    outermost : (s,) array of bool
        Of the last link that has a solid.
    pairs : (p, 2) array of int
        Capsules that may run into each other.
    heeds : (h,) array of int
        Capsules that may run into the base.
    body : Uprights
        The base's own body, in its frame.
    deep : (b,) array
        No point of its parts is farther inside than this [m].
    """

    rank: Index
    ends: Array
    radius: Array
    outermost: NDArray[np.bool_]
    pairs: Index
    heeds: Index
    body: Uprights
    deep: Array


class Around(NamedTuple):
    """What the arm keeps off near a target.

    Attributes
    ----------
    solids : Uprights
    deep : (m,) array
        No point of a solid is farther inside than this [m].
    near : (k,) array of int
        Which of them matter.
    owner : (m,) array of int
        Obstacle that each solid is part of.
    tool_on : int
        Obstacle that the outermost solids may touch, -1 for none.
    clearance : float
        [m]
    tolerance : float
        How far the tool may be off the target [m].
    """

    solids: Uprights
    deep: Array
    near: Index
    owner: Index
    tool_on: int
    clearance: float
    tolerance: float


@compiled
def swung(sway: float, level: float, off: float, turned: float) -> float:
    """Most that a point moves that sways in its plane and turns with it about an axis a level way off.

    Both go square to each other, but for what the turn goes inwards, and for what the point is off the plane.
    """
    across = level * turned
    square = sway * sway + across * across + sway * turned * (across + 2.0 * off)
    return math.sqrt(square)


@compiled
def lay(
    cores: Cores, frame: Frame, z: float, whole: bool, mid: Array, half: Array, look: Look, vary: Array
) -> None:
    """Write where capsules lie in the middle of a cell, and how far they move; ``whole`` if links meet."""
    plane, away = frame.plane, mid[AWAY]
    a, c = plane.lengths[0], plane.lengths[2]
    at_last = c * chord(vary[2])
    for s in range(len(cores.rank)):
        rank = cores.rank[s]
        r, up, angle = 0.0, 0.0, 0.0
        if rank == UPPER:
            r, up, angle = plane.shoulder_r, plane.shoulder_z, look.bends[0]
        elif rank == MIDDLE:
            angle = look.bends[1]
            r, up = away - c * math.cos(look.bends[2]), z - c * math.sin(look.bends[2])
        elif rank == LAST:
            r, up, angle = away, z, look.bends[2]
        cos, sin = math.cos(angle), math.sin(angle)
        for e in range(2):
            along, across = cores.ends[s, e, 0], cores.ends[s, e, 1]
            look.points[s, e, 0] = r + cos * along - sin * across
            look.points[s, e, 1] = up + sin * along + cos * across
            look.points[s, e, 2] = cores.ends[s, e, 2]
            lever = math.sqrt(along * along + across * across)
            from_target, from_axis = half[AWAY], 0.0
            if rank == UPPER:
                from_axis = lever * chord(vary[0])
                from_target = half[AWAY] + from_axis
            elif rank == MIDDLE:
                from_target = at_last + lever * chord(vary[1])
                from_axis = half[AWAY] + from_target
                if whole:  # as a point beyond the elbow
                    beyond = math.hypot(along + plane.lengths[1], across)
                    from_axis = min(from_axis, a * chord(vary[0]) + beyond * chord(vary[1]))
            elif rank == LAST:
                from_target = lever * chord(vary[2])
                from_axis = half[AWAY] + from_target
            look.sway[s, e, 0], look.sway[s, e, 1] = from_target, from_axis


@compiled
def _meets(
    solids: Uprights, deep: Array, k: int, a: Array, b: Array, at_a: float, at_b: float, reach: float
) -> int:
    """Whether a segment whose ends may move so far comes within ``reach`` of a solid.

    `GONE` where it does however they move, `CLEAR` where it does not; where it may or may not, `DOUBT` if it
    does in the middle and `NEAR` if not.
    """
    most = max(at_a, at_b)
    half = 0.5 * math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
    if distance_along(solids, k, a, b, 0.5) - half >= reach + most:
        return CLEAR
    if min(at_a, at_b) >= reach + deep[k]:
        return DOUBT  # too wide a cell to tell
    off = least_along(solids, k, a, b, 0.0, 0.0, reach, reach + most, SECTIONS)
    if off >= reach:
        return CLEAR if off >= reach + most else NEAR
    return GONE if least_along(solids, k, a, b, at_a, at_b, reach, reach, SECTIONS) < reach else DOUBT


@compiled
def _widen(
    cores: Cores,
    frame: Frame,
    mid: Array,
    half: Array,
    look: Look,
    s: int,
    seen: int,
    hit: bool,
    turned: float,
    side: int,
) -> None:
    """Widen the sides of a cell that leave open where a capsule is; ``side`` turns it out of its plane.

    Where it is hit in the middle, the end that moves less is the one to be shown to be hit everywhere.
    """
    pitch, away = frame.plane.lengths[2] * chord(half[PITCH]), half[AWAY]
    e = 0 if (look.sway[s, 0, seen] < look.sway[s, 1, seen]) == hit else 1
    sway, known = look.sway[s, e, seen], 0.0  # what of it comes from the pitch alone
    if cores.rank[s] == PIVOT:
        pitch = 0.0
    elif seen == 0 and cores.rank[s] != UPPER:
        known = sway if cores.rank[s] == LAST else min(pitch, sway)
    share = away / (away + pitch) if away + pitch > 0.0 else 0.0
    r = look.points[s, e, 0] - (mid[AWAY] if seen == 0 else 0.0)
    look.wide[AWAY] = max(look.wide[AWAY], (sway - known) * share)
    look.wide[PITCH] = max(look.wide[PITCH], known + (sway - known) * (1.0 - share))
    look.wide[side] = max(look.wide[side], turned * math.hypot(r, look.points[s, e, 2]))


@compiled
def _turn(
    look: Look, s: int, seen: int, x: float, y: float, away: float, angle: float, turned: float,
    ends: Array, moves: Array,
) -> None:  # fmt: skip
    """Write the ends (2, 3) of a capsule with its plane turned about (x, y), and how far they move (2,)."""
    cos, sin = math.cos(angle), math.sin(angle)
    for e in range(2):
        r, w = look.points[s, e, 0] - away, look.points[s, e, 2]
        ends[e, 0], ends[e, 1] = x + cos * r - sin * w, y + sin * r + cos * w
        ends[e, 2] = look.points[s, e, 1]
        moves[e] = swung(look.sway[s, e, seen], math.hypot(r, w), abs(w), turned)


@compiled
def keeps_off(
    cores: Cores, frame: Frame, around: Around, target: Array, mid: Array, half: Array, look: Look
) -> int:
    """Whether the capsules keep their distance from obstacles: `CLEAR` in the middle, `GONE` nowhere."""
    turned = chord(half[YAW])
    ends, moves, known = np.empty((2, 3)), np.empty(2), CLEAR
    for s in range(len(cores.rank) - 1, -1, -1):
        _turn(look, s, 0, target[0], target[1], mid[AWAY], mid[YAW], turned, ends, moves)
        moves += around.tolerance
        for k in around.near:
            if cores.outermost[s] and around.owner[k] == around.tool_on:
                continue
            reach = cores.radius[s] + around.clearance - SLACK
            seen = _meets(around.solids, around.deep, k, ends[0], ends[1], moves[0], moves[1], reach)
            if seen == GONE:
                return GONE
            if seen != CLEAR:
                _widen(cores, frame, mid, half, look, s, 0, seen == DOUBT, turned, YAW)
            known = DOUBT if seen == DOUBT else known
    return known


@compiled
def keeps_to_itself(cores: Cores, frame: Frame, mid: Array, half: Array, look: Look) -> int:
    """Whether the capsules keep off each other and the base: `CLEAR` in the middle, `GONE` nowhere."""
    known = CLEAR
    for i, k in cores.pairs:
        off = between(look.points[i, 0], look.points[i, 1], look.points[k, 0], look.points[k, 1])
        off -= cores.radius[i] + cores.radius[k] - SLACK
        least = np.inf
        for seen in range(2):
            one = max(look.sway[i, 0, seen], look.sway[i, 1, seen])
            least = min(least, one + max(look.sway[k, 0, seen], look.sway[k, 1, seen]))
        if off + least < 0.0:
            return GONE
        if off < least:
            _widen(cores, frame, mid, half, look, i, 0, False, 0.0, TURN)
            _widen(cores, frame, mid, half, look, k, 0, False, 0.0, TURN)
            known = DOUBT if off < 0.0 else known
    turn, turned = mid[TURN] + frame.zero, chord(half[TURN])
    ends, moves = np.empty((2, 3)), np.empty(2)
    for s in cores.heeds:
        _turn(look, s, 1, frame.mount[0], frame.mount[1], 0.0, turn, turned, ends, moves)
        for m in range(len(cores.body.disc)):
            reach = cores.radius[s] - SLACK
            meets = _meets(cores.body, cores.deep, m, ends[0], ends[1], moves[0], moves[1], reach)
            if meets == GONE:
                return GONE
            if meets != CLEAR:
                _widen(cores, frame, mid, half, look, s, 1, meets == DOUBT, turned, TURN)
            known = DOUBT if meets == DOUBT else known
    return known
