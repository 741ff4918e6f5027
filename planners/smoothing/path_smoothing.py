"""Base and arm along a whole path, made smooth together: the tool stays on its path, the redundancy is free.

Sequential quadratic programming. The second differences of the robot's coordinates along the path are made
small, which are its accelerations at an even speed of the tool. What holds the tool on its path, and wheels
from slipping, are equations, linear in each round; limits, areas and clearances are half-spaces there; a
trust region keeps the rounds honest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import bsr_array, csc_array, csr_array, diags_array, eye_array, kron, vstack
from scipy.sparse.linalg import splu

from regionik.planners.geometry.rolling import slips
from regionik.planners.progress import track
from regionik.planners.smoothing.options import PATH_SMOOTHING
from regionik.planners.smoothing.quadratic_program import minimize_quadratic
from regionik.planners.solvers.aims import beyond_cones, missed_by
from regionik.planners.solvers.damped_least_squares import Aims
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.robot import Robot

OPTIONS = PATH_SMOOTHING
EXACT = 1e-12  # miss that is rounding [m]
DAMPING = 1e-12  # of the least changes where equations depend on one another, as of a stretched arm


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
    corner: Mask  # (n,) states in which the tool's own path turns sharply
    aims: Aims  # of n points
    scale: Array  # (m,) weight of each coordinate: the inverse of the acceleration that it may have
    # lower, upper: (n, m) limits of the coordinates; equal where a coordinate is held
    lower: Array
    upper: Array
    # beyond: (n, m) states that first and last come from and go to with the tool lifted, NaN for none
    beyond: Array
    half_spaces_at: Callable[[Array], HalfSpaces]  # half-spaces that hold near given states (n, m)

    def part(self, rows: slice, half_spaces_at: Callable[[Array], HalfSpaces]) -> PathProblem:
        """The problem of some states, with half-spaces of these."""
        by_state = ("parameter", "corner", "lower", "upper", "beyond")
        some = {name: getattr(self, name)[rows] for name in by_state}
        return replace(self, aims=self.aims.part(rows), half_spaces_at=half_spaces_at, **some)


class _Roughness(NamedTuple):
    """Bending and length of a motion as a quadratic form, and springs to states beyond its ends."""

    form: csc_array  # (n m, n m)
    spring: Array  # (n m,)
    beyond: Array  # (n m,)

    def of(self, states: Array) -> float:
        flat = states.ravel()
        return float(flat @ (self.form @ flat) + self.spring @ (flat - self.beyond) ** 2) / 2

    def gradient(self, states: Array) -> Array:
        flat = states.ravel()
        return self.form @ flat + self.spring * (flat - self.beyond)


class _Equations(NamedTuple):
    """What states miss of the tool's path and of rolling without slip, (k,), and how changes mend it."""

    miss: Array
    J: csr_array  # (k, n m)


def smooth_states(problem: PathProblem, states: Array, trust: float = OPTIONS.first_trust) -> Array:
    """Return the states (n, m) made smooth, the tool on its path to rounding where the arm lets it.

    The largest change of a coordinate in the first round is ``trust`` [m] or [rad].
    """
    rough = _roughness(problem)
    states, missed = _projected(problem, states)
    half_spaces = problem.half_spaces_at(states)
    best, slight = _cost(rough, states, missed, half_spaces), 0
    for _ in track("rounds", range(OPTIONS.max_rounds)):
        step = _step(problem, rough, states, missed, half_spaces, trust)
        if step is None:
            break
        tried, missed_there = _projected(problem, states + step)
        kept_there = problem.half_spaces_at(tried)
        cost = _cost(rough, tried, missed_there, kept_there)
        if cost < best:
            gain, best = best - cost, cost
            states, missed, half_spaces = tried, missed_there, kept_there
            trust = min(2.0 * trust, OPTIONS.first_trust)
            slight = slight + 1 if gain < OPTIONS.min_gain * best else 0
            if slight == OPTIONS.patience:
                break
        else:
            trust *= 0.3
            if trust < OPTIONS.min_trust:
                break
    return on_path(problem, states)


def _roughness(problem: PathProblem) -> _Roughness:
    """Quadratic form of all coordinates, its mean curvature 1: bending, and a little of length.

    With the tool lifted motion costs its length alone, as `lifted_length` of the path.
    """
    t, n = problem.parameter, len(problem.parameter)
    h = np.diff(t)
    weight = np.sqrt(np.where(problem.corner[1:-1], OPTIONS.corner_weight, 1.0) * (h[:-1] + h[1:]) / 2)
    by_hop, weight = 1 / h, weight / ((h[:-1] + h[1:]) / 2)
    second = by_hop[:-1] * weight, -(by_hop[:-1] + by_hop[1:]) * weight, by_hop[1:] * weight
    bend = csr_array(diags_array(second, offsets=[0, 1, 2], shape=(n - 2, n)))
    slope = np.sqrt(OPTIONS.length_cost / h)
    length = csr_array(diags_array([-slope, slope], offsets=[0, 1], shape=(n - 1, n)))
    form = kron(bend.T @ bend + length.T @ length, diags_array(problem.scale**2), format="csc")
    mean = form.diagonal().mean()
    per_length = OPTIONS.length_cost / OPTIONS.lifted_length
    springs = per_length * np.where(np.isnan(problem.beyond), 0.0, problem.scale**2)
    return _Roughness(csc_array(form / mean), springs.ravel() / mean, np.nan_to_num(problem.beyond).ravel())


def _cost(rough: _Roughness, states: Array, missed: _Equations, half_spaces: HalfSpaces) -> float:
    """Roughness of states, and what the equations and the half-spaces miss."""
    beyond = float(half_spaces.cost @ np.maximum(half_spaces.least, 0.0))
    return rough.of(states) + 0.5 * OPTIONS.miss_weight * float(np.sum(missed.miss**2)) + beyond


def _step(
    problem: PathProblem,
    rough: _Roughness,
    states: Array,
    missed: _Equations,
    half_spaces: HalfSpaces,
    trust: float,
) -> Array | None:
    """Change of all states that one quadratic program finds best within the trust region."""
    miss, J = missed
    hessian = csc_array(rough.form + diags_array(rough.spring) + OPTIONS.miss_weight * (J.T @ J))
    gradient = rough.gradient(states) - OPTIONS.miss_weight * (J.T @ miss)
    n, m = states.shape
    lower = np.clip(problem.lower - states, -trust, 0.0)
    upper = np.clip(problem.upper - states, 0.0, trust)
    half_spaces = within_reach(half_spaces, lower, upper)
    columns = half_spaces.state[:, None] * m + np.arange(m)
    rows = csc_array(
        (half_spaces.normal.ravel(), (np.repeat(np.arange(len(half_spaces.least)), m), columns.ravel())),
        shape=(len(half_spaces.least), n * m),
    )
    ends = lower.ravel(), upper.ravel()
    found = minimize_quadratic(hessian, gradient, rows, half_spaces.least, half_spaces.cost, *ends)
    return None if found is None else np.clip(found, *ends).reshape(n, m)


def within_reach(half_spaces: HalfSpaces, lower: Array, upper: Array) -> HalfSpaces:
    """Half-spaces that changes between bounds (n, m) can leave: the others need no row of the program."""
    ends = np.where(half_spaces.normal > 0, lower[half_spaces.state], upper[half_spaces.state])
    crossed = np.einsum("km,km->k", half_spaces.normal, ends) < half_spaces.least
    return HalfSpaces(
        *(
            column[crossed]
            for column in (half_spaces.state, half_spaces.normal, half_spaces.least, half_spaces.cost)
        )
    )


def on_path(problem: PathProblem, states: Array) -> Array:
    """Meet the equations by the least changes of the coordinates that are free."""
    return _projected(problem, states)[0]


def _projected(problem: PathProblem, states: Array) -> tuple[Array, _Equations]:
    """States that meet the equations as near as they come, and what is missed there."""
    free = ((problem.upper > problem.lower) / problem.scale).ravel()
    missed = _equations(problem, states)
    for _ in range(OPTIONS.max_refinements):
        if np.abs(missed.miss).max(initial=0.0) <= EXACT:
            break
        J = missed.J @ diags_array(free)
        square = csc_array(J @ J.T)
        damped = square + DAMPING * square.diagonal().max(initial=1.0) * eye_array(len(missed.miss))
        step = (free * (J.T @ splu(csc_array(damped)).solve(missed.miss))).reshape(states.shape)
        for share in OPTIONS.step_shares:
            wished = states + share * step
            nearer = np.clip(wished, problem.lower, problem.upper)
            there = _equations(problem, nearer)
            if np.linalg.norm(there.miss) < np.linalg.norm(missed.miss):
                break
        else:  # states that are held miss what they miss
            break
        free = np.where((nearer == wished).ravel(), free, 0.0)  # what came to a limit stays there
        states, missed = nearer, there
    return states, missed


def _equations(problem: PathProblem, states: Array) -> _Equations:
    miss, J = beyond_cones(problem.aims, missed_by(problem.robot, problem.aims, states))
    if not problem.aims.kinds.any():
        miss, J = miss[:, :3], J[:, :3]
    n, asked, m = J.shape
    index = np.arange(n + 1)
    by_state = csr_array(bsr_array((J, index[:-1], index), shape=(n * asked, n * m)))
    slip, by_hop = slips(problem.robot.drive, states)
    return _Equations(np.concatenate([miss.ravel(), -slip]), csr_array(vstack([by_state, by_hop])))
