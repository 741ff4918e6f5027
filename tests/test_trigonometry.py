"""Polynomial sines and arctangents against numpy's in extended precision."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from regionik.planners.geometry.trigonometry import LARGEST, cosine_sine, direction, turned
from regionik.planners.solvers.passes import fast
from regionik.worlds.arrays import Array

NUMBERS = st.floats(-1e100, 1e100)
FINE = 4 * np.finfo(np.float64).eps


@fast
def _turned_all(angles: Array, c: Array, s: Array) -> None:
    for k in range(len(angles)):
        c[k], s[k] = cosine_sine(angles[k])


@pytest.mark.parametrize("largest", [1e-9, 1.0, 10.0, 1e3, LARGEST])
def test_cosine_and_sine_to_the_last_digits(largest: float) -> None:
    angles = np.random.default_rng(0).uniform(-largest, largest, 20_000)
    c, s = np.empty_like(angles), np.empty_like(angles)
    _turned_all(angles, c, s)
    exact = angles.astype(np.longdouble)
    assert np.abs(c - np.cos(exact)).max() <= 2e-16
    assert np.abs(s / np.sin(exact) - 1).max() <= FINE


@pytest.mark.parametrize("quarter", range(-8, 9))
def test_quarters_of_a_turn(quarter: int) -> None:
    angle = quarter * np.pi / 2
    assert cosine_sine(angle) == pytest.approx((np.cos(angle), np.sin(angle)), abs=1e-16)


@pytest.mark.parametrize("angle", [0.0, 3.0, LARGEST, -2 * LARGEST, 1e17, 1e300])
def test_any_angle_can_be_turned_by(angle: float) -> None:
    assert turned(angle) == pytest.approx((np.cos(angle), np.sin(angle)), abs=1e-15)


@given(NUMBERS, NUMBERS)
def test_directions_are_those_of_arctan2(y: float, x: float) -> None:
    y, x = y + 0.0, x + 0.0  # zeros have no sign here
    assert direction(y, x) == pytest.approx(np.arctan2(y, x), rel=FINE, abs=1e-300)


@given(st.floats(-np.pi, np.pi))
def test_there_and_back(angle: float) -> None:
    c, s = cosine_sine(angle)
    assert abs(np.angle(np.exp(1j * (direction(s, c) - angle)))) <= FINE
