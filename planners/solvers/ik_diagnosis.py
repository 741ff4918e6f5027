"""Why an arm does not reach its goal, in one line."""

from __future__ import annotations

import numpy as np

from regionik.planners.solvers.damped_least_squares import POSITION, Aim
from regionik.planners.solvers.multistart_ik import Effort, solve
from regionik.planners.solvers.rigid_bodies import RigidBodies, pointing_bodies, posing_bodies
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain


def why_not(
    chain: Chain,
    aim: Aim,
    starts: Array,
    effort: Effort,
    joints: Array,
    error: float,
    angle: float,
    passes: int,
) -> str:
    """One line on a goal that was missed by ``error`` [m] and ``angle`` [rad] at ``joints``.

    What is certain comes first: too far, too near. Then what solving again with less asked shows: without
    limits, without the tool's direction. Else the search itself gave out.
    """
    point = pointing_bodies(chain)
    distance = float(np.linalg.norm(aim.position - point.root))
    least, most = reach_bounds(point)
    if distance > most + effort.tolerance:
        return f"the target lies {distance - most:.4g} m beyond the arm's stretched length of {most:.4g} m"
    if distance < least - effort.tolerance:
        return f"the target is {least - distance:.4g} m closer than the arm can fold, {least:.4g} m"
    bodies = point if aim.kind == POSITION else posing_bodies(chain)
    beyond = _without_limits(bodies, aim, starts, effort, joints)
    if beyond:
        return f"no posture within the joint limits was found; without them {beyond}"
    if aim.kind != POSITION and _position_alone(point, aim, starts, effort, joints):
        what = f"{error:.4g} m and {angle:.4g} rad" if error > effort.tolerance else f"{angle:.4g} rad"
        return f"the position can be reached, but not in this direction: {what} are missing"
    missing = f"{error:.4g} m" if angle <= effort.angle_tolerance else f"{error:.4g} m and {angle:.4g} rad"
    return f"passes stalled {missing} from the goal after {passes} passes from {len(starts) + 1} postures"


def reach_bounds(bodies: RigidBodies) -> tuple[float, float]:
    """Least and greatest distance of the tool from the root point that the bodies' lengths allow [m]."""
    longest = np.linalg.norm(bodies.outer, axis=1)
    shortest = longest.copy()
    for k in np.flatnonzero(~bodies.arm.revolute):
        travel = np.array([bodies.arm.lower[k], bodies.arm.upper[k]])
        if not np.isfinite(travel).all():
            return 0.0, np.inf
        middle = float(np.clip(-bodies.outer[k] @ bodies.arm.axis[k], *travel))
        ends = bodies.outer[k] + np.multiply.outer(np.append(travel, middle), bodies.arm.axis[k])
        lengths = np.linalg.norm(ends, axis=1)
        longest[k], shortest[k] = lengths.max(), lengths.min()
    rest = longest.sum() - longest
    return float(max(0.0, (shortest - rest).max())), float(longest.sum())


def _without_limits(bodies: RigidBodies, aim: Aim, starts: Array, effort: Effort, joints: Array) -> str:
    """Which joints leave their limits once they may; empty where that does not help either."""
    arm = bodies.arm
    if np.isinf(arm.lower).all() and np.isinf(arm.upper).all():
        return ""
    free = arm._replace(lower=np.full_like(arm.lower, -np.inf), upper=np.full_like(arm.upper, np.inf))
    n, q = len(arm.axis), joints.copy()
    error, angle, *_ = solve(
        bodies._replace(arm=free),
        aim,
        np.ascontiguousarray(starts[:, :n]),
        effort._replace(polishing=True),
        q,
    )
    if error > effort.tolerance or angle > effort.angle_tolerance:
        return ""
    middle = np.where(np.isfinite(arm.lower + arm.upper), 0.5 * (arm.lower + arm.upper), q[:n])
    turns = np.where(arm.revolute, np.round((q[:n] - middle) / (2 * np.pi)), 0.0)
    q[:n] -= 2 * np.pi * turns
    excess = np.maximum(arm.lower - q[:n], q[:n] - arm.upper)
    k = int(np.argmax(excess))
    unit = "rad" if arm.revolute[k] else "m"
    return f"the goal is met, joint {k + 1} being {excess[k]:.4g} {unit} past its limit"


def _position_alone(bodies: RigidBodies, aim: Aim, starts: Array, effort: Effort, joints: Array) -> bool:
    n, q = len(bodies.slide), joints.copy()
    at = Aim(aim.position, POSITION, np.eye(3))
    error, *_ = solve(bodies, at, np.ascontiguousarray(starts[:, :n]), effort._replace(polishing=True), q)
    return bool(error <= effort.tolerance)
