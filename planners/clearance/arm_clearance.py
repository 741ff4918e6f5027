"""A planar arm on its base as compiled values, and the proof that a posture of it keeps its distance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.clearance.contacts import touches
from regionik.planners.clearance.robot_motion import WORLD, Exempt, Hop, Hulls, Movers, place, put
from regionik.planners.clearance.swept_motion import box_gap
from regionik.planners.geometry.hulls import hull_gap
from regionik.planners.geometry.polygons import compiled
from regionik.planners.solvers.planar_kinematics import PlanarLinkage
from regionik.planners.solvers.serial_chain import SerialArm
from regionik.worlds.arrays import Array

MOST_RINGS = 16  # intervals of reach at one height


class Stance(NamedTuple):
    """Joints and base of a planar arm, as its bends and the place of its axis give them.

    Attributes
    ----------
    plane : PlanarLinkage
    sign, offset : (3,) array
        ``bend = sign * joint + offset`` [rad].
    zero : float
        Direction of the arm's plane, seen from the base, with the pivot at zero [rad].
    low, high : float
        What the pivot may turn; the base turns the rest [rad].
    mount : (2,) array
        The arm axis in the base frame [m].
    yaw : float
        Heading of the base at the start [rad].
    """

    plane: PlanarLinkage
    sign: Array
    offset: Array
    zero: float
    low: float
    high: float
    mount: Array
    yaw: float


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
