"""A timed plan's whole motion optimised for time: base, joints and times together, from the one that it has.

The motion is laid out in sections from set-point to set-point and over each way with the tool lifted, evenly
in time. Corridors are half-spaces about what was found in the round before: tolerances of set-points and of
the tool's path, cones, the floor, and distances of the links. What is found is timed and verified as every
motion is; near states that break a rule more distance is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.moving.state_constraints import StateConstraints
from regionik.planners.smoothing.least_time import kept_within, least_time
from regionik.planners.smoothing.path_smoothing import HalfSpaces
from regionik.planners.smoothing.timed_states import LeastTimeProblem, TimedStates, states_between
from regionik.planners.solvers.aims import ANGLE_LENGTH, in_columns, missed_by, tool_jacobians
from regionik.planners.solvers.damped_least_squares import DIRECTION, Aims
from regionik.postures.arm import aim_of, goal_between
from regionik.scene import Scene, scene_of
from regionik.timing.limits import MotionLimits
from regionik.timing.options import TIMING
from regionik.timing.parametrization import path_of
from regionik.timing.trajectory import trajectory
from regionik.values import Motion, Plan, Report, approached
from regionik.worlds.arms import has_pivot, pivot_index
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.robot import with_joint_margin

OPTIONS = TIMING.optimisation


def _everywhere() -> Array:
    """Unit vectors whose half-spaces leave nearly a ball, (26, 3)."""
    cube = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
    directions: Array = cube / np.linalg.norm(cube, axis=1)[:, None]
    return directions


_DIRECTIONS = _everywhere()

Trial = Callable[[Motion], tuple[Plan, Report]]  # a motion timed and verified


def optimised(limits: MotionLimits, plan: Plan, trial: Trial) -> tuple[Plan, Report] | None:
    """Return a timed plan with its motion optimised, and its report; None where none that is faster holds.

    Parameters
    ----------
    limits : MotionLimits
        Of a robot that does not roll.
    plan : Plan
        Timed and verified.
    trial : callable
        Times and verifies other motions.
    """
    layout = _layout(limits, plan)
    timed = least_time(layout.problem(), layout.timed)
    layout = replace(layout, parts=OPTIONS.last_parts)
    demanded = np.zeros(len(layout.segment))
    for _ in range(OPTIONS.max_tries):
        timed = kept_within(layout.problem(demanded), timed)
        found, report = trial(layout.motion(timed))
        if report.ok:
            return (found, report) if found.motion.time[-1] < plan.motion.time[-1] else None
        near = layout.near(timed, found, report)
        if not len(near):
            break
        demanded[near] += OPTIONS.spare_distance
    return None


@dataclass(frozen=True, eq=False)
class _TimedLayout:
    """States of a plan laid out to be optimised, and what holds there."""

    scene: Scene
    limits: MotionLimits
    timed: TimedStates
    kind: NDArray[np.str_]  # (n,) of states
    owner: Index  # (n,) set-point of each
    section: Index  # (n - 1,) as in `LeastTimeProblem`
    lifted: Mask  # (n - 1,) segments with the tool lifted
    parts: int  # as in `LeastTimeProblem`

    def problem(self, demanded: Array | None = None) -> LeastTimeProblem:
        """The problem, with so much more distance in the places of half-spaces (p,) [m]."""
        limits, speeds, rules = self.limits, self.limits.speeds, self.scene.rules
        base = (
            [speeds.base_velocity, speeds.turn_velocity],
            [speeds.base_acceleration, speeds.turn_acceleration],
        )

        def half_spaces(states: Array) -> HalfSpaces:
            more, deepest = np.zeros(len(states)) if demanded is None else demanded, rules.deepest_contact
            near = self._clearances(more).half_spaces(states)
            # What may be touched is looked at from the deepest contact on, and told with all of its depth.
            deep = np.where(near.least > deepest, near.least - deepest, near.least)
            parts = replace(near, least=deep), self._tool_half_spaces(states, more)
            columns = ((one.state, one.normal, one.least, one.cost) for one in parts)
            return HalfSpaces(*(np.concatenate(column) for column in zip(*columns, strict=True)))

        return LeastTimeProblem(
            self.section,
            np.append(base[0], limits.joint_velocity),
            np.append(base[1], limits.joint_acceleration),
            *self._bounds,
            half_spaces,
            self._back_on_path,
            self._tool_ways,
            self._tool_speed,
            self.parts,
        )

    def _clearances(self, demanded: Array) -> StateConstraints:
        scene, cost, margin = self.scene, OPTIONS.cost, OPTIONS.margin
        room = scene.robot, scene.collision, scene.footprint, None
        return StateConstraints(*room, demanded, cost, cost, margin, margin)

    @cached_property
    def _bare(self) -> LeastTimeProblem:
        return self.problem()

    @property
    def _places(self) -> tuple[Index, Array]:
        """Segments of places of half-spaces and shares of them, (p,) each."""
        return self._bare.places

    @property
    def segment(self) -> Index:
        """Segment that each place of half-spaces is on, (p,)."""
        return self._places[0]

    @cached_property
    def _bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of coordinates, (n, m) each."""
        scene, states = self.scene, self.timed.states
        chain, rules = with_joint_margin(scene.robot, scene.rules.criteria).chain, scene.rules
        lower, upper = np.full(states.shape, -np.inf), np.full(states.shape, np.inf)
        lower[:, 3:], upper[:, 3:] = (
            np.minimum(chain.lower, states[:, 3:]),
            np.maximum(chain.upper, states[:, 3:]),
        )
        fixed, worked = np.zeros(states.shape, dtype=bool), self.kind == "setpoint"
        fixed[:, 2] = rules.heading == "fixed"
        if rules.heading == "face_target" and has_pivot(scene.robot.chain):
            fixed[worked, 3 + pivot_index(scene.robot.chain)] = True
        if rules.criteria is not None and rules.criteria.beyond_limits:
            fixed[worked] = True
        if rules.mode == "stops":
            fixed[self.kind != "transit", :3] = True
        fixed[0] |= scene.start is not None
        return np.where(fixed, states, lower), np.where(fixed, states, upper)

    @cached_property
    def _tool_speed(self) -> Array:
        """Greatest speed of the tool on each segment, infinite for none, (n - 1,) [m/s]."""
        return self.limits.tool_speeds_to(approached(self.kind, self.owner), ~self.lifted)

    def _tool_ways(self, states: Array) -> tuple[Index, Array, Array]:
        """Ways of the tool on segments, in directions about its own; see `LeastTimeProblem`."""
        m = states.shape[1]
        slow = np.flatnonzero(np.isfinite(self._tool_speed) & (self.section >= 0))
        if not len(slow):
            return np.empty(0, dtype=np.int64), np.empty(0), np.empty((0, 2, m))
        frames, J = tool_jacobians(self.scene.robot, states)
        moved = frames[slow + 1, :3, 3] - frames[slow, :3, 3]
        along = moved / np.maximum(np.linalg.norm(moved, axis=1), OPTIONS.same)[:, None]
        directions = np.stack([_about(way) for way in along])
        segment, way = np.repeat(slow, directions.shape[1]), directions.reshape(-1, 3)
        by_end = [np.einsum("ki,kij->kj", way, J[segment + k, :3]) for k in (0, 1)]
        ways = np.einsum("ski,si->sk", directions, moved).ravel()
        return segment, ways, np.stack([-by_end[0], by_end[1]], axis=1)

    def _back_on_path(self, states: Array) -> Array:
        """Changes that bring the tool to its set-points, linear between them; see `LeastTimeProblem`."""
        worked = np.flatnonzero(self.kind == "setpoint")
        frames, J = tool_jacobians(self.scene.robot, states[worked])
        wanted = np.array([self.scene.task[i].position for i in self.owner[worked]])
        left, J = wanted - frames[:, :3, 3], J[:, :3] * (self._bounds[0] < self._bounds[1])[worked, None]
        far = np.linalg.norm(left, axis=1)
        most = OPTIONS.corrected_share * self.scene.rules.tolerance
        left *= (np.maximum(far - most, 0.0) / np.maximum(far, 1e-12))[:, None]
        square = J @ J.swapaxes(1, 2) + OPTIONS.damping * np.eye(3)
        change = (J.swapaxes(1, 2) @ np.linalg.solve(square, left[..., None]))[..., 0]
        time = np.concatenate([[0.0], np.cumsum(self.section >= 0)])
        return np.stack([np.interp(time, time[worked], column) for column in change.T], axis=1)

    def _tool_half_spaces(self, states: Array, demanded: Array) -> HalfSpaces:
        """Half-spaces that keep the tool on its path, its axis or frame in its cone."""
        place, direction, most, wide = self._corridor
        wanted = np.minimum(demanded[place], OPTIONS.most_narrowed * wide)
        missed = missed_by(self.scene.robot, self._aims, states)
        tool = self._aims.positions - missed.miss[:, :3]
        normal = -np.einsum("ki,kij->kj", direction, missed.J[place, :3])
        least = np.einsum("ki,ki->k", direction, tool[place]) - most + wanted
        at, way = self._turns
        turn = np.einsum("ki,kij->kj", way, missed.J[at, 3:])
        left = np.einsum("ki,ki->k", way, missed.miss[at, 3:])
        beyond = left - ANGLE_LENGTH * OPTIONS.cone_share * self._aims.cones[at]
        rows = np.concatenate([place, at])
        cost = np.full(len(rows), OPTIONS.cost)
        return HalfSpaces(rows, np.concatenate([normal, turn]), np.concatenate([least, beyond]), cost)

    @cached_property
    def _aims(self) -> Aims:
        """Of each place; with the tool lifted that of the state before, which is not asked for."""
        task, (segment, share) = self.scene.task, self._places
        aims, none = [], replace(task[0], direction=None, orientation=None)
        first, count = self._section_ends
        for k, s in zip(segment.tolist(), share.tolist(), strict=True):
            i, j = self._between_setpoints(k)
            if self._free[k, int(s > 0) + int(s >= 1)]:
                aims.append(aim_of(none))
            else:
                aims.append(aim_of(goal_between(task[i], task[j], (k - first[k] + s) / count[k])))
        return in_columns(aims)

    @cached_property
    def _turns(self) -> tuple[Index, Array]:
        """Places in which the tool's axis or frame is asked for, and directions of turns from it."""
        aims = self._aims
        ways = [
            _across(turn[:, 2]) if kind == DIRECTION else _DIRECTIONS if kind else _DIRECTIONS[:0]
            for kind, turn in zip(aims.kinds.tolist(), aims.turns, strict=True)
        ]
        return np.repeat(np.arange(len(ways)), [len(one) for one in ways]), np.concatenate(ways)

    @cached_property
    def _section_ends(self) -> tuple[Index, Index]:
        """First segment of the way between two set-points that each segment is on, and how many it has."""
        worked = np.flatnonzero(self.kind == "setpoint")
        way = np.searchsorted(worked, np.arange(len(self.section)), side="right")
        first = np.concatenate([[0], worked])[way]
        last = np.append(worked, len(self.section))[way]
        return first, np.maximum(last - first, 1)

    def _between_setpoints(self, k: int) -> tuple[int, int]:
        """Set-points that the path on a segment leads from and to."""
        known = self.kind[: k + 1] == "setpoint"
        last, task = int(np.flatnonzero(known)[-1]) if known.any() else -1, self.scene.task
        i = int(self.owner[last]) if last >= 0 else 0
        return i, min(i + (last >= 0), len(task) - 1)

    @cached_property
    def _free(self) -> Mask:
        """Whether the tool is lifted at the start of each segment, on it and at its end, (n - 1, 3)."""
        lifted = self.kind == "transit"
        return np.column_stack([lifted[:-1], self.lifted, lifted[1:]])

    @cached_property
    def _corridor(self) -> tuple[Index, Array, Array, Array]:
        """Places, directions (k, 3), how far the tool may go in these and be off its path, (k,) [m]."""
        task, rules = self.scene.task, self.scene.rules
        near, far = OPTIONS.tool_share * rules.tolerance, OPTIONS.tool_share * rules.planned_path_tolerance
        if rules.contact_depth > 0:  # it must not sink in deeper
            near = far = OPTIONS.contact_share * rules.tolerance
        place, direction, most, wide = list[int](), list[Array](), list[float](), list[float]()

        def add(p: int, ways: Array, at: Array, radius: float) -> None:
            place.extend([p] * len(ways))
            direction.extend(ways)
            most.extend((at + radius).tolist())
            wide.extend([radius] * len(ways))

        for p, (k, s) in enumerate(zip(*(one.tolist() for one in self._places), strict=True)):
            if self._free[k, int(s > 0) + int(s >= 1)]:
                continue
            state = k + int(s >= 1)
            if s in (0.0, 1.0) and self.kind[state] == "setpoint":
                add(p, _DIRECTIONS, _DIRECTIONS @ task[self.owner[state]].position, near)
                continue
            i, j = self._between_setpoints(k)
            way = task[j].position - task[i].position
            length = float(np.linalg.norm(way))
            if length <= 1e-9:
                add(p, _DIRECTIONS, _DIRECTIONS @ task[i].position, far)
                continue
            along, across = way / length, _across(way / length)
            add(p, across, across @ task[i].position, far)
            ends = np.array([along @ task[j].position, -along @ task[i].position])
            add(p, np.stack([along, -along]), ends, 0.0)
        return (
            np.array(place, dtype=np.int64),
            np.array(direction).reshape(-1, 3),
            np.array(most),
            np.array(wide),
        )

    def motion(self, timed: TimedStates) -> Motion:
        """The states, and more between them, as a motion that is not timed."""
        chain = self.scene.robot.chain
        parts = np.where(
            self.section >= 0, np.ceil(timed.spans[self.section] / OPTIONS.state_period), 1
        ).astype(int)
        segment = np.repeat(np.arange(len(parts)), parts)
        first = np.concatenate([[0], np.cumsum(parts)])
        share = (np.arange(first[-1]) - first[segment]) / parts[segment]
        states = states_between(self._bare, timed, segment, share)
        states = np.concatenate([states, timed.states[-1:]])
        states[first] = timed.states
        still = self._bare.still[segment] & (timed.states[segment] == timed.states[segment + 1])
        states[:-1] = np.where(still, timed.states[segment], states[:-1])
        joints = np.clip(states[:, 3:], chain.lower, chain.upper)
        kind = np.append(np.where(self.lifted, "transit", "step")[segment], "step").astype(self.kind.dtype)
        kind[first] = self.kind
        again = 1 + np.flatnonzero((self.section < 0) & (self.owner[1:] == self.owner[:-1]))  # where it rests
        following = self.kind[np.minimum(again + 1, len(self.kind) - 1)]
        kind[first[again]] = np.where(following == "setpoint", "step", following)
        owner = np.append(self.owner[:-1][segment], self.owner[-1])
        turns = 2 * np.pi * np.round(states[:, 2] / (2 * np.pi))
        base = np.column_stack([states[:, :2], states[:, 2] - turns])
        return Motion(base, joints, kind, owner, np.full(len(base), np.nan))

    def near(self, timed: TimedStates, found: Plan, report: Report) -> Index:
        """Places next to states in which a plan breaks a rule."""
        at = states_between(self._bare, timed, *self._places)
        broken, beside = set[int](), OPTIONS.places_beside
        for one in report.violations:
            if one.state is not None:
                state = np.append(found.motion.base[one.state, :2], found.motion.joints[one.state])
                k = int(np.argmin(np.linalg.norm(np.delete(at, 2, axis=1) - state, axis=1)))
                broken.update(range(max(k - beside, 0), min(k + beside + 1, len(at))))
        return np.array(sorted(broken), dtype=np.int64)


class _Block(NamedTuple):
    """Some states, one after the other."""

    states: Array
    rates: Array
    kind: NDArray[np.str_]
    owner: Index


def _layout(limits: MotionLimits, plan: Plan) -> _TimedLayout:
    """A timed plan's states as they are optimised."""
    motion, course = plan.motion, trajectory(plan)
    q, time, lifted = path_of(limits.robot, motion).coordinates, motion.time, motion.kind == "transit"
    ends, edge = _ends(motion, q)
    resting = bool(np.isfinite(limits.tool_speeds(motion)).any()) or bool(plan.stops)
    blocks = [_Block(q[:1], 0 * q[:1], motion.kind[:1], motion.setpoint[:1])]
    section, spans, up = list[int](), list[float](), list[bool]()
    for a, b in pairwise(ends.tolist()):
        if resting and a > 0 and edge[a] and section[-1] >= 0:
            blocks.append(_Block(q[a : a + 1], 0 * q[:1], motion.kind[a : a + 1], motion.setpoint[a : a + 1]))
            section.append(-1)
            up.append(up[-1])
        flight, span = bool(lifted[a : b + 1].any()), float(time[b] - time[a])
        moves = bool((np.abs(np.diff(q[a : b + 1], axis=0)) > OPTIONS.same).any())
        count = max(1 + flight, int(np.ceil(span / OPTIONS.period))) if moves else 1
        section += [len(spans)] * count if moves else [-1]
        spans += [span / count] if moves else []
        up += [flight] * count
        states, rates, _ = course.sample(np.linspace(time[a], time[b], count + 1)[1:]).columns
        kind = np.append(np.repeat("transit" if flight else "step", count - 1), motion.kind[b])
        owner = np.append(np.repeat(motion.setpoint[min(a + 1, b - 1)], count - 1), motion.setpoint[b])
        states[-1] = q[b]
        constant = (np.abs(q[a : b + 1] - q[a]) <= OPTIONS.same).all(axis=0)
        states[:, constant], rates[:, constant] = blocks[-1].states[-1, constant], 0.0
        blocks.append(_Block(states, rates, kind, owner))
    states, rates, kind, owner = (np.concatenate(column) for column in zip(*blocks, strict=True))
    return _TimedLayout(
        scene_of(plan.world),
        limits,
        TimedStates(states, rates, np.array(spans)),
        kind,
        owner,
        np.array(section, dtype=np.int64),
        np.array(up, dtype=bool),
        OPTIONS.parts,
    )


def _ends(motion: Motion, q: Array) -> tuple[Index, Mask]:
    """States at which sections end, and which are at ends of ways with the tool lifted.

    Of states given twice, at which the robot rests, the first is one.
    """
    lifted, worked = motion.kind == "transit", motion.kind == "setpoint"
    edge = ~lifted & (np.append(lifted[1:], False) | np.append(False, lifted[:-1]))
    again = np.append(False, ~np.diff(q, axis=0).any(axis=1))
    ends = worked | (edge & ~again)
    ends[[0, -1]] = True
    return np.flatnonzero(ends), edge


def _about(way: Array) -> Array:
    """Unit vectors about a unit vector (3,), itself the first, (k, 3)."""
    across = _across(way)
    found = np.concatenate([way[None], *(way + share * across for share in OPTIONS.about)])
    ways: Array = found / np.linalg.norm(found, axis=1)[:, None]
    return ways


def _across(way: Array) -> Array:
    """Unit vectors all round across a unit vector (3,), (sides, 3)."""
    one = np.cross(way, np.eye(3)[int(np.argmin(np.abs(way)))])
    one = one / np.linalg.norm(one)
    turn = 2 * np.pi * np.arange(OPTIONS.sides)[:, None] / OPTIONS.sides
    found: Array = np.cos(turn) * one + np.sin(turn) * np.cross(way, one)
    return found
