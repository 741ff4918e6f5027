"""Tours: against every order, against dynamic programming, and bounds that no order breaks."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.planners.coverage.tours import _held_karp, _open_length, shortest_order
from regionik.worlds.arrays import Array
from tests import examples


def distances(points: Array) -> Array:
    far: Array = np.linalg.norm(points[:, None] - points[None], axis=2)
    return far


@given(st.integers(0, 10**6), st.integers(1, 6), st.booleans())
@settings(max_examples=examples(60))
def test_no_order_of_few_points_is_shorter(seed: int, count: int, started: bool) -> None:
    rng = np.random.default_rng(seed)
    far = distances(rng.uniform(0, 1, (count, 3)))
    lead = rng.uniform(0, 1, count) if started else np.zeros(count)
    found = shortest_order(far, lead if started else None)
    best = min(_open_length(way, far, lead) for way in permutations(range(count)))
    assert found.length == pytest.approx(best)
    assert found.lower == found.length


@pytest.mark.parametrize("seed", range(6))
def test_local_search_is_within_a_percent_of_dynamic_programming(seed: int) -> None:
    rng = np.random.default_rng(seed)
    far = distances(rng.uniform(0, 1, (13, 2)))
    lead = rng.uniform(0, 1, 13) if seed % 2 else np.zeros(13)
    best = _open_length(_held_karp(far, lead), far, lead)
    found = shortest_order(far, lead if seed % 2 else None)
    assert found.lower <= best + 1e-9
    assert best - 1e-9 <= found.length <= 1.01 * best


@pytest.mark.parametrize(("count", "started"), [(60, True), (336, False)])
def test_long_tours_are_within_three_percent_of_their_bound(count: int, started: bool) -> None:
    rng = np.random.default_rng(count)
    far = distances(rng.uniform(0, 1, (count, 2)))
    found = shortest_order(far, rng.uniform(0, 2, count) if started else None)
    assert sorted(found.order) == list(range(count))
    assert found.lower <= found.length <= 1.03 * found.lower


def test_a_grid_of_holes_is_done_row_by_row() -> None:
    """From hole to hole no step is shorter than the grid's, and some tour needs no longer one."""
    rows, columns = np.divmod(np.arange(245), 7)
    found = shortest_order(distances(0.025 * np.column_stack([rows, columns])))
    assert found.length == pytest.approx(244 * 0.025)
    assert found.lower == pytest.approx(found.length, rel=1e-3)
