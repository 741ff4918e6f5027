"""Proof that the postures at set-points meet the criteria of the rules, from the chain in space alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from regionik.values import Violation
from regionik.verification.findings import Finding, Words, finding
from regionik.verification.motion import Indices, Journey
from regionik.worlds.arrays import Array
from regionik.worlds.criteria import Criteria
from regionik.worlds.robot import GRAVITY, Robot
from regionik.worlds.scene import World

EXACT = 1e-9  # [m3], [N m], [N], or a share of a joint's range


def criteria(world: World, journey: Journey, words: Words) -> Iterator[Finding]:
    """One finding for each criterion: its least margin over all set-points, in its own unit."""
    asked = world.rules.criteria or Criteria()
    states = np.flatnonzero(journey.motion.kind == "setpoint")
    joints, robot = journey.motion.joints[states], journey.robot
    names = robot.chain.names
    if asked.manipulability:
        found = manipulability(robot, joints)[:, None]
        yield _least("manipulability", "m3", words, states, found, np.array([asked.manipulability]), ("",))
    if asked.joint_margin:
        wanted = np.full(robot.chain.dof, asked.joint_margin)
        yield _least("joint_margin", "", words, states, joint_margins(robot, joints), wanted, names)
    if asked.effort is not None:
        most = asked.efforts(robot.chain.dof)
        yield _least("effort", "N m", words, states, -np.abs(efforts(robot, joints)), -most, names)


def manipulability(robot: Robot, joints: ArrayLike) -> Array:
    """Manipulability sqrt(det(J J^T)) of the tool's position by all joints of the arm, (...,) [m3].

    Parameters
    ----------
    robot : Robot
    joints : (..., dof) array_like

    Source: T. Yoshikawa, Manipulability of robotic mechanisms, IJRR 1985.
    """
    q, tool = np.asarray(joints, dtype=np.float64), robot.chain.T_last_tool[:3, 3]
    J = np.swapaxes(_speeds(robot, q, robot.chain.dof, tool), -1, -2)
    found: Array = np.sqrt(np.maximum(np.linalg.det(J @ np.swapaxes(J, -1, -2)), 0.0))
    return found


def joint_margins(robot: Robot, joints: ArrayLike) -> Array:
    """Distance of each joint from the nearer of its limits, as a share of its range, (..., dof).

    Infinite without limits.
    """
    chain, q = robot.chain, np.asarray(joints, dtype=np.float64)
    span = chain.upper - chain.lower
    ends = np.isfinite(span)
    near = np.minimum(q - chain.lower, chain.upper - q)[..., ends]
    found = np.full(q.shape, np.inf)
    found[..., ends] = near / np.where(span[ends] > 0, span[ends], 1.0)
    return found


def efforts(robot: Robot, joints: ArrayLike) -> Array:
    """Torque or force with which each joint bears links and payload standing still, (..., dof) [N m] or [N].

    The virtual work of all weights: ``m g`` times how fast each joint lifts each mass.
    """
    q = np.asarray(joints, dtype=np.float64)
    found = np.zeros(q.shape)
    for load in robot.loads:
        found += GRAVITY * load.mass * _speeds(robot, q, load.link + 1, load.center)[..., 2]
    return found


def _speeds(robot: Robot, joints: Array, moving: int, point: Array) -> Array:
    """Velocity of a point by each joint's unit speed, (..., dof, 3), seen from the arm's base frame.

    The point is given in the frame of the last of the first ``moving`` joints, which alone move it.
    """
    chain, frames = robot.chain, robot.chain.frames(joints)
    T = frames[..., moving - 1, :, :]
    p = T[..., :3, :3] @ point + T[..., :3, 3]
    found = np.zeros((*joints.shape, 3))
    for k, joint in enumerate(chain.joints[:moving]):
        axis = frames[..., k, :3, :3] @ joint.axis
        turning = joint.kind == "revolute"
        found[..., k, :] = np.cross(axis, p - frames[..., k, :3, 3]) if turning else axis
    return found


def _least(
    kind: str, unit: str, words: Words, states: Indices, found: Array, wanted: Array, names: tuple[str, ...]
) -> Finding:
    """Values (n, m) of set-points against what is wanted at least (m,)."""
    margin = found - wanted
    what = kind.replace("_", " ")
    told = []
    for row, j in np.argwhere(margin < -EXACT).tolist():
        k = int(states[row])
        of = f" of {names[j]}" if names[j] else ""
        value, rule = abs(float(found[row, j])), abs(float(wanted[j]))
        text = f"the {what}{of} is {value:.4g} {unit}".rstrip() + f" {words.state(k)}; the rules ask for "
        text += f"at {'most' if kind == 'effort' else 'least'} {rule:.4g} {unit}".rstrip()
        told.append(Violation(kind, k, words.owner(k), float(-margin[row, j]), text))
    return finding(kind, float(margin.min(initial=np.inf)), told)
