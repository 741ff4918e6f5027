"""Roadmap of areas by heading: an omnidirectional base drives in one slab and turns where two overlap."""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heappop, heappush
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from regionik.planners.driving.arcs import wrapped
from regionik.planners.driving.footprint_scene import FootprintScene, slide_is_free
from regionik.planners.driving.heading_slabs import Slab
from regionik.planners.driving.point_planner import drive_point
from regionik.worlds.arrays import Array

MARGIN = 1e-6  # from the edge of a slab's area, so that a path in it can be proven free [m]
FAR = 1e3  # longer than any leg of a path [m]

Node = tuple[int, int]  # slab, part of its area
Parts = NDArray[np.object_]


def path_through_slabs(
    scene: FootprintScene, areas: Sequence[Slab], start: Array, goal: Array, seed: int
) -> Array | None:
    """Poses (k, 3) from start to goal, driven inside slabs and turned where two overlap, or None."""
    graph = [polygon_parts(slab.inner.buffer(-MARGIN)) for slab in areas]
    entry, leave = (_entry(scene, areas, graph, pose) for pose in (start, goal))
    if entry is None or leave is None:
        return None
    (first, a), (last, b) = entry, leave
    route = _shortest_route(graph, first, last, a[:2])
    if route is None:
        return None
    poses = [start, a]
    for (k, part), to in zip(route, [*_turning_points(graph, route, a[:2]), b[:2]], strict=True):
        path = drive_point(graph[k][part], poses[-1][:2], to, step=FAR, seed=seed)
        poses += [np.array([*p, areas[k].middle]) for p in path.points]
    poses += [b, goal]
    kept = [p for k, p in enumerate(poses) if k == 0 or not np.array_equal(p, poses[k - 1])]
    return np.array(kept)


def polygon_parts(area: BaseGeometry) -> Parts:
    """Polygons of an area, without parts that have none."""
    found = shapely.get_parts(area)
    solid: Parts = found[shapely.area(found) > 0]
    return solid


def nodes_at(areas: Sequence[Slab], graph: Sequence[Parts], pose: Array) -> list[Node]:
    """Nodes whose slab and part hold a pose; at the border of slabs those of both."""
    return [
        (k, int(m))
        for k, slab in enumerate(areas)
        if abs(wrapped(pose[2] - slab.middle)) <= (slab.high - slab.low) / 2 + 1e-9
        for m in np.flatnonzero(shapely.distance(graph[k], Point(pose[:2])) <= 1e-9)
    ]


def connected(graph: Sequence[Parts], first: list[Node], last: list[Node]) -> bool:
    """True if overlapping areas of neighbouring slabs lead from one set of nodes to another."""
    seen, open_ = set(first), list(first)
    while open_:
        node = open_.pop()
        new = [other for other in _neighbours(graph, node) if other not in seen]
        seen.update(new)
        open_ += new
    return not seen.isdisjoint(last)


def _neighbours(graph: Sequence[Parts], node: Node) -> list[Node]:
    """Overlapping parts of the slabs on both sides."""
    k, part = node
    near = ((k - 1) % len(graph), (k + 1) % len(graph))
    return [(j, int(m)) for j in near for m in np.flatnonzero(shapely.intersects(graph[j], graph[k][part]))]


def _entry(
    scene: FootprintScene, areas: Sequence[Slab], graph: Sequence[Parts], pose: Array
) -> tuple[Node, Array] | None:
    """Node and nearest pose in the middle of a slab that a straight motion from a pose leads to, or None."""
    trials = []
    for k, slab in enumerate(areas):
        turn = float(wrapped(slab.middle - pose[2]))
        for part, area in enumerate(graph[k]):
            spot = shapely.shortest_line(area, Point(pose[:2])).coords[0]
            trials.append((np.hypot(*(spot - pose[:2])) + abs(turn), k, part, spot, pose[2] + turn))
    for _, k, part, spot, yaw in sorted(trials, key=lambda trial: trial[:3]):
        there = np.array([*spot, yaw])
        if slide_is_free(scene, pose, there):
            return (k, part), there
    return None


def _shortest_route(graph: Sequence[Parts], first: Node, last: Node, start: Array) -> list[Node] | None:
    """Nodes from first to last, greedily shortest between nearest points of overlaps (Dijkstra)."""
    heap: list[tuple[float, int, Node, tuple[float, float], Node | None]] = []
    heappush(heap, (0.0, 0, first, (float(start[0]), float(start[1])), None))
    came: dict[Node, Node | None] = {}
    count = 0
    while heap:
        cost, _, node, spot, before = heappop(heap)
        if node in came:
            continue
        came[node] = before
        if node == last:
            route = [node]
            while (back := came[route[-1]]) is not None:
                route.append(back)
            return route[::-1]
        for other in _neighbours(graph, node):
            if other not in came:
                to = _nearest_shared(graph, node, other, np.array(spot))
                count += 1
                # The turn counts a little, so that the base does not turn for nothing.
                far = cost + float(np.hypot(*(to - spot))) + 0.01
                heappush(heap, (far, count, other, (float(to[0]), float(to[1])), node))
    return None


def _turning_points(graph: Sequence[Parts], route: list[Node], start: Array) -> list[Array]:
    """Points (2,) at which the base turns from each node to the next."""
    points = [start]
    for node, other in pairwise(route):
        points.append(_nearest_shared(graph, node, other, points[-1]))
    return points[1:]


def _nearest_shared(graph: Sequence[Parts], node: Node, other: Node, spot: Array) -> Array:
    """Point of the overlap of two nodes that is nearest to a spot."""
    shared = shapely.intersection(graph[node[0]][node[1]], graph[other[0]][other[1]])
    return np.array(shapely.shortest_line(shared, Point(spot)).coords[0])
