"""Where a timed plan is at any moment, and how fast."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from regionik.timing.curve import Curve, running_on
from regionik.values import Motion, Plan
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.robot import Robot

RESTS = 1e-6  # path velocity at the end of a run, of the largest in it


@dataclass(frozen=True, eq=False)
class Sample:
    """A motion at n instants.

    Attributes
    ----------
    time : (n,) array
        [s]
    base, base_velocity, base_acceleration : (n, 3) arrays
        x, y [m], yaw [rad], which runs on beyond a turn, and their derivatives, in the world.
    joints, joint_velocity, joint_acceleration : (n, dof) arrays
    """

    time: Array
    base: Array
    joints: Array
    base_velocity: Array
    joint_velocity: Array
    base_acceleration: Array
    joint_acceleration: Array

    @property
    def columns(self) -> tuple[Array, Array, Array]:
        """Base and joints side by side, (n, 3 + dof), their velocities and accelerations."""
        return (
            np.concatenate([self.base, self.joints], axis=1),
            np.concatenate([self.base_velocity, self.joint_velocity], axis=1),
            np.concatenate([self.base_acceleration, self.joint_acceleration], axis=1),
        )


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A timed motion as a function of time.

    Between two states the path acceleration is even along the smooth path of `regionik.timing.curve`, so
    that the times of the states tell all.

    Attributes
    ----------
    robot : Robot
    motion : Motion
    """

    robot: Robot
    motion: Motion

    def __post_init__(self) -> None:
        if self.rates[-1] != 0.0:
            raise InputError("times: the robot does not come to rest; time the plan anew")

    @property
    def duration(self) -> float:
        """[s]"""
        return float(self.motion.time[-1])

    def sample(self, times: ArrayLike) -> Sample:
        """The robot at some instants (n,) [s].

        Raises
        ------
        InputError
            For an instant before the start or after the end.
        """
        t = frozen(np.atleast_1d(np.asarray(times)), (None,), "times")
        if len(t) and (t.min() < 0 or t.max() > self.duration):
            raise InputError(f"times: expected from 0 to {self.duration:g} s, got {t.min():g} to {t.max():g}")
        z, velocity, acceleration = self._at(t)
        return Sample(
            t, z[:, :3], z[:, 3:], velocity[:, :3], velocity[:, 3:], acceleration[:, :3], acceleration[:, 3:]
        )

    def _at(self, times: Array) -> tuple[Array, Array, Array]:
        """Base and joints at instants, (n, 3 + dof), their velocities and accelerations."""
        time, hops, rate = self.motion.time, self._curve.hops, self.rates
        if not hops.any():  # nothing moves
            z = np.tile(np.concatenate([self.motion.base[0], self.motion.joints[0]]), (len(times), 1))
            return z, 0.0 * z, 0.0 * z
        going = np.flatnonzero(hops > 0)
        hop = going[np.clip(np.searchsorted(time[going], times, side="right") - 1, 0, None)]
        span = time[hop + 1] - time[hop]
        push, gone = (rate[hop + 1] - rate[hop]) / span, np.clip(times - time[hop], 0.0, span)
        position = self._curve.position[hop] + gone * (rate[hop] + gone * push / 2)
        z, slope, bend = self._curve.along(position, hop)
        now, push = (rate[hop] + gone * push)[:, None], push[:, None]
        return z, slope * now, slope * push + bend * now**2

    @cached_property
    def _curve(self) -> Curve:
        return running_on(self.robot.drive, self.motion.base, self.motion.joints)

    @cached_property
    def rates(self) -> Array:
        """Path velocity at each state, (n,): evenly accelerated between, from rest to rest in each run.

        Raises
        ------
        InputError
            Where no such motion has these times.
        """
        hops, span = self._curve.hops, np.diff(self.motion.time)
        if ((hops > 0) & (span <= 0)).any():
            at = self.motion.time[int(np.argmax((hops > 0) & (span <= 0)))]
            raise InputError(f"times: the robot moves on at {at:g} s, but no time passes; time the plan anew")
        means = (hops / np.where(hops > 0, span, 1.0)).tolist()
        found = [0.0]
        for mean in means:
            found.append(2 * mean - found[-1] if mean > 0 else 0.0)
        rate = np.array(found)
        most = RESTS * max(rate.max(), 1.0)
        ends = np.append(hops, 0.0) == 0
        if rate.min() < -most or np.abs(rate[ends]).max() > most:
            raise InputError("times: no even acceleration between states has these; time the plan anew")
        return np.where(ends, 0.0, np.maximum(rate, 0.0))


@lru_cache(maxsize=8)
def trajectory(plan: Plan) -> Trajectory:
    """A timed plan as a function of time.

    Raises
    ------
    InputError
        For a plan that is not timed.
    """
    motion = plan.motion
    if not len(motion) or np.isnan(motion.time).any():
        raise InputError("plan: it is not timed; `regionik.retime` or the command retime does that")
    return Trajectory(plan.world.robot, motion)
