"""Accuracy with which the base parks at its stops."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import frozen, one_line
from regionik.worlds.errors import InputError

ROUNDING = 1e-9  # share of the largest variance by which a covariance may be off


@dataclass(frozen=True)
class ParkingAccuracy:
    """Normal error of the base's pose after parking.

    Attributes
    ----------
    covariance : (3, 3) array_like, kept as nested tuples
        Of x, y [m2] and yaw [rad2] in the world's axes, as in a ``PoseWithCovariance`` of ROS in the map
        frame. A variance may be zero.
    probability : float or None
        Least probability that a stop is still good for its set-points; None asks for none.

    Examples
    --------
    >>> ParkingAccuracy(np.diag([0.02, 0.02, 0.03]) ** 2, probability=0.999).probability
    0.999
    """

    covariance: ArrayLike
    probability: float | None = None

    __repr__ = one_line

    def __post_init__(self) -> None:
        C = frozen(self.covariance, (3, 3), "parking: covariance")
        slack = ROUNDING * float(np.abs(C).max())
        if float(np.abs(C - C.T).max()) > slack:
            raise InputError(f"parking: covariance: expected a symmetric matrix, got {C.tolist()}")
        least = float(np.linalg.eigvalsh(C)[0])
        if least < -slack:
            raise InputError(
                f"parking: covariance: expected no eigenvalue below 0, that is no variance below 0 in any "
                f"direction, got {least:g}"
            )
        if self.probability is not None and not 0 < self.probability < 1:
            raise InputError(f"parking: probability: must be above 0 and below 1, got {self.probability:g}")
        object.__setattr__(self, "covariance", tuple(map(tuple, C.tolist())))
