"""Proximity of a robot's solids to obstacles, to each other and to its own base, in states and motions.

Compiled lower bounds (`gjk`, `collision_checking`) say where nothing needs to be looked at; the distances
returned come from `distances`.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.collision.collision_checking import (
    bound_by_boxes,
    distance_bounds,
    first_unproven_on_path,
    is_clear,
    place_solid,
    swept_boxes,
    touches_as_allowed,
)
from regionik.planners.collision.contacts import ROUNDING, range_left
from regionik.planners.collision.distances import hull_separation
from regionik.planners.collision.gjk import TOUCHING, hull_distance
from regionik.planners.collision.robot_bodies import Bodies, ContactTargets, RobotScene
from regionik.planners.collision.robot_motion import (
    WORLD,
    MotionSegment,
    at_rest,
    base_at,
    link_frames,
    motion_between,
    tool_speed,
    transform_into,
)
from regionik.planners.kernels import compiled
from regionik.planners.solvers.serial_chain import joint_values
from regionik.worlds.arrays import Array, Index, frozen
from regionik.worlds.links import LinkHull
from regionik.worlds.self_collision import BODY

LOOK = 1e-3  # part of a motion between two looks for a link inside a mesh


class Proximity(NamedTuple):
    """The nearest thing to the robot's solids; points in the world."""

    distance: float  # [m], negative where they overlap; infinite where there is nothing
    solid: int  # index into Robot.all_solids, -1 where there is nothing
    kind: Literal["obstacle", "self", "base", "none"]
    other: int  # index of the obstacle, or of the other solid of the robot; -1 otherwise
    on_solid: Array  # (3,) [m]
    on_other: Array  # (3,) [m]


NOTHING_NEAR = Proximity(np.inf, -1, "none", -1, np.full(3, np.nan), np.full(3, np.nan))  # is near


def nearest(
    bodies: Bodies,
    base: ArrayLike,
    joints: ArrayLike,
    *,
    contact: ContactTargets | None = None,
    within: float = np.inf,
    enough: float = -np.inf,
) -> Proximity:
    """The nearest thing to the robot's solids: an obstacle, another of its solids, or its own base.

    Parameters
    ----------
    base : (3,) array_like
        x, y [m], yaw [rad].
    joints : (dof,) array_like
    contact : ContactTargets, optional
        What may be touched is not looked at.
    within : float
        Distance beyond which nothing is looked for; from obstacles, beyond the bodies' clearance [m].
    enough : float
        Distance below which what is met is told without a look at what may be nearer still [m].

    Returns
    -------
    Proximity
        Of kind "none" where nothing is within that distance.

    Raises
    ------
    InputError
        When a number is not finite.
    """
    # Writable copies, as kernels are compiled for one kind of array alone.
    place, dof = np.array(frozen(base, (3,), "base")), bodies.robot.chain.dof
    rest = at_rest(place, bodies.robot.chain.joint_values(frozen(joints, (dof,), "joints")))
    lower = np.empty((len(bodies.robot.all_solids), len(bodies.pieces)))
    bound = distance_bounds(bodies.scene(contact), rest, within, lower)
    best, found = within, NOTHING_NEAR
    near = np.argwhere(lower <= bound + ROUNDING)
    for k, m in near[np.argsort(lower[near[:, 0], near[:, 1]], kind="stable")].tolist():
        if lower[k, m] >= best:
            break
        proximity = _proximity_of(bodies, rest, k, m)
        room = room_of(bodies, proximity)
        if room < best:
            best, found = room, proximity
        if best < enough:
            break
    return found


def state_clear(
    bodies: Bodies, base: Array, joints: Array, margin: float, contact: ContactTargets | None
) -> bool:
    """True if every link is proven to keep a distance from everything in a state; quicker than `nearest`."""
    if is_clear(bodies.scene(contact), float(margin), base, joints, -1):
        return True
    return is_path_clear(bodies, np.array([base, base]), np.array([joints, joints]), margin, contact)


def is_path_clear(
    bodies: Bodies, bases: Array, joints: Array, margin: float, contact: ContactTargets | None
) -> bool:
    """True if `path_clear` proves all motions; what stands in the way of one is not measured."""
    return _first_unproven(bodies, bases, joints, margin, contact)[1] < 0


def path_clear(
    bodies: Bodies, bases: Array, joints: Array, margin: float, contact: ContactTargets | None
) -> tuple[int, Proximity | None]:
    """Prove that every link keeps a distance from everything over the motions between states.

    The base turns the shorter way, and slides straight or, on wheels, rolls along the arc that its heading
    allows; joints move linearly. Proven, not sampled: see `collision_checking`.

    Parameters
    ----------
    bases, joints : (n + 1, 3), (n + 1, dof) arrays
        States; finite and writable.
    margin : float
        Of the robot's solids from each other, from its own base, and from obstacles beyond the bodies'
        clearance; at least 0 [m].
    contact : ContactTargets or None
        What may be touched while the tool is near.

    Returns
    -------
    int
        How many motions are proven clear before the first that is not.
    Proximity or None
        What could not be passed there, where the proof ended; None when all are clear.
    """
    i, k, m, s = _first_unproven(bodies, bases, joints, margin, contact)
    if k < 0:
        return i, None
    motion = motion_between(bodies.mobile, bases[i], joints[i], bases[i + 1], joints[i + 1])
    return i, _proximity_of(bodies, _stopped(motion, s), k, m)


def describe(bodies: Bodies, proximity: Proximity) -> str:
    """Text that names the solid of the robot, what comes near to it, and the distance."""
    if proximity.kind == "none":
        return "nothing is near"
    link, what = bodies.robot.all_solids[proximity.solid].name, name_of_other(bodies, proximity)
    if proximity.distance < 0:
        return f"{link} overlaps {what} by {-proximity.distance:z.4f} m"
    return f"{link} comes within {proximity.distance:z.4f} m of {what}"


def name_of_other(bodies: Bodies, proximity: Proximity) -> str:
    """Name of what comes near to the robot."""
    if proximity.kind == "obstacle":
        return bodies.obstacles[proximity.other].name
    return "the base" if proximity.kind == "base" else bodies.robot.all_solids[proximity.other].name


def room_of(bodies: Bodies, proximity: Proximity) -> float:
    """Distance of the nearest thing; from obstacles, beyond the bodies' clearance [m]."""
    return proximity.distance - (bodies.clearance if proximity.kind == "obstacle" else 0.0)


def _first_unproven(
    bodies: Bodies, bases: Array, joints: Array, margin: float, contact: ContactTargets | None
) -> tuple[int, int, int, float]:
    """Motion, solid, row and time where the proof of a path ends; a solid of -1 where it does not."""
    scene = bodies.scene(contact)
    i, k, m, s = first_unproven_on_path(scene, bases, joints, float(margin))
    outside = dict[tuple[int, int], _Ball]()
    for n in range(i if bodies.mesh_rows else 0):
        motion = motion_between(bodies.mobile, bases[n], joints[n], bases[n + 1], joints[n + 1])
        inside = _first_inside_mesh(bodies, scene, motion, outside, begun=n > 0)
        if inside[0] >= 0:
            return n, *inside
    return i, k, m, s


def _proximity_of(bodies: Bodies, rest: MotionSegment, k: int, m: int) -> Proximity:
    """Proximity of a solid to the piece of a row in a state, in the world."""
    solid, frame = bodies.robot.all_solids[k], int(bodies.hulls.frame[m])
    T = _frames(bodies, rest, frame)[solid.link]
    own = solid.polytope.moved(T) if isinstance(solid, LinkHull) else None  # made anew it takes milliseconds
    found = hull_separation(bodies.pieces[m], solid.corners @ T[:3, :3].T + T[:3, 3], own)
    gap, on_solid = float(found.distance - solid.radius), found.on_axis - solid.radius * found.normal
    on_other = on_solid - gap * found.normal
    kind: Literal["obstacle", "self", "base"] = "obstacle"
    if frame != WORLD:
        kind = "base" if bodies.hulls.owner[m] == BODY else "self"
        seen = _frames(bodies, rest, WORLD)[solid.link]
        turn = seen[:3, :3] @ T[:3, :3].T
        on_solid, on_other = (turn @ (p - T[:3, 3]) + seen[:3, 3] for p in (on_solid, on_other))
    other = -1 if kind == "base" else int(bodies.hulls.owner[m])
    return Proximity(gap, k, kind, other, on_solid, on_other)


def _frames(bodies: Bodies, rest: MotionSegment, frame: int) -> Array:
    """Frames of links, tool and base in a state, (n + 2, 4, 4)."""
    frames = np.empty((len(bodies.robot.chain.joints) + 2, 4, 4))
    link_frames(bodies.mobile, rest, 0.0, frame, frames)
    return frames


def _first_inside_mesh(
    bodies: Bodies,
    scene: RobotScene,
    motion: MotionSegment,
    outside: dict[tuple[int, int], _Ball],
    *,
    begun: bool,
) -> tuple[int, int, float]:
    """A solid inside a mesh whose surface it does not touch; -1, -1, 1 if there is none.

    While the surface is not touched a solid stays inside or outside, so one look where a path begins is
    enough but for what the tool may touch, which comes and goes: that is all that is looked at once the path
    has ``begun``. By solid and row, ``outside`` has where the last look was, and what is outside about it.
    """
    links, hulls, boxes = bodies.links, bodies.hulls, np.empty((len(bodies.robot.all_solids), 2, 3))
    touched = set(scene.contact.owner.tolist())
    rows = [m for m in bodies.mesh_rows if not begun or int(hulls.owner[m]) in touched]
    swept_boxes(bodies.mobile, links, motion, boxes)
    speed = tool_speed(bodies.mobile, motion, WORLD)
    for k, link in enumerate(links.link.tolist()):
        low, high = boxes[k]
        for m in rows if links.outermost[k] or not begun else []:
            mesh, s = bodies.pieces[m].mesh, 0.0
            if (low > hulls.boxes[m, 1]).any() or (hulls.boxes[m, 0] > high).any():
                continue
            while mesh is not None and s <= 1.0:
                frames = _frames(bodies, _stopped(motion, s), WORLD)
                left = range_left(scene.contact, hulls.owner[m], frames[-2, :3, 3])
                left = left if links.outermost[k] else -np.inf
                T, corners = frames[link], links.corners if left < 0 else links.core
                spot = T[:3, :3] @ corners[links.first[k]] + T[:3, 3]
                if (k, m) not in outside or math.dist(spot, outside[k, m].middle) >= outside[k, m].radius:
                    if mesh.contains(spot):
                        return k, m, s
                    outside[k, m] = _Ball(spot, bodies.pieces[m].gap(spot, np.inf))
                s += max(abs(left) / speed if speed > 0 else np.inf, LOOK)
    return -1, -1, 1.0


class _Ball(NamedTuple):
    middle: Array  # (3,)
    radius: float


def _stopped(motion: MotionSegment, s: float) -> MotionSegment:
    """The state at a time of a motion."""
    return at_rest(np.array(base_at(motion, s)), motion.joints + s * motion.bend)


class NearPairs(NamedTuple):
    """Solids of a robot in states, each with the obstacle or the part of the robot nearest to it: n pairs."""

    state: Index  # (n,)
    link: Index  # (n,) that carries the solid
    other: Index  # (n,) link that carries what is near, ``BASE`` or ``WORLD``
    room: Array  # (n,) distance, from obstacles beyond the bodies' clearance [m]
    normal: Array  # (n, 3) unit vector from what is near to the solid
    point: Array  # (n, 3) of the solid, in the world [m]


def near_pairs(
    bodies: Bodies, bases: Array, joints: Array, contact: ContactTargets, within: float
) -> NearPairs:
    """Return what each solid is near to in states: the nearest obstacle, and the nearest part of the robot.

    Of meshes it is the nearest triangle: that a solid lies inside one is not seen.

    Parameters
    ----------
    bases, joints : (k, 3), (k, dof) arrays
        States; finite.
    contact : ContactTargets
        What may be touched is not looked at.
    within : float
        Distance beyond which nothing is looked for; from obstacles, beyond the bodies' clearance [m].
    """
    count = len(bases), len(bodies.robot.all_solids), 2
    row, room = np.full(count, -1), np.full(count, within)
    normal, point = np.zeros((*count, 3)), np.zeros((*count, 3))
    bases, joints = np.array(bases), np.array(joints)  # as kernels are compiled for one kind of array alone
    _find_nearest(bodies.scene(contact), bases, joints, row, room, normal, point)
    found = np.nonzero(row >= 0)
    state, solid, _ = found
    for k in np.flatnonzero(~normal[found].any(axis=1)).tolist():  # of hulls that overlap nothing is known
        at = state[k], solid[k], found[2][k]
        values = bodies.robot.chain.joint_values(joints[state[k]])
        proximity = _proximity_of(bodies, at_rest(bases[state[k]], values), int(solid[k]), int(row[at]))
        apart = proximity.on_solid - proximity.on_other
        away = apart * np.copysign(1.0, proximity.distance)
        room[at], point[at] = room_of(bodies, proximity), proximity.on_solid
        normal[at] = away / max(float(np.linalg.norm(apart)), 1e-12)
    other = bodies.hulls.frame[row[found]]
    return NearPairs(state, bodies.links.link[solid], other, room[found], normal[found], point[found])


@compiled
def _find_nearest(
    scene: RobotScene, bases: Array, joints: Array, row: Index, room: Array, normal: Array, point: Array
) -> None:
    """Write the row nearest to each solid in each state (states, solids, 2), of the world and of the robot.

    Only rows nearer than ``room`` says are; their room, normal and point are written too. Where hulls overlap
    the normal is zero and the room a lower bound.
    """
    robot, links, hulls, _ = scene
    frames, placed = np.empty((len(robot.arm.axis) + 2, 4, 4)), np.empty_like(links.corners)
    boxes, first = np.empty((len(links.link), 2, 3)), hulls.first[hulls.world]  # corner of the robot itself
    body = np.empty((len(hulls.corners) - first, 3))
    n, spot = np.empty(3), np.empty(3)
    for i in range(len(bases)):
        rest = at_rest(bases[i], joint_values(robot.arm, joints[i]))
        swept_boxes(robot, links, rest, boxes)
        link_frames(robot, rest, 0.0, WORLD, frames)
        for k in range(len(links.link)):
            place_solid(links, k, frames, placed)
        for m in range(hulls.world, len(hulls.frame)):
            a, b = hulls.first[m], hulls.first[m + 1]
            transform_into(frames[hulls.frame[m]], hulls.corners[a:b], body[a - first : b - first])
        for k in range(len(links.link)):
            A, m = placed[links.first[k] : links.first[k + 1]], 0
            while m < len(hulls.frame):
                own, after = int(m >= hulls.world), hulls.next[m]
                near = links.pairs[k, m] and bound_by_boxes(links, hulls, boxes, k, m) < room[i, k, own]
                if near:
                    a, b = hulls.first[m], hulls.first[m + 1]
                    B, n[:] = body[a - first : b - first] if own else hulls.corners[a:b], 0.0
                    low = hull_distance(A, B, hulls.disc[m], n, spot)[0]
                    gap = low - links.radius[k] - hulls.ball[m]
                    near = gap < room[i, k, own]
                if near and (own == 1 or not touches_as_allowed(scene, rest, k, m, frames)):
                    if after > m + 1:
                        after = m + 1  # the hull bounds triangles: look at them
                    else:
                        row[i, k, own], room[i, k, own] = m, gap
                        for d in range(3):
                            normal[i, k, own, d] = n[d] if low > TOUCHING else 0.0
                            point[i, k, own, d] = spot[d] - links.radius[k] * n[d]
                m = after
