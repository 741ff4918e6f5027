"""M-FABRIK: base and arm configuration inside an admissible area.

Source: M-FABRIK (Santos et al., IEEE Access 2020), Algorithm 1, with joint limits held in both passes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from regionik.plan import Configuration
from regionik.planners import fabrik, kernels
from regionik.planners.flat import FlatPolygon
from regionik.pruning import Ladder
from regionik.reachable import FRONT, Family
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.planar import PlanarArm, planar_arm
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Heading, World

MOST_PASSES = 100
NOWHERE = FlatPolygon(np.empty((0, 2)), np.zeros(1, dtype=np.int64))
HEADINGS = ("free", "face_target", "fixed")


@dataclass(frozen=True, eq=False)
class Solver:
    """A prepared M-FABRIK solver for one robot.

    Parameters
    ----------
    robot : Robot
    area : geometry, optional
        Admissible area of the arm axis; none leaves the whole floor free.
    tolerance : float
        [m]
    heading : {"free", "face_target", "fixed"}
    family : Family
        Posture family to solve in.

    Examples
    --------
    >>> from regionik.worlds.library import robot_named
    >>> solver = Solver(robot_named("youbot"))
    >>> answer = solver([1.0, 0.2, 0.25], [0, 0, 0], [0, 1.6, -1, 0.5, 0])
    >>> answer.converged, answer.error <= 1e-3
    (True, True)
    """

    robot: Robot
    area: BaseGeometry | None = None
    tolerance: float = 1e-3
    heading: Heading = "free"
    family: Family = field(default_factory=lambda: Family(FRONT))
    _arm: PlanarArm = field(init=False, repr=False)
    _plane: kernels.PlaneArm = field(init=False, repr=False)
    _flat: FlatPolygon = field(init=False, repr=False)
    _postures: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not 0 < self.tolerance < np.inf:
            raise InputError(f"solver: tolerance must be above 0, got {self.tolerance}")
        if self.heading not in HEADINGS:
            raise InputError(f"solver: heading must be one of {', '.join(HEADINGS)}, got {self.heading}")
        arm = planar_arm(self.robot.chain)
        object.__setattr__(self, "_arm", arm)
        shoulder = float(arm.shoulder[0]), float(arm.shoulder[1] + self.robot.mount[2])
        plane = kernels.PlaneArm(*shoulder, arm.lengths, arm.lower, arm.upper)
        object.__setattr__(self, "_plane", plane)
        flat = NOWHERE if self.area is None else FlatPolygon.from_shapely(self.area)
        object.__setattr__(self, "_flat", flat)
        object.__setattr__(self, "_postures", spread_postures(arm))

    def __call__(self, target: ArrayLike, base: ArrayLike, joints: ArrayLike) -> Configuration:
        """Move base and arm so that the tool reaches a target.

        Parameters
        ----------
        target : (3,) array_like
            [m]
        base : (3,) array_like
            Where the base stands: x, y [m], yaw [rad].
        joints : (dof,) array_like
            Present joint values.

        Raises
        ------
        InputError
            For shapes that do not fit or numbers that are not finite.
        """
        point = frozen(target, (3,), "target")
        here = frozen(base, (3,), "base")
        now = frozen(joints, (self.robot.chain.dof,), "joints")
        return self._solve(point, here, now, mobile=True)

    def hold(self, target: ArrayLike, base: ArrayLike, joints: ArrayLike) -> Configuration:
        """As a call, but the arm axis stays where it is: only the arm and the heading move."""
        return self._solve(
            np.asarray(target, dtype=np.float64), np.asarray(base), np.asarray(joints), mobile=False
        )

    def least_change(self, target: Array, base: Array, joints: Array) -> Configuration | None:
        """With the arm axis held, the posture on target whose bends change least, if there is one."""
        axis, _, near = self._planar(base, joints)
        arm = self._arm
        dx, dy = target[:2] - axis
        facing, bends = self.family.facing, np.empty(3)
        change = kernels.nearest_posture(
            self._plane, self.family.pitch,
            facing * np.hypot(dx, dy), target[2], near, bends, 180, 0.5,
        )  # fmt: skip
        q = np.array(joints)
        q[1:4] = arm.hinge_joints(bends, joints)
        yaw = np.arctan2(facing * dy, facing * dx)
        pose, q[0], fits = self._set_heading(axis, yaw, base, joints[0])
        return Configuration(pose, q, 0.0, 0, True) if fits and np.isfinite(change) else None

    def self_motion(self, target: Array, base: Array, joints: Array, tries: int) -> list[Configuration]:
        """With the arm axis held, postures on target at ``tries`` pitches, the least changed first."""
        axis, _, _ = self._planar(base, joints)
        dx, dy = target[:2] - axis
        facing, bends = self.family.facing, np.empty((2 * tries, 3))
        count = kernels.self_motion(
            self._plane, self.family.pitch, facing * np.hypot(dx, dy), target[2], tries, bends
        )
        q = np.tile(joints, (count, 1))
        q[:, 1:4] = self._arm.hinge_joints(bends[:count], joints)
        yaw = float(np.arctan2(facing * dy, facing * dx))
        pose, q[:, 0], fits = self._set_heading(axis, yaw, base, joints[0])
        order = np.argsort(np.abs(q - joints).max(axis=1), kind="stable")
        return [Configuration(pose, q[k], 0.0, 0, True) for k in order] if fits else []

    def batch(self, targets: ArrayLike, bases: ArrayLike, joints: ArrayLike) -> Batch:
        """Solve for many targets at once.

        Parameters
        ----------
        targets : (n, 3) array_like
        bases : (n, 3) array_like
        joints : (n, dof) array_like
        """
        points = frozen(targets, (None, 3), "targets")
        here = frozen(bases, (len(points), 3), "bases")
        now = frozen(joints, (len(points), self.robot.chain.dof), "joints")
        axes, yaws, bends = self._planar(here, now)
        errors, iterations = np.empty(len(points)), np.empty(len(points), dtype=np.int64)
        arm = self._arm
        fabrik.solve_batch(
            self._plane, self._postures,
            self._flat.vertices, self._flat.starts, True, axes, yaws, bends, points,
            self.family.facing, self.family.pitch, self.tolerance, MOST_PASSES, errors, iterations,
        )  # fmt: skip
        q = np.array(now)
        q[:, 1:4] = arm.hinge_joints(bends, now)
        base = np.empty((len(points), 3))
        fits = np.empty(len(points), dtype=bool)
        for k in range(len(points)):
            base[k], q[k, 0], fits[k] = self._set_heading(axes[k], yaws[k], here[k], now[k, 0])
        return Batch(base, q, errors, iterations, (errors <= self.tolerance) & fits)

    def _solve(self, target: Array, base: Array, joints: Array, *, mobile: bool) -> Configuration:
        axis, plane, bends = self._planar(base, joints)
        arm = self._arm
        error, iterations, _, yaw = fabrik.solve(
            self._plane, self._postures,
            self._flat.vertices, self._flat.starts, mobile, axis, float(plane), bends, target,
            self.family.facing, self.family.pitch, self.tolerance, MOST_PASSES,
        )  # fmt: skip
        q = np.array(joints)
        q[1:4] = arm.hinge_joints(bends, joints)
        pose, q[0], fits = self._set_heading(axis, yaw, base, joints[0])
        return Configuration(pose, q, float(error), int(iterations), bool(error <= self.tolerance and fits))

    @property
    def _zero(self) -> float:
        """Direction of the plane in the base frame at joint zero."""
        return float(self.robot.mount[3] + self._arm.pivot_zero)

    def _planar(self, base: Array, joints: Array) -> tuple[Array, Array, Array]:
        """Arm axis, direction of the plane and bends, of one pose or of many."""
        yaw = base[..., 2] + self._zero + joints[..., 0]
        return axis_of(self.robot, base), yaw, self._arm.bends(joints)

    def _set_heading(
        self, axis: Array, plane_yaw: float, base: Array, pivot: float
    ) -> tuple[Array, float, bool]:
        """SetBaseOrientation of Algorithm 1: base pose, first joint, and whether its limits hold."""
        lower, upper = self._arm.pivot_lower, self._arm.pivot_upper
        wanted = plane_yaw - self._zero
        if self.heading == "face_target":
            q = float(np.clip(0.0, lower, upper))
            yaw = base[2] + kernels.wrap(wanted - q - base[2])
            return pose_of(self.robot, axis, yaw), q, True
        if self.heading == "fixed":
            q, over = kernels.fit(wanted - base[2], lower, upper)
            return pose_of(self.robot, axis, base[2]), q, over == 0.0
        # free: the base turns only by what the first joint cannot take
        turned = pivot + kernels.wrap(wanted - base[2] - pivot)
        q = float(np.clip(turned, lower, upper))
        return pose_of(self.robot, axis, base[2] + turned - q), q, True


@dataclass(frozen=True, eq=False)
class Batch:
    """Many configurations as arrays: base (n, 3), joints (n, dof), error, iterations, converged (n,)."""

    base: Array
    joints: Array
    error: Array
    iterations: NDArray[np.int64]
    converged: NDArray[np.bool_]


def axis_of(robot: Robot, base: Array) -> Array:
    """Arm axis on the floor (..., 2) for base poses (..., 3)."""
    c, s = np.cos(base[..., 2]), np.sin(base[..., 2])
    x, y = robot.mount[0], robot.mount[1]
    spot: Array = base[..., :2] + np.stack([c * x - s * y, s * x + c * y], axis=-1)
    return spot


def pose_of(robot: Robot, axis: Array, yaw: float) -> Array:
    """Base pose (3,) that puts the arm axis on a spot with a heading."""
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = robot.mount[0], robot.mount[1]
    return np.array([axis[0] - (c * x - s * y), axis[1] - (s * x + c * y), yaw])


def spread_postures(arm: PlanarArm) -> Array:
    """Ten postures to restart from, spread over the limits: elbow up and down, folded, stretched."""
    lower = np.where(np.isfinite(arm.lower), arm.lower, -np.pi)
    upper = np.where(np.isfinite(arm.upper), arm.upper, np.pi)
    share = np.array(
        [
            (0.5, 0.5, 0.5), (0.3, 0.2, 0.5), (0.7, 0.8, 0.5), (0.3, 0.7, 0.3), (0.6, 0.2, 0.8),
            (0.8, 0.3, 0.2), (0.1, 0.5, 0.5), (0.5, 0.1, 0.1), (0.5, 0.9, 0.9), (0.9, 0.5, 0.7),
        ]
    )  # fmt: skip
    postures: Array = lower + share * (upper - lower)
    return postures


def configurations(
    world: World, ladder: Ladder, chain: Sequence[int], start: tuple[Array, Array]
) -> tuple[Configuration, ...]:
    """One configuration for each set-point, the base kept within the chosen component.

    Parameters
    ----------
    world : World
    ladder : Ladder
    chain : sequence of int
        Component of each set-point.
    start : (base, joints)
        Where the robot stands at first.
    """
    base, joints = start
    found = []
    for target, k in zip(world.task, chain, strict=True):
        solver = solver_for(world, ladder.family[k], ladder.component[k])
        found.append(solver(target.position, base, joints))
        base, joints = found[-1].base, found[-1].joints
    return tuple(found)


def solver_for(world: World, family: Family, area: BaseGeometry | None = None) -> Solver:
    """Solver under the world's rules."""
    return Solver(world.robot, area, world.rules.tolerance, world.rules.heading, family)
