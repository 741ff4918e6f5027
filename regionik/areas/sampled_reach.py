"""Reach of an arm on a base that keeps its heading: where the tool comes, seen from the base.

Sampled, not proven: it says where a search should look, and what is found there is proven by others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from regionik.worlds.arrays import Array, Index
from regionik.worlds.prepared import made_once
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import postures_clear

MIN_CELL = 0.03  # least width of a cell [m]
LOG2_SAMPLES = 14  # postures drawn, as a power of two
POSTURES_PER_CELL = 4  # postures to a cell, if they were spread evenly
MIN_CLEAR_POSTURES = 100  # postures clear of the robot itself, of fewer nothing is learnt

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class SampledReach:
    """Cells of space, seen from the base, to which some posture within limits brings the tool."""

    cell: float  # width of a cell [m]
    corner: Index  # (3,) cell with the index 0, 0, 0
    occupied: Mask  # (nx, ny, nz)
    tools: Array  # (n, 3) positions of the tool in the postures drawn [m]
    joints: Array  # (n, dof)

    def holds(self, base: Array, position: Array) -> Mask:
        """Mask of the base poses (n, 3) from which the tool comes to a position (3,) [m]."""
        cell = np.floor(_seen_from(base, position) / self.cell).astype(np.intp) - self.corner
        inside = ((cell >= 0) & (cell < self.occupied.shape)).all(axis=1)
        held = np.zeros(len(base), dtype=bool)
        held[inside] = self.occupied[tuple(cell[inside].T)]
        return held

    def postures(self, base: Array, position: Array, count: int) -> Array:
        """Postures (count, dof) that bring the tool nearest to a position (3,) from a base pose (3,)."""
        off = self.tools - _seen_from(base[None], position)
        near = np.argpartition(np.einsum("ij,ij->i", off, off), count)[:count]
        return self.joints[np.sort(near)]


def _seen_from(base: Array, position: Array) -> Array:
    """A position (3,) in the frames of base poses (n, 3), (n, 3)."""
    c, s = np.cos(base[:, 2]), np.sin(base[:, 2])
    dx, dy = (position[:2] - base[:, :2]).T
    return np.column_stack([c * dx + s * dy, c * dy - s * dx, np.full(len(base), position[2])])


@made_once
def sampled_reach(robot: Robot) -> SampledReach:
    """Return where a robot's tool comes while its base stands, the arm clear of itself where it often is."""
    from scipy.stats import qmc  # takes long to load

    chain = robot.chain
    endless = np.isinf(chain.upper - chain.lower)
    low, high = np.where(endless, -np.pi, chain.lower), np.where(endless, np.pi, chain.upper)
    unit = qmc.Sobol(chain.dof, scramble=True, rng=np.random.default_rng(0)).random_base2(LOG2_SAMPLES)
    joints = low + unit * (high - low)
    clear = postures_clear(robot, joints, 0.0)
    joints = joints[clear] if np.count_nonzero(clear) >= MIN_CLEAR_POSTURES else joints
    tools = robot.tool(np.zeros((len(joints), 3)), joints)[:, :3, 3]
    width = float(max(MIN_CELL, (np.ptp(tools, axis=0).prod() * POSTURES_PER_CELL / len(joints)) ** (1 / 3)))
    cells = np.floor(tools / width).astype(np.intp)
    corner = cells.min(axis=0) - 1
    taken = np.zeros(cells.max(axis=0) - corner + 2, dtype=bool)
    taken[tuple((cells - corner).T)] = True
    return SampledReach(width, corner, ndimage.binary_closing(taken), tools, joints)
