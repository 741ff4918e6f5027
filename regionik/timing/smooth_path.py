"""Smooth path of a timed motion: through all states, and close to the segments between them.

Joints, and an omnidirectional base, follow cubic splines through the states, coordinate by coordinate, by
arc length in metres and radians alike: their curvature has no jumps. Of a base on wheels the way rolled and
the heading are such splines. The path is divided into runs, at whose ends the robot rests.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_banded

from regionik.timing.options import TIMING
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.drives import BaseDrive, unwrapped

OPTIONS = TIMING.corners

SAME = 1e-9  # states that differ by less are the same [m], [rad]
SLIP, SLIPPED = 1e-3, 1e-5  # that wheels may slip from state to state: as a share of the way, and besides [m]
STEERED = 1e-6  # angle of steering that a car need not stop for [rad]
MAX_REST_WAY = 1e-7  # of a way that a car rolls with its steering as it is, by rounding [m]
MIN_ROLLED_SHARE = 1e-6  # part of the path's way that a car hardly rolls
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True, eq=False)
class SmoothPath:
    """Smooth path through states."""

    drive: BaseDrive
    base: Array  # (n, 3) x, y [m], yaw [rad], unwrapped
    joints: Array  # (n, dof)

    @cached_property
    def lengths(self) -> Array:
        """Lengths of the segments in path position, (n - 1,); 0 for a state given twice."""
        far = np.linalg.norm(np.diff(self.coordinates, axis=0), axis=1)
        return np.where(far > SAME, far, 0.0)

    @cached_property
    def position(self) -> Array:
        """Path position of each state, (n,), not descending."""
        return np.concatenate([[0.0], np.cumsum(self.lengths)])

    @cached_property
    def runs(self) -> list[tuple[int, int]]:
        """First and last state of each run; the robot rests where a state is given twice."""
        edges = np.flatnonzero(np.diff(np.concatenate([[False], self.lengths > 0, [False]])))
        return [(a, b) for a, b in edges.reshape(-1, 2).tolist()]

    @property
    def rests(self) -> Mask:
        """States at which the robot rests, (n,)."""
        moving = np.concatenate([[False], self.lengths > 0, [False]])
        return ~(moving[:-1] & moving[1:])

    def corners(self, sharp: float = OPTIONS.rest_corner, gentle: float = OPTIONS.gentle_steering) -> Index:
        """States within runs where the robot must rest.

        At corners sharper than an angle [rad], and where a car has to stand to turn its steering: by more
        than is ``gentle`` [rad].
        """
        tangents = np.diff(self.coordinates, axis=0)
        tangents = tangents / np.maximum(np.linalg.norm(tangents, axis=1), SAME)[:, None]
        turned = (tangents[:-1] * tangents[1:]).sum(1) <= np.cos(sharp)
        within = (self.lengths[:-1] > 0) & (self.lengths[1:] > 0)
        return 1 + np.flatnonzero(within & (turned | self._stands_to_steer(gentle)))

    def _stands_to_steer(self, gentle: float) -> Mask:
        """States between two segments at which a car stands, as its steering is turned there, (n - 2,)."""
        return np.zeros(max(len(self.lengths) - 1, 0), dtype=np.bool_)

    @cached_property
    def coordinates(self) -> Array:
        """Coordinates that follow the cubics, (n, k): of the base, then the joints."""
        return np.concatenate([self.base, self.joints], axis=1)

    @cached_property
    def steering(self) -> Array:
        """Steering angle of a car on each segment, NaN where it does not roll, (n - 1,) [rad].

        That of a wheel one turning radius ahead of the axle: 45 degrees on the tightest arc.
        """
        return np.full(len(self.base) - 1, np.nan)

    def steering_rate(self, position: Array, segment: Index) -> Array:
        """How fast the steering angle changes by path position, (m,); 0 where a car does not roll."""
        return np.zeros(len(position))

    def states_at(self, segment: Index, share: Array) -> tuple[Array, Array]:
        """Base (m, 3) and joints (m, dof) of states to insert at shares of segments."""
        q, _, _ = self.evaluate(self.position[segment] + share * self.lengths[segment], segment)
        return q[:, :3], q[:, 3:]

    @cached_property
    def _cubics(self) -> Array:
        """Of the coordinates, (n - 1, 4, k)."""
        return self._through(self.coordinates)

    def _through(self, z: Array) -> Array:
        """Coefficients (n - 1, 4, k) of splines through values (n, k) at the states, constant first.

        At the ends of runs the path is straight.
        """
        moving = self.lengths > 0
        bend = knot_curvatures(self.lengths, z, moving, np.zeros((2, len(moving)), dtype=np.bool_))
        return spline_cubics(self.lengths, z, bend, moving)

    def evaluate(self, position: Array, segment: Index) -> tuple[Array, Array, Array]:
        """Base and joints q (m, 3 + dof) at path positions (m,) on segments (m,), with q_s and q_ss."""
        return cubic_values(self._cubics[segment], position - self.position[segment])[:3]


def cubic_values(cubics: Array, since: Array) -> tuple[Array, Array, Array, Array]:
    """Values of cubics (m, 4, k), constant first, at (m,), and their three derivatives, (m, k) each."""
    a, b, c, d = cubics.swapaxes(0, 1)
    t = since[:, None]
    return a + t * (b + t * (c + t * d)), b + t * (2 * c + 3 * t * d), 2 * c + 6 * t * d, 6 * d


def spline_cubics(h: Array, value: Array, bend: Array, moving: Mask) -> Array:
    """Coefficients (n - 1, 4, k) of splines, constant first, by values and second derivatives at knots."""
    h = np.where(moving, h, 1.0)[:, None]
    a, b = bend[:-1], bend[1:]
    slope = np.diff(value, axis=0) / h - h * (2 * a + b) / 6
    rest = [np.where(moving[:, None], one, 0.0) for one in (slope, a / 2, (b - a) / (6 * h))]
    return np.stack([value[:-1], *rest], axis=1)


def rolled_over(cubics: Array, since: Array) -> Array:
    """Way on the floor by cubics (m, 4, k) of way rolled and heading, from their start on, (m, 2) [m].

    By Gauss and Legendre's quadrature of the heading's cosine and sine.
    """
    nodes = since[:, None] * (_NODES + 1) / 2
    value, slope, *_ = cubic_values(np.repeat(cubics[..., :2], len(_NODES), axis=0), nodes.ravel())
    way = since[:, None] * _WEIGHTS / 2 * slope[:, 0].reshape(nodes.shape)
    yaw = value[:, 1].reshape(nodes.shape)
    return np.column_stack([(way * np.cos(yaw)).sum(1), (way * np.sin(yaw)).sum(1)])


def on_floor(place: Array, cubics: Array, slip: Array, since: Array) -> list[Array]:
    """Base and joints q, and their first three derivatives, (m, 3 + dof) each.

    By cubics of way rolled, heading and joints (m, 4, 2 + dof), which begin at a ``place`` (m, 2), and of
    what the base slips besides (m, 4, 2) [m].
    """
    values = value, slope, bend, jerk = cubic_values(cubics, since)
    slid, *slipping = cubic_values(slip, since)
    ahead, (v, w) = np.exp(1j * value[:, 1]), slope[:, :2].T
    last = jerk[:, 0] - v * w**2 + 1j * (2 * bend[:, 0] * w + v * bend[:, 1])
    along = [ahead * rate for rate in (v, bend[:, 0] + 1j * v * w, last)]
    flat = [place + rolled_over(cubics, since) + slid - slip[:, 0]]
    for row, slip_rate in zip(along, slipping, strict=True):
        flat.append(np.column_stack([row.real, row.imag]) + slip_rate)
    return [np.column_stack([xy, rest[:, 1:]]) for xy, rest in zip(flat, values, strict=True)]


def slips_far(left: Array, rolled: Array) -> Mask:
    """Whether wheels slip farther than they may by ways left (n, 2) beside ways rolled (n,), (n,)."""
    return np.hypot(*left.T) > SLIPPED + SLIP * np.abs(rolled)


def knot_curvatures(h: Array, value: Array, moving: Mask, halved: Mask) -> Array:
    """Second derivatives of cubic splines at states (n, k), zero where they rest.

    Parameters
    ----------
    h : (n - 1,) array
        Lengths of the segments, by whatever the splines are functions of.
    value : (n, k) array
        At the states.
    moving : (n - 1,) array of bool
        Segments that belong to a run; others separate runs.
    halved : (2, n - 1) array of bool
        First and last segments of runs that have a knot halfway, so that slopes at rest are zero too.
    """
    h, (first, last), inner = np.where(moving, h, 1.0), halved, moving[:-1] & moving[1:]
    secant = np.diff(value, axis=0) / h[:, None]
    banded = np.zeros((3, len(h) + 1))
    before, after = h[:-1] * np.where(first[:-1], 1, 2) / 6, h[1:] * np.where(last[1:], 1, 2) / 6
    banded[1] = 1.0
    banded[1, 1:-1] = np.where(inner, before + after, 1.0)
    banded[0, 2:] = np.where(inner & ~last[1:], h[1:] / 6, 0.0)
    banded[2, :-2] = np.where(inner & ~first[:-1], h[:-1] / 6, 0.0)
    right = np.zeros((len(h) + 1, secant.shape[1]))
    change = np.where(last, 2, 1)[1:, None] * secant[1:] - np.where(first, 2, 1)[:-1, None] * secant[:-1]
    right[1:-1] = np.where(inner[:, None], change, 0.0)
    return solve_banded((1, 1), banded, right)


@dataclass(frozen=True, eq=False)
class RollingPath(SmoothPath):
    """Smooth path of a robot on wheels: what its base rolls and its heading are smooth.

    It comes to all states with hardly any slip. A car turns its steering as it rolls, where that is little.
    """

    @cached_property
    def _rolled(self) -> Array:
        """Arc length of each segment, below 0 in reverse, (n - 1,) [m]."""
        return self.drive.rolled(self.base)

    @cached_property
    def coordinates(self) -> Array:
        """Way rolled, heading and joints, (n, 2 + dof)."""
        rolled = np.concatenate([[0.0], np.cumsum(self._rolled)])
        return np.column_stack([rolled, self.base[:, 2], self.joints])

    def _stands_to_steer(self, gentle: float) -> Mask:
        """See `SmoothPath`; between places where it stands a car steers as it rolls, or not at all.

        While it steers it rolls on all the way, for where it stops to roll, on a smooth path, its curvature
        would jump.
        """
        rolls = ~np.isnan(self.steering)
        last = np.maximum.accumulate(np.where(rolls, np.arange(len(rolls)), 0))
        steered, ahead = self.steering[last], np.where(rolls, np.sign(self._rolled), 0.0)
        change = np.abs(np.diff(steered))
        tight = np.abs(np.tan(steered))
        beyond = np.maximum(tight[:-1], tight[1:]) + np.abs(np.diff(np.tan(steered))) / 2  # of a cubic
        on = (ahead[:-1] * ahead[1:] > 0) & (change <= gentle) & (beyond <= 1)
        stands = (change > STEERED) & ~on
        part = np.cumsum(stands | (self.lengths[1:] == 0))
        steers = np.isin(part, part[(change > STEERED) & on])
        return stands | (steers & (ahead[:-1] != ahead[1:]))

    @cached_property
    def steering(self) -> Array:
        """See `SmoothPath.steering`."""
        rolled, turn = self._rolled, np.diff(self.base[:, 2])
        stands = (self.lengths == 0) | (np.abs(rolled) <= MAX_REST_WAY)
        angle = np.arctan(self.drive.turning_radius * turn / np.where(stands, 1.0, rolled))
        return np.where(stands, np.nan, angle)

    def steering_rate(self, position: Array, segment: Index) -> Array:
        """See `SmoothPath`."""
        radius, (_, rate, bend) = self.drive.turning_radius, super().evaluate(position, segment)
        (roll, turn), (gain, twist) = rate[:, :2].T, bend[:, :2].T
        square = roll**2 + (radius * turn) ** 2
        rolls = (square > MIN_ROLLED_SHARE**2) & ~np.isnan(self.steering[segment])
        return radius * np.abs(twist * roll - turn * gain) / np.where(rolls, square, np.inf)

    @cached_property
    def _left(self) -> Array:
        """What is left of the base's motion on each segment when all is rolled, (n - 1, 2) [m]."""
        return np.diff(self.base[:, :2], axis=0) - rolled_over(self._cubics, np.diff(self.position))

    @cached_property
    def _slip(self) -> Array:
        """Cubics of the place, besides what is rolled, (n - 1, 4, 2) [m]."""
        return self._through(np.concatenate([np.zeros((1, 2)), np.cumsum(self._left, axis=0)]))

    def evaluate(self, position: Array, segment: Index) -> tuple[Array, Array, Array]:
        """Return base and joints with derivatives, as `SmoothPath.evaluate` does."""
        since = position - self.position[segment]
        q, q_s, q_ss, _ = on_floor(self.base[segment, :2], self._cubics[segment], self._slip[segment], since)
        return q, q_s, q_ss


def smooth_path(drive: BaseDrive, base: Array, joints: Array) -> SmoothPath:
    """Return the path through states whose headings turn the shorter way from one to the next."""
    return (RollingPath if drive.rolls else SmoothPath)(drive, unwrapped(base), joints)
