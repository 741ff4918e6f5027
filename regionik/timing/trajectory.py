"""Timed plans as functions of time, and plans row by row: at their states or at a fixed rate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionik.timing.extrusion import extrusion_of
from regionik.timing.limits import tool_velocity
from regionik.timing.options import TIMING
from regionik.timing.smooth_path import SmoothPath, smooth_path
from regionik.timing.time_spline import TimeSpline, time_spline
from regionik.values import Motion, Plan
from regionik.worlds.arrays import Array, Index, Mask, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Speeds
from regionik.worlds.prepared import made_once
from regionik.worlds.robot import Robot

AT_REST = 1e-6  # path velocity at the end of a run, as a share of the largest


@dataclass(frozen=True, eq=False)
class TrajectorySample:
    """A motion at n instants.

    Attributes
    ----------
    time : (n,) array
        [s]
    base, base_velocity, base_acceleration : (n, 3) arrays
        x, y [m], yaw [rad], unwrapped, and their derivatives, in the world.
    joints, joint_velocity, joint_acceleration : (n, dof) arrays
    jerk : (n, 3 + dof) array, optional
        Of base and joints; none where accelerations have jumps.
    """

    time: Array
    base: Array
    joints: Array
    base_velocity: Array
    joint_velocity: Array
    base_acceleration: Array
    joint_acceleration: Array
    jerk: Array | None = None

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

    Between two states the path acceleration is constant along the path of `regionik.timing.smooth_path`, so
    that the times of the states determine the whole.
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

    @property
    def knots(self) -> tuple[Array, Index]:
        """Times (p + 1,) between which all rates are smooth [s], and the segment that each lies on (p,)."""
        return self.motion.time, np.arange(len(self.motion) - 1)

    def sample(self, times: ArrayLike) -> TrajectorySample:
        """Motion at some instants (n,) [s].

        Raises
        ------
        InputError
            For an instant before the start or after the end.
        """
        t = frozen(np.atleast_1d(np.asarray(times)), (None,), "times")
        if len(t) and (t.min() < 0 or t.max() > self.duration):
            raise InputError(f"times: expected from 0 to {self.duration:g} s, got {t.min():g} to {t.max():g}")
        q, v, a, jerk = self._rates(t)
        return TrajectorySample(t, q[:, :3], q[:, 3:], v[:, :3], v[:, 3:], a[:, :3], a[:, 3:], jerk)

    def _rates(self, times: Array) -> tuple[Array, Array, Array, Array | None]:
        """Base and joints q (n, 3 + dof) at instants, with q' = q_s s' and q'' = q_s s'' + q_ss s'^2.

        And with jerk where it is limited.
        """
        time, lengths, rate = self.motion.time, self._path.lengths, self.rates
        if not lengths.any():  # nothing moves
            q = np.tile(np.concatenate([self.motion.base[0], self.motion.joints[0]]), (len(times), 1))
            return q, 0.0 * q, 0.0 * q, 0.0 * q
        moving = np.flatnonzero(lengths > 0)
        segment = moving[np.clip(np.searchsorted(time[moving], times, side="right") - 1, 0, None)]
        span = time[segment + 1] - time[segment]
        acceleration = (rate[segment + 1] - rate[segment]) / span
        elapsed = np.clip(times - time[segment], 0.0, span)
        travelled = elapsed * (rate[segment] + elapsed * acceleration / 2)
        q, q_s, q_ss = self._path.evaluate(self._path.position[segment] + travelled, segment)
        goes = (times <= time[segment + 1])[:, None]  # else it rests, until a car's steering is turned
        velocity = goes * (rate[segment] + elapsed * acceleration)[:, None]
        acceleration = goes * acceleration[:, None]
        return q, q_s * velocity, q_s * acceleration + q_ss * velocity**2, None

    @cached_property
    def _path(self) -> SmoothPath:
        return smooth_path(self.robot.drive, self.motion.base, self.motion.joints)

    @cached_property
    def rates(self) -> Array:
        """Path velocity at each state, (n,): at constant acceleration between, from rest to rest in each run.

        Raises
        ------
        InputError
            Where no such motion has these times.
        """
        lengths, span = self._path.lengths, np.diff(self.motion.time)
        instant = (lengths > 0) & (span <= 0)
        if instant.any():
            at = self.motion.time[int(np.argmax(instant))]
            raise InputError(f"times: the robot moves on at {at:g} s, but no time passes; time the plan anew")
        means = (lengths / np.where(lengths > 0, span, 1.0)).tolist()
        found = [0.0]
        for mean in means:
            found.append(2 * mean - found[-1] if mean > 0 else 0.0)
        rate = np.array(found)
        tolerance = AT_REST * max(rate.max(), 1.0)
        ends = np.append(lengths, 0.0) == 0
        if rate.min() < -tolerance or np.abs(rate[ends]).max() > tolerance:
            raise InputError("times: no constant acceleration between states has these; time the plan anew")
        return np.where(ends, 0.0, np.maximum(rate, 0.0))


@dataclass(frozen=True, eq=False)
class SplineTrajectory(Trajectory):
    """The same where jerk is limited: each coordinate is a cubic spline of time through all states.

    At rest velocities and accelerations are zero, see `regionik.timing.time_spline`.
    """

    def __post_init__(self) -> None:
        first, last = self.spline.ends
        wrong = (self._path.lengths > 0) & ((np.diff(self.motion.time) <= 0) | (first & last))
        if wrong.any():
            at = self.motion.time[int(np.argmax(wrong))]
            raise InputError(f"times: no motion without jumps has these at {at:g} s; time the plan anew")

    @property
    def knots(self) -> tuple[Array, Index]:
        return self.spline.knots.time, self.spline.knots.segment[:-1]

    @cached_property
    def spline(self) -> TimeSpline:
        """Through the states."""
        return time_spline(self._path, self.motion.time)

    def _rates(self, times: Array) -> tuple[Array, Array, Array, Array | None]:
        return super()._rates(times) if len(self.motion) == 1 else self.spline.evaluate(times)


def trajectory_within(robot: Robot, motion: Motion, speeds: Speeds | None) -> Trajectory:
    """Return a timed motion as a function of time, without jumps of acceleration where jerk is limited."""
    kind = SplineTrajectory if speeds is not None and speeds.limit_jerk else Trajectory
    return kind(robot, motion)


@made_once
def trajectory(plan: Plan) -> Trajectory:
    """Return a timed plan as a function of time.

    Parameters
    ----------
    plan : Plan
        A plan with times: from `regionik.retime`, or from `regionik.plan` where world or robot limit speeds.

    Returns
    -------
    Trajectory
        Its ``sample(times)`` gives base, joints, velocities and accelerations at any instants [s]; its
        ``duration`` is the time of the last state [s].

    Raises
    ------
    InputError
        For a plan that is not timed.
    """
    if not is_timed(plan.motion):
        raise InputError("plan: it is not timed; `regionik.retime` or the command retime does that")
    return trajectory_within(plan.world.robot, plan.motion, plan.world.speeds)


def is_timed(motion: Motion) -> bool:
    """Return whether every state of a motion has a time."""
    return len(motion) > 0 and not bool(np.isnan(motion.time).any())


@dataclass(frozen=True, eq=False)
class PlanSamples:
    """A plan at n instants.

    Attributes
    ----------
    sample : TrajectorySample
        Times and speeds are NaN where the plan is not timed.
    kind : (n,) array of str
        "setpoint", "step" or "transit"; between two states a transit where either is one, else a step.
    setpoint : (n,) array of int
        As in `Motion`; between two states that of the last set-point, -1 on transits.
    tool_on : (n,) array of bool
        True where the tool works from there on, see `Plan.tool_on`.
    extrusion, extrusion_rate : (n,) arrays, optional
        Material fed by then, and how fast from there on [1/s], in the unit of `Target.flow`; none where the
        task tells no flow.
    """

    sample: TrajectorySample
    kind: NDArray[np.str_]
    setpoint: NDArray[np.int64]
    tool_on: Mask
    extrusion: Array | None = None
    extrusion_rate: Array | None = None

    def __len__(self) -> int:
        return len(self.kind)


def sample_plan(plan: Plan, rate: float | None = None) -> PlanSamples:
    """Sample a plan at its states, or at a fixed rate.

    Parameters
    ----------
    plan : Plan
    rate : float, optional
        Rows a second, from 0 to the end, which is always the last row [1/s]; by default every state is one,
        with its base and joints to the last digit.

    Raises
    ------
    InputError
        When the rate is not above 0 or gives more than a million rows, or where there is one and the plan is
        not timed.
    """
    return _at_states(plan) if rate is None else _at_rate(plan, rate)


def _at_states(plan: Plan) -> PlanSamples:
    motion = plan.motion
    if is_timed(motion):
        sample = replace(trajectory(plan).sample(motion.time), base=motion.base, joints=motion.joints)
    else:
        unknown = np.full_like(motion.base, np.nan), np.full_like(motion.joints, np.nan)
        sample = TrajectorySample(motion.time, motion.base, motion.joints, *unknown, *unknown)
    fed = _fed(plan, sample, np.arange(len(motion)))
    return PlanSamples(sample, motion.kind, motion.setpoint, plan.tool_on(), *fed)


def _at_rate(plan: Plan, rate: float) -> PlanSamples:
    if not 0 < rate < np.inf:
        raise InputError(f"rate: expected a number above 0, got {rate:g}")
    moving, motion = trajectory(plan), plan.motion
    count = moving.duration * rate
    if count >= TIMING.max_rows:
        most = TIMING.max_rows / moving.duration
        raise InputError(f"rate: expected at most {most:.6g} 1/s for this plan, got {rate:g}")
    # An end within rounding of a whole number of periods is not listed twice.
    times = np.append(np.arange(np.ceil(count - 1e-6)) / rate, moving.duration)
    before = np.searchsorted(motion.time, times, side="right") - 1
    after = np.minimum(before + 1, len(motion) - 1)
    on_state = times == motion.time[before]
    lifted = (motion.kind[before] == "transit") | (motion.kind[after] == "transit")
    kind = np.where(on_state, motion.kind[before], np.where(lifted, "transit", "step"))
    last = np.maximum.accumulate(np.where(motion.kind == "setpoint", motion.setpoint, -1))[before]
    setpoint = np.where(on_state, motion.setpoint[before], np.where(lifted, -1, last))
    sample = moving.sample(times)
    return PlanSamples(sample, kind, setpoint, plan.tool_on()[before], *_fed(plan, sample, before))


def _fed(plan: Plan, sample: TrajectorySample, segment: Index) -> tuple[Array | None, Array | None]:
    """Material fed by rows of a plan on segments, and its rate; of no flow none."""
    found, robot = extrusion_of(plan), plan.world.robot
    if found is None:
        return None, None
    speed = np.linalg.norm(tool_velocity(robot, *sample.columns[:2]), axis=1)
    tools = robot.tool(sample.base, sample.joints)[:, :3, 3]
    return found.at(tools, segment), found.flow[segment] * speed
