"""Collision checks of a robot, compiled: its motions between states, and single states.

Motions are checked by conservative advancement (Mirtich, 1996). The gap between two hulls now, less what is
to be kept, is used up no sooner than (a) the fastest point needs to move that far, or (b) a corner needs to
cross the plane between them, given its velocity now and the most that it can accelerate. Both bounds are
proven, so the time is advanced by the longer of the two steps until the motion ends or the steps vanish.
"""

from __future__ import annotations

import math

import numpy as np

from regionik.planners.collision.contacts import (
    ROUNDING,
    SHORTEST,
    contact_time,
    range_left,
    time_to_plane,
)
from regionik.planners.collision.gjk import hull_distance
from regionik.planners.collision.robot_bodies import Hulls, LinkHulls, RobotScene
from regionik.planners.collision.robot_motion import (
    BASE,
    WORLD,
    MobileArm,
    MotionSegment,
    at_rest,
    link_frames,
    link_twist,
    motion_between,
    speed_bounds,
    tool_speed,
    transform_into,
)
from regionik.planners.kernels import compiled
from regionik.planners.solvers.serial_chain import joint_values
from regionik.worlds.arrays import Array

MAX_STEPS = 1000
_CHORDS = 8  # most parts of a motion whose boxes bound where the links pass
_CHORD = 0.2  # largest turn of base or joint in one of them, while they are fewer [rad]


@compiled
def advance(scene: RobotScene, motion: MotionSegment, k: int, m: int, margin: float) -> float:
    """Time up to which solid k is proven to keep a distance from hull m; 1 or more is all of the motion."""
    robot, links, hulls, contact = scene
    A = links.corners[links.first[k] : links.first[k + 1]]
    B = hulls.corners[hulls.first[m] : hulls.first[m + 1]]
    link, frame = links.link[k], hulls.frame[m]
    speed, acceleration = speed_bounds(robot, motion, link, frame, A)
    speed_of_tool = tool_speed(robot, motion, frame)
    may_touch = frame == WORLD and links.outermost[k]
    need = links.radius[k] + hulls.ball[m] + margin + ROUNDING
    frames, placed = np.empty((len(robot.arm.axis) + 2, 4, 4)), np.empty_like(A)
    normal, spot = np.zeros(3), np.empty(3)
    s = 0.0
    for _ in range(MAX_STEPS):
        link_frames(robot, motion, s, frame, frames)
        transform_into(frames[link], A, placed)
        free = hull_distance(placed, B, hulls.disc[m], normal, spot)[0] - need
        step = 0.0
        if free > 0.0:
            V, W = link_twist(robot, motion, frames, s, link, frame)
            step = time_to_plane(placed, normal, free, V, W, acceleration)
            step = max(step, free / speed if speed > 0.0 else np.inf)
        if may_touch:
            left = range_left(contact, hulls.owner[m], frames[-2, :3, 3])
            if left >= 0.0:
                rest = min(1.0 - s, left / speed_of_tool if speed_of_tool > 0.0 else np.inf)
                step = max(step, contact_time(scene, motion, k, m, s, frames, rest))
        if s + step >= 1.0 or step < SHORTEST:
            return s + step if s + step >= 1.0 else s
        s += step
    return s


@compiled
def swept_boxes(robot: MobileArm, links: LinkHulls, motion: MotionSegment, boxes: Array) -> None:
    """Write boxes (solids, 2, 3) along the world's axes that hold all that the solids' corners pass.

    The boxes of n + 1 states, grown by a / (8 n^2): so far may a point that accelerates by a at the most be
    off the chord between two of them.
    """
    turn, rests = abs(motion.drive[2]), motion.arc == 0.0 and not motion.drive.any()
    for k in range(len(motion.bend)):
        turn, rests = max(turn, abs(motion.bend[k])), rests and motion.bend[k] == 0.0
    chords = min(max(1, math.ceil(turn / _CHORD)), _CHORDS)
    frames, placed = np.empty((len(robot.arm.axis) + 2, 4, 4)), np.empty_like(links.corners)
    boxes[:, 0], boxes[:, 1] = np.inf, -np.inf
    for c in range(1 if rests else chords + 1):
        link_frames(robot, motion, c / chords, WORLD, frames)
        for k in range(len(links.link)):
            a, b = links.first[k], links.first[k + 1]
            transform_into(frames[links.link[k]], links.corners[a:b], placed[a:b])
            for d in range(3):
                for j in range(a, b):
                    boxes[k, 0, d] = min(boxes[k, 0, d], placed[j, d])
                    boxes[k, 1, d] = max(boxes[k, 1, d], placed[j, d])
    for k in range(0 if rests else len(links.link)):
        points = links.corners[links.first[k] : links.first[k + 1]]
        sag = speed_bounds(robot, motion, links.link[k], WORLD, points)[1] / (8 * chords * chords)
        boxes[k, 0] -= sag
        boxes[k, 1] += sag


@compiled
def _box_distance(a: Array, b: Array) -> float:
    """Distance between two boxes along the same axes, each (2, 3), low and high; 0 where they meet [m]."""
    square = 0.0
    for d in range(3):
        apart = max(0.0, a[0, d] - b[1, d], b[0, d] - a[1, d])
        square += apart * apart
    return math.sqrt(square)


@compiled
def _rests(motion: MotionSegment, link: int, frame: int) -> bool:
    """True if no joint between a frame of the robot and a link moves."""
    return not motion.bend[max(frame, BASE) + 1 : link + 1].any()


@compiled
def _first_unproven(
    scene: RobotScene, motion: MotionSegment, boxes: Array, margin: float, start_known: bool
) -> tuple[int, int, float]:
    """The first solid and hull not proven to keep a distance, and the time; -1, -1, 1 if all are.

    ``boxes`` (solids, 2, 3) is overwritten with where the solids pass. Where the motion's start is known to
    keep all distances, solids of the robot that rest against one another are not looked at again.
    """
    robot, links, hulls, _ = scene
    swept_boxes(robot, links, motion, boxes)
    for k in range(len(links.link)):
        m = 0
        while m < len(hulls.frame):
            after, within, owner = hulls.next[m], links.radius[k] + margin + ROUNDING, hulls.owner[m]
            near = links.pairs[k, m]
            if m < hulls.world:
                near = near and _box_distance(boxes[k], hulls.boxes[m]) <= within
            else:
                near = near and not (start_known and _rests(motion, links.link[k], hulls.frame[m]))
                if near and owner >= 0:  # where that solid passes is known too
                    near = _box_distance(boxes[k], boxes[owner]) <= within + hulls.disc[m] + hulls.ball[m]
            if near:
                s = advance(scene, motion, k, m, margin)
                if s < 1.0:
                    if after == m + 1:
                        return k, m, s
                    after = m + 1  # the hull bounds triangles: look at them
            m = after
    return -1, -1, 1.0


@compiled
def first_unproven_on_path(
    scene: RobotScene, bases: Array, joints: Array, margin: float
) -> tuple[int, int, int, float]:
    """As `_first_unproven`, for motions between states (n + 1, ...): the first of them, n where all hold."""
    boxes = np.empty((len(scene.links.link), 2, 3))
    for i in range(len(bases) - 1):
        motion = motion_between(scene.robot, bases[i], joints[i], bases[i + 1], joints[i + 1])
        k, m, s = _first_unproven(scene, motion, boxes, margin, i > 0)
        if k >= 0:
            return i, k, m, s
    return len(bases) - 1, -1, -1, 1.0


@compiled
def touches_as_allowed(scene: RobotScene, rest: MotionSegment, k: int, m: int, frames: Array) -> bool:
    """True if solid k may touch hull m, and does so as it may, in a state."""
    owner, tool = scene.hulls.owner[m], frames[-2, :3, 3]
    near = scene.links.outermost[k] and range_left(scene.contact, owner, tool) >= 0.0
    return near and contact_time(scene, rest, k, m, 0.0, frames, 1.0) >= 1.0


@compiled
def distance_bounds(scene: RobotScene, rest: MotionSegment, within: float, lower: Array) -> float:
    """Write lower bounds of distances in a state, (solids, hulls); inf where none is looked at.

    Returns the smallest upper bound, or ``within``. Triangles of meshes are left to their hulls.
    """
    robot, links, hulls, _ = scene
    first_k, first_m, nearest = -1, -1, within
    frames, boxes = np.empty((len(robot.arm.axis) + 2, 4, 4)), np.empty((len(links.link), 2, 3))
    swept_boxes(robot, links, rest, boxes)
    link_frames(robot, rest, 0.0, WORLD, frames)
    lower[:] = np.inf
    for k in range(len(links.link)):
        m = 0
        while m < len(hulls.frame):
            if links.pairs[k, m]:
                if m >= hulls.world or not touches_as_allowed(scene, rest, k, m, frames):
                    lower[k, m] = bound_by_boxes(links, hulls, boxes, k, m)
                if -np.inf < lower[k, m] < nearest:
                    first_k, first_m, nearest = k, m, lower[k, m]
            m = hulls.next[m]
    best = within
    if first_k >= 0:  # with the distance of the row whose box is nearest, few others are looked at
        best = _bound_by_hulls(scene, rest, first_k, first_m, lower, best)
    for k in range(len(links.link)):
        for m in range(len(hulls.frame)):
            if lower[k, m] < best and not (k == first_k and m == first_m):
                best = _bound_by_hulls(scene, rest, k, m, lower, best)
            elif lower[k, m] > best + ROUNDING:
                lower[k, m] = np.inf
    return best


@compiled
def bound_by_boxes(links: LinkHulls, hulls: Hulls, boxes: Array, k: int, m: int) -> float:
    """Lower bound of the distance of solid k from hull m, by boxes (solids, 2, 3) round their corners [m]."""
    if m < hulls.world:
        return _bound_apart(boxes[k], hulls.boxes[m], links.radius[k])
    if hulls.owner[m] < 0:
        return -np.inf  # the base's own body
    thick: float = links.radius[k] + hulls.disc[m] + hulls.ball[m]
    return _bound_apart(boxes[k], boxes[hulls.owner[m]], thick)


@compiled
def _bound_apart(a: Array, b: Array, thick: float) -> float:
    """Lower bound of the distance of what boxes hold, grown by so much: boxes do not say how deep it is."""
    apart = _box_distance(a, b)
    return apart - thick if apart > 0.0 else -np.inf


@compiled
def _bound_by_hulls(
    scene: RobotScene, rest: MotionSegment, k: int, m: int, lower: Array, best: float
) -> float:
    """Put the bound from the hulls in the place of that from boxes; returns the least upper bound so far."""
    robot, links, hulls, _ = scene
    frames, placed = np.empty((len(robot.arm.axis) + 2, 4, 4)), np.empty_like(links.corners)
    link_frames(robot, rest, 0.0, hulls.frame[m], frames)
    place_solid(links, k, frames, placed)
    lower[k, m], high = _solid_distance(links, hulls, placed, k, m)
    return min(best, high) if hulls.next[m] == m + 1 else best


@compiled
def place_solid(links: LinkHulls, k: int, frames: Array, placed: Array) -> None:
    """Write the corners of a solid as its link's frame has them, among those of all solids (c, 3)."""
    a, b = links.first[k], links.first[k + 1]
    transform_into(frames[links.link[k]], links.corners[a:b], placed[a:b])


@compiled
def _solid_distance(links: LinkHulls, hulls: Hulls, placed: Array, k: int, m: int) -> tuple[float, float]:
    """Bounds of the distance of a placed solid from the hull of a row, all seen from the row's frame [m]."""
    A = placed[links.first[k] : links.first[k + 1]]
    B = hulls.corners[hulls.first[m] : hulls.first[m + 1]]
    low, high = hull_distance(A, B, hulls.disc[m], np.zeros(3), np.empty(3))
    thick = links.radius[k] + hulls.ball[m]
    return low - thick, high - thick


@compiled
def is_clear(scene: RobotScene, margin: float, base: Array, joints: Array, tool_on: int) -> bool:
    """True if every solid of the robot is proven to keep its distance in a state.

    The tool works on obstacle ``tool_on``; the spots of allowed contacts do not matter. Lower bounds decide,
    and meshes count as their hulls: what is clear by a hair may be refused.
    """
    robot, links, hulls, _ = scene
    rest = at_rest(base, joint_values(robot.arm, joints))
    frames, placed = np.empty((len(robot.arm.axis) + 2, 4, 4)), np.empty_like(links.corners)
    boxes, seen_from, m = np.empty((len(links.link), 2, 3)), WORLD, 0
    swept_boxes(robot, links, rest, boxes)
    link_frames(robot, rest, 0.0, WORLD, frames)
    while m < len(hulls.frame):
        owner, thick = hulls.owner[m], hulls.disc[m] + hulls.ball[m]
        for k in range(len(links.link)):
            if not links.pairs[k, m]:
                continue
            if m < hulls.world:
                near = _box_distance(boxes[k], hulls.boxes[m]) < links.radius[k] + margin
            else:
                near = owner < 0 or _box_distance(boxes[k], boxes[owner]) < links.radius[k] + thick + margin
            if not near:
                continue
            if hulls.frame[m] != seen_from:
                seen_from = hulls.frame[m]
                link_frames(robot, rest, 0.0, seen_from, frames)
            place_solid(links, k, frames, placed)
            if _solid_distance(links, hulls, placed, k, m)[0] < margin:
                on_it = m < hulls.world and owner == tool_on and links.outermost[k]
                if not on_it or contact_time(scene, rest, k, m, 0.0, frames, 1.0) < 1.0:
                    return False
        m = hulls.next[m]
    return True
