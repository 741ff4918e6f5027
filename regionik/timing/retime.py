"""Timing of plans: the fastest motion close to a plan's, within limits of speed, acceleration and jerk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from regionik.planners.progress import track
from regionik.timing.inserted_states import blended, refined, with_rests
from regionik.timing.jerk_limited_timing import jerk_limited_motion
from regionik.timing.limits import (
    MotionLimits,
    check_tool_speed,
    largest_slowdown,
    motion_limits,
    timing_figures,
)
from regionik.timing.parametrization import fastest_times, path_of
from regionik.values import Motion, Plan
from regionik.verification.verifier import verify
from regionik.worlds.errors import InputError
from regionik.worlds.robot import Robot
from regionik.worlds.speeds import Speeds

BLEND = 2e-4  # by which any point of the robot may leave the plan's motion on the smooth path [m]
SLOWDOWNS, SPARE = 5, 1e-4  # of the whole motion, and by how much more
TRIES = 4  # with more states to rest at


def retime(plan: Plan, speeds: Speeds | None = None, *, blend: float = BLEND, hold: bool = False) -> Plan:
    """Time a plan: as fast as speeds, accelerations and jerks allow, from rest to rest.

    The robot goes on a smooth path through the plan's states, whose points stay within ``blend`` of the
    motion that was verified; it rests at sharp corners, and where its rounded motion would break a rule of
    the plan. States are inserted where the path bends or its acceleration, constant between two, changes.

    Parameters
    ----------
    plan : Plan
    speeds : Speeds, optional
        By default those of the plan's world, or of its robot.
    blend : float
        [m]
    hold : bool
        Refuse a tool speed that joints or base cannot give the tool everywhere on the path; without it the
        tool is slower there, and ``stats`` says where.

    Returns
    -------
    Plan
        With the time of every state, and these speeds in its world; verified. ``stats["timing"]`` has the
        duration, the share used of each limit, and where an asked tool speed is not held.

    Raises
    ------
    InputError
        For limits that are not above 0 or not as many as joints, for a plan without states or one that breaks
        its own rules, and for a tool speed that cannot be held where that is asked.

    Examples
    --------
    >>> from regionik.pipeline import plan
    >>> from regionik.worlds.documents.world_file import load_world
    >>> timed = retime(plan(load_world("free")), Speeds(base_velocity=0.2))
    >>> bool(timed.motion.time[0] == 0.0), bool((np.diff(timed.motion.time) >= 0).all())
    (True, True)
    """
    if not len(plan.motion):
        raise InputError("plan: it has no states to be timed")
    if not 0 < blend < np.inf:
        raise InputError(f"blend: must be above 0, got {blend:g}")
    asked = speeds or plan.world.speeds or Speeds()
    limits = motion_limits(plan.world.robot, asked)
    motion = with_rests(plan.motion, path_of(limits.robot, plan.motion).corners)
    stats = {key: value for key, value in plan.stats.items() if key not in ("margins", "timing")}
    plan = replace(plan, world=replace(plan.world, speeds=asked))
    for _ in track("timing", range(TRIES)):
        timed = replace(plan, motion=_timed(limits, motion, blend), stats=stats)
        report = verify(timed)
        if report.ok:
            if hold:
                check_tool_speed(limits, timed.motion)
            found = {"margins": report.margins, "timing": timing_figures(limits, timed.motion, blend)}
            return replace(timed, stats={**stats, **found})
        states = [v.state for v in report.violations if v.state is not None]
        motion = with_rests(motion, _inner_states(limits.robot, motion, timed.motion, states))
    raise InputError(
        "plan: its motion breaks its own rules, so no smooth motion next to it keeps them; verify it"
    )


def _timed(limits: MotionLimits, motion: Motion, blend: float) -> Motion:
    """Motion with times, through its own states and more; a single state has time 0."""
    if len(motion) == 1:
        return replace(motion, time=np.zeros(1))
    fine = blended(limits, refined(limits, blended(limits, motion, blend)), blend)
    if limits.speeds.limit_jerk:
        motion = jerk_limited_motion(limits, fine, blend)
    else:
        motion = replace(fine, time=fastest_times(limits, fine))
    for _ in range(SLOWDOWNS):
        factor = largest_slowdown(limits, motion)
        if factor <= 1.0:
            break
        motion = replace(motion, time=motion.time * factor * (1 + SPARE))
    return motion


def _inner_states(robot: Robot, motion: Motion, timed: Motion, broken: list[int]) -> NDArray[np.int64]:
    """States within those runs of a motion that break a rule at states of the timed one."""
    ends = [b for _, b in path_of(robot, timed).runs]
    runs = np.unique(np.searchsorted(ends, broken))
    own = path_of(robot, motion).runs
    inner = [np.arange(own[k][0] + 1, own[k][1]) for k in runs.tolist() if k < len(own)]
    return np.concatenate([np.empty(0, dtype=np.int64), *inner])
