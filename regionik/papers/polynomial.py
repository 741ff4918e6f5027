"""Joint motions as polynomials of order 3 to 5, with given velocities and accelerations at their ends.

Source: de Souza et al. (paper 004), eqs. (5)-(13). Its order 4 is read as bound in its final acceleration,
which its Section IV and Table 6 say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.timing.jerk_limited import KinematicState, times_within
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError

# Coefficients of s^2 (order 5: s^3) and up, from position, velocity and acceleration at s = 1 less those that
# the terms of the start give there.
_BOUND = {
    3: np.array([[3.0, -1.0, 0.0], [-2.0, 1.0, 0.0]]),
    4: np.array([[6.0, -3.0, 0.5], [-8.0, 5.0, -1.0], [3.0, -2.0, 0.5]]),
    5: np.array([[10.0, -4.0, 0.5], [-15.0, 7.0, -1.0], [6.0, -3.0, 0.5]]),
}
ORDERS = tuple(_BOUND)


@dataclass(frozen=True, eq=False)
class Polynomial:
    """Motion of all joints, which begin and end together.

    Attributes
    ----------
    coefficients : (order + 1, *joints) array
        Of the powers of ``t / duration``, the constant first.
    duration : float
        [s]
    """

    coefficients: Array
    duration: float

    def at(self, t: ArrayLike) -> KinematicState:
        """Position, velocity and acceleration at times within the motion.

        Raises
        ------
        InputError
            For a time outside 0 to ``duration``.
        """
        times = times_within(t, self.duration)
        s, powers = times / self.duration, np.arange(len(self.coefficients))
        rows = []
        for derived in range(3):
            factors = np.prod([powers - k for k in range(derived)], axis=0, initial=1.0)
            terms = factors * s[..., None] ** np.maximum(powers - derived, 0) / self.duration**derived
            rows.append(np.tensordot(terms, self.coefficients, axes=1))
        return KinematicState(*rows)


def polynomial(
    order: int,
    start: ArrayLike,
    end: ArrayLike,
    duration: float,
    start_velocity: ArrayLike = 0.0,
    end_velocity: ArrayLike = 0.0,
    start_acceleration: ArrayLike = 0.0,
    end_acceleration: ArrayLike = 0.0,
) -> Polynomial:
    """Polynomial of an order with given ends.

    Parameters
    ----------
    order : {3, 4, 5}
        3 meets velocities alone; 4 the end acceleration too; 5 both accelerations.
    start, end : (*joints) array_like
        [rad] or [m]; so are velocities [1/s] and accelerations [1/s2], or one number for all joints.
    duration : float
        [s]

    Raises
    ------
    InputError
        For another order, no time, numbers that are not finite, or accelerations that the order cannot meet.

    Examples
    --------
    >>> polynomial(5, [0.0, 1.0], [1.0, 3.0], 2.0).at(1.0).position.tolist()
    [0.5, 2.0]
    """
    _check_order(order)
    if not 0.0 < duration < np.inf:
        raise InputError(f"duration: expected a time above 0, got {duration} s")
    q0, q1 = _checked("start", start, 0), _checked("end", end, 0)
    v0, v1 = _checked("start_velocity", start_velocity, 1), _checked("end_velocity", end_velocity, 1)
    a0 = _checked("start_acceleration", start_acceleration, 2)
    a1 = _checked("end_acceleration", end_acceleration, 2)
    if (a0.any() and order < 5) or (a1.any() and order < 4):
        which, needs = ("start", "5") if a0.any() and order < 5 else ("end", "4 or 5")
        raise InputError(f"{which}_acceleration: order {order} cannot meet it, valid choices: order {needs}")
    shape = _common_shape(q0, q1, v0, v1, a0, a1)
    v0, v1, a0, a1 = v0 * duration, v1 * duration, a0 * duration**2, a1 * duration**2  # over s = t / duration
    half = [a0 / 2] if order == 5 else []
    begun = [q0, v0, *half]
    left = [q1 - q0 - v0 - a0 / 2, v1 - v0 - a0, a1 - a0]
    bound = np.tensordot(_BOUND[order], np.array([np.broadcast_to(one, shape) for one in left]), axes=1)
    rows = [np.broadcast_to(one, shape) for one in begun]
    return Polynomial(np.concatenate([np.array(rows).reshape(len(rows), *shape), bound]), float(duration))


def blend(order: int, s: ArrayLike) -> KinematicState:
    """Position b(s) of a motion from 0 to 1, from rest to rest, and its derivatives b', b'' over s in 0 to 1.

    Examples
    --------
    >>> [float(blend(order, 0.25).position) for order in ORDERS]
    [0.15625, 0.26171875, 0.103515625]
    """
    return polynomial(order, 0.0, 1.0, 1.0).at(s)


def _check_order(order: int) -> None:
    if order not in _BOUND:
        raise InputError(f"order: expected one of {', '.join(map(str, ORDERS))}, got {order}")


def _checked(name: str, value: ArrayLike, derived: int) -> Array:
    unit = ("", "/s", "/s2")[derived]
    array = np.asarray(value, dtype=np.float64)
    if not np.isfinite(array).all():
        raise InputError(f"{name}: expected finite numbers [rad{unit}] or [m{unit}], got {array.tolist()}")
    return array


def _common_shape(*arrays: Array) -> tuple[int, ...]:
    try:
        return np.broadcast_shapes(*(array.shape for array in arrays))
    except ValueError:
        shapes = ", ".join(str(array.shape) for array in arrays)
        raise InputError(f"polynomial: expected ends of one shape, got {shapes}") from None
