"""Figures of a timing: what it uses of its limits, where and why the tool has not the speeds asked of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from regionik.timing.limit_usage import SHARES as LOOKS
from regionik.timing.limit_usage import largest_usage, motion_pieces
from regionik.timing.limits import MotionLimits, segments_on_path, tool_velocity
from regionik.timing.options import TIMING
from regionik.timing.trajectory import TrajectorySample, trajectory_within
from regionik.values import Motion
from regionik.worlds.arrays import Array, Index, Mask

OPTIONS = TIMING.figures

SHARES = np.linspace(0.0, 1.0, 13)  # of this time, at which it is looked
BISECTIONS = 30  # of the time between two instants, for when a speed begins or ceases to be held


def timing_figures(limits: MotionLimits, motion: Motion) -> dict[str, Any]:
    """Plain numbers about a timing, for ``Plan.stats``."""
    used = {name: float(share.max()) for name, share in largest_usage(limits, motion).items()}
    figures: dict[str, Any] = {"duration": float(motion.time[-1]), "blend": limits.blend, "used": used}
    if np.isfinite(limits.tool_speeds(motion)).any() or limits.speeds.tool_velocity is not None:
        figures["tool"] = _HeldSpeeds(limits, motion, *_tool_speeds(limits, motion)).figures()
    return figures


def _tool_speeds(limits: MotionLimits, motion: Motion) -> tuple[Array, Array, Index, Mask]:
    """Instants at which a speed is asked of the tool (n,), its speed then, and the segment that it is on.

    And which of them it goes on from at the same asked speed, (n - 1,). Those between which the speed begins
    or ceases to be held are next to each other.
    """
    time, speed, part = [np.empty(0)], [np.empty(0)], [np.empty(0, dtype=np.intp)]
    asked = limits.tool_speeds(motion)
    for every in motion_pieces(limits, motion):
        pieces = every.take(np.isfinite(every.tool_speed))
        sample = pieces.sample(np.repeat(LOOKS[:, None], len(pieces.start), axis=1))
        time.append(sample.time.reshape(len(LOOKS), -1).T.ravel())
        speed.append(_speed(limits, sample).reshape(len(LOOKS), -1).T.ravel())
        part.append(np.repeat(pieces.segment, len(LOOKS)))
    t, v, segment = np.concatenate(time), np.concatenate(speed), np.concatenate(part)
    run = np.concatenate([[0], np.cumsum(asked[1:] != asked[:-1])])
    enough = OPTIONS.min_speed_share * asked[segment]
    slow = v < enough
    before = np.flatnonzero((np.diff(run[segment]) == 0) & (slow[1:] != slow[:-1]))
    low, high = _crossings(limits, motion, enough[before], t[before], t[before + 1], slow[before])
    between = np.column_stack([low, high]).ravel()
    trajectory = trajectory_within(limits.robot, motion, limits.speeds)
    at = np.repeat(before + 1, 2)
    t, segment = np.insert(t, at, between), np.insert(segment, at, segment[at - 1])
    v = np.insert(v, at, _speed(limits, trajectory.sample(between)))
    return t, v, segment, np.diff(run[segment]) == 0


def _crossings(
    limits: MotionLimits, motion: Motion, least: Array, low: Array, high: Array, slow: Mask
) -> tuple[Array, Array]:
    """Instants (n,) next to each other, between others, the tool slower than ``least`` at one of the two."""
    trajectory = trajectory_within(limits.robot, motion, limits.speeds)
    for _ in range(BISECTIONS if len(low) else 0):
        middle = (low + high) / 2
        first = (_speed(limits, trajectory.sample(middle)) < least) == slow
        low, high = np.where(first, middle, low), np.where(first, high, middle)
    return low, high


def _speed(limits: MotionLimits, sample: TrajectorySample) -> Array:
    """Speed of the tool at n instants, (n,) [m/s]."""
    q, velocity, _ = sample.columns
    return np.linalg.norm(tool_velocity(limits.robot, q, velocity), axis=1)


@dataclass(frozen=True, eq=False)
class _HeldSpeeds:
    """Speed of the tool on its path against those that are asked."""

    limits: MotionLimits
    motion: Motion
    time: Array  # (n,) instants at which a speed is asked [s]
    speed: Array  # (n,) of the tool then [m/s]
    segment: Index  # (n,) that it is on
    goes_on: Mask  # (n - 1,) from each instant to the next

    @cached_property
    def _asked(self) -> Array:
        """Speed that is asked on each segment, infinite for none, (states - 1,) [m/s]."""
        return self.limits.tool_speeds(self.motion)

    @cached_property
    def _demanded(self) -> Array:
        """Speed that is asked at each instant, (n,) [m/s]."""
        return self._asked[self.segment]

    @property
    def _capped(self) -> Mask:
        """Instants at which the task asks for more than the limit of the tool's speed, (n,)."""
        alone = replace(self.limits, speeds=replace(self.limits.speeds, tool_velocity=None))
        own = alone.tool_speeds(self.motion)[self.segment]
        return np.isfinite(own) & (own > self._demanded)

    def figures(self) -> dict[str, Any]:
        """Shares of time at which the speed is held, and what keeps the tool from it where."""
        common = self.limits.speeds.tool_velocity or 0.0
        told = self._asked[np.isfinite(self._asked)] if len(self.time) else np.array([common])
        held = self.speed >= OPTIONS.min_speed_share * self._demanded
        elsewhere = self._from_stops.min(axis=0) > self._braking
        slow, apart = np.concatenate([[False], ~held, [False]]), ~self.goes_on
        apart = np.concatenate([[True], apart, [True]])
        starts = np.flatnonzero(slow[1:] & (~slow[:-1] | apart))
        ends = np.flatnonzero(slow[:-1] & (~slow[1:] | apart)) - 1
        longest = np.argsort(self.time[starts] - self.time[ends], kind="stable")[: OPTIONS.max_places]
        return {
            "asked": [float(told.min()), float(told.max())],
            "capped": self._share(self._capped, np.ones_like(held), 0.0),
            "held": self._share(held, np.ones_like(held), 0.0),
            "held_elsewhere": self._share(held, elsewhere, 1.0),
            "below": len(starts),
            "places": self._places(starts[longest], ends[longest]),
            "corners": [{"setpoint": int(self.motion.setpoint[k]), "turn": turn} for k, turn in self._turns],
        }

    def _share(self, steady: Mask, some: Mask, none: float) -> float:
        """Share of the time between ``some`` of the instants at which the speed is held."""
        span = np.diff(self.time) * (self.goes_on & some[1:] & some[:-1])
        whole = float(span.sum())
        return float(span[steady[1:] & steady[:-1]].sum()) / whole if whole > 0 else none

    def _places(self, starts: Index, ends: Index) -> list[dict[str, Any]]:
        """Where the tool is slower, from one instant to another: by what, and at what of its path."""
        trajectory = trajectory_within(self.limits.robot, self.motion, self.limits.speeds)
        first, last = self.time[starts] - OPTIONS.time_beside, self.time[ends] + OPTIONS.time_beside
        times = np.clip(first + SHARES[:, None] * (last - first), 0.0, self.motion.time[-1])
        sample = trajectory.sample(times.ravel())
        factor = self.limits.slowdown(*sample.columns, np.full(times.size, np.inf), sample.jerk)
        names = np.array(self.limits.most_used(*sample.columns, sample.jerk)).reshape(times.shape)
        hardest = np.argmax(factor.reshape(times.shape), axis=0)
        slowest = [float(self.speed[a : b + 1].min()) for a, b in zip(starts, ends, strict=True)]
        reached = np.maximum.accumulate(np.where(self.motion.kind == "setpoint", self.motion.setpoint, -1))
        after = reached[np.searchsorted(self.motion.time, self.time[ends], side="right") - 1]
        return [
            {
                "from": float(self.time[a]),
                "to": float(self.time[b]),
                "least": slowest[k],
                "by": str(names[hardest[k], k]),
                "at": self._stop_within(a, b),
                "setpoint": int(after[k]),
            }
            for k, (a, b) in enumerate(zip(starts, ends, strict=True))
        ]

    def _stop_within(self, start: int, end: int) -> str:
        """Where a slow part is slowest: near an "end" of the path, a "corner", or on the "path" besides."""
        at = start + int(np.argmin(self.speed[start : end + 1]))
        end_far, corner_far = self._from_stops[:, at]
        if min(end_far, corner_far) > self._braking[at]:
            return "path"
        return "end" if end_far <= corner_far else "corner"

    @cached_property
    def _from_stops(self) -> Array:
        """Way of the tool from each instant to the nearest end of its path, and to a corner, (2, n) [m]."""
        if not len(self.time):
            return np.empty((2, 0))
        on_path = np.concatenate([[False], segments_on_path(self.motion), [False]])
        stops = np.flatnonzero(np.diff(on_path)), [k for k, _ in self._turns]
        ways = (np.interp(self.motion.time[rows], self.time, self._way) for rows in stops)
        return np.stack([_nearest(way, self._way) for way in ways])

    @cached_property
    def _braking(self) -> Array:
        """Longest way on which the base alone comes to rest, or to a lower speed, at each instant, (n,) [m].

        To lose half of what the ramps of its acceleration take may be a longer way than to stop.
        """
        strongest, ramp = self.limits.speeds.base_acceleration, self.limits.ramp
        asked, at = np.unique(self._demanded, return_inverse=True)
        less = asked[:, None] * SHARES
        needed = np.where(
            less > strongest * ramp, less / strongest + ramp, 2 * np.sqrt(less * ramp / strongest)
        )
        found: Array = ((asked[:, None] - less / 2) * needed).max(axis=1)[at]
        return found

    @cached_property
    def _way(self) -> Array:
        """Way of the tool on its path to each instant, (n,) [m]."""
        step = self.goes_on * np.diff(self.time) * (self.speed[1:] + self.speed[:-1]) / 2
        return np.concatenate([[0.0], np.cumsum(step)])[: len(self.time)]

    @cached_property
    def _turns(self) -> list[tuple[int, float]]:
        """States at which the path turns more than the base could within the blend, and how much."""
        motion, lifted = self.motion, np.cumsum(self.motion.kind == "transit")
        rows = np.flatnonzero(motion.kind == "setpoint")
        way = np.diff(self.limits.robot.tool(motion.base[rows], motion.joints[rows])[:, :3, 3], axis=0)
        length = np.linalg.norm(way, axis=1)
        unit = way / np.maximum(length, 1e-9)[:, None]
        angle = np.arccos(np.clip((unit[:-1] * unit[1:]).sum(1), -1.0, 1.0))
        counts = (length[1:] > 1e-9) & (length[:-1] > 1e-9) & (lifted[rows[2:]] == lifted[rows[:-2]])
        asked = np.stack([self._asked[rows[1:-1] - 1], self._asked[rows[1:-1]]])
        counts &= np.isfinite(asked).all(axis=0)
        some = 1 + np.flatnonzero(counts & (self._cut(angle, asked.min(axis=0)) > self.limits.blend))
        return [(int(rows[k]), float(angle[k - 1])) for k in some]

    def _cut(self, angle: Array, speed: Array) -> Array:
        """Least distance by which corners are cut at a speed (k,) [m/s], (k,) [m].

        Velocity changes by a pulse of acceleration that is as high as the base allows, or triangular and as
        steep as it allows.
        """
        speeds, change = self.limits.speeds, 2 * np.where(np.isfinite(speed), speed, 0.0) * np.sin(angle / 2)
        steep = 0.0 if speeds.base_jerk is None else change**1.5 / (6 * np.sqrt(speeds.base_jerk))
        return np.maximum(change**2 / (8 * speeds.base_acceleration), steep)


def _nearest(stops: Array, ways: Array) -> Array:
    """Distance of each way (n,) to the nearest stop; infinite without any."""
    ends = np.concatenate([[-np.inf], np.sort(stops), [np.inf]])
    after = np.searchsorted(ends, ways)
    return np.minimum(ways - ends[after - 1], ends[after] - ways)
