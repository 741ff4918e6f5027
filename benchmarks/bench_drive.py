"""Base drives over random maps: time per query and length against the exact shortest path.

Run: python -m benchmarks.bench_drive
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely.geometry import Polygon

from regionik.planners.driving.greedy_steps import greedy_points
from regionik.planners.driving.point_planner import drive_point
from regionik.planners.geometry.polygons import FlatPolygon, segment_inside
from regionik.worlds.arrays import Array

MAPS, OBSTACLES, SIDE, STEP = 20, 30, 10.0, 0.1


def clutter(seed: int) -> Polygon:
    """The largest free part of a square room with boxes and discs, grown by a clearance of 0.2 m."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(1.2, SIDE - 1.2, (OBSTACLES, 2))
    sizes = rng.uniform(0.1, 0.8, (OBSTACLES, 2))
    boxes = shapely.box(*(centres - sizes).T, *(centres + sizes).T)
    discs = shapely.buffer(shapely.points(centres), sizes[:, 0])
    solids = np.where(rng.random(OBSTACLES) < 0.5, boxes, discs)
    free = shapely.box(0, 0, SIDE, SIDE) - shapely.union_all(shapely.buffer(solids, 0.2, quad_segs=4))
    parts = shapely.get_parts(free)
    part: Polygon = parts[np.argmax(shapely.area(parts))]
    return part


def length(points: Array) -> float:
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def shortest(free: Polygon, start: Array, goal: Array) -> float:
    """Exact: Dijkstra over all polygon vertices that see each other."""
    flat = FlatPolygon.from_shapely(free)
    nodes = np.vstack([start, goal, flat.vertices])
    n = len(nodes)
    pairs = [
        (i, j)
        for i in range(n)
        for j in range(i + 1, n)
        if segment_inside(flat.vertices, flat.starts, *nodes[i], *nodes[j])
    ]
    i, j = np.array(pairs).T
    graph = csr_array((np.hypot(*(nodes[i] - nodes[j]).T), (i, j)), shape=(n, n))
    return float(dijkstra(graph, directed=False, indices=0)[1])


def timed(function: Callable[..., Any], *args: Any, **kwargs: Any) -> tuple[Any, float]:
    """Return what a function returns, and the time that it took [ms]."""
    begin = time.perf_counter()
    answer = function(*args, **kwargs)
    return answer, 1e3 * (time.perf_counter() - begin)


def main() -> None:
    rows = []
    start, goal = np.array([0.1, 0.1]), np.array([9.9, 9.9])
    drive_point(clutter(0), start, goal, step=STEP)  # compiles
    for seed in range(MAPS):
        free = clutter(seed)
        flat = FlatPolygon.from_shapely(free)
        found, ms_drive = timed(drive_point, free, start, goal, step=STEP)
        _, ms_steps = timed(greedy_points, flat.vertices, flat.starts, *start, *goal, STEP)
        rows.append([ms_drive, ms_steps, length(found.points) / shortest(free, start, goal)])
    for name, column in zip(["drive", "Algorithm 2"], np.array(rows).T, strict=False):
        print(f"{name:>16}: median {np.median(column):7.2f} ms, worst {column.max():7.2f} ms")
    worst = np.array(rows)[:, 2]
    print(f"{'drive':>16}: length / shortest: median {np.median(worst):.3f}, worst {worst.max():.3f}")


if __name__ == "__main__":
    main()
