"""M-FABRIK: configurations of base and arm, the arm axis inside admissible areas.

Source: M-FABRIK (Santos et al., IEEE Access 2020), Algorithm 1, with joint limits held in both passes. Its
loop is `mfabrik_planar.planar_passes` for an arm in one vertical plane and `mfabrik_serial.serial_passes` for
any other. Algorithm 2, the base's way between two configurations, is `driving.greedy_steps`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import EVERY
from regionik.areas.reach_model import ReachModel
from regionik.areas.reachable import reach_model
from regionik.planners.geometry.polygons import FlatPolygon
from regionik.planners.solvers.base_placement import FACE_TARGET, FIXED, FREE, BaseArea, Turning, share_turn
from regionik.planners.solvers.mfabrik_planar import (
    PlanarSetup,
    solve_planar,
    solve_planar_along,
    solve_planar_many,
)
from regionik.postures.arm import ANGLE_SLACK, UNTOLD, Arm, ArmSolution, goal_of
from regionik.postures.families import FRONT, Family
from regionik.postures.planar_solver import PlanarSolver
from regionik.postures.poses import axis_of, pose_of
from regionik.scene import Scene
from regionik.values import Batch, Configuration
from regionik.worlds.arms import pivot_index, pivot_joints, with_pivot
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Criteria
from regionik.worlds.robot import Robot, with_joint_margin
from regionik.worlds.scene import Heading, Target

NOWHERE = FlatPolygon(np.empty((0, 2)), np.zeros(1, dtype=np.int64))
MAX_CONTINUED_CHANGE = np.pi / 2  # a joint that changes by more is not led on from where it was [rad]
HEADINGS: dict[Heading, int] = {"free": FREE, "face_target": FACE_TARGET, "fixed": FIXED}


class Method(Protocol):
    """A method that solves a target by base and arm."""

    def __call__(self, target: Target, base: Array, joints: Array, /) -> Configuration:
        """Solve a target from a base pose (3,) and joints (dof,); where it is not met, come near."""


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
        Thresholds that every posture must meet.

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
        model, turns = reach_model(self._limited_robot, "point"), self._turns
        arm = model.solver(self.family, self.tolerance, turns=turns, criteria=self.criteria)
        object.__setattr__(self, "_model", model)
        object.__setattr__(self, "_arm", arm)
        object.__setattr__(self, "_flat", flat_area(self.area))

    def __call__(self, target: Target | ArrayLike, base: ArrayLike, joints: ArrayLike) -> Configuration:
        """Move base and arm so that the tool reaches a target.

        Parameters
        ----------
        target : Target or (3,) array_like
            A bare point leaves the tool's direction free [m].
        base : (3,) array_like
            Where the base stands: x, y [m], yaw [rad].
        joints : (dof,) array_like
            Present joint values; those beyond a limit count as at it.

        Raises
        ------
        InputError
            For shapes that do not fit or numbers that are not finite.
        """
        return self._solve(target, base, joints, mobile=True)

    def hold(self, target: Target | ArrayLike, base: ArrayLike, joints: ArrayLike) -> Configuration:
        """Return the same with the arm axis held: only the arm and the heading move."""
        return self._solve(target, base, joints, mobile=False)

    def history(self, target: Target | ArrayLike, base: ArrayLike, joints: ArrayLike) -> Array:
        """Return how a solve went: the tool's distance from a target at the start and after each iteration.

        That of each pass, or step of polishing, itself, not the least so far; a restart begins anew. Points
        alone have one.

        Returns
        -------
        (iterations + 1,) array
            [m]

        Raises
        ------
        InputError
            As for a call, and for a target that asks for more than a point.
        """
        asked = as_target(target)
        if asked.direction is not None:
            raise InputError("history: expected a point alone, got a target with a direction")
        first = finite_numbers(base, 3, "base"), finite_numbers(joints, self.robot.chain.dof, "joints")
        history = np.empty(self(asked, *first).iterations)
        self._solve(asked, *first, mobile=True, history=history)
        start = self.robot.tool(first[0], self._within(first[1]))[:3, 3] - asked.position
        return np.array([np.linalg.norm(start), *history])

    def _solve(
        self,
        target: Target | ArrayLike,
        base: ArrayLike,
        joints: ArrayLike,
        *,
        mobile: bool,
        history: Array = UNTOLD,
    ) -> Configuration:
        here, now = (
            finite_numbers(base, 3, "base"),
            self._within(finite_numbers(joints, self.robot.chain.dof, "joints")),
        )
        directed = isinstance(target, Target) and target.direction is not None
        if self._setup is None or directed:
            return self._general(as_target(target), here, now, mobile=mobile, history=history)
        point = target.position if isinstance(target, Target) else target
        point = finite_numbers(point, 3, "target: position")
        area = BaseArea(self._flat.vertices, self._flat.starts, mobile)
        error, passes, met = solve_planar(self._setup, area, point, here, now, history)
        return Configuration(here, now, error, passes, met)

    def least_change(self, target: Target | ArrayLike, base: Array, joints: Array) -> Configuration | None:
        """Return the posture on target that changes least, the arm axis held, if there is one."""
        asked = as_target(target)
        axis, yaw = axis_of(self.robot, base), self._yaw(base)
        solution = self._arm_for(asked).least_change(asked, axis, yaw, self._behind(joints))
        found = None if solution is None else self._headed(solution, base, joints)
        return found if found is not None and found.converged else None

    def inside(self, area: BaseGeometry | FlatPolygon) -> Solver:
        """Return this solver for another area; what does not depend on the area is shared."""
        other = copy(self)
        for name, value in (("area", area), ("_flat", flat_area(area)), ("_setup", self._setup)):
            object.__setattr__(other, name, value)
        return other

    @property
    def compiled(self) -> bool:
        """True where one compiled call solves for bare points."""
        return self._setup is not None

    def along(
        self, points: Array, places: Array, wished: Array, bend: float, base: Array, joints: Array
    ) -> tuple[Array, Array]:
        """Bases and joints along a path, up to the first not found; see `solve_planar_along`.

        Only for a `compiled` solver.
        """
        assert self._setup is not None
        base, joints = np.array(base), np.array(joints)
        found: tuple[Array, Array]
        found = solve_planar_along(self._setup, points, places, wished, bend, base, joints)
        return found

    def self_motion(
        self, target: Target | ArrayLike, base: Array, joints: Array, tries: int
    ) -> list[Configuration]:
        """Return postures on target of many kinds, the arm axis held, the least changed first.

        Those that stand at a limit come last.
        """
        axis, asked = axis_of(self.robot, base), as_target(target)
        q = self._behind(joints)
        solution = self._arm_for(asked).self_motion(asked, axis, self._yaw(base), q, tries)
        found = [self._headed(one, base, joints) for one in solution]
        found.sort(key=lambda one: (self._at_limits(one.joints), float(np.abs(one.joints - joints).max())))
        return [one for one in found if one.converged]

    def batch(self, targets: ArrayLike | Sequence[Target], bases: ArrayLike, joints: ArrayLike) -> Batch:
        """Solve for many targets at once.

        Parameters
        ----------
        targets : (n, 3) array_like or sequence of Target
        bases : (n, 3) array_like
        joints : (n, dof) array_like
        """
        dof = self.robot.chain.dof
        if isinstance(targets, Sequence) and all(isinstance(target, Target) for target in targets):
            rows = [self(*row) for row in zip(targets, np.asarray(bases), np.asarray(joints), strict=True)]
            return Batch.of(rows, dof)
        points = frozen(np.asarray(targets), (None, 3), "targets").copy()  # writable, as kernels take them
        here = frozen(bases, (len(points), 3), "bases").copy()
        now = self._within(frozen(joints, (len(points), dof), "joints"))
        if self._setup is None:
            return Batch.of([self(*row) for row in zip(points, here, now, strict=True)], dof)
        area = BaseArea(self._flat.vertices, self._flat.starts, mobile=True)
        errors, passes, met = solve_planar_many(self._setup, area, points, here, now)
        return Batch(here, now, errors, passes, met)

    @cached_property
    def _setup(self) -> PlanarSetup | None:
        """Setup of the compiled solver; None where arm or criteria are beyond it."""
        arm = self._arm
        if (
            not isinstance(arm, PlanarSolver)
            or arm.thresholds
            or self._limited_robot.chain is not self.robot.chain
        ):
            return None
        return arm.setup(self.robot.mount, self._turning)

    @cached_property
    def _turning(self) -> Turning:
        chain = with_pivot(self._limited_robot.chain)
        pivot = chain.active_joints[pivot_index(chain)]
        low, high = (float(end) for end in self.span)
        return Turning(float(pivot.lower), float(pivot.upper), HEADINGS[self.heading], low, high)

    def _general(
        self, target: Target, base: Array, joints: Array, *, mobile: bool, history: Array = UNTOLD
    ) -> Configuration:
        """Solve by the arm's own solver, for any arm and target."""
        axis, q = axis_of(self.robot, base), self._behind(joints)
        solution = self._arm_for(target).reach(target, axis, self._yaw(base), q, self._flat, mobile, history)
        return self._headed(solution, base, joints)

    def _arm_for(self, target: Target) -> Arm:
        """Solver of the arm for a goal: that of a point, unless the goal takes another model of reach."""
        model = reach_model(self._limited_robot, goal_of(target))
        if model is self._model:
            return self._arm
        return model.solver(self.family, self.tolerance, turns=self._turns, criteria=self.criteria)

    def _yaw(self, base: Array) -> float:
        yaw = self.span[0] if self._bound else base[2]
        return float(yaw + self.robot.mount[3])

    @property
    def _bound(self) -> bool:
        """True where the base must take one heading, whichever it has."""
        return self.span[0] == self.span[1]

    @property
    def _turns(self) -> bool:
        """True where the base turns for the arm."""
        return self.heading != "fixed" and not self._bound

    @cached_property
    def _limited_robot(self) -> Robot:
        """The robot with the limits that its criteria leave."""
        return with_joint_margin(self.robot, self.criteria)

    @cached_property
    def _limits(self) -> tuple[Array, Array]:
        """Lowest and highest values of its joints (dof,)."""
        return self._limited_robot.chain.lower, self._limited_robot.chain.upper

    def _within(self, joints: Array) -> Array:
        """Postures (..., dof), what is beyond a limit put at it: one on target is taken as it is."""
        lower, upper = self._limits
        within: Array = np.minimum(np.maximum(joints, lower), upper)  # faster than `clip` of a few numbers
        return within

    def _behind(self, joints: Array) -> Array:
        """Joints of the chain from its pivot on, within the limits that are kept."""
        return pivot_joints(self._limited_robot.chain, self._within(joints))

    def _at_limits(self, joints: Array) -> bool:
        """True where a joint stands at one of its limits, or nearly so."""
        chain = self._limited_robot.chain
        return bool((np.minimum(joints - chain.lower, chain.upper - joints) < chain.spare).any())

    def _headed(self, solution: ArmSolution, base: Array, joints: Array) -> Configuration:
        """SetBaseOrientation of Algorithm 1: the pivot's turn shared between joint and base.

        Of joints that turn more than once those that are not led on take the turn nearest to their middle.
        """
        chain, joints = with_pivot(self._limited_robot.chain), pivot_joints(self.robot.chain, joints)
        k = pivot_index(chain)
        q = np.array(solution.joints)
        plane = self._yaw(base) - float(self.robot.mount[3]) + float(q[k])  # as the arm was asked
        q[k], yaw, fits = share_turn(plane, float(base[2]), float(joints[k]), self._turning)
        pose = pose_of(self.robot, solution.axis, float(yaw))
        good = solution.error <= self.tolerance and solution.angle <= ANGLE_SLACK and fits and solution.meets
        wound = chain.winding & (np.abs(q - joints) > MAX_CONTINUED_CHANGE) & (np.arange(chain.dof) != k)
        q = np.where(wound, chain.unwound(q), q) if wound.any() else q
        q = q[chain.dof - self.robot.chain.dof :]
        return Configuration(pose, q, solution.error, solution.iterations, bool(good))


def flat_area(area: BaseGeometry | FlatPolygon | None) -> FlatPolygon:
    if area is None:
        return NOWHERE
    return area if isinstance(area, FlatPolygon) else FlatPolygon.from_shapely(area)


def as_target(target: Target | ArrayLike) -> Target:
    return target if isinstance(target, Target) else Target(np.asarray(target, dtype=np.float64))


def finite_numbers(values: ArrayLike, count: int, what: str) -> Array:
    """Return a few finite numbers as a new array; faster than `frozen`, which words the errors."""
    try:
        row = np.array(values, dtype=np.float64)
        if row.shape == (count,) and isfinite(sum(row.tolist())):
            return row
    except (TypeError, ValueError):
        pass
    return np.array(frozen(values, (count,), what))


def configurations(
    task: Iterable[Target],
    solvers: Iterable[Method],
    start: tuple[Array, Array],
) -> tuple[Configuration, ...]:
    """One configuration for each set-point, each solved from the one before, the first from base and joints.

    Of the solvers each set-point has its own, such as a `Solver` for the area that is chosen there.
    """
    base, joints = start
    found: list[Configuration] = []
    for target, solver in zip(task, solvers, strict=True):
        found.append(solver(target, base, joints))
        base, joints = found[-1].base, found[-1].joints
    return tuple(found)


def solver_for(
    scene: Scene,
    family: Family,
    area: BaseGeometry | FlatPolygon | None = None,
    span: tuple[float, float] = EVERY,
) -> Solver:
    """Solver for set-points under the world's rules."""
    solver = scene.once(_solver_anywhere, family, span)
    return solver if area is None else solver.inside(area)


def _solver_anywhere(scene: Scene, family: Family, span: tuple[float, float]) -> Solver:
    rules = scene.rules
    return Solver(scene.robot, None, rules.tolerance, rules.heading, family, span, rules.criteria)


def solver_between(scene: Scene, family: Family) -> Solver:
    """Solver for the way between set-points, where of the criteria the joint margin alone is kept."""
    rules, asked = scene.rules, scene.rules.criteria
    margin = None if asked is None else Criteria(joint_margin=asked.joint_margin)
    return Solver(scene.robot, None, rules.tolerance, rules.heading, family, criteria=margin)
