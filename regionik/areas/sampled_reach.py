"""Postures drawn all over the range of an arm, by where they bring the tool, seen from the base.

They say where a search should begin, and what is found there is proven by others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regionik.areas.options import AREAS
from regionik.worlds.arrays import Array
from regionik.worlds.prepared import made_once
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import postures_clear


@dataclass(frozen=True, eq=False)
class SampledReach:
    """Postures within limits, and where they bring the tool."""

    tools: Array  # (n, 3) positions of the tool, seen from the base [m]
    joints: Array  # (n, dof)

    def postures(self, base: Array, position: Array, count: int) -> Array:
        """Postures (count, dof) that bring the tool nearest to a position (3,) from a base pose (3,)."""
        off = self.tools - _seen_from(base, position)
        near = np.argpartition(np.einsum("ij,ij->i", off, off), count)[:count]
        return self.joints[np.sort(near)]


def _seen_from(base: Array, position: Array) -> Array:
    """A position (3,) in the frame of a base pose (3,), (3,)."""
    c, s = np.cos(base[2]), np.sin(base[2])
    dx, dy = position[:2] - base[:2]
    return np.array([c * dx + s * dy, c * dy - s * dx, position[2]])


@made_once
def sampled_reach(robot: Robot) -> SampledReach:
    """Return postures of a robot's arm, clear of the robot itself where they often are."""
    from scipy.stats import qmc  # takes long to load

    chain = robot.chain
    endless = np.isinf(chain.upper - chain.lower)
    low, high = np.where(endless, -np.pi, chain.lower), np.where(endless, np.pi, chain.upper)
    unit = qmc.Sobol(chain.dof, scramble=True, rng=np.random.default_rng(0)).random_base2(AREAS.log2_samples)
    joints = low + unit * (high - low)
    clear = postures_clear(robot, joints, 0.0)
    joints = joints[clear] if np.count_nonzero(clear) >= AREAS.min_clear_postures else joints
    return SampledReach(robot.tool(np.zeros((len(joints), 3)), joints)[:, :3, 3], joints)
