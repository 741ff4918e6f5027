"""Tracking errors that a plan allows for, so that it holds wherever its execution strays within them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regionik.worlds.arrays import one_line
from regionik.worlds.errors import InputError


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
