"""Linear program of the least time near a timed motion: changes of its states, rates and times together.

Second derivatives by shares of a segment depend linearly on states, and so do speeds on them and on times;
what an acceleration allows of them grows with the square of the time, whose tangent is below it. So what a
program finds keeps the limits, but for changes of slopes at ends of sections times changes of their times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, diags_array, eye_array, hstack, kron, vstack

from regionik.planners.smoothing.options import LEAST_TIME
from regionik.planners.smoothing.path_smoothing import HalfSpaces
from regionik.planners.smoothing.quadratic_program import minimize_within
from regionik.planners.smoothing.timed_states import (
    WAYS,
    LeastTimeProblem,
    TimedStates,
    bend_weights,
    bends,
    section_of_bend,
)
from regionik.worlds.arrays import Array, Index, Mask

OPTIONS = LEAST_TIME


@dataclass(frozen=True, eq=False)
class TimeProgram:
    """Linear program in changes of states, accelerations, rates, and shares by which spans change.

    Besides, in shares of limits that sections exceed, and in what half-spaces miss in each place.
    """

    problem: LeastTimeProblem
    timed: TimedStates
    trust: float

    @cached_property
    def lower(self) -> Array:
        return np.clip(self.problem.lower - self.timed.states, -self.trust, 0.0)

    @cached_property
    def upper(self) -> Array:
        return np.clip(self.problem.upper - self.timed.states, 0.0, self.trust)

    @property
    def bend_count(self) -> int:
        return len(self.problem.moving) + len(self.problem.count)

    @cached_property
    def edges(self) -> Index:
        """States at which sections begin or end."""
        return np.union1d(self.problem.first, self.problem.first + self.problem.count)

    @cached_property
    def _at_rest(self) -> Mask:
        """Of `edges`, those at which the robot rests."""
        begins = np.isin(self.edges, self.problem.first)
        ends = np.isin(self.edges, self.problem.first + self.problem.count)
        return ~(begins & ends)

    def solve(self, half_spaces: HalfSpaces) -> Array | None:
        """All variables, None where no solution is found."""
        problem, (n, m), sections = self.problem, self.timed.states.shape, len(self.timed.spans)
        rows, least, place = self._half_spaces(half_spaces)
        known = np.unique(place)
        missed = coo_array(
            (np.ones(len(place)), (np.arange(len(place)), np.searchsorted(known, place))),
            shape=(len(place), len(known)),
        )
        cost = np.zeros(len(problem.places[0]))
        np.maximum.at(cost, half_spaces.state, half_spaces.cost)
        (limits, most), (form, right) = self._limits, self._equations
        longest = np.full(sections, OPTIONS.span_share * min(self.trust / OPTIONS.first_trust, 1.0))
        quick, strong = (np.insert(one, 1, one[0]) for one in (problem.velocity, problem.acceleration))
        now, still = self.timed.rates[self.edges], self._at_rest[:, None] | problem.still[self.edges]
        change = self.trust / OPTIONS.rate_time
        slowest, quickest = (
            np.where(still, 0.0, np.clip(now + sign * change, -quick, quick)).ravel() for sign in (-1, 1)
        )
        strong = np.tile(OPTIONS.most_excess * strong, self.bend_count)
        parts = n * m, len(strong), len(slowest), 2 * sections + len(known)
        time, none = problem.count * self.timed.spans, np.zeros(sections + len(known))
        weights = OPTIONS.change_cost / self.trust, OPTIONS.bend_cost, 0.0, 0.0
        hessian = np.repeat(weights, parts)
        hessian[n * m : n * m + len(strong)] /= strong**2
        gradient = np.concatenate([np.zeros(sum(parts[:3])), time, OPTIONS.excess_cost * time, cost[known]])
        return minimize_within(
            csc_array(diags_array(hessian)),
            gradient,
            (_beside(form, len(none)), right),
            csc_array(vstack([hstack([_beside(rows, sections), missed]), _beside(limits, len(known))])),
            np.concatenate([least, most]),
            np.concatenate([self.lower.ravel(), -strong, slowest, -longest, none]),
            np.concatenate([self.upper.ravel(), strong, quickest, longest, none + np.inf]),
        )

    @cached_property
    def _hop(self) -> csr_array:
        """Changes from state to state on moving segments, (moving, n)."""
        k, n = self.problem.moving, len(self.timed.states)
        return _sparse(np.arange(len(k)), [(k, -1.0), (k + 1, 1.0)], (len(k), n))

    @cached_property
    def _span(self) -> Array:
        """Of moving segments, (moving,) [s]."""
        return self.timed.spans[self.problem.section[self.problem.moving]]

    @cached_property
    def _equations(self) -> tuple[csr_array, Array]:
        """Equations of the splines: slopes from both sides of each state are one, at ends the rates."""
        problem, timed, (n, m) = self.problem, self.timed, self.timed.states.shape
        rows, moving = self.bend_count, len(problem.moving)
        at = np.arange(moving) + problem.section[problem.moving]  # row of the start of each segment
        change = _sparse(at, [(np.arange(moving), -1.0)], (rows, moving))
        change = change + _sparse(at + 1, [(np.arange(moving), 1.0)], (rows, moving))
        square = self._span**2 / 6
        bend = _sparse(at, [(at, 2 * square), (at + 1, square)], (rows, rows))
        bend = bend + _sparse(at + 1, [(at, square), (at + 1, 2 * square)], (rows, rows))
        begin = np.concatenate([[0], np.cumsum(problem.count + 1)[:-1]])
        ends = begin, begin + problem.count
        states = problem.first, problem.first + problem.count
        rate, longer = csr_array((rows, len(self.edges))), csr_array((rows * m, len(timed.spans)))
        column, sections = np.arange(m), np.arange(len(timed.spans))
        for row, state, sign in zip(ends, states, (1.0, -1.0), strict=True):
            edge = np.searchsorted(self.edges, state)
            rate = rate + _sparse(row, [(edge, sign * timed.spans)], rate.shape)
            value = (sign * timed.spans[:, None] * timed.rates[state]).ravel()
            where = (row[:, None] * m + column).ravel()
            longer = longer + _sparse(where, [(np.repeat(sections, m), value)], longer.shape)
        each = eye_array(m)
        by_state = csr_array(change @ self._hop)
        form = hstack([kron(by_state, each), kron(bend, each), kron(rate, each), longer])
        right = -(by_state @ timed.states).ravel()
        still = np.flatnonzero(problem.section < 0)
        tie = kron(_sparse(np.arange(len(still)), [(still, -1.0), (still + 1, 1.0)], (len(still), n)), each)
        tied = _beside(csr_array(tie), form.shape[1] - n * m)
        return csr_array(vstack([form, tied])), np.append(right, np.zeros(len(still) * m))

    def _half_spaces(self, half_spaces: HalfSpaces) -> tuple[csr_array, Array, Index]:
        """Rows, least values and places of half-spaces that the trust region lets the robot leave."""
        far = np.maximum(self.upper, -self.lower)
        segment, share = (one[half_spaces.state] for one in self.problem.places)
        reach = np.einsum("km,km->k", np.abs(half_spaces.normal), np.maximum(far[segment], far[segment + 1]))
        some = reach > -half_spaces.least
        segment, share, normal = segment[some], share[some], half_spaces.normal[some]
        (n, m), count, place = self.timed.states.shape, len(segment), half_spaces.state[some]
        row, column = np.repeat(np.arange(count), m), np.arange(m)

        def placed(ends: tuple[Array, Array], first: Index, width: int) -> csr_array:
            values = [(weight[:, None] * normal).ravel() for weight in ends]
            where = [((first + k)[:, None] * m + column).ravel() for k in (0, 1)]
            return _sparse(row, list(zip(where, values, strict=True)), (count, width))

        by_state = placed((1 - share, share), segment, n * m)
        square = self.timed.spans[self.problem.section[segment]] ** 2
        left, right = (square * weight for weight in bend_weights(share))
        by_bend = placed((left, right), self.problem.bend_row[segment], self.bend_count * m)
        now = bends(self.problem, self.timed) / self.timed.spans[section_of_bend(self.problem), None] ** 2
        least = half_spaces.least[some] + by_bend @ now.ravel()
        return (
            _beside(csr_array(hstack([by_state, by_bend])), len(self.edges) * m + len(self.timed.spans)),
            least,
            place,
        )

    def _slower(self, section: Index, change: Array, excess: Array) -> csr_array:
        """What changes of spans, and what is exceeded, allow of rates in rows (k,), (k, 2 sections)."""
        sections = len(self.timed.spans)
        parts = [(section, change), (section + sections, excess)]
        return _sparse(np.arange(len(section)), parts, (len(section), 2 * sections))

    @cached_property
    def _limits(self) -> tuple[csr_array, Array]:
        """Rows and least values for limits of speed and acceleration."""
        problem, (n, m) = self.problem, self.timed.states.shape
        edges, own = len(self.edges) * m, problem.section[problem.moving]
        change = np.diff(self.timed.states, axis=0)[problem.moving]
        rows, least = list[csr_array](), list[Array]()
        for unit, part in _units(m):
            most = problem.velocity[part]
            spare = most * self._span - change @ unit
            reach = 2 * self.trust * np.abs(unit).sum() + OPTIONS.span_share * most * self._span
            some = np.flatnonzero(spare < reach)
            longer = self._slower(own[some], most * self._span[some], most * self._span[some])
            by_state = kron(-self._hop[some], unit[None])
            rows.append(
                csr_array(hstack([by_state, csr_array((len(some), self.bend_count * m + edges)), longer]))
            )
            least.append(-spare[some])
            most, at = problem.acceleration[part], section_of_bend(problem)
            longer = self._slower(at, np.full(len(at), 2 * most), np.full(len(at), most))
            by_bend = kron(-eye_array(len(at)), unit[None])
            rows.append(
                csr_array(hstack([csr_array((len(at), n * m)), by_bend, csr_array((len(at), edges)), longer]))
            )
            least.append(np.full(len(at), -most))
        slow = np.flatnonzero(np.isfinite(problem.tool_velocity[problem.moving]))
        if len(slow):
            k = problem.moving[slow]
            way, J = problem.tool_ways(self.timed.states)
            where = (k[:, None] * m + np.arange(2 * m)).ravel()
            row = np.repeat(np.arange(len(k)), 2 * m)
            most = problem.tool_velocity[k] * self._span[slow]
            longer = self._slower(own[slow], most, most)
            by_state = _sparse(row, [(where, -J[k].ravel())], (len(k), n * m))
            rows.append(
                csr_array(hstack([by_state, csr_array((len(k), self.bend_count * m + edges)), longer]))
            )
            least.append(way[k] - most)
        pairs = np.arange(len(self.timed.spans) - 1)
        width = rows[0].shape[1]
        for sign in (1.0, -1.0):
            beside = _sparse(
                pairs, [(pairs, sign), (pairs + 1, -sign)], (len(pairs), 2 * len(self.timed.spans))
            )
            rows.append(csr_array(hstack([csr_array((len(pairs), width - beside.shape[1])), beside])))
            least.append(
                np.full(len(pairs), -OPTIONS.neighbour_share * min(self.trust / OPTIONS.first_trust, 1.0))
            )
        return csr_array(vstack(rows)), np.concatenate(least)


def _units(m: int) -> list[tuple[Array, int]]:
    """Directions (m,) in which rates are limited, and the limit of each: a polygon for the base."""
    ways = np.column_stack([WAYS, np.zeros((len(WAYS), m - 2))])
    return [(way, 0) for way in ways] + [
        (sign * np.eye(m)[j], j - 1) for j in range(2, m) for sign in (1, -1)
    ]


def _sparse(row: Index, parts: Sequence[tuple[Index, Array | float]], shape: tuple[int, int]) -> csr_array:
    """Sparse matrix that has in each row (k,) values (k,) in columns (k,), part by part."""
    values = [np.broadcast_to(value, row.shape) for _, value in parts]
    columns = np.concatenate([column for column, _ in parts])
    return csr_array((np.concatenate(values), (np.tile(row, len(parts)), columns)), shape=shape)


def _beside(rows: csr_array, count: int) -> csr_array:
    """Rows with so many more columns of zeros."""
    return csr_array(hstack([rows, csr_array((rows.shape[0], count))]))
