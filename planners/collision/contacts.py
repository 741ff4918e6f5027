"""Contacts of the tool with what it works on, proven over a part of a motion, compiled.

A plane is laid behind which the touched hull lies. The link's core, what is left of it when the depth of a
contact is taken off, stays beyond it; so does all of the link that is not within reach of the tool.
"""

from __future__ import annotations

import math

import numpy as np

from regionik.planners.collision.gjk import hull_distance
from regionik.planners.collision.robot_bodies import AllowedContact, RobotScene
from regionik.planners.collision.robot_motion import (
    WORLD,
    MotionSegment,
    link_twist,
    speed_bounds,
    tool_speed,
    transform_into,
)
from regionik.planners.geometry.vectors import cross, dot, minus, norm
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array

SHORTEST = 1e-5  # part of a motion; shorter steps mean that the gap is used up
ROUNDING = 1e-9  # [m]
SLACK = 3e-4  # of contacts, so that they can be proven by other code [m]
_BALLS = 16  # that cover a capsule


@compiled
def time_to_plane(points: Array, n: Array, free: float, V: Array, W: Array, acceleration: float) -> float:
    """Lower bound of the time in which a rigid body can cross a plane.

    A corner at height h above the plane with speed v = n . (V + W x p) is above it while
    h + v t - a t^2 / 2 > 0, a the most that it accelerates: until t = 2 h / (sqrt(v^2 + 2 a h) - v). The unit
    normal n of the plane points towards the corners (k, 3), the lowest of which is ``free`` above it [m].
    """
    low = np.inf
    for p in points:
        low = min(low, dot(n, p))
    base, turning = dot(n, V), cross(W, n)
    time = np.inf
    for p in points:
        height = free + n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - low
        speed = base - dot(turning, p)  # n . (W x p) = -(W x n) . p
        root = math.sqrt(speed * speed + 2 * acceleration * height)
        if acceleration > 0.0 and speed > 0.0:
            time = min(time, (speed + root) / acceleration)
        elif root > speed:
            time = min(time, 2 * height / (root - speed))
    return time


@compiled
def range_left(contact: AllowedContact, owner: int, tool: Array) -> float:
    """Reach of an owner's spots less the distance of the tool from the nearest; negative beyond [m]."""
    best = np.inf
    for k in range(len(contact.owner)):
        if contact.owner[k] == owner:
            x, y, z = contact.spots[k]
            x, y, z = tool[0] - x, tool[1] - y, tool[2] - z
            best = min(best, x * x + y * y + z * z)
    return contact.reach - math.sqrt(best)


@compiled
def farthest_below(points: Array, radius: float, n: Array, height: float, tool: Array) -> float:
    """Upper bound of the distance from the tool of what lies below a height of a capsule, box or hull [m].

    Points are the ends (2, 3) of the capsule's axis, or corners (k, 3); the unit vector n points upwards.
    """
    far = 0.0
    if len(points) == 2:  # balls cover it, each as large as their distance asks
        way = (points[1] - points[0]) / _BALLS
        r = radius + 0.5 * norm(way)
        for i in range(_BALLS + 1):
            far = max(far, _farthest_of_ball(points[0] + i * way, r, n, height, tool))
        return far
    for i in range(len(points)):
        a = dot(n, points[i]) - height
        if a <= 0.0:
            far = max(far, norm(points[i] - tool))
        for j in range(i):
            b = dot(n, points[j]) - height
            if a * b < 0.0:
                far = max(far, norm(points[i] + a / (a - b) * (points[j] - points[i]) - tool))
    return far


@compiled
def _farthest_of_ball(center: Array, r: float, n: Array, height: float, tool: Array) -> float:
    """Distance from the tool of the farthest point of a ball below a height along n, 0 where none is."""
    w = minus(center, tool)
    up, size, room = dot(n, w), norm(w), height - dot(n, center)
    if room < -r:
        return 0.0
    if room >= r or up * r <= room * size:
        return size + r
    aside = math.sqrt(max(0.0, size * size - up * up)) + math.sqrt(r * r - room * room)
    return float(np.hypot(up + room, aside))


@compiled
def _triangle_distance(A: Array, B: Array, n: Array) -> float:
    """Distance of a hull from the plane of a triangle, 0 if cut; writes the normal on its side to n."""
    n[:] = np.cross(B[1] - B[0], B[2] - B[0])
    n /= max(norm(n), 1e-300)
    low, high = np.inf, -np.inf
    for p in A:
        along = dot(n, minus(p, B[0]))
        low, high = min(low, along), max(high, along)
    if low + high < 0.0:
        n *= -1.0
        low = -high
    return max(0.0, low)


@compiled
def contact_time(
    scene: RobotScene, motion: MotionSegment, k: int, m: int, s: float, frames: Array, most: float
) -> float:
    """Time from s on, up to ``most``, over which solid k touches hull m as it may: proven; 0 where not.

    Its core stays beyond a plane that the hull lies behind, and of the solid no more than the depth lies
    behind it; what comes within the clearance of that plane lies within reach of the tool.
    """
    robot, links, hulls, contact = scene
    a, b, link = links.first[k], links.first[k + 1], links.link[k]
    A, B = links.corners[a:b], hulls.corners[hulls.first[m] : hulls.first[m + 1]]
    core, placed = np.empty_like(A), np.empty_like(A)
    transform_into(frames[link], links.core[a:b], core)
    transform_into(frames[link], A, placed)
    n, spot = np.zeros(3), np.empty(3)
    ball = hulls.ball[m] - contact.clearance
    gap = _triangle_distance(core, B, n) if len(B) == 3 else 0.0
    if gap <= links.core_radius[k] + ball:
        n[:] = 0.0
        gap = hull_distance(core, B, hulls.disc[m], n, spot)[0]
    free = gap - links.core_radius[k] - ball - ROUNDING
    least, height = np.inf, np.inf
    for i in range(len(A)):
        least = min(least, dot(n, placed[i]))
        height = min(height, dot(n, core[i]) + ball - gap)
    sunk = least - height - links.radius[k] + contact.depth
    if free < 0.0 or sunk < 0.0:
        return 0.0
    height += contact.clearance + SLACK
    speed, acceleration = speed_bounds(robot, motion, link, WORLD, A)
    drift = speed + tool_speed(robot, motion, WORLD)
    step = most
    if speed > 0.0:
        V, W = link_twist(robot, motion, frames, s, link, WORLD)
        step = min(step, time_to_plane(core, n, free, V, W, acceleration))
        step = min(step, time_to_plane(placed, n, sunk, V, W, acceleration))
    reach = contact.reach - SLACK
    while step >= SHORTEST or step == most:
        far = farthest_below(placed, links.radius[k], n, height + step * speed, frames[-2, :3, 3])
        if far <= reach - step * drift:
            return step
        if step < SHORTEST:
            break
        step *= 0.5
    return 0.0
