"""Runs of a plan, states with the tool on its path from one lift-off to the next, laid out to be smoothed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.areas.free_space import FreeSpace
from regionik.areas.ground import united
from regionik.areas.layers import Geometries
from regionik.moving.state_constraints import StateConstraints
from regionik.planners.smoothing.path_smoothing import PathProblem, on_path, smooth_states
from regionik.planners.solvers.aims import beyond_cones, in_columns, missed_by
from regionik.postures.arm import aim_of, goal_between
from regionik.postures.poses import axis_of, transits
from regionik.scene import Scene
from regionik.smoothing.options import SMOOTHING
from regionik.values import Plan
from regionik.worlds.arms import has_pivot, pivot_index
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.drives import displacement, unwrapped
from regionik.worlds.limits import Speeds
from regionik.worlds.robot import Robot, with_joint_margin

OPTIONS = SMOOTHING.layout
FAR = 1e6  # beyond every floor [m]
MAX_LIMIT_MISS = 1e-9  # by the tool of a state that is led off its limits [m]
OFF_AREA = 1e-6  # of the arm axis in a state as found, from which on no area is kept [m]
ANYWHERE = shapely.box(-FAR, -FAR, FAR, FAR)


@dataclass(frozen=True, eq=False)
class PathRun:
    """States with the tool on its path, from one lift-off to the next, laid out to be smoothed."""

    first: int  # rows of the plan's motion that the run takes the place of
    last: int
    owner: Index  # (n,) set-point of each state
    worked: Mask  # (n,) states that are set-points
    states: Array  # (n, m) x, y, yaw and joints, before smoothing
    areas: Geometries  # (k,) of the arm axis at the set-points
    # Of all states, and of the set-points and both ends; coordinates are held that must be
    problem: PathProblem
    coarse: PathProblem
    constraints: StateConstraints  # of all states

    def smoothed(self) -> Array:
        """All states smoothed; of long runs first those of the set-points alone, which is soon done."""
        rows, t = _coarse_rows(self.worked), self.problem.parameter
        most = OPTIONS.max_setpoint_share * len(self.states)
        if len(self.states) < OPTIONS.min_long_run or not OPTIONS.min_run_states <= len(rows) <= most:
            return self._within(smooth_states(self.problem, self.states))
        found = smooth_states(self.coarse, self.states[rows])
        begun = np.stack([np.interp(t, t[rows], column) for column in found.T], axis=1)
        return self._within(smooth_states(self.problem, begun, OPTIONS.near_trust))

    def mended(self, states: Array, failed: list[int], tube: Array, demanded: Array) -> Array:
        """States smoothed anew about those that failed, the others kept.

        Each stays within its ``tube`` (n,) of what it was before smoothing [m] or [rad], and distances that
        are ``demanded`` (n,) of it are not given up [m].
        """
        mended = states.copy()
        for rows in _windows(failed, len(states)):
            within = self.constraints.within
            within = None if within is None else within[rows]
            constraints = replace(self.constraints, within=within, demanded=demanded[rows])
            cost = OPTIONS.stiffer_area_cost * self.constraints.area_cost
            constraints = replace(constraints, area_cost=cost)
            part = self.problem.part(rows, constraints.half_spaces)
            lower = np.maximum(part.lower, self.states[rows] - tube[rows, None])
            upper = np.minimum(part.upper, self.states[rows] + tube[rows, None])
            inner = slice(2 if rows.start > 0 else 0, -2 if rows.stop < len(states) else None)
            held = np.ones(len(lower), dtype=bool)  # with two states at an end the others go on smoothly
            held[inner] = False
            lower[held] = upper[held] = states[rows][held]
            part = replace(part, lower=lower, upper=upper)
            mended[rows] = smooth_states(part, np.clip(states[rows], lower, upper), OPTIONS.near_trust)
        return self._within(mended)

    def _within(self, states: Array) -> Array:
        """States whose arm axis stands in its area to rounding, where it was there before."""
        problem = self.problem
        if problem.robot.drive.rolls:
            return states
        axis = axis_of(problem.robot, states[:, :3])
        lines = shapely.shortest_line(self.areas, shapely.points(axis[self.worked]))
        back = shapely.get_coordinates(lines).reshape(-1, 2, 2)[:, 0] - axis[self.worked]
        if not back.any():
            return states
        moved = states.copy()
        moved[self.worked, :2] += back
        held = np.arange(states.shape[1]) < 3
        lower, upper = (np.where(held, moved, ends) for ends in (problem.lower, problem.upper))
        return on_path(replace(problem, lower=lower, upper=upper), moved)


def runs_of(scene: Scene, plan: Plan, free_space: FreeSpace, stride: float, loose: bool) -> Iterator[PathRun]:
    """Runs of a plan; long ones in parts, which begin and end where they did.

    Where runs are ``loose`` their ends may move where the robot comes or goes with its tool lifted.

    The tool moves evenly by at most a ``stride`` from state to state [m]. Where that is infinite, and of a
    car, states are the plan's own.
    """
    layout = _Layout(
        scene, plan, free_space, stride if scene.robot.drive.turns_on_the_spot else math.inf, loose
    )
    working = plan.motion.kind != "transit"
    edges = np.flatnonzero(np.diff(np.concatenate([[False], working, [False]])))
    for first, end in edges.reshape(-1, 2).tolist():
        count = 1 + (end - 1 - first) // OPTIONS.max_states
        cuts = np.linspace(first, end - 1, count + 1).astype(int).tolist()
        yield from (layout.run(a, b) for a, b in pairwise(cuts))


@dataclass(frozen=True, eq=False)
class _Layout:
    scene: Scene
    plan: Plan
    free_space: FreeSpace
    stride: float
    loose: bool

    @property
    def evenly(self) -> bool:
        return math.isfinite(self.stride)

    def run(self, first: int, last: int) -> PathRun:
        scene, motion, rows = self.scene, self.plan.motion, slice(first, last + 1)
        before = np.column_stack([unwrapped(motion.base[rows]), motion.joints[rows]])
        owner, worked = motion.setpoint[rows], motion.kind[rows] == "setpoint"
        places = self._places(first, last)
        at, states = places, before
        if self.evenly:
            travelled = np.append(0.0, np.cumsum(_ways(scene.robot, before)))
            unique = np.append(np.diff(places) > 0, True)
            at, owner, worked = self._even(owner, places[unique], travelled[unique])
            states = np.stack([np.interp(at, places[unique], column) for column in before[unique].T], axis=1)
            states[0], states[-1] = before[0], before[-1]
        beyond = self._beyond(first, last, states)
        loose = ~np.isnan(beyond[[0, -1], 0])
        held = bool(first > 0 and not loose[0]), bool(last < len(motion) - 1 and not loose[1])
        within = self._within(states, owner, worked)
        problem = self._problem(states, within, at, held, beyond)
        states = on_path(problem, states) if self.evenly else states
        problem, states = _off_limits(problem, states)
        few = _coarse_rows(worked)
        coarse = self._problem(states[few], within[few], at[few], held, beyond[few])
        coarse = replace(coarse, lower=problem.lower[few], upper=problem.upper[few])
        coarse, constraints = replace(coarse, parameter=problem.parameter[few]), self._constraints(within)
        return PathRun(first, last, owner, worked, states, within[worked], problem, coarse, constraints)

    def _places(self, first: int, last: int) -> Array:
        """Places of old states along the path: the set-point, and the share of the way to the next."""
        task, motion = self.scene.task, self.plan.motion.part(first, last + 1)
        places = motion.setpoint.astype(float)
        tools = self.scene.robot.tool(motion.base, motion.joints)[:, :3, 3]
        for k in np.flatnonzero(motion.kind == "step").tolist():
            i = int(places[k])
            way = task[i + 1].position - task[i].position
            share = (tools[k] - task[i].position) @ way / max(float(way @ way), 1e-12)
            places[k] = i + min(max(float(share), 0.0), 1.0)
        return np.maximum.accumulate(places)

    def _even(self, owner: Index, places: Array, travelled: Array) -> tuple[Array, Index, Mask]:
        """Evenly laid out places, each with its set-point and whether it is one.

        There are enough of them for what the footprint has ``travelled`` (n,) from set-point to set-point.
        """
        task, step = self.scene.task, OPTIONS.step_share * self.scene.rules.step
        at = [places[0]]
        for i in range(int(owner[0]), math.ceil(places[-1])):
            way = math.dist(task[i].position, task[i + 1].position)
            driven = float(np.ptp(np.interp((i, i + 1), places, travelled)))
            least = 1 + (way > OPTIONS.max_near_distance)
            count = max(least, math.ceil(way / self.stride), math.ceil(driven / step))
            at += [p for p in (i + np.arange(1, count + 1) / count) if places[0] < p < places[-1]]
        if places[-1] > places[0]:
            at.append(places[-1])
        rows = np.array(at)
        return rows, np.floor(rows).astype(np.int64), rows == np.floor(rows)

    def _problem(
        self, states: Array, within: Geometries, at: Array, fixed_ends: tuple[bool, bool], beyond: Array
    ) -> PathProblem:
        scene = self.scene
        task, ends = scene.task, len(scene.task) - 1
        aims = [
            aim_of(goal_between(task[i], task[min(i + 1, ends)], float(p) - i))
            for i, p in zip(np.floor(at).astype(int).tolist(), at, strict=True)
        ]
        position = np.array([aim.position for aim in aims])
        parameter, limits = self._parameter(position, states), self._limits(states, fixed_ends)
        keep, corner = self._constraints(within).half_spaces, _corners(position)
        return PathProblem(
            scene.robot, parameter, corner, in_columns(aims), _scale(scene), *limits, beyond, keep
        )

    def _beyond(self, first: int, last: int, states: Array) -> Array:
        """States from and to which the robot goes with its tool lifted, beside its ends, NaN for none."""
        motion, beyond = self.plan.motion, np.full(states.shape, np.nan)
        ways = [*transits(motion)] if self.loose else []
        before = [(0, way.start - 1) for way in ways if way.stop == first]
        after = [(-1, way.stop) for way in ways if way.start == last + 1]
        for end, k in before + after:
            turn = displacement(states[end, :3], motion.base[k])[2]
            beyond[end] = [*motion.base[k, :2], states[end, 2] + turn, *motion.joints[k]]
        return beyond

    def _parameter(self, position: Array, states: Array) -> Array:
        tool = np.linalg.norm(np.diff(position, axis=0), axis=1)
        base = OPTIONS.base_share * _ways(self.scene.robot, states)
        way = tool if self.evenly else np.maximum(tool, base)
        return np.concatenate([[0.0], np.cumsum(np.maximum(way, OPTIONS.min_stride))])

    def _limits(self, states: Array, fixed_ends: tuple[bool, bool]) -> tuple[Array, Array]:
        """Bounds of all coordinates: limits with a margin where there is room, and what is held."""
        scene = self.scene
        chain = with_joint_margin(scene.robot, scene.rules.criteria).chain
        lower, upper = np.full(states.shape, -np.inf), np.full(states.shape, np.inf)
        spare = chain.spare
        lower[:, 3:] = np.minimum(chain.lower + spare, states[:, 3:])
        upper[:, 3:] = np.maximum(chain.upper - spare, states[:, 3:])
        fixed = np.zeros(states.shape, dtype=bool)
        fixed[:, :3] = not scene.robot.drive.turns_on_the_spot  # a car's steering has to stay as it is
        fixed[:, 2] |= scene.rules.heading == "fixed"
        if scene.rules.heading == "face_target" and has_pivot(chain):
            fixed[:, 3 + pivot_index(chain)] = True
        fixed[0], fixed[-1] = fixed[0] | fixed_ends[0], fixed[-1] | fixed_ends[1]
        return np.where(fixed, states, lower), np.where(fixed, states, upper)

    def _within(self, states: Array, owner: Index, worked: Mask) -> Geometries:
        """Where the arm axis may be in each state: at set-points in their areas, else on the free floor.

        Anywhere where it was found off them, as slabs of headings are smaller than the room of a footprint.
        """
        axes = shapely.points(axis_of(self.scene.robot, states[:, :3]))
        areas = np.array([self.plan.areas[i].pruned for i in owner])
        at_work = worked & (shapely.distance(areas, axes) <= OFF_AREA)
        free = np.where(shapely.distance(self._floor, axes) <= OFF_AREA, self._floor, ANYWHERE)
        return np.where(at_work, areas, free)

    def _constraints(self, within: Geometries) -> StateConstraints:
        scene, drive = self.scene, self.scene.robot.drive
        room = (
            scene.footprint
            if drive.turns_on_the_spot and (drive.rolls or scene.free_floor.turns_matter)
            else None
        )
        return StateConstraints(scene.robot, scene.collision, room, within, np.zeros(len(within)))

    @cached_property
    def _floor(self) -> BaseGeometry:
        return united(self.free_space.pieces.polygon)


def _off_limits(problem: PathProblem, states: Array) -> tuple[PathProblem, Array]:
    """Lead states off the limits of their joints where the tool keeps to its path so; they are kept there.

    Coordinates that are held stay as they are, and so do bases on wheels, whose states hang together.
    """
    chain = with_joint_margin(problem.robot, None).chain
    free = problem.upper > problem.lower
    lower, upper = problem.lower.copy(), problem.upper.copy()
    lower[:, 3:] = np.where(free[:, 3:], np.maximum(lower[:, 3:], chain.lower + chain.spare), lower[:, 3:])
    upper[:, 3:] = np.where(free[:, 3:], np.minimum(upper[:, 3:], chain.upper - chain.spare), upper[:, 3:])
    near = np.flatnonzero(((states < lower) | (states > upper)).any(axis=1))
    if not len(near) or problem.robot.drive.rolls:
        return problem, states
    tight, led = replace(problem, lower=lower, upper=upper), states.copy()
    for k in near.tolist():
        rows = slice(k, k + 1)
        there = on_path(
            tight.part(rows, problem.half_spaces_at), np.clip(states[rows], lower[rows], upper[rows])
        )
        aims = problem.aims.part(rows)
        missed = beyond_cones(aims, missed_by(problem.robot, aims, there)).miss
        change = float(np.abs(there - states[rows]).max())
        if np.abs(missed).max() <= MAX_LIMIT_MISS and change <= OPTIONS.max_limit_change:
            led[k] = there[0]
        else:
            lower[k], upper[k] = problem.lower[k], problem.upper[k]
    return replace(problem, lower=lower, upper=upper), led


def _ways(robot: Robot, states: Array) -> Array:
    """How far the farthest corner of the footprint goes at most from state to state (n, m), (n - 1,) [m]."""
    moved, radius = np.diff(states[:, :3], axis=0), np.linalg.norm(robot.footprint, axis=1).max()
    return np.linalg.norm(moved[:, :2], axis=1) + radius * np.abs(moved[:, 2])


def _coarse_rows(worked: Mask) -> Index:
    ends = np.arange(len(worked))
    return np.flatnonzero(worked | (ends == 0) | (ends == len(worked) - 1))


def _windows(failed: list[int], count: int) -> Iterator[slice]:
    """Stretches of ``count`` states about those that failed."""
    near = np.zeros(count + 2, dtype=np.int64)
    for row in failed:
        near[1 + max(row - OPTIONS.window, 0) : 1 + min(row + OPTIONS.window + 1, count)] = 1
    edges = np.flatnonzero(np.diff(near)).reshape(-1, 2)
    yield from (slice(a, b) for a, b in edges.tolist())


def _corners(position: Array) -> Mask:
    """States in which a path (n, 3) turns sharply."""
    way = np.diff(position, axis=0)
    length = np.linalg.norm(way, axis=1)
    unit = way / np.maximum(length, 1e-12)[:, None]
    cosine = np.einsum("ni,ni->n", unit[:-1], unit[1:])
    turned = (cosine < math.cos(OPTIONS.min_corner_turn)) & (length[:-1] > 1e-9) & (length[1:] > 1e-9)
    return np.concatenate([[False], turned, [False]])


def _scale(scene: Scene) -> Array:
    """Weight of each coordinate: the inverse of its limit of acceleration."""
    speeds = scene.world.speeds or Speeds()
    base, turn = speeds.base_acceleration, speeds.turn_acceleration
    return 1 / np.array([base, base, turn, *speeds.joint_limits(scene.robot.chain)[1]])
