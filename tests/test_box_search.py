"""Branch and bound over boxes: order, budget, verdicts; in Python as in a kernel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from regionik.planners.kernels import compiled
from regionik.planners.search.box_search import (
    JUDGED,
    NO_SIDE,
    Boxes,
    Verdict,
    begin,
    begin_in_kernel,
    both,
    explore,
    explore_in_kernel,
    left_open,
    proven,
    verdict_of,
)
from regionik.worlds.arrays import Index
from tests import examples
from tests.maths import Array

FINEST = 0.05
EVERY = 10**6
SEEDS = st.integers(0, 10_000)


class Ring(NamedTuple):
    """Points whose distance from the origin is in (near, far), to be found in boxes of the plane."""

    near: float
    far: float


@compiled
def judge(ring: Ring, low: Array, high: Array) -> tuple[Verdict, float, int]:
    """Proven where all of a box is in the ring; the widest box comes first."""
    least = most = 0.0
    for k in range(2):
        a, b = abs(low[k]), abs(high[k])
        least += 0.0 if low[k] <= 0.0 <= high[k] else min(a, b) ** 2
        most += max(a, b) ** 2
    width = high - low
    side = int(np.argmax(width))
    key = width[0] * width[1]
    if least > ring.far**2 or most < ring.near**2:
        return Verdict.RULED_OUT, key, NO_SIDE
    if least >= ring.near**2 and most <= ring.far**2:
        return Verdict.PROVEN, key, side
    return Verdict.OPEN, key, side if width[side] > FINEST else NO_SIDE


@compiled
def search(ring: Ring, low: Array, high: Array, budget: int, wanted: int) -> Boxes:
    boxes = begin_in_kernel(judge, ring, low, high)
    return explore_in_kernel(judge, ring, boxes, budget, wanted)


def square(half: float = 1.0, boxes: int = 1) -> tuple[Array, Array]:
    """So many slices of a square round the origin."""
    ends = np.linspace(-half, half, boxes + 1)
    sides = np.full(boxes, half)
    return np.column_stack([ends[:-1], -sides]), np.column_stack([ends[1:], sides])


def area(boxes: Boxes, slots: Index) -> float:
    return float((boxes.high[slots] - boxes.low[slots]).prod(1).sum())


@settings(max_examples=examples(30))
@given(st.floats(0.1, 0.6), st.floats(0.05, 0.4), st.integers(1, 5))
def test_proven_and_open_boxes_enclose_the_set(near: float, width: float, first: int) -> None:
    ring = Ring(near, near + width)
    boxes = search(ring, *square(boxes=first), EVERY, EVERY)
    exact = np.pi * (ring.far**2 - ring.near**2)
    inner, rest = area(boxes, proven(boxes)), area(boxes, left_open(boxes))
    assert inner <= exact <= inner + rest
    points = np.random.default_rng(first).uniform(-1, 1, (300, 2))
    away = np.linalg.norm(points, axis=1)
    for slots, ok in ((proven(boxes), True), (np.union1d(proven(boxes), left_open(boxes)), False)):
        off = np.maximum(boxes.low[slots, None] - points, points - boxes.high[slots, None])
        held: NDArray[np.bool_] = (off.max(2) <= 0.0).any(0)
        in_ring = (away >= ring.near) & (away <= ring.far)
        assert (in_ring[held] if ok else held[in_ring]).all()


@settings(max_examples=examples(20))
@given(SEEDS)
def test_python_and_kernel_agree(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ring = Ring(*sorted(rng.uniform(0, 1.4, 2)))
    budget, wanted = int(rng.integers(1, 400)), int(rng.integers(1, 40))
    one = search(ring, *square(), budget, wanted)
    other = explore(judge, ring, begin(judge, ring, *square()), budget, wanted)
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)
    assert verdict_of(one) == verdict_of(other)


@pytest.mark.parametrize("budget", [1, 2, 7, 200])
def test_no_box_is_bisected_after_the_budget(budget: int) -> None:
    boxes = search(Ring(0.5, 0.7), *square(), budget, EVERY)
    assert budget <= boxes.tally[JUDGED] <= budget + 1
    again = search(Ring(0.5, 0.7), *square(), 1, EVERY)
    for most in range(2, budget + 1):  # in steps it is the same search
        again = explore(judge, Ring(0.5, 0.7), again, most, EVERY)
    np.testing.assert_array_equal(boxes.low[left_open(boxes)], again.low[left_open(again)])


def test_verdicts() -> None:
    assert verdict_of(search(Ring(2.0, 3.0), *square(), EVERY, 1)) == Verdict.RULED_OUT
    assert verdict_of(search(Ring(0.5, 0.7), *square(), 1, 1)) == Verdict.OPEN
    assert verdict_of(search(Ring(0.5, 0.7), *square(), EVERY, 1)) == Verdict.PROVEN
    none = np.zeros((0, 2))
    assert verdict_of(begin(judge, Ring(0.0, 1.0), none, none)) == Verdict.RULED_OUT
    for a in Verdict:
        assert both(a, Verdict.PROVEN) == both(Verdict.PROVEN, a) == a
        assert both(a, Verdict.RULED_OUT) == Verdict.RULED_OUT
