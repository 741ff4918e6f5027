"""Scores of postures by which stops are chosen: higher is better."""

from __future__ import annotations

import numpy as np

from regionik.planners.solvers.serial_chain import chain_frames, chain_jacobian, serial_arm
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain


def posture_score(chain: Chain, joints: Array, criterion: str) -> float:
    """Score of a posture: its manipulability, or minus its largest joint torque by load [N m / N].

    Manipulability is sqrt(det J J^T) (Yoshikawa 1985), the load one newton at the tool.
    """
    arm, frames, J = serial_arm(chain), np.empty((len(chain.joints) + 1, 4, 4)), np.empty((6, chain.dof))
    chain_frames(arm, joints, frames)
    chain_jacobian(arm, frames, J)
    if criterion == "effort":
        return -float(np.abs(J[2]).max())
    return float(np.sqrt(max(np.linalg.det(J[:3] @ J[:3].T), 0.0)))
