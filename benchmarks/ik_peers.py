"""Other solvers of inverse kinematics, all asked alike: a target and a start in, joint values out.

Each is made from our own reading of the chain, so that all solve the same arm, and raises ModuleNotFoundError
where its package is absent. None is told our answers; what they return is judged by the caller.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain

Ask = Callable[
    [Array, Array, Array], Array | None
]  # target (4, 4), start (dof,), its orientation as x, y, z, w

TURN = 2 * np.pi  # to either side, where a joint has no limit and the peer wants one


def bounds(chain: Chain) -> tuple[Array, Array]:
    """Limits with numbers in the place of infinity."""
    return np.maximum(chain.lower, -TURN), np.minimum(chain.upper, TURN)


def trac_ik(chain: Chain, tolerance: float, timeout: float) -> Ask:
    """TRAC-IK (C++): Newton steps with restarts beside sequential quadratic programming, two threads."""
    import pytracik

    eps = tolerance / np.sqrt(3)  # it asks it of every component of position and turn
    solver = pytracik.TRAC_IK("l0", "tip", _urdf(chain), timeout, eps, pytracik.SolveType.Speed)

    def ask(T: Array, start: Array, turn: Array) -> Array | None:
        found = pytracik.ik(solver, start, *T[:3, 3], *turn)
        return found[1:] if found[0] >= 0 else None

    return ask


def toolbox(
    chain: Chain, tolerance: float, posed: bool, method: str, gain: float, turn_weight: float, searches: int
) -> Ask:
    """Robotics Toolbox' Levenberg-Marquardt in C++ with random restarts.

    It weighs angles against lengths by ``turn_weight``, and so ends where both are within the tolerance.
    """
    import roboticstoolbox as rtb
    from spatialmath import SE3

    lower, upper = bounds(chain)
    ets = rtb.ETS()
    for k, joint in enumerate(chain.joints):
        A = np.eye(4)
        A[:3, :3] = _turn_to(joint.axis)
        move = rtb.ET.Rz if joint.kind == "revolute" else rtb.ET.tz
        ets = ets * rtb.ET.SE3(SE3(joint.T_parent_joint @ A, check=False))
        ets = ets * move(qlim=[lower[k], upper[k]]) * rtb.ET.SE3(SE3(A.T, check=False))
    ets = ets * rtb.ET.SE3(SE3(np.array(chain.T_last_tool), check=False))
    mask = np.array([1.0] * 3 + [turn_weight if posed else 0.0] * 3)
    enough = 0.5 * tolerance**2

    def ask(T: Array, start: Array, _turn: Array) -> Array | None:
        found = ets.ik_LM(T, q0=start, slimit=searches, tol=enough, mask=mask, k=gain, method=method)
        return np.asarray(found.q) if found.success else None

    return ask


def pink(
    chain: Chain, tolerance: float, angle_tolerance: float, posed: bool, starts: Array, steps: int
) -> Ask:
    """Pink's differential inverse kinematics by quadratic programs, stepped until there, with restarts."""
    import pinocchio as pin
    from pink import Configuration, solve_ik
    from pink.exceptions import PinkError
    from pink.limits import ConfigurationLimit
    from pink.tasks import FrameTask

    model = pinocchio_model(chain, pin)
    data = model.createData()  # type: ignore[attr-defined]
    limits = [ConfigurationLimit(model, config_limit_gain=1.0)]
    task = FrameTask("tip", position_cost=1.0, orientation_cost=0.3 if posed else 0.0, lm_damping=1e-3)
    lower, upper = bounds(chain)

    def ask(T: Array, start: Array, _turn: Array) -> Array | None:
        task.set_target(pin.SE3(T))
        for first in (start, *starts):
            state = Configuration(model, data, np.clip(first, lower, upper), copy_data=False)
            for _ in range(steps):
                error = task.compute_error(state)
                near = np.linalg.norm(error[:3]) < tolerance
                if near and (not posed or np.linalg.norm(error[3:]) < angle_tolerance):
                    return np.array(state.q)
                try:
                    speed = solve_ik(state, [task], 1.0, solver="daqp", limits=limits, safety_break=False)
                except PinkError:
                    break
                state = Configuration(
                    model, data, np.clip(state.integrate(speed, 1.0), lower, upper), copy_data=False
                )
        return None

    return ask


def pinocchio_model(chain: Chain, pin: object) -> object:
    model = pin.Model()  # type: ignore[attr-defined]
    kinds = {
        "revolute": pin.JointModelRevoluteUnaligned,  # type: ignore[attr-defined]
        "prismatic": pin.JointModelPrismaticUnaligned,  # type: ignore[attr-defined]
    }
    lower, upper = bounds(chain)
    fast = np.full(1, 1e3)
    parent = 0
    for k, joint in enumerate(chain.joints):
        place = pin.SE3(np.array(joint.T_parent_joint))  # type: ignore[attr-defined]
        one = slice(k, k + 1)
        kind = kinds[joint.kind](*joint.axis)
        parent = model.addJoint(parent, kind, place, joint.name, fast, fast, lower[one], upper[one])
    tip = pin.SE3(np.array(chain.T_last_tool))  # type: ignore[attr-defined]
    model.addFrame(pin.Frame("tip", parent, tip, pin.FrameType.OP_FRAME))  # type: ignore[attr-defined]
    return model


def _urdf(chain: Chain) -> str:
    """The chain alone, from link l0 to link tip."""
    parts = []
    for k, joint in enumerate(chain.joints):
        endless = joint.kind == "revolute" and np.isinf(joint.lower) and np.isinf(joint.upper)
        limit = f'<limit lower="{joint.lower!r}" upper="{joint.upper!r}" effort="1" velocity="1"/>'
        parts.append(
            f'<link name="l{k}"/><joint name="j{k}" type="{"continuous" if endless else joint.kind}">'
            f'{_origin(joint.T_parent_joint)}<parent link="l{k}"/><child link="l{k + 1}"/>'
            f'<axis xyz="{" ".join(map(repr, joint.axis.tolist()))}"/>{"" if endless else limit}</joint>'
        )
    n = chain.dof
    parts.append(
        f'<link name="l{n}"/><link name="tip"/><joint name="end" type="fixed">{_origin(chain.T_last_tool)}'
        f'<parent link="l{n}"/><child link="tip"/></joint>'
    )
    return f'<robot name="arm">{"".join(parts)}</robot>'


def _origin(T: Array) -> str:
    rpy = Rotation.from_matrix(T[:3, :3]).as_euler("xyz")
    words = (" ".join(map(repr, values.tolist())) for values in (T[:3, 3], rpy))
    return '<origin xyz="{}" rpy="{}"/>'.format(*words)


def _turn_to(axis: Array) -> Array:
    """A rotation whose z axis is a unit axis, (3, 3)."""
    side = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(side, axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])
