"""Proofs that an arm on a fixed base among obstacles has no clear posture for a target."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from regionik.planners.collision.convex_bodies import inner_capsule
from regionik.planners.collision.distances import obstacles_from
from regionik.planners.collision.robot_bodies import NO_CONTACT, Bodies, ContactTargets
from regionik.planners.collision.upright_solids import uprights_from
from regionik.planners.search.fixed_base import FixedBaseResult, search_fixed_base
from regionik.planners.search.motion_bounds import longest_levers
from regionik.planners.search.self_clearance import SelfClearance
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.chain import Chain
from regionik.worlds.links import LinkSolid
from regionik.worlds.obstacles import Mesh
from regionik.worlds.self_collision import base_body, off_floor, self_collision_pairs

MOST_REDUNDANT = 2  # joints beyond those that the target takes, up to which the search may come to an end
LEVER = 1e-9  # a joint that moves no point farther than this does not count [m]


@dataclass(frozen=True, eq=False)
class PostureTask:
    """A target for an arm on a base that stands still among obstacles."""

    bodies: Bodies  # robot and obstacles
    base: Array  # (3,) x, y [m], yaw [rad]
    target: Array  # (3,) in the world [m]
    contact: ContactTargets | None = None  # what may be touched
    tolerance: float = 1e-3  # how far from the target the tool may be [m]
    # kept by solids from each other, from the base, and from obstacles beyond the bodies' clearance [m]
    margin: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "base", frozen(self.base, (3,), "base"))
        object.__setattr__(self, "target", frozen(self.target, (3,), "target"))


def search_postures(task: PostureTask, accept: Callable[[Array], bool], most: int) -> FixedBaseResult:
    """Search all postures of the arm by branch and bound.

    Boxes of links count as the capsules inside them; meshes, the floor, what is fixed to the base, and what
    the tool may touch at the target count as nothing. So RULED_OUT stays a proof, and ``accept`` judges
    whether a posture (dof,) that is found is clear of everything. The arm's chain must not be ``unbounded``;
    ``most`` is the budget of boxes.
    """
    bodies, robot = task.bodies, task.bodies.robot
    T = _inverse(robot.T_world_arm(task.base))
    free = (task.contact or NO_CONTACT).touchable(task.target, task.tolerance)
    solids = [
        solid.transformed(T)
        for k, solid in enumerate(bodies.obstacles)
        if k not in free and solid is not bodies.floor and not isinstance(solid, Mesh)
    ]
    inner = [inner_capsule(solid) for solid in robot.solids]
    goal = T[:3, :3] @ task.target + T[:3, 3]
    room = task.margin + bodies.clearance
    own = _self_clearance(bodies, task.margin)
    return search_fixed_base(
        robot.chain, inner, obstacles_from(solids), goal, task.tolerance, room, most, own, accept
    )


def solid_at_target(
    bodies: Bodies, target: Array, tolerance: float, margin: float, contact: ContactTargets | None
) -> str:
    """Name of the solid that the end of the last link is in, or too near to, in every posture; or empty."""
    chain, free = bodies.robot.chain, (contact or NO_CONTACT).touchable(target, tolerance)
    ends = []  # of each solid: how far the obstacle must be from the target at least, to touch nothing
    for solid, heeds in zip(map(inner_capsule, bodies.robot.solids), off_floor(bodies.robot), strict=False):
        if solid.link == len(chain.joints) - 1:
            off = np.linalg.norm(solid.corners - chain.T_last_tool[:3, 3], axis=1).min()
            ends.append((solid.radius - tolerance - float(off), heeds))
    for k, one in enumerate(bodies.obstacles):
        end = max((end for end, heeds in ends if heeds or one is not bodies.floor), default=-np.inf)
        gap, near = one.distance(target), end + margin + bodies.clearance
        if k in free:  # a tool below the surface takes its link along, deeper by as much
            near = end - bodies.depth - (tolerance if gap < 0 else 0.0)
        if gap < near - LEVER:
            return one.name
    return ""


def _self_clearance(bodies: Bodies, margin: float) -> SelfClearance:
    """The clearance of the arm from itself and its base, in the arm's base frame."""
    robot = bodies.robot
    count = len(robot.solids)
    links_only = [pair for pair in self_collision_pairs(robot) if pair[0] >= 0 and pair[1] < count]
    pairs = np.array(links_only, dtype=np.int64).reshape(-1, 2)
    links = np.array([solid.link for solid in robot.solids], dtype=np.int64)
    outwards = links[pairs[:, 0]] <= links[pairs[:, 1]]
    heeds = np.array([k for i, k in self_collision_pairs(robot) if i < 0], dtype=np.int64)
    body, T = base_body(robot), _inverse(robot.T_base_arm)
    pieces = obstacles_from([] if body is None else [body.transformed(T)]).pieces
    return SelfClearance(
        np.where(outwards[:, None], pairs, pairs[:, ::-1]), uprights_from(pieces), heeds, margin
    )


def redundant_joints(chain: Chain, solids: tuple[LinkSolid, ...]) -> int:
    """Number of joints that move tool or solids, less the directions in which they can move the tool."""
    points = [(len(chain.joints) - 1, chain.T_last_tool[:3, 3])]
    points += [(solid.link, end) for solid in solids for end in inner_capsule(solid).corners]
    levers = np.array([longest_levers(chain, link, point)[0] for link, point in points]).max(0)
    moving = np.abs(chain.coupling).T @ levers > LEVER
    frames = chain.frames(np.arange(1.0, chain.dof + 1.0))  # no special posture
    columns = chain.point_jacobian(frames, frames[-1, :3, 3], len(chain.joints))
    return int(moving.sum()) - int(np.linalg.matrix_rank(columns, tol=LEVER))


def _inverse(T: Array) -> Array:
    inverse = np.eye(4)
    inverse[:3, :3], inverse[:3, 3] = T[:3, :3].T, -T[:3, :3].T @ T[:3, 3]
    return inverse
