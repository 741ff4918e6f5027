"""The lattice of poses: its moves are what a base drives, and values relax to least costs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from regionik.planners.driving.arcs import path_of_motions
from regionik.planners.driving.pose_lattice import HEADINGS, LatticeMove, car_moves, relax, spin_moves
from regionik.planners.driving.reeds_shepp import words_between
from tests.maths import Array, wrap

CELL, RADIUS, WEIGHT = 0.05, 0.4, 0.3
SIDE = 5  # cells of a small grid


def both() -> list[tuple[LatticeMove, ...]]:
    return [spin_moves(CELL, WEIGHT), car_moves(CELL, RADIUS)]


def ends(move: LatticeMove) -> tuple[Array, Array]:
    here = np.array([0.0, 0.0, HEADINGS[move.start]])
    return here, np.array([CELL * move.dx, CELL * move.dy, HEADINGS[move.end]])


def test_a_base_that_spins_goes_along_its_heading_or_turns() -> None:
    for move in spin_moves(CELL, WEIGHT):
        here, there = ends(move)
        far, turn = np.hypot(*there[:2]), wrap(there[2] - here[2])
        assert far == 0.0 or turn == 0.0
        assert move.cost == pytest.approx(far + WEIGHT * abs(turn))
        across = there[1] * np.cos(here[2]) - there[0] * np.sin(here[2])
        assert across == pytest.approx(0.0, abs=1e-12)


def test_a_car_drives_its_moves_in_one_direction() -> None:
    moves = car_moves(CELL, RADIUS)
    assert all(any(move.start == k != move.end for move in moves) for k in range(len(HEADINGS)))
    for move in moves:
        here, there = ends(move)
        words, lengths = words_between(here, there, RADIUS)
        assert move.cost == pytest.approx(lengths[0], abs=1e-9)
        assert (words[0][:, 0] >= 0).all() or (words[0][:, 0] <= 0).all()
        assert path_of_motions(here, words[0], "straight").end[:2] == pytest.approx(there[:2], abs=1e-8)


@pytest.mark.parametrize("moves", both())
def test_every_move_can_be_taken_back(moves: tuple[LatticeMove, ...]) -> None:
    known = {move[:4]: move.cost for move in moves}
    for start, end, dx, dy, cost in moves:
        assert known[(end, start, -dx, -dy)] == pytest.approx(cost)


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 10**6), spins=st.booleans())
def test_values_relax_to_the_least_costs_of_the_graph(seed: int, spins: bool) -> None:
    rng, moves = np.random.default_rng(seed), spin_moves(CELL, WEIGHT) if spins else car_moves(CELL, 0.12)
    shape = (len(HEADINGS), SIDE, SIDE)
    free = rng.random(shape) < 0.7
    value = np.where(free & (rng.random(shape) < 0.1), rng.uniform(0, 2, shape), np.inf)
    wanted = least_costs(value, free, moves)
    relax(value, free, moves)
    np.testing.assert_allclose(value, wanted, atol=1e-8)


def least_costs(value: Array, free: np.ndarray, moves: tuple[LatticeMove, ...]) -> Array:
    """Dijkstra's algorithm from a sink that every value is the way to."""
    number = np.arange(value.size).reshape(value.shape)
    rows, columns, costs = [], [], []
    for start, end, dx, dy, cost in moves:
        for x, y in np.ndindex(SIDE, SIDE):
            p, q = x + dx, y + dy
            if 0 <= p < SIDE and 0 <= q < SIDE and free[start, x, y] and free[end, p, q]:
                rows.append(number[end, p, q])
                columns.append(number[start, x, y])
                costs.append(cost)
    given_ = np.flatnonzero(np.isfinite(value))
    rows += [value.size] * len(given_)
    columns += given_.tolist()
    costs += value.flat[given_].tolist()
    graph = csr_array((costs, (rows, columns)), shape=(value.size + 1,) * 2)
    found: Array = dijkstra(graph, indices=value.size)[:-1].reshape(value.shape)
    return found
