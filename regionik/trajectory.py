"""Where a timed plan is at any moment, and how fast."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionik.curve import Curve, running_on
from regionik.plan import Motion, Plan
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

    Between two states the path acceleration is even along the smooth path of `regionik.curve`, so that the
    times of the states tell all.

    Attributes
    ----------
    robot : Robot
    motion : Motion
    """

    robot: Robot
    motion: Motion

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
        found = np.zeros((3, len(times), 3 + self.motion.joints.shape[1]))
        if not self._laws:  # nothing moves
            found[0] = np.concatenate([self.motion.base[0], self.motion.joints[0]])
            return found[0], found[1], found[2]
        which = self._run_at(times)
        for run, law in enumerate(self._laws):
            rows = np.flatnonzero(which == run)
            position, rate, push = law.at(times[rows])
            z, slope, bend = self._curve.along(run, position)
            found[0, rows] = z
            found[1, rows] = slope * rate[:, None]
            found[2, rows] = slope * push[:, None] + bend * rate[:, None] ** 2
        return found[0], found[1], found[2]

    @cached_property
    def _curve(self) -> Curve:
        return running_on(self.robot.base, self.motion.base, self.motion.joints)

    @cached_property
    def _laws(self) -> list[Law]:
        position, time = self._curve.position, self.motion.time
        return [Law.through(position[a : b + 1], time[a : b + 1]) for a, b in self._curve.runs]

    def _run_at(self, times: Array) -> NDArray[np.int64]:
        starts = [self.motion.time[a] for a, _ in self._curve.runs]
        return np.maximum(np.searchsorted(starts, times, side="right") - 1, 0)


@dataclass(frozen=True, eq=False)
class Law:
    """How a run's path position goes with time: evenly accelerated between states, from rest to rest.

    Attributes
    ----------
    time, position, rate : (n,) arrays
        Of states; the rate is the path velocity.
    """

    time: Array
    position: Array
    rate: Array

    @classmethod
    def through(cls, position: Array, time: Array) -> Law:
        """The law that has its states at some times.

        Raises
        ------
        InputError
            Where no evenly accelerated motion from rest has them.
        """
        span = np.diff(time)
        if (span <= 0).any():
            k = int(np.argmax(span <= 0))
            raise InputError(
                f"times: the robot moves on at {time[k]:g} s, but no time passes; time the plan anew"
            )
        rate = np.zeros(len(time))
        for k, mean in enumerate((np.diff(position) / span).tolist()):
            rate[k + 1] = 2 * mean - rate[k]
        low = RESTS * max(rate.max(initial=0.0), 1.0)
        if rate.min(initial=0.0) < -low or rate[-1] > low:
            raise InputError("times: no even acceleration between states has these; time the plan anew")
        return cls(time, position, np.maximum(rate, 0.0))

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Path position, velocity and acceleration at instants, (n,) each."""
        k = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, len(self.time) - 2)
        push = (np.diff(self.rate) / np.diff(self.time))[k]
        gone = np.clip(times - self.time[k], 0.0, np.diff(self.time)[k])
        return self.position[k] + gone * (self.rate[k] + gone * push / 2), self.rate[k] + gone * push, push


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
    found = Trajectory(plan.world.robot, motion)
    found.sample([0.0])  # tells of times that fit no motion
    return found
