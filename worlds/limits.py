"""What plans keep beside the rules: criteria of postures, errors of execution and parking, speeds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import Array, frozen, one_line, scalar_or_tuple
from regionik.worlds.chain import Chain
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


COVARIANCE_ROUNDING = 1e-9  # share of the largest variance by which a covariance may be off


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
        slack = COVARIANCE_ROUNDING * float(np.abs(C).max())
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
