"""Search for a configuration with the base in a given area, and its check: on target, on the floor, clear."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.areas.reachable import model_of, reach_model
from regionik.areas.standing import LEAST_AREA, anywhere, into_span, room_for, span_of_rules
from regionik.mfabrik import Solver, solver_for
from regionik.moving.configuration_sampling import spread
from regionik.planners.avoidance.clear_posture import sampled_clear_posture
from regionik.planners.avoidance.posture_proof import PostureTask
from regionik.planners.collision.proximity import Touch
from regionik.planners.driving.footprint import fits
from regionik.postures.arm import goal_error
from regionik.postures.arm_guard import SPARE, Guard, guard_at
from regionik.postures.families import Family
from regionik.postures.poses import Pose, pose_of
from regionik.regions import path_areas
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target, World

PLACES = 12  # of the base, tried in an area where the arm touches something
PITCHES = 24  # of the last link, tried at every place
SEARCHED = 2  # places at which more postures of the arm are sampled
MOST_MET = 600  # postures that touch something, after which no other place is tried
MEASURED = 4  # of those at one place, whose distances are measured
SLACK = 1e-9  # rounding allowed at a bound [m] or [rad]


@dataclass(eq=False)
class TargetSearch:
    """Search for one target's configuration, and the contacts met.

    Attributes
    ----------
    world : World
    target : Target
    met : int
        Postures on target with the base on free floor that touch something.
    touch : Touch or None
        Contact of the posture among them nearest to being clear.
    nearly : list of (float, Pose)
        Clearance left [m] and posture nearest to being clear, of each place.
    """

    world: World
    target: Target
    met: int = 0
    touch: Touch | None = None
    nearly: list[tuple[float, Pose]] = field(default_factory=list)
    guard: Guard = field(init=False)

    def __post_init__(self) -> None:
        self.guard = guard_at(self.world, self.target)

    def within(self, area: BaseGeometry, family: Family, span: tuple[float, float]) -> Pose | None:
        """A confirmed configuration with the arm axis in an area, the heading in a span, if one is found."""
        solver = solver_for(self.world, family, None, span)
        for axis in self._places(area):
            base = pose_of(self.world.robot, axis, into_span(self._yaw(axis), span))
            if self.met >= MOST_MET:
                break
            standing = [q for q in self._postures(solver, base) if self.stands(q)]
            clear = next((q for q in standing if self.guard.proves(q)), None)
            if clear is not None:
                return clear
            self.met += len(standing)
            rooms = [self._room(q) for q in standing[:MEASURED]]
            if rooms:
                best = int(np.argmax(rooms))
                if rooms[best] == np.inf:
                    return standing[best]
                self.nearly.append((rooms[best], standing[best]))
        return None

    def in_areas(self) -> Pose | None:
        """A confirmed configuration in the areas that hold at every heading, if one is found."""
        areas, sides = path_areas(self.world, [self.target]), anywhere(self.world).sides
        for k in np.flatnonzero(shapely.area(areas.inner) > LEAST_AREA).tolist():
            pose = self.within(areas.inner[k], areas.family[k], sides[areas.side[k]].span)
            if pose is not None:
                return pose
        return None

    def search(self) -> Pose | None:
        """Sample postures of the arm at the places nearest to a clear one.

        This is not for arms whose self-motion has shown all kinds of them already.
        """
        if self.target.direction is not None or model_of(self.world, self.target).shows_all_postures:
            return None
        nearest = sorted(self.nearly, key=lambda one: -one[0])[:SEARCHED]
        return next((q for _, near in nearest if (q := self._searched(near)) is not None), None)

    def stands(self, q: Pose) -> bool:
        """True where tool, joints and base meet target, limits and floor, whatever the arm touches."""
        world, chain = self.world, self.world.robot.chain
        error, angle = goal_error(self.target, world.robot.tool(q.base, q.joints))
        on_target = error <= world.rules.tolerance + SLACK and angle <= self.target.cone + SLACK
        within = (q.joints >= chain.lower - SLACK).all() and (q.joints <= chain.upper + SLACK).all()
        good = bool(within) and reach_model(world.robot, "point").meets(world.rules.criteria, q.joints)
        return on_target and good and bool(fits(room_for(world), *q.base.tolist()))

    def confirms(self, q: Pose) -> bool:
        """True where a configuration is an answer."""
        return self.stands(q) and self.guard.clear(q)

    def _places(self, area: BaseGeometry) -> Array:
        """The middle of the area's largest part, then places spread over all of it."""
        largest = max(shapely.get_parts(area), key=lambda part: part.area)
        middle = shapely.maximum_inscribed_circle(largest).coords[0]
        return np.vstack([middle, spread(area, PLACES, 0)])

    def _postures(self, solver: Solver, base: Array) -> list[Pose]:
        """The posture that the solver finds from the carried arm, then those of its self-motion."""
        carry = self.world.robot.carry
        first = solver.hold(self.target, base, carry)
        if not first.converged:
            return []
        poses = [Pose(first.base, first.joints)]
        if self.guard.on and not self.confirms(poses[0]):
            others = solver.self_motion(self.target, base, carry, PITCHES)
            poses += [Pose(one.base, one.joints) for one in others]
        return poses

    def _searched(self, q: Pose) -> Pose | None:
        """Search postures of the arm about the nearest one, the base held."""
        guard, tolerance = self.guard, self.world.rules.tolerance
        task = PostureTask(guard.bodies, q.base, self.target.position, guard.contact, tolerance, SPARE)
        found = sampled_clear_posture(task, q.joints)
        if found.joints is None:
            return None
        pose = Pose(q.base, np.array(found.joints))
        return pose if self.confirms(pose) else None

    def _room(self, q: Pose) -> float:
        """Clearance of the arm beyond what is asked, infinite where it is clear [m]."""
        touch = self.guard.touch(q)
        room = self.guard.room(touch)
        if self.touch is None or room > self.guard.room(self.touch):
            self.touch = touch
        return room

    def _yaw(self, axis: Array) -> float:
        """Heading of the base: the fixed one, else towards the target."""
        if self.world.rules.heading == "fixed":
            return span_of_rules(self.world)[0]
        away = self.target.position[:2] - axis
        return float(np.arctan2(away[1], away[0]))
