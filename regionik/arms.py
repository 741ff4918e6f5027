"""What M-FABRIK asks of an arm: to follow a target with its base, to hold its base, to show its self-motion.

Arms that work in one vertical plane are solved in it; all others as chains of rigid bodies by FABRIK-R. Both
take the pivot as endless: `mfabrik` shares its turn between joint and base.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np

from regionik.planners import fabrik, kernels
from regionik.planners.bodies import Bodies, pointing_bodies, span
from regionik.planners.flat import FlatPolygon
from regionik.planners.inverse import spread_postures
from regionik.planners.levelreach import posture_at
from regionik.planners.mobile import roam, seen
from regionik.planners.polish import POSITION, Aim, polish
from regionik.planners.reaching import Effort, solve
from regionik.reachable import Family
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.pivot import is_planar, pivot_of, span_of
from regionik.worlds.planar import PlanarArm, planar_arm

MOST_PASSES = 100
RESTARTS = 10
MOST_STEPS = 60  # of damped least squares when a posture is carried along
ALIKE = 0.05  # postures that differ by less in every joint are one [rad]


@dataclass(frozen=True, eq=False)
class Reached:
    """Where the arm axis stands and how the arm reaches: the pivot counted from a given heading."""

    axis: Array  # (2,) [m]
    joints: Array  # (dof,)
    error: float  # [m]
    iterations: int


class Arm(Protocol):
    """An arm on a base, the heading of its base frame given."""

    def reach(
        self, target: Array, axis: Array, yaw: float, joints: Array, area: FlatPolygon, mobile: bool
    ) -> Reached:
        """Bring the tool to a target; a mobile base follows inside the area, any other stays."""

    def reach_many(
        self, targets: Array, axes: Array, yaws: Array, joints: Array, area: FlatPolygon
    ) -> list[Reached]:
        """As `reach` with a mobile base, for rows of targets and starts."""

    def least_change(self, target: Array, axis: Array, yaw: float, joints: Array) -> Reached | None:
        """The posture on target that changes least, the base held."""

    def self_motion(self, target: Array, axis: Array, yaw: float, joints: Array, tries: int) -> list[Reached]:
        """Postures on target of many kinds, the base held."""


def arm_solver(chain: Chain, height: float, family: Family, tolerance: float) -> Arm:
    """The solver that suits a chain.

    Parameters
    ----------
    chain : Chain
    height : float
        Of the arm's base frame over the floor [m].
    family : Family
        Kind of posture; arms that do not work in one plane have only one.
    tolerance : float
        [m]
    """
    if is_planar(chain):
        return PlaneSolver(planar_arm(chain), height, family, tolerance)
    return _serial_solver(chain, height, tolerance)


@dataclass(frozen=True, eq=False)
class PlaneSolver:
    """An arm in one vertical plane, solved there with its limits."""

    arm: PlanarArm
    height: float
    family: Family
    tolerance: float

    @cached_property
    def plane(self) -> kernels.PlaneArm:
        arm = self.arm
        shoulder = float(arm.shoulder[0]), float(arm.shoulder[1] + self.height)
        return kernels.PlaneArm(*shoulder, arm.lengths, arm.lower, arm.upper)

    @cached_property
    def postures(self) -> Array:
        """Ten postures to restart from, spread over the limits: elbow up and down, folded, stretched."""
        lower = np.where(np.isfinite(self.arm.lower), self.arm.lower, -np.pi)
        upper = np.where(np.isfinite(self.arm.upper), self.arm.upper, np.pi)
        spread: Array = lower + _SPREAD * (upper - lower)
        return spread

    def reach(
        self, target: Array, axis: Array, yaw: float, joints: Array, area: FlatPolygon, mobile: bool
    ) -> Reached:
        """Bring the tool to a target; see `Arm`."""
        bends, place = self.arm.bends(joints), np.array(axis)
        error, iterations, _, plane_yaw = fabrik.solve(
            self.plane, self.postures, area.vertices, area.starts, mobile, place,
            yaw + self.arm.pivot_zero + joints[0], bends, target,
            self.family.facing, self.family.pitch, self.tolerance, MOST_PASSES,
        )  # fmt: skip
        return Reached(place, self._joints(bends, plane_yaw - yaw, joints), float(error), int(iterations))

    def reach_many(
        self, targets: Array, axes: Array, yaws: Array, joints: Array, area: FlatPolygon
    ) -> list[Reached]:
        """Many targets in one compiled loop; see `Arm`."""
        bends, places = self.arm.bends(joints), np.array(axes)
        planes = yaws + self.arm.pivot_zero + joints[:, 0]
        errors, iterations = np.empty(len(targets)), np.empty(len(targets), dtype=np.int64)
        fabrik.solve_batch(
            self.plane, self.postures, area.vertices, area.starts, True, places, planes, bends, targets,
            self.family.facing, self.family.pitch, self.tolerance, MOST_PASSES, errors, iterations,
        )  # fmt: skip
        q = np.array(joints)
        q[:, 0] = planes - yaws - self.arm.pivot_zero
        q[:, 1:4] = self.arm.hinge_joints(bends, joints)
        rows = zip(places, q, errors.tolist(), iterations.tolist(), strict=True)
        return [Reached(*row) for row in rows]

    def least_change(self, target: Array, axis: Array, yaw: float, joints: Array) -> Reached | None:
        """The posture on target whose bends change least; see `Arm`."""
        bends = np.empty(3)
        r, plane_yaw = self._seen(target, axis)
        near = self.arm.bends(joints)
        change = kernels.nearest_posture(self.plane, self.family.pitch, r, target[2], near, bends, 180, 0.5)
        if not np.isfinite(change):
            return None
        return Reached(axis, self._joints(bends, plane_yaw - yaw, joints), 0.0, 0)

    def self_motion(self, target: Array, axis: Array, yaw: float, joints: Array, tries: int) -> list[Reached]:
        """Postures on target at ``tries`` pitches, the elbow either way; see `Arm`."""
        bends = np.empty((2 * tries, 3))
        r, plane_yaw = self._seen(target, axis)
        count = kernels.self_motion(self.plane, self.family.pitch, r, target[2], tries, bends)
        return [Reached(axis, self._joints(one, plane_yaw - yaw, joints), 0.0, 0) for one in bends[:count]]

    def _seen(self, target: Array, axis: Array) -> tuple[float, float]:
        """Target in the plane, and the plane's direction."""
        dx, dy = target[:2] - axis
        facing = self.family.facing
        return facing * float(np.hypot(dx, dy)), float(np.arctan2(facing * dy, facing * dx))

    def _joints(self, bends: Array, turn: float, near: Array) -> Array:
        q = np.array(near)
        q[0] = turn - self.arm.pivot_zero
        q[1:4] = self.arm.hinge_joints(bends, near)
        return q


_SPREAD = np.array(
    [
        (0.5, 0.5, 0.5), (0.3, 0.2, 0.5), (0.7, 0.8, 0.5), (0.3, 0.7, 0.3), (0.6, 0.2, 0.8),
        (0.8, 0.3, 0.2), (0.1, 0.5, 0.5), (0.5, 0.1, 0.1), (0.5, 0.9, 0.9), (0.9, 0.5, 0.7),
    ]
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class SerialSolver:
    """Any arm on a vertical pivot, solved by FABRIK-R with its limits; where that misses, by a walk."""

    chain: Chain
    bodies: Bodies
    starts: Array
    effort: Effort
    height: float

    def reach(
        self, target: Array, axis: Array, yaw: float, joints: Array, area: FlatPolygon, mobile: bool
    ) -> Reached:
        """Bring the tool to a target; see `Arm`."""
        q, place = np.array(joints), np.array(axis)
        if mobile:
            error, passes = roam(
                self.bodies, pivot_of(self.chain), self.starts, area.vertices, area.starts, place, yaw,
                self.height, target, self.effort, q,
            )  # fmt: skip
        else:
            error, _, passes, _, _ = solve(
                self.bodies, self._aim(target, axis, yaw), self.starts, self.effort, q
            )
        if error > self.effort.tolerance:
            point = seen(place, yaw, self.height, target)
            walked = posture_at(self.chain, point, q)
            off = float(np.linalg.norm(self.chain.forward(walked)[:3, 3] - point))
            if off < error:
                q, error = walked, off
        return Reached(place, q, float(error), int(passes))

    def reach_many(
        self, targets: Array, axes: Array, yaws: Array, joints: Array, area: FlatPolygon
    ) -> list[Reached]:
        """One after the other; see `Arm`."""
        rows = zip(targets, axes, yaws.tolist(), joints, strict=True)
        return [self.reach(*row, area, True) for row in rows]

    def least_change(self, target: Array, axis: Array, yaw: float, joints: Array) -> Reached | None:
        """The posture on target that damped least squares comes to; see `Arm`."""
        n = len(self.bodies.slide)
        q, effort = np.array(joints[:n]), self.effort
        aim = self._aim(target, axis, yaw)
        error, _, _ = polish(self.bodies.arm, aim, q, effort.reach, effort.tolerance, 1.0, MOST_STEPS)
        if error > effort.tolerance:
            return None
        return Reached(axis, np.concatenate([q, joints[n:]]), float(error), 0)

    def self_motion(self, target: Array, axis: Array, yaw: float, joints: Array, tries: int) -> list[Reached]:
        """Postures on target come to from ``tries`` starts; see `Arm`."""
        aim, n = self._aim(target, axis, yaw), len(self.bodies.slide)
        arm, none = self.bodies.arm, np.empty((0, n))
        low = np.where(np.isfinite(arm.lower), arm.lower, -np.pi)
        high = np.where(np.isfinite(arm.upper), arm.upper, np.pi)
        found: list[Reached] = []
        for start in np.random.default_rng(0).uniform(low, high, (tries, n)):
            q = np.concatenate([start, joints[n:]])
            error, _, passes, _, _ = solve(self.bodies, aim, none, self.effort, q)
            new = all(np.abs(q - other.joints).max() > ALIKE for other in found)
            if error <= self.effort.tolerance and new:
                found.append(Reached(axis, q, float(error), int(passes)))
        return found

    def _aim(self, target: Array, axis: Array, yaw: float) -> Aim:
        return Aim(seen(axis, yaw, self.height, target), POSITION, np.eye(3))


@lru_cache(maxsize=64)
def _serial_solver(chain: Chain, height: float, tolerance: float) -> SerialSolver:
    """Kept for the last few, as every set-point asks for it."""
    span_of(chain)
    joints = list(chain.joints)
    pivot = pivot_of(chain)
    joints[pivot] = replace(joints[pivot], lower=-np.inf, upper=np.inf)
    endless = Chain(tuple(joints), chain.T_last_tool)
    bodies = pointing_bodies(endless)
    effort = Effort(tolerance, 1.0, MOST_PASSES, span(bodies.arm), True)
    starts = spread_postures(endless, effort.reach, RESTARTS, 0)
    return SerialSolver(endless, bodies, np.ascontiguousarray(starts[:, : len(bodies.slide)]), effort, height)
