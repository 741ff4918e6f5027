"""Jerk-limited timing of a motion: a time-optimal one, its path position averaged over time.

The average of a path position over a window as long as a limited jerk needs to build up the acceleration has
the same velocities, and accelerations without jumps. What this or the path's own bends exceed is made slower
where it does, by tightening the limits of the time-optimal timing there, and what little is left by
stretching time there.
Source: Biagiotti and Melchiorri, FIR filters for online trajectory planning with time- and frequency-domain
specifications (Control Engineering Practice 2012), sections 2 and 3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from regionik.timing.inserted_states import (
    evenly,
    graded,
    halved,
    periods,
    with_rolled_states,
    with_states,
)
from regionik.timing.limits import MotionLimits, tool_velocity
from regionik.timing.options import TIMING
from regionik.timing.parametrization import fastest_rates, path_of, steering_pauses
from regionik.timing.smooth_path import SmoothPath
from regionik.timing.time_spline import time_spline
from regionik.values import Motion
from regionik.worlds.arrays import Array, Index, Mask

OPTIONS = TIMING.jerk

BISECTIONS = 50  # for the time at which a state is passed


def jerk_limited_motion(limits: MotionLimits, fine: Motion) -> Motion:
    """Motion timed within limits of jerk, by a ``fine`` one with constant path accelerations between states.

    Any point of the robot may leave its path, and then the segments between the states that are found, by
    ``limits.blend``.
    """
    path, factor, early = path_of(limits.robot, fine), np.ones(len(fine) - 1), leading(limits)
    best, least, found = fine, np.inf, 0
    for k in range(OPTIONS.max_rounds):
        position, rate = fastest_rates(early, fine, 0, factor)
        timed, places = _resampled(limits, fine, _TimeLaw(path, rate, limits.ramp))
        excess = np.maximum(_excess(limits, timed), 1.0)
        slower = stretched(limits, timed, np.sqrt(excess))
        lost = float(slower.time[-1]) + _time_below(limits, slower)
        if lost < least:
            best, least, found = slower, lost, k
        if excess.max(initial=1.0) <= 1 + TIMING.slowing.excess or k >= found + OPTIONS.max_futile_rounds:
            break
        factor *= _on_segments(position, places, excess)
    best = _within_limits(limits, best)
    timed = best if limits.robot.drive.rolls else _densely(limits, best)
    steering, span = limits.speeds.steering_velocity, np.diff(timed.time)
    pauses = steering_pauses(path_of(limits.robot, timed), span, steering)
    return replace(timed, time=timed.time + np.concatenate([[0.0], np.cumsum(pauses)]))


def leading(limits: MotionLimits) -> MotionLimits:
    """Return limits by which the tool is slow enough before the path says so, and after.

    So it still is once the path position is averaged, and where splines ripple as speeds change.
    """
    return replace(limits, lead=limits.ramp / 2 + OPTIONS.period)


@dataclass(frozen=True, eq=False)
class _TimeLaw:
    """Path position as a function of time: with constant path accelerations, then averaged over a window."""

    path: SmoothPath
    rate: Array  # (n,) path velocities at its states
    window: float  # [s]

    @cached_property
    def _moving(self) -> Mask:
        """Segments with a length, between two that have none, (n + 1,)."""
        return np.concatenate([[False], self.path.lengths > 0, [False]])

    @cached_property
    def _start(self) -> Array:
        """Times of the states before averaging, with a rest of a window behind each run, (n + 1,) [s]."""
        twice = np.where(self.path.lengths > 0, self.rate[1:] + self.rate[:-1], 1.0)
        span = np.append(2 * self.path.lengths / twice, 0.0)
        span[self._moving[:-1] & ~self._moving[1:]] = self.window
        return np.concatenate([[0.0], np.cumsum(span)])

    def _integral(self, times: Array) -> Array:
        """Integral of the path position before averaging, from 0 to times (m,)."""
        moving = self._moving[1:]
        span = np.where(moving, np.diff(self._start), 1.0)
        gain = np.where(moving, np.diff(self.rate, append=0.0) / span, 0.0)
        powers = np.stack([self.path.position, self.rate * moving / 2, gain / 6])
        t = np.diff(self._start)
        whole = np.concatenate([[0.0], np.cumsum(t * (powers[0] + t * (powers[1] + t * powers[2])))])
        segment = np.clip(np.searchsorted(self._start, times, side="right") - 1, 0, len(moving) - 1)
        t, (a, b, c) = times - self._start[segment], powers[:, segment]
        return whole[segment] + t * (a + t * (b + t * c))

    def at(self, times: Array) -> Array:
        """Averaged path positions at times (m,)."""
        before = np.maximum(times - self.window, 0.0)  # where the position is 0
        return (self._integral(times) - self._integral(before)) / self.window

    def times_of(self, states: Index) -> Array:
        """Times (m,) at which states are passed, or left where the robot rests."""
        low, wanted = self._start[states], self.path.position[states]
        high = low + self.window
        starts, ends = ~self._moving[states], ~self._moving[states + 1]
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            late = self.at(middle) > wanted
            low, high = np.where(late, low, middle), np.where(late, middle, high)
        found: Array = np.where(starts, self._start[states], (low + high) / 2)
        return np.where(ends & ~starts, self._start[states] + self.window, found)


def _resampled(limits: MotionLimits, fine: Motion, law: _TimeLaw) -> tuple[Motion, Array]:
    """Motion timed by a law: few states of its path, whose splines stay near it, and their path positions."""
    path, rows = law.path, np.flatnonzero(_retained_states(fine, law.path))
    own = Motion(fine.base[rows], fine.joints[rows], fine.kind[rows], fine.setpoint[rows], fine.time[rows])
    times, moves = law.times_of(rows), np.diff(path.position[rows]) > 0
    alone = moves & law.path.rests[rows[:-1]] & law.path.rests[rows[1:]]
    least = np.maximum(alone, np.diff(rows) > 1)
    parts = np.where(moves, np.maximum(periods(np.diff(times), OPTIONS.period), 1 + least), 1)
    gap, share = graded(parts, np.ones(len(rows), dtype=bool), OPTIONS.max_segment_knots * np.diff(rows))
    for left in range(OPTIONS.max_halvings, -1, -1):
        between = times[gap] + share * np.diff(times)[gap]
        position = law.at(between)
        segment = np.searchsorted(path.position, position, side="right") - 1
        segment = np.clip(segment, rows[gap], rows[gap + 1] - 1)
        part = np.clip((position - path.position[segment]) / path.lengths[segment], 0.0, 1.0)
        found = with_rolled_states(limits, own, gap, *path.states_at(segment, part))
        found = replace(found, time=np.insert(times, gap + 1, between))
        strayed = _strayed(limits, found, law) > limits.blend
        count = np.bincount(gap, minlength=len(moves))
        far = moves & np.logical_or.reduceat(strayed, np.cumsum(count + 1) - count - 1)
        if not left or not far.any():
            break
        gap, share = halved(gap, share, far)
    return found, np.insert(path.position[rows], gap + 1, position)


def _retained_states(fine: Motion, path: SmoothPath) -> Mask:
    """States that stay: set-points, ends of runs and transits."""
    lifted = fine.kind == "transit"
    cut = (lifted[1:] != lifted[:-1]) | (path.lengths == 0)
    cut = np.concatenate([[True], cut, [True]])
    return cut[:-1] | cut[1:] | (fine.kind == "setpoint")


def _strayed(limits: MotionLimits, timed: Motion, law: _TimeLaw) -> Array:
    """Upper bound for any point's distance on the splines from the path, (n - 1,) [m].

    Infinite where wheels slip too far.
    """
    spline, off = time_spline(path_of(limits.robot, timed), timed.time), np.zeros(len(timed) - 1)
    segment = np.flatnonzero(spline.path.lengths > 0)
    for share in OPTIONS.checked_shares[1:-1]:
        times = timed.time[segment] + share * np.diff(timed.time)[segment]
        position = law.at(times)
        at = np.searchsorted(law.path.position, position, side="right") - 1
        q, ahead, _ = law.path.evaluate(position, np.clip(at, 0, len(law.rate) - 2))
        apart = spline.evaluate(times).q - q
        apart -= ((apart * ahead).sum(1) / (ahead**2).sum(1))[:, None] * ahead  # sooner or later is no matter
        off[segment] = np.maximum(off[segment], limits.displacement(q, q + apart))
    return np.where(spline.slipping, np.inf, off)


def _densely(limits: MotionLimits, timed: Motion) -> Motion:
    """The same motion with states inserted until its splines keep to the segments between all."""
    count = np.zeros(len(timed) - 1, dtype=np.int64)
    spline = time_spline(path_of(limits.robot, timed), timed.time)
    for _ in range(OPTIONS.max_halvings):
        gap, share = evenly(count)
        between = timed.time[gap] + share * np.diff(timed.time)[gap]
        q = spline.evaluate(between).q
        found = with_states(timed, gap, q[:, :3], q[:, 3:])
        found = replace(found, time=np.insert(timed.time, gap + 1, between))
        far = np.logical_or.reduceat(
            _deviation(limits, found) > limits.blend, np.cumsum(count + 1) - count - 1
        )
        if not far.any():
            break
        count = np.where(far, 2 * count + 1, count)  # halves, so that knots stay knots
    return found


def _deviation(limits: MotionLimits, timed: Motion) -> Array:
    """Upper bound for any point's distance on the splines from each segment, (n - 1,) [m]."""
    path = path_of(limits.robot, timed)
    segment = np.flatnonzero(path.lengths > 0)
    spline, off = time_spline(path, timed.time), np.zeros(len(timed) - 1)
    change = np.column_stack([np.diff(path.base, axis=0), np.diff(path.joints, axis=0)])[segment]
    start = np.column_stack([path.base, path.joints])[segment]
    for share in OPTIONS.checked_shares[1:-1]:
        times = timed.time[segment] + share * np.diff(timed.time)[segment]
        q = spline.evaluate(times).q
        part = ((q - start) * change).sum(1) / (change**2).sum(1)
        base = limits.robot.drive.between(path.base[segment], path.base[segment + 1], part)
        joints = start[:, 3:] + part[:, None] * change[:, 3:]
        off[segment] = np.maximum(off[segment], limits.displacement(q, np.column_stack([base, joints])))
    return off


def _excess(limits: MotionLimits, timed: Motion) -> Array:
    """Factor by which the squared path velocity is too large on each segment, (n - 1,)."""
    path = path_of(limits.robot, timed)
    spline, excess = time_spline(path, timed.time), np.zeros(len(timed) - 1)
    knots, segment = spline.knots.time, spline.knots.segment[:-1]
    tool_speed, piece = limits.tool_speeds(timed)[segment], np.arange(len(segment))
    for share in OPTIONS.checked_shares:
        times = knots[:-1] + share * np.diff(knots)
        q, velocity, acceleration, jerk = spline.evaluate(times, piece)
        np.maximum.at(excess, segment, limits.slowdown(q, velocity, acceleration, tool_speed, jerk) ** 2)
    return excess


def _within_limits(limits: MotionLimits, timed: Motion) -> Motion:
    """The same motion slower about segments that exceed a limit, the more the more they do."""
    for _ in range(OPTIONS.max_stretches):
        factor = np.sqrt(_excess(limits, timed))
        if factor.max(initial=1.0) <= 1.0:
            break
        timed = stretched(limits, timed, factor)
    return timed


def stretched(limits: MotionLimits, timed: Motion, factor: Array) -> Motion:
    """Motion by a time that passes slower by factors above 1 on segments (n - 1,), and little less beside.

    The factor by which time passes slower is the largest about each instant, averaged twice.
    """
    time, wide = timed.time, max(2 * limits.ramp, OPTIONS.min_stretch_time)
    slow = np.flatnonzero(factor > 1.0)
    low, high, more = time[slow] - wide, time[slow + 1] + wide, factor[slow] * (1 + TIMING.slowing.spare) - 1
    cuts = np.unique(np.concatenate([low, high]))
    first, end = np.searchsorted(cuts, low), np.searchsorted(cuts, high)
    height = np.zeros(len(cuts))  # from each cut on
    for a, b, value in zip(first.tolist(), end.tolist(), more.tolist(), strict=True):
        height[a:b] = np.maximum(height[a:b], value)
    later = time + _averaged_steps(cuts, np.diff(height, prepend=0.0), wide, time)
    return replace(timed, time=later - later[0])


def _averaged_steps(cuts: Array, rise: Array, wide: float, times: Array) -> Array:
    """Integrals to times (m,) of steps that rise at cuts, averaged twice over a width, (m,)."""
    first, end = (np.searchsorted(cuts, times + side) for side in (-wide, wide))
    rises, moments = (np.concatenate([[0.0], np.cumsum(one)]) for one in (rise, rise * cuts))
    found: Array = times * rises[first] - moments[first]  # of steps that are over
    count = end - first
    at = np.repeat(np.arange(len(times)), count)
    step = np.arange(len(at)) - np.repeat(np.cumsum(count) - count - first, count)
    u = (times[at] - cuts[step]) / wide
    part = np.maximum(u, 0.0) + (1 - np.abs(u)) ** 3 / 6
    return found + wide * np.bincount(at, rise[step] * part, len(times))


def _time_below(limits: MotionLimits, timed: Motion) -> float:
    """Time on the path for which the tool has not the asked speed; 0 where none is asked [s]."""
    asked = limits.tool_speeds(timed)
    if not np.isfinite(asked).any():
        return 0.0
    span = np.diff(timed.time)
    spline = time_spline(path_of(limits.robot, timed), timed.time)
    q, velocity, *_ = spline.evaluate(timed.time[:-1] + span / 2)
    speed = np.linalg.norm(tool_velocity(limits.robot, q, velocity), axis=1)
    return float(span @ (np.isfinite(asked) & (speed < TIMING.figures.min_speed_share * asked)))


def _on_segments(position: Array, places: Array, values: Array) -> Array:
    """Largest of the values of segments between ``places`` over segments between path positions."""
    cuts = np.unique(np.concatenate([position, places]))
    middle = (cuts[1:] + cuts[:-1]) / 2
    found = np.ones(len(position) - 1)
    here, there = (np.searchsorted(ends, middle, side="right") - 1 for ends in (position, places))
    np.maximum.at(found, here, values[np.clip(there, 0, len(values) - 1)])
    return found
