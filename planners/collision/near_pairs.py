"""What each solid of a robot is near to in given states, all at once: distances, normals and points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.collision.collision_checking import (
    bound_by_boxes,
    place_solid,
    swept_boxes,
    touches_as_allowed,
)
from regionik.planners.collision.gjk import TOUCHING, hull_distance
from regionik.planners.collision.proximity import room_of, touch_of
from regionik.planners.collision.robot_bodies import Bodies, ContactTargets
from regionik.planners.collision.robot_motion import WORLD, at_rest, link_frames, transform_into
from regionik.planners.collision.robot_scene import RobotScene
from regionik.planners.kernels import compiled
from regionik.planners.solvers.serial_chain import joint_values
from regionik.worlds.arrays import Array, Index


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
        touch = touch_of(bodies, at_rest(bases[state[k]], values), int(solid[k]), int(row[at]))
        apart = touch.on_solid - touch.on_other
        away = apart * np.copysign(1.0, touch.distance)
        room[at], point[at] = room_of(bodies, touch), touch.on_solid
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
