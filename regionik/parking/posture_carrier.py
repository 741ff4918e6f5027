"""Postures along set-points on a fixed base, for arms whose posture the base place does not determine.

The base place determines the posture of an arm in one plane. Any other arm can be moved along the set-points
from each of its postures at the first, with a base heading that keeps its pivot within limits at all of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from regionik.areas.free_space import into_span
from regionik.mfabrik import Solver
from regionik.parking.options import PARKING
from regionik.planners.geometry.offsets import radius_that_holds
from regionik.planners.reach.serial_criteria import carried_along
from regionik.planners.solvers.serial_chain import serial_arm
from regionik.postures.arm_roadmap import (
    ArmRoadmap,
    FixedBasePostures,
    arm_path,
    goes,
    grown_roadmap,
    rooted_roadmap,
)
from regionik.postures.options import POSTURES
from regionik.postures.poses import Pose, axis_of, pose_of
from regionik.postures.posture_search import PostureSearch
from regionik.postures.serial_solver import SerialSolver
from regionik.worlds.arms import pivot_index
from regionik.worlds.arrays import Array, Index

OPTIONS = PARKING.carrier


@dataclass(frozen=True, eq=False)
class PostureCarrier(PostureSearch):
    """Postures of a robot along set-points, each continued from the one before."""

    def best(self, solver: Solver, axis: Array, span: tuple[float, float]) -> FixedBasePostures | None:
        """Return the postures that serve most set-points from a place (2,), and of these have most spare.

        The base has a heading within ``span``. The solver finds postures at the first set-point at any one.
        """
        base, robot = pose_of(self.world.robot, axis, into_span(0.0, span)), self.world.robot
        best: FixedBasePostures | None = None
        full = 0
        for start in solver.self_motion(self.targets[0], base, robot.carry, OPTIONS.max_starts):
            found = self._from(start.base, start.joints, axis, span)
            if found is None or (best is not None and len(found.joints) < len(best.joints)):
                continue
            if best is None or (len(found.joints), found.spare) > (len(best.joints), best.spare):
                best = found
            full += len(found.joints) == len(self.targets)
            if full == OPTIONS.max_compared:
                break
        if best is None or self.world.rules.order == "given":
            return best
        every = np.arange(len(self.targets))
        branched = self.at(best.base, every)
        if branched is None or branched.roadmap is None:
            branched = self.clear_postures(best.base, every[: len(best.joints)], best.joints)
        return best if branched is None else branched

    def continued_from(self, pose: Pose) -> Array:
        """Return postures (k, dof) at the first k targets, continued from that of a pose."""
        return self._carried(
            self._bound, axis_of(self.world.robot, pose.base), float(pose.base[2]), pose.joints
        )

    def at(self, base: Array, some: Index) -> FixedBasePostures | None:
        """Return postures from a base pose at all those of some set-points that have a clear one.

        In any order the tool may be lifted between two set-points, and what is not served from here is from
        elsewhere. None where none is found. Where none can be joined to the carry posture, others are taken.
        """
        found, joints = self.neighboring(base, some)
        held = self.joined(base, found, joints)
        return held if held is not None else self.clear_postures(base, found, joints)

    def joined(self, base: Array, some: Index, joints: Array) -> FixedBasePostures | None:
        """Those of some set-points with clear postures (n, dof) that a roadmap joins, kept all round.

        Where it does not join one by the few that lie between, postures of the roadmap are led on to its
        set-point; where none goes there straight, RRTConnect looks for a way.
        """
        travel = self._travel
        off = np.abs(joints[:, None] - travel.joints[None]).max(axis=2)
        between = travel.joints[travel.up_from(np.argmin(off, axis=1))][1:]
        nodes = np.vstack([between, joints])
        roadmap, grown = grown_roadmap(self.collision, rooted_roadmap(base, self.root), nodes)
        held = np.isin(np.arange(len(joints)) + len(between), grown)
        left = np.flatnonzero(~held) if self.collision.proves(Pose(base, self.root)) else ()
        most, joints = POSTURES.roadmap.max_iterations, joints.copy()
        for n in left:
            path = self._continued_to(roadmap, int(some[n]), joints[n])
            if path is None:
                path = arm_path(self.collision, base, roadmap.nearest(joints[n]), joints[n], 0, most)
            if path is not None:
                roadmap, held[n], joints[n] = roadmap.with_path(path), True, path[-1]
        found = self.clear_postures(base, some[held], joints[held])
        return None if found is None else replace(found, roadmap=roadmap)

    def _continued_to(self, roadmap: ArmRoadmap, i: int, joints: Array) -> Array | None:
        """A straight motion (2, dof) to a posture at set-point i that one of a roadmap is led on to.

        The nearest to ``joints`` come first. None where none goes.
        """
        axis, heading = axis_of(self.world.robot, roadmap.base), float(roadmap.base[2])
        off = np.abs(roadmap.joints - joints).max(axis=1)
        for k in np.argsort(off, kind="stable")[: OPTIONS.max_continued].tolist():
            here = roadmap.joints[k]
            led = self._carried(self._bound, axis, heading, here, np.array([i]))
            clear = len(led) > 0 and self.collision.proves(Pose(roadmap.base, led[0]))
            if clear and goes(self.collision, roadmap.base, here, led[0]):
                return np.stack([here, led[0]])
        return None

    @property
    def root(self) -> Array:
        """Posture (dof,) that the arm is driven in, the root of its roadmaps."""
        root: Array = self._travel.joints[0]
        return root

    def clear_postures(self, base: Array, some: Index, joints: Array) -> FixedBasePostures | None:
        """Return those of postures (n, dof) that are clear and hold all round the rim of the circle."""
        kept = [n for n, i in enumerate(some.tolist()) if self.serves(i, base, joints[n])]
        if not kept:
            return None
        spare = float(self.world.robot.chain.room_to_limits(joints[kept]).min())
        return FixedBasePostures(base, tuple(some[kept].tolist()), joints[kept], spare)

    def continued(self, base: Array, some: Index, joints: Array) -> Array:
        """Return postures (n, dof) at set-points, continued from the one before, or else the given ones."""
        axis, heading, found = axis_of(self.world.robot, base), float(base[2]), joints.copy()
        first = 0
        while first < len(some):
            held = self._carried(self._bound, axis, heading, joints[first], some[first:])
            found[first : first + len(held)] = held
            first += max(1, len(held))
        return found

    def serves(self, i: int, base: Array, joints: Array) -> bool:
        """True if a posture at set-point i is clear and holds all round the circle that the rules ask for."""
        wanted = self.world.rules.stop_tolerance
        if not self._holds(base, joints):
            return False
        return wanted == 0.0 or self.reaches_rim(i, base, joints, wanted)

    def _holds(self, base: Array, joints: Array) -> bool:
        """True if a posture is clear and meets the rules' criteria."""
        return self.collision.proves(Pose(base, joints)) and self._bound.meets(self._behind(joints))

    def _from(
        self, base: Array, joints: Array, axis: Array, span: tuple[float, float]
    ) -> FixedBasePostures | None:
        """Continue a posture along the targets, with a free pivot to choose a heading, then at that."""
        heading = float(base[2])
        if self._bound.chain.dof == self.world.robot.chain.dof:  # else the base turns in place of a pivot
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
        count = next((i for i, q in enumerate(held) if not self._holds(pose, q)), len(held))
        if count == 0:  # the motion may lead it round what it touches
            return FixedBasePostures(pose, (0,), held[:1], -np.inf)
        spare = float(self.world.robot.chain.room_to_limits(held[:count]).min())
        return FixedBasePostures(pose, tuple(range(count)), held[:count], spare)

    def reaches_rim(self, i: int, base: Array, joints: Array, radius: float) -> bool:
        """True if a posture stays on target i while the base moves in any direction to a rim.

        The rim is ``radius`` from a base pose (3,) [m].
        """
        axis, some = axis_of(self.world.robot, base), np.full(OPTIONS.rim_steps, i)
        shares = radius * np.arange(1, OPTIONS.rim_steps + 1)[:, None] / OPTIONS.rim_steps
        for angle in 2 * np.pi * np.arange(OPTIONS.rim_directions) / OPTIONS.rim_directions:
            places = axis + shares * (np.cos(angle), np.sin(angle))
            found = self._carried(
                self._bound, places, float(base[2]), joints, some, OPTIONS.rim_tolerance_share
            )
            if len(found) < OPTIONS.rim_steps:
                return False
        return True

    def widest_circle(self, base: Array, joints: Array, most: float) -> float:
        """Return the radius, at most so large, of a circle around a pose in which postures (n, dof) hold.

        They are those at the carrier's set-points; the circle that the rules ask for is known to be one.
        """
        wanted, radius = self.world.rules.stop_tolerance, most
        for i, q in enumerate(joints):
            radius = radius_that_holds(radius, wanted, partial(self.reaches_rim, i, base, q))
        return max(radius, wanted)

    def _carried(
        self,
        solver: SerialSolver,
        axis: Array,
        heading: float,
        joints: Array,
        some: Index | None = None,
        share: float = 1.0,
    ) -> Array:
        """Return postures (k, dof) at the first k of some set-points, the base at one place or one each.

        They miss no more than a ``share`` of the tolerance.
        """
        aims = self._aims(
            axis, heading + float(self.world.robot.mount[3]), slice(None) if some is None else some
        )
        more, arm, effort = solver.chain.dof - len(joints), serial_arm(solver.endless), solver.effort
        rows = np.zeros((len(aims.positions), solver.chain.dof))
        rows[0, more:] = joints
        rows[0] = np.clip(rows[0], arm.lower, arm.upper)
        most, steps = share * effort.tolerance, POSTURES.solver.max_carry_steps
        count = carried_along(arm, self._thresholds, aims, effort.reach, most, steps, rows)
        return rows[:count, more:]

    def _heading(self, heading: float, free: Array) -> float:
        """Return the heading that leaves the pivot as near as possible to the middle of its limits."""
        pivot = self._bound.chain.active_joints[pivot_index(self._bound.chain)]
        if not np.isfinite(pivot.upper - pivot.lower) or not len(free):
            return heading
        some = free[:, self._pivot]
        return float(heading + (some.max() + some.min() - pivot.lower - pivot.upper) / 2)
