"""The figures of a motion that a viewer tells beside its time bar: curves, and what holds at set-points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regionik.timing.limits import tool_velocity
from regionik.timing.trajectory import TrajectorySample, is_timed, trajectory
from regionik.values import Motion, Plan
from regionik.view.clearance import Clearances, clearances
from regionik.worlds.arrays import Array
from regionik.worlds.drives import unwrapped
from regionik.worlds.robot import Robot

SAMPLES = 600  # of a motion, at even times
STRIDE = 2  # of samples, from one at which distances are measured to the next
_DIGITS = 5


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
    grid = np.linspace(clock[0], clock[-1], SAMPLES) if clock[-1] > clock[0] else clock[:1]
    times, measured = np.union1d(grid, at), np.union1d(grid[::STRIDE], at)
    speeds: dict[str, Array] = {}
    if is_timed(motion):
        sample = trajectory(plan).sample(times)
        poses = np.column_stack([sample.base, sample.joints])
        speeds = tool_and_base_speeds(robot, sample)
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
        lifted=lifted_intervals(motion, clock),
    )


def tool_and_base_speeds(robot: Robot, sample: TrajectorySample) -> dict[str, Array]:
    """Speeds of the tool's and the base's origin at n samples, (n,) each [m/s]."""
    tool = tool_velocity(robot, *sample.columns[:2])
    return {"tool": np.linalg.norm(tool, axis=1), "base": np.hypot(*sample.base_velocity[:, :2].T)}


def lifted_intervals(motion: Motion, clock: Array) -> Array:
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
    return [round(value, _DIGITS) + 0.0 if np.isfinite(value) else None for value in values.tolist()]
