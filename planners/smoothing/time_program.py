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
            OPTIONS.accuracy,
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

    @property
    def _limits(self) -> tuple[csr_array, Array]:
        """Rows and least values for limits of speed and acceleration, and for how unevenly spans change."""
        parts = self._speeds, self._accelerations, self._tool_speeds, self._neighbours
        return csr_array(vstack([one for one, _ in parts])), np.concatenate([least for _, least in parts])

    def _rows(self, states: csr_array | None, bent: csr_array | None, slower: csr_array) -> csr_array:
        """Rows by states, by accelerations, and by what spans change and sections exceed."""
        count, (n, m) = slower.shape[0], self.timed.states.shape
        by_state = csr_array((count, n * m)) if states is None else states
        by_bend = csr_array((count, self.bend_count * m)) if bent is None else bent
        return csr_array(hstack([by_state, by_bend, csr_array((count, len(self.edges) * m)), slower]))

    @property
    def _speeds(self) -> tuple[csr_array, Array]:
        """Mean speeds of segments, where the trust region lets them come to their limits."""
        problem, (units, part) = self.problem, _units(self.timed.states.shape[1])
        change = np.diff(self.timed.states, axis=0)[problem.moving] @ units.T
        most = self._span[:, None] * problem.velocity[part]
        reach = 2 * self.trust * np.abs(units).sum(axis=1) + OPTIONS.span_share * most
        some = (most - change < reach).ravel()
        own = np.repeat(problem.section[problem.moving], len(part))[some]
        by_state = csr_array(kron(-self._hop, units))[some]
        allowed = most.ravel()[some]
        return self._rows(by_state, None, self._slower(own, allowed, allowed)), (change - most).ravel()[some]

    @property
    def _accelerations(self) -> tuple[csr_array, Array]:
        """Accelerations at both ends of segments."""
        units, part = _units(self.timed.states.shape[1])
        own = np.repeat(section_of_bend(self.problem), len(part))
        most = np.tile(self.problem.acceleration[part], self.bend_count)
        by_bend = csr_array(kron(-eye_array(self.bend_count), units))
        return self._rows(None, by_bend, self._slower(own, 2 * most, most)), -most

    @property
    def _tool_speeds(self) -> tuple[csr_array, Array]:
        """Mean speeds of the tool on segments."""
        (n, m), (k, way, J) = self.timed.states.shape, self.problem.tool_ways(self.timed.states)
        where, row = (k[:, None] * m + np.arange(2 * m)).ravel(), np.repeat(np.arange(len(k)), 2 * m)
        own = self.problem.section[k]
        most = self.problem.tool_velocity[k] * self.timed.spans[own]
        by_state = _sparse(row, [(where, -J.ravel())], (len(k), n * m))
        return self._rows(by_state, None, self._slower(own, most, most)), way - most

    @property
    def _neighbours(self) -> tuple[csr_array, Array]:
        """Changes of spans beside those of the next section."""
        count = len(self.timed.spans) - 1
        rows, first = np.arange(2 * count), np.tile(np.arange(count), 2)
        sign = np.repeat([1.0, -1.0], count)
        beside = _sparse(rows, [(first, sign), (first + 1, -sign)], (2 * count, 2 * count + 2))
        share = OPTIONS.neighbour_share * min(self.trust / OPTIONS.first_trust, 1.0)
        return self._rows(None, None, beside), np.full(2 * count, -share)


def _units(m: int) -> tuple[Array, Index]:
    """Directions (k, m) in which rates are limited, and the limit of each (k,): a polygon for the base."""
    ways, others = np.hstack([WAYS, np.zeros((len(WAYS), m - 2))]), np.eye(m)[2:]
    part = np.concatenate([np.zeros(len(WAYS), dtype=np.int64), np.tile(np.arange(1, m - 1), 2)])
    return np.concatenate([ways, others, -others]), part


def _sparse(row: Index, parts: Sequence[tuple[Index, Array | float]], shape: tuple[int, int]) -> csr_array:
    """Sparse matrix that has in each row (k,) values (k,) in columns (k,), part by part."""
    values = [np.broadcast_to(value, row.shape) for _, value in parts]
    columns = np.concatenate([column for column, _ in parts])
    return csr_array((np.concatenate(values), (np.tile(row, len(parts)), columns)), shape=shape)


def _beside(rows: csr_array, count: int) -> csr_array:
    """Rows with so many more columns of zeros."""
    return csr_array(hstack([rows, csr_array((rows.shape[0], count))]))
