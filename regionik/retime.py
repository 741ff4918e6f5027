"""From a path to a trajectory: the fastest motion along a plan within limits of speed and acceleration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from regionik.curve import Curve
from regionik.limits import Limits, Mask, limits_of
from regionik.pace import check_tool_speed, figures, slowing
from regionik.plan import Motion, Plan
from regionik.planners.timing import Look, fastest
from regionik.rounding import curve_of, put_in, resting, rounded
from regionik.verify import verify
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
    >>> from regionik.worlds.format import load_world
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
    """A motion with times, through its own states and more."""
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
    """Path positions and velocities of a motion's states, (n,): fastest from rest to rest over each run."""
    curve = curve_of(limits.robot, motion)
    working = limits.working(motion)
    rate = np.zeros(len(motion))
    for run, (a, b) in enumerate(curve.runs):
        rate[a : b + 1] = _run_rates(limits, Run(curve, run), working[a:b], tightenings)
    return curve.position, rate


@dataclass(frozen=True, eq=False)
class Run:
    """One run of a curve, of m hops."""

    curve: Curve
    number: int

    @cached_property
    def grid(self) -> Array:
        """Path positions of its states, (m + 1,)."""
        a, b = self.curve.runs[self.number]
        return self.curve.position[a : b + 1]

    def at(self, share: float) -> tuple[Array, Array, Array]:
        """Poses at a share of each hop, and their derivatives."""
        a, b = self.curve.runs[self.number]
        position = self.grid[:-1] + share * np.diff(self.grid)
        return self.curve.along(position, np.arange(a, b))


def _run_rates(limits: Limits, run: Run, working: Mask, tightenings: int) -> Array:
    """Path velocities at the ends of a run's hops, (m + 1,).

    The engine keeps limits at both ends and in the middle of each hop; where they are broken elsewhere, they
    are drawn closer.
    """
    first, middle, last = (run.at(share) for share in ENGINE_LOOKS)
    most = np.full(len(run.grid), np.inf)
    most[:-1] = limits.most(first[0], first[1], working)
    most[1:] = np.minimum(most[1:], limits.most(last[0], last[1], working))
    ways = [limits.accelerations(slope, bend) for _, slope, bend in (first, middle, last)]
    count = len(run.grid) - 1
    strict = np.ones(count)
    shares, looking = np.repeat(LOOKS, count)[:, None], np.tile(working, len(LOOKS))
    z, slope, bend = (np.concatenate(parts) for parts in zip(*map(run.at, LOOKS), strict=True))
    for left in range(tightenings, -1, -1):
        close = strict[:, None]
        looks = [Look(k, way[0] * close, way[1] * close) for k, way in zip(ENGINE_LOOKS, ways, strict=True)]
        ends = np.maximum(np.append(strict, 1.0), np.insert(strict, 0, 1.0))
        rate = fastest(run.grid, looks, ways[0][2], most / ends)
        if not left:
            break
        gain = np.tile(np.diff(rate**2), len(LOOKS))[:, None]
        push = gain / np.tile(2 * np.diff(run.grid), len(LOOKS))[:, None]
        now = np.sqrt(np.tile(rate[:-1] ** 2, len(LOOKS))[:, None] + shares * gain)
        over = limits.slowing(z, slope * now, slope * push + bend * now**2, looking) ** 2
        over = over.reshape(len(LOOKS), count).max(0)
        if over.max() <= 1 + ALLOWED:
            break
        strict *= np.maximum(over, 1.0)
    return rate
