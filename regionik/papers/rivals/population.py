"""What methods that breed postures share: where these are drawn, and how far they miss."""

from __future__ import annotations

import numpy as np

from regionik.papers.rivals.method import ArmMethod, SearchResult, arm_length, position_error
from regionik.planners.solvers.damped_least_squares import DIRECTION, POSITION, Aim
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain


class PopulationMethod(ArmMethod):
    """A population of postures within the joint limits, bred until the aim is met.

    Prismatic joints without limits are drawn within the distance of the target and an arm's length of their
    start. The start is one of the first population.

    Parameters
    ----------
    tolerance, angle_tolerance : float [m], [rad]
    seed : int
        Same seed, same answer.
    """

    def __init__(
        self, chain: Chain, tolerance: float = 1e-3, angle_tolerance: float = 1e-3, seed: int = 0
    ) -> None:
        super().__init__(chain, tolerance, angle_tolerance)
        self._seed, self._reach = seed, arm_length(chain)

    def result(self, aim: Aim, genes: Array, generations: int) -> SearchResult:
        """A posture as an answer, its joints within their limits; a generation counts as an iteration."""
        q = np.clip(genes.astype(np.float64), self.chain.lower, self.chain.upper)
        angle = float(_angles(aim, self.chain.forward(q)[None])[0])
        return SearchResult(q, position_error(self.chain, aim, q), angle, generations, 0)

    def bounds(self, aim: Aim, joints: Array) -> tuple[Array, Array]:
        turns = np.array([joint.kind == "revolute" for joint in self.chain.joints])
        span = np.where(turns, np.pi, position_error(self.chain, aim, joints) + self._reach)
        return np.maximum(self.chain.lower, joints - span), np.minimum(self.chain.upper, joints + span)

    def misses(self, aim: Aim, postures: Array) -> Array:
        """Misses of postures (m, dof) [m]; an angle counts as a length of the same share of its tolerance."""
        tools = self.chain.forward(postures)
        off: Array = np.linalg.norm(tools[:, :3, 3] - aim.position, axis=1)
        if aim.kind == POSITION:
            return off
        share = self.tolerance / self.angle_tolerance
        missed: Array = np.maximum(off, share * _angles(aim, tools))
        return missed


def _angles(aim: Aim, tools: Array) -> Array:
    """Angles (m,) of tools (m, 4, 4) beyond the aim's cone [rad]."""
    if aim.kind == POSITION:
        return np.zeros(len(tools))
    if aim.kind == DIRECTION:
        cosines = tools[:, :3, 2] @ aim.turn[:, 2]
    else:
        cosines = (np.einsum("mij,ij->m", tools[:, :3, :3], aim.turn) - 1.0) / 2.0
    angles: Array = np.maximum(0.0, np.arccos(np.clip(cosines, -1.0, 1.0)) - aim.cone)
    return angles
