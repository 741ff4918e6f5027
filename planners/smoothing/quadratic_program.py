"""Sparse convex quadratic programs by PIQP's interior point method. The only file that imports piqp."""

from __future__ import annotations

import numpy as np
import piqp
from scipy.sparse import block_diag, csc_array, csr_array, eye_array, hstack

from regionik.worlds.arrays import Array

ACCURACY = 1e-10  # of residuals, after PIQP's own scaling; the least costs are 1e-8
UNBOUNDED = -1e30  # below this PIQP takes a bound for none, and warns on stderr of a constraint with no other


def minimize_quadratic(
    hessian: csc_array,
    gradient: Array,
    rows: csc_array,
    least: Array,
    cost: Array,
    lower: Array,
    upper: Array,
) -> Array | None:
    """Return the minimum of a quadratic function and of what is missing of linear constraints.

    Parameters
    ----------
    hessian : (n, n) sparse array
        Symmetric, positive semidefinite.
    gradient : (n,) array
        At zero.
    rows : (k, n) sparse array
        ``rows @ x`` is to be at least ``least`` (k,); what it is less costs ``cost`` (k,) times as much.
    lower, upper : (n,) array
        Bounds of x.

    Returns
    -------
    (n,) array or None
        None where the solver does not come to an end, as where nothing meets the constraints.
    """
    bounded = least > UNBOUNDED
    rows, least, cost = rows[bounded], least[bounded], cost[bounded]
    k, n = rows.shape
    found = minimize_within(
        csc_array(block_diag([hessian, csc_array((k, k))])),
        np.concatenate([gradient, cost]),
        None,
        csc_array(hstack([rows, eye_array(k)])),
        least,
        np.concatenate([lower, np.zeros(k)]),
        np.concatenate([upper, np.full(k, np.inf)]),
        ACCURACY,
    )
    return None if found is None else found[:n]


def minimize_within(
    hessian: csc_array,
    gradient: Array,
    equations: tuple[csr_array, Array] | None,
    rows: csc_array,
    least: Array,
    lower: Array,
    upper: Array,
    accuracy: float,
) -> Array | None:
    """Return the minimum of a quadratic function within linear constraints, None where none is found.

    Parameters
    ----------
    hessian : (n, n) sparse array
        Symmetric, positive semidefinite.
    gradient : (n,) array
        At zero.
    equations : (k, n) sparse array and (k,) array, or None for none
        ``equations[0] @ x`` is ``equations[1]``.
    rows, least : (m, n) sparse array, (m,) array
        ``rows @ x`` is at least ``least``.
    lower, upper : (n,) array
        Bounds of x.
    accuracy : float
        Of residuals, after PIQP's own scaling.
    """
    solver = piqp.SparseSolver()
    solver.settings.eps_abs = solver.settings.eps_rel = accuracy
    most = np.full(len(least), np.inf)
    form, right = (None, None) if equations is None else (csc_array(equations[0]), equations[1])
    solver.setup(hessian, gradient, form, right, rows, least, most, lower, upper)
    return np.array(solver.result.x) if solver.solve() == piqp.PIQP_SOLVED else None


def least_weighted(
    weight: Array,
    wished: Array,
    rows: Array,
    rhs: Array,
    half_spaces: Array,
    least: Array,
    lower: Array,
    upper: Array,
) -> Array | None:
    """Return the x (n,) nearest to a wished one that meets linear equations and half-spaces.

    Parameters
    ----------
    weight : (n,) array
        Of the square of how far each part of x is from the ``wished`` (n,), above 0.
    rows, asked : (k, n), (k,) array
        ``rows @ x`` is ``rhs``.
    half_spaces, least : (m, n), (m,) array
        ``half_spaces @ x`` is at least ``least``.
    lower, upper : (n,) array
        Bounds of x.
    """
    solver = piqp.DenseSolver()
    solver.settings.eps_abs = solver.settings.eps_rel = ACCURACY
    bounded = least > UNBOUNDED
    half_spaces, least, most = half_spaces[bounded], least[bounded], np.full(bounded.sum(), np.inf)
    solver.setup(np.diag(weight), -weight * wished, rows, rhs, half_spaces, least, most, lower, upper)
    return np.array(solver.result.x) if solver.solve() == piqp.PIQP_SOLVED else None
