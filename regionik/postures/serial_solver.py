"""Any arm on a vertical pivot, its base following, solved as a chain of rigid bodies by FABRIK-R."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from regionik.planners.geometry.polygons import FlatPolygon, clamp, contains
from regionik.planners.reach.level_reach import posture_at
from regionik.planners.reach.pose_reach import ANGLE_SHARE, pose_reach
from regionik.planners.solvers.base_placement import BaseArea
from regionik.planners.solvers.damped_least_squares import Aim, polish
from regionik.planners.solvers.inverse_kinematics import spread_postures
from regionik.planners.solvers.mfabrik_serial import ArmStand, follow_with_restarts, in_arm_frame
from regionik.planners.solvers.multistart_ik import Effort, solve
from regionik.planners.solvers.rigid_bodies import RigidBodies, pointing_bodies, posing_bodies, span
from regionik.postures.tool_goal import HELD, aim_of
from regionik.worlds.arms import pivot_index, reach_bound, with_pivot
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.scene import Target

MOST_PASSES = 100
RESTARTS = 10
MOST_STEPS = 60  # of damped least squares when a posture is carried along
ALIKE = 0.05  # postures that differ by less in every joint are one [rad]
NEAREST = 6  # postures of the reach that are tried where passes and restarts do not meet a target


@dataclass(frozen=True, eq=False)
class Reached:
    """Where the arm axis stands and how the arm reaches: the pivot counted from a given heading."""

    axis: Array  # (2,) [m]
    joints: Array  # (dof,)
    error: float  # [m]
    iterations: int
    angle: float = 0.0  # by which the tool points, or is turned, out of its cone [rad]
    meets: bool = True  # what is asked of postures besides


@dataclass(frozen=True, eq=False)
class SerialSolver:
    """Any arm on a vertical pivot, solved by FABRIK-R with its limits.

    Attributes
    ----------
    chain, endless : Chain
        As it is `with_pivot`, and with a pivot that turns without end, where the base turns.
    pointing, posing : RigidBodies
        Of the latter, for positions, and for more.
    starts : (r, dof) array
        Postures to start again from.
    effort : Effort
    height : float
        Of the arm's base frame over the floor [m].
    """

    chain: Chain
    endless: Chain
    pointing: RigidBodies
    posing: RigidBodies
    starts: Array
    effort: Effort
    height: float

    @cached_property
    def _pointing_starts(self) -> Array:
        """The joints of the starts that move the tool's point."""
        return np.ascontiguousarray(self.starts[:, : len(self.pointing.slide)])

    def reach(
        self, target: Target, axis: Array, yaw: float, joints: Array, area: FlatPolygon, mobile: bool
    ) -> Reached:
        """Bring the tool to a target; see `Arm`.

        A pose is asked for where the base stands first, as that changes least; then come passes, the postures
        that the reach is made of, and restarts.
        """
        quest = self.quest(target)
        if target.direction is None:
            if mobile:
                found = self._followed(quest, quest.starts, axis, yaw, joints, area)
            else:
                found = self._held(quest, axis, yaw, joints)
            return found if quest.met(found) else self._walked(target, found, yaw)
        bounded = mobile and len(area.starts) > 1
        place = np.array(clamp(area.vertices, area.starts, *axis) if bounded else axis)
        near = self._polished(quest, place, yaw, joints)
        if near is not None:
            return near
        if not mobile:
            return self._held(quest, axis, yaw, joints)
        found = self._followed(quest, quest.starts[:0], axis, yaw, joints, area)
        if quest.met(found):
            return found
        known = self._from_reach(quest, found, yaw, joints, area)
        return known or self._followed(quest, quest.starts, axis, yaw, joints, area)

    def _followed(
        self, quest: SerialGoal, starts: Array, axis: Array, yaw: float, joints: Array, area: FlatPolygon
    ) -> Reached:
        """M-FABRIK: passes with the base after the root, then restarts."""
        q, place = np.array(joints), np.array(axis)
        stand = ArmStand(pivot_index(self.chain), yaw, self.height)
        free = BaseArea(area.vertices, area.starts, True)
        error, angle, passes = follow_with_restarts(
            quest.bodies, stand, starts, free, place, quest.aim, quest.effort, q
        )
        return quest.reached(place, q, error, angle, passes)

    def _walked(self, target: Target, missed: Reached, yaw: float) -> Reached:
        """By a walk at the target's height, where that comes nearer."""
        point = in_arm_frame(missed.axis, yaw, self.height, aim_of(target)).position
        joints = posture_at(self.endless, point, missed.joints)
        off = float(np.linalg.norm(self.chain.forward(joints)[:3, 3] - point))
        return replace(missed, joints=joints, error=off) if off < missed.error else missed

    def _held(self, quest: SerialGoal, axis: Array, yaw: float, joints: Array) -> Reached:
        """FABRIK-R with the base held."""
        q, aim = np.array(joints), in_arm_frame(axis, yaw, self.height, quest.aim)
        error, angle, passes, _, _ = solve(quest.bodies, aim, quest.starts, quest.effort, q)
        return quest.reached(axis, q, error, angle, passes)

    def reach_many(
        self, targets: Array, axes: Array, yaws: Array, joints: Array, area: FlatPolygon
    ) -> list[Reached]:
        """One after the other; see `Arm`."""
        rows = zip(map(Target, targets), axes, yaws.tolist(), joints, strict=True)
        return [self.reach(*row, area, True) for row in rows]

    def least_change(self, target: Target, axis: Array, yaw: float, joints: Array) -> Reached | None:
        """The posture on target that damped least squares comes to; see `Arm`."""
        quest = self.quest(target)
        return self._polished(quest, np.array(axis), yaw, np.array(joints))

    def self_motion(
        self, target: Target, axis: Array, yaw: float, joints: Array, tries: int
    ) -> list[Reached]:
        """Postures on target come to from ``tries`` starts; see `Arm`.

        For a pose every other start lies about the given posture, and damped least squares alone leads on:
        passes that must meet a direction wander, and arms that curl up come near to themselves.
        """
        quest, rng = self.quest(target), np.random.default_rng(0)
        arm, n = quest.bodies.arm, len(quest.bodies.slide)
        low = np.where(np.isfinite(arm.lower), arm.lower, -np.pi)
        high = np.where(np.isfinite(arm.upper), arm.upper, np.pi)
        starts = rng.uniform(low, high, (tries, n))
        if target.direction is not None:
            starts[::2] = np.clip(joints + rng.normal(size=starts[::2].shape), arm.lower, arm.upper)
        found: list[Reached] = []
        for start in starts:
            one = self._on_target(target, quest, axis, yaw, np.concatenate([start, joints[n:]]))
            if one is not None and all(np.abs(one.joints - other.joints).max() > ALIKE for other in found):
                found.append(one)
        return found

    def _on_target(
        self, target: Target, quest: SerialGoal, axis: Array, yaw: float, start: Array
    ) -> Reached | None:
        """A posture on target come to from one start, without any other."""
        if target.direction is not None:
            return self._polished(quest, axis, yaw, start)
        none = np.empty((0, len(quest.bodies.slide)))
        aim = in_arm_frame(axis, yaw, self.height, quest.aim)
        error, angle, passes, _, _ = solve(quest.bodies, aim, none, quest.effort, start)
        found = quest.reached(axis, start, error, angle, passes)
        return found if quest.met(found) else None

    def _from_reach(
        self, quest: SerialGoal, missed: Reached, yaw: float, joints: Array, area: FlatPolygon
    ) -> Reached | None:
        """From the postures that the reach is made of: the base where it came to, or as near as may be."""
        known = pose_reach(self.chain, self.height, quest.aim)
        near = np.argsort(np.hypot(*(known.places - missed.axis).T), kind="stable")
        bounded = len(area.starts) > 1
        free = [k for k in near if not bounded or contains(area.vertices, area.starts, *known.places[k])]
        tries = [(missed.axis, k) for k in near[:NEAREST]] + [(known.places[k], k) for k in free[:1]]
        for place, k in tries:
            q = np.array(known.postures[k])
            q[pivot_index(self.chain)] += known.yaws[k] - yaw
            endless = np.isinf(self.chain.upper - self.chain.lower)
            q = np.where(endless, joints + np.remainder(q - joints + np.pi, 2 * np.pi) - np.pi, q)
            found = self._polished(quest, np.array(place), yaw, q)
            if found is not None:
                return replace(found, iterations=missed.iterations)
        return None

    def _polished(self, quest: SerialGoal, place: Array, yaw: float, joints: Array) -> Reached | None:
        """Damped least squares from a posture, the base held."""
        n, effort = len(quest.bodies.slide), quest.effort
        q, aim = np.array(joints[:n]), in_arm_frame(place, yaw, self.height, quest.aim)
        error, angle, _ = polish(
            quest.bodies.arm, aim, q, effort.reach, effort.tolerance, effort.angle_tolerance, MOST_STEPS
        )
        if error > effort.tolerance or angle > effort.angle_tolerance:
            return None
        return quest.reached(place, np.concatenate([q, joints[n:]]), error, angle, 0)

    def quest(self, target: Target) -> SerialGoal:
        """What a target asks of the kernels, and with which effort."""
        if target.direction is None:
            return SerialGoal(self.pointing, self._pointing_starts, self.effort, aim_of(target), 0.0)
        effort = self.effort._replace(angle_tolerance=ANGLE_SHARE * target.cone)
        return SerialGoal(self.posing, self.starts, effort, aim_of(target), (1 - HELD) * target.cone)


@dataclass(frozen=True, eq=False)
class SerialGoal:
    """A target as the kernels take it, and what is left of its cone beyond the aim's [rad]."""

    bodies: RigidBodies
    starts: Array
    effort: Effort
    aim: Aim
    spare: float

    def met(self, found: Reached) -> bool:
        return found.error <= self.effort.tolerance and found.angle == 0.0

    def reached(self, place: Array, joints: Array, error: float, angle: float, passes: int) -> Reached:
        return Reached(place, joints, float(error), int(passes), max(0.0, float(angle) - self.spare))


@lru_cache(maxsize=64)
def serial_solver(chain: Chain, height: float, tolerance: float, *, turns: bool = True) -> SerialSolver:
    """Kept for the last few, as every set-point asks for it.

    The pivot has no limits where the base ``turns``, and its own where that keeps its heading.
    """
    reach_bound(chain)
    chain = with_pivot(chain)
    joints, pivot = list(chain.joints), pivot_index(chain)
    if turns:
        joints[pivot] = replace(joints[pivot], lower=-np.inf, upper=np.inf)
    endless = Chain(tuple(joints), chain.T_last_tool)
    pointing, posing = pointing_bodies(endless), posing_bodies(endless)
    effort = Effort(tolerance, 1.0, MOST_PASSES, span(pointing.arm), True)
    starts = spread_postures(endless, effort.reach, RESTARTS, 0)
    return SerialSolver(chain, endless, pointing, posing, starts, effort, height)
