"""Triangles of polygons, routes through them against the exact shortest path, and paths cut to steps."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely import box
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.geometry.polygons import FlatPolygon, segment_inside
from regionik.planners.geometry.polylines import cut, spread_along
from regionik.planners.geometry.shortest_paths import route
from regionik.planners.geometry.triangulation import triangulate
from regionik.worlds.arrays import Array

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
def test_triangles_fill_the_area_edge_to_edge(seed: int, on_grid: bool) -> None:
    free = clutter(seed, on_grid)
    mesh = triangulate(free)
    a, b, c = (mesh.vertices[mesh.corners[:, k]] for k in range(3))
    areas = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(free.area, rel=1e-12)
    for t, k in zip(*np.nonzero(mesh.neighbours >= 0), strict=True):
        n = mesh.neighbours[t, k]
        shared = {mesh.corners[t, k], mesh.corners[t, (k + 1) % 3]}
        assert t in mesh.neighbours[n]
        assert shared <= set(mesh.corners[n])


def test_parts_that_touch_in_a_point_have_no_route() -> None:
    touching = MultiPolygon([box(0, 0, 1, 1), box(1, 1, 2, 2)])
    assert route(touching, [0.1, 0.1], [1.9, 1.9]) is None


@pytest.mark.parametrize(("seed", "on_grid"), MAPS)
def test_a_route_is_always_found_and_locally_shortest(seed: int, on_grid: bool) -> None:
    free = clutter(seed, on_grid)
    start, goal = ends(free, np.random.default_rng(seed))
    path = route(free, start, goal)
    assert path is not None
    assert stays_inside(free, path)
    best = length(shortest(free, start, goal))
    assert best - 1e-9 <= length(path) <= 1.5 * best
    for before, at, after in zip(path[:-2], path[1:-1], path[2:], strict=True):
        ways = [(end - at) / np.hypot(*(end - at)) for end in (before, after)]
        cut = np.array([at + 1e-4 * way for way in ways])
        assert not stays_inside(free, cut)  # no bend can be cut off


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
