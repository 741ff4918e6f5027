"""Curves of a motion over its time: joints, speeds, distances from solids, and what holds at set-points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from regionik.planners.collision.proximity import nearest
from regionik.planners.collision.robot_bodies import Bodies, ContactTargets, bodies_from
from regionik.scene import scene_of
from regionik.timing.limits import tool_velocity
from regionik.timing.trajectory import TrajectorySample, is_timed, trajectory
from regionik.values import Motion, Plan
from regionik.verification.base_clearance import base_shadows, footprint_hulls
from regionik.view.options import VIEW
from regionik.worlds.arrays import Array
from regionik.worlds.drives import unwrapped
from regionik.worlds.robot import Robot
from regionik.worlds.scene import World

OPTIONS = VIEW.curves


@dataclass(frozen=True, eq=False)
class Clearances:
    """Distances at some poses, (n,) each [m]; infinite where there is nothing to avoid."""

    base: Array  # footprint to the shadow of the nearest solid that the base could hit
    arm: Array  # the robot's solids to the nearest of the world, apart from allowed contact of the tool
    own: Array  # the robot's solids to each other and to its base, where these have to keep apart


def clearances(world: World, base: Array, joints: Array) -> Clearances:
    """Return the distances at base poses (n, 3) and joint values (n, dof)."""
    nothing = np.full(len(base), np.inf)
    contact = scene_of(world).collision.contact
    return Clearances(
        base=_base_clearance(world, base),
        arm=_distances(bodies_around(world), base, joints, contact) if world.arm_solids else nothing,
        own=_distances(bodies_from(world.robot, ()), base, joints, None),
    )


def bodies_around(world: World) -> Bodies:
    """A robot among the solids of its world, with nothing of its own that has to keep apart."""
    robot = world.robot
    pairs = tuple(combinations([solid.name for solid in robot.all_solids], 2))
    apart = replace(robot, footprint=np.zeros((1, 2)), unchecked=pairs)
    return bodies_from(apart, world.solids, floor=world.floor_slab)


def _distances(bodies: Bodies, base: Array, joints: Array, contact: ContactTargets | None) -> Array:
    """Least distance at every pose, negative where something overlaps, (n,) [m]."""
    pairs = zip(base, joints, strict=True)
    return np.array([nearest(bodies, at, q, contact=contact).distance for at, q in pairs])


def _base_clearance(world: World, base: Array) -> Array:
    """Footprint to the nearest shadow at every pose, 0 where they meet, (n,) [m]."""
    shown = [shadow for _, shadow in base_shadows(world)]
    nearest_shadow = np.full(len(base), np.inf)
    prints = footprint_hulls(world.robot, base)
    for radius in sorted({shadow.radius for shadow in shown}):
        cores = shapely.STRtree([shadow.core for shadow in shown if shadow.radius == radius])
        which, distance = cores.query_nearest(prints, return_distance=True, all_matches=False)
        nearest_shadow[which[0]] = np.minimum(nearest_shadow[which[0]], distance - radius)
    clearance: Array = np.maximum(nearest_shadow, 0.0)
    return clearance


@dataclass(frozen=True, eq=False)
class Timeline:
    """Curves of a motion over the time in which it is shown."""

    timed: bool  # the time shown is the plan's own
    times: Array  # (n,) of samples, set-points among them [s]
    base: Array  # (n, 3) x, y [m], yaw [rad]
    joints: Array  # (n, dof) [rad], [m]
    joint_kinds: tuple[tuple[str, str], ...]  # name and kind of each joint
    speeds: dict[str, Array]  # (n,) each [m/s]; none where the plan is not timed
    measured: Array  # (m,) times at which distances are measured, set-points among them [s]
    clearances: Clearances  # (m,) each
    setpoints: Array  # (k,) when each set-point is reached [s]
    areas: Array  # (k, 2) for the whole path, and admissible [m2]; empty where a plan file holds none
    lifted: Array  # (l, 2) intervals in which the tool is lifted [s]


def timeline(plan: Plan, clock: Array) -> Timeline:
    """Return the curves of a plan whose states are shown at the times of a ``clock`` (n,) [s]."""
    motion, robot = plan.motion, plan.world.robot
    at = clock[motion.kind == "setpoint"]
    grid = np.linspace(clock[0], clock[-1], OPTIONS.samples) if clock[-1] > clock[0] else clock[:1]
    times, measured = np.union1d(grid, at), np.union1d(grid[:: OPTIONS.distance_stride], at)
    speeds: dict[str, Array] = {}
    if is_timed(motion):
        sample = trajectory(plan).sample(times)
        poses = np.column_stack([sample.base, sample.joints])
        speeds = _tool_and_base_speeds(robot, sample)
    else:
        index = np.interp(times, clock, np.arange(len(clock)))
        base = robot.drive.sampled(unwrapped(motion.base), index)
        poses = np.column_stack([base, *(np.interp(times, clock, column) for column in motion.joints.T)])
    rows = np.searchsorted(times, measured)
    return Timeline(
        timed=is_timed(motion),
        times=times,
        base=poses[:, :3],
        joints=poses[:, 3:],
        joint_kinds=tuple((joint.name, joint.kind) for joint in robot.chain.active_joints),
        speeds=speeds,
        measured=measured,
        clearances=clearances(plan.world, poses[rows, :3], poses[rows, 3:]),
        setpoints=at,
        areas=np.array([[area.pruned.area, area.admissible.area] for area in plan.areas]).reshape(-1, 2),
        lifted=_lifted_intervals(motion, clock),
    )


def _tool_and_base_speeds(robot: Robot, sample: TrajectorySample) -> dict[str, Array]:
    """Speeds of the tool's and the base's origin at n samples, (n,) each [m/s]."""
    tool = tool_velocity(robot, *sample.columns[:2])
    return {"tool": np.linalg.norm(tool, axis=1), "base": np.hypot(*sample.base_velocity[:, :2].T)}


def _lifted_intervals(motion: Motion, clock: Array) -> Array:
    """Intervals of transits, the motions to and from them included, (l, 2)."""
    transit = motion.kind == "transit"
    lifted: NDArray[np.bool_] = transit[:-1] | transit[1:]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], lifted, [False]])))
    spans: Array = clock[edges].reshape(-1, 2)
    return spans


def timeline_document(curves: Timeline) -> dict[str, Any]:
    """Return a timeline as JSON, each curve a list; null stands for what is infinite."""
    distances = {
        "base to solids": curves.clearances.base,
        "arm to solids": curves.clearances.arm,
        "arm to itself": curves.clearances.own,
    }
    return {
        "timed": curves.timed,
        "times": _numbers(curves.times),
        "base": [_numbers(column) for column in curves.base.T],
        "joints": [_numbers(column) for column in curves.joints.T],
        "jointKinds": [list(row) for row in curves.joint_kinds],
        "speeds": {name: _numbers(values) for name, values in curves.speeds.items()},
        "measured": _numbers(curves.measured),
        "clearances": {
            name: _numbers(values) for name, values in distances.items() if np.isfinite(values).any()
        },
        "setpoints": _numbers(curves.setpoints),
        "areas": [_numbers(row) for row in curves.areas],
        "lifted": [_numbers(row) for row in curves.lifted],
    }


def _numbers(values: Array) -> list[float | None]:
    return [round(value, OPTIONS.digits) + 0.0 if np.isfinite(value) else None for value in values.tolist()]


@dataclass(frozen=True, eq=False)
class PlanCurves:
    """Curves of a plan along its motion."""

    timed: bool  # abscissas are times [s]; else numbers of states, from 1
    states: Array  # (n,) abscissa of every state
    along: Array  # (m,) abscissas of ``joints``, ``velocities`` and ``speeds``
    joints: Array  # (m, dof)
    velocities: Array  # (m, dof) of joints [rad/s], [m/s]; no rows where the plan is not timed
    speeds: dict[str, Array]  # (m,) of tool and base [m/s]; none where the plan is not timed
    clearances: Clearances
    setpoints: Array  # (k,) abscissas of set-points
    lifted: Array  # (l, 2) intervals in which the tool is lifted


def plan_curves(plan: Plan) -> PlanCurves:
    """Return the curves of a plan."""
    motion, timed = plan.motion, is_timed(plan.motion)
    states = motion.time if timed else np.arange(1.0, len(motion) + 1)
    along, joints, velocities, speeds = states, motion.joints, motion.joints[:0], dict[str, Array]()
    if timed:
        along = np.union1d(states, np.linspace(0.0, states[-1], OPTIONS.timed_samples))
        sample = trajectory(plan).sample(along)
        joints, velocities = sample.joints, sample.joint_velocity
        speeds = _tool_and_base_speeds(plan.world.robot, sample)
    return PlanCurves(
        timed=timed,
        states=states,
        along=along,
        joints=joints,
        velocities=velocities,
        speeds=speeds,
        clearances=clearances(plan.world, motion.base, motion.joints),
        setpoints=states[motion.kind == "setpoint"],
        lifted=_lifted_intervals(motion, states),
    )
