"""Interface of the methods of inverse kinematics that are compared, and FABRIK-R as one of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np

from regionik.papers.options import PAPERS
from regionik.planners.solvers.damped_least_squares import Aim
from regionik.planners.solvers.multistart_ik import ArmSolver
from regionik.planners.solvers.rigid_bodies import span
from regionik.planners.solvers.serial_chain import serial_arm
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError

OPTIONS = PAPERS.comparison


class SearchResult(NamedTuple):
    """The end of a search: joints (dof,), misses [m] and [rad], iterations and restarts."""

    joints: Array
    error: float
    angle: float
    iterations: int
    restarts: int


class ArmMethod(ABC):
    """An inverse kinematics method for a chain, to a tolerance [m] and an angle tolerance [rad]."""

    name: ClassVar[str]  # in ``regionik compare --methods``

    def __init__(self, chain: Chain, tolerance: float, angle_tolerance: float) -> None:
        for label, value in (("tolerance", tolerance), ("angle_tolerance", angle_tolerance)):
            if not 0.0 < value < np.inf:
                raise InputError(f"{label}: expected a number above 0, got {value}")
        self.chain, self.tolerance, self.angle_tolerance = chain, float(tolerance), float(angle_tolerance)

    @abstractmethod
    def search(self, aim: Aim, joints: Array) -> SearchResult:
        """Bring the tool to an aim from joints (dof,) within the limits; ``joints`` is not changed."""


class Fabrik(ArmMethod):
    """FABRIK-R by passes and restarts alone."""

    name = "fabrik"
    polishing: ClassVar[bool] = False

    def __init__(
        self,
        chain: Chain,
        tolerance: float = 1e-3,
        angle_tolerance: float = 1e-3,
        max_iterations: int = 300,
        restarts: int = OPTIONS.restarts,
    ) -> None:
        super().__init__(chain, tolerance, angle_tolerance)
        self._solver = ArmSolver(chain, tolerance, angle_tolerance, max_iterations, restarts, self.polishing)

    def search(self, aim: Aim, joints: Array) -> SearchResult:
        """Run passes from the joints, then from the starts, until the aim is met."""
        q = np.array(joints)
        error, angle, passes, restarts, _ = self._solver.solve(aim, q)
        return SearchResult(q, float(error), float(angle), int(passes), int(restarts))


class FabrikPolished(Fabrik):
    """FABRIK-R polished by damped least squares, as in `regionik.planners.solvers.multistart_ik`."""

    name = "fabrik+dls"
    polishing = True


def position_error(chain: Chain, aim: Aim, joints: Array) -> float:
    """Distance of the tool from the aim's position, by forward kinematics [m]."""
    return float(np.linalg.norm(chain.forward(joints)[:3, 3] - aim.position))


def arm_length(chain: Chain) -> float:
    """Length of the outstretched arm [m]."""
    return span(serial_arm(chain))
