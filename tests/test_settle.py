import sys
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon

from regionik.planners.reach.ringfloor import distances, inside, meets, on_circle, parts_of
from regionik.reach import FEWER, _decided, reach
from regionik.seeking.settle import OPEN, REACHED, is_covered, reasons, settled
from regionik.verification.answers import verify_answers
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.scene import Target
from tests.test_random_worlds import random_world

FLOOR = [
    Polygon([(0, 0), (4, 0), (4, 3), (0, 3)], [[(1, 1), (2, 1), (2, 2), (1, 2)]]),
    Polygon([(5, 0), (6, 0), (5.5, 3)]),
    shapely.Point(5, 5).buffer(0.7),
]
PARTS = parts_of(FLOOR)
SPOT = st.tuples(st.floats(-1, 7), st.floats(-1, 7))


@given(SPOT)
def test_inside_is_that_of_the_polygons(spot: tuple[float, float]) -> None:
    point, floor = shapely.Point(spot), shapely.MultiPolygon(FLOOR)
    if floor.boundary.distance(point) > 1e-9:
        assert inside(PARTS, *spot) == floor.contains(point)


@given(SPOT, st.floats(0.01, 10))
def test_distances_are_those_of_the_polygons(spot: tuple[float, float], far: float) -> None:
    low, high = np.empty(3), np.empty(3)
    distances(PARTS, *spot, far, low, high)
    for k, polygon in enumerate(FLOOR):
        least = polygon.distance(shapely.Point(spot))
        if abs(least - far) > 1e-9:
            assert low[k] == (pytest.approx(least, abs=1e-9) if least < far else np.inf)
        if least < far - 1e-9:
            corners = np.asarray(polygon.exterior.coords)
            assert high[k] == pytest.approx(np.hypot(*(corners - spot).T).max())


@given(SPOT, st.floats(0.01, 6), st.floats(0.01, 2))
def test_a_ring_meets_the_floor_where_its_polygon_does(
    spot: tuple[float, float], a: float, width: float
) -> None:
    low, high = np.empty(3), np.empty(3)
    distances(PARTS, *spot, a + width, low, high)
    center = shapely.Point(spot)
    floor = shapely.MultiPolygon(FLOOR)
    within = center.buffer(a + width, 256) - center.buffer(a / np.cos(np.pi / 512), 256)
    around = center.buffer((a + width) / np.cos(np.pi / 512) + 1e-9, 256) - center.buffer(a - 1e-9, 256)
    found = meets(low, high, a, a + width)
    assert found or not floor.intersects(within)
    assert not found or floor.intersects(around)


CORNER = (-5.3e-267, 0.05)  # a circle of 5 cm round it goes through a corner of the floor


@example(CORNER, 0.05)
@given(SPOT, st.floats(0.05, 6))
def test_places_on_a_circle_are_on_the_floor(spot: tuple[float, float], r: float) -> None:
    low, high, cuts, places = np.empty(3), np.empty(3), np.empty(512), np.empty((16, 2))
    distances(PARTS, *spot, r, low, high)
    count = on_circle(PARTS, *spot, r, cuts, places, 0)
    floor = shapely.MultiPolygon(FLOOR)
    assert shapely.distance(floor, shapely.points(places[:count])).max(initial=0.0) < 1e-9
    np.testing.assert_allclose(np.hypot(*(places[:count] - spot).T), r)
    if any(low[k] + 1e-3 < r < high[k] - 1e-3 for k in range(3)):
        assert count > 0


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 400))
def test_loops_and_single_answers_agree(seed: int) -> None:
    world = random_world(seed)
    spots = np.random.default_rng(seed).uniform([-1.5, -2.5, 0], [5, 2.5, 0.9], (6, 3))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys.modules["regionik.reach"], "MANY", 1)
        many = reach(world, spots)
    alone = _decided(world, [Target(spot) for spot in spots], FEWER)
    assert [one.verdict for one in alone] == many.verdict.tolist()
    assert verify_answers(world, many).ok


def test_a_thousand_at_once_are_as_one_by_one() -> None:
    world = load_world("l_shape")
    spots = np.random.default_rng(1).uniform([-1, -1.5, 0], [4.5, 2.5, 0.9], (1000, 3))
    found = settled(world, spots)
    assert (found.kind != OPEN).mean() > 0.98
    alone = [settled(world, spot[None]) for spot in spots[:50]]
    assert np.array_equal(np.concatenate([one.kind for one in alone]), found.kind[:50])
    assert np.array_equal(np.concatenate([one.base for one in alone]), found.base[:50], equal_nan=True)
    assert np.isfinite(found.joints[found.kind == REACHED]).all()
    assert np.isnan(found.joints[found.kind != REACHED]).all()
    assert {bool(why) for why in reasons(world, found.kind[found.kind == REACHED])} == {False}
    assert not settled(world, spots[:0]).kind.size


def test_a_heading_that_binds_the_pivot_is_left_to_others() -> None:
    world = load_world("l_shape")
    assert is_covered(world)
    assert not is_covered(replace(world, rules=replace(world.rules, heading="fixed")))
