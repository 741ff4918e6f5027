"""Limits of speed, acceleration and jerk by which plans are timed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regionik.worlds.arrays import Array, one_line, scalar_or_tuple
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError

REVOLUTE_SPEED, PRISMATIC_SPEED = 1.0, 0.1  # of joints that have no limit [rad/s], [m/s]
RISE_TIME = 0.5  # from rest to full speed, where no acceleration is given [s]
BLEND = 2e-4  # [m]


@dataclass(frozen=True)
class Speeds:
    """Limits of speed, acceleration and jerk; None stands for the robot's own, or for a default.

    Attributes
    ----------
    joint_velocity : float or sequence of float, optional
        Of all joints, or of each; by default the robot's, and 1 rad/s or 0.1 m/s where it has none.
    joint_acceleration : float or sequence of float, optional
        By default the robot's, and full speed within half a second where it has none.
    joint_jerk : float or sequence of float, optional
        Of all joints, or of each [rad/s3] or [m/s3]; None for no limit. With any limit of jerk a plan's
        accelerations have no jumps.
    base_velocity, base_acceleration, base_jerk : float
        Of the base's origin [m/s], [m/s2], [m/s3]; jerk None for no limit.
    turn_velocity, turn_acceleration, turn_jerk : float
        Of its heading [rad/s], [rad/s2], [rad/s3]; jerk None for no limit.
    steering_velocity : float
        Of a car's steering: of a wheel one turning radius ahead of the axle, which is turned by 45 degrees on
        the tightest arc [rad/s].
    wheel_velocity : float, optional
        Of the rim of either driven wheel of a differential base whose ``gauge`` is known [m/s].
    tool_velocity : float, optional
        Of the tool while it works [m/s].
    blend : float
        By which points of the robot may cut corners; with the tool lifted it may be more. A timed motion
        leaves the lines between its own states by no more than this, nor than the default [m].

    Examples
    --------
    >>> Speeds(joint_velocity=[1.0, 2.0], tool_velocity=0.1)
    Speeds(joint_velocity=(1.0, 2.0), tool_velocity=0.1)
    """

    joint_velocity: float | tuple[float, ...] | None = None
    joint_acceleration: float | tuple[float, ...] | None = None
    joint_jerk: float | tuple[float, ...] | None = None
    base_velocity: float = 0.5
    base_acceleration: float = 1.0
    base_jerk: float | None = None
    turn_velocity: float = 1.0
    turn_acceleration: float = 2.0
    turn_jerk: float | None = None
    steering_velocity: float = 1.0
    wheel_velocity: float | None = None
    tool_velocity: float | None = None
    blend: float = BLEND

    __repr__ = one_line

    def __post_init__(self) -> None:
        for key in ("joint_velocity", "joint_acceleration", "joint_jerk"):
            object.__setattr__(self, key, scalar_or_tuple(getattr(self, key)))
        for key, value in vars(self).items():
            for one in value if isinstance(value, tuple) else (value,):
                if one is not None and not one > 0:
                    raise InputError(f"speeds: {key}: must be above 0, got {one:g}")
        if not np.isfinite(self.blend):
            raise InputError(f"speeds: blend: expected a finite length, got {self.blend}")

    @property
    def limit_jerk(self) -> bool:
        """There is a limit of jerk, so that accelerations have no jumps."""
        return any(one is not None for one in (self.joint_jerk, self.base_jerk, self.turn_jerk))

    def joint_limits(self, chain: Chain) -> tuple[Array, Array]:
        """Return the velocity and acceleration limits of each joint, (dof,) each.

        Raises
        ------
        InputError
            When there are not as many as joints.
        """
        default = np.array(
            [REVOLUTE_SPEED if j.kind == "revolute" else PRISMATIC_SPEED for j in chain.active_joints]
        )
        own = np.array([joint.velocity for joint in chain.active_joints])
        own = np.where(np.isfinite(own), own, default)
        velocity = _per_joint(self.joint_velocity, own, chain, "joint_velocity")
        own = np.array([joint.acceleration for joint in chain.active_joints])
        own = np.where(np.isfinite(own), own, velocity / RISE_TIME)
        return velocity, _per_joint(self.joint_acceleration, own, chain, "joint_acceleration")

    def joint_jerks(self, chain: Chain) -> Array:
        """Return the limit of jerk of each joint, (dof,), infinite for none.

        Raises
        ------
        InputError
            When there are not as many as joints.
        """
        return _per_joint(self.joint_jerk, np.full(chain.dof, np.inf), chain, "joint_jerk")


def _per_joint(values: float | tuple[float, ...] | None, default: Array, chain: Chain, what: str) -> Array:
    if values is None:
        return default
    if isinstance(values, tuple) and len(values) != chain.dof:
        names = ", ".join(chain.names)
        raise InputError(f"speeds: {what}: expected one number or {chain.dof} ({names}), got {len(values)}")
    return np.broadcast_to(np.asarray(values, dtype=np.float64), (chain.dof,)).copy()
