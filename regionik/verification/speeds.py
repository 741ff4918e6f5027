"""Speeds, accelerations and jerks of a timed plan, bounded at every moment.

On each piece of a timed motion every coordinate is a polynomial of time, and so are its derivatives; a
polynomial on an interval lies between the least and the largest of its Bernstein coefficients.
Source: Farouki, The Bernstein polynomial basis: a centennial retrospective (CAGD 2012), section 5.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from regionik.values import Violation
from regionik.verification.motion import Indices, MotionSegments
from regionik.verification.proofs import Finding, StateNames, finding
from regionik.verification.steering import steering_shares
from regionik.verification.timed_deviation import verify_deviation
from regionik.verification.timed_segments import (
    SLIP,
    SLIPPED,
    CoursePolynomials,
    TimedSegments,
    bernstein_parts,
    product,
    timed_segments,
)
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World
from regionik.worlds.speeds import Speeds

OVER = 2e-3  # share of a limit by which bounds may be beyond it


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
    yield verify_deviation(segments, course, names, blend, min(cones, default=np.inf))
    yield _held_against("speeds", _shares(world, segments, course, rates), names)
    if world.speeds is not None and world.speeds.limit_jerk:
        yield _held_against("jerk", _jerks(world, course.moving, rates), names)


def _held_against(kind: str, shares: Iterable[tuple[str, Array, Indices]], names: StateNames) -> Finding:
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
    world: World,
    segments: MotionSegments,
    course: TimedSegments,
    rates: Sequence[CoursePolynomials],
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
    if speeds.tool_velocity is not None:
        yield "the tool's mean speed", _tool_speeds(segments)[k] / course.span[k] / speeds.tool_velocity, k
    if robot.drive.rolls:
        most = SLIPPED + SLIP * np.abs(segments.rolled)
        yield "the slip of the wheels", (np.hypot(*course.slip.T) / most)[k], k
    if robot.turning_radius > 0:
        yield from steering_shares(segments, course, speeds.steering_velocity)


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


def _derivatives(polynomials: Array, span: Array) -> list[Array]:
    """First to third derivatives by time of polynomials (m, n, k) of the share of it."""
    found = [polynomials]
    for _ in range(3):
        last = found[-1]
        found.append(last[:, 1:] * np.arange(1, last.shape[1])[:, None] / span[:, None, None])
    return found[1:]


def _largest(polynomials: Array) -> Array:
    """Upper bounds for the lengths of vectors of polynomials (m, n, k) from 0 to 1, (m,)."""
    bounds = np.zeros(len(polynomials))
    for values in bernstein_parts(polynomials):
        bounds = np.maximum(bounds, np.linalg.norm(values, axis=2).max(axis=1))
    return bounds
