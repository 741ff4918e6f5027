"""Speeds, accelerations, jerks and steering of a timed plan, and how far it leaves the proven motion.

On each piece of a timed motion every coordinate is a polynomial of time, and so are its derivatives; a
polynomial on an interval lies between the least and the largest of its Bernstein coefficients. So all are
bounded at every moment.
Source: Farouki, The Bernstein polynomial basis: a centennial retrospective (CAGD 2012), section 5.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.polynomial.polynomial import polyder

from regionik.values import Motion, Violation
from regionik.verification.motion import Indices, MotionSegments
from regionik.verification.proofs import Finding, StateNames, finding
from regionik.verification.strokes import in_one_stroke, ways
from regionik.verification.timed_segments import (
    CoursePolynomials,
    TimedSegments,
    bernstein_parts,
    product,
    substitution,
    timed_segments,
)
from regionik.verification.tolerances import BEYOND, OVER, SLIP, SLIPPED, STEERED
from regionik.worlds.arrays import Array
from regionik.worlds.limits import Speeds
from regionik.worlds.robot import Robot
from regionik.worlds.scene import World

ZERO_SHARE = 1e-9  # of derivatives at an end of a segment, as a share of the largest
MAX_SHARE = 1e9  # share of a limit where nothing bounds it


def verify_speeds(world: World, segments: MotionSegments, names: StateNames) -> Iterator[Finding]:
    """A timed plan keeps the speeds and accelerations of its world, or those that are its robot's own.

    The margin is what is left of the limit that is used most, as a share. Of the tool's speed the mean over
    each segment counts. Where jerks are limited they are a finding of their own.
    """
    if np.isnan(segments.motion.time).any() or len(segments) == 0:
        return
    course = timed_segments(segments, world.speeds)
    if len(course.impossible):
        at = int(course.impossible[0])
        text = f"no motion {course.kind} passes at these times {names.segment(at)}"
        yield finding("speeds", np.inf, [Violation("speeds", at, names.owner(at), 1.0, text)])
        return
    rates = [
        CoursePolynomials(*some)
        for some in zip(*(_derivatives(one, course.piece_span) for one in course.polynomials), strict=True)
    ]
    cones = [target.cone for target in world.task if target.direction is not None]
    blend = (world.speeds or Speeds()).blend
    yield _verify_deviation(segments, course, names, blend, min(cones, default=np.inf))
    yield _limit_finding("speeds", _shares(world, segments, course, rates), names)
    if world.speeds is not None and world.speeds.limit_jerk:
        yield _limit_finding("jerk", _jerks(world, course.moving, rates), names)


def _limit_finding(kind: str, shares: Iterable[tuple[str, Array, Indices]], names: StateNames) -> Finding:
    """Finding of who uses what shares of a limit on which segments."""
    violations, most = [], 0.0
    for who, share, rows in shares:
        most = max(most, float(share.max(initial=0.0)))
        for k in np.flatnonzero(share > 1 + OVER).tolist():
            at = int(rows[k])
            text = f"{who} reaches {share[k]:.4f} of its limit {names.segment(at)}"
            violations.append(Violation(kind, at, names.owner(at), float(share[k] - 1), text))
    return finding(kind, 1 + OVER - most, violations)


def _shares(
    world: World, segments: MotionSegments, course: TimedSegments, rates: Sequence[CoursePolynomials]
) -> Iterator[tuple[str, Array, Indices]]:
    """Shares of limits that are used at the most, by segments, from derivatives by time."""
    robot, speeds, k = world.robot, world.speeds or Speeds(), course.moving
    base, joints, slip = zip(*rates, strict=True)
    fastest, quickest = speeds.joint_limits(robot.chain)
    for j, name in enumerate(robot.chain.names):
        yield f"the speed of {name}", _largest(joints[0][..., j : j + 1]) / fastest[j], k
        yield f"the acceleration of {name}", _largest(joints[1][..., j : j + 1]) / quickest[j], k
    yield "the base's turning rate", _largest(base[0][..., -1:]) / speeds.turn_velocity, k
    yield "the base's angular acceleration", _largest(base[1][..., -1:]) / speeds.turn_acceleration, k
    way, gain = base[0][..., :-1], base[1][..., :-1]
    if robot.drive.rolls:
        across = product(way[..., 0], base[0][..., 1])
        along = np.zeros_like(across)
        along[:, : gain.shape[1]] = gain[..., 0]
        gain = np.stack([along, across], axis=-1)
    yield "the base's speed", (_largest(way) + _largest(slip[0])) / speeds.base_velocity, k
    yield "the base's acceleration", (_largest(gain) + _largest(slip[1])) / speeds.base_acceleration, k
    if speeds.wheel_velocity is not None and robot.gauge > 0:
        turned = base[0][..., -1:] * robot.gauge / 2
        for wheel in (way - turned, way + turned):
            yield "the speed of a wheel", _largest(wheel) / speeds.wheel_velocity, k
    fastest = _fastest_of_tool(world, segments.motion)[k]
    if np.isfinite(fastest).any():
        yield "the tool's mean speed", _tool_speeds(segments)[k] / course.span[k] / fastest, k
    if robot.drive.rolls:
        most = SLIPPED + SLIP * np.abs(segments.rolled)
        yield "the slip of the wheels", (np.hypot(*course.slip.T) / most)[k], k
    if robot.turning_radius > 0:
        yield from _steering_shares(segments, course, speeds.steering_velocity)


def _jerks(
    world: World, k: Indices, rates: Sequence[CoursePolynomials]
) -> Iterator[tuple[str, Array, Indices]]:
    """Shares of limits of jerk that are used at the most on segments k."""
    robot, speeds, (turned, swung, slip) = world.robot, world.speeds or Speeds(), rates[2]
    for j, (name, limit) in enumerate(zip(robot.chain.names, speeds.joint_jerks(robot.chain), strict=True)):
        yield f"the jerk of {name}", _largest(swung[..., j : j + 1]) / limit, k
    if speeds.turn_jerk is not None:
        yield "the base's angular jerk", _largest(turned[..., -1:]) / speeds.turn_jerk, k
    if speeds.base_jerk is not None:
        moved = _rolled_jerk(*(one.base for one in rates)) if robot.drive.rolls else turned[..., :-1]
        yield "the base's jerk", (_largest(moved) + _largest(slip)) / speeds.base_jerk, k


def _rolled_jerk(first: Array, second: Array, third: Array) -> Array:
    """Jerk of a base on wheels along and across its heading, from derivatives of way and heading."""
    (v, w), (gain, twist) = ((one[..., 0], one[..., 1]) for one in (first, second))
    along = -product(product(v, w), w)
    along[:, : third.shape[1]] += third[..., 0]
    across = product(v, twist) + 2 * product(gain, w)
    return np.stack([along, np.pad(across, ((0, 0), (0, along.shape[1] - across.shape[1])))], axis=-1)


def _tool_speeds(segments: MotionSegments) -> Array:
    """Distances of the tool from state to state, 0 where it is lifted, (segments,) [m]."""
    motion = segments.motion
    tools = segments.robot.tool(motion.base, motion.joints)[:, :3, 3]
    lifted = motion.kind == "transit"
    return np.linalg.norm(np.diff(tools, axis=0), axis=1) * ~(lifted[:-1] | lifted[1:])


def _fastest_of_tool(world: World, motion: Motion) -> Array:
    """Limits of the tool's speed on segments, of all and of ways at work to set-points, (segments,) [m/s]."""
    common = (world.speeds or Speeds()).tool_velocity
    fastest = np.full(len(motion) - 1, np.inf if common is None else common)
    for i, first, after in ways(motion):
        before, target = world.task[i - 1], world.task[i]
        if target.speed is not None and (target.stroke is None or in_one_stroke(before, target)):
            fastest[first:after] = np.minimum(fastest[first:after], target.speed)
    return fastest


def _verify_deviation(
    segments: MotionSegments, course: TimedSegments, names: StateNames, blend: float, cone: float
) -> Finding:
    """No point of the robot leaves the proven motion by much more than the blend [m].

    The tool turns from it by no more than the narrowest ``cone`` [rad].
    """
    most = BEYOND * blend
    off = deviations(segments, course, most / cone)
    violations = []
    for k, far in zip(course.moving.tolist(), off.tolist(), strict=True):
        if far > most:
            text = f"the timed motion may be {far:.4g} m off the one that is proven {names.segment(k)}"
            violations.append(Violation("timing", k, names.owner(k), far - most, text))
    return finding("timing", most - float(off.max(initial=0.0)), violations)


def deviations(segments: MotionSegments, course: TimedSegments, pointer: float) -> Array:
    """Upper bounds for how far points are off the proven motion, on each polynomial (moving,) [m].

    Proven are joints that move evenly from state to state, and a base that slides straight or rolls along an
    arc. What moves most has come a share of its way; what any other coordinate is off that same share of its
    own is a polynomial of time. Points are those of all solids, and of lines as long as a ``pointer`` from
    the tool's point [m].
    """
    k, motion, robot = course.moving, course.polynomials, segments.robot
    levers = _levers(segments, pointer)
    coordinates = np.concatenate([motion.base, motion.joints], axis=2)
    change = course.change[k]
    leading = np.argmax(np.abs(change) * levers, axis=1)[:, None]
    share = np.take_along_axis(coordinates, leading[:, None], axis=2)
    share = share / np.take_along_axis(change, leading, axis=1)[:, None]
    off = _largest((coordinates - share * change[:, None]) * levers, 1)
    beyond = np.maximum(_largest(2 * share - np.eye(1, share.shape[1]).T) - 1, 0.0) / 2
    found: Array = off + beyond * (np.abs(change) @ levers)
    if robot.drive.rolls:  # the way rolled goes where the heading points
        turned = _largest(coordinates[..., 1:2] - share * change[:, None, 1:2])
        found = found + _largest(motion.slip, 1) + turned * (1 + 2 * beyond) * np.abs(change[:, 0])
    return found


def _levers(segments: MotionSegments, pointer: float) -> Array:
    """Upper bounds for the motion of any point by a unit of each coordinate of base and arm, (k,) [m]."""
    robot = segments.robot
    chain, n = robot.chain, len(robot.chain.joints)
    radii = np.zeros(n)
    for solid in robot.solids:
        farthest = float(np.linalg.norm(solid.corners, axis=1).max()) + solid.radius
        radii[solid.link] = max(radii[solid.link], farthest)
    radii[-1] = max(radii[-1], float(np.linalg.norm(chain.T_last_tool[:3, 3])) + pointer)
    by_joint, far = np.zeros(n), 0.0
    slides = np.abs(chain.joint_values(segments.motion.joints)).max(axis=0, initial=0.0)
    for k in reversed(range(n)):
        far = max(far, float(radii[k]))
        turns = chain.joints[k].kind == "revolute"
        by_joint[k] = far if turns else 1.0
        far += float(np.linalg.norm(chain.joints[k].T_parent_joint[:3, 3])) + (0.0 if turns else slides[k])
    by_turn = max(far + float(np.hypot(*robot.mount[:2])), _farthest_of_base(robot))
    return np.array([*[1.0] * (1 if robot.drive.rolls else 2), by_turn, *np.abs(chain.coupling).T @ by_joint])


def _farthest_of_base(robot: Robot) -> float:
    """Distance of the base's farthest point from its origin [m]."""
    corners = [robot.footprint, *(solid.corners[:, :2] for solid in robot.base_solids)]
    thick = max((solid.radius for solid in robot.base_solids), default=0.0)
    return float(np.linalg.norm(np.concatenate(corners), axis=1).max()) + thick


def _steering_shares(
    segments: MotionSegments, course: TimedSegments, limit: float
) -> Iterator[tuple[str, Array, Indices]]:
    """Shares of a car's lock, and of the limit of its steering's rate, that segments use at the most.

    On a segment the way rolled and the heading are polynomials of a share; f and g are their derivatives. The
    steering angle is atan(R g / f), of a wheel one turning radius R ahead of the axle. A factor common to f
    and g changes nothing of it: such are zeros where the base begins or ends to roll while the arm goes on.
    """
    k, ways, share_rates = course.rolling()
    f, g = _without_common_zeros(ways) * np.array([1.0, segments.robot.turning_radius])[:, None, None]
    far = np.abs(segments.rolled[k])
    room = [np.sign(segments.rolled[k])[:, None] * f - side * g for side in (-1, 1)]
    least = np.minimum(*(_parts(one).min(axis=(0, 2)) for one in room))
    yield "the steering's lock", 1 - least / (far + SLIPPED), k

    turning = product(polyder(g, axis=1), f) - product(g, polyder(f, axis=1))
    square = limit * (product(f, f) + product(g, g))
    yield "the steering", _largest_share(product(product(turning, turning), share_rates), square), k

    time = segments.motion.time
    with np.errstate(divide="ignore", invalid="ignore"):
        begun, ended = np.arctan(g[:, 0] / f[:, 0]), np.arctan(g.sum(axis=1) / f.sum(axis=1))
        turned = np.abs(begun[1:] - ended[:-1])
        rate = np.where(turned > STEERED, turned / (time[k[1:]] - time[k[:-1] + 1]), 0.0)
    yield "the steering", np.minimum(rate / limit, MAX_SHARE), k[1:]


def _largest_share(used: Array, limit: Array) -> Array:
    """Upper bounds (m,) for the roots of polynomials (m, n) as shares of the squares of others (m, k)."""
    most = product(limit, limit)
    beyond = np.zeros((len(used), max(used.shape[1], most.shape[1])))
    beyond[:, : used.shape[1]] += used
    beyond[:, : most.shape[1]] -= most
    over, most = _parts(beyond).max(axis=2), _parts(most)
    with np.errstate(divide="ignore", invalid="ignore"):
        square = 1 + over / np.where(over > 0, np.maximum(most.min(axis=2), 0.0), most.max(axis=2))
    found: Array = np.sqrt(np.clip(np.nan_to_num(square, nan=0.0), 0.0, MAX_SHARE**2).max(axis=0))
    return found


def _parts(polynomials: Array) -> Array:
    """Bernstein coefficients of polynomials (m, n) on parts of the interval from 0 to 1, (parts, m, n)."""
    return np.stack(list(bernstein_parts(polynomials)))


def _without_common_zeros(ways: Array) -> Array:
    """Derivatives, (2, m, 3), of cubics (2, m, 4), less factors of zeros at an end that both have."""
    found: Array = ways[..., 1:] * [1, 2, 3]
    for _ in range(2):  # at the start, then, seen from there, at the end
        zero = (np.abs(found[..., 0]) <= ZERO_SHARE * np.abs(found).sum(axis=2).max(axis=0)).all(axis=0)
        shifted = np.concatenate([found[..., 1:], np.zeros_like(found[..., :1])], axis=2)
        found = np.where(zero[:, None], shifted, found) @ substitution(3, 1.0, -1.0).T
    return found


def _derivatives(polynomials: Array, span: Array) -> list[Array]:
    """First to third derivatives by time of polynomials (m, n, k) of the share of it."""
    found = [polynomials]
    for _ in range(3):
        found.append(polyder(found[-1], axis=1) / span[:, None, None])
    return found[1:]


def _largest(polynomials: Array, order: int | None = None) -> Array:
    """Upper bounds (m,) for norms of vectors of polynomials (m, n, k) from 0 to 1, lengths by default."""
    bounds = np.zeros(len(polynomials))
    for values in bernstein_parts(polynomials):
        bounds = np.maximum(bounds, np.linalg.norm(values, order, axis=2).max(axis=1))
    return bounds
