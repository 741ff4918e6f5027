"""Criteria that postures meet at set-points, besides reaching them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from regionik.worlds.arrays import Array, one_line, scalar_or_tuple
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.robot import Robot


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

    def check(self, robot: Robot) -> None:
        """Refuse criteria that do not apply to a robot.

        Raises
        ------
        InputError
            When effort is limited for a robot without masses, or for another number of joints.
        """
        if self.effort is None:
            return
        dof = robot.chain.dof
        if isinstance(self.effort, tuple) and len(self.effort) != dof:
            raise InputError(
                f"criteria: effort: expected one limit, or {dof} ({', '.join(robot.chain.names)}), "
                f"got {len(self.effort)}"
            )
        if not robot.loads:
            raise InputError(
                f"criteria: effort: {robot.name} has no masses: give robot.masses or robot.payload in the "
                "world file, or inertial elements in its URDF"
            )

    def efforts(self, dof: int) -> Array:
        """Return the limits of effort (dof,); infinite where there are none."""
        return np.broadcast_to(np.array(np.inf if self.effort is None else self.effort, dtype=float), (dof,))


def with_joint_margin(robot: Robot, criteria: Criteria | None) -> Robot:
    """Return the robot with its joint limits narrowed by the joint margin of the criteria."""
    margin = None if criteria is None else criteria.joint_margin
    return robot if not margin else _narrowed(robot, margin)


@lru_cache(maxsize=64)
def _narrowed(robot: Robot, margin: float) -> Robot:
    joints = tuple(
        replace(one, lower=one.lower + margin * span, upper=one.upper - margin * span)
        if np.isfinite(span := one.upper - one.lower)
        else one
        for one in robot.chain.joints
    )
    return replace(robot, chain=Chain(joints, robot.chain.T_last_tool))
