"""Where a base may stand, and how its planar arm then reaches, for many targets in one compiled loop.

Reach is taken at its exact radii, the floor as `ringfloor` sees it. Of postures those far from their limits
come first; where one comes too near to something, others follow, at that place and at more.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.planners.clearance.moving import WORLD, Hop, Hulls, Movers, place, put
from regionik.planners.clearance.sweeping import box_gap
from regionik.planners.geometry.angles import wrap
from regionik.planners.geometry.flat import Index, compiled
from regionik.planners.geometry.hulls import hull_gap
from regionik.planners.reach.ringfloor import MOST_CUTS, Parts, distances, meets, on_circle
from regionik.planners.solvers.planar_arm import PlaneArm, reach_intervals, self_motion, widest_posture
from regionik.planners.solvers.serial_chain import SerialArm
from regionik.worlds.arrays import Array

MOST_RINGS = 16
WIDE = 24  # pitches among which the posture farthest from its limits is chosen
PITCHES = 16  # of the last link, looked through where a posture touches something
FEW, MANY = 4, 16  # places on a circle
SHARES = np.array([0.5, 0.8, 0.2, 0.95, 0.05])  # of the way through a ring, at which circles are drawn
MOST_LOOKS = 600  # postures of one target


class Stance(NamedTuple):
    """How places and bends become base and joints.

    Attributes
    ----------
    plane : PlaneArm
    sign, offset : (3,) array
        ``bend = sign * joint + offset`` [rad].
    zero : float
        Direction of the arm's plane, seen from the base, with the pivot at zero [rad].
    low, high : float
        What the pivot may turn; the base turns the rest [rad].
    mount : (2,) array
        The arm axis in the base frame [m].
    yaw, turn : float
        Heading that is kept where it can be, and by how much it may change [rad].
    carry : (dof,) array
        Joints that do not matter.
    """

    plane: PlaneArm
    sign: Array
    offset: Array
    zero: float
    low: float
    high: float
    mount: Array
    yaw: float
    turn: float
    carry: Array


class Reach(NamedTuple):
    """The arm's reach: circles of its plane on which it can begin or end, and what is kept from both ends.

    Attributes
    ----------
    centers : (k, 2) array
        [m]
    radii : (k,) array
        [m]
    margin : float
        [m]
    """

    centers: Array
    radii: Array
    margin: float


class Keep(NamedTuple):
    """What the arm keeps off, as `touching` has it.

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
    """

    arm: SerialArm
    mount: Array
    movers: Movers
    hulls: Hulls
    within: float
    on: bool


@compiled
def stand(stance: Stance, x: float, y: float, plane_yaw: float, bends: Array, base: Array, q: Array) -> bool:
    """Write base (3,) and joints (dof,) of a posture from a place; False where the base turns too far."""
    q[:] = stance.carry
    middle = 0.0
    if np.isfinite(stance.low) and np.isfinite(stance.high):
        middle = 0.5 * (stance.low + stance.high)
    turn = middle + wrap(plane_yaw - stance.yaw - stance.zero - middle)
    q[0] = min(max(turn, stance.low), stance.high)
    for k in range(3):
        q[k + 1] = stance.sign[k] * (bends[k] - stance.offset[k])
    yaw = stance.yaw + turn - q[0]
    c, s = math.cos(yaw), math.sin(yaw)
    base[0] = x - (c * stance.mount[0] - s * stance.mount[1])
    base[1] = y - (s * stance.mount[0] + c * stance.mount[1])
    base[2] = yaw
    return bool(abs(yaw - stance.yaw) <= stance.turn)


@compiled
def _gap(movers: Movers, hulls: Hulls, placed: Array, k: int, m: int) -> float:
    """Lower bound of the distance of a solid, its corners placed in the frame of a row, from that row."""
    A = placed[movers.first[k] : movers.first[k + 1]]
    B = hulls.corners[hulls.first[m] : hulls.first[m + 1]]
    low = hull_gap(A, B, hulls.disc[m], np.zeros(3), np.empty(3))[0]
    return float(low - movers.radius[k] - hulls.ball[m])


@compiled
def _clear_of_itself(keep: Keep, hop: Hop, frames: Array, placed: Array) -> bool:
    """Whether solids keep their distance from one another and from the base; both arrays are overwritten."""
    arm, mount, movers, hulls, within, _ = keep
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
    """Whether every solid of the robot is proven to keep its distance; the tool works on ``tool_on``.

    Lower bounds decide, and meshes count as their hulls: what is clear by a hair may be refused.
    """
    arm, mount, movers, hulls, within, _ = keep
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
                exempt = movers.outermost[k] and hulls.owner[m] == tool_on
                near = not exempt and box_gap(boxes[k], hulls.boxes[m]) <= within
                if near and _gap(movers, hulls, placed, k, m) < within:
                    return False
        m = hulls.next[m]
    return _clear_of_itself(keep, hop, frames, placed)


@compiled
def near_boxes(boxes: Array, targets: Array, by: float, near: NDArray[np.bool_]) -> None:
    """Mark targets (n, 3) that are in a box (m, 2, 3) or at most ``by`` from it along an axis."""
    for i in range(len(targets)):
        near[i] = False
        for box in boxes:
            off = 0.0
            for d in range(3):
                off = max(off, box[0, d] - targets[i, d], targets[i, d] - box[1, d])
            if off <= by:
                near[i] = True
                break


@compiled
def _rings(stance: Stance, reach: Reach, z: float, rings: Array) -> int:
    return reach_intervals(stance.plane, -np.inf, np.inf, reach.centers, reach.radii, z, True, True, rings)


@compiled
def _open(parts: Parts, rings: Array, x: float, y: float) -> bool:
    """Whether some place of the floor is at a distance of some ring, by rounding's width or more."""
    low, high = np.empty(len(parts.hull) - 1), np.empty(len(parts.hull) - 1)
    far = 0.0
    for k in range(len(rings)):
        far = max(far, abs(rings[k, 0]), abs(rings[k, 1]))
    distances(parts, x, y, far + 1e-9, low, high)
    for k in range(len(rings)):
        a, b = min(abs(rings[k, 0]), abs(rings[k, 1])), max(abs(rings[k, 0]), abs(rings[k, 1]))
        if meets(low, high, a - 1e-9, b + 1e-9):
            return True
    return False


@compiled
def _looked(
    stance: Stance,
    keep: Keep,
    tool_on: int,
    bends: Array,
    target: Array,
    facing: float,
    place: Array,
    every: bool,
    base: Array,
    q: Array,
) -> tuple[bool, int]:
    """Whether a posture at a place is clear, written to ``base`` and ``q``; and how many were looked at."""
    dx, dy = target[0] - place[0], target[1] - place[1]
    rho = math.hypot(dx, dy)
    plane_yaw = math.atan2(facing * dy, facing * dx)
    if every:
        count = self_motion(stance.plane, np.nan, facing * rho, target[2], PITCHES, bends)
    else:
        count = int(widest_posture(stance.plane, np.nan, facing * rho, target[2], bends[0], WIDE))
    for k in range(count):
        stands = stand(stance, place[0], place[1], plane_yaw, bends[k], base, q)
        if stands and (not keep.on or is_clear(keep, base, q, tool_on)):
            return True, k + 1
    return False, count


@compiled
def _found(
    stance: Stance,
    reach: Reach,
    inner: Parts,
    keep: Keep,
    tool_on: int,
    bends: Array,
    target: Array,
    rings: Array,
    base: Array,
    q: Array,
) -> bool:
    """Whether a clear posture was found from a place of the inner floor."""
    parts = len(inner.hull) - 1
    low, high, cuts, places = np.empty(parts), np.empty(parts), np.empty(MOST_CUTS), np.empty((MANY, 2))
    far = 0.0
    for k in range(len(rings)):
        far = max(far, abs(rings[k, 0]), abs(rings[k, 1]))
    distances(inner, target[0], target[1], far, low, high)
    looks = 0
    for level in range(len(SHARES) + 1):
        every, share = level > 0, SHARES[max(0, level - 1)]
        for k in range(len(rings)):
            facing = 1.0 if rings[k, 0] + rings[k, 1] > 0.0 else -1.0
            a = min(abs(rings[k, 0]), abs(rings[k, 1])) + reach.margin
            b = max(abs(rings[k, 0]), abs(rings[k, 1])) - reach.margin
            for c in range(parts):
                near, away = max(a, low[c]), min(b, high[c])
                if near >= away:
                    continue
                r = near + share * (away - near)
                room = places if every else places[:FEW]
                count = on_circle(inner, target[0], target[1], r, cuts, room, 0)
                for p in range(count):
                    good, more = _looked(
                        stance, keep, tool_on, bends, target, facing, places[p], every, base, q
                    )
                    if good:
                        return True
                    looks += more
                    if looks > MOST_LOOKS:
                        return False
    return False


@compiled
def meet(stance: Stance, reach: Reach, parts: Parts, targets: Array, state: Index) -> None:
    """Raise ``state`` (n,): 1 where the arm reaches a target's height, 2 where from a place of the floor too.

    Where it stays below 2, there is proven to be no such place. Those that are at 2 are not looked at.
    """
    rings = np.empty((MOST_RINGS, 2))
    for i in range(len(targets)):
        if state[i] < 2:
            count = _rings(stance, reach, targets[i, 2], rings)
            if count > 0:
                state[i] = 2 if _open(parts, rings[:count], targets[i, 0], targets[i, 1]) else 1


@compiled
def find(
    stance: Stance,
    reach: Reach,
    inner: Parts,
    keep: Keep,
    targets: Array,
    owners: Index,
    found: NDArray[np.bool_],
    bases: Array,
    joints: Array,
) -> None:
    """Look for configurations that are clear, with the arm axis on a floor.

    Parameters
    ----------
    stance, reach, inner, keep
    targets : (n, 3) array
        [m]
    owners : (n,) array of int
        Obstacle that the last link may touch at each target; -1 for none.
    found : (n,) array of bool
        Set where there is one; those that are set are not looked at.
    bases, joints : (n, 3), (n, dof) arrays
        Overwritten with what was found.
    """
    rings, bends = np.empty((MOST_RINGS, 2)), np.empty((2 * PITCHES, 3))
    for i in range(len(targets)):
        if not found[i]:
            count = _rings(stance, reach, targets[i, 2], rings)
            found[i] = _found(
                stance, reach, inner, keep, owners[i], bends, targets[i], rings[:count], bases[i], joints[i]
            )
