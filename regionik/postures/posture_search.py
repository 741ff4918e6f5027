"""Collision-free postures at set-points from one base pose, continued from known ones and neighbours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from regionik.planners.avoidance.clear_posture import NeighboringTargets, neighboring_postures
from regionik.planners.reach.serial_criteria import SerialThresholds, demand_of, serial_thresholds
from regionik.planners.solvers.aims import in_columns
from regionik.planners.solvers.damped_least_squares import POSITION, Aims
from regionik.planners.solvers.serial_chain import serial_arm
from regionik.postures.arm_roadmap import ArmRoadmap, travel_roadmap
from regionik.postures.collision_checker import MAX_SPARE, CollisionChecker, contact_for
from regionik.postures.options import POSTURES
from regionik.postures.poses import axis_of
from regionik.postures.serial_solver import SerialSolver, serial_solver
from regionik.worlds.arms import pivot_index, pivot_joints
from regionik.worlds.arrays import Array, Index
from regionik.worlds.joints import nearest_turn
from regionik.worlds.robot import with_joint_margin
from regionik.worlds.scene import Target, World

OPTIONS = POSTURES.search


@dataclass(frozen=True, eq=False)
class PostureSearch:
    """Search for postures of a robot at set-points, its base at any pose."""

    world: World
    collision: CollisionChecker
    targets: Sequence[Target]

    def neighboring(self, base: Array, some: Index, starts: int = OPTIONS.max_starts) -> tuple[Index, Array]:
        """Return those of some set-points where a clear posture was soon found, and the postures."""
        return next(self._neighboring(base, some, [slice(None, starts)]))

    def families(self, base: Array, some: Index, count: int) -> Iterator[tuple[Index, Array]]:
        """As `neighboring`, so many times: each from one start, so that the postures are of another kind."""
        return self._neighboring(base, some, [slice(n, n + 1) for n in range(count)])

    def _neighboring(self, base: Array, some: Index, parts: Sequence[slice]) -> Iterator[tuple[Index, Array]]:
        """As `neighboring`, from each part of the starts, the likeliest of which come first."""
        axis, yaw = axis_of(self.world.robot, base), float(base[2] + self.world.robot.mount[3])
        if not len(some):
            yield some, np.empty((0, self.world.robot.chain.dof))
            return
        aims, effort = self._aims(axis, yaw, some), self._bound.effort
        spots = aims.positions
        far = np.linalg.norm(spots[:, None] - spots[None], axis=2)
        near = np.argsort(far, axis=1, kind="stable")[:, 1 : OPTIONS.max_neighbors + 1]
        collision, margin = self.collision, MAX_SPARE if self.collision.enabled else -np.inf
        targets = NeighboringTargets(
            collision.bodies.scene(collision.contact), margin, base, self._thresholds,
            serial_arm(self._bound.chain), aims,
            self._tool_on[some], np.ascontiguousarray(near), effort.reach, effort.tolerance,
        )  # fmt: skip
        starts, more = self._starts(aims, parts[-1].stop), self._bound.chain.dof - self.world.robot.chain.dof
        for part in parts:
            postures = np.zeros((len(some), self._bound.chain.dof))
            found = neighboring_postures(targets, np.ascontiguousarray(starts[:, part]), postures)
            yield some[found], postures[found][:, more:]

    def _starts(self, aims: Aims, count: int) -> Array:
        """Postures (n, s, k) to begin from: of the travel roadmap, turned to the target, the nearest."""
        chain, (postures, points, axes) = self._bound.chain, self._known
        bearing = np.arctan2(aims.positions[:, 1], aims.positions[:, 0])[:, None]
        pivot, turn = chain.active_joints[self._pivot], bearing - np.arctan2(points[:, 1], points[:, 0])
        turned = postures[:, self._pivot] + turn
        if np.isfinite(pivot.upper - pivot.lower):
            middle = (pivot.lower + pivot.upper) / 2
            within = nearest_turn(turned, middle)
            turned = np.clip(within, pivot.lower, pivot.upper)
            turn = turn + turned - within
        c, s = np.cos(turn), np.sin(turn)
        moved = [
            np.stack([c * p[:, 0] - s * p[:, 1], s * p[:, 0] + c * p[:, 1], c * 0 + p[:, 2]], -1)
            for p in (points, axes)
        ]
        off = np.linalg.norm(moved[0] - aims.positions[:, None], axis=2)
        if (aims.kinds != POSITION).all():
            off += self._bound.effort.reach * (1 - (moved[1] * aims.turns[:, None, :, 2]).sum(axis=2)) / 2
        best = np.argsort(off, axis=1, kind="stable")[:, :count]
        starts = postures[best]
        starts[:, :, self._pivot] = np.take_along_axis(turned, best, axis=1)
        return starts

    @cached_property
    def _travel(self) -> ArmRoadmap:
        return travel_roadmap(self.world)

    @cached_property
    def _known(self) -> tuple[Array, Array, Array]:
        """Postures of the travel roadmap as the solver has them, and their tools' points and axes."""
        postures = self._behind(self._travel.joints)
        tools = np.array([self._bound.chain.forward(q) for q in postures])
        return postures, tools[:, :3, 3], tools[:, :3, 2]

    @cached_property
    def _tool_on(self) -> Index:
        """Index of the obstacle that the tool works on at each set-point, -1 for none."""
        owners = [contact_for(self.world, [target]).owner for target in self.targets]
        return np.array([own[0] if len(own) else -1 for own in owners], dtype=np.int64)

    def _behind(self, joints: Array) -> Array:
        """Return postures (..., dof) as the solver has them."""
        return pivot_joints(self.world.robot.chain, joints)

    def _aims(self, axis: Array, yaw: float, some: Index | slice) -> Aims:
        """Return set-points in the frame of an arm whose base is at a place with a heading."""
        c, s = np.cos(yaw), np.sin(yaw)
        back = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        goals = self._goals.part(some)
        seen = goals.positions - (0.0, 0.0, self.world.robot.mount[2])
        seen[:, :2] -= axis
        return goals._replace(positions=seen @ back.T, turns=back @ goals.turns)

    @cached_property
    def _goals(self) -> Aims:
        goals = [self._free.goal_for(target) for target in self.targets]
        angles = np.array([goal.effort.angle_tolerance for goal in goals])
        return in_columns([goal.aim for goal in goals])._replace(angle_tolerances=angles)

    @cached_property
    def _free(self) -> SerialSolver:
        return self._arm(turns=True)

    @cached_property
    def _bound(self) -> SerialSolver:
        return self._arm(turns=False)

    def _arm(self, *, turns: bool) -> SerialSolver:
        """Solver with a pivot that has no limits, or its own."""
        rules, robot = self.world.rules, with_joint_margin(self.world.robot, self.world.rules.criteria)
        demand = demand_of(robot, rules.criteria)
        return serial_solver(robot.chain, float(robot.mount[2]), rules.tolerance, turns=turns, demand=demand)

    @property
    def _thresholds(self) -> SerialThresholds:
        return serial_thresholds(self._bound.demand, self._bound.chain.dof)

    @property
    def _pivot(self) -> int:
        return pivot_index(self._bound.chain)
