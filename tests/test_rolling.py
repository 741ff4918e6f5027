"""The way of a base between two states: both readings of it agree with each other and with rolling wheels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.planners.driving.arcs import moved, rolling
from regionik.rolling import BULGE, cuts, on_way, sampled, trace, travel
from regionik.verification.motion import Journey
from regionik.worlds.arrays import Array
from regionik.worlds.robot import BaseKind
from tests.bodies import motion_through
from tests.plans import youbot

WHEELS: tuple[BaseKind, ...] = ("differential", "car")
turns = st.floats(-3.1, 3.1)
arcs = st.floats(-2.0, 2.0)
poses = st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-7, 7)).map(np.array)


def rolled(start: Array, length: float, turn: float, n: int = 2000) -> Array:
    """Poses of a base that rolls, from many small steps along the heading in the middle of each."""
    headings = start[2] + turn * (np.arange(n) + 0.5) / n
    steps = length / n * np.column_stack([np.cos(headings), np.sin(headings)])
    spots = start[:2] + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    return np.column_stack([spots, start[2] + turn * np.arange(n + 1) / n])


@pytest.mark.parametrize("kind", WHEELS)
@given(poses, arcs, turns)
def test_the_way_of_a_base_that_rolls(kind: BaseKind, start: Array, length: float, turn: float) -> None:
    way = rolled(start, length, turn)
    share = np.linspace(0, 1, len(way))
    np.testing.assert_allclose(on_way(kind, start, way[-1], share)[:, :2], way[:, :2], atol=1e-5)
    np.testing.assert_allclose(on_way(kind, start, way[-1], share)[:, 2], way[:, 2], atol=1e-9)
    assert travel(kind, way[[0, -1]]) == pytest.approx(abs(length), abs=1e-5)


@settings(deadline=None)  # the first call compiles
@given(poses, arcs, turns)
def test_lengths_come_back_from_where_they_lead(start: Array, length: float, turn: float) -> None:
    x, y, _ = moved(start[0], start[1], start[2], length, turn)
    found, *missed = rolling(start[0], start[1], start[2], x, y, turn)
    assert found == pytest.approx(length, abs=1e-12)
    assert np.abs(missed).max() < 1e-14 * (1 + np.abs(start).max())


@pytest.mark.parametrize("kind", ["omni", *WHEELS])
@given(st.integers(0, 10_000))
def test_what_plans_are_filled_in_with_is_what_verify_assumes(kind: BaseKind, seed: int) -> None:
    """Also where wheels would slip: the way ends where the next state stands."""
    rng = np.random.default_rng(seed)
    base = rng.uniform(-3, 3, (6, 3))
    base[3] = base[2]
    base[4, 2] = base[3, 2]
    journey = Journey(replace(youbot(), base=kind), motion_through(base, np.zeros((6, 5))))
    hop, s = np.repeat(np.arange(5), 7), np.tile(np.linspace(0, 1, 7), 5)
    found = on_way(kind, base[hop], base[hop + 1], s)
    np.testing.assert_allclose(journey.base(hop, s), found, atol=1e-12)
    np.testing.assert_allclose(found[6::7, :2], base[1:, :2], atol=1e-12)
    assert travel(kind, base) == pytest.approx(journey.length.sum())
    assert np.abs(np.cos(found[6::7, 2]) - np.cos(base[1:, 2])).max() < 1e-12


def test_an_omnidirectional_base_goes_straight_whatever_it_turns() -> None:
    way = on_way("omni", np.zeros(3), np.array([2.0, 1.0, 3.0]), np.linspace(0, 1, 5))
    np.testing.assert_allclose(way, np.outer(np.linspace(0, 1, 5), [2, 1, 3]), atol=1e-15)


def test_lines_through_the_cuts_stay_near_the_way() -> None:
    base = np.array([[0, 0, 0], [1, 1, np.pi / 2], [1, 2, np.pi / 2], [1, 2, 0.0], [1, 2, 0.0]])
    index = cuts("differential", base)
    assert np.isin(np.arange(5), index).all()
    np.testing.assert_allclose(sampled("differential", base, index)[np.isin(index, np.arange(5))], base)
    fine = on_way("differential", base[0], base[1], np.linspace(0, 1, 500))[:, :2]
    line = trace("differential", base)[: int(np.searchsorted(index, 1.0)) + 1]
    off = [np.abs(np.hypot(*(point - [0, 1])) - 1) for point in (line[:-1] + line[1:]) / 2]
    assert max(off) <= BULGE
    assert np.abs(np.hypot(*(fine - [0, 1]).T) - 1).max() < 1e-12
    assert len(index) < 40
    assert cuts("omni", base).tolist() == [0, 1, 2, 3, 4]
    assert trace("car", base[:1]).tolist() == [[0, 0]]
