"""Inverse kinematics of any serial arm on a fixed base: FABRIK-R, polishing, restarts.

>>> from regionik.worlds.bundled import robot_named
>>> robot = robot_named("pioneer7")
>>> solver = ArmSolver(robot.chain)
>>> answer = solver(Goal([0.3, 0.0, 0.15]), robot.carry)
>>> answer.converged, answer.steps
(True, ('passes',))
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.solvers.damped_least_squares import DIRECTION, ORIENTATION, POSITION, Aim
from regionik.planners.solvers.multistart_ik import Effort, solve_ik
from regionik.planners.solvers.rigid_bodies import RigidBodies, pointing_bodies, posing_bodies, span
from regionik.planners.solvers.serial_chain import spread_postures
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError


@dataclass(frozen=True, eq=False)
class Goal:
    """Goal of the tool in the arm's base frame.

    Attributes
    ----------
    position : (3,) array
        [m]
    direction : (3,) array or None
        Of the tool's z axis, any length; the roll about it is free.
    orientation : (3, 3) array or None
        Rotation matrix of the tool frame. At most one of direction and orientation may be given.
    """

    position: Array
    direction: Array | None = None
    orientation: Array | None = None

    def __init__(
        self, position: ArrayLike, direction: ArrayLike | None = None, orientation: ArrayLike | None = None
    ) -> None:
        if direction is not None and orientation is not None:
            raise InputError("goal: expected a direction or an orientation, got both")
        object.__setattr__(self, "position", frozen(position, (3,), "goal: position"))
        object.__setattr__(self, "direction", None if direction is None else _unit(direction))
        object.__setattr__(self, "orientation", None if orientation is None else _rotation(orientation))

    @property
    def aim(self) -> Aim:
        """The goal as kernels take it."""
        turn, kind = np.eye(3), POSITION
        if self.orientation is not None:
            turn, kind = np.array(self.orientation), ORIENTATION
        elif self.direction is not None:
            turn[:, 2], kind = self.direction, DIRECTION
        return Aim(np.array(self.position), kind, turn)


@dataclass(frozen=True, eq=False)
class ArmPosture:
    """The answer to one goal, checked by the chain's own forward kinematics.

    Attributes
    ----------
    joints : (dof,) array
        Within limits; the nearest posture found where it did not converge [rad] or [m].
    error, angle_error : float
        Of the tool [m], [rad]; the angle is 0 where the goal has none.
    iterations : int
        Passes, forward and backward together one, restarts included.
    restarts : int
    steps : tuple of str
        Of "passes", "restarts", "polish": those that led to the answer.
    converged : bool
    reason : str
        One line when not converged, else empty.
    """

    joints: Array
    error: float
    angle_error: float
    iterations: int
    restarts: int
    steps: tuple[str, ...]
    converged: bool
    reason: str


class ArmSolver:
    """A chain prepared for many goals.

    Parameters
    ----------
    chain : Chain
    tolerance, angle_tolerance : float
        [m], [rad]
    most_passes : int
        From each start.
    restarts : int
        Other postures to start from, drawn once from ``seed`` within the limits.
    polish : bool
        Whether damped least squares may finish what passes do not.
    """

    def __init__(
        self,
        chain: Chain,
        tolerance: float = 1e-3,
        angle_tolerance: float = 1e-3,
        most_passes: int = 300,
        restarts: int = 10,
        polish: bool = True,
        seed: int = 0,
    ) -> None:
        for name, value in (("tolerance", tolerance), ("angle_tolerance", angle_tolerance)):
            if not 0.0 < value < np.inf:
                raise InputError(f"{name}: expected a number above 0, got {value}")
        for name, count in (("most_passes", most_passes), ("restarts", restarts)):
            if count < 0:
                raise InputError(f"{name}: expected 0 or more, got {count}")
        self.chain = chain
        self.pointing, self.posing = pointing_bodies(chain), posing_bodies(chain)
        self.effort = Effort(
            float(tolerance), float(angle_tolerance), int(most_passes), span(self.posing.arm), bool(polish)
        )
        self.starts = spread_postures(chain, self.effort.reach, restarts, seed)

    def __call__(self, goal: Goal, joints: ArrayLike) -> ArmPosture:
        """Solve one goal from a start posture, which is taken into the limits first."""
        chain, aim = self.chain, goal.aim
        q = np.clip(frozen(joints, (chain.dof,), "joints"), chain.lower, chain.upper)
        _, _, passes, restarts, polished = self.solve(aim, q)
        error, angle = confirm(chain, aim, q)
        converged = error <= self.effort.tolerance and angle <= self.effort.angle_tolerance
        steps = ("passes",) + ("restarts",) * (restarts > 0) + ("polish",) * bool(polished)
        reason = "" if converged else why_not(chain, aim, self.starts, self.effort, q, error, angle, passes)
        q.flags.writeable = False
        return ArmPosture(q, error, angle, passes, restarts, steps, converged, reason)

    def bodies(self, kind: int) -> RigidBodies:
        """The bodies that the kernel `solve_ik` needs for a kind of aim."""
        return self.pointing if kind == POSITION else self.posing

    def solve(self, aim: Aim, joints: Array) -> tuple[float, float, int, int, bool]:
        """`solve_ik` of the chain; overwrites ``joints`` (dof,), which are within the limits."""
        bodies = self.bodies(aim.kind)
        starts = np.ascontiguousarray(self.starts[:, : len(bodies.slide)])
        found: tuple[float, float, int, int, bool] = solve_ik(bodies, aim, starts, self.effort, joints)
        return found


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


def _unit(direction: ArrayLike) -> Array:
    d = frozen(direction, (3,), "goal: direction")
    length = float(np.linalg.norm(d))
    if length < 1e-9:
        raise InputError("goal: direction must not be zero")
    return frozen(d / length, (3,), "goal: direction")


def _rotation(orientation: ArrayLike) -> Array:
    R = frozen(orientation, (3, 3), "goal: orientation")
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0:
        raise InputError(f"goal: orientation must be a rotation matrix, got {R.tolist()}")
    return R


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
    """One line on why a goal was missed by ``error`` [m] and ``angle`` [rad] at ``joints``.

    Proofs come first: too far, too near. Then the goal is solved again without limits, and without the tool's
    direction. Else the search itself failed.
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
    """Words on the joint farthest past its limits once it may be; empty where the goal is missed even so."""
    arm = bodies.arm
    if np.isinf(arm.lower).all() and np.isinf(arm.upper).all():
        return ""
    free = arm._replace(lower=np.full_like(arm.lower, -np.inf), upper=np.full_like(arm.upper, np.inf))
    n, q = len(arm.axis), joints.copy()
    error, angle, *_ = solve_ik(
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
    error, *_ = solve_ik(bodies, at, np.ascontiguousarray(starts[:, :n]), effort._replace(polishing=True), q)
    return bool(error <= effort.tolerance)
