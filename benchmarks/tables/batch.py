"""Many positions in one compiled call, by FABRIK-R or an iterative method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionik.papers.rivals.iterative import DescentLimits, IterativeMethod, descend
from regionik.planners.kernels import compiled
from regionik.planners.solvers.damped_least_squares import POSITION, Aim
from regionik.planners.solvers.multistart_ik import ArmSolver, Effort, solve_ik
from regionik.planners.solvers.rigid_bodies import RigidBodies
from regionik.planners.solvers.serial_chain import SerialArm
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError


@dataclass(frozen=True, eq=False)
class ArmPostures:
    """The answers to m positions, as arrays: joints (m, dof), the others (m,); see `ArmPosture`."""

    joints: Array
    error: Array
    iterations: NDArray[np.int64]
    restarts: NDArray[np.int64]
    polished: NDArray[np.bool_]
    converged: NDArray[np.bool_]


def solve_batch(method: ArmSolver | IterativeMethod, positions: ArrayLike, joints: ArrayLike) -> ArmPostures:
    """Solve positions (m, 3) [m] from start postures (m, dof), or all from one (dof,).

    Raises
    ------
    InputError
        For shapes that do not fit.
    """
    chain = method.chain
    p, q = _rows(chain, positions, joints)
    errors, counts = np.empty(len(p)), np.zeros((len(p), 3), dtype=np.int64)
    if isinstance(method, ArmSolver):
        bodies, tolerance = method.pointing, method.effort.tolerance
        starts = np.ascontiguousarray(method.starts[:, : len(bodies.slide)])
        _solve_each(bodies, p, starts, method.effort, q, errors, counts)
        errors = np.linalg.norm(chain.forward(q)[:, :3, 3] - p, axis=1)
    else:
        tolerance = method.tolerance
        _descend_each(method.kernel, method.arm, p, method.starts, method.limits, q, errors, counts)
    return ArmPostures(q, errors, counts[:, 0], counts[:, 1], counts[:, 2] > 0, errors <= tolerance)


def _rows(chain: Chain, positions: ArrayLike, joints: ArrayLike) -> tuple[Array, Array]:
    """Checked positions (m, 3) and starts (m, dof), clipped to the limits; one (dof,) does for all."""
    p = np.array(frozen(positions, (None, 3), "positions"))  # writable, as the kernels were compiled for
    start = np.asarray(joints, dtype=np.float64)
    if start.ndim == 1:
        start = np.broadcast_to(start, (len(p), len(start)))
    q = np.clip(frozen(start, (None, chain.dof), "joints"), chain.lower, chain.upper)
    if len(q) != len(p):
        raise InputError(f"joints: expected {len(p)} rows, one a position, got {len(q)}")
    return p, q


@compiled
def _solve_each(
    bodies: RigidBodies,
    positions: Array,
    starts: Array,
    effort: Effort,
    joints: Array,
    errors: Array,
    counts: NDArray[np.int64],
) -> None:
    """`solve_ik` for each row; counts (m, 3): passes, restarts, 1 where it was polished."""
    for i in range(len(positions)):
        aim = Aim(positions[i], POSITION, np.eye(3), 0.0)
        errors[i], _, passes, restarts, polished = solve_ik(bodies, aim, starts, effort, joints[i])
        counts[i, 0], counts[i, 1], counts[i, 2] = passes, restarts, 1 if polished else 0


@compiled
def _descend_each(
    kernel: int,
    arm: SerialArm,
    positions: Array,
    starts: Array,
    limits: DescentLimits,
    joints: Array,
    errors: Array,
    counts: NDArray[np.int64],
) -> None:
    """`descend` for each row; counts (m, 3): steps, restarts, 0."""
    for i in range(len(positions)):
        aim = Aim(positions[i], POSITION, np.eye(3), 0.0)
        errors[i], _, counts[i, 0], counts[i, 1] = descend(kernel, arm, aim, starts, limits, joints[i])
