"""The fastest way along a given path: TOPP-RA, as toppra computes it; the only file that imports it.

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

logging.getLogger("toppra").setLevel(logging.CRITICAL)  # it tells of what is raised here
SOLVER, EVEN = "seidel", "ParametrizeConstAccel"
UNITS = (1.0, 2.0, 10.0, 0.3)  # of the way; the engine may fail by rounding, which is another in another unit


class _Path(AbstractGeometricPath):  # type: ignore[misc]
    """What the engine asks of a path whose derivatives its constraint knows."""

    def __init__(self, grid: Array, dof: int) -> None:
        self.grid, self.count = grid, dof

    @property
    def dof(self) -> int:
        return self.count

    @property
    def path_interval(self) -> Array:
        return self.grid[[0, -1]]


class _Limits(LinearConstraint):  # type: ignore[misc]
    """Accelerations within limits at some shares of each hop, and a bound of the velocity."""

    def __init__(self, looks: Sequence[Look], limits: Array, most: Array) -> None:
        super().__init__()
        self.looks, self.limits, self.most, self.identical = looks, limits, most, True
        self.dof = len(limits)

    def compute_constraint_params(self, path: Any, gridpoints: Any, *args: Any, **kwargs: Any) -> Any:
        hop = np.diff(gridpoints)[:, None]
        # The squared velocity grows evenly along a hop: by twice the acceleration for each unit of the way.
        push = [look.slope + 2 * look.share * hop * look.bend for look in self.looks]
        a, b = np.concatenate(push, axis=1), np.concatenate([look.bend for look in self.looks], axis=1)
        a, b = np.concatenate([a, a[-1:]]), np.concatenate([b, b[-1:]])
        sides = np.concatenate([np.eye(a.shape[1]), -np.eye(a.shape[1])])
        bounds = np.tile(self.limits, 2 * len(self.looks))
        rates = np.column_stack([np.zeros_like(self.most), self.most])
        return a, b, np.zeros_like(a), sides, bounds, None, rates


@dataclass(frozen=True, eq=False)
class Look:
    """First and second derivatives of coordinates at a share of each hop, (m, k) each."""

    share: float
    slope: Array
    bend: Array


def fastest(grid: Array, looks: Sequence[Look], limits: Array, most: Array) -> Array:
    """Path velocities at a grid, from rest to rest, so that the whole takes least time.

    Between grid points the path acceleration is even; derivatives may jump there.

    Parameters
    ----------
    grid : (m + 1,) array
        Path positions, ascending.
    looks : sequence of Look
        Where accelerations of k coordinates are kept within limits.
    limits : (k,) array
        Of these accelerations, either way.
    most : (m + 1,) array
        Of the squared path velocity.

    Returns
    -------
    (m + 1,) array

    Raises
    ------
    InputError
        When none is found.
    """
    for unit in UNITS:
        seen = [Look(one.share, one.slope * unit, one.bend * unit**2) for one in looks]
        found = _asked(grid / unit, seen, limits, most / unit**2)
        if found is not None:
            return found * unit
    raise InputError("timing: no motion along the path within these speeds and accelerations was found")


def _asked(grid: Array, looks: Sequence[Look], limits: Array, most: Array) -> Array | None:
    """What the engine finds, see `fastest`; None where it finds nothing."""
    path = _Path(grid, len(limits))
    solver = TOPPRA(
        [_Limits(looks, limits, most)], path, gridpoints=grid, solver_wrapper=SOLVER, parametrizer=EVEN
    )
    _, velocity, _ = solver.compute_parameterization(0.0, 0.0)
    if velocity is None or not np.isfinite(velocity).all():
        return None
    return np.asarray(velocity, dtype=np.float64)
