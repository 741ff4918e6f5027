"""Motions in sections of cubic splines of time, and what has to hold of them to be made faster.

Over each section coordinates are cubic splines of time through states that are evenly spaced in it; slopes at
both ends of a section are its neighbours' too.
Source: de Boor, A Practical Guide to Splines (1978), chapter 4, for the equations of the splines.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_banded

from regionik.planners.smoothing.options import LEAST_TIME
from regionik.planners.smoothing.path_smoothing import HalfSpaces
from regionik.worlds.arrays import Array, Index, Mask

OPTIONS = LEAST_TIME


def _all_round(count: int) -> Array:
    """Unit vectors evenly all round, (count, 2)."""
    turn = 2 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(turn), np.sin(turn)])


WAYS = _all_round(OPTIONS.sides)  # of the base, in which its rates are limited


class TimedStates(NamedTuple):
    """States of a motion, their rates where sections end, and the times of segments of each section."""

    states: Array  # (n, m) x, y, yaw and joints
    rates: Array  # (n, m) of which those at ends of sections count
    spans: Array  # (sections,) [s]


@dataclass(frozen=True, eq=False)
class LeastTimeProblem:
    """States (n, m) of coordinates x, y, yaw and joints, in sections of segments that take the same time."""

    section: Index  # (n - 1,) of each segment, ascending; -1 where the robot rests between two like states
    velocity: Array  # (m - 1,) limits of the base, its heading and each joint
    acceleration: Array  # (m - 1,)
    # lower, upper: (n, m) limits of the coordinates; equal where a coordinate is held
    lower: Array
    upper: Array
    # Half-spaces near states (p, m) at shares of the segments, in the order of `places`
    half_spaces_at: Callable[[Array], HalfSpaces]
    # Changes of states (n, m) that bring the tool back to where it has to be, (n, m)
    back_on_path: Callable[[Array], Array]
    # Ways of the tool in some directions on some segments by states (n, m): the segments (k,), ways (k,) [m],
    # and how states at both ends change them (k, 2, m)
    tool_ways: Callable[[Array], tuple[Index, Array, Array]]
    tool_velocity: Array  # (n - 1,) limit of its speed on each segment, infinite for none [m/s]
    parts: int  # of each segment, at whose ends half-spaces hold

    @cached_property
    def moving(self) -> Index:
        """Segments on which the robot moves."""
        return np.flatnonzero(self.section >= 0)

    @cached_property
    def count(self) -> Index:
        """Segments of each section."""
        return np.bincount(self.section[self.moving])

    @cached_property
    def first(self) -> Index:
        """First state of each section."""
        return self.moving[np.concatenate([[0], np.cumsum(self.count)[:-1]])]

    @cached_property
    def still(self) -> Mask:
        """Coordinates of states that are held there and in the same place in a state next to it, (n, m)."""
        held = self.lower == self.upper
        same = held[1:] & held[:-1] & (self.lower[1:] == self.lower[:-1])
        none = np.zeros((1, held.shape[1]), dtype=np.bool_)
        found: Mask = np.concatenate([same, none]) | np.concatenate([none, same])
        return found

    @cached_property
    def places(self) -> tuple[Index, Array]:
        """Segments and shares of them at which half-spaces hold: the states and places between."""
        shares = np.arange(self.parts) / self.parts
        ends = np.flatnonzero(np.append(self.section[:-1] != self.section[1:], True) & (self.section >= 0))
        ends = ends[np.append(self.section, -1)[ends + 1] < 0]  # before rests and at the end
        segment = np.concatenate([np.repeat(self.moving, len(shares)), ends])
        share = np.concatenate([np.tile(shares, len(self.moving)), np.ones(len(ends))])
        order = np.lexsort([share, segment])
        return segment[order], share[order]

    @cached_property
    def bend_row(self) -> Index:
        """Row of `bends` at the start of each moving segment; that at its end is the next, (n - 1,)."""
        row = np.zeros(len(self.section), dtype=np.int64)
        row[self.moving] = np.arange(len(self.moving)) + self.section[self.moving]
        return row

    def duration(self, spans: Array) -> float:
        """Of the whole motion [s]."""
        return float(self.count @ spans)


def bends(problem: LeastTimeProblem, timed: TimedStates) -> Array:
    """Return second derivatives of the splines by the share of a segment, section by section, (k, m)."""
    found = list[Array]()
    for first, count, span in zip(
        problem.first.tolist(), problem.count.tolist(), timed.spans.tolist(), strict=True
    ):
        change = np.diff(timed.states[first : first + count + 1], axis=0)
        begin, end = span * timed.rates[[first, first + count]]
        right = np.diff(np.concatenate([begin[None], change, end[None]]), axis=0)
        bands = np.full((3, count + 1), 1 / 6)
        bands[1] = 4 / 6
        bands[1, [0, -1]] = 2 / 6
        found.append(solve_banded((1, 1), bands, right))
    return np.concatenate(found)


def states_between(problem: LeastTimeProblem, timed: TimedStates, segment: Index, share: Array) -> Array:
    """Return states (p, m) at shares of segments."""
    bend, row, share = bends(problem, timed), problem.bend_row[segment], share[:, None]
    left, right = bend_weights(share)
    straight = (1 - share) * timed.states[segment] + share * timed.states[segment + 1]
    found: Array = straight + left * bend[row] + right * bend[row + 1]
    return found


def at_places(problem: LeastTimeProblem, timed: TimedStates) -> Array:
    """Return states in the places of half-spaces, (p, m)."""
    return states_between(problem, timed, *problem.places)


def bend_weights(share: Array) -> tuple[Array, Array]:
    """Return what second derivatives at both ends of a segment add at shares of it."""
    rest = 1 - share
    return (rest**3 - rest) / 6, (share**3 - share) / 6


def section_of_bend(problem: LeastTimeProblem) -> Index:
    """Return the section of each row of `bends`."""
    return np.repeat(np.arange(len(problem.count)), problem.count + 1)


def by_part(rates: Array) -> Array:
    """Return sizes of rates (n, m): of the base, by the polygon, of its heading and of joints, (n, m - 1)."""
    return np.column_stack([(rates[:, :2] @ WAYS.T).max(axis=1), np.abs(rates[:, 2:])])
