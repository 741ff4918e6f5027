"""The shortest path in a polygon, against all lines of sight and against paths pulled tight."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely import box
from shapely.geometry import Polygon

from regionik.planners.driving.point_planner import NoPathError, drive_point
from regionik.planners.geometry.polygons import FlatPolygon, segment_inside
from regionik.planners.geometry.shortest_paths import route, shorter_path
from regionik.worlds.arrays import Array

START, GOAL = np.array([0.05, 0.05]), np.array([5.95, 5.95])


def clutter(seed: int, count: int = 12) -> Polygon:
    """The largest free part of a room with turned boxes and discs of few corners."""
    rng = np.random.default_rng(seed)
    centres, sizes = rng.uniform(0.5, 5.5, (count, 2)), rng.uniform(0.1, 0.9, (count, 2))
    boxes = shapely.box(*(centres - sizes).T, *(centres + sizes).T)
    turned = [shapely.affinity.rotate(b, a) for b, a in zip(boxes, rng.uniform(0, 90, count), strict=True)]
    discs = shapely.buffer(shapely.points(centres), sizes[:, 0], quad_segs=2)
    free = box(0, 0, 6, 6) - shapely.union_all(np.where(rng.random(count) < 0.6, turned, discs))
    part: Polygon = max(shapely.get_parts(free), key=lambda p: p.area)
    return part


def length(path: Array) -> float:
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def by_sight(free: Polygon, start: Array, goal: Array) -> float:
    """Length of the shortest path by Dijkstra over all corners that see each other."""
    flat = FlatPolygon.from_shapely(free)
    nodes = np.vstack([start, goal, flat.vertices])
    seen = [
        (i, j)
        for i, j in combinations(range(len(nodes)), 2)
        if segment_inside(flat.vertices, flat.starts, *nodes[i], *nodes[j])
    ]
    i, j = np.array(seen).T
    graph = csr_array((np.hypot(*(nodes[i] - nodes[j]).T), (i, j)), shape=(len(nodes), len(nodes)))
    return float(dijkstra(graph, directed=False, indices=[0])[0, 1])


def cases() -> list[Polygon]:
    rooms = [clutter(seed) for seed in range(14)]
    return [room for room in rooms if room.buffer(1e-9).covers(shapely.MultiPoint([START, GOAL]))]


@pytest.mark.parametrize("free", cases())
def test_no_path_over_lines_of_sight_is_shorter(free: Polygon) -> None:
    known = route(free, START, GOAL)
    assert known is not None
    best = by_sight(free, START, GOAL)
    for bound in (np.inf, length(known) + 1e-6):
        path = shorter_path(free, START, GOAL, bound)
        assert path is not None
        assert length(path) == pytest.approx(best, abs=1e-9)
        np.testing.assert_array_equal(path[[0, -1]], [START, GOAL])
        flat = FlatPolygon.from_shapely(free)
        pairs = zip(path[:-1], path[1:], strict=True)
        assert all(segment_inside(flat.vertices, flat.starts, *p, *q) for p, q in pairs)
    assert shorter_path(free, START, GOAL, best - 1e-6) is None
    assert length(drive_point(free, START, GOAL, step=0.2, seed=3).points) >= best - 1e-9


@pytest.mark.parametrize("seed", range(8))
def test_drives_that_are_planned_are_the_shortest(seed: int) -> None:
    free = clutter(seed, 25)
    corners = shapely.get_coordinates(free.exterior)
    a, b = corners[np.argmin(corners.sum(axis=1))], corners[np.argmax(corners.sum(axis=1))]
    found = drive_point(free, a, b, step=0.3, seed=seed)
    if found.method in ("ompl", "triangles"):
        assert length(found.points) == pytest.approx(by_sight(free, a, b), abs=1e-9)


def test_the_other_way_round_is_seen() -> None:
    free = box(0, 0, 10, 4) - box(2, 0.5, 3, 3.9)
    start, goal = np.array([1.0, 1.5]), np.array([4.0, 1.5])
    above = length(np.array([start, [2, 3.9], [3, 3.9], goal]))
    path = shorter_path(free, start, goal, above)
    assert path is not None
    np.testing.assert_array_equal(path, [start, [2, 0.5], [3, 0.5], goal])


def test_ends_may_stand_on_corners_and_edges() -> None:
    free = box(0, 0, 3, 3) - box(1, 0, 2, 2)
    path = shorter_path(free, np.array([1.0, 1.0]), np.array([2.0, 2.0]), np.inf)
    assert path is not None
    np.testing.assert_array_equal(path, [[1, 1], [1, 2], [2, 2]])


def test_parts_that_do_not_join_have_no_path() -> None:
    with pytest.raises(NoPathError):
        drive_point(box(0, 0, 1, 1) | box(2, 0, 3, 1), [0.5, 0.5], [2.5, 0.5], step=0.1, seed=0)
