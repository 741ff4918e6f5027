"""Random chains, links and hops, and distances of convex bodies by other means than the library's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls
from scipy.spatial import ConvexHull
from shapely.geometry import box

from regionik.planners.collision.proximity import Proximity
from regionik.postures.poses import Pose
from regionik.scene import scene_of
from regionik.values import Motion
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox, LinkCapsule, LinkHull, capsules_along
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.kinds import LinkSolid, Solid
from tests.maths import Array, rot_x, rot_y, rot_z, translation

LARGEST_BEND = 0.5  # change of a joint between two states above which the arm has jumped [rad]
HEAVY = 1e4  # weight of "the parts add up to one" against distances


def signed_distance(one: Array, other: Array) -> float:
    """Of the hulls of corners (k, 3): the point of their difference that is nearest to the origin [m].

    Minus the depth of the origin where it lies inside.
    """
    difference = (other[None] - one[:, None]).reshape(-1, 3)
    rows = np.vstack([difference.T, np.full(len(difference), HEAVY)])
    parts, _ = nnls(rows, np.array([0.0, 0.0, 0.0, HEAVY]))
    distance = float(np.linalg.norm(parts @ difference / parts.sum()))
    flat = np.linalg.matrix_rank(difference - difference[0], tol=1e-9) < 3
    if distance > 1e-6 or flat:
        return distance
    return float(ConvexHull(difference).equations[:, 3].max())


def random_frame(rng: np.random.Generator, reach: float) -> Array:
    turn = rot_z(rng.uniform(-3, 3)) @ rot_y(rng.uniform(-3, 3)) @ rot_x(rng.uniform(-3, 3))
    frame: Array = translation(*rng.uniform(-reach, reach, 3)) @ turn
    return frame


def random_solid(rng: np.random.Generator, link: int) -> LinkSolid:
    name = f"part {link}"
    if rng.random() < 0.5:
        box = LinkBox(link, name, random_frame(rng, 0.1), rng.uniform(0.02, 0.3, 3))
        middle, taper = box.corners.mean(0), np.array([1, 1, 1, 1, 0.5, 0.6, 0.7, 0.8])
        tapered = LinkHull(link, name, middle + taper[:, None] * (box.corners - middle))
        return tapered if box.size[0] > 0.2 else box
    start, end = rng.uniform(-0.2, 0.2, (2, 3))
    return LinkCapsule(link, name, start, end, rng.uniform(0.01, 0.08))


def random_robot(rng: np.random.Generator, dof: int, reach: float = 0.3) -> Robot:
    """Joints of both kinds about slanted axes, one solid a link, and an arm mounted off the centre."""
    joints = []
    for k in range(dof):
        kind = "prismatic" if rng.random() < 0.3 else "revolute"
        frame = random_frame(rng, reach)
        axis = rng.normal(size=3)
        joints.append(Joint(f"j{k}", kind, -3, 3, frame, axis))  # type: ignore[arg-type]
    chain = Chain(tuple(joints), random_frame(rng, 0.2))
    solids = tuple(random_solid(rng, k) for k in range(dof))
    corners = np.array([[0.2, 0.15], [-0.25, 0.15], [-0.2, -0.2], [0.2, -0.15]])
    mount = np.array([*rng.uniform(-reach, reach, 3), rng.uniform(-3, 3)])
    return Robot("random", "omni", corners, mount, chain, solids, 0.2, np.zeros(dof))


def motion_through(base: Array, joints: Array) -> Motion:
    """States of no set-point."""
    n = len(base)
    return Motion(base, joints, np.full(n, "transit"), np.full(n, -1), np.full(n, np.nan))


def with_lift() -> Robot:
    """A torso that lifts after the pivot, then three hinges; every joint has limits."""
    joints = (
        Joint("pivot", "revolute", -3.0, 3.0, np.eye(4)),
        Joint("lift", "prismatic", 0.0, 0.3, translation(0, 0, 0.2)),
        Joint("shoulder", "revolute", -2.0, 2.0, translation(0, 0, 0.1) @ rot_x(np.pi / 2)),
        Joint("elbow", "revolute", -2.5, 2.5, translation(0.3, 0, 0)),
        Joint("wrist", "revolute", -2.0, 2.0, translation(0.25, 0, 0)),
    )
    chain = Chain(joints, translation(0.15, 0, 0))
    carry = np.array([0.0, 0.1, 1.5, 0.0, 0.0])
    mount = np.array([0.1, 0.05, 0.1, 0.4])
    return Robot("lift", "omni", np.zeros((1, 2)), mount, chain, capsules_along(chain, 0.03), 0.14, carry)


def on_lift(robot: Robot, travel: float = 0.3) -> Robot:
    """The robot with its arm on a lift, a joint before all others."""
    lift = Joint("torso", "prismatic", 0.0, travel, np.eye(4))
    return replace(
        robot,
        name=f"{robot.name} on a lift",
        chain=Chain((lift, *robot.chain.joints), robot.chain.T_last_tool),
        solids=tuple(replace(solid, link=solid.link + 1) for solid in robot.solids),
        carry=np.array([travel / 4, *robot.carry]),
    )


def pose_between(here: Pose, there: Pose, share: float, robot: Robot) -> Pose:
    """Part of the way between two states, as every reader of a plan fills it in."""
    joints = here.joints + share * (there.joints - here.joints)
    return Pose(robot.drive.between(here.base, there.base, share), joints)


class Guarded:
    """A robot among solids on a wide floor, and what its scene proves of states and motions."""

    def __init__(
        self, robot: Robot, *solids: Solid, spots: Sequence[ArrayLike] | Array = (), **rules: Any
    ) -> None:
        self.robot, self.solids = robot, solids
        asked = Rules(**{"solid_floor": False, "tool_contact": 0.0, **rules})
        task = tuple(Target(np.array(spot)) for spot in spots)
        self.scene = scene_of(World("guarded", robot, Floor(box(-99, -99, 99, 99)), solids, task, asked))

    def nearest(self, base: ArrayLike, joints: ArrayLike, within: float = 1e6) -> Proximity:
        """Return the nearest thing to the robot's solids, of kind "none" where nothing is within that."""
        return replace(self.scene.collision, spare=within).nearest(_pose(base, joints))

    def stop(
        self, here: ArrayLike, joints: ArrayLike, there: ArrayLike, bent: ArrayLike, margin: float = 0.0
    ) -> Proximity | None:
        """Return None when the motion between two states is proven clear, otherwise what stops it."""
        collision = replace(self.scene.collision, spare=margin)
        return collision.first_obstruction([_pose(here, joints), _pose(there, bent)])


def _pose(base: ArrayLike, joints: ArrayLike) -> Pose:
    return Pose(np.array(base, dtype=float), np.array(joints, dtype=float))
