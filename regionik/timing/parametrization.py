"""Time-optimal parametrization of a motion: path velocities at its states, from rest to rest in each run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from regionik.planners.timing.time_optimal import PathDerivatives, time_optimal_velocities
from regionik.timing.limits import MotionLimits
from regionik.timing.options import TIMING
from regionik.timing.smooth_path import STEERED, SmoothPath, smooth_path
from regionik.values import Motion
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.robot import Robot

OPTIONS = TIMING.slowing

AT_REST = 1e-12  # squared path velocity at rest between runs; rounding in toppra does not bear 0
MIN_USE = 1e-3  # of the steering, at a path velocity of 1
LAST = 1 - 1e-9  # share of a segment: at its end the next one starts
CHECKED_SHARES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, LAST)  # of a segment, at which limits are checked
LIMITED_SHARES = (0.0, 0.5, LAST)  # at which the parametrization keeps accelerations


def path_of(robot: Robot, motion: Motion) -> SmoothPath:
    """Return the smooth path through a motion's states."""
    return smooth_path(robot.drive, motion.base, motion.joints)


def fastest_times(
    limits: MotionLimits,
    motion: Motion,
    tightenings: int = OPTIONS.max_tightenings,
    tightened: Array | None = None,
) -> Array:
    """Times of a motion's states, (n,) [s]; see `fastest_rates`."""
    position, rate = fastest_rates(limits, motion, tightenings, tightened)
    length, twice = np.diff(position), rate[1:] + rate[:-1]
    span = 2 * length / np.where(length > 0, twice, 1.0)
    span += steering_pauses(path_of(limits.robot, motion), span, limits.speeds.steering_velocity)
    return np.concatenate([[0.0], np.cumsum(span)])


def steering_pauses(path: SmoothPath, span: Array, velocity: float) -> Array:
    """Time for which a car rests on each segment besides, until its steering is turned, (n - 1,) [s].

    The steering turns while the car stands, with the arm moving or not.
    """
    pauses, rests = np.zeros(len(span)), np.flatnonzero(path.lengths == 0)
    end, steering = np.concatenate([[0.0], np.cumsum(span)]), path.steering
    for before, after in pairwise(np.flatnonzero(~np.isnan(steering)).tolist()):
        rest = int(np.searchsorted(rests, after)) - 1
        turned = abs(steering[after] - steering[before])
        if turned > STEERED and rest >= 0 and rests[rest] > before:
            pauses[rests[rest]] = max(0.0, turned / velocity - (end[after] - end[before + 1]))
    return pauses


def fastest_rates(
    limits: MotionLimits, motion: Motion, tightenings: int, tightened: Array | None = None
) -> tuple[Array, Array]:
    """Path positions and velocities of a motion's states, (n,).

    Limits are kept at both ends and in the middle of each segment; where they are exceeded elsewhere, they
    are tightened over that run. They may be ``tightened`` by factors on segments (n - 1,) to begin with.
    """
    path = path_of(limits.robot, motion)
    moving = np.flatnonzero(path.lengths > 0)
    rate, todo = np.zeros(len(motion)), np.arange(len(moving))
    factor = np.ones(len(moving)) if tightened is None else tightened[moving]
    if not len(moving):
        return path.position, rate
    every = _MovingSegments(limits, path, moving, limits.tool_speeds(motion)[moving])
    for left in range(tightenings, -1, -1):
        part = every.take(todo)
        found = np.where(part.at_rest, 0.0, part.fastest_rates(factor[todo]))
        rate[part.segments], rate[part.segments + 1] = found[:-1], found[1:]
        if not left:
            break
        excess = part.excess(found)
        factor[todo] *= np.maximum(excess, 1.0)
        run = np.cumsum(part.at_rest[:-1])
        todo = todo[np.isin(run, run[excess > 1 + OPTIONS.excess])]
        if not len(todo):
            break
    return path.position, rate


@dataclass(frozen=True, eq=False)
class _MovingSegments:
    """Segments of a path that have a length, whole runs of them, one after the other."""

    limits: MotionLimits
    path: SmoothPath
    segments: Index  # (m,)
    tool_speed: Array  # (m,) greatest of the tool, infinite for none [m/s]

    def take(self, some: Index) -> _MovingSegments:
        """Some of the segments, whole runs of them."""
        return replace(self, segments=self.segments[some], tool_speed=self.tool_speed[some])

    @cached_property
    def grid(self) -> Array:
        """Path positions of their ends, without what lies between, (m + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.path.lengths[self.segments])])

    @cached_property
    def at_rest(self) -> Mask:
        """Ends at which the robot rests, (m + 1,)."""
        return np.concatenate([[True], np.diff(self.segments) > 1, [True]])

    def evaluate(self, shares: Sequence[float]) -> tuple[Array, Array, Array]:
        """Coordinates q at shares of each segment, share by share, with q_s and q_ss; (k m, 3 + dof)."""
        return self.path.evaluate(*self._places(shares))

    def steered(self, shares: Sequence[float]) -> Array:
        """What a car's steering uses of its rate at a path velocity of 1, as `evaluate`, (k m,)."""
        limit = OPTIONS.steering_share * self.limits.speeds.steering_velocity
        return self.path.steering_rate(*self._places(shares)) / limit

    def _places(self, shares: Sequence[float]) -> tuple[Array, Index]:
        """Path positions and segments (k m,)."""
        length, start = self.path.lengths[self.segments], self.path.position[self.segments]
        position = np.concatenate([start + share * length for share in shares])
        return position, np.tile(self.segments, len(shares))

    def fastest_rates(self, factor: Array) -> Array:
        """Path velocities at the ends, (m + 1,), within limits tightened by factors (m,)."""
        samples, most = [], np.where(self.at_rest, AT_REST, np.inf)
        for share in LIMITED_SHARES:
            q, q_s, q_ss = self.evaluate([share])
            if share != LIMITED_SHARES[1]:
                ends = slice(None, -1) if share == 0.0 else slice(1, None)
                allowed = self.limits.largest_squared_velocity(q, q_s, self.tool_speed) / factor
                steered = 1 / np.maximum(self.steered([share]), MIN_USE) ** 2 / factor
                most[ends] = np.minimum(most[ends], np.minimum(allowed, steered))
            first, second, limit = self.limits.limited_derivatives(q_s, q_ss)
            samples.append(PathDerivatives(share, first * factor[:, None], second * factor[:, None]))
        return time_optimal_velocities(self.grid, samples, limit, most)

    def excess(self, rate: Array) -> Array:
        """Factor by which the squared path velocity is too large on each segment, (m,)."""
        count = len(CHECKED_SHARES)
        q, q_s, q_ss = self.evaluate(CHECKED_SHARES)
        length = np.tile(np.diff(self.grid), count)[:, None]
        gain = np.tile(np.diff(rate**2), count)[:, None]  # x grows linearly along a segment, x = s'^2
        shares = np.repeat(CHECKED_SHARES, len(self.segments))[:, None]
        velocity = np.sqrt(np.maximum(np.tile(rate[:-1] ** 2, count)[:, None] + shares * gain, 0.0))
        acceleration = q_s * gain / (2 * length) + q_ss * velocity**2
        factor = self.limits.slowdown(q, q_s * velocity, acceleration, np.tile(self.tool_speed, count))
        factor = np.maximum(factor, self.steered(CHECKED_SHARES) * velocity[:, 0])
        return (factor**2).reshape(count, -1).max(0)
