"""Search for a configuration, the base in an area or held, and its check: target, limits, floor, clear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.areas.free_space import MIN_AREA, into_span, spread
from regionik.areas.reachable import reach_model
from regionik.explain.constraints import setpoint_at
from regionik.mfabrik import Solver, solver_for
from regionik.planners.collision.proximity import Proximity
from regionik.planners.driving.footprint import fits
from regionik.posture_finder import PostureFinder
from regionik.postures.arm import goal_error
from regionik.postures.collision_checker import CollisionChecker
from regionik.postures.families import Family
from regionik.postures.poses import Pose, arrays, facing, pose_of
from regionik.reachability.options import REACHABILITY
from regionik.regions import path_areas
from regionik.scene import Scene
from regionik.values import Configuration
from regionik.worlds.arrays import Array
from regionik.worlds.errors import ReasonCode
from regionik.worlds.scene import Target

OPTIONS = REACHABILITY.configurations
BOUND_SLACK = 1e-9  # rounding allowed at a bound [m] or [rad]


class TargetResult(NamedTuple):
    """The answer for one target."""

    verdict: Literal["reachable", "unreachable", "undecided"]
    pose: Pose | None
    gap: float  # diameter of the largest circle of undecided places for the arm axis [m]
    reason: str
    code: ReasonCode = ""  # of the reason


@dataclass(eq=False)
class TargetSearch:
    """Search for one target's configuration, and the contacts met."""

    scene: Scene
    target: Target
    fixed_base: Array | None = None  # (3,) the one base pose that counts, known to stand on free floor
    colliding: int = 0  # postures on target with the base on free floor that touch something
    proximity: Proximity | None = None  # of the posture among them nearest to being clear
    # Clearance left [m] and posture nearest to being clear, of each place
    nearly: list[tuple[float, Pose]] = field(default_factory=list)
    collision: CollisionChecker = field(init=False)

    def __post_init__(self) -> None:
        self.collision = self.scene.collision_at(self.target)

    @property
    def finder(self) -> PostureFinder:
        return PostureFinder(self.scene, self.target, self.collision)

    @property
    def is_exhausted(self) -> bool:
        """True where so many postures touch something that no other place is tried."""
        return self.colliding >= OPTIONS.max_colliding

    def within(self, area: BaseGeometry, family: Family, span: tuple[float, float]) -> Pose | None:
        """A confirmed configuration with the arm axis in an area, the heading in a span, if one is found."""
        solver = solver_for(self.scene, family, None, span)
        for axis in self._places(area):
            base = pose_of(self.scene.robot, axis, into_span(self._yaw(axis), span))
            if self.is_exhausted:
                break
            pose = self.at(solver, base)
            if pose is not None:
                return pose
        return None

    def at(self, solver: Solver, base: Array) -> Pose | None:
        """A confirmed configuration with the arm axis as a base pose (3,) has it, if one is found."""
        free_space = self.on_target(self._postures(solver, base))
        clear = next((q for q in free_space if self.collision.proves(q)), None)
        if clear is not None:
            return clear
        self.colliding += len(free_space)
        best = -np.inf
        for q in free_space[: OPTIONS.max_measured]:
            room = self._room(q, best)
            if room == np.inf:
                return q
            if room > best:
                best, nearest = room, q
        if best > -np.inf:
            self.nearly.append((best, nearest))
        return None

    def in_areas(self) -> Pose | None:
        """A confirmed configuration in the areas that hold at every heading, if one is found."""
        areas, sides = path_areas(self.scene, [self.target]), self.scene.free_floor.anywhere.sides
        for k in np.flatnonzero(shapely.area(areas.inner) > MIN_AREA).tolist():
            pose = self.within(areas.inner[k], areas.family[k], sides[areas.side[k]].span)
            if pose is not None:
                return pose
        return None

    def search(self) -> Pose | None:
        """Sample postures of the arm at the places nearest to a clear one, or at the one that counts."""
        nearest = sorted(
            (one for one in self.nearly if one[0] > -OPTIONS.max_overlap), key=lambda one: -one[0]
        )
        about = [near for _, near in nearest[: OPTIONS.max_sampled_places]]
        if not about and self.fixed_base is not None:
            about = [Pose(self.fixed_base, self.scene.robot.carry)]
        return next((q for q in map(self._searched, about) if q is not None), None)

    def on_target(self, poses: Sequence[Pose]) -> list[Pose]:
        """Those whose tool, joints and base meet target, limits and floor, whatever the arm touches."""
        if not poses:
            return []
        scene, model = self.scene, reach_model(self.scene.robot, "point")
        bases, joints = arrays(poses)
        chain = scene.robot.chain
        within = ((joints >= chain.lower - BOUND_SLACK) & (joints <= chain.upper + BOUND_SLACK)).all(axis=1)
        errors = [goal_error(self.target, tool) for tool in scene.robot.tool(bases, joints)]
        off, angles = np.array(errors).T
        good = (
            within & (off <= scene.rules.tolerance + BOUND_SLACK) & (angles <= self.target.cone + BOUND_SLACK)
        )
        free = {
            place: self._base_may_stand(place) for place in {tuple(base) for base in bases[good].tolist()}
        }
        return [
            q
            for q, on_target in zip(poses, good.tolist(), strict=True)
            if on_target and free[tuple(q.base.tolist())] and model.meets(scene.rules.criteria, q.joints)
        ]

    def confirms(self, q: Pose) -> bool:
        """True where a configuration is an answer."""
        return bool(self.on_target([q])) and self.collision.clear(q)

    @property
    def who(self) -> str:
        """The target in words."""
        return setpoint_at([self.target], 0)

    def _base_may_stand(self, base: tuple[float, float, float]) -> bool:
        """True where the base may stand: on free floor, and as it is held."""
        if self.fixed_base is not None:
            return base == tuple(self.fixed_base.tolist())
        return bool(fits(self.scene.footprint, *base))

    def _places(self, area: BaseGeometry) -> Array:
        """The middle of the area's largest part, then places spread over all of it."""
        largest = max(shapely.get_parts(area), key=lambda part: part.area)
        middle = shapely.maximum_inscribed_circle(largest).coords[0]
        return np.vstack([middle, spread(area, OPTIONS.max_places, 0)])

    def _postures(self, solver: Solver, base: Array) -> list[Pose]:
        """The posture that the solver finds from the carried arm, then those of its self-motion."""
        carry = self.scene.robot.carry
        first = solver.hold(self.target, base, carry)
        if not first.converged and self.fixed_base is None:
            return []
        poses = [self._posed(first)] if first.converged else []
        if not poses or (self.collision.enabled and not self.confirms(poses[0])):
            others = solver.self_motion(self.target, base, carry, OPTIONS.max_pitches)
            poses += [self._posed(one) for one in others]
        return poses

    def _posed(self, configuration: Configuration) -> Pose:
        """What a solver found; a held base is as it is held, not as it is rounded."""
        return Pose(configuration.base if self.fixed_base is None else self.fixed_base, configuration.joints)

    def _searched(self, q: Pose) -> Pose | None:
        """Search postures of the arm about the nearest one, the base held."""
        found = self.finder.sampled(q, OPTIONS.max_samples)
        if found.joints is None:
            return None
        pose = Pose(q.base, np.array(found.joints))
        if self.scene.rules.heading == "face_target":  # the search turned the pivot
            pose = facing(self.scene.robot, pose)
        return pose if self.confirms(pose) else None

    def _room(self, q: Pose, best: float) -> float:
        """Clearance of the arm beyond what is asked, infinite where it is clear [m].

        Where it is less than ``best``, some contact's, not the nearest one's.
        """
        proximity = self.collision.nearest(q, best)
        room = self.collision.room(proximity)
        if self.proximity is None or room > self.collision.room(self.proximity):
            self.proximity = proximity
        return room

    def _yaw(self, axis: Array) -> float:
        """Heading of the base: the fixed one, else towards the target."""
        if self.scene.rules.heading == "fixed":
            return self.scene.free_floor.headings[0]
        away = self.target.position[:2] - axis
        return float(np.arctan2(away[1], away[0]))
