"""Shortest paths in polygons, against all lines of sight; paths cut to steps."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely import box
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.driving.point_planner import drive_point
from regionik.planners.geometry.polygons import FlatPolygon, segment_inside
from regionik.planners.geometry.polylines import cut, spread_along
from regionik.planners.geometry.shortest_paths import shortest_path
from tests.maths import Array

SIDE, OBSTACLES = 10.0, 30


def clutter(seed: int, on_grid: bool = False) -> Polygon:
    """Largest free part of a room with 30 obstacles; on a grid they touch, align and share corners."""
    rng = np.random.default_rng(seed)
    centres, sizes = rng.uniform(0, SIDE, (OBSTACLES, 2)), rng.uniform(0.2, 0.7, (OBSTACLES, 2))
    if on_grid:
        centres, sizes = np.round(2 * centres) / 2, np.round(4 * sizes) / 4
    boxes = shapely.box(*(centres - sizes).T, *(centres + sizes).T)
    discs = shapely.buffer(shapely.points(centres), sizes[:, 0], quad_segs=3)
    solids = np.where((rng.random(OBSTACLES) < 0.5) & (not on_grid), discs, boxes)
    free = box(0, 0, SIDE, SIDE) - shapely.union_all(solids)
    part: Polygon = max(shapely.get_parts(free), key=lambda p: p.area)
    return part


MAPS = [(seed, on_grid) for on_grid in (False, True) for seed in range(8)]


def length(points: Array) -> float:
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def shortest(free: Polygon, start: Array, goal: Array) -> Array:
    """Dijkstra over all vertices that see each other, by shapely: slow, plain and exact."""
    nodes = np.vstack([start, goal, np.unique(shapely.get_coordinates(free), axis=0)])
    i, j = np.triu_indices(len(nodes), k=1)
    grown = free.buffer(1e-9, join_style="mitre")
    shapely.prepare(grown)
    seen = shapely.covers(grown, shapely.linestrings(np.stack([nodes[i], nodes[j]], axis=1)))
    i, j = i[seen], j[seen]
    graph = csr_array((np.hypot(*(nodes[i] - nodes[j]).T), (i, j)), shape=(len(nodes), len(nodes)))
    came = dijkstra(graph, directed=False, indices=[0], return_predecessors=True)[1][0]
    chain = [1]
    while chain[-1] != 0:
        chain.append(int(came[chain[-1]]))
    return nodes[chain[::-1]]


def ends(free: Polygon, rng: np.random.Generator) -> tuple[Array, Array]:
    """Two points inside, far apart."""
    points = rng.uniform(0, SIDE, (200, 2))
    points = points[shapely.contains_xy(free, *points.T)]
    return points[np.argmin(points.sum(axis=1))], points[np.argmax(points.sum(axis=1))]


def stays_inside(free: Polygon | MultiPolygon, points: Array) -> bool:
    flat = FlatPolygon.from_shapely(free)
    return all(
        segment_inside(flat.vertices, flat.starts, *p, *q)
        for p, q in zip(points[:-1], points[1:], strict=True)
    )


@pytest.mark.parametrize(("seed", "on_grid"), MAPS)
def test_no_path_over_lines_of_sight_is_shorter(seed: int, on_grid: bool) -> None:
    free = clutter(seed, on_grid)
    start, goal = ends(free, np.random.default_rng(seed))
    best = shortest(free, start, goal)
    path = shortest_path(free, start, goal)
    back = shortest_path(free, goal, start)
    assert path is not None
    assert back is not None
    assert length(path) == pytest.approx(length(best), abs=1e-9)
    assert length(back) == pytest.approx(length(best), abs=1e-9)
    np.testing.assert_array_equal(path[[0, -1]], [start, goal])
    assert stays_inside(free, path)
    driven = drive_point(free, start, goal, step=0.2)
    assert length(driven.points) >= length(best) - 1e-9
    assert driven.method == "steps" or length(driven.points) == pytest.approx(length(best), abs=1e-9)


def test_the_shorter_way_round_is_taken() -> None:
    free = box(0, 0, 10, 4) - box(2, 0.5, 3, 3.9)
    start, goal = np.array([1.0, 1.5]), np.array([4.0, 1.5])
    path = shortest_path(free, start, goal)
    assert path is not None
    np.testing.assert_array_equal(path, [start, [2, 0.5], [3, 0.5], goal])


def test_ends_may_stand_on_corners_and_edges() -> None:
    free = box(0, 0, 3, 3) - box(1, 0, 2, 2)
    path = shortest_path(free, np.array([1.0, 1.0]), np.array([2.0, 2.0]))
    assert path is not None
    np.testing.assert_array_equal(path, [[1, 1], [1, 2], [2, 2]])
    for off in (0.0, 1e-12, -1e-12, 1e-16, -1e-16):
        path = shortest_path(free, np.array([1 + off, 0.5]), np.array([2 - off, 0.5]))
        assert path is not None
        assert length(path) == pytest.approx(4.0, abs=1e-9)


def test_parts_that_do_not_join_have_no_path() -> None:
    apart = MultiPolygon([box(0, 0, 1, 1), box(2, 0, 3, 1)])
    assert shortest_path(apart, np.array([0.5, 0.5]), np.array([2.5, 0.5])) is None
    touching = MultiPolygon([box(0, 0, 1, 1), box(1, 1, 2, 2)])
    assert shortest_path(touching, np.array([0.5, 0.1]), np.array([1.9, 1.5])) is None


def test_a_path_may_touch_hundreds_of_corners() -> None:
    """A wall of teeth, hundreds of which the path touches."""
    teeth = [(0.002 * k, 0.5 - 0.4 * (k % 2)) for k in range(1501)]
    free = Polygon([*teeth, (3.0, 1.0), (0.0, 1.0)])
    path = shortest_path(free, np.array([0.002, 0.2]), np.array([2.998, 0.2]))
    assert path is not None
    assert length(path) == pytest.approx(2.992 + 2 * np.hypot(0.002, 0.3), abs=1e-9)


def test_cutting_keeps_points_and_bounds_legs() -> None:
    path = np.array([[0.0, 0.0], [0.3, 0.0], [0.3, 1.0], [0.3, 1.0]])
    dense = cut(path, 0.1)
    assert (np.hypot(*np.diff(dense, axis=0).T) <= 0.1 + 1e-9).all()
    assert len(dense) == 1 + 3 + 10 + 1
    assert all((dense == p).all(axis=1).any() for p in path)
    assert length(dense) == pytest.approx(length(path))


@pytest.mark.parametrize(("step", "parts"), [(0.3, 1), (0.3, 40), (5.0, 7), (5.0, 1)])
def test_shares_along_a_path_cut_it_to_steps_and_parts(step: float, parts: int) -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.75], [0.5, 0.75]])
    line = shapely.LineString(path)
    shares, places = spread_along(path, step, parts)
    all_shares = np.concatenate([[0.0], shares, [1.0]])
    assert (np.diff(all_shares) > 0).all()
    assert np.diff(all_shares).max() <= min(step / line.length, 1 / parts) + 1e-12
    np.testing.assert_allclose(places, shapely.get_coordinates(line.interpolate(shares, normalized=True)))
    assert all(np.abs(shares - corner / 2.25).min() < 1e-12 for corner in (1.0, 1.75))


def test_a_path_of_no_length_is_cut_to_parts_alone() -> None:
    shares, places = spread_along(np.ones((2, 2)), 0.1, 4)
    assert shares.tolist() == [0.25, 0.5, 0.75]
    assert (places == 1.0).all()
