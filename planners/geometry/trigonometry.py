"""Sine, cosine and arctangent without a branch or a call, so that a loop over them takes several at a time.

Polynomials are minimax on the octant that an angle is brought to, and answers good to two units in the last
place. Their coefficients come from Remez' exchange in 60 digits.
"""

from __future__ import annotations

from typing import cast

import numpy as np
from numba import njit

from regionik.planners.geometry.flat import Kernel

LARGEST = 1e6  # angle up to which the octant is found to the last digit [rad]

_PER_QUARTER = 2.0 / np.pi
_QUARTER = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)  # 33 bits, 33 bits, the rest
_STEEPEST = np.sqrt(2.0) - 1.0  # tangent of half an octant
_EIGHTH, _HALF = 0.25 * np.pi, 0.5 * np.pi


def woven(function: Kernel) -> Kernel:
    """Compile into every kernel that calls it; floats are divided as the processor divides them.

    Types are inferred once and the machine code goes in, which compiles twice as fast as the source going in.
    A product and a sum may be rounded once where the processor does both in one.
    """
    return cast(Kernel, njit(forceinline=True, error_model="numpy", fastmath={"contract"})(function))


@woven
def cosine_sine(angle: float) -> tuple[float, float]:
    """Cosine and sine of an angle up to `LARGEST` [rad].

    Examples
    --------
    >>> cosine_sine(0.0)
    (1.0, 0.0)
    """
    quarters = np.rint(angle * _PER_QUARTER)
    x = ((angle - quarters * _QUARTER[0]) - quarters * _QUARTER[1]) - quarters * _QUARTER[2]
    s = x * x
    sine = 1.6058362882989472e-10 + s * -7.578526137283049e-13
    sine = 2.7557319214056574e-06 + s * (-2.505210487966735e-08 + s * sine)
    sine = -0.16666666666666666 + s * (0.008333333333333323 + s * (-0.00019841269841254784 + s * sine))
    sine = x + x * s * sine
    cosine = 2.0875723278132235e-09 + s * -1.13596480422716e-11
    cosine = 2.480158728948234e-05 + s * (-2.7557314352372173e-07 + s * cosine)
    cosine = 0.0416666666666666 + s * (-0.0013888888888874125 + s * cosine)
    cosine = 1.0 - (0.5 * s - s * s * cosine)
    left = quarters - 4.0 * np.floor(0.25 * quarters)  # 0, 1, 2 or 3
    odd = left == 1.0 or left == 3.0
    c, s = (sine if odd else cosine), (cosine if odd else sine)
    return (-c if left == 1.0 or left == 2.0 else c), (-s if left >= 2.0 else s)


@woven
def turned(angle: float) -> tuple[float, float]:
    """Cosine and sine of any angle [rad]."""
    if abs(angle) > LARGEST:
        return np.cos(angle), np.sin(angle)
    return cosine_sine(angle)


@woven
def direction(y: float, x: float) -> float:
    """Angle of the direction (x, y), as arctan2 counts it; zero where there is none [rad].

    Examples
    --------
    >>> direction(0.0, 2.0)
    0.0
    """
    across, along = abs(y), abs(x)
    less, more = min(across, along), max(across, along)
    steep = less > _STEEPEST * more
    over, under = (less - more if steep else less), (less + more if steep else more)
    t = over / (1.0 if under == 0.0 else under)
    s = t * t
    angle = -0.03347042331010824 + s * 0.01519167265368737
    angle = -0.0521834710343151 + s * (0.045033477126923634 + s * angle)
    angle = -0.06666225565647617 + s * (0.05877011584260914 + s * angle)
    angle = -0.09090908139909254 + s * (0.0769228266675238 + s * angle)
    angle = -0.14285714285385362 + s * (0.11111111088032478 + s * angle)
    angle = -0.33333333333333326 + s * (0.19999999999997645 + s * angle)
    angle = t + t * s * angle
    angle = _EIGHTH + angle if steep else angle
    angle = _HALF - angle if across > along else angle
    angle = np.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle
