"""Base and arm along a whole path, made smooth together: the tool stays on its path, the redundancy is free.

Sequential quadratic programming. The second differences of the robot's coordinates along the path are made
small, which are its accelerations at an even speed of the tool. What holds the tool on its path is linear in
each round, and limits, areas and clearances are half-spaces there; a trust region keeps the rounds honest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array, csr_array, diags_array, kron

from regionik.planners.progress import track
from regionik.planners.smoothing.quadratic_program import minimize_quadratic
from regionik.planners.solvers.aims import Aims, Missed, missed_by
from regionik.worlds.arrays import Array, Index
from regionik.worlds.robot import Robot

ROUNDS, REFINEMENTS = 25, 6  # of the programs; of the tool at last
LEAST_GAIN = 2e-3  # part of the cost, for another round
FIRST_TRUST, LEAST_TRUST = 0.3, 1e-3  # largest change of a coordinate in a round [m] or [rad]
TOOL_WEIGHT = 1e4  # of the tool's error against the mean of the roughness
LENGTH_COST = 0.05  # of motion itself, against its bending along a metre of path
CORNER_WEIGHT = 0.02  # of bending where the tool's own path has a corner
EXACT = 1e-12  # miss of the tool that is rounding, and change of a coordinate [m] or [rad]
FLAT = 1e-6  # singular values below this part of the largest are left out


@dataclass(frozen=True, eq=False)
class HalfSpaces:
    """Linear constraints on changes of states: ``normal @ change`` of a ``state`` is at least ``least``."""

    state: Index  # (k,)
    normal: Array  # (k, m)
    least: Array  # (k,) above 0 where a constraint does not hold yet [m]
    cost: Array  # (k,) of such a constraint [1/m]


@dataclass(frozen=True, eq=False)
class PathProblem:
    """States along a path of the tool, of coordinates x, y, yaw and joints (n, m)."""

    robot: Robot
    parameter: Array  # (n,) place of each state along the path, ascending [m]
    corner: NDArray[np.bool_]  # (n,) states in which the tool's own path turns sharply
    aims: Aims  # of n points
    scale: Array  # (m,) weight of each coordinate: the inverse of the acceleration that it may have
    # lower, upper: (n, m) limits of the coordinates; equal where a coordinate is held
    lower: Array
    upper: Array
    keep: Callable[[Array], HalfSpaces]  # half-spaces that hold near given states (n, m)

    def part(self, rows: slice, keep: Callable[[Array], HalfSpaces]) -> PathProblem:
        """The problem of some states, with half-spaces of these."""
        by_state = ("parameter", "corner", "lower", "upper")
        some = {name: getattr(self, name)[rows] for name in by_state}
        return replace(self, aims=self.aims.part(rows), keep=keep, **some)


def smooth_states(problem: PathProblem, states: Array, trust: float = FIRST_TRUST) -> Array:
    """Return the states (n, m) made smooth, the tool on its path to rounding where the arm lets it.

    The largest change of a coordinate in the first round is ``trust`` [m] or [rad].
    """
    rough = _roughness(problem)
    states, missed = _led_back(problem, states)
    kept = problem.keep(states)
    best = _cost(rough, states, missed, kept)
    for _ in track("rounds", range(ROUNDS)):
        step = _step(problem, rough, states, missed, kept, trust)
        if step is None:
            break
        tried, missed_there = _led_back(problem, states + step)
        kept_there = problem.keep(tried)
        cost = _cost(rough, tried, missed_there, kept_there)
        if cost < best:
            gain, best = best - cost, cost
            states, missed, kept = tried, missed_there, kept_there
            trust = min(2.0 * trust, FIRST_TRUST)
            if gain < LEAST_GAIN * best:
                break
        else:
            trust *= 0.3
            if trust < LEAST_TRUST:
                break
    return states


def _roughness(problem: PathProblem) -> csc_array:
    """Quadratic form of all coordinates, its mean curvature 1: bending, and a little of length."""
    t, n = problem.parameter, len(problem.parameter)
    h = np.diff(t)
    weight = np.sqrt(np.where(problem.corner[1:-1], CORNER_WEIGHT, 1.0) * (h[:-1] + h[1:]) / 2)
    mean = (h[:-1] + h[1:]) / 2
    inner = np.arange(n - 2)
    values = np.concatenate([1 / h[:-1], -(1 / h[:-1] + 1 / h[1:]), 1 / h[1:]]) * np.tile(weight / mean, 3)
    columns = np.concatenate([inner, inner + 1, inner + 2])
    bend = csr_array((values, (np.tile(inner, 3), columns)), shape=(n - 2, n))
    hop, slope = np.arange(n - 1), np.sqrt(LENGTH_COST / h)
    length = csr_array(
        (np.concatenate([-slope, slope]), (np.tile(hop, 2), np.concatenate([hop, hop + 1]))), shape=(n - 1, n)
    )
    form = kron(bend.T @ bend + length.T @ length, diags_array(problem.scale**2), format="csc")
    return csc_array(form / form.diagonal().mean())


def _cost(rough: csc_array, states: Array, missed: Missed, kept: HalfSpaces) -> float:
    """Roughness of states, and what the tool and the half-spaces miss."""
    flat = states.ravel()
    beyond = float(kept.cost @ np.maximum(kept.least, 0.0))
    return float(0.5 * flat @ (rough @ flat) + 0.5 * TOOL_WEIGHT * np.sum(missed.miss**2)) + beyond


def _step(
    problem: PathProblem, rough: csc_array, states: Array, missed: Missed, kept: HalfSpaces, trust: float
) -> Array | None:
    """Change of all states that one quadratic program finds best within the trust region."""
    miss, J = missed
    index, blocks = np.arange(len(states) + 1), np.einsum("nij,nik->njk", J, J)
    hessian = rough + TOOL_WEIGHT * bsr_array((blocks, index[:-1], index)).tocsc()
    gradient = rough @ states.ravel() - TOOL_WEIGHT * np.einsum("nij,ni->nj", J, miss).ravel()
    n, m = states.shape
    columns = kept.state[:, None] * m + np.arange(m)
    rows = csc_array(
        (kept.normal.ravel(), (np.repeat(np.arange(len(kept.least)), m), columns.ravel())),
        shape=(len(kept.least), n * m),
    )
    lower = np.clip(problem.lower - states, -trust, 0.0).ravel()
    upper = np.clip(problem.upper - states, 0.0, trust).ravel()
    found = minimize_quadratic(csc_array(hessian), gradient, rows, kept.least, kept.cost, lower, upper)
    return None if found is None else np.clip(found, lower, upper).reshape(n, m)


def on_path(problem: PathProblem, states: Array) -> Array:
    """Bring the tool onto its path by the least changes of the coordinates that are free."""
    return _led_back(problem, states)[0]


def _led_back(problem: PathProblem, states: Array) -> tuple[Array, Missed]:
    """States with the tool on its path as near as they come, and what is missed there."""
    free = (problem.upper > problem.lower) / problem.scale
    asked = slice(None) if problem.aims.kind.any() else slice(3)
    missed = missed_by(problem.robot, problem.aims, states)
    for _ in range(REFINEMENTS):
        if np.abs(missed.miss).max(initial=0.0) <= EXACT:
            break
        back = np.linalg.pinv(missed.J[:, asked] * free[:, None, :], rcond=FLAT)
        step = free * np.einsum("nij,nj->ni", back, missed.miss[:, asked])
        nearer = np.clip(states + step, problem.lower, problem.upper)
        moved = np.abs(nearer - states).max(initial=0.0)
        states, missed = nearer, missed_by(problem.robot, problem.aims, nearer)
        if moved <= EXACT:  # states that are held miss what they miss
            break
    return states, missed
