"""Pink, a rival in inverse kinematics: a target and a start in, joint values out.

It is made from our own reading of the chain, so that both solve the same arm, and raises ModuleNotFoundError
where its package is absent. What it returns is judged by the caller.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain

Ask = Callable[
    [Array, Array, Array], Array | None
]  # target (4, 4), start (dof,), its orientation as x, y, z, w

TURN = 2 * np.pi  # to either side, where a joint has no limit and the peer wants one


def bounds(chain: Chain) -> tuple[Array, Array]:
    """Limits with numbers in the place of infinity."""
    return np.maximum(chain.lower, -TURN), np.minimum(chain.upper, TURN)


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
