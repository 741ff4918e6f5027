"""How a link may touch what the tool works on, and how long on a motion it does no more, compiled.

A plane is laid behind which the touched hull lies. The link's core, what is left of it when the depth of a
contact is taken off, stays beyond it, and so does all of the link that is not within reach of the tool.
"""

from __future__ import annotations

import math

import numpy as np

from regionik.planners.collision.gjk import hull_gap
from regionik.planners.collision.robot_bodies import Exempt, Hulls, Movers
from regionik.planners.collision.robot_motion import WORLD, Hop, pace, put, twist
from regionik.planners.geometry.polygons import compiled
from regionik.planners.solvers.serial_chain import SerialArm
from regionik.worlds.arrays import Array

SHORTEST = 1e-5  # part of a hop; shorter steps mean that the gap is used up
ROUNDING = 1e-9  # [m]
SLACK = 3e-4  # of contacts, so that they can be proven by other code [m]
BALLS = 16  # that stand for the parts of a capsule


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
def farthest(points: Array, radius: float, n: Array, height: float, tool: Array) -> float:
    """Distance from the tool of what of a segment grown by a radius, or of a box, lies below a height."""
    far = 0.0
    if len(points) == 2:  # balls hold it, each as large as their distance asks
        way = (points[1] - points[0]) / BALLS
        r = radius + 0.5 * math.sqrt(way[0] ** 2 + way[1] ** 2 + way[2] ** 2)
        for i in range(BALLS + 1):
            far = max(far, _of_ball(points[0] + i * way, r, n, height, tool))
        return far
    for i in range(len(points)):
        a = n[0] * points[i, 0] + n[1] * points[i, 1] + n[2] * points[i, 2] - height
        if a <= 0.0:
            far = max(far, _length(points[i] - tool))
        for j in range(i):
            b = n[0] * points[j, 0] + n[1] * points[j, 1] + n[2] * points[j, 2] - height
            if a * b < 0.0:
                far = max(far, _length(points[i] + a / (a - b) * (points[j] - points[i]) - tool))
    return far


@compiled
def _length(v: Array) -> float:
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@compiled
def _of_ball(center: Array, r: float, n: Array, height: float, tool: Array) -> float:
    """Distance from the tool of the farthest point of a ball below a height along n, 0 where none is."""
    w = center - tool
    up, size = n[0] * w[0] + n[1] * w[1] + n[2] * w[2], _length(w)
    room = height - (n[0] * center[0] + n[1] * center[1] + n[2] * center[2])
    if room < -r:
        return 0.0
    if room >= r or up * r <= room * size:
        return size + r
    return math.hypot(up + room, math.sqrt(max(0.0, size * size - up * up)) + math.sqrt(r * r - room * room))


@compiled
def _face_gap(A: Array, B: Array, n: Array) -> float:
    """Distance of a hull from the plane of a triangle, 0 if cut; writes the normal on its side to n."""
    n[:] = np.cross(B[1] - B[0], B[2] - B[0])
    n /= max(_length(n), 1e-300)
    low, high = np.inf, -np.inf
    for p in A:
        along = n[0] * (p[0] - B[0, 0]) + n[1] * (p[1] - B[0, 1]) + n[2] * (p[2] - B[0, 2])
        low, high = min(low, along), max(high, along)
    if low + high < 0.0:
        n *= -1.0
        low = -high
    return max(0.0, low)


@compiled
def touches(
    arm: SerialArm,
    mount: Array,
    movers: Movers,
    hulls: Hulls,
    hop: Hop,
    exempt: Exempt,
    k: int,
    m: int,
    s: float,
    frames: Array,
    most: float,
) -> float:
    """Part of a hop, up to ``most``, over which solid k is proven to touch hull m as it may; 0 where not.

    Its core stays beyond a plane that the hull lies behind, and of the solid no more than the depth lies
    behind it; what comes within the clearance of that plane lies within reach of the tool.
    """
    a, b, link = movers.first[k], movers.first[k + 1], movers.link[k]
    A, B = movers.corners[a:b], hulls.corners[hulls.first[m] : hulls.first[m + 1]]
    core, placed = np.empty_like(A), np.empty_like(A)
    put(frames[link], movers.core[a:b], core)
    put(frames[link], A, placed)
    n, spot, V, W = np.zeros(3), np.empty(3), np.empty(3), np.empty(3)
    ball = hulls.ball[m] - exempt.clearance
    gap = _face_gap(core, B, n) if len(B) == 3 else 0.0
    if gap <= movers.core_radius[k] + ball:
        n[:] = 0.0
        gap = hull_gap(core, B, hulls.disc[m], n, spot)[0]
    free = gap - movers.core_radius[k] - ball - ROUNDING
    least, height = np.inf, np.inf
    for i in range(len(A)):
        least = min(least, n[0] * placed[i, 0] + n[1] * placed[i, 1] + n[2] * placed[i, 2])
        height = min(height, n[0] * core[i, 0] + n[1] * core[i, 1] + n[2] * core[i, 2] + ball - gap)
    sunk = least - height - movers.radius[k] + exempt.depth
    if free < 0.0 or sunk < 0.0:
        return 0.0
    height += exempt.clearance + SLACK
    tool = arm.tool[:3, 3].copy().reshape(1, 3)
    speed, acceleration = pace(arm, mount, hop, link, WORLD, A)
    drift = speed + pace(arm, mount, hop, len(arm.axis) - 1, WORLD, tool)[0]
    twist(arm, hop, frames, s, link, WORLD, V, W)
    step = most
    if speed > 0.0:
        step = min(step, until_plane(core, n, free, V, W, acceleration))
        step = min(step, until_plane(placed, n, sunk, V, W, acceleration))
    reach = exempt.reach - SLACK
    while step >= SHORTEST or step == most:
        far = farthest(placed, movers.radius[k], n, height + step * speed, frames[-2, :3, 3])
        if far <= reach - step * drift:
            return step
        if step < SHORTEST:
            break
        step *= 0.5
    return 0.0
