"""Tours: against every order, against dynamic programming, and a bound that no order breaks."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.csgraph import minimum_spanning_tree

from regionik.planners.coverage import tours
from regionik.planners.coverage.options import COVERAGE
from regionik.planners.coverage.tours import (
    _held_karp,
    _open_length,
    shortest_choice,
    shortest_order,
    shortest_tour_of_sets,
)
from tests import examples
from tests.maths import Array


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
    best = min(_open_length(way, far, lead, np.zeros(count)) for way in permutations(range(count)))
    assert found.length == pytest.approx(best)


def sets_of_points(seed: int, count: int) -> tuple[Array, Array, Array, Array]:
    """Distances of points, the set of each, and how far the points are from a start and from an end."""
    rng = np.random.default_rng(seed)
    owner = rng.permutation(np.concatenate([np.arange(count), rng.integers(0, count, rng.integers(0, 8))]))
    far = distances(rng.uniform(0, 1, (len(owner), 3)))
    return far, owner, rng.uniform(0, 1, len(owner)), rng.uniform(0, 1, len(owner))


def best_of_all(far: Array, owner: Array, lead: Array, tail: Array) -> float:
    """Length of the shortest tour of sets, of all orders and all choices."""
    members = [np.flatnonzero(owner == k).tolist() for k in range(int(owner.max()) + 1)]
    ways = (way for order in permutations(members) for way in product(*order))
    return min(_open_length(way, far, lead, tail) for way in ways)


@given(st.integers(0, 10**6), st.integers(1, 5))
@settings(max_examples=examples(40))
def test_no_order_of_few_sets_and_no_choice_is_shorter(seed: int, count: int) -> None:
    far, owner, lead, tail = sets_of_points(seed, count)
    found = shortest_tour_of_sets(far, owner, lead, tail)
    assert sorted(owner[list(found.order)]) == list(range(count))
    assert found.length == pytest.approx(_open_length(found.order, far, lead, tail))
    assert found.length == pytest.approx(best_of_all(far, owner, lead, tail))


@given(st.integers(0, 10**6))
@settings(max_examples=examples(10), deadline=None)
def test_order_and_choice_in_turns_come_near_the_best(seed: int) -> None:
    """The same sets, once exactly and once as more of them are done."""
    far, owner, lead, tail = sets_of_points(seed, 10)
    exact = shortest_tour_of_sets(far, owner, lead, tail).length
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tours, "COVERAGE", replace(COVERAGE, max_exact_order=7))
        found = shortest_tour_of_sets(far, owner, lead, tail)
    assert found.length == pytest.approx(_open_length(found.order, far, lead, tail))
    assert sorted(owner[list(found.order)]) == list(range(10))
    assert exact - 1e-9 <= found.length <= 1.5 * exact


@given(st.integers(0, 10**6), st.integers(1, 5))
@settings(max_examples=examples(40), deadline=None)
def test_no_other_choice_in_an_order_is_shorter(seed: int, count: int) -> None:
    far, owner, lead, tail = sets_of_points(seed, count)
    layers = [np.flatnonzero(owner == k) for k in range(count)]
    chosen = shortest_choice(far, layers, lead, tail)
    assert owner[chosen].tolist() == list(range(count))
    best = min(
        _open_length(list(some), far, lead, tail) for some in product(*(layer.tolist() for layer in layers))
    )
    assert _open_length(chosen, far, lead, tail) == pytest.approx(best)


@pytest.mark.parametrize("seed", range(3))
def test_local_search_is_within_a_percent_of_dynamic_programming(seed: int) -> None:
    rng = np.random.default_rng(seed)
    far = distances(rng.uniform(0, 1, (13, 2)))
    lead = rng.uniform(0, 1, 13) if seed % 2 else np.zeros(13)
    tail = np.zeros(13)
    best = _open_length(_held_karp(far, lead, tail), far, lead, tail)
    found = shortest_order(far, lead if seed % 2 else None)
    assert best - 1e-9 <= found.length <= 1.01 * best
    assert least_length(far, lead) <= best + 1e-9


def least_length(far: Array, lead: Array) -> float:
    """Lower bound of open tours: spanning trees under prices of the nodes (Held and Karp 1970).

    A tour with its start and an end at 1 m from all points is a tree, in which these two have one edge and
    each point two. So much as a node costs for every edge, a tour costs besides, and a tree may cost less.
    """
    n = len(far) + 2
    weights, asked = np.ones((n, n)), np.full(n, 2)
    weights[0, 1:-1], weights[1:-1, 1:-1] = 1 + lead, 1 + far
    asked[[0, -1]] = 1
    price, best, step = np.zeros(n), -np.inf, 0.02
    for _ in range(150):
        priced = weights + price + price[:, None]
        low = priced.min() - 1  # edges of no weight would count as none
        tree = minimum_spanning_tree(np.triu(priced - low, 1)).tocoo()
        best = max(best, float(tree.data.sum() + (n - 1) * (low - 1) - price @ asked))
        price += step * (np.bincount([*tree.row, *tree.col], minlength=n) - asked)
        step *= 0.97
    return best


@pytest.mark.parametrize(("count", "started"), [(60, True), (336, False)])
def test_long_tours_are_within_three_percent_of_a_bound(count: int, started: bool) -> None:
    rng = np.random.default_rng(count)
    far = distances(rng.uniform(0, 1, (count, 2)))
    lead = rng.uniform(0, 2, count) if started else np.zeros(count)
    found = shortest_order(far, lead)
    assert sorted(found.order) == list(range(count))
    least = least_length(far, lead)
    assert least <= found.length <= 1.03 * least


def test_a_grid_of_holes_is_done_row_by_row() -> None:
    """From hole to hole no step is shorter than the grid's, and some tour needs no longer one."""
    rows, columns = np.divmod(np.arange(245), 7)
    found = shortest_order(distances(0.025 * np.column_stack([rows, columns])))
    assert found.length == pytest.approx(244 * 0.025)
