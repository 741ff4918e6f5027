"""The exhaustive search asked of an arm on a base among obstacles: what it needs, and whether it can end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from shapely.affinity import affine_transform

from regionik.planners.clearance.exhaustive import Verdict, search
from regionik.planners.clearance.linkwise import touchable
from regionik.planners.clearance.ownbody import Own
from regionik.planners.clearance.prepared import Bodies, Contact
from regionik.planners.geometry.collision import obstacles_from
from regionik.planners.geometry.upright import uprights_from
from regionik.planners.reach.sway import longest_levers
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Solid, Sphere
from regionik.worlds.robot import LinkBox, LinkCapsule, LinkSolid
from regionik.worlds.solids.selfpairs import base_body, self_pairs

MOST_SPARE = 2  # joints beyond what the target takes, up to which the search may come to an end
LEVER = 1e-9  # a joint that moves no point farther than this plays no part [m]
WITHIN = 0.999  # of half a box's least side: radius of the capsule inside it, which keeps some length


def ask(
    bodies: Bodies,
    base: Array,
    target: Array,
    tolerance: float,
    margin: float,
    contact: Contact | None,
    accept: Callable[[Array], bool],
    most: int,
) -> Verdict:
    """Search all postures of the arm on a base that stands still.

    Boxes of links count as the capsules inside them, meshes and what is fixed to the base as nothing, and
    what the tool may touch at the target as nothing too: all of that leaves "none" a proof, and ``accept``
    judges what is found.

    Parameters
    ----------
    bodies : Bodies
        Of an arm that `is_bounded`.
    base : (3,) array
        x, y [m], yaw [rad].
    target : (3,) array
        In the world [m].
    tolerance, margin : float
        [m]
    contact : Contact or None
    accept : callable
        Whether a posture (dof,) is clear of everything.
    most : int
        Budget of boxes.

    Returns
    -------
    Verdict
    """
    robot = bodies.robot
    T = _inverse(robot.T_world_arm(base))
    free = touchable(contact, target, tolerance)
    solids = [
        _seen(solid, T)
        for k, solid in enumerate(bodies.obstacles)
        if k not in free and not isinstance(solid, Mesh)
    ]
    inner = [inner_capsule(solid) for solid in robot.solids]
    goal = T[:3, :3] @ target + T[:3, 3]
    room = margin + bodies.clearance
    own = _own(bodies, margin)
    return search(robot.chain, inner, obstacles_from(solids), goal, tolerance, room, most, own, accept)


def smothered(bodies: Bodies, target: Array, tolerance: float, margin: float, contact: Contact | None) -> str:
    """What the end of the last link is in, or too near to, in any posture; empty where it is in nothing."""
    chain, free = bodies.robot.chain, touchable(contact, target, tolerance)
    end = -np.inf  # how far the obstacle must be from the target at least, to touch nothing
    for solid in map(inner_capsule, bodies.robot.solids):
        if solid.link == chain.dof - 1:
            off = np.linalg.norm(solid.corners - chain.T_last_tool[:3, 3], axis=1).min()
            end = max(end, solid.radius - tolerance - float(off))
    for k, one in enumerate(bodies.obstacles):
        gap, near = one.distance(target), end + margin + bodies.clearance
        if k in free:
            gap, near = max(0.0, gap), end - bodies.depth
        if gap < near - LEVER:
            return one.name
    return ""


def _own(bodies: Bodies, margin: float) -> Own:
    """What the arm keeps from itself and its base, in the arm's base frame."""
    robot = bodies.robot
    count = len(robot.solids)
    links_only = [pair for pair in self_pairs(robot) if pair[0] >= 0 and pair[1] < count]
    pairs = np.array(links_only, dtype=np.int64).reshape(-1, 2)
    links = np.array([solid.link for solid in robot.solids], dtype=np.int64)
    outwards = links[pairs[:, 0]] <= links[pairs[:, 1]]
    heeds = np.array([k for i, k in self_pairs(robot) if i < 0], dtype=np.int64)
    body, T = base_body(robot), _inverse(robot.T_base_arm)
    pieces = obstacles_from([] if body is None else [_seen(body, T)]).pieces
    return Own(np.where(outwards[:, None], pairs, pairs[:, ::-1]), uprights_from(pieces), heeds, margin)


def is_bounded(chain: Chain) -> bool:
    """Whether all sliding joints have limits, as the search needs."""
    slides = [joint for joint in chain.joints if joint.kind == "prismatic"]
    return bool(np.isfinite([(joint.lower, joint.upper) for joint in slides]).all())


def spare_joints(chain: Chain, solids: tuple[LinkSolid, ...]) -> int:
    """Joints that move tool or solids, less the directions in which they can move the tool."""
    points = [(chain.dof - 1, chain.T_last_tool[:3, 3])]
    points += [(solid.link, end) for solid in solids for end in inner_capsule(solid).corners]
    levers = np.array([longest_levers(chain, link, point)[0] for link, point in points]).max(0)
    frames = chain.frames(np.arange(1.0, chain.dof + 1.0))  # no special posture
    tool, columns = frames[-1, :3, 3], []
    for joint, frame in zip(chain.joints, frames, strict=False):
        axis = frame[:3, :3] @ joint.axis
        columns.append(axis if joint.kind == "prismatic" else np.cross(axis, tool - frame[:3, 3]))
    return int((levers > LEVER).sum()) - int(np.linalg.matrix_rank(np.array(columns), tol=LEVER))


def inner_capsule(solid: LinkSolid) -> LinkCapsule:
    """A capsule itself, or the one along the middle of a box."""
    if isinstance(solid, LinkCapsule):
        return solid
    return _along(solid)


def _along(solid: LinkBox) -> LinkCapsule:
    longest = int(np.argmax(solid.size))
    radius = WITHIN * float(solid.size.min()) / 2
    half = solid.T_link_box[:3, longest] * (solid.size[longest] / 2 - radius)
    middle = solid.T_link_box[:3, 3]
    return LinkCapsule(solid.link, solid.name, middle - half, middle + half, radius)


def _seen(solid: Solid, T: Array) -> Solid:
    """A solid in another frame whose z axis is upright too."""
    match solid:
        case Box():
            turn = float(np.arctan2(T[1, 0], T[0, 0]))
            return replace(solid, center=_moved(solid.center, T), yaw=solid.yaw + turn)
        case Cylinder() | Sphere():
            return replace(solid, center=_moved(solid.center, T))
        case Prism():
            level = [T[0, 0], T[0, 1], T[1, 0], T[1, 1], T[0, 3], T[1, 3]]
            outline = affine_transform(solid.polygon, level)
            return Prism(solid.name, outline, solid.bottom + T[2, 3], solid.top + T[2, 3])
        case Mesh():
            return replace(solid, vertices=_moved(solid.vertices, T))


def _inverse(T: Array) -> Array:
    inverse = np.eye(4)
    inverse[:3, :3], inverse[:3, 3] = T[:3, :3].T, -T[:3, :3].T @ T[:3, 3]
    return inverse


def _moved(points: Array, T: Array) -> Array:
    moved: Array = points @ T[:3, :3].T + T[:3, 3]
    return moved
