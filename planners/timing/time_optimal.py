"""Time-optimal velocities along a given path, by TOPP-RA as toppra computes it; only this file imports it.

Source: Pham and Pham, A new approach to time-optimal path parameterization based on reachability analysis
(IEEE T-RO 2018).
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from toppra.algorithm import TOPPRA
from toppra.constraint import LinearConstraint
from toppra.interpolator import AbstractGeometricPath

from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError

logging.getLogger("toppra").setLevel(logging.CRITICAL)  # what it warns of is raised here
SOLVER, PARAMETRIZER = "seidel", "ParametrizeConstAccel"
UNITS = (1.0, 2.0, 10.0, 0.3)  # of path position; toppra may fail by rounding, which differs with the unit


class _Path(AbstractGeometricPath):  # type: ignore[misc]
    """Path as toppra asks for it; its derivatives are known to the constraint."""

    def __init__(self, grid: Array, dof: int) -> None:
        self.grid, self.count = grid, dof

    @property
    def dof(self) -> int:
        return self.count

    @property
    def path_interval(self) -> Array:
        return self.grid[[0, -1]]


class _Limits(LinearConstraint):  # type: ignore[misc]
    """Limits of accelerations at some shares of each segment, and of the path velocity."""

    def __init__(self, samples: Sequence[PathDerivatives], limits: Array, most: Array) -> None:
        super().__init__()
        self.samples, self.limits, self.most, self.identical = samples, limits, most, True
        self.dof = len(limits)

    def compute_constraint_params(self, path: Any, gridpoints: Any, *args: Any, **kwargs: Any) -> Any:
        # q'' = q_s u + q_ss x with x = s'^2, and x = x_0 + 2 share ds u along a segment.
        ds = np.diff(gridpoints)[:, None]
        a = np.concatenate([one.first + 2 * one.share * ds * one.second for one in self.samples], axis=1)
        b = np.concatenate([one.second for one in self.samples], axis=1)
        a, b = np.concatenate([a, a[-1:]]), np.concatenate([b, b[-1:]])
        sides = np.concatenate([np.eye(a.shape[1]), -np.eye(a.shape[1])])
        bounds = np.tile(self.limits, 2 * len(self.samples))
        rates = np.column_stack([np.zeros_like(self.most), self.most])
        return a, b, np.zeros_like(a), sides, bounds, None, rates


@dataclass(frozen=True, eq=False)
class PathDerivatives:
    """Derivatives of k coordinates by path position at a share of each of m segments."""

    share: float
    first: Array  # (m, k)
    second: Array  # (m, k)


def time_optimal_velocities(
    grid: Array, samples: Sequence[PathDerivatives], limits: Array, most: Array
) -> Array:
    """Return path velocities at a grid, from rest to rest, that take least time.

    Between grid points the path acceleration is constant; derivatives may jump there.

    Parameters
    ----------
    grid : (m + 1,) array
        Path positions, ascending.
    samples : sequence of PathDerivatives
        Where accelerations of k coordinates are kept within limits.
    limits : (k,) array
        Of these accelerations, in both directions.
    most : (m + 1,) array
        Limits of the squared path velocity.

    Returns
    -------
    (m + 1,) array

    Raises
    ------
    InputError
        When none is found.
    """
    for unit in UNITS:
        scaled = [PathDerivatives(one.share, one.first * unit, one.second * unit**2) for one in samples]
        found = _solve(grid / unit, scaled, limits, most / unit**2)
        if found is not None:
            return found * unit
    raise InputError("timing: no motion along the path within these speeds and accelerations was found")


def _solve(grid: Array, samples: Sequence[PathDerivatives], limits: Array, most: Array) -> Array | None:
    """Return the velocities that toppra finds, or None."""
    path = _Path(grid, len(limits))
    solver = TOPPRA(
        [_Limits(samples, limits, most)],
        path,
        gridpoints=grid,
        solver_wrapper=SOLVER,
        parametrizer=PARAMETRIZER,
    )
    _, velocity, _ = solver.compute_parameterization(0.0, 0.0)
    if velocity is None or not np.isfinite(velocity).all():
        return None
    return np.asarray(velocity, dtype=np.float64)
