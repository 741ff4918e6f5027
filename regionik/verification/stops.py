"""Proof that the base stands still at its stops, and that it may park anywhere in their circles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.values import Plan, Stop, Violation
from regionik.verification.findings import Finding, Words, finding
from regionik.verification.motion import wrapped
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target, World

EXACT = 1e-9  # [m] or [rad]
TOUCH = 1e-6  # by which a footprint may lie over the floor's edge or a clearance [m]
RIM = 8  # places on the rim of a circle that are looked at
WAYS = 4  # steps on the way out to the rim, each posture led on to the next
SWEEPS = 40  # of damped least squares at each step
DAMPING = 1e-3
LONGEST = 0.3  # step of a joint [rad] or [m]
CLOSE = 0.05  # share of the tolerance that is near enough to end, in metres as in radians
NUDGES = 32  # seeded postures tried where none led on is left


def stops(plan: Plan, words: Words) -> Finding:
    """Stops stand still, hold all set-points, and have room for their circles.

    That the footprint keeps its clearance and the floor anywhere in a circle is proven; that the arm reaches
    all set-points of the stop is looked at in the middle of the way and on the rim, by damped least squares
    that keep to the limits.
    """
    if not plan.stops and plan.world.rules.mode != "stops":
        return finding("stops", np.inf, [])
    violations = [*_complete(plan, words), *_still(plan, words)]
    rooms = []
    for n, stop in enumerate(plan.stops):
        room = _room(plan.world, stop)
        rooms.append(room - stop.tolerance)
        if rooms[-1] < -TOUCH:
            text = f"{_name(plan, n)} promises {stop.tolerance:.4f} m to park in, it has {room:.4f} m"
            violations.append(Violation("stops", None, stop.first, -rooms[-1], text))
            continue
        missed = _missed(plan, stop)
        if missed is not None:
            i, far = missed
            text = (
                f"{_name(plan, n)}: parked off by {stop.tolerance:.4f} m the arm is not seen to "
                f"reach {words.setpoint(i)}, it comes within {far:.4f} m"
            )
            violations.append(Violation("stops", None, i, far, text))
    return finding("stops", min(rooms, default=np.inf), violations)


def _complete(plan: Plan, words: Words) -> Iterator[Violation]:
    """Every set-point at one stop, in order."""
    served = [i for stop in plan.stops for i in stop.setpoints]
    if served != list(range(len(plan.world.task))):
        wrong = next((i for i, s in enumerate(served) if s != i), len(served))
        text = f"the stops do not hold every set-point once and in order, from {words.setpoint(wrong)} on"
        yield Violation("stops", None, min(wrong, len(plan.world.task) - 1), np.inf, text)


def _still(plan: Plan, words: Words) -> Iterator[Violation]:
    """The base where the stop is, from its first set-point to its last."""
    motion = plan.motion
    at = {int(motion.setpoint[k]): k for k in np.flatnonzero(motion.kind == "setpoint").tolist()}
    for n, stop in enumerate(plan.stops):
        if stop.first not in at or stop.last not in at:
            continue
        span = slice(at[stop.first], at[stop.last] + 1)
        off = motion.base[span] - stop.base
        off[:, 2] = wrapped(off[:, 2])
        worst = np.abs(off).max(axis=1)
        if len(worst) and worst.max() > EXACT:
            k = span.start + int(np.argmax(worst))
            text = f"the base is {worst.max():.4g} off {_name(plan, n)} {words.state(k)}"
            yield Violation("stops", k, words.owner(k), float(worst.max()), text)


def _name(plan: Plan, n: int) -> str:
    return f"stop {n + 1} of {len(plan.stops)}"


def _room(world: World, stop: Stop) -> float:
    """How far the base may be moved at its heading and keep floor and clearance [m]."""
    c, s = np.cos(stop.base[2]), np.sin(stop.base[2])
    corners = world.robot.footprint @ np.array([[c, s], [-s, c]]) + stop.base[:2]
    shape: BaseGeometry = shapely.convex_hull(shapely.multipoints(corners))
    floor: Polygon = world.floor.polygon
    room = float(shape.distance(floor.boundary)) if floor.covers(shape) else 0.0
    for solid in world.solids:
        shadow = solid.shadow(below=world.robot.body_height)
        if shadow is not None and not shadow.core.is_empty:
            gap = float(shape.distance(shadow.core)) - shadow.radius
            room = min(room, gap - world.rules.clearance)
    return room


def _missed(plan: Plan, stop: Stop) -> tuple[int, float] | None:
    """The set-point that is missed farthest on the rim of a circle, and by how much beyond the tolerance."""
    task = [plan.world.task[i] for i in stop.setpoints]
    angle = 2 * np.pi * np.arange(RIM) / RIM
    out = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(RIM)]) * stop.tolerance
    base = np.tile(stop.base, (len(task), RIM, 1))
    joints = np.repeat([plan.setpoints[i].joints for i in stop.setpoints], RIM, axis=0)
    asked = [target for target in task for _ in range(RIM)]
    for share in np.arange(1, WAYS + 1) / WAYS:
        poses = (base + share * out).reshape(-1, 3)
        joints, miss = _solved(plan.world, asked, poses, joints)
    lost = np.flatnonzero(miss > 0)
    if len(lost):
        miss[lost] = _sought(plan.world, [asked[k] for k in lost.tolist()], poses[lost])
    worst = int(np.argmax(miss))
    return None if miss[worst] <= 0 else (stop.setpoints[worst // RIM], float(miss[worst]))


def _sought(world: World, asked: list[Target], poses: Array) -> Array:
    """Least miss from seeded postures."""
    rng, chain = np.random.default_rng(0), world.robot.chain
    low, high = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    best, left = np.full(len(asked), np.inf), np.arange(len(asked))
    for _ in range(NUDGES):
        begin = rng.uniform(low, high, (len(left), chain.dof))
        miss = _solved(world, [asked[k] for k in left.tolist()], poses[left], begin)[1]
        best[left] = np.minimum(best[left], miss)
        left = left[best[left] > 0]
        if not len(left):
            break
    return best


def _solved(world: World, asked: list[Target], poses: Array, joints: Array) -> tuple[Array, Array]:
    """Postures led to targets with the base held, and by how much they miss beyond what is allowed."""
    chain = world.robot.chain
    q = np.clip(joints, chain.lower, chain.upper)
    for _ in range(SWEEPS):
        missing, J = _linear(world, asked, poses, q)
        if np.abs(missing).max() < CLOSE * world.rules.tolerance:
            break
        step = _step(J, missing)
        blocked = ((q <= chain.lower) & (step < 0)) | ((q >= chain.upper) & (step > 0))
        step = _step(np.where(blocked[:, None, :], 0.0, J), missing)
        q = np.clip(q + np.clip(step, -LONGEST, LONGEST), chain.lower, chain.upper)
    return q, _miss(world, asked, poses, q)


def _step(J: Array, missing: Array) -> Array:
    """Damped least squares, (n, dof)."""
    across = J.transpose(0, 2, 1)
    square = J @ across + DAMPING**2 * np.eye(J.shape[1])
    step: Array = (across @ np.linalg.solve(square, missing[..., None]))[..., 0]
    return step


def _linear(world: World, asked: list[Target], poses: Array, q: Array) -> tuple[Array, Array]:
    """What the position lacks and how far the tool is turned off, (n, 4), and its Jacobian, (n, 4, dof)."""
    frames = world.robot.frames(poses, q)
    tool = frames[:, -1]
    off = np.array([target.position for target in asked]) - tool[:, :3, 3]
    tolerance = world.rules.tolerance
    turns = [_turn(target, R, tolerance) for target, R in zip(asked, tool[:, :3, :3], strict=True)]
    about, over = (np.array(part) for part in zip(*turns, strict=True))
    axes = np.stack(
        [frames[:, k, :3, :3] @ joint.axis for k, joint in enumerate(world.robot.chain.joints)], axis=1
    )
    revolute = np.array([joint.kind == "revolute" for joint in world.robot.chain.joints])[None, :, None]
    levers = tool[:, None, :3, 3] - frames[:, :-1, :3, 3]
    moves = np.where(revolute, np.cross(axes, levers), axes).transpose(0, 2, 1)
    turned = np.einsum("nka,na->nk", np.where(revolute, axes, 0.0), about)
    missing: Array = np.column_stack([off, over])
    J: Array = np.concatenate([moves, turned[:, None]], axis=1)
    return missing, J


def _turn(target: Target, R: Array, tolerance: float) -> tuple[Array, float]:
    """About which axis a tool is to be turned to what is asked, and how far; not at all within its cone.

    What is aimed at lies hardly more inside the cone than an answer that is near enough is off: at the end of
    the reach no posture may turn the tool any further.
    """
    way, angle = _off(target, R)
    inside = max(target.cone - 2 * CLOSE * tolerance, target.cone / 2)
    size = float(np.linalg.norm(way))
    return (way / size, angle - inside) if size > 0 and angle > inside else (np.zeros(3), 0.0)


def _off(target: Target, R: Array) -> tuple[Array, float]:
    """Axis of the turn from a tool to what is asked, of some length, and the angle [rad]."""
    if target.direction is None:
        return np.zeros(3), 0.0
    if target.orientation is not None:
        left = target.orientation @ R.T
        way = np.array([left[2, 1] - left[1, 2], left[0, 2] - left[2, 0], left[1, 0] - left[0, 1]])
        return way, float(np.arctan2(np.linalg.norm(way), np.trace(left) - 1.0))
    way = np.cross(R[:, 2], target.direction)
    return way, float(np.arctan2(np.linalg.norm(way), R[:, 2] @ target.direction))


def _miss(world: World, asked: list[Target], poses: Array, q: Array) -> Array:
    """By how much tools miss beyond the tolerance or a cone, at most 0 where they do not [m] or [rad]."""
    tool = world.robot.tool(poses, q)[:, :3]
    spots = np.array([target.position for target in asked])
    miss: Array = np.linalg.norm(tool[:, :, 3] - spots, axis=1) - world.rules.tolerance
    for k, (target, R) in enumerate(zip(asked, tool[:, :, :3], strict=True)):
        if target.direction is not None:
            miss[k] = max(miss[k], _off(target, R)[1] - target.cone)
    return miss
