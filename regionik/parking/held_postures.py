"""Postures along set-points while the base stands still, of arms whose posture no place gives.

A place gives an arm in one plane its posture. Any other arm may be carried along the set-points from each of
its postures at the first, and the heading of the base is one that leaves its pivot within limits at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regionik.areas.standing import into_span
from regionik.mfabrik import Solver
from regionik.moving.base_motion import arm_states
from regionik.moving.transit import lifted
from regionik.planners.solvers.damped_least_squares import Aims, polish_along
from regionik.planners.solvers.redundancy_resolution import PathSolving, resolve_redundancy
from regionik.planners.solvers.serial_chain import serial_arm
from regionik.postures.arm_guard import Guard
from regionik.postures.poses import Pose, axis_of, pose_of
from regionik.postures.serial_solver import MOST_STEPS, SerialSolver, serial_solver
from regionik.worlds.arms import pivot_index, pivot_joints
from regionik.worlds.arrays import Array, Index
from regionik.worlds.criteria import with_joint_margin
from regionik.worlds.scene import Target, World

STARTS = 24  # postures at the first set-point that are looked for
MORE_STARTS = 192  # where redundancy is resolved along the set-points
LONGEST_TURN, LONGEST_SLIDE = 0.1, 0.02  # of a joint from one target to the next there [rad], [m]
TRIES = 96  # at others, where the one that is led there does not do
ENOUGH = 3  # of those that serve every set-point, so many are compared
RIM = np.arange(8) * np.pi / 4  # directions in which a circle to park in is tried [rad]
RIM_STEPS = 4  # on the way out to its rim, each posture the start of the next


@dataclass(frozen=True, eq=False)
class HeldPostures:
    """Postures at set-points in a row from one pose of the base.

    Attributes
    ----------
    base : (3,) array
    served : tuple of int
        Indices of the k set-points among those asked for: the first k, or any where their order is free.
    joints : (k, dof) array
    spare : float
        Least distance of a joint to a limit, as a share of its range.
    """

    base: Array
    served: tuple[int, ...]
    joints: Array
    spare: float


@dataclass(frozen=True, eq=False)
class PostureCarrier:
    """The robot of a world, carried along set-points.

    Attributes
    ----------
    world : World
    guard : Guard
    targets : sequence of Target
    """

    world: World
    guard: Guard
    targets: Sequence[Target]

    def best(
        self, solver: Solver, axis: Array, span: tuple[float, float], known: Array
    ) -> HeldPostures | None:
        """Postures that serve most set-points from a place of the arm axis, and among those have most spare.

        Parameters
        ----------
        solver : Solver
            At any heading, for postures at the first set-point.
        axis : (2,) array
            [m]
        span : (low, high)
            Headings of the base [rad].
        known : (m, dof) array
            Postures elsewhere: those that are led from them are taken where they serve all.
        """
        base, robot = pose_of(self.world.robot, axis, into_span(0.0, span)), self.world.robot
        best: HeldPostures | None = None
        full = 0
        alike = (solver.least_change(self.targets[0], base, joints) for joints in known)
        others = solver.self_motion(self.targets[0], base, robot.carry, STARTS)
        if self.world.rules.order == "any":
            others.sort(key=lambda one: not self.folds(one.base, one.joints))
        for n, start in enumerate(chain(alike, others)):
            found = None if start is None else self._from(start.base, start.joints, axis, span)
            if found is None or (best is not None and len(found.joints) < len(best.joints)):
                continue
            if best is None or (len(found.joints), found.spare) > (len(best.joints), best.spare):
                best = found
            full += len(found.joints) == len(self.targets)
            if full == ENOUGH or (full and n < len(known)):
                break
        if best is None or self.world.rules.order == "given":
            return best
        branched = self.at(best.base, best.joints)
        return best if branched is None else branched

    def resolved(self, base: Array, most: int) -> Array:
        """Clear postures (k, dof) at the first k targets in a row, `most` of them carried on at once.

        From one target to the next joints change by `LONGEST_TURN` or `LONGEST_SLIDE` at the most.
        """
        axis, robot, solver = axis_of(self.world.robot, base), self.world.robot, self._bound
        yaw, more = float(base[2] + robot.mount[3]), solver.chain.dof - robot.chain.dof
        near = pivot_joints(robot.chain, robot.carry)
        starts = solver.self_motion(self.targets[0], axis, yaw, near, MORE_STARTS)
        if not starts:
            return np.empty((0, robot.chain.dof))
        turns = [joint.kind == "revolute" for joint in solver.chain.joints]
        longest = np.where(turns, LONGEST_TURN, LONGEST_SLIDE)
        effort = solver.effort
        found = resolve_redundancy(
            serial_arm(solver.endless),
            self._aims(axis, yaw, slice(None)),
            np.array([one.joints for one in starts]),
            PathSolving(effort.reach, effort.tolerance, longest, most),
            lambda here, there: self._goes(base, here[more:], there[more:]),
        )
        return found[:, more:]

    def _goes(self, base: Array, here: Array, there: Array) -> bool:
        """True if the straight motion between two postures is proven clear."""
        if not self.guard.proves(Pose(base, there)):
            return False
        return self.guard.stop([Pose(base, here), Pose(base, there)]) is None

    def at(self, base: Array, rows: Array) -> HeldPostures | None:
        """Postures from a pose of the base at all set-points that have a clear one; None where none has.

        In any order the tool may be lifted between two set-points, so the arm need not stay in one branch,
        and what is not served from here is from elsewhere.

        Parameters
        ----------
        base : (3,) array
        rows : (k, dof) array
            Postures that are known at the first set-points.
        """
        served, found = list[int](), list[Array]()
        near = rows[0] if len(rows) else self.world.robot.carry
        for i in range(len(self.targets)):
            known = rows[i] if i < len(rows) else self._onward(i, base, near)
            joints = self._posture(i, base, known, near)
            if joints is not None:
                served.append(i)
                found.append(joints)
                near = joints
        if not served:
            return None
        return HeldPostures(base, tuple(served), np.array(found), self._spare(np.array(found)))

    def _posture(self, i: int, base: Array, known: Array | None, near: Array) -> Array | None:
        """A clear posture at set-point i, the known one if it folds, else the nearest to another that does.

        Where none folds the first is taken; None where none is clear.
        """
        if known is not None and not self.keeps(i, base, known):
            known = None
        if known is not None and self.folds(base, known):
            return known
        chain, axis = self.world.robot.chain, axis_of(self.world.robot, base)
        yaw, behind = float(base[2] + self.world.robot.mount[3]), pivot_joints(chain, near)
        tries = self._bound.self_motion(self.targets[i], axis, yaw, behind, TRIES)
        others = np.array([one.joints[-chain.dof :] for one in tries]).reshape(-1, chain.dof)
        nearest = others[np.argsort(np.abs(others - near).max(axis=1), kind="stable")]
        clear = [joints for joints in nearest if self.guard.proves(Pose(base, joints))]
        folding = (joints for joints in clear if self.folds(base, joints) and self.keeps(i, base, joints))
        found = next(folding, known)
        return found if found is not None else next((q for q in clear if self.keeps(i, base, q)), None)

    def folds(self, base: Array, joints: Array) -> bool:
        """True if the arm gets straight to the posture in which it is carried, the pivot left as it is.

        The arm can go from each such posture to every other.
        """
        pose = Pose(base, joints)
        folded = lifted(self.world.robot, pose)
        return self.guard.passes([pose, *arm_states(pose, folded), folded])

    def _onward(self, i: int, base: Array, joints: Array) -> Array | None:
        """Posture at set-point i that one elsewhere is led to; None where it is not."""
        axis, near = axis_of(self.world.robot, base), pivot_joints(self.world.robot.chain, joints)
        found = self._bound.least_change(
            self.targets[i], axis, float(base[2] + self.world.robot.mount[3]), near
        )
        return None if found is None else found.joints[-len(joints) :]

    def keeps(self, i: int, base: Array, joints: Array) -> bool:
        """True if a posture at set-point i is clear, and kept all round the circle that the rules ask for."""
        wanted = self.world.rules.stop_tolerance
        if not self.guard.proves(Pose(base, joints)):
            return False
        return wanted == 0.0 or self.reaches_rim(i, base, joints, wanted)

    def _from(
        self, base: Array, joints: Array, axis: Array, span: tuple[float, float]
    ) -> HeldPostures | None:
        """Carry one posture along: the pivot left free to choose a heading, then at that heading."""
        heading = float(base[2])
        if not self._still:
            free = self._carried(self._free, axis, heading, joints)
            heading = into_span(self._heading(heading, free), span)
            joints = joints.copy()
            joints[self._pivot] += base[2] - heading
        elif into_span(heading, span) != heading:
            return None
        held = self._carried(self._bound, axis, heading, joints)
        pose = pose_of(self.world.robot, axis, heading)
        if not len(held):
            return None
        count = next((i for i, q in enumerate(held) if not self.guard.proves(Pose(pose, q))), len(held))
        if count == 0:  # the motion may lead it round what it touches
            return HeldPostures(pose, (0,), held[:1], -np.inf)
        return HeldPostures(pose, tuple(range(count)), held[:count], self._spare(held[:count]))

    def reaches_rim(self, i: int, base: Array, joints: Array, radius: float) -> bool:
        """True where a posture at set-point i can be kept on it while the base goes out to a rim, any way.

        Parameters
        ----------
        i : int
            Index of the set-point among the carrier's.
        base : (3,) array
        joints : (dof,) array
        radius : float
            [m]
        """
        axis, some = axis_of(self.world.robot, base), np.full(RIM_STEPS, i)
        shares = radius * np.arange(1, RIM_STEPS + 1)[:, None] / RIM_STEPS
        for angle in RIM:
            places = axis + shares * (np.cos(angle), np.sin(angle))
            found = self._carried(self._bound, places, float(base[2]), joints, some)
            if len(found) < RIM_STEPS:
                return False
        return True

    def _carried(
        self, solver: SerialSolver, axis: Array, heading: float, joints: Array, some: Index | None = None
    ) -> Array:
        """Postures (k, dof) at the first k of some set-points, the base at one place or at one for each."""
        aims = self._aims(
            axis, heading + float(self.world.robot.mount[3]), slice(None) if some is None else some
        )
        more, arm, effort = solver.chain.dof - len(joints), serial_arm(solver.endless), solver.effort
        rows = np.zeros((len(aims.positions), solver.chain.dof))
        rows[0, more:] = joints
        rows[0] = np.clip(rows[0], arm.lower, arm.upper)
        count = polish_along(arm, aims, effort.reach, effort.tolerance, MOST_STEPS, rows)
        return rows[:count, more:]

    def _heading(self, heading: float, free: Array) -> float:
        """Heading that leaves the pivot as near as may be to the middle of its limits."""
        pivot = self._bound.chain.joints[pivot_index(self._bound.chain)]
        if not np.isfinite(pivot.upper - pivot.lower) or not len(free):
            return heading
        some = free[:, self._pivot]
        return float(heading + (some.max() + some.min() - pivot.lower - pivot.upper) / 2)

    def _aims(self, axis: Array, yaw: float, some: Index | slice) -> Aims:
        """Set-points as an arm sees them whose base frame stands at a place with a heading."""
        c, s = np.cos(yaw), np.sin(yaw)
        back = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        positions, kinds, turns, cones, angles = (column[some] for column in self._goals)
        seen = positions - (0.0, 0.0, self.world.robot.mount[2])
        seen[:, :2] -= axis
        return Aims(seen @ back.T, kinds, back @ turns, cones, angles)

    @cached_property
    def _goals(self) -> tuple[NDArray[Any], ...]:
        goals = [self._free.goal_for(target) for target in self.targets]
        return (
            np.array([goal.aim.position for goal in goals]),
            np.array([goal.aim.kind for goal in goals]),
            np.array([goal.aim.turn for goal in goals]),
            np.array([goal.aim.cone for goal in goals]),
            np.array([goal.effort.angle_tolerance for goal in goals]),
        )

    @cached_property
    def _free(self) -> SerialSolver:
        return self._arm(turns=True)

    @cached_property
    def _bound(self) -> SerialSolver:
        return self._arm(turns=False)

    def _arm(self, *, turns: bool) -> SerialSolver:
        """Solver with a pivot that has no limits, or its own."""
        rules, robot = self.world.rules, with_joint_margin(self.world.robot, self.world.rules.criteria)
        return serial_solver(robot.chain, float(robot.mount[2]), rules.tolerance, turns=turns)

    @property
    def _still(self) -> bool:
        """True where the base turns in place of a pivot."""
        return self._bound.chain.dof > self.world.robot.chain.dof

    @property
    def _pivot(self) -> int:
        return pivot_index(self._bound.chain)

    def _spare(self, joints: Array) -> float:
        """Least distance of a joint to its limits, as a share of its range."""
        lower, upper = self.world.robot.chain.lower, self.world.robot.chain.upper
        if not len(joints):
            return 0.0
        with np.errstate(invalid="ignore"):
            share = np.minimum(joints - lower, upper - joints) / (upper - lower)
        return float(np.where(np.isnan(share), 0.5, share).min())
