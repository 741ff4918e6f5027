"""Cubic splines of time through the states of a motion: accelerations have no jumps, jerk is bounded.

At both ends of a run velocity and acceleration are zero. For that the first and the last of its segments have
one more knot, halfway in time. Between knots jerk is constant, but for what leads a base on wheels to its
states.
Source: Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots (2008), section 4.4.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.timing.smooth_path import LEFT, SAME, SLIP, SmoothPath, knot_curvatures
from regionik.worlds.arrays import Array, Index

CLOSINGS = 12  # steps in which a rolled way is brought to its end
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_WAY = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0, 0.0])  # from 0 to 1, first and second rate 0 at both ends
_HEADING = np.array([0.0, 0.0, 0.0, 1.0, -3.0, 3.0, -1.0])  # 0 at both ends, and so are both rates


class MotionRates(NamedTuple):
    """Base and joints q at m instants, and their first three derivatives by time, (m, 3 + dof) each."""

    q: Array
    velocity: Array
    acceleration: Array
    jerk: Array


class _Knots(NamedTuple):
    """Knots of the splines: the states, and those between states."""

    time: Array  # (p,)
    value: Array  # (p, k)
    acceleration: Array  # (p, k)
    segment: Index  # that a knot is on, or the last one is the end of, (p,)


@dataclass(frozen=True, eq=False)
class TimeSpline:
    """Splines through the states of a timed motion.

    Attributes
    ----------
    path : SmoothPath
        Whose coordinates they are; a run ends where it has no length.
    time : (n,) array
        Of the states, rising wherever something moves [s].
    """

    path: SmoothPath
    time: Array

    @cached_property
    def single(self) -> NDArray[np.bool_]:
        """Segments that are a run of their own, on which no such motion is, (n - 1,)."""
        first, last = self._ends
        return first & last

    @cached_property
    def _ends(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Segments that are the first, and the last, of a run, (n - 1,) each."""
        moving = np.concatenate([[False], self.path.lengths > 0, [False]])
        return moving[1:-1] & ~moving[:-2], moving[1:-1] & ~moving[2:]

    def _accelerations(self, z: Array) -> Array:
        """Second derivatives at the states, (n, k), by which first derivatives are continuous."""
        moving = self.path.lengths > 0
        h = np.where(moving, np.diff(self.time), 1.0)
        return knot_curvatures(h, np.diff(z, axis=0) / h[:, None], moving, np.stack(self._ends))

    def _knots(self, z: Array) -> _Knots:
        """States with values (n, k), and in the first and last segments of runs a knot halfway."""
        time, bend = self.time, self._accelerations(z)
        first, last = self._ends
        at = np.flatnonzero(first | last)
        lead, span = first[at][:, None], np.diff(time)[at]
        inner, rest = np.where(lead, bend[at + 1], bend[at]), np.where(lead, z[at], z[at + 1])
        half = np.where(lead, 4, -4) * (z[at + 1] - z[at]) / span[:, None] ** 2 - inner / 6
        return _Knots(
            np.insert(time, at + 1, time[at] + span / 2),
            np.insert(z, at + 1, rest + half * span[:, None] ** 2 / 24, axis=0),
            np.insert(bend, at + 1, half, axis=0),
            np.insert(np.arange(len(time)), at + 1, at),
        )

    @cached_property
    def _laid_out(self) -> _Knots:
        return self._knots(self.path.coordinates)

    @cached_property
    def _cubics(self) -> Array:
        """Of the coordinates."""
        return self._through(self._laid_out)

    def _through(self, knots: _Knots) -> Array:
        """Coefficients by time from each knot on, constant first, (p - 1, 4, k)."""
        moving = (self.path.lengths > 0)[knots.segment[:-1], None]
        h = np.where(moving, np.diff(knots.time)[:, None], 1.0)
        a, b = knots.acceleration[:-1], knots.acceleration[1:]
        slope = np.diff(knots.value, axis=0) / h - h * (2 * a + b) / 6
        rest = [np.where(moving, one, 0.0) for one in (slope, a / 2, (b - a) / (6 * h))]
        return np.stack([knots.value[:-1], *rest], axis=1)

    @property
    def instants(self) -> Array:
        """Times of the knots, (p,) [s]."""
        return self._laid_out.time

    @property
    def segments(self) -> Index:
        """Segment that each knot but the last begins or is on, (p - 1,)."""
        return self._laid_out.segment[:-1]

    def evaluate(self, times: Array, piece: Index | None = None) -> MotionRates:
        """Base and joints at instants (m,) [s], which may be said to lie in pieces between knots (m,)."""
        if piece is None:
            last = len(self.instants) - 2
            piece = np.clip(np.searchsorted(self.instants, times, side="right") - 1, 0, last)
        return self._world(times, piece)

    def _world(self, times: Array, piece: Index) -> MotionRates:
        return MotionRates(*_derivatives(self._cubics[piece], times - self.instants[piece]))


@dataclass(frozen=True, eq=False)
class RollingSpline(TimeSpline):
    """The same for a base on wheels: way rolled and heading are splines, and it comes to each of its states.

    To the way of a segment a part of 10 u^3 - 15 u^4 + 6 u^5 of its time u is added, to the heading one of
    u^3 (1 - u)^3: rates at the states stay what they are. Where it hardly misses the next state nothing is
    added, as states that are joined by arcs would have it turn to and fro between them; what it misses is
    slip, by splines like the others.
    """

    @cached_property
    def _added(self) -> Array:
        """Way and heading that are added on each segment, (n - 1, 2)."""
        path, added = self.path, np.zeros((len(self.time) - 1, 2))
        rolled, turn = path.drive.rolled(path.base), np.diff(path.base[:, 2])
        rolling = (np.abs(rolled) > SAME) & (path.lengths > 0)
        middle, chord = path.base[:-1, 2] + turn / 2, rolled * np.sinc(turn / 2 / np.pi)
        for step in range(CLOSINGS):
            went, by_heading = self._ways(added)
            missed = chord - went * np.exp(-1j * middle)
            rolling &= (step > 0) | (np.abs(missed) > LEFT + SLIP * np.abs(rolled))
            missed = missed[rolling]
            added[rolling, 0] += missed.real
            added[rolling, 1] += missed.imag / by_heading[rolling]
        return added

    @cached_property
    def _slip(self) -> Array:
        """Coefficients of what is left of the base's motion when all is rolled, (p - 1, 4, 2) [m]."""
        ways, _ = self._ways(self._added)
        left = np.diff(self.path.base[:, :2], axis=0) - np.column_stack([ways.real, ways.imag])
        left[self.path.lengths == 0] = 0.0
        return self._through(self._knots(np.concatenate([np.zeros((1, 2)), np.cumsum(left, axis=0)])))

    def _ways(self, added: Array) -> tuple[NDArray[np.complex128], Array]:
        """Ways on the floor over segments, and how much farther aside a unit of added heading leads."""
        piece = np.repeat(np.arange(len(self.segments)), len(_NODES))
        start, span = self.instants[:-1], np.diff(self.instants)
        times = (start[:, None] + span[:, None] * (_NODES + 1) / 2).ravel()
        weight = (span[:, None] * _WEIGHTS / 2).ravel()
        value, slope, *_ = self._rolled(times, piece, added)
        segment, count = self.segments[piece], len(self.time) - 1
        rate, heading = (
            weight * slope[:, 0],
            np.polynomial.polynomial.polyval(self._share(times, segment), _HEADING),
        )
        step = rate * np.exp(1j * value[:, 1])
        ways = np.bincount(segment, step.real, count) + 1j * np.bincount(segment, step.imag, count)
        by_heading: Array = np.bincount(segment, rate * heading, count).astype(np.float64)
        return ways, by_heading

    def _share(self, times: Array, segment: Index) -> Array:
        span = np.diff(self.time)[segment]
        share: Array = (times - self.time[segment]) / np.where(span > 0, span, 1.0)
        return share

    def _rolled(self, times: Array, piece: Index, added: Array) -> list[Array]:
        """Way rolled, heading and joints, and their derivatives, (m, 2 + dof) each."""
        found = _derivatives(self._cubics[piece], times - self.instants[piece])
        segment = self.segments[piece]
        span = np.diff(self.time)[segment]
        share, rate = self._share(times, segment), 1 / np.where(span > 0, span, np.inf)
        for column, bump in enumerate((_WAY, _HEADING)):
            for order, values in enumerate(found):
                by_share = np.polynomial.polynomial.polyder(bump, order)
                bent = np.polynomial.polynomial.polyval(share, by_share) * rate**order
                values[:, column] += added[segment, column] * bent
        return found

    @cached_property
    def _places(self) -> Array:
        """Of the base at each knot, (p, 2) [m]: at states their own."""
        knots = self._laid_out
        places = self.path.base[knots.segment, :2].copy()
        between = np.flatnonzero(np.diff(knots.segment, prepend=-1) == 0)
        slid = self._slip[between, 0] - self._slip[between - 1, 0]
        places[between] += self._gone(knots.time[between], between - 1) + slid
        return places

    def _gone(self, times: Array, piece: Index) -> Array:
        """Way on the floor from the knot before to instants in pieces, (m, 2) [m]."""
        since = times - self.instants[piece]
        nodes = self.instants[piece, None] + since[:, None] * (_NODES + 1) / 2
        value, slope, *_ = self._rolled(nodes.ravel(), np.repeat(piece, len(_NODES)), self._added)
        rate = slope[:, 0].reshape(nodes.shape) * since[:, None] * _WEIGHTS / 2
        yaw = value[:, 1].reshape(nodes.shape)
        return np.column_stack([(rate * np.cos(yaw)).sum(1), (rate * np.sin(yaw)).sum(1)])

    def _world(self, times: Array, piece: Index) -> MotionRates:
        value, slope, bend, jerk = self._rolled(times, piece, self._added)
        ahead = np.exp(1j * value[:, 1])
        v, w = slope[:, 0], slope[:, 1]
        along = [
            v + 0j,
            bend[:, 0] + 1j * v * w,
            jerk[:, 0] - v * w**2 + 1j * (2 * bend[:, 0] * w + v * bend[:, 1]),
        ]
        slid, *slipping = _derivatives(self._slip[piece], times - self.instants[piece])
        place = self._places[piece] + self._gone(times, piece) + slid - self._slip[piece, 0]
        flat = [
            np.column_stack([row.real, row.imag]) + slip
            for row, slip in zip((row * ahead for row in along), slipping, strict=True)
        ]
        rates = zip([place, *flat], (value, slope, bend, jerk), strict=True)
        return MotionRates(*(np.column_stack([xy, rest[:, 1:]]) for xy, rest in rates))


def _derivatives(cubics: Array, since: Array) -> list[Array]:
    """Values of cubics (m, 4, k) at times (m,), and their first three derivatives, (m, k) each."""
    a, b, c, d = (cubics[:, order] for order in range(4))
    t = since[:, None]
    return [a + t * (b + t * (c + t * d)), b + t * (2 * c + 3 * t * d), 2 * c + 6 * t * d, 6 * d]


def time_spline(path: SmoothPath, time: Array) -> TimeSpline:
    """Return the splines through the states of a path at given times (n,) [s]."""
    return (RollingSpline if path.drive.rolls else TimeSpline)(path, time)
