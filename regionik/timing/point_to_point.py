"""Jerk-limited motion of the arm from one posture to another, without a path."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.timing.jerk_limited import JerkLimited, KinematicState, jerk_limited
from regionik.timing.options import TIMING
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Speeds
from regionik.worlds.robot import Robot

SLACK = 1e-9  # rounding allowed at joint limits [rad] or [m]


def point_to_point(
    robot: Robot,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    speeds: Speeds | None = None,
    jerk: ArrayLike | None = None,
    start_velocity: ArrayLike = 0.0,
    goal_velocity: ArrayLike = 0.0,
) -> JerkLimited:
    """Move the arm from one posture to another as fast as velocity, acceleration and jerk allow.

    From rest to rest the joints keep a straight line between their postures. Obstacles and the robot's own
    body are ignored: for a motion that is free of them, plan one and time it.

    Parameters
    ----------
    robot : Robot
    start, goal : (dof,) array_like
        Joints [rad] or [m].
    speeds : Speeds, optional
        Limits of velocity, acceleration and jerk; by default those of the robot.
    jerk : float or (dof,) array_like, optional
        Limits [rad/s3] or [m/s3]; by default those of the speeds, else full acceleration within a quarter of
        a second.
    start_velocity, goal_velocity : float or (dof,) array_like
        [rad/s] or [m/s]

    Raises
    ------
    InputError
        For numbers that are not finite, limits not above 0, velocities beyond the limits, and a motion that
        leaves the joints' limits, with the joint and the time.

    Examples
    --------
    >>> from regionik.worlds.urdf.loader import load_robot
    >>> motion = point_to_point(load_robot("youbot"), [0, 0.5, 0.5, 0, 0], [1, 0.5, 1.0, 0, 0])
    >>> round(motion.duration, 3), motion.at(motion.duration).position.tolist()
    (1.75, [1.0, 0.5, 1.0, 0.0, 0.0])
    """
    chain = robot.chain
    velocity, acceleration = (speeds or Speeds()).joint_limits(chain)
    asked = (speeds or Speeds()).joint_jerk if jerk is None else jerk
    jerks = acceleration / TIMING.default_ramp if asked is None else _each(asked, chain.dof, "jerk")
    rest = np.zeros(chain.dof)
    at = frozen(start, (chain.dof,), "start"), _each(start_velocity, chain.dof, "start_velocity"), rest
    to = frozen(goal, (chain.dof,), "goal"), _each(goal_velocity, chain.dof, "goal_velocity"), rest
    motion = jerk_limited(KinematicState(*at), KinematicState(*to), velocity, acceleration, jerks)
    _check_joint_limits(chain, motion)
    return motion


def _check_joint_limits(chain: Chain, motion: JerkLimited) -> None:
    """Refuse a motion that leaves the joints' limits, with the joint and the time."""
    least, most, at_least, at_most = motion.extremes()
    for k, joint in enumerate(chain.active_joints):
        for value, time in ((least[k], at_least[k]), (most[k], at_most[k])):
            if not joint.lower - SLACK <= value <= joint.upper + SLACK:
                raise InputError(
                    f"{joint.name}: expected {joint.lower:g} to {joint.upper:g}, would be at {value:g} "
                    f"after {time:g} s"
                )


def _each(values: ArrayLike, dof: int, what: str) -> Array:
    given = np.asarray(values, dtype=np.float64)
    return frozen(np.full(dof, given) if given.ndim == 0 else given, (dof,), what)
