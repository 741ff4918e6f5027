"""Timing of plans: the fastest motion close to a plan's, within limits of speed, acceleration and jerk."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from regionik.planners.progress import track
from regionik.postures.arm import deviation
from regionik.timing.corner_rounding import rounded
from regionik.timing.inserted_states import blended, refined, strayed, with_rests
from regionik.timing.jerk_limited_timing import jerk_limited_motion, leading, stretched
from regionik.timing.limit_usage import check_tool_speed, slowdowns
from regionik.timing.limits import MotionLimits, segments_on_path
from regionik.timing.optimised_motion import optimised
from regionik.timing.options import TIMING
from regionik.timing.parametrization import fastest_times, path_of
from regionik.timing.timing_figures import timing_figures
from regionik.values import Motion, Plan, Report
from regionik.verification.verifier import verify
from regionik.worlds.arms import has_pivot, pivot_index
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Speeds
from regionik.worlds.robot import Robot

CORNERS, SLOWING, RULES = TIMING.corners, TIMING.slowing, TIMING.rules


def retime(plan: Plan, speeds: Speeds | None = None, *, hold: bool = False, optimise: bool = False) -> Plan:
    """Time a plan: as fast as speeds, accelerations and jerks allow, from rest to rest.

    The robot goes on a smooth path through the plan's states, whose points stay within a ``blend`` of the
    motion that was verified. Unless the base rolls, corners are rounded by that, at set-points too as far as
    their tolerance allows, and by up to 3 cm where the tool is lifted; by less where the rounded motion would
    break a rule of the plan. Where that does not help the robot rests, as it does at sharp corners. States
    are inserted where the path bends or its acceleration, constant between two, changes.

    Parameters
    ----------
    plan : Plan
    speeds : Speeds, optional
        By default those of the plan's world, or of its robot. To set-points with a ``speed`` of their own
        the tool goes no faster than that either.
    hold : bool
        Refuse a tool speed that joints or base cannot give the tool everywhere on the path; without it the
        tool is slower there, and ``stats`` says where.
    optimise : bool
        Optimise the motion for time before, base, joints and times together: same set-points, in the same
        order, same lift-offs and stops. The faster of both counts. Bases on wheels keep their motion.

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
    asked = speeds or plan.world.speeds or Speeds()
    stats = {key: value for key, value in plan.stats.items() if key not in ("margins", "timing")}
    plan = replace(plan, world=replace(plan.world, speeds=asked), stats=stats)
    # The narrowest cone of the task bounds how far the blend turns the tool.
    cone = min((target.cone for target in plan.world.task if target.direction is not None), default=np.inf)
    pointer = asked.blend / (CORNERS.turn_share * cone)
    limits = MotionLimits(plan.world.robot, asked, pointer, plan.world.work_speeds)
    timed, report = _fastest(limits, plan)
    if not report.ok:
        raise InputError(
            "plan: its motion breaks its own rules, so no smooth motion next to it keeps them; verify it"
        )
    if optimise and not plan.world.robot.drive.rolls:
        quicker = optimised(limits, timed, partial(_as_laid_out, limits, plan))
        timed, report = quicker or (timed, report)
    if hold:
        check_tool_speed(limits, timed.motion)
    figures = {"margins": report.margins, "timing": timing_figures(limits, timed.motion)}
    return replace(timed, stats={**timed.stats, **figures})


def _fastest(limits: MotionLimits, plan: Plan) -> tuple[Plan, Report]:
    """The plan timed and its report; with usual corners too, where it rests at one that was to be rounder.

    And with none rounded, where the states are dense already.
    """
    usual, found = min(limits.blend, Speeds.blend), list[tuple[Plan, Report]]()
    near, most = replace(limits, speeds=replace(limits.speeds, blend=usual)), _most(plan)
    if not limits.robot.drive.rolls and strayed(limits, plan.motion) <= RULES.max_strayed_share:
        found.append(_as_laid_out(limits, plan, plan.motion))
    asked = np.where(plan.motion.kind == "transit", max(limits.blend, CORNERS.lifted_blend), limits.blend)
    rounder = not limits.robot.drive.rolls and (asked > usual).any()
    for room in (asked, np.full(len(asked), usual))[not rounder :]:
        timed, report, flows = _within(near, plan, room, most)
        found.append((timed, report))
        if report.ok and flows:
            break
    return min(found, key=lambda one: (not one[1].ok, float(one[0].motion.time[-1])))


def _as_laid_out(limits: MotionLimits, plan: Plan, motion: Motion) -> tuple[Plan, Report]:
    """The plan with a motion timed as its states are, none of its corners rounded, and its report."""
    resting, _ = with_rests(motion, _rests(limits, motion, np.zeros(len(motion))))
    return _verified(limits, plan, _timed(limits, resting))


def _within(limits: MotionLimits, plan: Plan, allowed: Array, most: Array) -> tuple[Plan, Report, bool]:
    """The plan timed, its report, and whether no rule made it rest where corners were to be rounder.

    Points leave the motion by at most what is ``allowed`` (n,) about each state, and ``most`` (n,) in it, by
    less where that breaks a rule, and where that does not help the robot rests [m].
    """
    room, kept = allowed.copy(), _kept(plan)
    first = rests = _rests(limits, plan.motion, np.minimum(room, most))
    widths = iter(RULES.rested_beside)
    for k in track("timing", range(RULES.max_narrowings + len(RULES.rested_beside))):
        motion, own = with_rests(plan.motion, rests)
        rolls = limits.robot.drive.rolls  # wheels keep to their arcs
        smooth = motion if rolls else rounded(limits, motion, room[own], most[own], kept[own])
        timed, report = _verified(limits, plan, _timed(limits, smooth))
        if report.ok:
            break
        near = partial(_nearby_states, limits.robot, motion, timed.motion, _worst(report))
        broken = own[near(1 + k // 2)]
        if not len(broken):
            break
        wide = broken[room[broken] > limits.blend]
        room[wide] = np.maximum(room[wide] / RULES.narrowing, limits.blend)
        if not len(wide):
            rests = np.union1d(rests, own[near(next(widths, RULES.rested_beside[-1]))])
    return timed, report, not (allowed[np.setdiff1d(rests, first)] > limits.blend).any()


def _rests(limits: MotionLimits, motion: Motion, room: Array) -> Index:
    """States to rest at: corners, and both ends of a path on which the tool has a speed."""
    path = path_of(limits.robot, motion)
    gentle = 0.0 if limits.speeds.limit_jerk else CORNERS.gentle_steering
    rests = path.corners(CORNERS.rest_corner, gentle)
    if not limits.robot.drive.rolls:  # corners are rounded before the motion is timed
        sharp = np.isin(rests, path.corners(CORNERS.rest_rounded_corner, gentle))
        stays = room[rests] <= CORNERS.min_rounded_share * limits.blend
        rests = rests[(sharp & (room[rests] < CORNERS.lifted_blend)) | stays]
    if not np.isfinite(limits.tool_speeds(motion)).any():
        return rests
    return np.union1d(rests, 1 + np.flatnonzero(np.diff(segments_on_path(motion))))


def _verified(limits: MotionLimits, plan: Plan, motion: Motion) -> tuple[Plan, Report]:
    """The plan with a timed motion, slower where by its bounds it is slightly too fast, and the report."""
    for _ in range(SLOWING.max_slowdowns):
        timed = _with_motion(plan, motion)
        report = verify(timed)
        factor = np.ones(max(len(motion) - 1, 1))
        for fast in report.violations:
            slightly = fast.kind in ("speeds", "jerk") and fast.amount <= SLOWING.max_slowed_excess
            if slightly and fast.state is not None:
                factor[fast.state] = max(factor[fast.state], 1 + fast.amount)
        if factor.max() <= 1.0:
            break
        motion = _slower(limits, motion, factor)
    return timed, report


def _slower(limits: MotionLimits, motion: Motion, factor: Array) -> Motion:
    """Motion slower by factors on segments (n - 1,): about them where jerk is limited, else as a whole."""
    if limits.speeds.limit_jerk:
        return stretched(limits, motion, factor)
    return replace(motion, time=motion.time * factor.max() * (1 + SLOWING.spare))


def _most(plan: Plan) -> Array:
    """Distance by which any point may move in each state, for the tool to meet its set-point, (n,) [m]."""
    most, task, motion = np.full(len(plan.motion), np.inf), plan.world.task, plan.motion
    for k, i in _listed(plan, motion):
        tool = plan.world.robot.tool(motion.base[k], motion.joints[k])
        near = plan.world.rules.tolerance - math.dist(tool[:3, 3], task[i].position)
        free = task[i].direction is None
        if not free:
            free = task[i].cone - deviation(task[i], tool[:3, :3]) > CORNERS.min_spare_cone
        most[k] = max(near, 0.0) if free else 0.0
    return most


def _kept(plan: Plan) -> Mask:
    """Coordinates that stay in each state, (n, 3 + dof): the pivot's, of a base that faces its targets."""
    motion, chain = plan.motion, plan.world.robot.chain
    kept = np.zeros((len(motion), 3 + chain.dof), dtype=np.bool_)
    if plan.world.rules.heading == "face_target" and has_pivot(chain):
        kept[motion.kind == "setpoint", 3 + pivot_index(chain)] = True
    return kept


def _with_motion(plan: Plan, motion: Motion) -> Plan:
    """The plan with another motion, whose states at set-points are its configurations."""
    found, rows = list(plan.setpoints), _listed(plan, motion)
    for k, i in rows:
        base, joints = motion.base[k], motion.joints[k]
        if not (np.array_equal(base, found[i].base) and np.array_equal(joints, found[i].joints)):
            error = math.dist(plan.world.robot.tool(base, joints)[:3, 3], plan.world.task[i].position)
            found[i] = replace(found[i], base=base, joints=joints, error=error)
    figures = {
        "states": len(motion),
        "base_travel": plan.world.robot.drive.travel(motion.base),
        "largest_error": max((float(one.error) for one in found), default=0.0),
    }
    stats = {key: figures.get(key, value) for key, value in plan.stats.items()}
    return replace(plan, motion=motion, setpoints=tuple(found), stats=stats)


def _listed(plan: Plan, motion: Motion) -> list[tuple[int, int]]:
    """States of a motion at set-points that the plan lists, and which."""
    rows = np.flatnonzero((motion.kind == "setpoint") & (motion.setpoint >= 0))
    count = min(len(plan.setpoints), len(plan.world.task))
    return [(k, i) for k, i in zip(rows.tolist(), motion.setpoint[rows].tolist(), strict=True) if i < count]


def _timed(limits: MotionLimits, motion: Motion) -> Motion:
    """Motion with times, through its own states and more; a single state has time 0."""
    if len(motion) == 1:
        return replace(motion, time=np.zeros(1))
    near = leading(limits) if limits.speeds.limit_jerk else limits
    fine = blended(limits, refined(near, blended(limits, motion)))
    if limits.speeds.limit_jerk:
        motion = jerk_limited_motion(limits, fine)
    else:
        motion = replace(fine, time=fastest_times(limits, fine))
    tightened = np.ones(max(len(motion) - 1, 1))
    for k in range(SLOWING.max_slowdowns):
        factor = slowdowns(limits, motion)
        if factor.max() <= 1.0:
            break
        little = factor.max() <= 1 + SLOWING.negligible
        if k >= SLOWING.max_local_slowdowns or limits.speeds.limit_jerk or little:
            motion = _slower(limits, motion, factor)
        else:
            tightened *= np.where(factor > 1.0, factor * (1 + SLOWING.spare), 1.0) ** 2 ** (k + 1)
            motion = replace(motion, time=fastest_times(limits, motion, tightened=tightened))
    return motion


def _worst(report: Report) -> list[int]:
    """States that break a rule, but for those near one that does by more: it may be for that one's sake."""
    found = list[int]()
    for one in sorted(report.violations, key=lambda one: -one.amount):
        if one.state is not None and all(abs(one.state - state) > RULES.min_states_apart for state in found):
            found.append(one.state)
    return sorted(found)


def _nearby_states(robot: Robot, motion: Motion, timed: Motion, broken: list[int], beside: int) -> Index:
    """States within runs of a motion, next to those at which the timed one breaks a rule."""
    own, there = path_of(robot, motion), path_of(robot, timed)
    ends, found = [b for _, b in there.runs], np.zeros(len(motion), dtype=bool)
    for k, run in zip(broken, np.searchsorted(ends, broken).tolist(), strict=True):
        a, b = own.runs[run] if run < len(own.runs) else (0, 0)
        if b > a + 1:
            apart = np.linalg.norm(own.coordinates[a + 1 : b] - there.coordinates[k], axis=1)
            nearest = a + 1 + int(np.argmin(apart))
            found[max(a + 1, nearest - beside) : min(b, nearest + beside + 1)] = True
    return np.flatnonzero(found)
