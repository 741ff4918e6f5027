"""Base and arm along a whole path in the least time: states and times together.

Sequential linear programming, see `time_program`. Half-spaces, for the tool, areas and clearances at the
states and between them, are linear in each round; a trust region keeps the rounds honest.
"""

from __future__ import annotations

import numpy as np

from regionik.planners.progress import track
from regionik.planners.smoothing.options import LEAST_TIME
from regionik.planners.smoothing.path_smoothing import HalfSpaces
from regionik.planners.smoothing.time_program import TimeProgram
from regionik.planners.smoothing.timed_states import (
    LeastTimeProblem,
    TimedStates,
    at_places,
    bends,
    by_part,
    section_of_bend,
)
from regionik.worlds.arrays import Array

OPTIONS = LEAST_TIME


def least_time(problem: LeastTimeProblem, timed: TimedStates) -> TimedStates:
    """Return timed states that take less time than given ones; what half-spaces miss is nearly mended."""
    timed = timed._replace(rates=np.where(problem.still, 0.0, timed.rates))
    rounds = min(OPTIONS.max_rounds, max(OPTIONS.min_rounds, OPTIONS.max_work // len(timed.states)))
    return _improved(problem, timed, rounds, OPTIONS.first_trust, OPTIONS.missed_share)


def kept_within(problem: LeastTimeProblem, timed: TimedStates) -> TimedStates:
    """Return timed states near given ones that miss less of half-spaces, with the tool at its set-points."""
    found = _improved(problem, timed, OPTIONS.max_last_rounds, OPTIONS.last_trust, 1.0)
    return _corrected(problem, found)


def _improved(
    problem: LeastTimeProblem, timed: TimedStates, rounds: int, trust: float, missed_share: float
) -> TimedStates:
    """Timed states after rounds of programs, judged by their time, and by what is missed in part."""
    half_spaces = problem.half_spaces_at(at_places(problem, timed))
    best, slight = _merit(problem, timed, half_spaces, missed_share), 0
    for _ in track("optimising", range(rounds)):
        tried = _step(problem, timed, half_spaces, trust)
        if tried is None:
            break
        there = problem.half_spaces_at(at_places(problem, tried))
        merit = _merit(problem, tried, there, missed_share)
        if merit < best:
            slight = slight + 1 if best - merit < OPTIONS.min_gain * best else 0
            timed, half_spaces, best = tried, there, merit
            trust = min(OPTIONS.growth * trust, OPTIONS.max_trust)
            if slight == OPTIONS.patience:
                break
        else:
            trust *= OPTIONS.shrinking
            if trust < OPTIONS.min_trust:
                break
    return timed


def _corrected(problem: LeastTimeProblem, timed: TimedStates) -> TimedStates:
    """The timed states with the tool brought back to its set-points, by changes that are linear between."""
    change = problem.back_on_path(timed.states)
    change = np.clip(timed.states + change, problem.lower, problem.upper) - timed.states
    ends = problem.first, problem.first + problem.count
    slope = np.diff(change, axis=0)
    shift, sides = np.zeros_like(change), np.zeros(len(change))
    for end, k in zip(ends, (ends[0], ends[1] - 1), strict=True):
        shift[end] += slope[k] / timed.spans[:, None]
        sides[end] += 1
    return TimedStates(
        timed.states + change, timed.rates + np.where(sides > 1, 0.5, 0.0)[:, None] * shift, timed.spans
    )


def _excess(problem: LeastTimeProblem, timed: TimedStates) -> Array:
    """Share of a limit beyond it that sections use at most, (sections,)."""
    own = problem.section[problem.moving]
    span = timed.spans[own]
    speed = by_part(np.diff(timed.states, axis=0)[problem.moving]) / span[:, None] / problem.velocity
    slow, way, _ = problem.tool_ways(timed.states)
    gain, at = by_part(bends(problem, timed)) / problem.acceleration, section_of_bend(problem)
    found = np.ones(len(timed.spans))
    np.maximum.at(found, own, speed.max(axis=1))
    limit, slow = problem.tool_velocity[slow], problem.section[slow]
    np.maximum.at(found, slow, way / timed.spans[slow] / limit)
    np.maximum.at(found, at, gain.max(axis=1) / timed.spans[at] ** 2)
    return found - 1


def _merit(
    problem: LeastTimeProblem, timed: TimedStates, half_spaces: HalfSpaces, missed_share: float
) -> float:
    """Duration, and the costs of what sections exceed and half-spaces miss at most in each place."""
    missed = np.zeros(len(problem.places[0]))
    np.maximum.at(missed, half_spaces.state, half_spaces.cost * half_spaces.least)
    beyond = (
        OPTIONS.excess_share * OPTIONS.excess_cost * problem.count * timed.spans @ _excess(problem, timed)
    )
    return problem.duration(timed.spans) + float(beyond) + missed_share * float(missed.sum())


def _step(
    problem: LeastTimeProblem, timed: TimedStates, half_spaces: HalfSpaces, trust: float
) -> TimedStates | None:
    """Timed states that one program finds best within the trust region."""
    program = TimeProgram(problem, timed, trust)
    found = program.solve(half_spaces)
    if found is None:
        return None
    (n, m), edges = timed.states.shape, program.edges
    at = np.cumsum([n * m, program.bend_count * m, len(edges) * m, len(timed.spans)])
    moved, _, rates, longer, _ = np.split(found, at)
    moved = np.clip(moved.reshape(n, m), program.lower, program.upper)
    rests = np.flatnonzero(problem.section < 0)
    moved[rests + 1] = moved[rests]
    new, sides = np.zeros((2, *timed.rates.shape))
    found = np.zeros_like(timed.rates)
    found[edges] = rates.reshape(-1, m)
    for end in (problem.first, problem.first + problem.count):  # what the program had for rates times spans
        new[end] += (found[end] + longer[:, None] * timed.rates[end]) / (1 + longer[:, None])
        sides[end] += 1
    new = np.where(problem.still, 0.0, new / np.maximum(sides, 1))
    return TimedStates(timed.states + moved, new, timed.spans * (1 + longer))
