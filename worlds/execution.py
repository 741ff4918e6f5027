"""Errors that a plan allows for: of a robot that executes it, and of a base that has parked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import frozen, one_line
from regionik.worlds.errors import InputError

ROUNDING = 1e-9  # share of the largest variance by which a covariance may be off


@dataclass(frozen=True)
class Execution:
    """Largest errors of a robot that executes a plan: against the plan's own state at that moment.

    Attributes
    ----------
    base_error : float
        Distance of the base from its place [m].
    heading_error : float
        Of the base [rad].
    tool_error : float
        Distance of the tool from its place, while it is on its path [m].
    arm_error : float or None
        Distance of any point of the arm from its place; None for as much as base and tool are off [m].

    Examples
    --------
    >>> Execution(base_error=0.005, tool_error=0.004)
    Execution(base_error=0.005, tool_error=0.004)
    """

    base_error: float = 0.0
    heading_error: float = 0.0
    tool_error: float = 0.0
    arm_error: float | None = None

    __repr__ = one_line

    def __post_init__(self) -> None:
        for key, value in vars(self).items():
            if value is not None and not 0 <= value < np.inf:
                raise InputError(f"execution: {key}: must be at least 0, got {value:g}")
        if self.heading_error >= np.pi:
            raise InputError(
                f"execution: heading_error: must be below pi, as it is in radians, got {self.heading_error:g}"
            )

    def base_allowance(self, lever: float) -> float:
        """Distance by which a point of the base, ``lever`` from its origin, may be off its place [m]."""
        return self.base_error + lever * self.heading_error

    def arm_allowance(self, lever: float) -> float:
        """Distance by which a point of the arm may be off its place, the base's points within a lever [m]."""
        return max(self.arm_error or 0.0, self.tool_error, self.base_allowance(lever))


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
