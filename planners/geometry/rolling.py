"""Poses of a base on wheels moved that it rolls from one to the next without slip."""

from __future__ import annotations

import numpy as np
from scipy.sparse import block_array, csc_array, csr_array, diags_array, eye_array, kron
from scipy.sparse.linalg import splu

from regionik.planners.geometry.options import GEOMETRY
from regionik.worlds.arrays import Array, Mask
from regionik.worlds.drives import BaseDrive

EXACT = 1e-14  # slip that is rounding [m]
DAMPING = 1e-9  # where the base turns on the spot, hops depend on one another


def without_slip(drive: BaseDrive, base: Array, free: Mask) -> Array:
    """Return poses (n, 3) between which the drive rolls along arcs; a base that goes every way keeps them.

    Only those that are ``free`` (n,) are moved, together, by what bends their way the least: each by itself
    would turn to and fro. A hop between two that are not slips as it did.
    """
    moved = np.repeat(free, 3)
    rolls = (free[:-1] | free[1:])[: len(drive.slip(base)[0])]
    if not rolls.any():
        return base
    n = len(base)
    bend = diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(max(n - 2, 0), n))
    cost = bend.T @ bend + GEOMETRY.rolling_length_cost * eye_array(n)
    form = csr_array(kron(cost, eye_array(3)))[moved][:, moved]
    found, force = base.copy(), np.zeros(np.count_nonzero(rolls))
    for _ in range(GEOMETRY.rolling_rounds):
        slip, J = slips(drive, found)
        slip, J = slip[rolls], J[rolls][:, moved]
        if np.abs(slip).max() <= EXACT:
            break
        system = block_array([[form, J.T], [J, -DAMPING * eye_array(len(slip))]], format="csc")
        pull = -form @ (found - base).ravel()[moved] - J.T @ force
        step, more = np.split(splu(csc_array(system)).solve(np.concatenate([pull, -slip])), [len(pull)])
        found[free] += step.reshape(-1, 3)
        force += more
    return found


def slips(drive: BaseDrive, states: Array) -> tuple[Array, csr_array]:
    """What wheels cannot roll of each hop through states (n, m), and how these change it.

    States begin with x, y, yaw. Returns k slips [m] and their derivatives, (k,) and (k, n m); see
    `BaseDrive.slip`.
    """
    slip, by_pose = drive.slip(states[:, :3])
    m = states.shape[1]
    columns = m * np.arange(len(slip))[:, None] + np.concatenate([np.arange(3), m + np.arange(3)])
    shape = len(slip), states.size
    return slip, csr_array((by_pose.ravel(), columns.ravel(), 6 * np.arange(len(slip) + 1)), shape=shape)
