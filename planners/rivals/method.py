"""What all methods of inverse kinematics have in common: an aim and a start in, a posture out.

FABRIK-R stands here; ``iterative``, ``genetic``, ``network`` and ``planar3r`` beside it hold its rivals.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.solvers.damped_least_squares import POSITION, Aim
from regionik.planners.solvers.inverse_kinematics import ArmPosture, Goal, aim_of, confirm, spread_postures
from regionik.planners.solvers.multistart_ik import Effort, solve
from regionik.planners.solvers.rigid_bodies import pointing_bodies, posing_bodies, span
from regionik.planners.solvers.serial_chain import serial_arm
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError

RESTARTS = 10  # other postures to start from, the same for all methods that start again


class Found(NamedTuple):
    """What a method came to: joints (dof,), misses [m] and [rad], iterations and restarts."""

    joints: Array
    error: float
    angle: float
    iterations: int
    restarts: int


class ArmMethod(ABC):
    """A way to solve a chain.

    Attributes
    ----------
    name : str
        By which it is asked for.
    chain : Chain
    tolerance, angle_tolerance : float
        [m], [rad]
    """

    name: ClassVar[str]

    def __init__(self, chain: Chain, tolerance: float, angle_tolerance: float) -> None:
        for label, value in (("tolerance", tolerance), ("angle_tolerance", angle_tolerance)):
            if not 0.0 < value < np.inf:
                raise InputError(f"{label}: expected a number above 0, got {value}")
        self.chain, self.tolerance, self.angle_tolerance = chain, float(tolerance), float(angle_tolerance)

    @abstractmethod
    def search(self, aim: Aim, joints: Array) -> Found:
        """Bring the tool to an aim from joints (dof,) within the limits, which stay as they are."""

    def __call__(self, goal: Goal, joints: ArrayLike) -> ArmPosture:
        """Solve one goal from a start posture, which is taken into the limits first.

        Raises
        ------
        InputError
            For joints that do not fit, and for goals that the method cannot take.
        """
        start = np.clip(frozen(joints, (self.chain.dof,), "joints"), self.chain.lower, self.chain.upper)
        aim = aim_of(goal)
        found = self.search(aim, start)
        error, angle = confirm(self.chain, aim, found.joints)
        converged = error <= self.tolerance and angle <= self.angle_tolerance
        reason = "" if converged else f"{self.name} ended {error:.4g} m and {angle:.4g} rad off"
        joints = frozen(found.joints, (self.chain.dof,), "joints")
        return ArmPosture(
            joints, error, angle, found.iterations, found.restarts, (self.name,), converged, reason
        )


class Fabrik(ArmMethod):
    """FABRIK-R by passes and restarts alone; nothing else finishes what they do not."""

    name = "fabrik"
    polishing: ClassVar[bool] = False

    def __init__(
        self,
        chain: Chain,
        tolerance: float = 1e-3,
        angle_tolerance: float = 1e-3,
        most: int = 300,
        restarts: int = RESTARTS,
    ) -> None:
        super().__init__(chain, tolerance, angle_tolerance)
        self._pointing, self._posing = pointing_bodies(chain), posing_bodies(chain)
        reach = span(self._posing.arm)
        self._effort = Effort(self.tolerance, self.angle_tolerance, int(most), reach, self.polishing)
        self._starts = spread_postures(chain, reach, restarts, 0)

    def search(self, aim: Aim, joints: Array) -> Found:
        """Passes from the joints, then from the starts, until the aim is met."""
        bodies = self._pointing if aim.kind == POSITION else self._posing
        q, starts = np.array(joints), np.ascontiguousarray(self._starts[:, : len(bodies.slide)])
        error, angle, passes, restarts, _ = solve(bodies, aim, starts, self._effort, q)
        return Found(q, float(error), float(angle), int(passes), int(restarts))


class FabrikPolished(Fabrik):
    """FABRIK-R whose ends are polished by damped least squares, as in `inverse_kinematics`."""

    name = "fabrik+dls"
    polishing = True


def spatial_error(chain: Chain, aim: Aim, joints: Array) -> float:
    """Distance of the tool from the aim's position, by the chain's own forward kinematics [m]."""
    return float(np.linalg.norm(chain.forward(joints)[:3, 3] - aim.position))


def reach_of(chain: Chain) -> float:
    """Length of the arm laid straight [m]."""
    return span(serial_arm(chain))
