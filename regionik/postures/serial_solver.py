"""Any arm on a vertical pivot, its base following, solved as a chain of rigid bodies by FABRIK-R."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from regionik.planners.geometry.polygons import FlatPolygon, clamp, contains
from regionik.planners.reach.level_reach import posture_at
from regionik.planners.reach.options import REACH
from regionik.planners.reach.pose_reach import pose_reach
from regionik.planners.reach.serial_criteria import PostureDemand, moved_within_thresholds
from regionik.planners.solvers.base_placement import BaseArea
from regionik.planners.solvers.closed_form import decomposition, postures_at
from regionik.planners.solvers.damped_least_squares import ORIENTATION, Aim, polish, polish_each, tool_error
from regionik.planners.solvers.mfabrik_serial import ArmMounting, in_arm_frame, solve_serial
from regionik.planners.solvers.multistart_ik import Effort, solve_ik
from regionik.planners.solvers.rigid_bodies import RigidBodies, arm_model, span
from regionik.planners.solvers.serial_chain import SerialArm, serial_arm
from regionik.postures.arm import CONE_SHARE, UNTOLD, ArmSolution, aim_of
from regionik.postures.options import POSTURES
from regionik.worlds.arms import pivot_index, reach_bound, sliding_chain, with_pivot, with_pivot_limits
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, spread_postures, within_half_turns
from regionik.worlds.joints import nearest_turn
from regionik.worlds.prepared import made_once
from regionik.worlds.scene import Target

OPTIONS = POSTURES.solver


@dataclass(frozen=True, eq=False)
class SerialSolver:
    """Any arm on a vertical pivot, solved by FABRIK-R with its limits."""

    chain: Chain  # as it is `with_pivot`
    endless: Chain  # with a pivot that turns without end, where the base turns
    pointing: RigidBodies  # of the latter, for positions
    posing: RigidBodies  # and for more
    starts: Array  # (r, dof) postures to start again from
    effort: Effort
    height: float  # of the arm's base frame over the floor [m]
    demand: PostureDemand | None = None

    def reach(
        self,
        target: Target,
        axis: Array,
        yaw: float,
        joints: Array,
        area: FlatPolygon,
        mobile: bool,
        history: Array = UNTOLD,
    ) -> ArmSolution:
        """Bring the tool to a target; see `Arm`. Of the postures there, one that meets the demand.

        For a pose, the posture nearest to the present one is tried first, the base held; then passes, the
        postures that the reach was sampled by, and restarts.
        """
        goal = self.goal_for(target)
        found = self._reach_any(target, goal, axis, yaw, joints, area, mobile, history)
        if self.demand is None or not goal.is_met_by(found):
            return found
        led = self._within_demand(goal, found, yaw)
        if led is not None:
            return led
        others = self.self_motion(target, found.axis, yaw, joints, OPTIONS.max_other_starts)
        if not others and mobile and (known := self._from_reach(goal, found, yaw, joints, area)) is not None:
            return known
        nearest = min(others, key=lambda one: float(np.abs(one.joints - joints).max()), default=None)
        return replace(found, meets=False) if nearest is None else nearest

    def _reach_any(
        self,
        target: Target,
        goal: SerialGoal,
        axis: Array,
        yaw: float,
        joints: Array,
        area: FlatPolygon,
        mobile: bool,
        history: Array,
    ) -> ArmSolution:
        """`reach` by any posture."""
        if target.direction is None:
            if mobile:
                found = self._followed(goal, goal.starts, axis, yaw, joints, area, history)
            else:
                found = self._fixed_base(goal, axis, yaw, joints)
            return found if goal.is_met_by(found) else self._walked(target, found, yaw)
        near = self._polished(goal, self._nearest_place(axis, area) if mobile else axis, yaw, joints)
        if near is not None:
            return near
        if not mobile:
            return self._fixed_base(goal, axis, yaw, joints)
        found = self._followed(goal, goal.starts[:0], axis, yaw, joints, area)
        if goal.is_met_by(found):
            return found
        known = self._from_reach(goal, found, yaw, joints, area)
        return known or self._followed(goal, goal.starts, axis, yaw, joints, area)

    def _followed(
        self,
        goal: SerialGoal,
        starts: Array,
        axis: Array,
        yaw: float,
        joints: Array,
        area: FlatPolygon,
        history: Array = UNTOLD,
    ) -> ArmSolution:
        """M-FABRIK: passes with the base after the root, base and arm polished together, then restarts."""
        q, place = np.array(joints), np.array(axis)
        mounting = ArmMounting(pivot_index(self.chain), yaw, self.height)
        free = BaseArea(area.vertices, area.starts, True)
        error, angle, passes = solve_serial(
            goal.bodies, goal.sliding, mounting, starts, free, place, goal.aim, goal.effort, q, history
        )
        return goal.solution(place, q, error, angle, passes)

    def _nearest_place(self, axis: Array, area: FlatPolygon) -> Array:
        return np.array(clamp(area.vertices, area.starts, *axis) if len(area.starts) > 1 else axis)

    def _walked(self, target: Target, missed: ArmSolution, yaw: float) -> ArmSolution:
        """Solve by a walk at the target's height, where that comes nearer."""
        point = in_arm_frame(missed.axis, yaw, self.height, aim_of(target)).position
        joints = posture_at(self.endless, point, missed.joints)
        off = float(np.linalg.norm(self.chain.forward(joints)[:3, 3] - point))
        return replace(missed, joints=joints, error=off) if off < missed.error else missed

    def _fixed_base(self, goal: SerialGoal, axis: Array, yaw: float, joints: Array) -> ArmSolution:
        """Return the result of FABRIK-R on a fixed base."""
        q, aim = np.array(joints), in_arm_frame(axis, yaw, self.height, goal.aim)
        error, angle, passes, _, _ = solve_ik(goal.bodies, aim, goal.starts, goal.effort, q)
        return goal.solution(axis, q, error, angle, passes)

    def _within_demand(self, goal: SerialGoal, solution: ArmSolution, yaw: float) -> ArmSolution | None:
        """Return a posture from the same place that meets the demand; None if none is found."""
        if self.demand is None:
            return solution
        arm, effort, q = serial_arm(self.endless), goal.effort, np.array(solution.joints)
        aim = in_arm_frame(solution.axis, yaw, self.height, goal.aim)
        within = effort.reach, effort.tolerance, effort.angle_tolerance
        if not moved_within_thresholds(arm, self.demand.thresholds, aim, q, *within):
            return None
        error, angle = tool_error(arm, aim, q, np.empty((len(arm.axis) + 1, 4, 4)), np.empty(6))
        return goal.solution(solution.axis, q, error, angle, solution.iterations)

    def meets(self, joints: Array) -> bool:
        """True if a posture (dof,) meets the demand."""
        return self.demand is None or self.demand.is_met_by(joints)

    def least_change(self, target: Target, axis: Array, yaw: float, joints: Array) -> ArmSolution | None:
        """The posture on target that damped least squares comes to; see `Arm`."""
        goal = self.goal_for(target)
        found = self._polished(goal, np.array(axis), yaw, np.array(joints))
        return None if found is None else self._within_demand(goal, found, yaw)

    def self_motion(
        self, target: Target, axis: Array, yaw: float, joints: Array, tries: int
    ) -> list[ArmSolution]:
        """Postures on target that meet the demand, each led to it; see `Arm` and `_postures`."""
        goal = self.goal_for(target)
        found = (
            self._within_demand(goal, one, yaw)
            for one in self._postures(target, goal, axis, yaw, joints, tries)
        )
        return [one for one in found if one is not None]

    def _postures(
        self, target: Target, goal: SerialGoal, axis: Array, yaw: float, joints: Array, tries: int
    ) -> list[ArmSolution]:
        """Postures on target: all that a closed form knows, or those come to from some starts.

        A closed form knows those at the pose itself; there may be none, and yet some in its cone. The first
        start is the given posture.

        Damped least squares leads on, and where it misses a point, passes: those that must meet a direction
        wander, and arms that curl up come near to themselves. So for one every other start lies about the
        given posture.
        """
        rng = np.random.default_rng(0)
        if goal.aim.kind == ORIENTATION and decomposition(self.endless) is not None:
            known = self._all_postures(goal, axis, yaw, joints)
            if known:
                return known
        arm = goal.bodies.arm
        n = len(arm.lower)
        starts = rng.uniform(*within_half_turns(arm.lower, arm.upper), (tries, n))
        starts = self.endless.unwound(np.column_stack([starts, np.tile(joints[n:], (tries, 1))]))[:, :n]
        if target.direction is not None:
            starts[::2] = np.clip(joints + rng.normal(size=starts[::2].shape), arm.lower, arm.upper)
        starts[0] = joints[:n]
        found: list[ArmSolution] = []
        for one in self._on_target(target, goal, axis, yaw, starts, joints):
            if all(np.abs(one.joints - other.joints).max() > OPTIONS.same_posture for other in found):
                found.append(one)
        return found

    def _all_postures(self, goal: SerialGoal, axis: Array, yaw: float, joints: Array) -> list[ArmSolution]:
        """Every posture at the pose itself, its joints the turns nearest to the given ones."""
        aim, tool = in_arm_frame(axis, yaw, self.height, goal.aim), np.eye(4)
        tool[:3, :3], tool[:3, 3] = aim.turn, aim.position
        found = postures_at(self.endless, tool[None])[0]
        near = found + 2 * np.pi * np.round((joints - found) / (2 * np.pi))
        found = np.where((self.endless.lower <= near) & (near <= self.endless.upper), near, found)
        return [goal.solution(axis, q, 0.0, 0.0, 0) for q in found]

    def _on_target(
        self, target: Target, goal: SerialGoal, axis: Array, yaw: float, starts: Array, joints: Array
    ) -> Iterator[ArmSolution]:
        """Postures on target from starts (m, n), by damped least squares; for a point, else by passes."""
        effort, arm, ends = goal.effort, goal.bodies.arm, starts.copy()
        aim, none = in_arm_frame(axis, yaw, self.height, goal.aim), starts[:0]
        most = effort.reach, effort.tolerance, effort.angle_tolerance, OPTIONS.max_carry_steps
        for start, end, error, angle in zip(starts, ends, *polish_each(arm, aim, ends, *most), strict=True):
            q = np.concatenate([end, joints[len(end) :]])
            if error > effort.tolerance or angle > effort.angle_tolerance:
                if target.direction is not None:
                    continue
                q[: len(end)] = start
                error, angle, *_ = solve_ik(goal.bodies, aim, none, effort, q)
            one = goal.solution(axis, q, error, angle, 0)
            if goal.is_met_by(one):
                yield one

    def _from_reach(
        self, goal: SerialGoal, missed: ArmSolution, yaw: float, joints: Array, area: FlatPolygon
    ) -> ArmSolution | None:
        """From the postures that the reach is made of: the base where it came to, or as near as may be."""
        known = pose_reach(self.chain, self.height, goal.aim, None, self.demand).grid
        near = np.argsort(np.hypot(*(known.places - missed.axis).T), kind="stable")
        bounded = len(area.starts) > 1
        free = [k for k in near if not bounded or contains(area.vertices, area.starts, *known.places[k])]
        tries = [(missed.axis, k) for k in near[: OPTIONS.max_nearest]]
        tries += [(known.places[k], k) for k in free[:1]]
        for place, k in tries:
            q = np.array(known.postures[k])
            q[pivot_index(self.chain)] += known.yaws[k] - yaw
            endless = np.isinf(self.chain.upper - self.chain.lower)
            q = np.where(endless, nearest_turn(q, joints), q)
            found = self._polished(goal, np.array(place), yaw, q)
            if found is not None and (led := self._within_demand(goal, found, yaw)) is not None:
                return replace(led, iterations=missed.iterations)
        return None

    def _polished(self, goal: SerialGoal, place: Array, yaw: float, joints: Array) -> ArmSolution | None:
        """Return the result of damped least squares from a posture on a fixed base."""
        n, effort = len(goal.bodies.arm.lower), goal.effort
        q, aim = np.array(joints[:n]), in_arm_frame(place, yaw, self.height, goal.aim)
        most = effort.reach, effort.tolerance, effort.angle_tolerance, OPTIONS.max_carry_steps
        error, angle, _ = polish(goal.bodies.arm, aim, q, *most)
        if error > effort.tolerance or angle > effort.angle_tolerance:
            return None
        return goal.solution(place, np.concatenate([q, joints[n:]]), error, angle, 0)

    def goal_for(self, target: Target) -> SerialGoal:
        """Return a target as the kernels take it, and the effort to make."""
        if target.direction is None:
            starts = np.ascontiguousarray(self.starts[:, : len(self.pointing.arm.lower)])
            sliding = arm_model(sliding_chain(self.endless)).pointing.arm
            return SerialGoal(self.pointing, sliding, starts, self.effort, aim_of(target), 0.0)
        sliding = serial_arm(sliding_chain(self.endless))
        effort = self.effort._replace(angle_tolerance=REACH.pose.angle_share * target.cone)
        return SerialGoal(
            self.posing, sliding, self.starts, effort, aim_of(target), (1 - CONE_SHARE) * target.cone
        )


@dataclass(frozen=True, eq=False)
class SerialGoal:
    """A target as the kernels take it, and what is left of its cone beyond the aim's [rad]."""

    bodies: RigidBodies
    sliding: SerialArm  # that of the bodies after two slides of the base
    starts: Array
    effort: Effort
    aim: Aim
    spare: float

    def is_met_by(self, solution: ArmSolution) -> bool:
        return solution.error <= self.effort.tolerance and solution.angle == 0.0

    def solution(self, place: Array, joints: Array, error: float, angle: float, passes: int) -> ArmSolution:
        return ArmSolution(place, joints, float(error), int(passes), max(0.0, float(angle) - self.spare))


@made_once
def serial_solver(
    chain: Chain,
    height: float,
    tolerance: float,
    *,
    turns: bool = True,
    demand: PostureDemand | None = None,
) -> SerialSolver:
    """Return the solver of a chain; the last few are cached, as every set-point asks for one.

    The pivot has no limits where the base ``turns``, and its own where that keeps its heading.
    """
    reach_bound(chain)
    chain = with_pivot(chain)
    endless = with_pivot_limits(chain, -np.inf, np.inf) if turns else chain
    pointing, posing = arm_model(endless).pointing, arm_model(endless).posing
    effort = Effort(tolerance, 1.0, 0 if chain.has_mimics else OPTIONS.max_passes, span(pointing.arm), True)
    starts = spread_postures(endless, effort.reach, OPTIONS.max_restarts, 0)
    return SerialSolver(chain, endless, pointing, posing, starts, effort, height, demand)
