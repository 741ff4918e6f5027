"""Proof that the base stands still at its stops, and checks of a plan with the base off its place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.special import bdtr

from regionik.planners.geometry.offsets import farthest_outside, radius_that_holds
from regionik.values import Plan, Stop, Violation
from regionik.verification.base_clearance import asked_of_base, base_shadows, footprint_hulls
from regionik.verification.motion import wrap_angle
from regionik.verification.options import VERIFICATION
from regionik.verification.postures_on_target import postures_on_target
from regionik.verification.proofs import Finding, StateNames, finding
from regionik.verification.tolerances import EXACT, TOUCH
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target, World

OPTIONS = VERIFICATION.stops

_ANGLES = 2 * np.pi * np.arange(OPTIONS.rim_points) / OPTIONS.rim_points
RIM = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES), np.zeros(OPTIONS.rim_points)])  # of a radius of 1


def verify_stops(plan: Plan, names: StateNames) -> Finding:
    """Stops stand still, serve all set-points in order, and have room for their circles.

    That the footprint keeps its clearance and the floor anywhere in a circle is proven. That the arm reaches
    all set-points of the stop is tried on the rim, by damped least squares within the joint limits. Of what a
    stop promises after parking with an error it is tried how often it holds.
    """
    if not plan.stops and plan.world.rules.mode != "stops":
        return finding("stops", np.inf, [])
    violations = [*_incomplete(plan, names), *_moving(plan, names)]
    margins = []
    for n, stop in enumerate(plan.stops):
        violations += _unlikely(plan, n)
        if stop.criterion != plan.world.rules.stop_criterion:
            text = f"{_name(plan, n)} was chosen by {stop.criterion}, the rules ask for "
            text += plan.world.rules.stop_criterion
            violations.append(Violation("stops", None, stop.first, 0.0, text))
        wanted = plan.world.rules.stop_tolerance
        if not stop.tolerance >= wanted - TOUCH:
            text = f"{_name(plan, n)} promises {stop.tolerance:.4f} m to park in, asked for are {wanted:g} m"
            violations.append(Violation("stops", None, stop.first, wanted - stop.tolerance, text))
        room = _room(plan.world, stop.base)
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
    served = [i for stop in plan.stops for i in stop.setpoints]
    if served != list(range(len(plan.world.task))):
        wrong = next((i for i, s in enumerate(served) if s != i), len(served))
        text = f"the stops do not serve every set-point once and in order, from {names.setpoint(wrong)} on"
        yield Violation("stops", None, min(wrong, len(plan.world.task) - 1), 0.0, text)


def _moving(plan: Plan, names: StateNames) -> Iterator[Violation]:
    """Violations where the base drives with the tool not lifted, or leaves a stop that it serves."""
    motion = plan.motion
    lifted, way = motion.kind == "transit", np.diff(motion.base, axis=0)
    way[:, 2] = wrap_angle(way[:, 2])
    drives = (np.abs(way).max(axis=1, initial=0.0) > EXACT) & ~(lifted[:-1] | lifted[1:])
    for k in np.flatnonzero(drives).tolist():
        text = f"the base moves with the tool not lifted {names.segment(k)}; it drives from stop to stop"
        yield Violation("stops", k, names.owner(k), float(np.abs(way[k]).max()), text)
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


def _room(world: World, base: Array) -> float:
    """Distance by which the base may be off its pose, at its heading; below 0 off the floor [m]."""
    room = float(_rooms(world, base[None])[0])
    if np.isfinite(room):
        return room
    return -farthest_outside(footprint_hulls(world.robot, base[None])[0], world.drivable_floor)


def _rooms(world: World, bases: Array) -> Array:
    """Distances (n,) by which the base may be off poses (n, 3), at their headings, and keep its clearance.

    Off the floor minus infinity [m].
    """
    shapes, floor = footprint_hulls(world.robot, bases), world.drivable_floor
    on_floor = shapely.covers(floor.buffer(TOUCH), shapes)
    room: Array = np.where(on_floor, shapely.distance(shapes, floor.boundary), -np.inf)
    for solid, shadow in base_shadows(world):
        apart = shapely.distance(shapes, shadow.core) - shadow.radius
        room = np.minimum(room, apart - asked_of_base(world, solid))
    return room


def _unlikely(plan: Plan, n: int) -> Iterator[Violation]:
    """Violation where a stop holds after fewer parkings than its probability allows, or than is asked for."""
    stop, accuracy, who = plan.stops[n], plan.world.rules.parking, _name(plan, n)
    if stop.probability is None:
        asked = None if accuracy is None else accuracy.probability
        if asked is not None:
            text = f"{who} promises no probability after parking, the rules ask for {asked:g}"
            yield Violation("stops", None, stop.first, asked, text)
        return
    if accuracy is None:
        text = f"{who} promises a probability after parking, rules.parking says nothing of the error"
        yield Violation("stops", None, stop.first, stop.probability, text)
        return
    if accuracy.probability is not None and stop.probability < accuracy.probability:
        short = accuracy.probability - stop.probability
        text = f"{who} is good after parking with {stop.probability:.4f}, "
        text += f"the rules ask for {accuracy.probability:g}"
        yield Violation("stops", None, stop.first, short, text)
    rng, C = np.random.default_rng(0), np.array(accuracy.covariance)
    poses = rng.multivariate_normal(stop.base, C, OPTIONS.max_parkings, check_valid="ignore")
    fits = _rooms(plan.world, poses) >= -TOUCH
    most = OPTIONS.max_parked_arms // len(stop.setpoints)
    some = np.arange(np.clip(most, OPTIONS.min_parkings, OPTIONS.max_parkings))
    reached = some[fits[some]]
    reached = reached[_reachable_poses(plan, stop, poses[reached])]
    for good, tried, what in (
        (int(fits.sum()), OPTIONS.max_parkings, "the base has room"),
        (len(reached), len(some), "it is good"),
    ):
        if bdtr(good, tried, stop.probability) < OPTIONS.min_chance:
            text = f"{who} promises to be good after parking with {stop.probability:.4f}: "
            text += f"{what} after {good} of {tried} parkings"
            yield Violation("stops", None, stop.first, stop.probability - good / tried, text)


def _reachable_poses(plan: Plan, stop: Stop, poses: Array) -> NDArray[np.bool_]:
    """Poses (n, 3) of the base from which a posture was found at every set-point of a stop."""
    reached = np.ones(len(poses), dtype=bool)
    for i in stop.setpoints:
        left = np.flatnonzero(reached)
        targets, joints = [plan.world.task[i]] * len(left), np.tile(plan.setpoints[i].joints, (len(left), 1))
        excess = postures_on_target(plan.world, targets, poses[left], joints)[1]
        reached[left] = _restarted(plan.world, targets, poses[left], excess) <= 0
    return reached


def _worst_on_rim(plan: Plan, stop: Stop) -> tuple[int, float]:
    """The set-point missed farthest on the rim of the circle, and by how much beyond its tolerance."""
    task = [plan.world.task[i] for i in stop.setpoints]
    base = np.tile(stop.base, (len(task), OPTIONS.rim_points, 1))
    joints = np.repeat([plan.setpoints[i].joints for i in stop.setpoints], OPTIONS.rim_points, axis=0)
    targets = [target for target in task for _ in range(OPTIONS.rim_points)]
    for share in np.arange(1, OPTIONS.rim_steps + 1) / OPTIONS.rim_steps:
        poses = (base + share * (RIM * stop.tolerance)).reshape(-1, 3)
        joints, excess = postures_on_target(plan.world, targets, poses, joints)
    excess = _restarted(plan.world, targets, poses, excess)
    worst = int(np.argmax(excess))
    return stop.setpoints[worst // OPTIONS.rim_points], float(excess[worst])


def within_reachable_circles(plan: Plan) -> Plan:
    """Return a plan whose stops promise no larger circle than one on whose rim their postures are found.

    Areas know that there is a posture all over a circle, not that it is found from the plan's own. What the
    rules ask for is promised in any case.
    """
    stops = tuple(replace(stop, tolerance=_reachable_radius(plan, stop)) for stop in plan.stops)
    return replace(plan, stops=stops)


def _reachable_radius(plan: Plan, stop: Stop) -> float:
    def reachable(radius: float) -> bool:
        return _worst_on_rim(plan, replace(stop, tolerance=radius))[1] <= 0

    return radius_that_holds(stop.tolerance, plan.world.rules.stop_tolerance, reachable)


def _restarted(world: World, targets: Sequence[Target], poses: Array, excess: Array) -> Array:
    """The excess of targets that are met, of others the least from random postures, (n,)."""
    rng, chain = np.random.default_rng(0), world.robot.chain
    low, high = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    best = np.where(excess > 0, np.inf, excess)
    for _ in range(OPTIONS.max_restarts):
        left = np.flatnonzero(best > 0)
        if not len(left):
            break
        start = rng.uniform(low, high, (len(left), chain.dof))
        again = postures_on_target(world, [targets[k] for k in left.tolist()], poses[left], start)[1]
        best[left] = np.minimum(best[left], again)
    return best


def verify_execution(plan: Plan, names: StateNames) -> Finding:
    """The arm reaches every set-point with the base as far off as ``rules.execution`` has it.

    It is tried from the rim of the base's error, by damped least squares from the plan's posture, within the
    joint limits. That nothing is touched is proven elsewhere, by clearances that hold the errors too.
    """
    offsets = _rim(plan.world)
    if not len(offsets):
        return finding("execution", np.inf, [])
    poses = np.array([one.base for one in plan.setpoints])[:, None] + offsets
    joints = np.repeat([one.joints for one in plan.setpoints], len(offsets), axis=0)
    targets = [target for target in plan.world.task for _ in offsets]
    led, missed = postures_on_target(plan.world, targets, poses.reshape(-1, 3), joints)
    excess = missed.reshape(-1, len(offsets))
    violations, chain = [], plan.world.robot.chain
    for i in np.flatnonzero(excess.max(axis=1) > 0).tolist():
        k, worst = int(excess[i].argmax()), float(excess[i].max())
        off, posture = offsets[k], led[i * len(offsets) + k]
        at_limit = np.flatnonzero((posture <= chain.lower) | (posture >= chain.upper))
        text = f"with the base {np.hypot(off[0], off[1]):.4f} m and {abs(off[2]):.4f} rad off its place, "
        text += f"no posture near the planned one reaches {names.setpoint(i)}; the nearest misses its "
        text += f"tolerance by {worst:.4f} m or rad"
        if len(at_limit):
            joint = chain.names[at_limit[0]]
            text += f", {joint} at its limit, which criteria.joint_margin keeps it off"
        violations.append(Violation("execution", None, i, worst, text))
    return finding("execution", np.inf, violations)


def _rim(world: World) -> Array:
    """Offsets (n, 3) of the base at the largest errors that the rules allow for; none where they are zero."""
    errors = world.rules.errors
    if not errors.base_error and not errors.heading_error:
        return np.empty((0, 3))
    turns = np.unique([-errors.heading_error, errors.heading_error])
    return np.concatenate([errors.base_error * RIM + (0.0, 0.0, turn) for turn in turns])
