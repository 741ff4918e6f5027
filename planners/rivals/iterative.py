"""Iterative rivals of FABRIK: pseudo-inverse, transpose, damped least squares, CCD.

Each may start again from the postures that FABRIK may start again from. None knows of obstacles or areas.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.rivals.descent import (
    CYCLIC,
    DAMPED,
    PSEUDO_INVERSE,
    TRANSPOSE,
    DescentEffort,
    search,
    search_each,
)
from regionik.planners.rivals.method import RESTARTS, ArmMethod, Found, reach_of
from regionik.planners.solvers.damped_least_squares import Aim
from regionik.planners.solvers.inverse_kinematics import ArmPostures, rows_of, spread_postures
from regionik.planners.solvers.serial_chain import serial_arm
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain

MOST_STEPS = 300  # from each start


class Rival(ArmMethod):
    """An iterative method with restarts; its kernel is what differs.

    Parameters
    ----------
    chain : Chain
    tolerance, angle_tolerance : float
        [m], [rad]
    most : int
        Steps from each start.
    restarts : int
        Other postures to start from.
    """

    which: ClassVar[int]

    def __init__(
        self,
        chain: Chain,
        tolerance: float = 1e-3,
        angle_tolerance: float = 1e-3,
        most: int = MOST_STEPS,
        restarts: int = RESTARTS,
    ) -> None:
        super().__init__(chain, tolerance, angle_tolerance)
        self._arm, reach = serial_arm(chain), reach_of(chain)
        self._effort = DescentEffort(self.tolerance, self.angle_tolerance, int(most), reach)
        self._starts = spread_postures(chain, reach, restarts, 0)

    def search(self, aim: Aim, joints: Array) -> Found:
        """The kernel from the joints, then from the starts, until the aim is met; else the nearest end."""
        q = np.array(joints)
        tried = search(self.which, self._arm, aim, self._starts, self._effort, q)
        return Found(q, float(tried.error), float(tried.angle), int(tried.steps), int(tried.restarts))

    def batch(self, positions: ArrayLike, joints: ArrayLike) -> ArmPostures:
        """Solve many positions (m, 3) from start postures (m, dof), or all from one (dof,), in one call."""
        p, q = rows_of(self.chain, positions, joints)
        errors, counts = np.empty(len(p)), np.empty((len(p), 2), dtype=np.int64)
        search_each(self.which, self._arm, p, self._starts, self._effort, q, errors, counts)
        polished = np.zeros(len(p), dtype=bool)
        return ArmPostures(q, errors, counts[:, 0], counts[:, 1], polished, errors <= self.tolerance)


class PseudoInverse(Rival):
    """Jacobian pseudo-inverse."""

    name, which = "pinv", PSEUDO_INVERSE


class DampedLeastSquares(Rival):
    """Levenberg's and Marquardt's damped least squares, the kernel that polishes our own answers."""

    name, which = "dls", DAMPED


class Transpose(Rival):
    """Jacobian transpose."""

    name, which = "transpose", TRANSPOSE


class CyclicDescent(Rival):
    """Cyclic coordinate descent."""

    name, which = "ccd", CYCLIC
