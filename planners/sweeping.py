"""How far a motion goes before a link may come too near, compiled.

On a hop the base moves straight and turns evenly, and joints move evenly. The gap between two hulls now, less
what is to be kept, is used up no sooner than (a) the fastest point needs to move that far, or (b) a corner
needs to cross the plane between them, given its velocity now and the most it can accelerate. Either bound is
proven, so the hop is gone along by the longer of the two steps until it ends or the steps vanish.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.planners.flat import Index, compiled
from regionik.planners.hulls import hull_gap
from regionik.planners.serial import SerialArm, chain_frames
from regionik.worlds.arrays import Array

WORLD, BASE = -2, -1  # frames of hulls that no link carries
MOST_STEPS = 1000
SHORTEST = 1e-5  # part of a hop; shorter steps mean that the gap is used up
ROUNDING = 1e-9  # [m]
CHORDS = 8  # parts of a hop whose boxes bound where the links pass


class Movers(NamedTuple):
    """The solids of links: all points within ``radius`` of the hulls of corners in the links' frames.

    Attributes
    ----------
    corners : (c, 3) array
        [m]
    first : (n + 1,) array of int
        Solid k has corners ``first[k]:first[k + 1]``.
    radius : (n,) array
        [m]
    link : (n,) array of int
    outermost : (n,) array of bool
        Of the last link that has a solid.
    meets : (n, o) array of bool
        Which of the o hulls behind those of the world a solid may run into.
    """

    corners: Array
    first: Index
    radius: Array
    link: Index
    outermost: NDArray[np.bool_]
    meets: NDArray[np.bool_]


class Hulls(NamedTuple):
    """What links keep away from: all points within a disc (level) and a ball of the hulls of corners.

    The surface of a mesh is a row for its hull, which only bounds it, and a row for each triangle.

    Attributes
    ----------
    corners : (c, 3) array
        [m]
    first : (m + 1,) array of int
    disc, ball : (m,) array
        [m]
    frame : (m,) array of int
        Link that carries the hull, ``BASE`` or ``WORLD``; those of the world come first.
    owner : (m,) array of int
        Obstacle, part of the base (0), or solid of a link.
    next : (m,) array of int
        Row to go on with where this one is clear: beyond the triangles if it bounds some.
    boxes : (m, 2, 3) array
        Low and high along the axes of the hull's frame, disc and ball included [m].
    world : int
        Rows of the world.
    """

    corners: Array
    first: Index
    disc: Array
    ball: Array
    frame: Index
    owner: Index
    next: Index
    boxes: Array
    world: int


class Hop(NamedTuple):
    """A motion between two states."""

    base: Array  # (3,) x, y [m], yaw [rad]
    drive: Array  # (3,) what is added to it
    joints: Array  # (dof,)
    bend: Array  # (dof,) what is added to them


class Exempt(NamedTuple):
    """Where the outermost solids may touch an obstacle: the tool within ``reach`` of a spot it owns."""

    spots: Array  # (n, 3) [m]
    owner: Index  # (n,)
    reach: float  # [m]


@compiled
def place(arm: SerialArm, mount: Array, hop: Hop, s: float, frame: int, frames: Array) -> None:
    """Write the frames of links and tool at part s of a hop, seen from a link, the base or the world."""
    chain_frames(arm, hop.joints + s * hop.bend, frames)
    X = np.zeros((3, 4))
    if frame >= 0:
        for i in range(3):
            for j in range(3):
                X[i, j] = frames[frame, j, i]
                X[i, 3] -= frames[frame, j, i] * frames[frame, j, 3]
    elif frame == BASE:
        X[:] = mount[:3]
    else:
        yaw = hop.base[2] + s * hop.drive[2]
        c, z = math.cos(yaw), math.sin(yaw)
        for j in range(4):
            X[0, j] = c * mount[0, j] - z * mount[1, j]
            X[1, j] = z * mount[0, j] + c * mount[1, j]
            X[2, j] = mount[2, j]
        X[0, 3] += hop.base[0] + s * hop.drive[0]
        X[1, 3] += hop.base[1] + s * hop.drive[1]
    column = np.empty(3)
    for k in range(len(frames)):
        for j in range(4):
            for i in range(3):
                column[i] = frames[k, i, j]
            for i in range(3):
                turned = X[i, 0] * column[0] + X[i, 1] * column[1] + X[i, 2] * column[2]
                frames[k, i, j] = turned + (X[i, 3] if j == 3 else 0.0)


@compiled
def put(frame: Array, points: Array, out: Array) -> None:
    """Write points (n, 3) of a frame, seen from where the frame is seen."""
    for k in range(len(points)):
        for i in range(3):
            out[k, i] = (
                frame[i, 0] * points[k, 0]
                + frame[i, 1] * points[k, 1]
                + frame[i, 2] * points[k, 2]
                + frame[i, 3]
            )


@compiled
def pace(arm: SerialArm, mount: Array, hop: Hop, link: int, frame: int, points: Array) -> tuple[float, float]:
    """Most speed [m per hop] and acceleration [m per hop^2] of points fixed to a link, seen from a frame.

    Frame by frame from the link inwards: a joint that turns at rate w under a point that moves at speed v at
    a distance r of its axis adds w^2 r + 2 w v to the acceleration and w r to the speed.
    """
    far, lever = 0.0, 0.0  # from the joint's origin, and from its axis
    x, y, z = arm.axis[link, 0], arm.axis[link, 1], arm.axis[link, 2]
    for p in points:
        square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
        along = x * p[0] + y * p[1] + z * p[2]
        far = max(far, math.sqrt(square))
        lever = max(lever, math.sqrt(max(0.0, square - along * along)))
    speed, acceleration = 0.0, 0.0
    for k in range(link, max(frame, BASE), -1):
        rate = abs(hop.bend[k])
        if arm.revolute[k]:
            acceleration += rate * rate * lever + 2 * rate * speed
            speed += rate * lever
        else:
            speed += rate
            far += max(abs(hop.joints[k]), abs(hop.joints[k] + hop.bend[k]))
        step = arm.fixed[k]
        far += math.sqrt(step[0, 3] ** 2 + step[1, 3] ** 2 + step[2, 3] ** 2)
        lever = far
    if frame == WORLD:
        rate = abs(hop.drive[2])
        lever = far + math.hypot(mount[0, 3], mount[1, 3])
        acceleration += rate * rate * lever + 2 * rate * speed
        speed += rate * lever + math.hypot(hop.drive[0], hop.drive[1])
    return speed, acceleration


@compiled
def twist(
    arm: SerialArm, hop: Hop, frames: Array, s: float, link: int, frame: int, V: Array, W: Array
) -> None:
    """Write how a link moves, seen from a frame: a point p of it has velocity V + W x p [m per hop]."""
    V[:] = 0.0
    W[:] = 0.0
    if frame == WORLD:
        W[2] = hop.drive[2]
        V[0] = hop.drive[0] + W[2] * (hop.base[1] + s * hop.drive[1])
        V[1] = hop.drive[1] - W[2] * (hop.base[0] + s * hop.drive[0])
    w = np.empty(3)
    for k in range(max(frame, BASE) + 1, link + 1):
        T = frames[k]
        for i in range(3):
            w[i] = hop.bend[k] * (
                T[i, 0] * arm.axis[k, 0] + T[i, 1] * arm.axis[k, 1] + T[i, 2] * arm.axis[k, 2]
            )
        if arm.revolute[k]:
            for i in range(3):
                W[i] += w[i]
            V[0] += T[1, 3] * w[2] - T[2, 3] * w[1]
            V[1] += T[2, 3] * w[0] - T[0, 3] * w[2]
            V[2] += T[0, 3] * w[1] - T[1, 3] * w[0]
        else:
            for i in range(3):
                V[i] += w[i]


@compiled
def until_plane(points: Array, n: Array, free: float, V: Array, W: Array, acceleration: float) -> float:
    """Part of a hop before a point can cross a plane that the nearest one is ``free`` [m] from."""
    low = np.inf
    for p in points:
        low = min(low, n[0] * p[0] + n[1] * p[1] + n[2] * p[2])
    base = n[0] * V[0] + n[1] * V[1] + n[2] * V[2]
    x, y, z = W[1] * n[2] - W[2] * n[1], W[2] * n[0] - W[0] * n[2], W[0] * n[1] - W[1] * n[0]
    part = np.inf
    for p in points:
        gap = free + n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - low
        drift = base - (x * p[0] + y * p[1] + z * p[2])  # n . (W x p) = -(W x n) . p
        root = math.sqrt(drift * drift + 2 * acceleration * gap)
        if acceleration > 0.0 and drift > 0.0:
            part = min(part, (drift + root) / acceleration)
        elif root > drift:
            part = min(part, 2 * gap / (root - drift))
    return part


@compiled
def exempt_for(exempt: Exempt, owner: int, tool: Array) -> float:
    """How far the tool is within the reach of a spot of an owner; negative beyond it [m]."""
    best = np.inf
    for k in range(len(exempt.owner)):
        if exempt.owner[k] == owner:
            x, y, z = tool[0] - exempt.spots[k, 0], tool[1] - exempt.spots[k, 1], tool[2] - exempt.spots[k, 2]
            best = min(best, x * x + y * y + z * z)
    return exempt.reach - math.sqrt(best)


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
    frames, placed = np.empty((len(arm.axis) + 1, 4, 4)), np.empty_like(A)
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
            left = exempt_for(exempt, hulls.owner[m], frames[-1, :3, 3])
            if left >= 0.0:
                step = max(step, left / pace_of_tool if pace_of_tool > 0.0 else np.inf)
        if s + step >= 1.0 or step < SHORTEST:
            return s + step if s + step >= 1.0 else s
        s += step
    return s


@compiled
def swept(arm: SerialArm, mount: Array, movers: Movers, hop: Hop, boxes: Array) -> None:
    """Write boxes (solids, 2, 3) along the world's axes that hold all that the solids' corners pass."""
    turning = hop.drive[2] != 0.0
    for k in range(len(hop.bend)):
        turning = turning or hop.bend[k] != 0.0
    chords = CHORDS if turning else 1
    frames, placed = np.empty((len(arm.axis) + 1, 4, 4)), np.empty_like(movers.corners)
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
def first_stop(
    arm: SerialArm,
    mount: Array,
    movers: Movers,
    hulls: Hulls,
    hop: Hop,
    exempt: Exempt,
    boxes: Array,
    keep: float,
) -> tuple[int, int, float]:
    """The first solid and hull not proven to keep a distance, and the part of the hop; -1, -1, 1 if all are.

    ``boxes`` (solids, 2, 3) is overwritten with where the solids pass.
    """
    swept(arm, mount, movers, hop, boxes)
    for k in range(len(movers.link)):
        m = 0
        while m < len(hulls.frame):
            after = hulls.next[m]
            if m < hulls.world:
                near = box_gap(boxes[k], hulls.boxes[m]) <= movers.radius[k] + keep + ROUNDING
            else:
                near = movers.meets[k, m - hulls.world]
            if near:
                s = advance(arm, mount, movers, hulls, hop, exempt, k, m, keep)
                if s < 1.0:
                    if after == m + 1:
                        return k, m, s
                    after = m + 1  # the hull bounds triangles: look at them
            m = after
    return -1, -1, 1.0


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
    frames, boxes = np.empty((len(arm.axis) + 1, 4, 4)), np.empty((len(movers.link), 2, 3))
    still = Hop(hop.base, np.zeros(3), hop.joints, np.zeros(len(hop.joints)))
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
            elif not movers.outermost[k] or exempt_for(exempt, hulls.owner[m], frames[-1, :3, 3]) < 0.0:
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
            elif lower[k, m] > best:
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
    frames, placed = np.empty((len(arm.axis) + 1, 4, 4)), np.empty_like(A)
    place(arm, mount, hop, 0.0, hulls.frame[m], frames)
    put(frames[movers.link[k]], A, placed)
    low, high = hull_gap(placed, B, hulls.disc[m], np.zeros(3), np.empty(3))
    thick = movers.radius[k] + hulls.ball[m]
    lower[k, m] = low - thick
    return min(best, high - thick) if hulls.next[m] == m + 1 else best
