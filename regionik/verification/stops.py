"""Proof that the base stands still at its stops, and checks that it may park anywhere in their circles."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.values import Plan, Stop, Violation
from regionik.verification.motion import point_jacobian, wrap_angle
from regionik.verification.proofs import Finding, StateNames, finding
from regionik.verification.tool_path import rotation_to
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target, World

Mask = NDArray[np.bool_]

EXACT = 1e-9  # [m] or [rad]
TOUCH = 1e-6  # by which a footprint may pass the floor's edge or a clearance [m]
RIM_POINTS = 8  # places on the rim of a circle where the arm is tried
RIM_STEPS = 4  # on the way out to the rim, each posture the start of the next
ITERATIONS = 40  # of damped least squares at each step
DAMPING = 1e-3
LONGEST_STEP = 0.3  # of a joint [rad] or [m]
CLOSE = 0.05  # share of the tolerance at which iterations end, in metres as in radians
RESTARTS = 32  # random postures tried where the one led on fails


def verify_stops(plan: Plan, names: StateNames) -> Finding:
    """Stops stand still, serve all set-points in order, and have room for their circles.

    That the footprint keeps its clearance and the floor anywhere in a circle is proven. That the arm reaches
    all set-points of the stop is tried on the rim, by damped least squares within the joint limits.
    """
    if not plan.stops and plan.world.rules.mode != "stops":
        return finding("stops", np.inf, [])
    violations = [*_incomplete(plan, names), *_moving(plan, names)]
    margins = []
    for n, stop in enumerate(plan.stops):
        room = _room(plan.world, stop)
        margins.append(room - stop.tolerance)
        if margins[-1] < -TOUCH:
            text = f"{_name(plan, n)} promises {stop.tolerance:.4f} m to park in, it has {room:.4f} m"
            violations.append(Violation("stops", None, stop.first, -margins[-1], text))
            continue
        i, excess = _worst_on_rim(plan, stop)
        if excess > 0:
            text = f"{_name(plan, n)}: with the base {stop.tolerance:.4f} m off, no posture was found that "
            text += f"reaches {names.setpoint(i)}; the best one misses its tolerance by {excess:.4f} m"
            violations.append(Violation("stops", None, i, excess, text))
    return finding("stops", min(margins, default=np.inf), violations)


def _incomplete(plan: Plan, names: StateNames) -> Iterator[Violation]:
    """Violation where set-points are not served once and in order."""
    served = [i for stop in plan.stops for i in stop.setpoints]
    if served != list(range(len(plan.world.task))):
        wrong = next((i for i, s in enumerate(served) if s != i), len(served))
        text = f"the stops do not serve every set-point once and in order, from {names.setpoint(wrong)} on"
        yield Violation("stops", None, min(wrong, len(plan.world.task) - 1), np.inf, text)


def _moving(plan: Plan, names: StateNames) -> Iterator[Violation]:
    """Violations where the base leaves its stop between the first and last set-point of it."""
    motion = plan.motion
    at = {int(motion.setpoint[k]): k for k in np.flatnonzero(motion.kind == "setpoint").tolist()}
    for n, stop in enumerate(plan.stops):
        if stop.first not in at or stop.last not in at:
            continue
        span = slice(at[stop.first], at[stop.last] + 1)
        off = motion.base[span] - stop.base
        off[:, 2] = wrap_angle(off[:, 2])
        worst = np.abs(off).max(axis=1)
        if len(worst) and worst.max() > EXACT:
            k = span.start + int(np.argmax(worst))
            text = f"the base is {worst.max():.4g} off {_name(plan, n)} {names.state(k)}"
            yield Violation("stops", k, names.owner(k), float(worst.max()), text)


def _name(plan: Plan, n: int) -> str:
    return f"stop {n + 1} of {len(plan.stops)}"


def _room(world: World, stop: Stop) -> float:
    """Distance by which the base may be off at its heading and keep floor and clearance [m]."""
    c, s = np.cos(stop.base[2]), np.sin(stop.base[2])
    corners = world.robot.footprint @ np.array([[c, s], [-s, c]]) + stop.base[:2]
    shape: BaseGeometry = shapely.convex_hull(shapely.multipoints(corners))
    floor: Polygon = world.floor.polygon
    room = float(shape.distance(floor.boundary)) if floor.covers(shape) else 0.0
    for solid in world.solids:
        shadow = solid.shadow(below=world.robot.body_height)
        if shadow is not None and not shadow.core.is_empty:
            distance = float(shape.distance(shadow.core)) - shadow.radius
            room = min(room, distance - world.rules.clearance)
    return room


def _worst_on_rim(plan: Plan, stop: Stop) -> tuple[int, float]:
    """The set-point missed farthest on the rim of the circle, and by how much beyond its tolerance."""
    task = [plan.world.task[i] for i in stop.setpoints]
    angle = 2 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
    out = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(RIM_POINTS)]) * stop.tolerance
    base = np.tile(stop.base, (len(task), RIM_POINTS, 1))
    joints = np.repeat([plan.setpoints[i].joints for i in stop.setpoints], RIM_POINTS, axis=0)
    targets = [target for target in task for _ in range(RIM_POINTS)]
    for share in np.arange(1, RIM_STEPS + 1) / RIM_STEPS:
        poses = (base + share * out).reshape(-1, 3)
        joints, excess = _solve(plan.world, targets, poses, joints)
    missed = np.flatnonzero(excess > 0)
    if len(missed):
        excess[missed] = _restarted(plan.world, [targets[k] for k in missed.tolist()], poses[missed])
    worst = int(np.argmax(excess))
    return stop.setpoints[worst // RIM_POINTS], float(excess[worst])


def _restarted(world: World, targets: Sequence[Target], poses: Array) -> Array:
    """Least excess from random postures, (n,)."""
    rng, chain = np.random.default_rng(0), world.robot.chain
    low, high = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    best, left = np.full(len(targets), np.inf), np.arange(len(targets))
    for _ in range(RESTARTS):
        start = rng.uniform(low, high, (len(left), chain.dof))
        excess = _solve(world, [targets[k] for k in left.tolist()], poses[left], start)[1]
        best[left] = np.minimum(best[left], excess)
        left = left[best[left] > 0]
        if not len(left):
            break
    return best


def _solve(world: World, targets: Sequence[Target], poses: Array, joints: Array) -> tuple[Array, Array]:
    """Postures led to targets with the base held, and by how much they miss beyond the tolerances."""
    chain, close = world.robot.chain, CLOSE * world.rules.tolerance
    q, goals, left = (
        np.clip(joints, chain.lower, chain.upper),
        _Goals.of(targets, close),
        np.arange(len(joints)),
    )
    # Six joints and more turn the tool the shortest way at first, then by its angle alone, as fewer do.
    whole = ITERATIONS // 2 if chain.dof >= 6 else 0
    for n in range(ITERATIONS):
        residual, J = _residual_and_jacobian(world, goals.only(left), poses[left], q[left])
        J = J if n < whole else _angle_alone(residual, J)
        open_ = np.abs(residual).max(axis=1) >= close
        left, residual, J = left[open_], residual[open_], J[open_]
        if not len(left):
            break
        here, step = q[left], _damped_step(J, residual)
        for _ in range(chain.dof):
            blocked = ((here <= chain.lower) & (step < 0)) | ((here >= chain.upper) & (step > 0))
            if not blocked.any():
                break
            J = np.where(blocked[:, None, :], 0.0, J)
            step = _damped_step(J, residual)
        q[left] = np.clip(here + np.clip(step, -LONGEST_STEP, LONGEST_STEP), chain.lower, chain.upper)
    return q, _excess(world, targets, poses, q)


class _Goals(NamedTuple):
    """Targets as arrays."""

    positions: Array  # (n, 3) [m]
    frames: Array  # (n, 3, 3) asked tool frame, or a direction in its last column
    framed: Mask  # (n,) a frame is asked
    directed: Mask  # (n,) a direction or a frame is asked
    cones: (
        Array  # (n,) hardly narrower than asked: at the end of the reach no tool may turn any further [rad]
    )

    @classmethod
    def of(cls, targets: Sequence[Target], close: float) -> _Goals:
        frames = np.zeros((len(targets), 3, 3))
        for k, target in enumerate(targets):
            if target.orientation is not None:
                frames[k] = target.orientation
            elif target.direction is not None:
                frames[k, :, 2] = target.direction
        cones = np.array([target.cone for target in targets])
        return cls(
            np.array([target.position for target in targets]),
            frames,
            np.array([target.orientation is not None for target in targets]),
            np.array([target.direction is not None for target in targets]),
            np.maximum(cones - 2 * close, cones / 2),
        )

    def only(self, some: NDArray[np.intp]) -> _Goals:
        return _Goals(
            self.positions[some],
            self.frames[some],
            self.framed[some],
            self.directed[some],
            self.cones[some],
        )


def _damped_step(J: Array, residual: Array) -> Array:
    """Damped least squares J^T (J J^T + d^2 I)^-1 r, (n, dof)."""
    transposed = J.transpose(0, 2, 1)
    A = J @ transposed + DAMPING**2 * np.eye(J.shape[1])
    step: Array = (transposed @ np.linalg.solve(A, residual[..., None]))[..., 0]
    return step


def _residual_and_jacobian(world: World, goals: _Goals, poses: Array, q: Array) -> tuple[Array, Array]:
    """Position residual and turn left beyond the cone, (n, 6), and their Jacobian, (n, 6, dof)."""
    chain, frames = world.robot.chain, world.robot.frames(poses, q)
    tool = frames[:, -1]
    turn = _turn_left(goals, tool[:, :3, :3])
    joint_axes = np.stack([frames[:, k, :3, :3] @ joint.axis for k, joint in enumerate(chain.joints)], axis=2)
    slides = np.array([joint.kind == "prismatic" for joint in chain.joints])
    z = tool[:, :3, 2]
    rolls = np.where(goals.framed[:, None], 0.0, np.einsum("na,nak->nk", z, joint_axes))
    turning = joint_axes - z[:, :, None] * rolls[:, None]  # a roll about a direction is free
    turning[(turn == 0.0).all(axis=1)] = 0.0
    turning[:, :, slides] = 0.0
    linear = point_jacobian(chain, frames, tool[:, :3, 3], chain.dof).transpose(0, 2, 1)
    J: Array = np.concatenate([linear, turning], axis=1)
    return np.column_stack([goals.positions - tool[:, :3, 3], turn]), J


def _angle_alone(residual: Array, J: Array) -> Array:
    """The Jacobian with only that part of each turn that changes the angle which is left."""
    size = np.linalg.norm(residual[:, 3:], axis=1)
    axis = residual[:, 3:] / np.maximum(size, 1e-300)[:, None]
    turning = axis[:, :, None] * np.einsum("na,nak->nk", axis, J[:, 3:])[:, None]
    alone: Array = np.concatenate([J[:, :3], turning], axis=1)
    return alone


def _turn_left(goals: _Goals, R: Array) -> Array:
    """Rotation vectors (n, 3) that bring tool frames (n, 3, 3) into their cones; zeros where they are."""
    turn = np.zeros((len(R), 3))
    framed, pointed = goals.framed, goals.directed & ~goals.framed
    if framed.any():
        turn[framed] = Rotation.from_matrix(goals.frames[framed] @ R[framed].transpose(0, 2, 1)).as_rotvec()
    if pointed.any():
        z, asked = R[pointed, :, 2], goals.frames[pointed, :, 2]
        axis = np.cross(z, asked)
        sine = np.linalg.norm(axis, axis=1)
        angle = np.arctan2(sine, (z * asked).sum(axis=1))
        turn[pointed] = axis * (angle / np.maximum(sine, 1e-300))[:, None]
    size = np.linalg.norm(turn, axis=1)
    beyond = np.maximum(size - goals.cones, 0.0) / np.maximum(size, 1e-300)
    left: Array = turn * beyond[:, None]
    return left


def _rotation_off(target: Target, R: Array) -> tuple[Array, float]:
    """Axis (3,), not normalized, and angle [rad] of the rotation from the tool to what is asked."""
    if target.direction is None:
        return np.zeros(3), 0.0
    if target.orientation is not None:
        return rotation_to(target.orientation, R)
    axis = np.cross(R[:, 2], target.direction)
    return axis, float(np.arctan2(np.linalg.norm(axis), R[:, 2] @ target.direction))


def _excess(world: World, targets: Sequence[Target], poses: Array, q: Array) -> Array:
    """Amount by which tools miss tolerance or cone, at most 0 where they do not, (n,) [m] or [rad]."""
    tool = world.robot.tool(poses, q)[:, :3]
    positions = np.array([target.position for target in targets])
    excess: Array = np.linalg.norm(tool[:, :, 3] - positions, axis=1) - world.rules.tolerance
    for k, (target, R) in enumerate(zip(targets, tool[:, :, :3], strict=True)):
        if target.direction is not None:
            excess[k] = max(excess[k], _rotation_off(target, R)[1] - target.cone)
    return excess
