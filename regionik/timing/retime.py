"""From a path to a trajectory: the fastest motion along a plan within limits of speed and acceleration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from regionik.planners.timing.path_timing import Look, fastest
from regionik.timing.blending import curve_of, put_in, resting, rounded
from regionik.timing.curve import Curve
from regionik.timing.limits import Limits, Mask, limits_of
from regionik.timing.speed_report import check_tool_speed, figures, slowing
from regionik.values import Motion, Plan
from regionik.verification.verifier import verify
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.robot import Robot
from regionik.worlds.speeds import Speeds

BLEND = 2e-4  # by which any point of the robot may leave the plan's motion on the smooth path [m]
PERIOD = 0.02  # of the fine timing that tells where states are needed [s]
EVEN = 0.002  # of the squared path velocity, by which it may be off the fine one
TIGHTENINGS = 6  # of limits, where they are broken between states
SLOWINGS, SPARE = 5, 1e-4  # of the whole motion, and by how much more
TRIES = 4  # of rounding, with more states to rest at
STILL = 1e-12  # squared path velocity at a rest within a course; the engine's rounding does not bear 0
ALLOWED = 1e-3  # by which they may be, before the whole motion is slowed by it
LAST = 1 - 1e-9  # of a hop: at its end the next one starts
LOOKS = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, LAST)  # shares of a hop at which limits are looked at
ENGINE_LOOKS = (0.0, 0.5, LAST)


def retime(plan: Plan, speeds: Speeds | None = None, *, blend: float = BLEND, hold: bool = False) -> Plan:
    """Time a plan: as fast as speeds and accelerations allow, from rest to rest.

    The robot goes on a smooth path through the plan's states, whose points stay within ``blend`` of the
    motion that was verified; it rests at sharp corners, and where its rounded motion would break a rule of
    the plan. States are put in where the path or its pace bends: between two the path acceleration is even.

    Parameters
    ----------
    plan : Plan
    speeds : Speeds, optional
        By default those of the plan's world, or of its robot.
    blend : float
        [m]
    hold : bool
        Refuse a tool speed that joints or base cannot give the tool everywhere on the path; without it the
        tool is slower there, and ``stats`` tells where.

    Returns
    -------
    Plan
        With the time of every state, and verified. ``stats["timing"]`` tells the duration, how much of each
        limit is made use of, and where an asked tool speed is not held.

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
    limits = limits_of(plan.world.robot, asked)
    motion = resting(limits.robot, plan.motion)
    for _ in range(TRIES):
        timed = replace(plan, motion=_timed(limits, motion, blend))
        report = verify(timed)
        if report.ok:
            if hold:
                check_tool_speed(limits, timed.motion)
            told = {"margins": report.margins, "timing": figures(limits, timed.motion, blend)}
            return replace(timed, stats={**plan.stats, **told})
        off = [v.state for v in report.violations if v.state is not None]
        motion = resting(limits.robot, motion, _strict(limits.robot, motion, timed.motion, off))
    raise InputError(
        "plan: its motion breaks its own rules, so no smooth motion next to it keeps them; verify it"
    )


def _timed(limits: Limits, motion: Motion, blend: float) -> Motion:
    """A motion with times, through its own states and more; a single state is there at 0."""
    if len(motion) == 1:
        return replace(motion, time=np.zeros(1))
    motion = rounded(limits, motion, blend)
    motion = rounded(limits, _dense(limits, motion), blend)
    motion = replace(motion, time=_times(limits, motion))
    for _ in range(SLOWINGS):
        slower = slowing(limits, motion)
        if slower <= 1.0:
            break
        motion = replace(motion, time=motion.time * slower * (1 + SPARE))
    return motion


def _strict(robot: Robot, motion: Motion, timed: Motion, off: list[int]) -> NDArray[np.int64]:
    """States of a motion at which the robot should rest, as its runs break a rule when they are rounded."""
    ends = [b for _, b in curve_of(robot, timed).runs]
    runs = np.unique(np.searchsorted(ends, off))
    own = curve_of(robot, motion).runs
    inner = [np.arange(own[k][0] + 1, own[k][1]) for k in runs.tolist() if k < len(own)]
    return np.concatenate([np.empty(0, dtype=np.int64), *inner])


def _dense(limits: Limits, motion: Motion) -> Motion:
    """A motion with states put in on its smooth path where the path acceleration changes.

    A fine timing tells where: between two states that are kept its acceleration is next to even.
    """
    curve = curve_of(limits.robot, motion)
    alone = np.zeros(len(motion) - 1, dtype=np.int64)  # from rest to rest takes two hops
    alone[[a for a, b in curve.runs if b == a + 1]] = 1
    motion = put_in(limits.robot, motion, alone)
    span = np.diff(_times(limits, motion, tightenings=0))
    count = np.maximum(np.ceil(span / PERIOD).astype(np.int64) - 1, 0)
    fine = put_in(limits.robot, motion, count)
    position, rate = _fastest(limits, fine, tightenings=0)
    first = np.concatenate([[0], np.cumsum(count + 1)])  # where the motion's own states are
    keep = np.zeros(len(fine), dtype=bool)
    for a, b in pairwise(first.tolist()):
        keep[a + np.array(_bends(position[a : b + 1], rate[a : b + 1] ** 2))] = True
    return Motion(fine.base[keep], fine.joints[keep], fine.kind[keep], fine.setpoint[keep], fine.time[keep])


def _bends(x: Array, y: Array) -> list[int]:
    """Both ends of a line through points (n,), and those between that straight lines need to be near it."""
    line = y[0] + (y[-1] - y[0]) * (x - x[0]) / max(x[-1] - x[0], np.finfo(float).tiny)
    off = np.abs(y - line) / np.maximum(y, line.max() * 1e-2 + np.finfo(float).tiny)
    k = int(np.argmax(off))
    if off[k] <= EVEN or not 0 < k < len(x) - 1:
        return [0, len(x) - 1]
    return [*_bends(x[: k + 1], y[: k + 1]), *(k + j for j in _bends(x[k:], y[k:])[1:])]


def _times(limits: Limits, motion: Motion, tightenings: int = TIGHTENINGS) -> Array:
    """Times of a motion's states, (n,) [s]."""
    position, rate = _fastest(limits, motion, tightenings)
    way, twice = np.diff(position), rate[1:] + rate[:-1]
    return np.concatenate([[0.0], np.cumsum(2 * way / np.where(way > 0, twice, 1.0))])


def _fastest(limits: Limits, motion: Motion, tightenings: int) -> tuple[Array, Array]:
    """Path positions and velocities of a motion's states, (n,): fastest from rest to rest over each run.

    The engine keeps limits at both ends and in the middle of each hop; where they are broken elsewhere, they
    are drawn closer over that run.
    """
    curve = curve_of(limits.robot, motion)
    hops = np.flatnonzero(curve.hops > 0)
    rate, strict, todo = np.zeros(len(motion)), np.ones(len(hops)), np.arange(len(hops))
    if not len(hops):
        return curve.position, rate
    course = Course(limits, curve, hops, limits.working(motion)[hops])
    for left in range(tightenings, -1, -1):
        part = course.of(todo)
        found = np.where(part.rest, 0.0, part.fastest(strict[todo]))
        rate[part.hops], rate[part.hops + 1] = found[:-1], found[1:]
        if not left:
            break
        over = part.over(found)
        strict[todo] *= np.maximum(over, 1.0)
        run = np.cumsum(part.rest[:-1])
        todo = todo[np.isin(run, run[over > 1 + ALLOWED])]
        if not len(todo):
            break
    return curve.position, rate


@dataclass(frozen=True, eq=False)
class Course:
    """Hops of a curve, whole runs of them, one after the other.

    Attributes
    ----------
    limits : Limits
    curve : Curve
    hops : (m,) array of int
    working : (m,) array of bool
        Whether the tool is on its path.
    """

    limits: Limits
    curve: Curve
    hops: NDArray[np.int64]
    working: Mask

    def of(self, some: NDArray[np.int64]) -> Course:
        """Some of the hops, whole runs of them."""
        return (
            self
            if len(some) == len(self.hops)
            else replace(self, hops=self.hops[some], working=self.working[some])
        )

    @cached_property
    def grid(self) -> Array:
        """Path positions of their ends, without the ways between, (m + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.curve.hops[self.hops])])

    @cached_property
    def rest(self) -> Mask:
        """At which of these the robot rests, (m + 1,)."""
        return np.concatenate([[True], np.diff(self.hops) > 1, [True]])

    def at(self, shares: Sequence[float]) -> tuple[Array, Array, Array]:
        """Poses at shares of each hop, share by share, and their derivatives; (k m, 3 + dof)."""
        way, begun = self.curve.hops[self.hops], self.curve.position[self.hops]
        position = np.concatenate([begun + share * way for share in shares])
        return self.curve.along(position, np.tile(self.hops, len(shares)))

    def fastest(self, strict: Array) -> Array:
        """Path velocities at the ends of the hops, (m + 1,), with limits drawn closer by factors (m,)."""
        looks, most, close = [], np.where(self.rest, STILL, np.inf), strict[:, None]
        for share in ENGINE_LOOKS:
            z, slope, bend = self.at([share])
            if share != ENGINE_LOOKS[1]:
                ends = slice(None, -1) if share == 0.0 else slice(1, None)
                allowed = self.limits.most(z, slope, self.working) / strict
                most[ends] = np.minimum(most[ends], allowed)
            slope, bend, limit = self.limits.accelerations(slope, bend)
            looks.append(Look(share, slope * close, bend * close))
        return fastest(self.grid, looks, limit, most)

    def over(self, rate: Array) -> Array:
        """By which factor the square of the motion's pace is too large on each hop, (m,)."""
        count = len(LOOKS)
        z, slope, bend = self.at(LOOKS)
        way, gain = np.tile(np.diff(self.grid), count)[:, None], np.tile(np.diff(rate**2), count)[:, None]
        shares = np.repeat(LOOKS, len(self.hops))[:, None]
        now = np.sqrt(np.maximum(np.tile(rate[:-1] ** 2, count)[:, None] + shares * gain, 0.0))
        push = slope * gain / (2 * way) + bend * now**2
        slower = self.limits.slowing(z, slope * now, push, np.tile(self.working, count))
        found: Array = (slower**2).reshape(count, -1).max(0)
        return found
