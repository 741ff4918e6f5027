"""Smooth path of a timed motion: through all states, and close to the segments between them.

Joints, and an omnidirectional base, follow a monotone piecewise cubic through the states, coordinate by
coordinate (Fritsch and Butland). A base on wheels keeps to its arcs and lines. The path is divided into runs,
at whose ends the robot rests.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from regionik.worlds.arrays import Array
from regionik.worlds.drives import BaseDrive

SAME = 1e-9  # states that differ by less are the same [m], [rad]
CORNER = np.radians(30)  # at sharper corners the robot stops, others are rounded
STANDING = 1e-3  # share of the joints' motion below which a base on wheels counts as standing


@dataclass(frozen=True, eq=False)
class SmoothPath:
    """Smooth path through states.

    Attributes
    ----------
    drive : BaseDrive
    base : (n, 3) array
        x, y [m], yaw [rad], unwrapped.
    joints : (n, dof) array
    """

    drive: BaseDrive
    base: Array
    joints: Array

    @cached_property
    def _changes(self) -> tuple[Array, Array, Array]:
        """Arc length rolled [m], turn [rad] and largest joint motion on each segment, (n - 1,) each."""
        swing = np.abs(np.diff(self.joints, axis=0)).max(1, initial=0.0)
        return self.drive.rolled(self.base), np.diff(self.base[:, 2]), swing

    @cached_property
    def _wheel_mode(self) -> NDArray[np.int64]:
        """Mode of a base on wheels on each segment: 1, -1 rolls, 2, -2 turns on the spot, 0 stands."""
        return np.zeros(len(self.base) - 1, dtype=np.int64)

    @cached_property
    def lengths(self) -> Array:
        """Lengths of the segments in path position, (n - 1,); 0 for a state given twice."""
        far = self._largest_change
        return np.where(far > SAME, far, 0.0)

    @property
    def _largest_change(self) -> Array:
        """Change of what moves most on each segment, (n - 1,)."""
        _, turn, swing = self._changes
        slid = np.hypot(*np.diff(self.base[:, :2], axis=0).T)
        far: Array = np.maximum(np.maximum(slid, np.abs(turn)), swing)
        return far

    @cached_property
    def position(self) -> Array:
        """Path position of each state, (n,), not descending."""
        return np.concatenate([[0.0], np.cumsum(self.lengths)])

    @cached_property
    def runs(self) -> list[tuple[int, int]]:
        """First and last state of each run; the robot rests where a state is given twice."""
        going = np.concatenate([[False], self.lengths > 0, [False]]).astype(int)
        starts, ends = np.flatnonzero(np.diff(going) == 1), np.flatnonzero(np.diff(going) == -1)
        return list(zip(starts.tolist(), ends.tolist(), strict=True))

    @cached_property
    def corners(self) -> NDArray[np.int64]:
        """States within runs where the robot must rest: sharp corners, and changes of the wheel mode."""
        tangents = np.concatenate([self._base_changes, np.diff(self.joints, axis=0)], axis=1)
        tangents = tangents / np.maximum(np.linalg.norm(tangents, axis=1), SAME)[:, None]
        turned = (tangents[:-1] * tangents[1:]).sum(1) <= np.cos(CORNER)
        changed = (np.diff(self._wheel_mode) != 0) | turned
        return 1 + np.flatnonzero(changed & (self.lengths[:-1] > 0) & (self.lengths[1:] > 0))

    @property
    def _base_changes(self) -> Array:
        """Changes of the base on each segment that count for corners, (n - 1, k)."""
        changes: Array = np.diff(self.base, axis=0)
        return changes

    @cached_property
    def _cubics(self) -> tuple[Array, Array, Array, Array]:
        """Coefficients of base and joints on each segment, constant first, (n - 1, 3 + dof) each.

        Slopes at states are weighted harmonic means of those of the two segments, and 0 where these have
        opposite signs, so that nothing goes beyond its states (Fritsch and Butland, SIAM J. Sci. Stat.
        Comput. 1984).
        """
        z = np.concatenate([self.base, self.joints], axis=1)
        far = np.where(self.lengths > 0, self.lengths, np.inf)[:, None]
        secant, width = np.diff(z, axis=0) / far, np.where(self.lengths > 0, self.lengths, 0.0)[:, None]
        before, after = secant[:-1], secant[1:]
        w, v = 2 * width[1:] + width[:-1], width[1:] + 2 * width[:-1]
        same = before * after > 0
        reciprocals = w / np.where(same, before, 1.0) + v / np.where(same, after, 1.0)
        mean = (w + v) / np.where(same, reciprocals, np.inf)
        mean = np.where(width[:-1] == 0, after, np.where(width[1:] == 0, before, mean))  # at rest
        slope = np.concatenate([secant[:1], mean, secant[-1:]])
        start, end = slope[:-1], slope[1:]
        return z[:-1], start, (3 * secant - 2 * start - end) / far, (start + end - 2 * secant) / far**2

    def evaluate(self, position: Array, segment: NDArray[np.int64]) -> tuple[Array, Array, Array]:
        """Base and joints q (m, 3 + dof) at path positions (m,) on segments (m,), with q_s and q_ss."""
        t = (position - self.position[segment])[:, None]
        a, b, c, d = (power[segment] for power in self._cubics)
        return a + t * (b + t * (c + t * d)), b + t * (2 * c + 3 * t * d), 2 * c + 6 * t * d


@dataclass(frozen=True, eq=False)
class RollingPath(SmoothPath):
    """Smooth path of a robot on wheels, whose base keeps to its arcs and lines."""

    @cached_property
    def _wheel_mode(self) -> NDArray[np.int64]:
        rolled, turn, swing = self._changes
        slow = STANDING * swing + SAME
        turning = np.where(np.abs(turn) > slow, 2 * np.sign(turn), 0.0)
        return np.where(np.abs(rolled) > slow, np.sign(rolled), turning).astype(np.int64)

    @property
    def _largest_change(self) -> Array:
        """Motion of the wheels, or of the joints where these stand."""
        rolled, turn, swing = (np.abs(change) for change in self._changes)
        change: Array = np.choose(np.abs(self._wheel_mode), [swing, rolled, turn])
        return change

    @property
    def _base_changes(self) -> Array:
        """Roll and turn on the spot: where the base rolls on along another arc there is no corner."""
        rolled, turn, _ = self._changes
        return np.column_stack([rolled, np.where(np.abs(self._wheel_mode) == 1, 0.0, turn)])

    def evaluate(self, position: Array, segment: NDArray[np.int64]) -> tuple[Array, Array, Array]:
        """Return base and joints with derivatives, as `SmoothPath.evaluate` does."""
        q, q_s, q_ss = super().evaluate(position, segment)
        q[:, :3], q_s[:, :3], q_ss[:, :3] = self._evaluate_base(position, segment)
        return q, q_s, q_ss

    def _evaluate_base(self, position: Array, segment: NDArray[np.int64]) -> tuple[Array, Array, Array]:
        """Base poses on arcs and lines, with their derivatives."""
        length = np.where(self.lengths > 0, self.lengths, np.inf)[segment]
        rolled, turn = (change[segment] / length for change in self._changes[:2])
        share = np.clip((position - self.position[segment]) / length, 0.0, 1.0)
        base = self.drive.between(self.base[segment], self.base[segment + 1], share)
        c, s, zero = np.cos(base[:, 2]), np.sin(base[:, 2]), np.zeros(len(base))
        centripetal = rolled * turn
        return (
            base,
            np.column_stack([rolled * c, rolled * s, turn]),
            np.column_stack([-centripetal * s, centripetal * c, zero]),
        )


def smooth_path(drive: BaseDrive, base: Array, joints: Array) -> SmoothPath:
    """Return the path through states whose headings turn the shorter way from one to the next."""
    turn = np.diff(base[:, 2])
    turn -= 2 * np.pi * np.ceil((turn - np.pi) / (2 * np.pi))
    yaw = base[0, 2] + np.concatenate([[0.0], np.cumsum(turn)])
    kind = RollingPath if drive.rolls else SmoothPath
    return kind(drive, np.column_stack([base[:, :2], yaw]), joints)
