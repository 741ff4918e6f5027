"""The tree of edges answers as the edges do when they are asked one by one."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.planners.geometry import flat
from regionik.planners.geometry.edgetree import LEAF, clamp, likely, nearest, tree_of
from regionik.planners.geometry.flat import FlatPolygon
from tests.test_flat import random_area

ROOM = shapely.box(0, 0, 4, 4) - shapely.box(1, 1, 2, 2)
AREAS = {
    "a room with bays, holes and parts": random_area(0),
    "another": random_area(1),
    "a triangle, fewer edges than a leaf": shapely.Polygon([(0, 0), (2, 0), (0, 2)]),
    "two parts and a hole": shapely.MultiPolygon([ROOM, shapely.box(5, 0, 6, 1)]),
    "many short edges": shapely.Point(2, 2).buffer(2, quad_segs=200),
}


@pytest.mark.parametrize("area", AREAS.values(), ids=AREAS)
def test_answers_are_those_of_all_edges_wherever_the_search_begins(area: BaseGeometry) -> None:
    polygon, rng = FlatPolygon.from_shapely(area), np.random.default_rng(0)
    tree = tree_of(polygon.vertices, polygon.starts)
    drawn = rng.uniform(-1, 11, (400, 2))
    middles = tree.edges.reshape(-1, 2, 2).mean(axis=1)
    for x, y in np.vstack([drawn, polygon.vertices, middles, np.round(drawn)]).tolist():
        begins = likely(tree, x, y), int(rng.integers(len(tree.edges)))
        held = [clamp(tree, x, y, edge)[:2] for edge in begins]
        assert held == [flat.clamp(polygon.vertices, polygon.starts, x, y)] * 2
        near = {nearest(tree, x, y, edge) for edge in begins}
        assert len(near) == 1
        assert near.pop()[:2] == flat.nearest(polygon.vertices, polygon.starts, x, y)


@pytest.mark.parametrize("area", AREAS.values(), ids=AREAS)
def test_every_box_holds_the_edges_below_it(area: BaseGeometry) -> None:
    polygon = FlatPolygon.from_shapely(area)
    edges, boxes = tree_of(polygon.vertices, polygon.starts)
    leaves = len(boxes) // 2
    assert leaves * LEAF >= len(edges) == len(polygon.vertices)
    for k, (ax, ay, bx, by) in enumerate(edges):
        i = leaves + k // LEAF
        while i > 0:
            low, high = boxes[i, :2], boxes[i, 2:]
            assert (low <= [min(ax, bx), min(ay, by)]).all()
            assert (high >= [max(ax, bx), max(ay, by)]).all()
            i //= 2
    np.testing.assert_array_equal(boxes[1], shapely.bounds(area))


def test_the_edge_nearest_a_place_is_where_the_next_search_begins() -> None:
    polygon = FlatPolygon.from_shapely(ROOM)
    tree = tree_of(polygon.vertices, polygon.starts)
    x, y, edge = clamp(tree, 5.0, 3.0, 0)
    assert (x, y) == (4.0, 3.0)
    assert set(tree.edges[edge, ::2]) == {4.0}
    assert clamp(tree, 3.0, 3.0, edge) == (3.0, 3.0, edge)
