"""Criteria that postures meet at set-points, besides reaching them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regionik.worlds.arrays import Array, one_line, scalar_or_tuple
from regionik.worlds.errors import InputError


@dataclass(frozen=True)
class Criteria:
    """Thresholds that a posture at a set-point must meet together; None sets none.

    Attributes
    ----------
    manipulability : float, optional
        Least manipulability sqrt(det(J J^T)) of Yoshikawa, J (3, dof) being the Jacobian of the tool's
        position by all joints of the arm, its pivot included and the base standing still [m3].
    joint_margin : float, optional
        Least distance of every joint from both of its limits, as a share of its range: 0 to below 0.5.
        Joints without limits keep any.
    effort : float or sequence of float, optional
        Largest torque (force of a sliding joint) due to gravity at all joints, or at each [N m] or [N]; the
        robot needs masses or a payload.

    Examples
    --------
    >>> Criteria(manipulability=0.01, joint_margin=0.05)
    Criteria(manipulability=0.01, joint_margin=0.05)
    """

    manipulability: float | None = None
    joint_margin: float | None = None
    effort: float | tuple[float, ...] | None = None

    __repr__ = one_line

    def __post_init__(self) -> None:
        object.__setattr__(self, "effort", scalar_or_tuple(self.effort))
        if self.manipulability is not None and not 0 <= self.manipulability < np.inf:
            raise InputError(f"criteria: manipulability: must be at least 0, got {self.manipulability:g}")
        if self.joint_margin is not None and not 0 <= self.joint_margin < 0.5:
            raise InputError(
                f"criteria: joint_margin: expected a share of the range from 0 to below 0.5, "
                f"got {self.joint_margin:g}"
            )
        for one in self.effort if isinstance(self.effort, tuple) else (self.effort,):
            if one is not None and not one > 0:
                raise InputError(f"criteria: effort: must be above 0, got {one:g}")

    @property
    def beyond_limits(self) -> bool:
        """True where more is asked than a margin to the joint limits."""
        return bool(self.manipulability) or self.effort is not None

    def efforts(self, dof: int) -> Array:
        """Return the limits of effort (dof,); infinite where there are none."""
        return np.broadcast_to(np.array(np.inf if self.effort is None else self.effort, dtype=float), (dof,))
