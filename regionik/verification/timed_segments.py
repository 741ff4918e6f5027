"""Timed motions between states as polynomials of time, built again from states and times.

Where jerk is not limited the path acceleration is constant between two states, along cubic splines of arc
length through the states. Where it is, each coordinate is a cubic spline of time through the states, at rest
at both ends of a run.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import factorial
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, make_interp_spline
from scipy.special import comb

from regionik.verification.motion import Indices, Mask, MotionSegments
from regionik.verification.options import VERIFICATION
from regionik.verification.tolerances import EXACT
from regionik.worlds.arrays import Array
from regionik.worlds.limits import Speeds

OPTIONS = VERIFICATION.proofs

MAX_REST_WAY = 1e-7  # of a way that a car rolls with its steering as it is, by rounding [m]
AT_REST = 1e-5  # path velocity at an end of a run, as a share of the largest
NODES, WEIGHTS = np.array(leggauss(24)) / 2 + [[0.5], [0.0]]  # of a mean from 0 to 1


class CoursePolynomials(NamedTuple):
    """Polynomials of the share of a piece's time, constant first."""

    # (pieces, n, k) x, y and yaw, or what a base on wheels rolls, and its heading against that at the start
    base: Array
    joints: Array  # (pieces, n, dof)
    slip: Array  # (pieces, n, 2) of a base on wheels in the world, else (pieces, n, 0)


@dataclass(frozen=True, eq=False)
class TimedSegments:
    """Segments of a timed motion on which something moves, as polynomials of the share of their time."""

    segments: MotionSegments

    @property
    def kind(self) -> str:
        """What the motion is, in words."""
        return "with constant path acceleration"

    @cached_property
    def span(self) -> Array:
        """[s], (segments,)"""
        return np.diff(self.segments.motion.time)

    @cached_property
    def lengths(self) -> Array:
        """Lengths on the smooth path, in metres and radians alike, (segments,)."""
        far = np.linalg.norm(self.change, axis=1)
        return np.where(far > EXACT, far, 0.0)

    @cached_property
    def moving(self) -> Indices:
        """Segment of each polynomial."""
        return np.flatnonzero(self.lengths > 0)

    @property
    def piece_span(self) -> Array:
        """Time that each polynomial is for (moving,) [s]."""
        return self.span[self.moving]

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

    @cached_property
    def polynomials(self) -> CoursePolynomials:
        """Of moving segments; see `CoursePolynomials`."""
        k, shape = self.moving, self._through(self.change)
        if self.segments.robot.drive.rolls:
            shape = np.concatenate([shape, self._through(self.slip)], axis=2)
        start, end = (np.maximum(rate[k], 0.0) for rate in self._rates)
        first = 2 * start / (start + end)
        share = np.column_stack([np.zeros(len(k)), first, 1 - first])
        by_time = np.zeros((len(k), 7, shape.shape[2]))
        power = np.ones((len(k), 1))
        for order in range(4):
            by_time[:, : power.shape[1]] += shape[:, order, None] * power[:, :, None]
            power = product(power, share)
        return self._split(by_time)

    def rolling(self) -> tuple[Indices, Array, Array]:
        """Segments (m,) on which a base on wheels rolls, and their ways as polynomials of a share.

        These are way rolled and heading, (2, m, 4), and the square of the share's rate, (m, 2) [1/s2].
        """
        rolls = np.abs(self.segments.rolled[self.moving]) > MAX_REST_WAY
        k, ways = self.moving[rolls], self._through(self.change[:, :2])[rolls]
        start, end = ((np.maximum(rate[k], 0.0) / self.lengths[k]) ** 2 for rate in self._rates)
        return k, np.moveaxis(ways, 2, 0), np.column_stack([start, end - start])

    @cached_property
    def slip(self) -> Array:
        """What is left of each segment's motion of a base on wheels when all is rolled, (segments, 2) [m]."""
        one, k = self.segments, self.moving
        pieces = self._through(self.change)
        order = pieces.shape[1]
        powers, slopes = np.vander(NODES, order, increasing=True), np.zeros((len(NODES), order))
        slopes[:, 1:] = np.arange(1, order) * powers[:, :-1]
        way, yaw = pieces[..., 0] @ slopes.T, pieces[..., 1] @ powers.T + one.motion.base[k, None, 2]
        rolled = (np.bincount(k, (way * turned) @ WEIGHTS, len(one)) for turned in (np.cos(yaw), np.sin(yaw)))
        left = np.diff(one.motion.base[:, :2], axis=0) - np.column_stack(list(rolled))
        return np.where(self.lengths[:, None] > 0, left, 0.0)

    @property
    def change(self) -> Array:
        """Of coordinates and joints over segments, (segments, k + dof)."""
        one = self.segments
        slid = one.rolled[:, None] if one.robot.drive.rolls else one.slide
        return np.column_stack([slid, one.turn, one.joint_change])

    def _split(self, polynomials: Array) -> CoursePolynomials:
        if not self.segments.robot.drive.rolls:
            return CoursePolynomials(polynomials[..., :3], polynomials[..., 3:], polynomials[..., :0])
        return CoursePolynomials(polynomials[..., :2], polynomials[..., 2:-2], polynomials[..., -2:])

    def _through(self, change: Array) -> Array:
        """Splines of the share of each length, constant first, (moving, 4, k), from 0 at its start.

        They are functions of the way, with no second derivative at both ends of a run.
        """
        found = np.zeros((len(self.lengths), 4, change.shape[1]))
        for first, end in self._runs.tolist():
            found[first:end] = _natural_spline(self.lengths[first:end], change[first:end])
        return found[self.moving]

    @cached_property
    def _runs(self) -> Indices:
        """First segment of each run, and the one after its last, (runs, 2)."""
        edges = np.diff(np.concatenate([[False], self.lengths > 0, [False]]))
        return np.flatnonzero(edges).reshape(-1, 2)


@dataclass(frozen=True, eq=False)
class SplinedSegments(TimedSegments):
    """The same of a motion by cubic splines of time, of which the first and last segment of a run are two.

    Source: Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots (2008), 4.4.
    """

    @property
    def kind(self) -> str:
        return "without jumps of acceleration"

    def rolling(self) -> tuple[Indices, Array, Array]:
        """See `TimedSegments`: a car rests wherever its curvature changes, so it is constant on a segment."""
        one = self.segments
        k = np.flatnonzero((self.lengths > 0) & (np.abs(one.rolled) > MAX_REST_WAY))
        ways = np.zeros((2, len(k), 4))
        ways[:, :, 1] = one.rolled[k], one.turn[k]
        return k, ways, np.zeros((len(k), 2))

    @cached_property
    def impossible(self) -> Indices:
        alone = self._runs[self._runs[:, 1] - self._runs[:, 0] == 1, 0]
        return np.union1d(alone, np.flatnonzero((self.lengths > 0) & (self.span <= 0)))

    @cached_property
    def _halved(self) -> Mask:
        """Segments in two pieces, (segments,)."""
        return np.isin(np.arange(len(self.span)), self._runs - [0, 1])

    @cached_property
    def moving(self) -> Indices:
        whole = np.flatnonzero(self.lengths > 0)
        return np.repeat(whole, 1 + self._halved[whole])

    @property
    def piece_span(self) -> Array:
        return self.span[self.moving] / (1 + self._halved[self.moving])

    @cached_property
    def polynomials(self) -> CoursePolynomials:
        """Of pieces; see `CoursePolynomials`."""
        found = self._through(self.change)
        if self.segments.robot.drive.rolls:
            found = np.concatenate([found, self._through(self.slip)], axis=2)
        return self._split(found)

    def _through(self, change: Array) -> Array:
        """Splines by changes over segments (segments, k), from 0 at the start of each, (moving, 4, k)."""
        k = self.moving
        found = np.zeros((len(k), 4, change.shape[1]))
        for first, end in self._runs.tolist():
            rows = (first <= k) & (k < end)
            found[rows] = _spline_pieces(self.span[first:end], change[first:end])
        again = np.append(False, k[1:] == k[:-1])
        found[:, 0] = np.where(again[:, None], found[:, 0] - found[np.arange(len(k)) - 1, 0], 0.0)
        return found


def timed_segments(segments: MotionSegments, speeds: Speeds | None) -> TimedSegments:
    """Segments of a timed motion, by splines where speeds limit jerk."""
    return (SplinedSegments if speeds is not None and speeds.limit_jerk else TimedSegments)(segments)


def _natural_spline(length: Array, change: Array) -> Array:
    """Pieces (n, 4, k) of the cubic spline over n segments, by the share of each, from 0 at its start."""
    spline = make_interp_spline(*_places(length, change), 3, bc_type="natural")
    found = _pieces(spline, np.concatenate([[0.0], np.cumsum(length)]))
    found[:, 0] = 0.0
    return found


def _spline_pieces(span: Array, change: Array) -> Array:
    """Pieces (n + 2, 4, k) of the cubic spline over n segments, by the share of each, constant first.

    With neither velocity nor acceleration at both ends, for which the first and the last have a knot halfway.
    """
    time, places = _places(span, change)
    knots = np.concatenate([time[:1], [time[:2].mean()], time[1:-1], [time[-2:].mean()], time[-1:]])
    rest = [(order, np.zeros(change.shape[1])) for order in (1, 2)]
    ends = np.repeat(time[:1], 3), np.repeat(time[-1:], 3)
    spline = make_interp_spline(time, places, 3, np.concatenate([ends[0], knots, ends[1]]), (rest, rest))
    return _pieces(spline, knots)


def _places(width: Array, change: Array) -> tuple[Array, Array]:
    """Ends of segments (n + 1,) by their widths, and the places there (n + 1, k) by changes."""
    start = np.zeros((1, change.shape[1]))
    return np.concatenate([[0.0], np.cumsum(width)]), np.concatenate([start, np.cumsum(change, axis=0)])


def _pieces(spline: BSpline, knots: Array) -> Array:
    """Coefficients (n, 4, k) of a cubic spline by the share of the way between knots (n + 1,)."""
    h = np.diff(knots)[:, None]
    return np.stack([spline(knots[:-1], n) * h**n / factorial(n) for n in range(4)], axis=1)


def substitution(order: int, start: ArrayLike, width: ArrayLike) -> Array:
    """Matrices (..., order, order) from coefficients by x to those by u, where x = start + width u."""
    (i, n), (a, b) = np.indices((order, order)), (np.asarray(x)[..., None, None] for x in (start, width))
    return comb(n, i) * a ** np.maximum(n - i, 0) * b**i


def bernstein_parts(polynomials: Array) -> Iterator[Array]:
    """Bernstein coefficients of polynomials (m, n, ...) on each part of the interval from 0 to 1, so many."""
    i, n = np.indices((polynomials.shape[1], polynomials.shape[1]))
    scale = comb(i, n) / comb(len(i) - 1, n)
    for part in range(OPTIONS.speed_parts):
        by_power = scale @ substitution(len(i), part / OPTIONS.speed_parts, 1 / OPTIONS.speed_parts)
        yield np.einsum("in,mn...->mi...", by_power, polynomials)


def product(one: Array, other: Array) -> Array:
    """Products of polynomials (m, p) and (m, q), (m, p + q - 1)."""
    found = np.zeros((len(one), one.shape[1] + other.shape[1] - 1))
    for k in range(one.shape[1]):
        found[:, k : k + other.shape[1]] += one[:, k, None] * other
    return found
