"""The motion with the tool on its path, made smooth: base and arm of a whole run optimised together.

What the search found is a way round things, not a way to drive: it goes to the nearest place again and
again. Here each run is laid out evenly along the tool's path and smoothed by `path_smoothing`, and the plan
is proven. Where a check fails, the states near it are asked to keep farther off, then are held closer to what
the search found; a run that cannot be proven stays as it was.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import shapely

from regionik.areas.free_space import FreeSpace
from regionik.moving.path_search import transit_planner
from regionik.moving.transit import TransitPlanner
from regionik.planners.geometry.angles import wrap
from regionik.planners.progress import track
from regionik.postures.poses import Pose, arrays, axis_of, lifted_states, transits, untimed_motion
from regionik.scene import Scene
from regionik.smoothing.options import SMOOTHING
from regionik.smoothing.runs import PathRun, runs_of
from regionik.values import Motion, Plan, Report
from regionik.verification.verifier import verify
from regionik.worlds.arrays import Array

AREA_ROUNDING = 1e-9  # of its area, by rounding [m]
OPTIONS = SMOOTHING.trials

Failed = dict[int, list[int]]  # states that failed, by run


def smooth_motion(scene: Scene, plan: Plan, free_space: FreeSpace) -> Plan:
    """Return a plan that is not timed with smoother motion while the tool is on its path, verified.

    It is returned itself, and not verified, where nothing could be made smoother.
    """
    way, drive = np.diff([target.position for target in scene.task], axis=0), scene.robot.drive
    long = float(np.linalg.norm(way, axis=1).sum()) > OPTIONS.long_path and drive.turns_on_the_spot
    lifted = any(transits(plan.motion)) and not drive.rolls
    rejoin = Reconnection(transit_planner(scene, free_space, plan.seed), free_space)
    for stride, loose in product(OPTIONS.strides[not long :], (True, False)[not lifted :]):
        runs = [
            run
            for run in runs_of(scene, plan, free_space, stride, loose)
            if len(run.states) >= SMOOTHING.layout.min_run_states
        ]
        plan, complete = _proven(plan, runs, rejoin)
        if complete:
            break
    return plan


def _proven(plan: Plan, runs: list[PathRun], rejoin: Reconnection) -> tuple[Plan, bool]:
    """The plan with those runs smoothed that can be proven so, and whether all of them were."""
    tubes = [np.full(len(run.states), np.inf) for run in runs]
    demanded = [np.zeros(len(run.states)) for run in runs]
    smoothed, failed = [run.smoothed() for run in track("smoothing", runs)], Failed()
    for attempt in range(OPTIONS.max_tries):
        for k, rows in track("smoothing", list(failed.items())):
            if attempt > 1:
                tubes[k] = _narrowed_tube(runs[k], smoothed[k], tubes[k], rows)
            for row in rows:  # what a hop cuts off is less than this, mostly
                demanded[k][_beside(row)] = OPTIONS.spare_distance
            smoothed[k] = runs[k].mended(smoothed[k], rows, tubes[k], demanded[k])
        found, failed = _checked(plan, runs, smoothed, rejoin)
        if found is not None:
            return found, True
        if not failed:
            return plan, False
    kept = [k for k in range(len(runs)) if k not in failed]
    found, _ = _checked(plan, [runs[k] for k in kept], [smoothed[k] for k in kept], rejoin)
    return found or plan, False


def _checked(
    plan: Plan, runs: list[PathRun], smoothed: list[Array], rejoin: Reconnection
) -> tuple[Plan | None, Failed]:
    """The plan with smoothed runs, if it holds, and the states of each run where it does not."""
    found = _rebuilt(plan, runs, smoothed, rejoin)
    if found is None:
        return None, {}
    report, failed = verify(found), Failed()
    for k, row in _failures(plan, found, report, runs, smoothed):
        failed.setdefault(k, []).append(row)
    if failed or not report.ok:
        return None, failed
    return replace(found, stats={**found.stats, "margins": report.margins}), failed


def _rebuilt(plan: Plan, runs: list[PathRun], smoothed: list[Array], rejoin: Reconnection) -> Plan | None:
    old, done, parts = plan.motion, 0, list[Motion]()
    setpoints = list(plan.setpoints)
    for run, states in zip(runs, smoothed, strict=True):
        parts.append(old.part(done, run.first))
        shared = int(run.first < done)  # where a long run was cut both of its parts have the state
        parts.append(_columns(run, states).part(shared, len(states)))
        done = run.last + 1
        bases, joints = _wrapped(states[run.worked]), states[run.worked, 3:]
        tools = plan.world.robot.tool(bases, joints)[:, :3, 3]
        owners = run.owner[run.worked].tolist()
        for i, base, posture, tool in zip(owners, bases, joints, tools, strict=True):
            error = math.dist(tool, plan.world.task[i].position)
            setpoints[i] = replace(setpoints[i], base=base, joints=posture, error=error)
    motion = rejoin.joined(old, Motion.joined([*parts, old.part(done, len(old))]))
    if motion is None:
        return None
    stats = {key: value for key, value in plan.stats.items() if key != "margins"}
    stats["states"], stats["base_travel"] = len(motion), plan.world.robot.drive.travel(motion.base)
    stats["largest_error"] = float(max(found.error for found in setpoints))
    return replace(plan, motion=motion, setpoints=tuple(setpoints), stats=stats)


def _columns(run: PathRun, states: Array) -> Motion:
    kind = np.where(run.worked, "setpoint", "step")
    return Motion(_wrapped(states), states[:, 3:], kind, run.owner, np.full(len(states), np.nan))


def _wrapped(states: Array) -> Array:
    base = states[:, :3].copy()
    base[:, 2] = [wrap(yaw) for yaw in base[:, 2].tolist()]
    return base


def _failures(
    plan: Plan, after: Plan, report: Report, runs: list[PathRun], smoothed: list[Array]
) -> Iterator[tuple[int, int]]:
    """Runs and states in them that a report is about, or that stand outside their area."""
    before, now = (np.flatnonzero(one.motion.kind != "transit") for one in (plan, after))
    shift, starts = 0, list[int]()
    for run, states in zip(runs, smoothed, strict=True):
        starts.append(int(now[np.searchsorted(before, run.first) + shift]))
        shift += len(states) - (run.last + 1 - run.first)
    for violation in report.violations:
        for k, (start, states) in enumerate(zip(starts, smoothed, strict=True)):
            if violation.state is not None and start - 1 <= violation.state <= start + len(states):
                yield k, min(max(violation.state - start, 0), len(states) - 1)
    if after.world.robot.drive.rolls:  # areas are those of a base that goes every way
        return
    for k, (run, states) in enumerate(zip(runs, smoothed, strict=True)):
        worked = np.flatnonzero(run.worked)
        was, now = (
            shapely.distance(run.areas, shapely.points(axis_of(after.world.robot, one[worked, :3])))
            for one in (run.states, states)
        )
        yield from ((k, int(row)) for row in worked[now > np.maximum(was, AREA_ROUNDING)])


def _narrowed_tube(run: PathRun, smoothed: Array, tube: Array, rows: list[int]) -> Array:
    """The tube narrower about states that failed."""
    changed = np.abs(smoothed - run.states).max(axis=1)
    narrow = tube.copy()
    for row in rows:
        beside = _beside(row)
        narrow[beside] = np.minimum(narrow[beside], OPTIONS.narrowing_factor * changed[beside])
    return narrow


def _beside(row: int) -> slice:
    return slice(max(0, row - OPTIONS.states_beside), row + OPTIONS.states_beside + 1)


@dataclass(frozen=True, eq=False)
class Reconnection:
    """Moves the robot with its tool lifted to where runs begin now."""

    planner: TransitPlanner
    free_space: FreeSpace
    # Ways that were looked for, by their ends and the old way: mostly only states between them are mended
    _ways: dict[bytes, list[Pose] | None] = field(default_factory=dict)

    def joined(self, old: Motion, new: Motion) -> Motion | None:
        """The new motion, its ways with the tool lifted led to where they have to be now; None without one.

        They are those of the old motion, which has as many, where their ends have not moved.
        """
        parts, done = list[Motion](), 0
        for was, now in zip(transits(old), transits(new), strict=True):
            here, there = _ends(new, now)
            if all(map(_same, _ends(old, was), (here, there))):
                continue
            way = self._known_way(here, there, [_pose(old, k) for k in range(was.start - 1, was.stop + 1)])
            if way is None:
                return None
            owner, drive = int(new.setpoint[now.start - 1]), self.planner.scene.robot.drive
            rows = lifted_states(here, way, there, owner, drive)
            parts += [new.part(done, now.start), *([untimed_motion(rows)] if rows else [])]
            done = now.stop
        return Motion.joined([*parts, new.part(done, len(new))])

    def _known_way(self, here: Pose, there: Pose, old: list[Pose]) -> list[Pose] | None:
        key = np.hstack(arrays([here, there, *old])).tobytes()
        if key not in self._ways:
            self._ways[key] = self._way(here, there, old)
        return self._ways[key]

    def _way(self, here: Pose, there: Pose, old: list[Pose]) -> list[Pose] | None:
        piece = self.free_space.piece_at(axis_of(self.planner.scene.robot, here.base), float(here.base[2]))
        return None if piece is None else self.planner.rejoined(here, old, there, piece)


def _ends(motion: Motion, rows: slice) -> tuple[Pose, Pose]:
    return _pose(motion, rows.start - 1), _pose(motion, rows.stop)


def _pose(motion: Motion, k: int) -> Pose:
    return Pose(motion.base[k], motion.joints[k])


def _same(one: Pose, other: Pose) -> bool:
    return bool((one.base == other.base).all() and (one.joints == other.joints).all())
