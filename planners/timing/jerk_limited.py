"""Time-optimal joint motion between two states within velocity, acceleration and jerk, by ruckig alone.

Source: Berscheid and Kröger, Jerk-limited real-time trajectory generation with arbitrary target states
(RSS 2021).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from ruckig import InputParameter, Ruckig, RuckigError, Synchronization
from ruckig import Trajectory as Profile

from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError, RegionikError

LARGEST = 1e9  # numbers beyond this make no motion of a robot


class KinematicState(NamedTuple):
    """Positions, velocities and accelerations, each of shape (*times, *joints)."""

    position: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True, eq=False)
class JerkLimited:
    """Motion of all joints, which begin and end together."""

    duration: float  # [s]
    _profile: Any

    def at(self, t: ArrayLike) -> KinematicState:
        """Position, velocity and acceleration at times within the motion, each (*times, dof).

        Raises
        ------
        InputError
            For a time outside 0 to ``duration``.
        """
        times = times_within(t, self.duration)
        rows = np.array([self._profile.at_time(float(one)) for one in times.ravel()])
        return KinematicState(*(rows[:, k].reshape(*times.shape, -1) for k in range(3)))

    def extremes(self) -> tuple[Array, Array, Array, Array]:
        """Least and largest position of each joint, and the times of both [s], (dof,) each."""
        found = self._profile.position_extrema
        return (
            np.array([one.min for one in found]),
            np.array([one.max for one in found]),
            np.array([one.t_min for one in found]),
            np.array([one.t_max for one in found]),
        )


def jerk_limited(
    start: KinematicState, end: KinematicState, velocity: ArrayLike, acceleration: ArrayLike, jerk: ArrayLike
) -> JerkLimited:
    """Return the fastest motion from one state to another, on a straight line where its ends allow it.

    Parameters
    ----------
    start, end : KinematicState
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
    >>> still = KinematicState(np.zeros(1), np.zeros(1), np.zeros(1))
    >>> there = KinematicState(np.ones(1), np.zeros(1), np.zeros(1))
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
    for side, state in (("current", start), ("target", end)):
        for what, values in state._asdict().items():
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


def times_within(t: ArrayLike, duration: float) -> Array:
    """Times of any shape, checked to lie within a motion of that duration [s]."""
    times = np.asarray(t, dtype=np.float64)
    outside = times[~((times >= 0.0) & (times <= duration))]
    if outside.size:
        raise InputError(f"time: expected 0 to {duration:g} s, got {outside[0]:g}")
    return times


def _limits(what: str, values: ArrayLike, dof: int) -> Array:
    limits = np.broadcast_to(np.asarray(values, dtype=np.float64), (dof,))
    for k, limit in enumerate(limits.tolist(), 1):
        if not limit > 0.0:
            raise InputError(f"{what} limit of joint {k}: must be above 0, got {limit:g}")
    return limits


def _check(what: str, values: ArrayLike, limits: Array | None) -> None:
    most = np.full(np.shape(values), LARGEST) if limits is None else np.minimum(limits, LARGEST)
    for k, (value, limit) in enumerate(zip(np.asarray(values).tolist(), most.tolist(), strict=True), 1):
        if not abs(value) <= limit:
            raise InputError(f"{what} of joint {k}: expected at most {limit:g}, got {value:g}")
