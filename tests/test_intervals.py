"""Bounds over intervals hold for all that lies in them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from regionik.planners.search.box_search import (
    Verdict,
    interval_cos,
    interval_product,
    interval_sin,
    interval_square,
    opening,
    polar_angle,
    within_limits,
)

ANGLE = st.floats(-9, 9)
WIDTH = st.floats(0, 7)
NUMBER = st.floats(-3, 3)
SHARES = np.linspace(0, 1, 41)
ROUNDING = 1e-12


@given(ANGLE, WIDTH)
def test_cosines_and_sines(low: float, width: float) -> None:
    angles = low + width * SHARES
    for bound, values in ((interval_cos, np.cos(angles)), (interval_sin, np.sin(angles))):
        least, most = bound(low, low + width)
        assert least - ROUNDING <= values.min()
        assert values.max() <= most + ROUNDING
        assert -1.0 <= least <= most <= 1.0
        assert most - least <= width + 1e-9  # neither rises by more than its angle


@given(NUMBER, WIDTH, NUMBER, WIDTH)
def test_products_and_squares(a: float, wide: float, b: float, high: float) -> None:
    x, y = a + wide * SHARES, b + high * SHARES
    every = np.multiply.outer(x, y)
    low, top = interval_product(a, a + wide, b, b + high)
    assert low - 1e-9 <= every.min()
    assert every.max() <= top + 1e-9
    assert low == pytest.approx(every.min())
    assert top == pytest.approx(every.max())
    low, top = interval_square(a, a + wide)
    assert low - 1e-9 <= (x * x).min()
    assert top == pytest.approx((x * x).max())


@given(st.floats(0.05, 1), st.floats(0.05, 1), st.floats(0, 1), st.floats(0, 1))
def test_angles_of_triangles(own: float, other: float, one: float, two: float) -> None:
    least, most = abs(own - other) + 1e-6, own + other
    low, high = sorted((least + one * (most - least), least + two * (most - least)))
    third = low + (high - low) * SHARES
    angles = np.arccos(np.clip((own**2 + third**2 - other**2) / (2 * own * third), -1, 1))
    a, b = opening(own, other, low, high)
    assert a - 1e-7 <= angles.min()
    assert angles.max() <= b + 1e-7
    if own > other and low == least and high == most:
        assert b == pytest.approx(np.arcsin(other / own), abs=1e-6)


@given(NUMBER, WIDTH, NUMBER, WIDTH)
def test_directions_of_boxes(x: float, wide: float, y: float, high: float) -> None:
    low, top = polar_angle(x, x + wide, y, y + high)
    assert top - low <= 2 * np.pi
    for p in x + wide * SHARES[::8]:
        for q in y + high * SHARES[::8]:
            if np.hypot(p, q) > 1e-9:
                turns = np.arctan2(q, p) + 2 * np.pi * np.arange(-1, 2)
                assert ((low - 1e-9 <= turns) & (turns <= top + 1e-9)).any()


@given(ANGLE, st.floats(0, 3), st.floats(-4, 0), st.floats(0, 4))
def test_limits_are_kept_by_all_by_none_or_by_some(
    low: float, width: float, lower: float, upper: float
) -> None:
    angles = np.add.outer(low + width * SHARES, 2 * np.pi * np.arange(-4, 5))
    keep = ((angles >= lower - ROUNDING) & (angles <= upper + ROUNDING)).any(axis=1)
    verdict = within_limits(low, low + width, lower, upper, 1e-10)
    if verdict == Verdict.PROVEN:
        assert keep.all()
    if verdict == Verdict.RULED_OUT:
        assert not keep.any()
    assert within_limits(low, low + width, -np.inf, np.inf, 0.0) == Verdict.PROVEN
