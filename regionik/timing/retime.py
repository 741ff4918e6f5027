"""Timing of plans: the fastest motion close to a plan's, within limits of speed and acceleration."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from regionik.timing.limits import (
    MotionLimits,
    check_tool_speed,
    largest_slowdown,
    motion_limits,
    timing_figures,
)
from regionik.timing.parametrization import fastest_rates, fastest_times, path_of
from regionik.values import Motion, Plan
from regionik.verification.verifier import verify
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.robot import Robot
from regionik.worlds.speeds import Speeds

BLEND = 2e-4  # by which any point of the robot may leave the plan's motion on the smooth path [m]
ROUNDS = 30  # of inserting states until the smooth path keeps to the plan
COMPARED_SHARES = (0.25, 0.5, 0.75)  # of a segment, where the smooth path is compared with it
PERIOD = 0.02  # of the fine timing that shows where states are needed [s]
VELOCITY_ERROR = 0.002  # share of the squared path velocity by which it may be off the fine one
SLOWDOWNS, SPARE = 5, 1e-4  # of the whole motion, and by how much more
TRIES = 4  # with more states to rest at


def retime(plan: Plan, speeds: Speeds | None = None, *, blend: float = BLEND, hold: bool = False) -> Plan:
    """Time a plan: as fast as speeds and accelerations allow, from rest to rest.

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
    motion = _with_rests(plan.motion, path_of(limits.robot, plan.motion).corners)
    stats = {key: value for key, value in plan.stats.items() if key not in ("margins", "timing")}
    plan = replace(plan, world=replace(plan.world, speeds=asked))
    for _ in range(TRIES):
        timed = replace(plan, motion=_timed(limits, motion, blend), stats=stats)
        report = verify(timed)
        if report.ok:
            if hold:
                check_tool_speed(limits, timed.motion)
            found = {"margins": report.margins, "timing": timing_figures(limits, timed.motion, blend)}
            return replace(timed, stats={**stats, **found})
        states = [v.state for v in report.violations if v.state is not None]
        motion = _with_rests(motion, _inner_states(limits.robot, motion, timed.motion, states))
    raise InputError(
        "plan: its motion breaks its own rules, so no smooth motion next to it keeps them; verify it"
    )


def _timed(limits: MotionLimits, motion: Motion, blend: float) -> Motion:
    """Motion with times, through its own states and more; a single state has time 0."""
    if len(motion) == 1:
        return replace(motion, time=np.zeros(1))
    motion = _blended(limits, motion, blend)
    motion = _blended(limits, _refined(limits, motion), blend)
    motion = replace(motion, time=fastest_times(limits, motion))
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


def _refined(limits: MotionLimits, motion: Motion) -> Motion:
    """Motion with states inserted on its smooth path where the path acceleration changes.

    A fine timing shows where: between two states that are kept its acceleration is nearly constant.
    """
    path = path_of(limits.robot, motion)
    alone = np.zeros(len(motion) - 1, dtype=np.int64)  # from rest to rest takes two segments
    alone[[a for a, b in path.runs if b == a + 1]] = 1
    motion = _subdivided(limits.robot, motion, alone)
    span = np.diff(fastest_times(limits, motion, tightenings=0))
    whole = ~path_of(limits.robot, motion).subdividable
    count = np.where(whole, 0, np.maximum(np.ceil(span / PERIOD).astype(np.int64) - 1, 0))
    fine = _subdivided(limits.robot, motion, count)
    position, rate = fastest_rates(limits, fine, tightenings=0)
    first = np.concatenate([[0], np.cumsum(count + 1)])  # where the motion's own states are
    keep = np.zeros(len(fine), dtype=bool)
    for a, b in pairwise(first.tolist()):
        keep[a + np.array(_knots(position[a : b + 1], rate[a : b + 1] ** 2))] = True
    return Motion(fine.base[keep], fine.joints[keep], fine.kind[keep], fine.setpoint[keep], fine.time[keep])


def _knots(x: Array, y: Array) -> list[int]:
    """Points (n,) that a polyline through them must keep to be near all, both ends among them.

    The points are halved at the farthest one from the chord (Douglas and Peucker, 1973).
    """
    line = y[0] + (y[-1] - y[0]) * (x - x[0]) / max(x[-1] - x[0], np.finfo(float).tiny)
    off = np.abs(y - line) / np.maximum(y, line.max() * 1e-2 + np.finfo(float).tiny)
    k = int(np.argmax(off))
    if off[k] <= VELOCITY_ERROR or not 0 < k < len(x) - 1:
        return [0, len(x) - 1]
    return [*_knots(x[: k + 1], y[: k + 1]), *(k + j for j in _knots(x[k:], y[k:])[1:])]


def _blended(limits: MotionLimits, motion: Motion, blend: float) -> Motion:
    """Motion with states inserted halfway until the smooth path keeps to the segments between all."""
    for _ in range(ROUNDS):
        far = np.flatnonzero(_deviation(limits, motion) > blend)
        if not len(far):
            return motion
        base = limits.robot.drive.between(motion.base[far], motion.base[far + 1], np.full(len(far), 0.5))
        joints = (motion.joints[far] + motion.joints[far + 1]) / 2
        motion = _with_states(motion, far, base, joints)
    raise InputError(
        f"blend: the smooth path does not come within {blend:g} m of the plan's motion; ask for more"
    )


def _deviation(limits: MotionLimits, motion: Motion) -> Array:
    """Upper bound for any point's distance on the smooth path from each segment, (n - 1,) [m]."""
    off = np.zeros(len(motion) - 1)
    path, segment = path_of(limits.robot, motion), np.arange(len(off))
    for share in COMPARED_SHARES:
        q, _, _ = path.evaluate(path.position[:-1] + share * path.lengths, segment)
        base = limits.robot.drive.between(path.base[:-1], path.base[1:], np.full(len(off), share))
        joints = path.joints[:-1] + share * np.diff(path.joints, axis=0)
        off = np.maximum(off, limits.displacement_bound(q[:, :3] - base, q[:, 3:] - joints))
    return off


def _with_rests(motion: Motion, states: NDArray[np.int64]) -> Motion:
    """Motion that gives some states twice, at which the robot then rests."""
    inner = states[states < len(motion) - 1]
    return _with_states(motion, inner, motion.base[inner], motion.joints[inner])


def _subdivided(robot: Robot, motion: Motion, count: NDArray[np.int64]) -> Motion:
    """Motion with so many states inserted in each segment (n - 1,), next to its smooth path."""
    path = path_of(robot, motion)
    if not count.any():
        return motion
    segment = np.repeat(np.arange(len(count)), count)
    share = np.concatenate([np.arange(1, n + 1) / (n + 1) for n in count[count > 0].tolist()])
    return _with_states(motion, segment, *path.states_at(segment, share))


def _with_states(motion: Motion, segment: NDArray[np.int64], base: Array, joints: Array) -> Motion:
    """Motion with states inserted in segments, in the order given, of the kind that the segment is."""
    from_setpoint = np.asarray(motion.kind[segment] == "setpoint")  # then the next state says the kind
    lead = np.where(from_setpoint, segment + 1, segment)
    between = from_setpoint & (motion.kind[lead] == "setpoint")
    kind = np.where(between, "step", motion.kind[lead])
    setpoint = np.where(between, motion.setpoint[segment], motion.setpoint[lead])
    return Motion(
        base=np.insert(motion.base, segment + 1, base, axis=0),
        joints=np.insert(motion.joints, segment + 1, joints, axis=0),
        kind=np.insert(motion.kind, segment + 1, kind),
        setpoint=np.insert(motion.setpoint, segment + 1, setpoint),
        time=np.full(len(motion) + len(segment), np.nan),
    )
