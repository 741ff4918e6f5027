"""Cubic splines of time through the states of a motion: accelerations have no jumps, jerk is bounded.

At both ends of a run velocity and acceleration are zero. For that the first and the last of its segments have
one more knot, halfway in time. Between knots jerk is constant.
Source: Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots (2008), section 4.4.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from regionik.timing.smooth_path import (
    SmoothPath,
    cubic_values,
    knot_curvatures,
    on_floor,
    rolled_over,
    slips_far,
    spline_cubics,
)
from regionik.worlds.arrays import Array, Index, Mask


class MotionRates(NamedTuple):
    """Base and joints q at m instants, and their first three derivatives by time, (m, 3 + dof) each."""

    q: Array
    velocity: Array
    acceleration: Array
    jerk: Array


class Knots(NamedTuple):
    """Knots of the splines: the states, and those between states."""

    time: Array  # (p,) [s]
    value: Array  # (p, k)
    acceleration: Array  # (p, k)
    segment: Index  # that a knot is on, or the last one is the end of, (p,)


@dataclass(frozen=True, eq=False)
class TimeSpline:
    """Splines through the states of a timed motion."""

    path: SmoothPath  # whose coordinates they are; a run ends where it has no length
    time: Array  # (n,) of the states, rising wherever something moves [s]

    @cached_property
    def ends(self) -> tuple[Mask, Mask]:
        """Segments that are the first, and the last, of a run, (n - 1,) each; no motion is on one alone."""
        moving = np.concatenate([[False], self.path.lengths > 0, [False]])
        return moving[1:-1] & ~moving[:-2], moving[1:-1] & ~moving[2:]

    def _knots(self, z: Array) -> Knots:
        """States with values (n, k), and in the first and last segments of runs a knot halfway."""
        time, (first, last) = self.time, self.ends
        bend = knot_curvatures(np.diff(time), z, self.path.lengths > 0, np.stack(self.ends))
        at = np.flatnonzero(first | last)
        lead, span = first[at][:, None], np.diff(time)[at]
        inner, rest = np.where(lead, bend[at + 1], bend[at]), np.where(lead, z[at], z[at + 1])
        half = np.where(lead, 4, -4) * (z[at + 1] - z[at]) / span[:, None] ** 2 - inner / 6
        return Knots(
            np.insert(time, at + 1, time[at] + span / 2),
            np.insert(z, at + 1, rest + half * span[:, None] ** 2 / 24, axis=0),
            np.insert(bend, at + 1, half, axis=0),
            np.insert(np.arange(len(time)), at + 1, at),
        )

    @cached_property
    def knots(self) -> Knots:
        """Those of the coordinates."""
        return self._knots(self.path.coordinates)

    @cached_property
    def _cubics(self) -> Array:
        """Of the coordinates."""
        return self._through(self.knots)

    def _through(self, knots: Knots) -> Array:
        """Coefficients by time from each knot on, constant first, (p - 1, 4, k)."""
        moving = (self.path.lengths > 0)[knots.segment[:-1]]
        return spline_cubics(np.diff(knots.time), knots.value, knots.acceleration, moving)

    @property
    def slipping(self) -> Mask:
        """Segments on which wheels slip more than they may, (n - 1,)."""
        return np.zeros(len(self.time) - 1, dtype=np.bool_)

    def evaluate(self, times: Array, piece: Index | None = None) -> MotionRates:
        """Base and joints at instants (m,) [s], which may be said to lie in pieces between knots (m,)."""
        if piece is None:
            knots = self.knots.time
            piece = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
        return self._world(times, piece)

    def _world(self, times: Array, piece: Index) -> MotionRates:
        return MotionRates(*cubic_values(self._cubics[piece], times - self.knots.time[piece]))


@dataclass(frozen=True, eq=False)
class RollingSpline(TimeSpline):
    """The same for a base on wheels: way rolled, heading, and what wheels slip on the way to each state.

    A smooth way that slips nowhere would have to turn to and fro between states that are joined by arcs.
    """

    @cached_property
    def _left(self) -> Array:
        """What is left of the base's motion on each segment when all is rolled, (n - 1, 2) [m]."""
        gone, segment = rolled_over(self._cubics, np.diff(self.knots.time)), self.knots.segment[:-1]
        rolled = np.column_stack([np.bincount(segment, one, len(self.time) - 1) for one in gone.T])
        left = np.diff(self.path.base[:, :2], axis=0) - rolled
        return np.where(self.path.lengths[:, None] > 0, left, 0.0)

    @property
    def slipping(self) -> Mask:
        return slips_far(self._left, self.path.drive.rolled(self.path.base))

    @cached_property
    def _slip(self) -> Array:
        """Coefficients of the place, besides what is rolled, (p - 1, 4, 2) [m]."""
        return self._through(self._knots(np.concatenate([np.zeros((1, 2)), np.cumsum(self._left, axis=0)])))

    @cached_property
    def _places(self) -> Array:
        """Of the base at each knot, (p, 2) [m]: at states their own."""
        knots = self.knots
        places = self.path.base[knots.segment, :2].copy()
        between = np.flatnonzero(np.diff(knots.segment, prepend=-1) == 0)
        slid = self._slip[between, 0] - self._slip[between - 1, 0]
        gone = rolled_over(self._cubics[between - 1], np.diff(knots.time)[between - 1])
        places[between] += gone + slid
        return places

    def _world(self, times: Array, piece: Index) -> MotionRates:
        since = times - self.knots.time[piece]
        return MotionRates(*on_floor(self._places[piece], self._cubics[piece], self._slip[piece], since))


def time_spline(path: SmoothPath, time: Array) -> TimeSpline:
    """Return the splines through the states of a path at given times (n,) [s]."""
    return (RollingSpline if path.drive.rolls else TimeSpline)(path, time)
