"""Shapes grown and shrunk by a disc lie on the side of the true ones that was asked for."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from regionik.planners.geometry.offsets import grown, shrunk
from tests import examples

NEAR = 1e-9
SHALLOW = 0.01  # of the distance: how deep bays may be that are filled


def blob(seed: int) -> shapely.Polygon:
    """A star, a disc with a dented rim or a room with bays, now and then with holes."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 90))
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
    dents = [rng.uniform(0.4, 1.0, count), 1.0 + rng.uniform(-0.02, 0.02, count), np.ones(count)]
    reach = dents[rng.integers(3)]
    shape = shapely.Polygon(np.column_stack([reach * np.cos(angles), reach * np.sin(angles)])).buffer(0)
    for _ in range(rng.integers(0, 3)):
        x, y = rng.uniform(-0.8, 0.8, 2)
        hole = shapely.Point(x, y).buffer(rng.uniform(0.02, 0.4), quad_segs=int(rng.integers(1, 24)))
        shape = shape.difference(hole)
    parts = [part for part in shapely.get_parts(shape) if part.geom_type == "Polygon"]
    return max(parts, key=lambda part: part.area)


def rim(shape: shapely.Geometry) -> np.ndarray:
    points: np.ndarray = shapely.points(shapely.get_coordinates(shape.boundary.segmentize(0.01)))
    return points


@settings(max_examples=examples(200))
@given(st.integers(0, 10**9), st.floats(0.01, 0.6))
def test_grown(seed: int, by: float) -> None:
    shape = blob(seed)
    more, less = grown(shape, by, outside=True), grown(shape, by, outside=False)
    assert shapely.distance(rim(more), shape).min() >= by - NEAR
    assert shapely.distance(rim(less), shape).max() <= by + NEAR
    assert shapely.distance(rim(more), shape).max() <= 1.02 * by
    # Holes that are left where there are none make it less still.
    shell = shapely.Polygon(less.exterior)
    assert shapely.distance(rim(shell), shape).min() >= (0.99 - SHALLOW) * by


# A corner so flat that GEOS leaves it out, and the arc of a hole that it fills four times as deep as others
@example(5555, 0.125)
@example(6818, 0.25)
@settings(max_examples=examples(200))
@given(st.integers(0, 10**9), st.floats(0.01, 0.3))
def test_shrunk(seed: int, by: float) -> None:
    shape = blob(seed)
    more, less = shrunk(shape, by, outside=True), shrunk(shape, by, outside=False)
    assert less.is_empty or more.buffer(NEAR).covers(less)
    if not less.is_empty:
        assert shapely.distance(rim(less), shape.boundary).min() >= by - NEAR
    if not more.is_empty:
        assert shapely.distance(rim(more), shape.boundary).max() <= by + NEAR
        assert shapely.distance(rim(more), shape.boundary).min() >= 0.8 * by
    places = np.random.default_rng(seed).uniform(-1, 1, (300, 2))
    spots = shapely.points(places[shapely.contains_xy(shape, *places.T)])
    room = shapely.distance(spots, shape.boundary)
    assert not shapely.covers(less, spots[room < by - NEAR]).any()
    assert shapely.covers(more, spots[room > by + NEAR]).all()


@pytest.mark.parametrize("seed", range(12))
def test_what_is_shrunk_is_a_hundredth_off_or_two(seed: int) -> None:
    shape, by = blob(seed), 0.15
    more, less = shrunk(shape, by, outside=True), shrunk(shape, by, outside=False)
    assert shapely.distance(rim(less), shape.boundary).max(initial=by) <= 1.02 * by
    assert shapely.distance(rim(more), shape.boundary).min(initial=by) >= (0.99 - SHALLOW) * by


def wavy(seed: int) -> shapely.Polygon:
    """A slab whose one side has waves, teeth, or one wide bay, seen from within or from outside."""
    rng = np.random.default_rng(seed)
    count, height = int(rng.integers(8, 200)), 10 ** rng.uniform(-5, -1.5)
    x = np.linspace(0, 3, count)
    sides = [
        np.sin(x * rng.uniform(1, 60)),
        rng.uniform(-1, 1, count),
        -np.sin(np.pi * x / 3),
        -1.0 * ((np.arange(count) // rng.integers(2, 9)) % 2),
    ]
    side = np.column_stack([x, height * sides[rng.integers(4)]])
    y, turn = rng.choice([-3.0, 3.0]), rng.uniform(0, 2 * np.pi)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    shape = shapely.Polygon(np.concatenate([side, [[3, y], [0, y]]]) @ R.T).buffer(0)
    return max(shapely.get_parts(shape), key=lambda part: part.area)


@example(155, 0.5)  # corners so flat that GEOS does not round them
@settings(max_examples=examples(200))
@given(st.integers(0, 10**9), st.floats(0.01, 0.6))
def test_wide_and_shallow_bays_are_on_the_side_that_was_asked_for(seed: int, by: float) -> None:
    _check_sides(wavy(seed), by)


def _check_sides(shape: shapely.Polygon, by: float) -> None:
    edge = shape.boundary
    for offset, outer in ((grown, True), (grown, False), (shrunk, True), (shrunk, False)):
        found = offset(shape, by, outside=outer)
        away = shapely.distance(rim(found), edge)
        if (offset is grown) == outer:
            assert away.min(initial=by) >= by - NEAR
            assert away.max(initial=by) <= 1.02 * by
        else:
            assert away.max(initial=by) <= by + NEAR
            assert away.min(initial=by) >= 0.8 * by


@pytest.mark.parametrize("outside", [True, False])
def test_a_room_without_corners_that_stand_out_is_shrunk_exactly(outside: bool) -> None:
    assert shrunk(shapely.box(0, 0, 3, 2), 0.5, outside=outside).equals(shapely.box(0.5, 0.5, 2.5, 1.5))
