"""Timed motions between states as polynomials of time, built again from states and times.

Where jerk is not limited the path acceleration is constant between two states, along the smooth path through
the states. Where it is, each coordinate is a cubic spline of time through the states, at rest at both ends of
a run.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np

from regionik.values import Motion
from regionik.verification.motion import Indices, Mask, MotionSegments
from regionik.worlds.arrays import Array
from regionik.worlds.speeds import Speeds

SAME = 1e-9  # states that differ by less are the same [m], [rad]
STANDING = 1e-3  # share of the joints' motion below which a base on wheels stands
CLOSINGS = 20  # steps in which a rolled way is brought to its end
AT_REST = 1e-5  # path velocity at an end of a run, as a share of the largest
WAY = (0.0, 0.0, 0.0, 10.0, -15.0, 6.0, 0.0)  # added to a way by the share of time, constant first
HEADING = (0.0, 0.0, 0.0, 1.0, -3.0, 3.0, -1.0)  # added to a heading


@dataclass(frozen=True, eq=False)
class TimedSegments:
    """Segments of a timed motion on which something moves, as polynomials of the share of their time."""

    segments: MotionSegments

    @property
    def kind(self) -> str:
        """What the motion is, in words."""
        return "with constant path acceleration"

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

    def polynomials(self) -> tuple[Array, Array]:
        """Coordinates and joints of moving segments, constant first, (moving, 9, k) and (moving, 9, dof).

        Coordinates are x, y and yaw, or what a base on wheels rolls, and its heading against that midway.
        """
        one, k, change = self.segments, self.moving, self._change
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
            power = product(power, share)
        return self._split(by_time)

    @property
    def _change(self) -> Array:
        """Of coordinates and joints over segments, (segments, k + dof)."""
        one = self.segments
        slid = one.rolled[:, None] if one.robot.drive.rolls else one.slide
        return np.column_stack([slid, one.turn, one.joint_change])

    def _split(self, polynomials: Array) -> tuple[Array, Array]:
        """Those of coordinates and those of joints."""
        count = 2 if self.segments.robot.drive.rolls else 3
        return polynomials[..., :count], polynomials[..., count:]

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


@dataclass(frozen=True, eq=False)
class SplinedSegments(TimedSegments):
    """The same of a motion by cubic splines of time, of which the first and last segment of a run are two.

    Source: Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots (2008), 4.4.
    """

    @property
    def kind(self) -> str:
        """See `TimedSegments.kind`."""
        return "without jumps of acceleration"

    @cached_property
    def _ends(self) -> tuple[Mask, Mask]:
        """Segments that begin and that end a run, (segments,)."""
        still = self.lengths == 0
        return ~still & np.append(True, still[:-1]), ~still & np.append(still[1:], True)

    @cached_property
    def impossible(self) -> Indices:
        """Segments that no motion from rest to rest passes in their time."""
        first, last = self._ends
        return np.flatnonzero((self.lengths > 0) & ((self.span <= 0) | (first & last)))

    @cached_property
    def _halved(self) -> Mask:
        """Segments in two pieces, (segments,)."""
        first, last = self._ends
        return first | last

    @cached_property
    def moving(self) -> Indices:
        """Segment of each polynomial."""
        whole = np.flatnonzero(self.lengths > 0)
        return np.repeat(whole, 1 + self._halved[whole])

    @property
    def piece_span(self) -> Array:
        """See `TimedSegments.piece_span`."""
        return self.span[self.moving] / (1 + self._halved[self.moving])

    @cached_property
    def _start(self) -> Array:
        """Share of the segment's time at which each piece begins, (moving,)."""
        again = np.append(False, self.moving[1:] == self.moving[:-1])
        return np.where(again, 0.5, 0.0)

    def _velocities(self) -> Array:
        """First derivatives at the states, by which second ones are continuous, (segments + 1, k)."""
        change, (first, last) = self._change, self._ends
        h = np.where(self.lengths > 0, self.span, np.inf)
        inner = (self.lengths[:-1] > 0) & (self.lengths[1:] > 0)
        by_left, by_right = np.where(first, 6, 4) / h, np.where(last, 6, 4) / h
        pull = change / h[:, None] ** 2
        right = np.where(last, 12, 6)[1:, None] * pull[1:] + np.where(first, 12, 6)[:-1, None] * pull[:-1]
        middle = np.where(inner, by_left[:-1] + by_right[1:], 1.0)
        below = np.where(inner & ~first[:-1], 2 / h[:-1], 0.0)
        above = np.where(inner & ~last[1:], 2 / h[1:], 0.0)
        found = np.zeros((len(h) + 1, change.shape[1]))
        found[1:-1] = _tridiagonal(below, middle, above, np.where(inner[:, None], right, 0.0))
        return found

    def polynomials(self) -> tuple[Array, Array]:
        """Coordinates and joints of pieces, constant first, (moving, 7, k) and (moving, 7, dof)."""
        v, k, (first, last) = self._velocities(), self.moving, self._ends
        change, h = self._change[k], self.span[k, None]
        start, end = v[k] * h, v[k + 1] * h
        zero = np.zeros_like(change)
        whole = [zero, start, 3 * change - 2 * start - end, start + end - 2 * change]
        ends = np.where(first[k, None], end, -start), np.where(first[k, None], change, -change)
        # Accelerations times H^2, with H half the span: of the state, and halfway.
        at_state = (6 * ends[0] - 12 * ends[1]) / 4
        halfway = (2 * ends[0] - 2 * at_state) / 4
        way, jump = halfway / 6, (at_state - halfway) / 6
        from_rest = [zero, zero, zero, way]
        to_state = [way, halfway / 2, halfway / 2, jump]
        from_state = [zero, start / 2, at_state / 2, -jump]
        to_rest = [change + way, -halfway / 2, halfway / 2, -way]
        late = self._start > 0
        cases = [first[k] & ~late, first[k] & late, last[k] & ~late, last[k] & late]
        found = np.zeros((len(k), 7, change.shape[1]))
        for order in range(4):
            parts = [one[order] for one in (from_rest, to_state, from_state, to_rest)]
            found[:, order] = np.select([case[:, None] for case in cases], parts, whole[order])
        return self._split(self._closed(found) if self.segments.robot.drive.rolls else found)

    def _closed(self, found: Array) -> Array:
        """Pieces whose rolled ways and headings come to the next state of the base."""
        one, k = self.segments, self.moving
        found[:, 0, 1] -= one.turn[k] / 2
        chord = one.rolled * np.sinc(one.turn / 2 / np.pi)
        bumps = np.stack(
            [_moved(bump, self._start, 1 / (1 + self._halved[k])) for bump in (WAY, HEADING)], axis=-1
        )
        rolling, count = np.abs(chord) > SAME, len(one)
        u, weights = _simpson()
        powers, slopes = np.vander(u, 7, increasing=True), np.zeros((len(u), 7))
        slopes[:, 1:] = np.arange(1, 7) * np.vander(u, 6, increasing=True)
        aside_of = bumps[..., 1] @ powers.T
        for _ in range(CLOSINGS):
            way, heading = found[..., 0] @ slopes.T, found[..., 1] @ powers.T
            ahead, aside, gain = (
                np.bincount(k, (way * one_of) @ weights, count)
                for one_of in (np.cos(heading), np.sin(heading), aside_of)
            )
            added = np.zeros((count, 2))
            added[rolling, 0] = (chord - ahead)[rolling]
            added[rolling, 1] = -aside[rolling] / gain[rolling]
            found[..., :2] += bumps * added[k][:, None]
        return found


def timed_segments(segments: MotionSegments, speeds: Speeds | None) -> TimedSegments:
    """Segments of a timed motion, by splines where speeds limit jerk."""
    return (SplinedSegments if speeds is not None and speeds.limit_jerk else TimedSegments)(segments)


def _tridiagonal(below: Array, middle: Array, above: Array, right: Array) -> Array:
    """Solve for m rows (m, k), each with its neighbours before and after, by elimination."""
    ratio, found = np.zeros(len(middle)), right.copy()
    for i in range(len(middle)):
        left = below[i] if i else 0.0
        pivot = middle[i] - left * ratio[i - 1]
        ratio[i] = above[i] / pivot
        found[i] = (right[i] - left * found[i - 1]) / pivot
    for i in range(len(middle) - 2, -1, -1):
        found[i] -= ratio[i] * found[i + 1]
    return found


def _moved(polynomial: tuple[float, ...], start: Array, width: Array) -> Array:
    """Coefficients (m, n) of a polynomial of ``start + width u`` by u."""
    found = np.zeros((len(start), len(polynomial)))
    for n, value in enumerate(polynomial):
        for i in range(n + 1):
            found[:, i] += value * comb(n, i) * start ** (n - i) * width**i
    return found


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


def product(one: Array, other: Array) -> Array:
    """Products of polynomials (m, p) and (m, q), (m, p + q - 1)."""
    found = np.zeros((len(one), one.shape[1] + other.shape[1] - 1))
    for k in range(one.shape[1]):
        found[:, k : k + other.shape[1]] += one[:, k, None] * other
    return found
