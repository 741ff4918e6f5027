"""Polynomials meet what is asked of their ends, and their derivatives are derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.papers.polynomial import ORDERS, blend, polynomial
from regionik.worlds.errors import InputError
from tests import examples

numbers = st.floats(-5.0, 5.0)
ends = st.tuples(*[st.tuples(numbers, numbers)] * 6)


@settings(max_examples=examples(60))
@given(st.sampled_from(ORDERS), ends, st.floats(0.1, 20.0))
def test_ends_are_met(order: int, asked: tuple[tuple[float, float], ...], duration: float) -> None:
    q0, q1, v0, v1, a0, a1 = (np.array(pair) for pair in asked)
    a0, a1 = (a0 if order == 5 else np.zeros(2)), (a1 if order > 3 else np.zeros(2))
    first, last = (polynomial(order, q0, q1, duration, v0, v1, a0, a1).at(t) for t in (0.0, duration))
    rounding = 1e-8 * max(1.0, duration**2, 1.0 / duration**2)
    np.testing.assert_allclose((first.position, first.velocity), (q0, v0), rtol=1e-9, atol=rounding)
    np.testing.assert_allclose((last.position, last.velocity), (q1, v1), rtol=1e-9, atol=rounding)
    if order == 5:
        np.testing.assert_allclose(first.acceleration, a0, rtol=1e-9, atol=rounding)
    if order > 3:
        np.testing.assert_allclose(last.acceleration, a1, rtol=1e-9, atol=rounding)


@pytest.mark.parametrize("order", ORDERS)
def test_derivatives_against_differences(order: int) -> None:
    motion = polynomial(order, [0.2, -1.0], [1.0, 2.0], 3.0, [0.5, 0.0], [-0.1, 0.3])
    t, h = np.linspace(0.1, 2.9, 15), 1e-4
    before, now, after = (motion.at(t + step) for step in (-h, 0.0, h))
    assert now.position.shape == (15, 2)
    velocity = (after.position - before.position) / (2 * h)
    acceleration = (after.velocity - before.velocity) / (2 * h)
    np.testing.assert_allclose(now.velocity, velocity, atol=1e-6)
    np.testing.assert_allclose(now.acceleration, acceleration, atol=1e-6)


@pytest.mark.parametrize("order", ORDERS)
def test_blend_goes_from_rest_to_rest_and_never_back(order: int) -> None:
    b = blend(order, np.linspace(0.0, 1.0, 101))
    np.testing.assert_allclose((b.position[0], b.position[-1]), (0.0, 1.0), atol=1e-12)
    np.testing.assert_allclose((b.velocity[0], b.velocity[-1]), 0.0, atol=1e-12)
    assert (np.diff(b.position) > 0.0).all()
    if order > 3:
        assert abs(b.acceleration[-1]) < 1e-12
    assert (abs(b.acceleration[0]) < 1e-12) == (order == 5)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((2, 0.0, 1.0, 1.0), "order: expected one of 3, 4, 5, got 2"),
        ((3, 0.0, 1.0, 0.0), "duration: expected a time above 0"),
        ((3, 0.0, 1.0, np.nan), "duration: expected a time above 0"),
        ((3, np.inf, 1.0, 1.0), "start: expected finite numbers"),
        ((5, [0.0, 1.0], [1.0, 2.0, 3.0], 1.0), "expected ends of one shape"),
        ((4, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0), "start_acceleration: order 4 cannot meet it"),
        ((3, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0), "end_acceleration: order 3 cannot meet it"),
    ],
)
def test_what_cannot_be_is_refused(arguments: tuple[float, ...], words: str) -> None:
    with pytest.raises(InputError, match=words):
        polynomial(*arguments)  # type: ignore[arg-type]


def test_times_outside_are_refused() -> None:
    with pytest.raises(InputError, match=r"time: expected 0 to 2 s, got 2\.5"):
        polynomial(3, 0.0, 1.0, 2.0).at([1.0, 2.5])
