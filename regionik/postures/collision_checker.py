"""Collision checks of poses and motions under a world's rules; `verify` has code of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from regionik.planners.collision.contacts import SLACK
from regionik.planners.collision.distances import obstacles_from, solids_within
from regionik.planners.collision.proximity import (
    NOTHING_NEAR,
    Proximity,
    describe,
    is_path_clear,
    name_of_other,
    nearest,
    path_clear,
    room_of,
    state_clear,
)
from regionik.planners.collision.robot_bodies import (
    Bodies,
    ContactTargets,
    bodies_from,
    near_bodies,
    span_about_tool,
    tool_span,
)
from regionik.planners.collision.robot_motion import count_on_line, tool_frames
from regionik.postures.poses import MAX_JOINT_CHANGE, Pose, arrays
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Cause, CauseKind
from regionik.worlds.scene import Rules, Target, World

MAX_SPARE = 5e-4  # kept beyond what the rules want, so that what is planned can be proven [m]
MIN_SPARE = 1e-5  # of a start that has less than that to spare [m]


@dataclass(frozen=True, eq=False)
class CollisionChecker:
    """Collision checker of a robot among the solids of its world, under the world's rules."""

    rules: Rules
    bodies: Bodies
    contact: ContactTargets  # where the last link may touch
    spare: float = MAX_SPARE  # less for a start that has less: it need not be left at once [m]

    @property
    def enabled(self) -> bool:
        """True if the rules ask for the arm to avoid obstacles."""
        return self.rules.avoidance

    def nearest(self, pose: Pose, enough: float = -np.inf) -> Proximity:
        """Return the nearest thing that comes too near to the arm, of kind "none" if nothing does.

        Once something nearer than ``enough`` is found, nearer things are not looked for; see `nearest`.
        """
        if state_clear(self.bodies, pose.base, pose.joints, self.spare, self.contact):
            return NOTHING_NEAR
        return nearest(
            self.bodies, pose.base, pose.joints, contact=self.contact, within=self.spare, enough=enough
        )

    def room(self, proximity: Proximity) -> float:
        """Distance beyond what the rules want, infinite where nothing is too near [m]."""
        return room_of(self.bodies, proximity)

    def clear(self, pose: Pose) -> bool:
        """True if every link is collision-free."""
        return not self.enabled or self.nearest(pose, self.spare).kind == "none"

    def proves(self, pose: Pose, beyond: float = 0.0) -> bool:
        """True if every link is quickly proven collision-free, by so much more than the rules ask."""
        margin = self.spare + beyond
        return not self.enabled or state_clear(self.bodies, pose.base, pose.joints, margin, self.contact)

    def passes(self, poses: Sequence[Pose]) -> bool:
        """True if the motion through poses is proven collision-free."""
        if not self.enabled or len(poses) < 2:
            return True
        return is_path_clear(self.bodies, *arrays(poses), self.spare, self.contact)

    def first_obstruction(self, poses: Sequence[Pose]) -> Proximity | None:
        """Return the first thing that keeps the motion through poses from being proven collision-free."""
        return self.proven(*arrays(poses))[1] if len(poses) > 1 else None

    def proven(self, bases: Array, joints: Array) -> tuple[int, Proximity | None]:
        """Return the number of motions between states (n + 1, ...) proven clear, and what stops the next."""
        if not self.enabled:
            return len(bases) - 1, None
        return path_clear(self.bodies, bases, joints, self.spare, self.contact)

    def count_on_line(self, bases: Array, joints: Array, line: Array, shares: Array, stray: float) -> int:
        """Return the number of motions without a jump whose tool follows a line; see `count_on_line`."""
        most = stray, MAX_JOINT_CHANGE, float(self.rules.step)
        return int(count_on_line(self.bodies.mobile, bases, joints, line, shares, most))

    def tools(self, bases: Array, joints: Array, shares: Array) -> Array:
        """Return tool frames at k times of every motion between states (n + 1, ...), (n, k, 4, 4)."""
        return tool_frames(self.bodies.mobile, bases, joints, shares)

    def words(self, proximity: Proximity) -> str:
        """Return a description of the nearest thing, and how the link might touch what the tool works on."""
        said = describe(self.bodies, proximity)
        if (
            proximity.kind == "obstacle"
            and self.bodies.links.outermost[proximity.solid]
            and proximity.other in self.contact.owner
        ):
            said += f" ({self._contact_words(proximity)})"
        return said

    def _contact_words(self, proximity: Proximity) -> str:
        """Return how the last link may touch what the tool works on, and which rules would let it."""
        rules, sunk = self.rules, -proximity.distance
        span = tool_span(self.bodies.robot, proximity.solid) + SLACK
        wanted = [f"rules.tool_contact: {_rounded_up(span)}"] if span > rules.tool_contact else []
        if sunk > rules.deepest_contact:
            depth = _rounded_up(sunk + SLACK - rules.tolerance)
            wanted.append(f"rules.contact_depth: {depth} or solids that end at the tool point")
        said = (
            f"it may touch it {rules.deepest_contact:g} m deep, within {rules.tool_contact:g} m of the tool"
        )
        return f"{said}; {' and '.join(wanted)} would let it do so at a set-point" if wanted else said

    def other(self, proximity: Proximity) -> str:
        """Return the name of what the link comes near to."""
        return name_of_other(self.bodies, proximity)

    def cause(self, proximity: Proximity) -> Cause:
        """Return the nearest thing as a cause of a failure; its margin is what is missing [m]."""
        if proximity.kind == "obstacle":
            floor = self.bodies.obstacles[proximity.other] is self.bodies.floor
            kind: CauseKind = "floor" if floor else "obstacle"
            return Cause(kind, self.other(proximity), max(0.0, self.bodies.clearance - proximity.distance))
        return Cause("self", self.other(proximity), max(0.0, -proximity.distance))


def _rounded_up(length: float) -> str:
    """Return a length in words, rounded up to millimetres [m]."""
    return f"{np.ceil(length * 1000) / 1000:g}"


def bodies_in(world: World) -> Bodies:
    """Return the robot's solids and those that they must keep clear of."""
    near, deep = world.arm_clearance, world.rules.deepest_contact
    return bodies_from(world.robot, world.solids, near, deep, world.floor_slab)


def checker_from(world: World, bodies: Bodies) -> CollisionChecker:
    """Return the collision checker of a world; a start with little to spare reduces what is spared."""
    collision = CollisionChecker(world.rules, bodies, contact_for(world, world.task))
    if world.start is None or not collision.enabled:
        return collision
    room = collision.room(collision.nearest(Pose(world.start.base, world.start.joints)))
    spare = MAX_SPARE if room < MIN_SPARE else min(MAX_SPARE, max(MIN_SPARE, room / 2))
    return replace(collision, spare=spare)


def checker_at(world: World, bodies: Bodies, target: Target) -> CollisionChecker:
    """Return the collision checker for the tool at one target, of solids within the robot's reach."""
    far = span_about_tool(world.robot) + world.rules.tolerance + 2 * MAX_SPARE
    near = near_bodies(bodies, target.position, far)
    return CollisionChecker(world.rules, near, contact_for(world, [target]))


def contact_for(world: World, targets: Sequence[Target]) -> ContactTargets:
    """Return set-points with the solid that each lies on or in, or within ``tool_contact`` of."""
    reach, obstacles = world.rules.tool_contact, obstacles_from(world.arm_solids)
    spots, owners = [], []
    for target in targets:
        near = solids_within(obstacles, target.position, reach) if reach > 0 else []
        if near:
            spots.append(target.position)
            owners.append(near[0][1])
    return ContactTargets(np.array(spots).reshape(-1, 3), np.array(owners, dtype=np.int64), reach)
