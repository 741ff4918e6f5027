"""Single goals put to a method of inverse kinematics, its answers judged by the chain's own kinematics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from regionik.papers.rivals.method import ArmMethod
from regionik.planners.solvers.damped_least_squares import DIRECTION, ORIENTATION, POSITION, Aim
from regionik.planners.solvers.multistart_ik import ArmSolver
from regionik.worlds.arrays import Array, frozen, unit_vector
from regionik.worlds.chain import Chain


@dataclass(frozen=True, eq=False)
class ArmPosture:
    """The answer to one goal."""

    joints: Array  # (dof,) within limits; the nearest posture found where it did not converge [rad] or [m]
    # error, angle_error: of the tool [m], [rad]; the angle is 0 where the goal has none
    error: float
    angle_error: float
    iterations: int  # restarts included
    restarts: int
    steps: tuple[str, ...]  # of FABRIK-R: "passes", "restarts", "polish", those that led to the answer
    converged: bool


def aim_at(
    position: ArrayLike, direction: ArrayLike | None = None, orientation: ArrayLike | None = None
) -> Aim:
    """Aim at a position (3,) [m] in the arm's base frame, with the tool's z axis (3,) or all of its frame."""
    turn, kind = np.eye(3), POSITION
    if orientation is not None:
        turn, kind = np.array(orientation), ORIENTATION
    elif direction is not None:
        turn[:, 2], kind = unit_vector(direction, "direction"), DIRECTION
    return Aim(np.array(frozen(position, (3,), "position")), kind, turn)


def solve_goal(method: ArmSolver | ArmMethod, aim: Aim, joints: ArrayLike) -> ArmPosture:
    """Solve one goal from a start posture (dof,), which is clipped to the limits first."""
    chain = method.chain
    q = np.clip(frozen(joints, (chain.dof,), "joints"), chain.lower, chain.upper)
    if isinstance(method, ArmSolver):
        tolerance, angle_tolerance = method.effort.tolerance, method.effort.angle_tolerance
        _, _, count, restarts, polished = method.solve(aim, q)
        steps = ("passes",) + ("restarts",) * (restarts > 0) + ("polish",) * bool(polished)
    else:
        tolerance, angle_tolerance = method.tolerance, method.angle_tolerance
        q, _, _, count, restarts = method.search(aim, q)
        steps = (method.name,)
    error, angle = confirm(chain, aim, q)
    converged = error <= tolerance and angle <= angle_tolerance
    return ArmPosture(q, error, angle, count, restarts, steps, converged)


def confirm(chain: Chain, aim: Aim, joints: Array) -> tuple[float, float]:
    """Errors of the tool [m], [rad] by the chain's own forward kinematics, in plain numpy."""
    tool = chain.forward(joints)
    error = float(np.linalg.norm(tool[:3, 3] - aim.position))
    if aim.kind == POSITION:
        return error, 0.0
    if aim.kind == DIRECTION:
        z, wanted = tool[:3, 2], aim.turn[:, 2]
        return error, float(np.arctan2(np.linalg.norm(np.cross(z, wanted)), z @ wanted))
    R = aim.turn @ tool[:3, :3].T
    sine = 0.5 * np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return error, float(np.arctan2(sine, 0.5 * (np.trace(R) - 1.0)))
