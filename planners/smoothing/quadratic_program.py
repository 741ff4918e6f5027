"""Sparse convex quadratic programs by PIQP's interior point method. The only file that imports piqp."""

from __future__ import annotations

import numpy as np
import piqp
from scipy.sparse import csc_array

from regionik.worlds.arrays import Array

ACCURACY = 1e-7  # of residuals, after PIQP's own scaling


def minimize_quadratic(
    hessian: csc_array, gradient: Array, rows: csc_array, least: Array, lower: Array, upper: Array
) -> Array | None:
    """Return the minimum of a quadratic function among linear constraints.

    Parameters
    ----------
    hessian : (n, n) sparse array
        Symmetric, positive semidefinite.
    gradient : (n,) array
        At zero.
    rows : (k, n) sparse array
        ``rows @ x`` is to be at least ``least`` (k,).
    lower, upper : (n,) array
        Bounds of x.

    Returns
    -------
    (n,) array or None
        None where the solver does not come to an end, as where nothing meets the constraints.
    """
    solver = piqp.SparseSolver()
    solver.settings.eps_abs = solver.settings.eps_rel = ACCURACY
    most = np.full(len(least), np.inf)
    solver.setup(hessian, gradient, None, None, rows, least, most, lower, upper)
    if solver.solve() != piqp.PIQP_SOLVED:
        return None
    found: Array = np.array(solver.result.x)
    return found
