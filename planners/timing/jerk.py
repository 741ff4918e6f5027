"""The fastest joint motion between two states within velocity, acceleration and jerk; only ruckig does this.

Source: Berscheid and Kröger, Jerk-limited real-time trajectory generation with arbitrary target states
(RSS 2021).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from ruckig import InputParameter, Ruckig, RuckigError, Synchronization
from ruckig import Trajectory as Profile

from regionik.planners.timing.polynomial import Moment, times_within
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError, RegionikError

FAR = 1e9  # numbers beyond this make no motion of a robot


@dataclass(frozen=True, eq=False)
class JerkLimited:
    """A motion of all joints that begin and end together.

    Attributes
    ----------
    duration : float
        [s]
    """

    duration: float
    _profile: Any

    def at(self, t: ArrayLike) -> Moment:
        """Position, velocity and acceleration at times within the motion, each (*times, dof).

        Raises
        ------
        InputError
            For a time outside 0 to ``duration``.
        """
        times = times_within(t, self.duration)
        rows = np.array([self._profile.at_time(float(one)) for one in times.ravel()])
        return Moment(*(rows[:, k].reshape(*times.shape, -1) for k in range(3)))

    def extremes(self) -> tuple[Array, Array, Array, Array]:
        """Least and largest position of each joint, and when it is there [s], (dof,) each."""
        found = self._profile.position_extrema
        return (
            np.array([one.min for one in found]),
            np.array([one.max for one in found]),
            np.array([one.t_min for one in found]),
            np.array([one.t_max for one in found]),
        )


def jerk_limited(
    start: Moment, end: Moment, velocity: ArrayLike, acceleration: ArrayLike, jerk: ArrayLike
) -> JerkLimited:
    """The fastest motion from one state to another; joints keep a straight line where their ends allow it.

    Parameters
    ----------
    start, end : Moment
        Positions, velocities and accelerations, (dof,) each [rad] or [m], over [s] and [s2].
    velocity, acceleration, jerk : (dof,) array_like
        Limits, above 0; infinite for none.

    Raises
    ------
    InputError
        For numbers that are not finite, limits not above 0, and ends beyond the limits, naming the joint by
        its number from 1.

    Examples
    --------
    >>> still = Moment(np.zeros(1), np.zeros(1), np.zeros(1))
    >>> there = Moment(np.ones(1), np.zeros(1), np.zeros(1))
    >>> motion = jerk_limited(still, there, [2.0], [2.0], [8.0])
    >>> float(motion.duration), float(motion.at(motion.duration / 2).position[0])
    (1.6861406616345072, 0.5)
    """
    dof = len(start.position)
    limits = {
        "velocity": _limits("velocity", velocity, dof),
        "acceleration": _limits("acceleration", acceleration, dof),
        "jerk": _limits("jerk", jerk, dof),
    }
    asked = InputParameter(dof)
    for side, moment in (("current", start), ("target", end)):
        for what, values in moment._asdict().items():
            _check(f"{'start' if side == 'current' else 'end'} {what}", values, limits.get(what))
            setattr(asked, f"{side}_{what}", np.asarray(values, dtype=np.float64).tolist())
    for what, limit in limits.items():
        setattr(asked, f"max_{what}", limit.tolist())
    asked.synchronization = Synchronization.Phase
    profile = Profile(dof)
    try:
        result = Ruckig(dof).calculate(asked, profile)
    except RuckigError as error:  # for instance an end acceleration that leaves no time to brake
        raise InputError(f"point to point: ends and limits do not go together ({error})") from None
    if result.value < 0:
        raise RegionikError(f"point to point: the engine found no motion ({result.name})")
    return JerkLimited(float(profile.duration), profile)


def _limits(what: str, values: ArrayLike, dof: int) -> Array:
    limits = np.broadcast_to(np.asarray(values, dtype=np.float64), (dof,))
    for k, limit in enumerate(limits.tolist(), 1):
        if not limit > 0.0:
            raise InputError(f"{what} limit of joint {k}: must be above 0, got {limit:g}")
    return limits


def _check(what: str, values: ArrayLike, limits: Array | None) -> None:
    most = np.full(np.shape(values), FAR) if limits is None else np.minimum(limits, FAR)
    for k, (value, limit) in enumerate(zip(np.asarray(values).tolist(), most.tolist(), strict=True), 1):
        if not abs(value) <= limit:
            raise InputError(f"{what} of joint {k}: expected at most {limit:g}, got {value:g}")
