"""A plan's motion row by row: at its states, or evenly sampled in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regionik.timing.trajectory import Sample, trajectory
from regionik.values import Motion, Plan
from regionik.worlds.errors import InputError

MOST = 1_000_000  # rows of a file


@dataclass(frozen=True, eq=False)
class Instants:
    """A plan at n instants.

    Attributes
    ----------
    sample : Sample
        Where the robot is and how fast; times and speeds are NaN where the plan is not timed.
    kind : (n,) array of str
        "setpoint", "step" or "transit"; between two states a transit where either is one, else a step.
    setpoint : (n,) array of int
        As in `Motion`; between two states that of the set-point behind, -1 on transits.
    """

    sample: Sample
    kind: NDArray[np.str_]
    setpoint: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.kind)


def is_timed(motion: Motion) -> bool:
    """Whether every state of a motion has a time."""
    return len(motion) > 0 and not bool(np.isnan(motion.time).any())


def instants(plan: Plan, rate: float | None = None) -> Instants:
    """Rows of a plan.

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
    return _at_states(plan) if rate is None else _evenly(plan, rate)


def _at_states(plan: Plan) -> Instants:
    motion = plan.motion
    if is_timed(motion):
        moving = trajectory(plan).sample(motion.time)
        speeds = (
            moving.base_velocity,
            moving.joint_velocity,
            moving.base_acceleration,
            moving.joint_acceleration,
        )
    else:
        unknown = np.full_like(motion.base, np.nan), np.full_like(motion.joints, np.nan)
        speeds = (*unknown, *unknown)
    return Instants(Sample(motion.time, motion.base, motion.joints, *speeds), motion.kind, motion.setpoint)


def _evenly(plan: Plan, rate: float) -> Instants:
    if not 0 < rate < np.inf:
        raise InputError(f"rate: expected a number above 0, got {rate:g}")
    moving, motion = trajectory(plan), plan.motion
    count = moving.duration * rate
    if count >= MOST:
        raise InputError(
            f"rate: expected at most {MOST / moving.duration:.6g} 1/s for this plan, got {rate:g}"
        )
    # An end within rounding of a whole number of periods is not told twice.
    times = np.append(np.arange(np.ceil(count - 1e-6)) / rate, moving.duration)
    behind = np.searchsorted(motion.time, times, side="right") - 1
    ahead = np.minimum(behind + 1, len(motion) - 1)
    on_state = times == motion.time[behind]
    lifted = (motion.kind[behind] == "transit") | (motion.kind[ahead] == "transit")
    kind = np.where(on_state, motion.kind[behind], np.where(lifted, "transit", "step"))
    passed = np.maximum.accumulate(np.where(motion.kind == "setpoint", motion.setpoint, -1))[behind]
    setpoint = np.where(on_state, motion.setpoint[behind], np.where(lifted, -1, passed))
    return Instants(moving.sample(times), kind, setpoint)
