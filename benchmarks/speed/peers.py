"""Other solvers for positions, all asked alike: a target (3,) and a start (dof,) in, joint values out.

Each is made from our own reading of the chain and raises ModuleNotFoundError where its package is absent. Of
each there are a few settings; the caller takes the fastest of those that solve what there is to solve.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.ik_peers import bounds, pinocchio_model, toolbox
from benchmarks.speed.mobile import TOLERANCE
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain

Ask = Callable[[Array, Array], Array | None]
STEPS = 100  # of a loop, before a target is given up


def toolbox_lm(chain: Chain) -> Iterator[tuple[str, Ask]]:
    """Robotics Toolbox' Levenberg-Marquardt in C++, with its random restarts where limits are broken."""
    for method, gain in (("chan", 1.0), ("chan", 0.1), ("chan", 0.01), ("wampler", 1e-2), ("sugihara", 1e-4)):
        solve = toolbox(chain, TOLERANCE, False, method, gain, 1.0, 100)
        T = np.eye(4)

        def ask(target: Array, start: Array, solve=solve, T=T) -> Array | None:  # type: ignore[no-untyped-def]
            T[:3, 3] = target
            found: Array | None = solve(T, start, start)
            return found

        yield f"{method} {gain:g}", ask


def pinocchio_loop(chain: Chain) -> Iterator[tuple[str, Ask]]:
    """Damped least squares in Python on pinocchio's Jacobians, joints clipped to their limits."""
    import pinocchio as pin

    model = pinocchio_model(chain, pin)
    data, tip = model.createData(), model.getFrameId("tip")  # type: ignore[attr-defined]
    lower, upper = bounds(chain)
    for damping in (1e-6, 1e-4, 1e-2):
        added = damping * np.eye(3)

        def ask(target: Array, start: Array, damp: Array = added) -> Array | None:
            q = start
            for _ in range(STEPS):
                J = pin.computeFrameJacobian(model, data, q, tip, pin.LOCAL_WORLD_ALIGNED)[:3]
                miss = target - pin.updateFramePlacement(model, data, tip).translation
                if miss @ miss <= TOLERANCE**2:
                    return q
                q = np.minimum(np.maximum(q + J.T @ np.linalg.solve(J @ J.T + damp, miss), lower), upper)
            return None

        yield f"damping {damping:g}", ask


def pink_loop(chain: Chain) -> Iterator[tuple[str, Ask]]:
    """Pink's quadratic programs, stepped until there, by daqp: limits in the program, or clipped."""
    import pinocchio as pin
    from pink import Configuration, solve_ik
    from pink.limits import ConfigurationLimit
    from pink.tasks import FrameTask

    model = pinocchio_model(chain, pin)
    data = model.createData()  # type: ignore[attr-defined]
    lower, upper = bounds(chain)
    task = FrameTask("tip", position_cost=1.0, orientation_cost=0.0, lm_damping=1e-3)
    for name, limits in (("limits", [ConfigurationLimit(model, config_limit_gain=1.0)]), ("clipped", [])):

        def ask(target: Array, start: Array, limits=limits) -> Array | None:  # type: ignore[no-untyped-def]
            task.set_target(pin.SE3(np.eye(3), target))
            state = Configuration(model, data, start, copy_data=False)
            for _ in range(STEPS):
                miss = task.compute_error(state)[:3]
                if miss @ miss <= TOLERANCE**2:
                    return np.array(state.q)
                speed = solve_ik(state, [task], 1.0, solver="daqp", limits=limits, safety_break=False)
                q = np.minimum(np.maximum(state.integrate(speed, 1.0), lower), upper)
                state = Configuration(model, data, q, copy_data=False)
            return None

        yield name, ask


def mink_loop(chain: Chain) -> Iterator[tuple[str, Ask]]:
    """Mink's quadratic programs on MuJoCo, stepped until there by daqp: limits kept in them, or clipped."""
    import mink
    import mujoco

    model = mujoco.MjModel.from_xml_string(_mjcf(chain))
    state = mink.Configuration(model)
    lower, upper = bounds(chain)
    task = mink.FrameTask("tip", "site", position_cost=1.0, orientation_cost=0.0, lm_damping=1e-3)
    site = model.site("tip").id
    for name, limits in (("limits", [mink.ConfigurationLimit(model, gain=1.0)]), ("clipped", [])):

        def ask(target: Array, start: Array, limits=limits) -> Array | None:  # type: ignore[no-untyped-def]
            task.set_target(mink.SE3.from_translation(target))
            state.update(start)
            for _ in range(STEPS):
                miss = target - state.data.site_xpos[site]
                if miss @ miss <= TOLERANCE**2:
                    return np.array(state.q)
                speed = mink.solve_ik(state, [task], 1.0, solver="daqp", limits=limits, damping=1e-6)
                state.update(np.minimum(np.maximum(state.integrate(speed, 1.0), lower), upper))
            return None

        yield name, ask


def ikpy_search(chain: Chain) -> Iterator[tuple[str, Ask]]:
    """ikpy's minimisation by SciPy, bounds and all."""
    from ikpy.chain import Chain as Peer
    from ikpy.link import OriginLink, URDFLink

    lower, upper = bounds(chain)
    links = [OriginLink()]
    for k, joint in enumerate(chain.joints):
        move = {"rotation" if joint.kind == "revolute" else "translation": joint.axis}
        links.append(
            URDFLink(
                joint.name, *_origin(joint.T_parent_joint), joint_type=joint.kind,
                bounds=(lower[k], upper[k]), **move,
            )
        )  # fmt: skip
    links.append(URDFLink("tip", *_origin(chain.T_last_tool), joint_type="fixed"))
    peer = Peer(links, active_links_mask=[False, *[True] * chain.dof, False])
    for optimizer in ("least_squares", "scalar"):

        def ask(target: Array, start: Array, optimizer: str = optimizer) -> Array | None:
            first = np.concatenate([[0.0], start, [0.0]])
            found = peer.inverse_kinematics(target, initial_position=first, optimizer=optimizer)
            return np.asarray(found)[1:-1]

        yield optimizer, ask


def _origin(T: Array) -> tuple[Array, Array]:
    return T[:3, 3], Rotation.from_matrix(T[:3, :3]).as_euler("xyz")


def _mjcf(chain: Chain) -> str:
    """The chain alone, its bodies nested, each with the least of masses."""
    mass = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    lower, upper = bounds(chain)
    opened = []
    for k, joint in enumerate(chain.joints):
        kind = "hinge" if joint.kind == "revolute" else "slide"
        limits = f'range="{lower[k]!r} {upper[k]!r}" limited="true"'.replace("np.float64(", "").replace(
            ")", ""
        )
        opened.append(
            f'<body {_placed(joint.T_parent_joint)}>{mass}<joint name="{joint.name}" type="{kind}" '
            f'axis="{" ".join(map(repr, joint.axis.tolist()))}" {limits}/>'
        )
    tip = f'<site name="tip" {_placed(chain.T_last_tool)}/>'
    body = "".join(opened) + tip + "</body>" * chain.dof
    return f'<mujoco><compiler angle="radian"/><worldbody>{body}</worldbody></mujoco>'


def _placed(T: Array) -> str:
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat().tolist()
    spot = " ".join(map(repr, T[:3, 3].tolist()))
    return f'pos="{spot}" quat="{w!r} {x!r} {y!r} {z!r}"'
