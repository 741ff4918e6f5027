"""Algorithm 2: the paper's experiments, and the laws of its step area."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from shapely import box
from shapely.geometry import Polygon

from regionik.planners.driving.greedy_steps import greedy_points
from regionik.planners.geometry.polygons import FlatPolygon, clamp, segment_inside
from tests import examples
from tests.maths import Array

SQUARE = box(-0.5, -1.5, 3, 1.5) - box(1.0, -0.2, 1.6, 0.4).buffer(0.2)  # experiment 2
BLOCK = box(-0.5, -1.5, 3, 1.5) - box(1.175, -0.45, 1.425, 0.45).buffer(0.2)  # experiment 2b


def clutter(seed: int) -> Polygon:
    """Largest part of a 4 m room with ten obstacles."""
    rng = np.random.default_rng(seed)
    centres, sizes = rng.uniform(0.4, 3.6, (10, 2)), rng.uniform(0.05, 0.4, (10, 2))
    boxes = shapely.box(*(centres - sizes).T, *(centres + sizes).T)
    discs = shapely.buffer(shapely.points(centres), sizes[:, 0])
    free = box(0, 0, 4, 4) - shapely.union_all(np.where(rng.random(10) < 0.5, boxes, discs))
    part: Polygon = max(shapely.get_parts(free), key=lambda p: p.area)
    return part


class Steps(NamedTuple):
    points: Array
    arrived: bool


def step_to_goal(free: Polygon, start: ArrayLike, goal: ArrayLike, rho: float) -> Steps:
    flat = FlatPolygon.from_shapely(free)
    (x, y), (goal_x, goal_y) = clamp(flat.vertices, flat.starts, *np.asarray(start)), np.asarray(goal)
    return Steps(*greedy_points(flat.vertices, flat.starts, x, y, goal_x, goal_y, rho))


def legs_inside(free: Polygon, points: Array) -> bool:
    flat = FlatPolygon.from_shapely(free)
    return all(
        segment_inside(flat.vertices, flat.starts, *p, *q)
        for p, q in zip(points[:-1], points[1:], strict=True)
    )


def test_experiment_2_takes_three_intermediate_steps() -> None:
    steps = step_to_goal(SQUARE, (0.7896162428305282, 0.1585664255264057), (1.0723551929579735, -0.4), 0.25)
    assert steps.arrived
    expected = [[0.8, -0.0645], [0.8, -0.2586], [0.916, -0.4408]]
    np.testing.assert_allclose(steps.points[1:-1], expected, atol=2e-3)
    assert legs_inside(SQUARE, steps.points)


@pytest.mark.parametrize("rho", [0.10, 0.15, 0.20, 0.25, 0.30])
def test_experiment_2b_stalls_before_the_opposite_face(rho: float) -> None:
    steps = step_to_goal(BLOCK, (0.887, 0.044), (1.625, 0.033), rho)
    assert not steps.arrived
    np.testing.assert_allclose(steps.points[-1], [0.975, 0.033], atol=2e-3)
    assert legs_inside(BLOCK, steps.points)


@settings(max_examples=examples(60))
@given(
    seed=st.integers(0, 40), rho=st.floats(0.05, 1.0), ends=st.lists(st.floats(0, 4), min_size=4, max_size=4)
)
def test_steps_keep_rho_stay_inside_and_never_move_away(seed: int, rho: float, ends: list[float]) -> None:
    free = clutter(seed)
    flat = FlatPolygon.from_shapely(free)
    start, goal = (np.array(clamp(flat.vertices, flat.starts, *p)) for p in (ends[:2], ends[2:]))
    steps = step_to_goal(free, start, goal, rho)
    lengths = np.hypot(*np.diff(steps.points, axis=0).T)
    left = np.hypot(*(steps.points - goal).T)
    assert (lengths <= rho * (1 + 1e-12)).all()
    assert (np.diff(left) <= 1e-9).all()
    assert legs_inside(free, steps.points)
    np.testing.assert_allclose(steps.points[0], start, atol=1e-12)
    assert steps.arrived == (left[-1] == 0.0)


def test_a_goal_out_of_the_pocket_stalls_in_it() -> None:
    pocket = box(0, 0, 3, 3) - (box(1, 1, 2, 2) - box(1, 1.2, 1.8, 1.8))
    steps = step_to_goal(pocket, (1.5, 1.5), (2.5, 1.5), 0.2)
    assert not steps.arrived
    assert steps.points[-1][0] == pytest.approx(1.8)
