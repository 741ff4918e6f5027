"""How fast a robot may move: what a plan is timed by."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isnan

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.robot import Robot

JOINT_SPEED, SLIDE_SPEED = 1.0, 0.1  # of joints that have no limit [rad/s], [m/s]
RISE = 0.5  # from rest to full speed, where no acceleration is given [s]


@dataclass(frozen=True)
class Speeds:
    """Limits of speed and acceleration; None stands for what the robot has, or for a plain default.

    Attributes
    ----------
    joint_velocity : float or tuple of float, optional
        Of all joints, or of each; by default the robot's, and 1 rad/s or 0.1 m/s where it has none.
    joint_acceleration : float or tuple of float, optional
        By default full speed within half a second.
    base_velocity, base_acceleration : float
        Of the base's origin [m/s], [m/s2].
    turn_velocity, turn_acceleration : float
        Of its heading [rad/s], [rad/s2].
    wheel_velocity : float, optional
        Of the rim of either driven wheel of a differential base whose ``gauge`` is known [m/s].
    tool_velocity : float, optional
        Of the tool while it works [m/s].
    """

    joint_velocity: float | tuple[float, ...] | None = None
    joint_acceleration: float | tuple[float, ...] | None = None
    base_velocity: float = 0.5
    base_acceleration: float = 1.0
    turn_velocity: float = 1.0
    turn_acceleration: float = 2.0
    wheel_velocity: float | None = None
    tool_velocity: float | None = None

    def __post_init__(self) -> None:
        for key in ("joint_velocity", "joint_acceleration"):
            values = getattr(self, key)
            if isinstance(values, (list, np.ndarray)):
                object.__setattr__(self, key, tuple(float(value) for value in values))
        for key, value in vars(self).items():
            for one in value if isinstance(value, tuple) else (value,):
                if one is not None and (isnan(one) or one <= 0):
                    raise InputError(f"speeds: {key}: must be above 0, got {one:g}")

    def of_joints(self, chain: Chain) -> tuple[Array, Array]:
        """Velocity and acceleration limits of each joint, (dof,) each.

        Raises
        ------
        InputError
            When there are not as many as joints.
        """
        plain = np.array([JOINT_SPEED if j.kind == "revolute" else SLIDE_SPEED for j in chain.joints])
        own = np.array([joint.velocity for joint in chain.joints])
        velocity = _each(self.joint_velocity, np.where(np.isfinite(own), own, plain), chain, "joint_velocity")
        return velocity, _each(self.joint_acceleration, velocity / RISE, chain, "joint_acceleration")

    @property
    def of_wheels(self) -> float:
        return inf if self.wheel_velocity is None else self.wheel_velocity

    @property
    def of_tool(self) -> float:
        return inf if self.tool_velocity is None else self.tool_velocity


def has_speeds(robot: Robot) -> bool:
    """Whether any joint of a robot has a velocity limit."""
    return any(np.isfinite(joint.velocity) for joint in robot.chain.joints)


def _each(values: float | tuple[float, ...] | None, plain: Array, chain: Chain, what: str) -> Array:
    if values is None:
        return plain
    given: ArrayLike = values
    if isinstance(values, tuple) and len(values) != chain.dof:
        names = ", ".join(chain.names)
        raise InputError(f"speeds: {what}: expected one number or {chain.dof} ({names}), got {len(values)}")
    return np.broadcast_to(np.asarray(given, dtype=np.float64), (chain.dof,)).copy()
