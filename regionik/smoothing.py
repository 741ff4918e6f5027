"""The motion with the tool on its path, made smooth: base and arm of a whole run optimised together.

What the search found is a way round things, not a way to drive: it goes to the nearest place again and
again. Here each run is laid out evenly along the tool's path and smoothed by `path_smoothing`, and the plan
is proven anew. Where a check fails, the states near it are held closer to what was proven before; a run that
cannot be proven stays as it was.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from regionik.areas.ground import Geometries
from regionik.areas.standing import Standing
from regionik.planners.collision.proximity import Touch, nearest, state_clear
from regionik.planners.geometry.angles import wrap
from regionik.planners.smoothing.path_smoothing import HalfSpaces, PathProblem, on_path, smooth_states
from regionik.postures.arm import aim_of, goal_between
from regionik.postures.arm_guard import Guard, guard_of
from regionik.postures.poses import axis_of
from regionik.timing.limits import motion_limits
from regionik.values import Configuration, Motion, Plan, Report
from regionik.verification.verifier import verify
from regionik.worlds.arms import pivot_index, with_pivot
from regionik.worlds.arrays import Array, Index
from regionik.worlds.criteria import with_joint_margin
from regionik.worlds.robot import Robot
from regionik.worlds.scene import World
from regionik.worlds.speeds import Speeds

STRIDE = 0.025  # of the tool between two states [m]
LEAST_STRIDE = 1e-3  # along the path, where the tool rests or nearly so [m]
BASE_SHARE = 0.4  # of the base's way that counts as way along the path, where the tool rests
SHARP = 0.35  # turn of the tool's path that is a corner [rad]
MOST_STATES = 1500  # smoothed at once
SHORTEST_RUN = 3  # states
AREA_MARGIN, ARM_MARGIN = 0.03, 0.01  # kept where there is room [m]
AREA_COST, ARM_COST = 1.0, 0.02  # of what is missing; where an arm is too near the proof will say [1/m]
JOINT_MARGIN = math.radians(2)  # [rad]
NEAR = 0.05  # distance from which a link's clearance is looked after [m]
OUTSIDE = 1e-9  # of its area, by rounding [m]
RECOVERY = 0.01  # by which a state outside is asked to come back in a round [m]
TRIES = 6  # of proving a smoothed plan
BESIDE = 6  # states on either side of one that fails which are held closer
CLOSER = 0.5  # by this factor


def smooth_motion(plan: Plan, standing: Standing) -> Plan:
    """Return a plan with smoother motion while the tool is on its path, proven like the one it came from.

    Parameters
    ----------
    plan : Plan
        Verified, not timed.
    standing : Standing
        Where the base may stand.

    Returns
    -------
    Plan
        The plan itself where nothing could be made smoother.
    """
    for evenly in (True, False):  # where states laid out evenly fail, those that were found may do
        runs = [run for run in _runs(plan, standing, evenly) if len(run.states) >= SHORTEST_RUN]
        plan, complete = _proven(plan, runs)
        if complete:
            break
    return plan


def _proven(plan: Plan, runs: list[_Run]) -> tuple[Plan, bool]:
    """The plan with those runs smoothed that can be proven so, and whether all of them were."""
    tubes = [np.full(len(run.states), np.inf) for run in runs]
    smoothed = [run.smoothed(tube, run.states) for run, tube in zip(runs, tubes, strict=True)]
    failed = dict[int, list[int]]()
    for _ in range(TRIES):
        found, failed = _checked(plan, runs, smoothed)
        if found is not None:
            return found, True
        for k, rows in failed.items():
            tubes[k] = _held_closer(runs[k], smoothed[k], tubes[k], rows)
            smoothed[k] = runs[k].smoothed(tubes[k], smoothed[k])
    kept = [k for k in range(len(runs)) if k not in failed]
    found, _ = _checked(plan, [runs[k] for k in kept], [smoothed[k] for k in kept])
    return found or plan, False


def _checked(plan: Plan, runs: list[_Run], smoothed: list[Array]) -> tuple[Plan | None, dict[int, list[int]]]:
    """The plan with smoothed runs, if it holds, and the states of each run where it does not."""
    found = _rebuilt(plan, runs, smoothed)
    report, failed = verify(found), dict[int, list[int]]()
    for k, row in _failures(found, report, runs, smoothed):
        failed.setdefault(k, []).append(row)
    if failed or not report.ok:
        return None, failed
    return replace(found, stats={**found.stats, "margins": report.margins}), failed


@dataclass(frozen=True, eq=False)
class _Run:
    """States with the tool on its path, from one lift-off to the next, laid out to be smoothed.

    Attributes
    ----------
    first, last : int
        Rows of the plan's motion that the run takes the place of.
    owner : (n,) array of int
        Set-point of each state.
    worked : (n,) array of bool
        States that are set-points.
    states : (n, m) array
        x, y, yaw and joints, before smoothing.
    areas : (k,) array of geometry
        Of the arm axis at the set-points.
    problem : PathProblem
        With the coordinates held that must be.
    """

    first: int
    last: int
    owner: Index
    worked: NDArray[np.bool_]
    states: Array
    areas: Geometries
    problem: PathProblem

    def smoothed(self, tube: Array, start: Array) -> Array:
        """States from a start on smoothed, each within its ``tube`` (n,) of what it was [m] or [rad]."""
        lower = np.maximum(self.problem.lower, self.states - tube[:, None])
        upper = np.minimum(self.problem.upper, self.states + tube[:, None])
        problem = replace(self.problem, lower=lower, upper=upper)
        return self._within(problem, smooth_states(problem, np.clip(start, lower, upper)))

    def _within(self, problem: PathProblem, states: Array) -> Array:
        """States whose arm axis stands in its area to rounding, where it was there before."""
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


def _runs(plan: Plan, standing: Standing, evenly: bool) -> Iterator[_Run]:
    """Runs of a plan; long ones in parts, which begin and end where they did."""
    layout = _Layout(plan, standing, evenly and not plan.world.robot.drive.rolls)
    working = plan.motion.kind != "transit"
    edges = np.flatnonzero(np.diff(np.concatenate([[False], working, [False]])))
    for first, end in edges.reshape(-1, 2).tolist():
        yield from layout.parts(first, end - 1)


@dataclass(frozen=True, eq=False)
class _Layout:
    """Lays out the runs of a plan."""

    plan: Plan
    standing: Standing
    evenly: bool

    def parts(self, first: int, last: int) -> Iterator[_Run]:
        count = 1 + (last - first) // MOST_STATES
        cuts = np.linspace(first, last, count + 1).astype(int).tolist()
        for a, b in zip(cuts[:-1], cuts[1:], strict=True):
            yield self._run(a, b)

    def _run(self, first: int, last: int) -> _Run:
        motion, rows = self.plan.motion, slice(first, last + 1)
        before = np.column_stack(
            [motion.base[rows, :2], np.unwrap(motion.base[rows, 2]), motion.joints[rows]]
        )
        owner, worked = motion.setpoint[rows], motion.kind[rows] == "setpoint"
        places = self._places(first, last)
        at, states = places, before
        if self.evenly:
            at, owner, worked = self._even(owner, places)
            unique = np.append(np.diff(places) > 0, True)
            states = np.stack([np.interp(at, places[unique], column) for column in before[unique].T], axis=1)
            states[0], states[-1] = before[0], before[-1]
        held = first > 0, last < len(motion) - 1
        areas = np.array([self.plan.areas[i].pruned for i in owner[worked]])
        problem = self._problem(states, owner, worked, at, held)
        return _Run(first, last, owner, worked, states, areas, problem)

    def _places(self, first: int, last: int) -> Array:
        """Places of old states along the path: the set-point, and the share of the way to the next."""
        task, motion = self.plan.world.task, self.plan.motion
        places = motion.setpoint[first : last + 1].astype(float)
        tools = self._tools[first : last + 1]
        for k in np.flatnonzero(motion.kind[first : last + 1] == "step").tolist():
            i = int(places[k])
            way = task[i + 1].position - task[i].position
            share = (tools[k] - task[i].position) @ way / max(float(way @ way), 1e-12)
            places[k] = i + min(max(float(share), 0.0), 1.0)
        kept: Array = np.maximum.accumulate(places)
        return kept

    def _even(self, owner: Index, places: Array) -> tuple[Array, Index, NDArray[np.bool_]]:
        """Evenly laid out places, each with its set-point and whether it is one."""
        task = self.plan.world.task
        at = [places[0]]
        for i in range(int(owner[0]), math.ceil(places[-1])):
            count = max(1, math.ceil(math.dist(task[i].position, task[i + 1].position) / STRIDE))
            at += [p for p in (i + np.arange(1, count + 1) / count) if places[0] < p < places[-1]]
        if places[-1] > places[0]:
            at.append(places[-1])
        rows = np.array(at)
        return rows, np.floor(rows).astype(np.int64), rows == np.floor(rows)

    def _problem(
        self, states: Array, owner: Index, worked: NDArray[np.bool_], at: Array, held: tuple[bool, bool]
    ) -> PathProblem:
        world = self.plan.world
        task, ends = world.task, len(world.task) - 1
        aims = [
            aim_of(goal_between(task[i], task[min(i + 1, ends)], float(p) - i))
            for i, p in zip(np.floor(at).astype(int).tolist(), at, strict=True)
        ]
        position = np.array([aim.position for aim in aims])
        lower, upper = self._limits(states, held)
        return PathProblem(
            world.robot,
            self._parameter(position, states),
            _corners(position),
            position,
            np.array([aim.kind for aim in aims]),
            np.array([aim.turn for aim in aims]),
            np.array([aim.cone for aim in aims]),
            _scale(world),
            lower,
            upper,
            self._keeper(owner, worked),
        )

    def _parameter(self, position: Array, states: Array) -> Array:
        tool = np.linalg.norm(np.diff(position, axis=0), axis=1)
        base = BASE_SHARE * np.linalg.norm(np.diff(states[:, :2], axis=0), axis=1)
        way = tool if self.evenly else np.maximum(tool, base)
        return np.concatenate([[0.0], np.cumsum(np.maximum(way, LEAST_STRIDE))])

    def _limits(self, states: Array, held: tuple[bool, bool]) -> tuple[Array, Array]:
        """Bounds of all coordinates: limits with a margin where there is room, and what is held."""
        world = self.plan.world
        chain = with_joint_margin(world.robot, world.rules.criteria).chain
        lower, upper = np.full(states.shape, -np.inf), np.full(states.shape, np.inf)
        spare = np.minimum(JOINT_MARGIN, 0.1 * (chain.upper - chain.lower))
        lower[:, 3:] = np.minimum(chain.lower + spare, states[:, 3:])
        upper[:, 3:] = np.maximum(chain.upper - spare, states[:, 3:])
        fixed = np.zeros(states.shape, dtype=bool)
        fixed[:, :3] = world.robot.drive.rolls
        fixed[:, 2] |= world.rules.heading == "fixed"
        if world.rules.heading == "face_target" and with_pivot(chain) is chain:
            fixed[:, 3 + pivot_index(chain)] = True
        fixed[0], fixed[-1] = fixed[0] | held[0], fixed[-1] | held[1]
        return np.where(fixed, states, lower), np.where(fixed, states, upper)

    def _keeper(self, owner: Index, worked: NDArray[np.bool_]) -> Callable[[Array], HalfSpaces]:
        world, areas = self.plan.world, self.plan.areas
        floor = shapely.union_all(self.standing.pieces.polygon)
        within = np.array([areas[i].pruned if at else floor for i, at in zip(owner, worked, strict=True)])
        keeper = _Keeper(world.robot, guard_of(world), within)
        return keeper.half_spaces

    @cached_property
    def _tools(self) -> Array:
        return self.plan.tools()


@dataclass(frozen=True, eq=False)
class _Keeper:
    """Keeps the arm axis in its areas and the links clear."""

    robot: Robot
    guard: Guard
    within: Geometries

    def half_spaces(self, states: Array) -> HalfSpaces:
        """Half-spaces about given states, see `path_smoothing`."""
        parts = [self._inside(states)] if not self.robot.drive.rolls else []
        parts += self._clear(states) if self.guard.on else []
        if not parts:
            return HalfSpaces(np.empty(0, np.int64), np.empty((0, states.shape[1])), np.empty(0), np.empty(0))
        columns = ((one.state, one.normal, one.least, one.cost) for one in parts)
        return HalfSpaces(*(np.concatenate(column) for column in zip(*columns, strict=True)))

    def _inside(self, states: Array) -> HalfSpaces:
        """The arm axis stays on its side of the nearest edge of its area."""
        axis = axis_of(self.robot, states[:, :3])
        points = shapely.points(axis)
        lines = shapely.shortest_line(self._edges, points)
        away = axis - shapely.get_coordinates(lines).reshape(-1, 2, 2)[:, 0]
        depth = np.linalg.norm(away, axis=1)
        sign = np.where(shapely.covers(self.within, points), 1.0, -1.0)
        unit = away * (sign / np.maximum(depth, 1e-12))[:, None]
        normal = np.zeros(states.shape)
        normal[:, :2] = unit
        normal[:, 2] = unit[:, 1] * (axis - states[:, :2])[:, 0] - unit[:, 0] * (axis - states[:, :2])[:, 1]
        least = _least(sign * depth, AREA_MARGIN)
        return HalfSpaces(np.arange(len(states)), normal, least, np.full(len(states), AREA_COST))

    def _clear(self, states: Array) -> list[HalfSpaces]:
        """Links that are near to something come no nearer than they may."""
        bodies, contact = self.guard.bodies, self.guard.contact
        rows = []
        for k, state in enumerate(states):
            base, joints = state[:3].copy(), state[3:].copy()
            if state_clear(bodies, base, joints, NEAR, contact):
                continue
            touch = nearest(bodies, base, joints, contact=contact, within=NEAR)
            if touch.kind != "none":
                room = np.array([self.guard.room(touch)])
                normal = self._approach(touch, base, joints)[None]
                least = _least(room, ARM_MARGIN)
                rows.append(HalfSpaces(np.array([k]), normal, least, np.array([ARM_COST])))
        return rows

    def _approach(self, touch: Touch, base: Array, joints: Array) -> Array:
        """How the distance of a touch changes with each coordinate, (m,)."""
        apart = touch.on_solid - touch.on_other
        unit = apart / max(float(np.linalg.norm(apart)), 1e-12) * (1.0 if touch.distance >= 0 else -1.0)
        frames, solids = self.robot.frames(base, joints), self.robot.all_solids
        moved = self._moved(frames, base, solids[touch.solid].link, touch.on_solid)
        if touch.kind == "self":
            moved = moved - self._moved(frames, base, solids[touch.other].link, touch.on_other)
        if touch.kind == "base":
            moved = moved - self._moved(frames, base, -1, touch.on_other)
        rate: Array = unit @ moved
        return rate

    def _moved(self, frames: Array, base: Array, link: int, point: Array) -> Array:
        """Velocity of a point of a link for each coordinate's unit speed, (3, m)."""
        J = np.zeros((3, 3 + self.robot.chain.dof))
        J[0, 0] = J[1, 1] = 1.0
        J[:2, 2] = base[1] - point[1], point[0] - base[0]
        for k, joint in enumerate(self.robot.chain.joints[: link + 1]):
            axis = frames[k, :3, :3] @ joint.axis
            revolute = joint.kind == "revolute"
            J[:, 3 + k] = np.cross(axis, point - frames[k, :3, 3]) if revolute else axis
        return J

    @cached_property
    def _edges(self) -> Geometries:
        edges: Geometries = shapely.boundary(self.within)
        return edges


def _least(room: Array, margin: float) -> Array:
    """Least change of a distance: it may shrink to the margin, and grows a little where it is negative."""
    return np.where(room < 0, np.minimum(-room, RECOVERY), np.minimum(margin - room, 0.0))


def _corners(position: Array) -> NDArray[np.bool_]:
    """States in which a path (n, 3) turns sharply."""
    way = np.diff(position, axis=0)
    length = np.linalg.norm(way, axis=1)
    unit = way / np.maximum(length, 1e-12)[:, None]
    cosine = np.einsum("ni,ni->n", unit[:-1], unit[1:])
    turned = (cosine < math.cos(SHARP)) & (length[:-1] > 1e-9) & (length[1:] > 1e-9)
    return np.concatenate([[False], turned, [False]])


def _scale(world: World) -> Array:
    """Weight of each coordinate: the inverse of its limit of acceleration."""
    limits = motion_limits(world.robot, world.speeds or Speeds())
    base = limits.speeds.base_acceleration
    return 1 / np.concatenate([[base, base, limits.speeds.turn_acceleration], limits.joint_acceleration])


def _rebuilt(plan: Plan, runs: list[_Run], smoothed: list[Array]) -> Plan:
    """The plan with the states of runs in the place of its own."""
    old, done, parts = plan.motion, 0, list[Motion]()
    setpoints = list(plan.setpoints)
    for run, states in zip(runs, smoothed, strict=True):
        parts.append(_cut(old, done, run.first))
        parts.append(_columns(run, states))
        done = run.last + 1
        for k in np.flatnonzero(run.worked).tolist():
            setpoints[run.owner[k]] = _moved_to(plan.world, int(run.owner[k]), setpoints, states[k])
    parts.append(_cut(old, done, len(old)))
    columns = ("base", "joints", "kind", "setpoint", "time")
    motion = Motion(*(np.concatenate([getattr(part, key) for part in parts]) for key in columns))
    stats = {key: value for key, value in plan.stats.items() if key != "margins"}
    stats["states"], stats["base_travel"] = len(motion), plan.world.robot.drive.travel(motion.base)
    stats["largest_error"] = float(max(found.error for found in setpoints))
    return replace(plan, motion=motion, setpoints=tuple(setpoints), stats=stats)


def _moved_to(world: World, i: int, setpoints: list[Configuration], state: Array) -> Configuration:
    base, joints = _wrapped(state[None])[0], state[3:]
    error = math.dist(world.robot.tool(base, joints)[:3, 3], world.task[i].position)
    return replace(setpoints[i], base=base, joints=joints, error=error)


def _cut(motion: Motion, a: int, b: int) -> Motion:
    rows = slice(a, b)
    return Motion(
        motion.base[rows], motion.joints[rows], motion.kind[rows], motion.setpoint[rows], motion.time[rows]
    )


def _columns(run: _Run, states: Array) -> Motion:
    kind = np.where(run.worked, "setpoint", "step")
    return Motion(_wrapped(states), states[:, 3:], kind, run.owner, np.full(len(states), np.nan))


def _wrapped(states: Array) -> Array:
    base = states[:, :3].copy()
    base[:, 2] = [wrap(yaw) for yaw in base[:, 2].tolist()]
    return base


def _failures(
    found: Plan, report: Report, runs: list[_Run], smoothed: list[Array]
) -> Iterator[tuple[int, int]]:
    """Runs and states in them that a report is about, or that stand outside their area."""
    shift, starts = 0, list[int]()
    for run, states in zip(runs, smoothed, strict=True):
        starts.append(run.first + shift)
        shift += len(states) - (run.last + 1 - run.first)
    for violation in report.violations:
        for k, (start, states) in enumerate(zip(starts, smoothed, strict=True)):
            if violation.state is not None and start - 1 <= violation.state <= start + len(states):
                yield k, min(max(violation.state - start, 0), len(states) - 1)
    for k, (run, states) in enumerate(zip(runs, smoothed, strict=True)):
        worked = np.flatnonzero(run.worked)
        axis = shapely.points(axis_of(found.world.robot, states[worked, :3]))
        moved = (states[worked] != run.states[worked]).any(axis=1)
        yield from ((k, int(row)) for row in worked[moved & (shapely.distance(run.areas, axis) > OUTSIDE)])


def _held_closer(run: _Run, smoothed: Array, tube: Array, rows: list[int]) -> Array:
    """The tube narrower about states that failed."""
    changed = np.abs(smoothed - run.states).max(axis=1)
    narrow = tube.copy()
    for row in rows:
        beside = slice(max(0, row - BESIDE), row + BESIDE + 1)
        narrow[beside] = np.minimum(narrow[beside], CLOSER * changed[beside])
    return narrow
