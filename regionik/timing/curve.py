"""The smooth path of a timed motion: through all states, and next to the straight hops between them.

Joints, and an omnidirectional base, follow a piecewise cubic through the states that goes no further than
these, coordinate by coordinate (Fritsch and Butland). A base on wheels keeps to its arcs and lines. The path
is parted into runs, at whose ends the robot rests.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from regionik.worlds.arrays import Array
from regionik.worlds.drives import BaseDrive

SAME = 1e-9  # states that differ by less are one [m], [rad]
CORNER = np.radians(30)  # sharper ones are stopped at, others are rounded
CRAWL = 1e-3  # of the joints' way, below which a base on wheels counts as standing


@dataclass(frozen=True, eq=False)
class Curve:
    """A path through states.

    Attributes
    ----------
    drive : BaseDrive
    base : (n, 3) array
        x, y [m], yaw [rad], running on.
    joints : (n, dof) array
    """

    drive: BaseDrive
    base: Array
    joints: Array

    @cached_property
    def _ways(self) -> tuple[Array, Array, Array]:
        """Over each hop: way rolled [m], angle turned [rad], the most that a joint moves; (n - 1,) each."""
        bend = np.abs(np.diff(self.joints, axis=0)).max(1, initial=0.0)
        return self.drive.rolled(self.base), np.diff(self.base[:, 2]), bend

    @cached_property
    def _gait(self) -> NDArray[np.int64]:
        """What a base on wheels does over each hop: 1, -1 rolls, 2, -2 turns on the spot, 0 stands."""
        return np.zeros(len(self.base) - 1, dtype=np.int64)

    @cached_property
    def hops(self) -> Array:
        """How far each hop goes along the path, (n - 1,)."""
        far = self._far
        return np.where(far > SAME, far, 0.0)

    @property
    def _far(self) -> Array:
        """How far each hop goes, as what moves most, (n - 1,)."""
        _, turn, bend = self._ways
        slid = np.hypot(*np.diff(self.base[:, :2], axis=0).T)
        far: Array = np.maximum(np.maximum(slid, np.abs(turn)), bend)
        return far

    @cached_property
    def position(self) -> Array:
        """Path position of each state, (n,), not descending."""
        return np.concatenate([[0.0], np.cumsum(self.hops)])

    @cached_property
    def runs(self) -> list[tuple[int, int]]:
        """First and last state of each run: the robot rests where a state is given twice."""
        going = np.concatenate([[False], self.hops > 0, [False]]).astype(int)
        starts, ends = np.flatnonzero(np.diff(going) == 1), np.flatnonzero(np.diff(going) == -1)
        return list(zip(starts.tolist(), ends.tolist(), strict=True))

    @cached_property
    def corners(self) -> NDArray[np.int64]:
        """States within runs where the robot must rest: sharp corners, and changes of a base's gait."""
        ways = np.concatenate([self._base_ways, np.diff(self.joints, axis=0)], axis=1)
        ways = ways / np.maximum(np.linalg.norm(ways, axis=1), SAME)[:, None]
        turned = (ways[:-1] * ways[1:]).sum(1) <= np.cos(CORNER)
        changed = (np.diff(self._gait) != 0) | turned
        return 1 + np.flatnonzero(changed & (self.hops[:-1] > 0) & (self.hops[1:] > 0))

    @property
    def _base_ways(self) -> Array:
        """What the base does over each hop, (n - 1, k), told apart where the path has a corner."""
        ways: Array = np.diff(self.base, axis=0)
        return ways

    @cached_property
    def _cubics(self) -> tuple[Array, Array, Array, Array]:
        """Coefficients of base and joints over each hop by rising power of the way, (n - 1, 3 + dof) each.

        Slopes at states are harmonic means of those of the hops beside, and 0 where these run against each
        other, so that nothing goes beyond its states (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 1984).
        """
        z = np.concatenate([self.base, self.joints], axis=1)
        far = np.where(self.hops > 0, self.hops, np.inf)[:, None]
        secant, width = np.diff(z, axis=0) / far, np.where(self.hops > 0, self.hops, 0.0)[:, None]
        before, after = secant[:-1], secant[1:]
        w, v = 2 * width[1:] + width[:-1], width[1:] + 2 * width[:-1]
        same = before * after > 0
        mean = (w + v) / np.where(
            same, w / np.where(same, before, 1.0) + v / np.where(same, after, 1.0), np.inf
        )
        mean = np.where(width[:-1] == 0, after, np.where(width[1:] == 0, before, mean))  # at rest
        slope = np.concatenate([secant[:1], mean, secant[-1:]])
        start, end = slope[:-1], slope[1:]
        return z[:-1], start, (3 * secant - 2 * start - end) / far, (start + end - 2 * secant) / far**2

    def hop_at(self, position: Array) -> NDArray[np.int64]:
        """Which hop path positions (m,) are on; where one ends, the next."""
        hop = np.searchsorted(self.position, position, side="right") - 1
        return np.clip(hop, 0, len(self.hops) - 1)

    def along(self, position: Array, hop: NDArray[np.int64]) -> tuple[Array, Array, Array]:
        """Base and joints at path positions (m,) on hops (m,), (m, 3 + dof), and their two derivatives."""
        t = (position - self.position[hop])[:, None]
        a, b, c, d = (power[hop] for power in self._cubics)
        return a + t * (b + t * (c + t * d)), b + t * (2 * c + 3 * t * d), 2 * c + 6 * t * d


@dataclass(frozen=True, eq=False)
class RollingCurve(Curve):
    """A path through states of a base on wheels, which keeps to its arcs and lines."""

    @cached_property
    def _gait(self) -> NDArray[np.int64]:
        rolled, turn, bend = self._ways
        slow = CRAWL * bend + SAME
        turning = np.where(np.abs(turn) > slow, 2 * np.sign(turn), 0.0)
        return np.where(np.abs(rolled) > slow, np.sign(rolled), turning).astype(np.int64)

    @property
    def _far(self) -> Array:
        """As the wheels roll."""
        rolled, turn, bend = (np.abs(way) for way in self._ways)
        far: Array = np.choose(np.abs(self._gait), [bend, rolled, turn])
        return far

    @property
    def _base_ways(self) -> Array:
        """Where it rolls it may roll on along another arc."""
        rolled, turn, _ = self._ways
        return np.column_stack([rolled, np.where(np.abs(self._gait) == 1, 0.0, turn)])

    def along(self, position: Array, hop: NDArray[np.int64]) -> tuple[Array, Array, Array]:
        """See `Curve`."""
        z, slope, bend = super().along(position, hop)
        z[:, :3], slope[:, :3], bend[:, :3] = self._rolling(position, hop)
        return z, slope, bend

    def _rolling(self, position: Array, hop: NDArray[np.int64]) -> tuple[Array, Array, Array]:
        """Base poses on arcs and lines, with their derivatives."""
        far = np.where(self.hops > 0, self.hops, np.inf)[hop]
        rolled, turn = (way[hop] / far for way in self._ways[:2])
        share = np.clip((position - self.position[hop]) / far, 0.0, 1.0)
        base = self.drive.between(self.base[hop], self.base[hop + 1], share)
        c, s, none = np.cos(base[:, 2]), np.sin(base[:, 2]), np.zeros(len(base))
        swing = rolled * turn
        return (
            base,
            np.column_stack([rolled * c, rolled * s, turn]),
            np.column_stack([-swing * s, swing * c, none]),
        )


def running_on(drive: BaseDrive, base: Array, joints: Array) -> Curve:
    """The curve through states whose headings are taken the shorter way from one to the next."""
    turn = np.diff(base[:, 2])
    turn -= 2 * np.pi * np.ceil((turn - np.pi) / (2 * np.pi))
    yaw = base[0, 2] + np.concatenate([[0.0], np.cumsum(turn)])
    curve = RollingCurve if drive.rolls else Curve
    return curve(drive, np.column_stack([base[:, :2], yaw]), joints)
