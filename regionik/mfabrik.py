"""M-FABRIK: base and arm configuration inside an admissible area.

Source: M-FABRIK (Santos et al., IEEE Access 2020), Algorithm 1, with joint limits held in both passes.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import EVERY
from regionik.areas.reach_model import ReachModel
from regionik.areas.reachable import reach_model
from regionik.areas.standing import Standing
from regionik.ladder import Ladder
from regionik.planners.geometry.polygons import FlatPolygon
from regionik.planners.solvers.base_placement import FACE_TARGET, FIXED, FREE, Turning, share_turn
from regionik.planners.solvers.mfabrik_planar import solve, solve_along, solve_many
from regionik.planners.solvers.planar_setup import Record
from regionik.postures.arm_solvers import ANGLE_SLACK, Arm, PlaneSolver
from regionik.postures.families import FRONT, Family
from regionik.postures.serial_solver import Reached
from regionik.postures.tool_goal import goal_of
from regionik.values import Configuration
from regionik.worlds.arms import pivot_index, pivot_joints, with_pivot
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.criteria import Criteria, with_joint_margin
from regionik.worlds.errors import InputError
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Heading, Target, World

NOWHERE = FlatPolygon(np.empty((0, 2)), np.zeros(1, dtype=np.int64))
HEADINGS: dict[Heading, int] = {"free": FREE, "face_target": FACE_TARGET, "fixed": FIXED}


@dataclass(frozen=True, eq=False)
class Solver:
    """A prepared M-FABRIK solver for one robot.

    Parameters
    ----------
    robot : Robot
    area : geometry or FlatPolygon, optional
        Admissible area of the arm axis; none leaves the whole floor free.
    tolerance : float
        [m]
    heading : {"free", "face_target", "fixed"}
    family : Family
        Posture family to solve in.
    span : (low, high)
        Headings of the base to stay within [rad].
    criteria : Criteria, optional
        What every posture must be good for.

    Examples
    --------
    >>> from regionik.worlds.bundled import robot_named
    >>> solver = Solver(robot_named("youbot"))
    >>> answer = solver([1.0, 0.2, 0.25], [0, 0, 0], [0, 1.6, -1, 0.5, 0])
    >>> answer.converged, answer.error <= 1e-3
    (True, True)
    """

    robot: Robot
    area: BaseGeometry | FlatPolygon | None = None
    tolerance: float = 1e-3
    heading: Heading = "free"
    family: Family = field(default_factory=lambda: Family(FRONT))
    span: tuple[float, float] = EVERY
    criteria: Criteria | None = None
    _model: ReachModel = field(init=False, repr=False)
    _arm: Arm = field(init=False, repr=False)
    _flat: FlatPolygon = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not 0 < self.tolerance < np.inf:
            raise InputError(f"solver: tolerance must be above 0, got {self.tolerance}")
        if self.heading not in HEADINGS:
            raise InputError(f"solver: heading must be one of {', '.join(HEADINGS)}, got {self.heading}")
        model, turns = reach_model(self._kept, "point"), not self._bound
        arm = model.solver(self.family, self.tolerance, turns=turns, criteria=self.criteria)
        object.__setattr__(self, "_model", model)
        object.__setattr__(self, "_arm", arm)
        object.__setattr__(self, "_flat", _flat(self.area))

    def __call__(self, target: Target | ArrayLike, base: ArrayLike, joints: ArrayLike) -> Configuration:
        """Move base and arm so that the tool reaches a target.

        Parameters
        ----------
        target : Target or (3,) array_like
            A bare point leaves the tool's direction free [m].
        base : (3,) array_like
            Where the base stands: x, y [m], yaw [rad].
        joints : (dof,) array_like
            Present joint values.

        Raises
        ------
        InputError
            For shapes that do not fit or numbers that are not finite.
        """
        return self._solve(target, base, joints, mobile=True)

    def hold(self, target: Target | ArrayLike, base: ArrayLike, joints: ArrayLike) -> Configuration:
        """As a call, but the arm axis stays where it is: only the arm and the heading move."""
        return self._solve(target, base, joints, mobile=False)

    def _solve(
        self, target: Target | ArrayLike, base: ArrayLike, joints: ArrayLike, *, mobile: bool
    ) -> Configuration:
        here, now = _numbers(base, 3, "base"), _numbers(joints, self.robot.chain.dof, "joints")
        directed = isinstance(target, Target) and target.direction is not None
        if self._setup is None or directed:
            return self._general(_asked(target), here, now, mobile=mobile)
        point = target.position if isinstance(target, Target) else target
        point = _numbers(point, 3, "target: position")
        area = self._flat
        error, passes, met = solve(self._setup, area.vertices, area.starts, mobile, point, here, now)
        return Configuration(here, now, error, passes, met)

    def least_change(self, target: Target | ArrayLike, base: Array, joints: Array) -> Configuration | None:
        """With the arm axis held, the posture on target that changes least, if there is one."""
        asked = _asked(target)
        axis, yaw = axis_of(self.robot, base), self._yaw(base)
        reached = self._arm_for(asked).least_change(asked, axis, yaw, self._behind(joints))
        found = None if reached is None else self._headed(reached, base, joints)
        return found if found is not None and found.converged else None

    def inside(self, area: BaseGeometry | FlatPolygon) -> Solver:
        """The same solver for another area; what does not depend on it is made once and shared."""
        other = copy(self)
        for name, value in (("area", area), ("_flat", _flat(area)), ("_setup", self._setup)):
            object.__setattr__(other, name, value)
        return other

    @property
    def compiled(self) -> bool:
        """Whether one compiled call solves for bare points."""
        return self._setup is not None

    def along(
        self, points: Array, places: Array, wished: Array, bend: float, base: Array, joints: Array
    ) -> tuple[Array, Array]:
        """Bases and joints on a way, as many as are found; see `solve_along`. Of a compiled solver."""
        assert self._setup is not None
        found: tuple[Array, Array] = solve_along(
            self._setup, points, places, wished, bend, np.array(base), np.array(joints)
        )
        return found

    def self_motion(
        self, target: Target | ArrayLike, base: Array, joints: Array, tries: int
    ) -> list[Configuration]:
        """With the arm axis held, postures on target of many kinds, the least changed first."""
        axis, asked = axis_of(self.robot, base), _asked(target)
        q = self._behind(joints)
        reached = self._arm_for(asked).self_motion(asked, axis, self._yaw(base), q, tries)
        found = [self._headed(one, base, joints) for one in reached]
        found.sort(key=lambda one: float(np.abs(one.joints - joints).max()))
        return [one for one in found if one.converged]

    def batch(self, targets: ArrayLike | Sequence[Target], bases: ArrayLike, joints: ArrayLike) -> Batch:
        """Solve for many targets at once.

        Parameters
        ----------
        targets : (n, 3) array_like or sequence of Target
        bases : (n, 3) array_like
        joints : (n, dof) array_like
        """
        if isinstance(targets, Sequence) and all(isinstance(target, Target) for target in targets):
            rows = [self(*row) for row in zip(targets, np.asarray(bases), np.asarray(joints), strict=True)]
            return _batch(rows, self.robot.chain.dof)
        points = frozen(np.asarray(targets), (None, 3), "targets")
        here = frozen(bases, (len(points), 3), "bases")
        now = frozen(joints, (len(points), self.robot.chain.dof), "joints")
        if self._setup is not None:
            area, new_bases, new_joints = (
                self._flat,
                here.copy(),
                now.copy(),
            )  # writable, as kernels take them
            errors, passes, met = solve_many(
                self._setup, area.vertices, area.starts, points.copy(), new_bases, new_joints
            )
            return Batch(new_bases, new_joints, errors, passes, met)
        axes, yaws = axis_of(self.robot, here), np.array([self._yaw(row) for row in here])
        reached = self._arm.reach_many(points, axes, yaws, self._behind(now), self._flat)
        rows = [self._headed(*row) for row in zip(reached, here, now, strict=True)]
        return _batch(rows, self.robot.chain.dof)

    @cached_property
    def _setup(self) -> Record | None:
        """What the compiled solver takes; None where the arm or what is asked of it is beyond that."""
        arm = self._arm
        if not isinstance(arm, PlaneSolver) or arm.asked or self._kept.chain is not self.robot.chain:
            return None
        return arm.setup(self.robot.mount, self._turning)

    @cached_property
    def _turning(self) -> Turning:
        chain = with_pivot(self._kept.chain)
        pivot = chain.joints[pivot_index(chain)]
        low, high = (float(end) for end in self.span)
        return Turning(float(pivot.lower), float(pivot.upper), HEADINGS[self.heading], low, high)

    def _general(self, target: Target, base: Array, joints: Array, *, mobile: bool) -> Configuration:
        """By the arm's own solver, for any arm and target."""
        axis = axis_of(self.robot, base)
        arm = self._arm_for(target)
        q = self._behind(joints)
        return self._headed(arm.reach(target, axis, self._yaw(base), q, self._flat, mobile), base, joints)

    def _arm_for(self, target: Target) -> Arm:
        """The arm as it meets the goal: as for a point, unless that takes another model of its reach."""
        model = reach_model(self._kept, goal_of(target))
        if model is self._model:
            return self._arm
        return model.solver(self.family, self.tolerance, turns=not self._bound)

    def _yaw(self, base: Array) -> float:
        """Heading of the arm's base frame."""
        yaw = self.span[0] if self._bound else base[2]
        return float(yaw + self.robot.mount[3])

    @property
    def _bound(self) -> bool:
        """Whether the base must keep one heading."""
        return self.heading != "fixed" and self.span[0] == self.span[1]

    @property
    def _kept(self) -> Robot:
        """The robot with the limits that its criteria leave."""
        return with_joint_margin(self.robot, self.criteria)

    def _behind(self, joints: Array) -> Array:
        chain = self._kept.chain
        if chain is not self.robot.chain:  # joints that do not matter stay as they are
            joints = np.clip(joints, chain.lower, chain.upper)
        return pivot_joints(chain, joints)

    def _headed(self, reached: Reached, base: Array, joints: Array) -> Configuration:
        """SetBaseOrientation of Algorithm 1: the pivot's turn shared between joint and base."""
        chain, joints = with_pivot(self._kept.chain), pivot_joints(self.robot.chain, joints)
        k = pivot_index(chain)
        q = np.array(reached.joints)
        plane = self._yaw(base) - float(self.robot.mount[3]) + float(q[k])  # as the arm was asked
        q[k], yaw, fits = share_turn(plane, float(base[2]), float(joints[k]), self._turning)
        pose = pose_of(self.robot, reached.axis, float(yaw))
        good = bool(
            reached.error <= self.tolerance and reached.angle <= ANGLE_SLACK and fits and reached.meets
        )
        return Configuration(
            pose, q[chain.dof - self.robot.chain.dof :], reached.error, reached.iterations, good
        )


@dataclass(frozen=True, eq=False)
class Batch:
    """Many configurations as arrays: base (n, 3), joints (n, dof), error, iterations, converged (n,)."""

    base: Array
    joints: Array
    error: Array
    iterations: NDArray[np.int64]
    converged: NDArray[np.bool_]


def _batch(rows: Sequence[Configuration], dof: int) -> Batch:
    return Batch(
        np.array([row.base for row in rows]).reshape(-1, 3),
        np.array([row.joints for row in rows]).reshape(-1, dof),
        np.array([row.error for row in rows]),
        np.array([row.iterations for row in rows], dtype=np.int64),
        np.array([row.converged for row in rows], dtype=bool),
    )


def _flat(area: BaseGeometry | FlatPolygon | None) -> FlatPolygon:
    if area is None:
        return NOWHERE
    return area if isinstance(area, FlatPolygon) else FlatPolygon.from_shapely(area)


def _asked(target: Target | ArrayLike) -> Target:
    return target if isinstance(target, Target) else Target(np.asarray(target, dtype=np.float64))


def _numbers(values: ArrayLike, count: int, what: str) -> Array:
    """Copy a few finite numbers, sooner than `frozen` does, which says what is wrong with others."""
    try:
        row = np.array(values, dtype=np.float64)
        if row.shape == (count,) and isfinite(sum(row.tolist())):
            return row
    except (TypeError, ValueError):
        pass
    return np.array(frozen(values, (count,), what))


def axis_of(robot: Robot, base: Array) -> Array:
    """Arm axis on the floor (..., 2) for base poses (..., 3)."""
    x, y = robot.mount[0], robot.mount[1]
    if x == 0.0 and y == 0.0:
        return np.array(base[..., :2])
    c, s = np.cos(base[..., 2]), np.sin(base[..., 2])
    spot: Array = base[..., :2] + np.stack([c * x - s * y, s * x + c * y], axis=-1)
    return spot


def pose_of(robot: Robot, axis: Array, yaw: float) -> Array:
    """Base pose (3,) that puts the arm axis on a spot with a heading."""
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = robot.mount[0], robot.mount[1]
    return np.array([axis[0] - (c * x - s * y), axis[1] - (s * x + c * y), yaw])


def configurations(
    world: World, ladder: Ladder, standing: Standing, chain: Sequence[int], start: tuple[Array, Array]
) -> tuple[Configuration, ...]:
    """One configuration for each set-point, the base kept within the chosen component.

    Parameters
    ----------
    world : World
    ladder : Ladder
    standing : Standing
    chain : sequence of int
        Component of each set-point.
    start : (base, joints)
        Where the robot stands at first.
    """
    base, joints = start
    found = []
    for target, k in zip(world.task, chain, strict=True):
        span = standing.sides[ladder.side[k]].span
        solver = solver_for(world, ladder.family[k], ladder.flat(k), span)
        found.append(solver(target if target.direction is not None else target.position, base, joints))
        base, joints = found[-1].base, found[-1].joints
    return tuple(found)


def solver_for(
    world: World,
    family: Family,
    area: BaseGeometry | FlatPolygon | None = None,
    span: tuple[float, float] = EVERY,
) -> Solver:
    """Solver for set-points under the world's rules."""
    solver = _solver_anywhere(world, family, span)
    return solver if area is None else solver.inside(area)


@lru_cache(maxsize=64)
def _solver_anywhere(world: World, family: Family, span: tuple[float, float]) -> Solver:
    rules = world.rules
    return Solver(world.robot, None, rules.tolerance, rules.heading, family, span, rules.criteria)


def solver_between(world: World, family: Family) -> Solver:
    """Solver for the way from one set-point to the next, of whose criteria the joint margin alone is kept.

    It is solved anew at its end, where the margin is asked.
    """
    rules, asked = world.rules, world.rules.criteria
    margin = None if asked is None else Criteria(joint_margin=asked.joint_margin)
    return Solver(world.robot, None, rules.tolerance, rules.heading, family, criteria=margin)
