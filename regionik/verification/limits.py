"""Limits of joints, base steps, headings, wheels and posture criteria.

Joints, heading and arc length change at constant rate on a segment. So what the states and the whole segments
keep is kept everywhere between, and nothing has to be bounded or bisected here.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from regionik.values import Violation
from regionik.verification.motion import MotionSegments, wrap_angle
from regionik.verification.proofs import Finding, StateNames, finding
from regionik.verification.tolerances import EXACT, HEADING_TOLERANCE
from regionik.worlds.arms import has_pivot, pivot_index
from regionik.worlds.arrays import Array
from regionik.worlds.limits import Criteria
from regionik.worlds.robot import GRAVITY, Robot
from regionik.worlds.scene import World


def verify_joint_limits(segments: MotionSegments, names: StateNames) -> Finding:
    """Joint values lie within their limits."""
    chain, joints = segments.robot.chain, segments.motion.joints
    lower, upper = chain.lower, chain.upper
    margin = np.minimum(joints - lower, upper - joints)
    violations = []
    for k, j in np.argwhere(margin < -EXACT).tolist():
        unit = "rad" if chain.active_joints[j].kind == "revolute" else "m"
        text = (
            f"{chain.names[j]} is at {joints[k, j]:z.4f} {unit} {names.state(k)}; "
            f"its limits are {lower[j]:z.4f} to {upper[j]:z.4f} {unit}"
        )
        violations.append(Violation("joints", k, names.owner(k), float(-margin[k, j]), text))
    return finding("joints", float(margin.min()), violations)


def verify_base_steps(segments: MotionSegments, names: StateNames, longest: float) -> Finding:
    """The base moves at most ``rules.step`` on each segment."""
    length = segments.base_length
    violations = []
    for k in np.flatnonzero(length > longest + EXACT).tolist():
        text = f"the base moves {length[k]:.4f} m {names.segment(k)}; the rules allow {longest:g} m"
        violations.append(Violation("step", k, names.owner(k), float(length[k] - longest), text))
    return finding("step", float(longest - length.max(initial=0.0)), violations)


def verify_heading(world: World, segments: MotionSegments, names: StateNames) -> Finding:
    """Headings obey ``rules.heading`` to a microradian.

    A base that faces its targets has the pivot of its arm straight ahead, or as near to that as its limits
    allow, in the states that are set-points. A fixed heading is that of the first state.
    """
    motion, chain, rules = segments.motion, world.robot.chain, world.rules
    if rules.heading == "fixed":
        off = np.abs(wrap_angle(motion.base[:, 2] - motion.base[0, 2]))
        text = "the base is turned by {:.4g} rad {}; its heading is fixed"
    elif rules.heading == "face_target" and has_pivot(chain):
        pivot = pivot_index(chain)
        ahead = np.clip(0.0, chain.lower[pivot], chain.upper[pivot])
        off = np.abs(wrap_angle(motion.joints[:, pivot] - ahead)) * (motion.kind == "setpoint")
        text = "the base faces {:.4g} rad past its target {}"
    else:
        return finding("heading", np.inf, [])
    violations = [
        Violation("heading", k, names.owner(k), float(off[k]), text.format(off[k], names.state(k)))
        for k in np.flatnonzero(off > HEADING_TOLERANCE).tolist()
    ]
    return finding("heading", np.inf, violations)


def verify_wheels(segments: MotionSegments, names: StateNames) -> Finding:
    """Wheels do not slip sideways, and a car turns no tighter than its turning radius.

    The wheels stand beside the middle of the base, which therefore moves along its heading in the middle of
    each turn and nowhere else; a car rolls at least its turning radius times the turn. The margin is that of
    slip, or the arc length that a car's tightest segment has to spare if that is less.
    """
    if not segments.robot.drive.rolls or not len(segments):
        return finding("wheels", np.inf, [])
    slip = np.linalg.norm(segments.slide, axis=1)
    violations = []
    for k in np.flatnonzero(slip > EXACT).tolist():
        text = f"the base slips {slip[k]:.3g} m sideways {names.segment(k)}"
        violations.append(Violation("wheels", k, names.owner(k), float(slip[k]), text))
    margin = EXACT - float(slip.max())
    radius, turn, rolled = segments.robot.drive.turning_radius, np.abs(segments.turn), np.abs(segments.rolled)
    if radius > 0:
        short = turn * radius * (1 - EXACT) - rolled
        margin = min(margin, -float(short[turn * radius > EXACT].max(initial=-np.inf)))
        for k in np.flatnonzero(short > EXACT).tolist():
            text = f"the car turns {turn[k]:.4f} rad on {rolled[k]:.4f} m {names.segment(k)}; "
            text += f"its turning radius is {radius:g} m"
            violations.append(Violation("wheels", k, names.owner(k), float(short[k]), text))
    return finding("wheels", margin, violations)


def verify_criteria(world: World, segments: MotionSegments, names: StateNames) -> Iterator[Finding]:
    """Postures at set-points meet ``rules.criteria``: one finding each, its margin in its own unit."""
    asked = world.rules.criteria or Criteria()
    states = np.flatnonzero(segments.motion.kind == "setpoint")
    joints, robot = segments.motion.joints[states], segments.robot
    dof = robot.chain.dof

    def compared(kind: str, unit: str, values: Array, least: Array) -> Finding:
        """Values (n, m) of set-points against those asked for at least (m,)."""
        margin, criterion = values - least, kind.replace("_", " ")
        violations = []
        for row, j in np.argwhere(margin < -EXACT).tolist():
            k = int(states[row])
            joint = "" if kind == "manipulability" else f" of {robot.chain.names[j]}"
            side = "most" if kind == "effort" else "least"
            found = f"{abs(float(values[row, j])):.4g} {unit}".rstrip()
            bound = f"{abs(float(least[j])):.4g} {unit}".rstrip()
            text = f"the {criterion}{joint} is {found} {names.state(k)}; the rules ask for at {side} {bound}"
            violations.append(Violation(kind, k, names.owner(k), float(-margin[row, j]), text))
        return finding(kind, float(margin.min(initial=np.inf)), violations)

    if asked.manipulability:
        values = manipulability(robot, joints)[:, None]
        yield compared("manipulability", "m3", values, np.array([asked.manipulability]))
    if asked.joint_margin:
        yield compared("joint_margin", "", joint_margins(robot, joints), np.full(dof, asked.joint_margin))
    if asked.effort is not None:
        yield compared("effort", "N m", -np.abs(efforts(robot, joints)), -asked.efforts(dof))


def manipulability(robot: Robot, joints: ArrayLike) -> Array:
    """Manipulability sqrt(det(J J^T)) of the tool's position by joints (..., dof), (...,) [m3].

    Source: T. Yoshikawa, Manipulability of robotic mechanisms, IJRR 1985.
    """
    columns = _link_point_jacobian(robot, joints, len(robot.chain.joints), robot.chain.T_last_tool[:3, 3])
    J = np.swapaxes(columns, -1, -2)
    return np.sqrt(np.maximum(np.linalg.det(J @ columns), 0.0))


def joint_margins(robot: Robot, joints: ArrayLike) -> Array:
    """Distance of each joint from the nearer of its limits, as a share of its range, (..., dof).

    Infinite without limits.
    """
    chain, q = robot.chain, np.asarray(joints, dtype=np.float64)
    span = chain.upper - chain.lower
    limited = np.isfinite(span)
    near = np.minimum(q - chain.lower, chain.upper - q)[..., limited]
    found = np.full(q.shape, np.inf)
    found[..., limited] = near / np.where(span[limited] > 0, span[limited], 1.0)
    return found


def efforts(robot: Robot, joints: ArrayLike) -> Array:
    """Torque or force with which each joint bears links and payload at rest, (..., dof) [N m] or [N].

    By virtual work: the sum over all masses of m g times the speed at which the joint lifts the mass.
    """
    found = np.zeros(np.shape(joints))
    for load in robot.loads:
        lifting = _link_point_jacobian(robot, joints, load.link + 1, load.center)[..., 2]
        found += GRAVITY * load.mass * lifting
    return found


def _link_point_jacobian(robot: Robot, joints: ArrayLike, moving: int, point: Array) -> Array:
    """Jacobian columns (..., dof, 3) in the arm's base frame of a point fixed to the last moving link."""
    frames = robot.chain.frames(np.asarray(joints, dtype=np.float64))
    T = frames[..., moving - 1, :, :]
    return robot.chain.point_jacobian(frames, T[..., :3, :3] @ point + T[..., :3, 3], moving)
