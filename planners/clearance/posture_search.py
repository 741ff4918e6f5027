"""A posture of an arm on a fixed base that meets a pose and touches nothing: looked for, never proven."""

from __future__ import annotations

import numpy as np

from regionik.planners.clearance.proximity import Touch, nearest
from regionik.planners.clearance.robot_bodies import Bodies, ContactTargets
from regionik.planners.solvers.damped_least_squares import Aim, polish
from regionik.planners.solvers.mfabrik_serial import in_arm_frame
from regionik.planners.solvers.multistart_ik import Effort, spread_postures
from regionik.planners.solvers.rigid_bodies import posing_bodies
from regionik.worlds.arrays import Array

LOOKS = 60  # postures, every other one drawn at random
STEPS = 60  # of damped least squares that take each to the pose
FARTHEST = 1.0  # change of a joint when the best posture so far is varied [rad] or [m]


def look_round(
    bodies: Bodies,
    base: Array,
    aim: Aim,
    joints: Array,
    effort: Effort,
    *,
    contact: ContactTargets | None = None,
    margin: float = 0.0,
    seed: int = 0,
) -> tuple[Array, float] | None:
    """Postures on a pose come to from random ones, and from the one that is nearest to being clear.

    Parameters
    ----------
    bodies : Bodies
        Robot and obstacles.
    base : (3,) array
        x, y [m], yaw [rad]; it stands still.
    aim : Aim
        In the world.
    joints : (dof,) array
        Posture to start from, clear or not.
    effort : Effort
        Tolerances and the arm's length.
    contact : ContactTargets, optional
        What may be touched.
    margin : float
        Kept beyond the bodies' clearance [m].
    seed : int

    Returns
    -------
    Joints and what the tool misses [m]; None where no posture that was met is clear.
    """
    chain, T = bodies.robot.chain, bodies.robot.T_world_arm(base)
    arm, rng = posing_bodies(chain).arm, np.random.default_rng([seed, 2])
    here = in_arm_frame(T[:2, 3], float(np.arctan2(T[1, 0], T[0, 0])), float(T[2, 3]), aim)
    best, most = np.clip(joints, chain.lower, chain.upper), -np.inf
    for k, fresh in enumerate(spread_postures(chain, effort.reach, LOOKS, seed)):
        q = fresh
        if k % 2 == 0:
            change = FARTHEST * 10.0 ** rng.uniform(-3, 0) * rng.normal(size=chain.dof)
            q = np.clip(best + change, chain.lower, chain.upper)
        error, angle, _ = polish(arm, here, q, effort.reach, effort.tolerance, effort.angle_tolerance, STEPS)
        if error > effort.tolerance or angle > effort.angle_tolerance:
            continue
        room = _room(bodies, nearest(bodies, base, q, contact=contact))
        if room >= margin:
            return q, float(error)
        if room > most:
            best, most = q, room
    return None


def _room(bodies: Bodies, touch: Touch) -> float:
    """Distance at a touch; from obstacles, beyond the bodies' clearance [m]."""
    return touch.distance - (bodies.clearance if touch.kind == "obstacle" else 0.0)
