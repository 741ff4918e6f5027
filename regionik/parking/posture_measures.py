"""Measures of a posture by which stops are chosen: higher is better."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from regionik.planners.solvers.serial_chain import chain_frames, chain_jacobian, serial_arm
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain


def ellipsoid_volume(chain: Chain, joints: Array) -> float:
    """Manipulability sqrt(det J J^T) (Yoshikawa 1985): volume of the velocity ellipsoid but for a factor."""
    J = _jacobian(chain, joints)
    return float(np.sqrt(max(np.linalg.det(J @ J.T), 0.0)))


def load_capacity(chain: Chain, joints: Array) -> float:
    """Negative of the largest joint torque for each newton of load at the tool [N m / N]."""
    return -float(np.abs(_jacobian(chain, joints)[2]).max())


def _jacobian(chain: Chain, joints: Array) -> Array:
    """Of the tool's velocity by the joints, (3, dof)."""
    arm = serial_arm(chain)
    frames, J = np.empty((chain.dof + 1, 4, 4)), np.empty((6, chain.dof))
    chain_frames(arm, joints, frames)
    chain_jacobian(arm, frames, J)
    return J[:3]


POSTURE_MEASURES: dict[str, Callable[[Chain, Array], float]] = {
    "manipulability": ellipsoid_volume,
    "effort": load_capacity,
}
