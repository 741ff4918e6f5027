"""String pulling: against the exact shortest path, and by its laws on random detours."""

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
from regionik.planners.geometry.shortest_paths import route, tighten
from regionik.planners.geometry.triangulation import Triangulation, triangulate
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError

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


def ramble(mesh: Triangulation, rng: np.random.Generator) -> Array:
    """A detour through triangle after triangle, through corners and edge middles, back and forth."""
    t = int(rng.integers(len(mesh.corners)))
    points = []
    for _ in range(40):
        points.append(rng.dirichlet([1, 1, 1]) @ mesh.vertices[mesh.corners[t]])
        open_edges = np.flatnonzero(mesh.neighbours[t] >= 0)
        if not len(open_edges):
            break
        k = rng.choice(open_edges)
        p, q = mesh.vertices[mesh.corners[t, k]], mesh.vertices[mesh.corners[t, (k + 1) % 3]]
        points.append(p + rng.choice([0.0, 0.3, 0.5, 1.0]) * (q - p))
        t = int(mesh.neighbours[t, k])
    return np.array(points)


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


@pytest.mark.parametrize(("seed", "on_grid"), MAPS)
def test_a_path_of_the_shortest_class_becomes_the_shortest_path(seed: int, on_grid: bool) -> None:
    free = clutter(seed, on_grid)
    rng = np.random.default_rng(seed)
    start, goal = ends(free, rng)
    best = shortest(free, start, goal)
    # A detour in the same class: every bend is pushed off and every leg bulged, as far as there is room.
    flat = FlatPolygon.from_shapely(free)
    path = cut(best, 0.5)
    detour = path.copy()
    for k in range(1, len(path) - 1):
        for reach in (0.3, 0.1, 0.03, 0.01, 0.003):
            x = path[k] + rng.normal(0, reach, 2)
            corners = np.array([detour[k - 1], x, path[k + 1]])
            swept = Polygon([detour[k - 1], x, path[k + 1], path[k]]).buffer(0)
            if stays_inside(free, corners) and swept.difference(free).area < 1e-12:
                detour[k] = x
                break
    assert length(detour) > length(best) + 0.01
    tight = tighten(free, detour)
    assert length(tight) == pytest.approx(length(best), abs=1e-9)
    assert all(
        segment_inside(flat.vertices, flat.starts, *p, *q) for p, q in zip(tight[:-1], tight[1:], strict=True)
    )


@pytest.mark.parametrize(("seed", "on_grid"), MAPS)
def test_laws_of_pulling(seed: int, on_grid: bool) -> None:
    free = clutter(seed, on_grid)
    mesh = triangulate(free)
    rng = np.random.default_rng(seed)
    for _ in range(4):
        path = ramble(mesh, rng)
        tight = tighten(free, path)
        assert stays_inside(free, tight)
        assert length(tight) <= length(path) + 1e-12
        np.testing.assert_array_equal(tight[[0, -1]], path[[0, -1]])
        for same in (tight, cut(path, 0.05), path[::-1], np.repeat(path, 2, axis=0)):
            assert length(tighten(free, same)) == pytest.approx(length(tight), abs=1e-9)
        there_and_back = tighten(free, np.vstack([path, path[::-1]]))
        assert length(there_and_back) == pytest.approx(0.0, abs=1e-9)


def test_the_side_on_which_an_obstacle_is_passed_is_kept() -> None:
    room = box(0, 0, 3, 3) - box(1, 1, 2, 2)
    above = tighten(room, [[0.5, 1.4], [0.5, 2.5], [2.5, 2.5], [2.5, 1.4]])
    below = tighten(room, [[0.5, 1.4], [0.5, 0.5], [2.5, 0.5], [2.5, 1.4]])
    np.testing.assert_array_equal(above, [[0.5, 1.4], [1, 2], [2, 2], [2.5, 1.4]])
    np.testing.assert_array_equal(below, [[0.5, 1.4], [1, 1], [2, 1], [2.5, 1.4]])
    round_once = tighten(room, [[0.5, 1.4], [0.5, 2.5], [2.5, 2.5], [2.5, 0.5], [0.5, 0.5], [0.5, 1.4]])
    assert len(round_once) == 6
    assert length(round_once) == pytest.approx(3 + np.hypot(0.5, 0.6) + np.hypot(0.5, 0.4))


def test_ends_on_the_boundary_up_to_rounding() -> None:
    room = box(0, 0, 3, 3) - box(1, 0, 2, 2)
    for off in (0.0, 1e-12, -1e-12, 1e-16, -1e-16):
        tight = tighten(room, [[1 + off, 0.5], [0.5, 2.5], [2.5, 2.5], [2 - off, 0.5]])
        assert length(tight) == pytest.approx(4.0, abs=1e-9)
        along_the_wall = tighten(room, [[off, 0.1], [off, 1.5], [off, 2.9]])
        assert length(along_the_wall) == pytest.approx(2.8)
    corners = tighten(room, [[1, 0], [1, 2], [2, 2], [2, 0]])
    np.testing.assert_array_equal(corners, [[1, 0], [1, 2], [2, 2], [2, 0]])


def test_parts_that_touch_in_a_point_hold_the_string_there() -> None:
    touching = MultiPolygon([box(0, 0, 1, 1), box(1, 1, 2, 2)])
    tight = tighten(touching, [[0.1, 0.1], [0.9, 0.2], [1.0, 1.0], [1.2, 1.9], [1.9, 1.9]])
    assert length(tight) == pytest.approx(1.8 * np.sqrt(2))
    assert stays_inside(touching, tight)
    assert route(touching, [0.1, 0.1], [1.9, 1.9]) is None


def test_a_path_that_leaves_is_refused() -> None:
    with pytest.raises(InputError, match="leg 1 from"):
        tighten(box(0, 0, 1, 1), [[0.1, 0.1], [0.2, 0.1], [2, 0.1]])


@pytest.mark.parametrize("count", [1, 2])
def test_short_paths_stay(count: int) -> None:
    path = np.full((count, 2), 0.25)
    assert length(tighten(box(0, 0, 1, 1), path)) == 0.0


@pytest.mark.parametrize(("seed", "on_grid"), MAPS)
def test_a_route_is_always_found_and_locally_shortest(seed: int, on_grid: bool) -> None:
    free = clutter(seed, on_grid)
    start, goal = ends(free, np.random.default_rng(seed))
    path = route(free, start, goal)
    assert path is not None
    assert stays_inside(free, path)
    best = length(shortest(free, start, goal))
    assert best - 1e-9 <= length(path) <= 1.5 * best
    assert length(tighten(free, path)) == pytest.approx(length(path), abs=1e-9)


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
