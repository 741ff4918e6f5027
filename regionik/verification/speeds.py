"""Speeds and accelerations of a timed plan, bounded at every moment.

Between two states the path acceleration is constant along the smooth path through the states, which is built
here again. On each segment every coordinate is a polynomial of time, and so are its derivatives; a polynomial
on an interval lies between the least and the largest of its Bernstein coefficients.
Source: Farouki, The Bernstein polynomial basis: a centennial retrospective (CAGD 2012), section 5.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np

from regionik.values import Motion, Violation
from regionik.verification.motion import Indices, MotionSegments
from regionik.verification.proofs import Finding, StateNames, finding
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World
from regionik.worlds.speeds import Speeds

OVER = 2e-3  # share of a limit by which bounds may be beyond it
SAME = 1e-9  # states that differ by less are the same [m], [rad]
STANDING = 1e-3  # share of the joints' motion below which a base on wheels stands
STEERED = 1e-5  # angle that a car's steering need not be turned for [rad]
PARTS = 16  # of a segment, each with bounds of its own
CLOSINGS = 20  # steps in which a rolled way is brought to its end
AT_REST = 1e-5  # path velocity at an end of a run, as a share of the largest


def verify_speeds(world: World, segments: MotionSegments, names: StateNames) -> Finding:
    """A timed plan keeps the speeds and accelerations of its world, or those that are its robot's own.

    The margin is what is left of the limit that is used most, as a share. Of the tool's speed the mean over
    each segment counts. A car's steering turns while it stands.
    """
    if np.isnan(segments.motion.time).any() or len(segments) == 0:
        return finding("speeds", np.inf, [])
    course = TimedSegments(segments)
    wrong = course.impossible
    if len(wrong):
        text = (
            f"no motion with constant path acceleration passes at these times {names.segment(int(wrong[0]))}"
        )
        at = int(wrong[0])
        return finding("speeds", np.inf, [Violation("speeds", at, names.owner(at), 1.0, text)])
    violations, most = [], 0.0
    for who, share, rows in _shares(world, segments, course):
        most = max(most, float(share.max(initial=0.0)))
        for k in np.flatnonzero(share > 1 + OVER).tolist():
            at = int(rows[k])
            text = f"{who} reaches {share[k]:.4f} of its limit {names.segment(at)}"
            violations.append(Violation("speeds", at, names.owner(at), float(share[k] - 1), text))
    return finding("speeds", 1 + OVER - most, violations)


@dataclass(frozen=True, eq=False)
class TimedSegments:
    """Segments of a timed motion on which something moves, as polynomials of the share of their time."""

    segments: MotionSegments

    @property
    def _motion(self) -> Motion:
        return self.segments.motion

    @cached_property
    def span(self) -> Array:
        """[s], (segments,)"""
        span: Array = np.diff(self._motion.time)
        return span

    @cached_property
    def lengths(self) -> Array:
        """Lengths on the smooth path: of what is rolled, else turned, else what moves most, (segments,)."""
        one = self.segments
        swing = np.abs(one.joint_change).max(axis=1, initial=0.0)
        if one.robot.drive.rolls:
            slow = STANDING * swing + SAME
            rolled, turn = np.abs(one.rolled), np.abs(one.turn)
            far = np.where(rolled > slow, rolled, np.where(turn > slow, turn, swing))
        else:
            far = np.maximum(np.maximum(np.linalg.norm(one.slide, axis=1), np.abs(one.turn)), swing)
        return np.where(far > SAME, far, 0.0)

    @cached_property
    def moving(self) -> Indices:
        return np.flatnonzero(self.lengths > 0)

    @cached_property
    def _rates(self) -> tuple[Array, Array]:
        """Path velocities at the start and at the end of each segment, (segments,)."""
        mean = self.lengths / np.where(self.span > 0, self.span, np.inf)
        start, end, rate = np.zeros(len(mean)), np.zeros(len(mean)), 0.0
        for k, value in enumerate(mean.tolist()):
            start[k] = rate
            rate = 2 * value - rate if self.lengths[k] > 0 else 0.0
            end[k] = rate
        return start, end

    @cached_property
    def impossible(self) -> Indices:
        """Segments that no motion from rest to rest passes in their time."""
        start, end = self._rates
        still = self.lengths == 0
        tolerance = AT_REST * max(float(end.max(initial=0.0)), 1.0)
        ends = np.append(still[1:], True) & ~still
        wrong = (~still & (self.span <= 0)) | (end < -tolerance) | (ends & (np.abs(end) > tolerance))
        return np.flatnonzero(wrong & np.isfinite(start))

    def polynomials(self) -> tuple[Array, Array]:
        """Coordinates and joints of moving segments, constant first, (moving, 9, k) and (moving, 9, dof).

        Coordinates are x, y and yaw, or what a base on wheels rolls, and its heading against that midway.
        """
        one, k = self.segments, self.moving
        if one.robot.drive.rolls:
            base = np.column_stack([one.rolled, one.turn])
        else:
            base = np.column_stack([one.slide, one.turn])
        change = np.column_stack([base, one.joint_change])
        shape = self._by_share(change)[k]
        if one.robot.drive.rolls:
            shape[:, 0, 1] = -one.turn[k] / 2
            shape = _closed(shape, one.rolled[k] * np.sinc(one.turn[k] / 2 / np.pi))
        start, end = (np.maximum(rate[k], 0.0) for rate in self._rates)
        first = 2 * start / (start + end)
        share = np.column_stack([np.zeros(len(k)), first, 1 - first])
        by_time = np.zeros((len(k), 9, change.shape[1]))
        power = np.ones((len(k), 1))
        for order in range(5):
            by_time[:, : power.shape[1]] += shape[:, order, None] * power[:, :, None]
            power = _product(power, share)
        return by_time[..., : base.shape[1]], by_time[..., base.shape[1] :]

    def _by_share(self, change: Array) -> Array:
        """Monotone cubics of the share of the way, constant first, (segments, 5, k), from 0 at the start.

        Source: Fritsch and Butland, SIAM J. Sci. Stat. Comput. 1984, eq. 5.
        """
        far = self.lengths[:, None]
        slope = change / np.where(far > 0, far, np.inf)
        one, other = slope[:-1], slope[1:]
        before, after = far[:-1], far[1:]
        part = (1 + after / np.where(before + after > 0, before + after, 1.0)) / 3
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = np.where(one * other > 0, one * other / (part * other + (1 - part) * one), 0.0)
        mean = np.where(before == 0, other, np.where(after == 0, one, mean))
        ends = np.concatenate([slope[:1], mean, slope[-1:]])
        left, right = ends[:-1] * far, ends[1:] * far
        zero = np.zeros_like(change)
        return np.stack([zero, left, 3 * change - 2 * left - right, left + right - 2 * change, zero], axis=1)


def _closed(shape: Array, chord: Array) -> Array:
    """Rolled ways and headings (m, 5, k) by share, changed so that the base comes to its next state.

    A way a (3 u^2 - 2 u^3) and a heading b u^2 (1 - u)^2 are added, which leave the rates at both ends.
    """
    shape, u, weights = shape.copy(), *_simpson()
    powers, slopes = np.vander(u, 5, increasing=True), np.zeros((len(u), 5))
    slopes[:, 1:] = np.arange(1, 5) * np.vander(u, 4, increasing=True)
    far = np.where(np.abs(chord) > SAME, chord, np.inf)
    for _ in range(CLOSINGS):
        way, heading = shape[..., 0] @ slopes.T, shape[..., 1] @ powers.T
        ahead, aside = (way * np.cos(heading)) @ weights, (way * np.sin(heading)) @ weights
        missed = np.where(np.isfinite(far), chord - ahead, 0.0)
        shape[:, 2:4, 0] += np.outer(missed, [3.0, -2.0])
        shape[:, 2:5, 1] -= np.outer(30.0 * aside / far, [1.0, -2.0, 1.0])
    return shape


def _simpson(panels: int = 32) -> tuple[Array, Array]:
    """Nodes and weights of Simpson's rule from 0 to 1."""
    weights = np.full(panels + 1, 2.0)
    weights[1::2] = 4.0
    weights[[0, -1]] = 1.0
    return np.linspace(0, 1, panels + 1), weights / (3 * panels)


def _shares(
    world: World, segments: MotionSegments, course: TimedSegments
) -> Iterator[tuple[str, Array, Indices]]:
    """Shares of limits that are used at the most, by segments."""
    robot, speeds = world.robot, world.speeds or Speeds()
    k, span = course.moving, course.span[course.moving]
    base, joints = (_derived(one, span) for one in course.polynomials())
    fastest, quickest = speeds.joint_limits(robot.chain)
    for j, name in enumerate(robot.chain.names):
        yield f"the speed of {name}", _largest(joints[0][..., j : j + 1]) / fastest[j], k
        yield f"the acceleration of {name}", _largest(joints[1][..., j : j + 1]) / quickest[j], k
    yield "the base's turning rate", _largest(base[0][..., -1:]) / speeds.turn_velocity, k
    yield "the base's angular acceleration", _largest(base[1][..., -1:]) / speeds.turn_acceleration, k
    way, gain = base[0][..., :-1], base[1][..., :-1]
    if robot.drive.rolls:
        across = _product(way[..., 0], base[0][..., 1])
        along = np.zeros_like(across)
        along[:, : gain.shape[1]] = gain[..., 0]
        gain = np.stack([along, across], axis=-1)
    yield "the base's speed", _largest(way) / speeds.base_velocity, k
    yield "the base's acceleration", _largest(gain) / speeds.base_acceleration, k
    if speeds.wheel_velocity is not None and robot.gauge > 0:
        turned = base[0][..., -1:] * robot.gauge / 2
        for wheel in (way - turned, way + turned):
            yield "the speed of a wheel", _largest(wheel) / speeds.wheel_velocity, k
    if speeds.tool_velocity is not None:
        yield "the tool's mean speed", _tool_speeds(segments)[k] / span / speeds.tool_velocity, k
    if robot.turning_radius > 0:
        yield from _steering(segments, course, speeds.steering_velocity)


def _tool_speeds(segments: MotionSegments) -> Array:
    """Distances of the tool from state to state, 0 where it is lifted, (segments,) [m]."""
    motion = segments.motion
    tools = segments.robot.tool(motion.base, motion.joints)[:, :3, 3]
    lifted = motion.kind == "transit"
    way: Array = np.linalg.norm(np.diff(tools, axis=0), axis=1) * ~(lifted[:-1] | lifted[1:])
    return way


def _steering(
    segments: MotionSegments, course: TimedSegments, limit: float
) -> Iterator[tuple[str, Array, Indices]]:
    """Rates of a car's steering while it stands: of a wheel one turning radius ahead of the axle."""
    rolling = np.flatnonzero((course.lengths > 0) & (np.abs(segments.rolled) > SAME))
    angle = np.arctan(segments.robot.turning_radius * segments.turn[rolling] / segments.rolled[rolling])
    turned = np.abs(np.diff(angle))
    stood = segments.motion.time[rolling[1:]] - segments.motion.time[rolling[:-1] + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = np.where(turned > STEERED, turned / stood, 0.0)
    yield "the steering", np.minimum(rate / limit, 1e9), rolling[1:]


def _derived(polynomials: Array, span: Array) -> tuple[Array, Array]:
    """First and second derivatives by time of polynomials (m, n, k) of the share of it."""
    first = polynomials[:, 1:] * np.arange(1, polynomials.shape[1])[:, None] / span[:, None, None]
    second = first[:, 1:] * np.arange(1, first.shape[1])[:, None] / span[:, None, None]
    return first, second


def _product(one: Array, other: Array) -> Array:
    """Products of polynomials (m, p) and (m, q), (m, p + q - 1)."""
    found = np.zeros((len(one), one.shape[1] + other.shape[1] - 1))
    for k in range(one.shape[1]):
        found[:, k : k + other.shape[1]] += one[:, k, None] * other
    return found


def _largest(polynomials: Array) -> Array:
    """Upper bounds for the lengths of vectors of polynomials (m, n, k) from 0 to 1, (m,)."""
    order = polynomials.shape[1] - 1
    bounds = np.zeros(len(polynomials))
    for part in range(PARTS):
        values = np.einsum("in,mnk->mik", _bernstein(order, part / PARTS, 1 / PARTS), polynomials)
        bounds = np.maximum(bounds, np.linalg.norm(values, axis=2).max(axis=1))
    return bounds


def _bernstein(order: int, start: float, width: float) -> Array:
    """Matrix from powers to Bernstein coefficients on an interval, (order + 1, order + 1)."""
    index = range(order + 1)
    moved = np.array(
        [[comb(n, i) * start ** max(n - i, 0) * width**i if n >= i else 0.0 for n in index] for i in index]
    )
    basis = np.array([[comb(i, n) / comb(order, n) if i >= n else 0.0 for n in index] for i in index])
    found: Array = basis @ moved
    return found
