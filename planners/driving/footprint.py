"""A convex footprint among walls and obstacles: poses that are free, and whole motions proven free.

The proof splits a motion in time (conservative bounds by subdivision). Over a short time every point of the
footprint stays near the chord of its path: all it sweeps lies in the hull of the footprint at both ends,
grown by how far the paths bulge, which falls with the square of the time. A gap of a micrometre is passed in
steps of a milliradian.
"""

from __future__ import annotations

import math

import numpy as np

from regionik.planners.driving.arcs import arc_end
from regionik.planners.driving.footprint_scene import FootprintScene, UpperOutlines
from regionik.planners.geometry.angles import wrap
from regionik.planners.geometry.polygons import contains, nearest_on_segment
from regionik.planners.geometry.vectors import squared
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array

MAX_HALVINGS = 16  # halvings of a motion, after which it counts as blocked


@compiled
def _cross(o: Array, a: Array, x: float, y: float) -> float:
    """Cross product of o -> a and o -> (x, y)."""
    return float((a[0] - o[0]) * (y - o[1]) - (a[1] - o[1]) * (x - o[0]))


@compiled
def _hull(points: Array) -> Array:
    """Corners of the convex hull, counter-clockwise (Andrew's monotone chain, 1979)."""
    n = len(points)
    for i in range(1, n):
        x, y = points[i, 0], points[i, 1]
        k = i
        while k > 0 and (points[k - 1, 0] > x or (points[k - 1, 0] == x and points[k - 1, 1] > y)):
            points[k] = points[k - 1]
            k -= 1
        points[k, 0], points[k, 1] = x, y
    hull = np.empty((2 * n, 2))
    k, floor = 0, 2
    for step in range(2 * n - 1):
        x, y = points[step if step < n else 2 * n - 2 - step]
        if step == n:
            floor = k + 1
        while k >= floor and _cross(hull[k - 2], hull[k - 1], x, y) <= 0.0:
            k -= 1
        hull[k, 0], hull[k, 1] = x, y
        k += 1
    return hull[: max(1, k - 1)]


@compiled
def _squared_distance(ax: float, ay: float, bx: float, by: float, edge: Array) -> float:
    """Squared distance of two segments that do not cross."""
    least = np.inf
    for x, y in ((ax, ay), (bx, by)):
        px, py = nearest_on_segment(edge[0], edge[1], edge[2], edge[3], x, y)
        least = min(least, squared(px - x) + squared(py - y))
    for k in (0, 2):
        px, py = nearest_on_segment(ax, ay, bx, by, edge[k], edge[k + 1])
        least = min(least, squared(px - edge[k]) + squared(py - edge[k + 1]))
    return least


@compiled
def _meets(hull: Array, edge: Array) -> bool:
    """True if a segment meets a convex polygon: it is clipped by every edge (Cyrus and Beck 1978)."""
    if len(hull) < 3:
        p, q = hull[0], hull[-1]
        parted = _cross(p, q, edge[0], edge[1]) * _cross(p, q, edge[2], edge[3]) < 0.0
        return (
            parted and _cross(edge[:2], edge[2:], p[0], p[1]) * _cross(edge[:2], edge[2:], q[0], q[1]) < 0.0
        )
    enter, leave = 0.0, 1.0
    for k in range(len(hull)):
        a = _cross(hull[k - 1], hull[k], edge[0], edge[1])
        b = _cross(hull[k - 1], hull[k], edge[2], edge[3])
        if a < 0.0 and b < 0.0:
            return False
        if a < 0.0:
            enter = max(enter, a / (a - b))
        elif b < 0.0:
            leave = min(leave, a / (a - b))
        if enter > leave:
            return False
    return True


@compiled
def _keeps_clear(edges: Array, clearance: Array, hull: Array, beyond: float) -> bool:
    """True if a convex hull stays farther from every edge than it must, by more than ``beyond``."""
    x0, x1 = hull[:, 0].min(), hull[:, 0].max()
    y0, y1 = hull[:, 1].min(), hull[:, 1].max()
    for m in range(len(edges)):
        edge, need = edges[m], clearance[m] + beyond
        beside = min(edge[0], edge[2]) > x1 + need or max(edge[0], edge[2]) < x0 - need
        if beside or min(edge[1], edge[3]) > y1 + need or max(edge[1], edge[3]) < y0 - need:
            continue
        if _meets(hull, edge):
            return False
        px, py = hull[-1]
        for k in range(len(hull)):
            if _squared_distance(px, py, hull[k, 0], hull[k, 1], edge) <= need * need:
                return False
            px, py = hull[k]
    return True


@compiled
def _place(corners: Array, x: float, y: float, yaw: float, out: Array) -> None:
    """Write corners of the base frame as seen from the world."""
    c, s = math.cos(yaw), math.sin(yaw)
    for k in range(len(corners)):
        out[k, 0] = x + c * corners[k, 0] - s * corners[k, 1]
        out[k, 1] = y + s * corners[k, 0] + c * corners[k, 1]


@compiled
def fits(scene: FootprintScene, x: float, y: float, yaw: float) -> bool:
    """True if the base at a pose lies inside the floor and keeps its distance from every obstacle."""
    if not _footprint_fits(scene, scene.corners, x, y, yaw):
        return False
    upper = scene.upper
    for p in range(len(upper.corner_starts) - 1):
        corners, edges, clearance = _outline(upper, p)
        placed = np.empty_like(corners)
        _place(corners, x, y, yaw, placed)
        if _inside_solid(upper, p, placed[0]) or not _keeps_clear(edges, clearance, placed, 0.0):
            return False
    return True


@compiled
def _footprint_fits(scene: FootprintScene, corners: Array, x: float, y: float, yaw: float) -> bool:
    """True if the footprint alone, or a convex part of it, fits at a pose."""
    placed = np.empty_like(corners)
    _place(corners, x, y, yaw, placed)
    return _corner_free(scene, placed) and _keeps_clear(scene.edges, scene.clearance, placed, 0.0)


@compiled
def fits_nowhere_near(
    scene: FootprintScene, centre: Array, radius: float, x: float, y: float, yaw: float, by: float
) -> bool:
    """True if the footprint provably fits at no pose that moves each of its points by at most ``by``.

    ``centre`` (2,) and ``radius`` are a circle inside the footprint. Shrunk towards that centre, the
    footprint lies in the footprints at all these poses. Upper outlines rule nothing out, as they are larger
    than what they stand for.
    """
    if by >= radius:
        return False
    shrunk = np.empty_like(scene.corners)
    for k in range(len(shrunk)):
        for i in range(2):
            shrunk[k, i] = centre[i] + (1.0 - by / radius) * (scene.corners[k, i] - centre[i])
    return not _footprint_fits(scene, shrunk, x, y, yaw)


@compiled
def _corner_free(scene: FootprintScene, placed: Array) -> bool:
    """True if one corner of the footprint is on the floor and not in an obstacle; edges decide the rest."""
    x, y = placed[0]
    return contains(scene.vertices, scene.starts, x, y) and not contains(
        scene.solid, scene.solid_starts, x, y
    )


@compiled
def _outline(upper: UpperOutlines, p: int) -> tuple[Array, Array, Array]:
    """Corners of an upper outline, edges that it keeps from, and how far."""
    a, b = upper.edge_starts[p], upper.edge_starts[p + 1]
    return (
        upper.corners[upper.corner_starts[p] : upper.corner_starts[p + 1]],
        upper.edges[a:b],
        upper.clearance[a:b],
    )


@compiled
def _inside_solid(upper: UpperOutlines, p: int, corner: Array) -> bool:
    """True if a corner of an upper outline lies in an obstacle."""
    a, b = upper.ring_starts[p], upper.ring_starts[p + 1]
    return b > a and contains(upper.solid, upper.solid_starts[a : b + 1], corner[0], corner[1])


@compiled
def _motion_free(
    scene: FootprintScene, start: Array, length: float, turn: float, dx: float, dy: float
) -> bool:
    """True if a motion is proven free: along the heading and round, while it also slides by (dx, dy)."""
    placed = np.empty_like(scene.corners)
    _place(scene.corners, start[0], start[1], start[2], placed)
    if not _corner_free(scene, placed):
        return False
    if not _sweep_clear(scene.corners, scene.edges, scene.clearance, start, length, turn, dx, dy):
        return False
    upper = scene.upper
    for p in range(len(upper.corner_starts) - 1):
        corners, edges, clearance = _outline(upper, p)
        first = np.empty_like(corners)
        _place(corners, start[0], start[1], start[2], first)
        if _inside_solid(upper, p, first[0]):
            return False
        if not _sweep_clear(corners, edges, clearance, start, length, turn, dx, dy):
            return False
    return True


@compiled
def _sweep_clear(
    corners: Array,
    edges: Array,
    clearance: Array,
    start: Array,
    length: float,
    turn: float,
    dx: float,
    dy: float,
) -> bool:
    """True if a convex outline provably comes too near to no edge in a motion, see `_motion_free`."""
    n = len(corners)
    both = np.empty((2 * n, 2))
    _place(corners, start[0], start[1], start[2], both[:n])
    if not _keeps_clear(edges, clearance, both[:n], 0.0):
        return False
    bulge = 0.0  # an eighth of the largest acceleration of a point bounds its distance from the chord
    for k in range(n):
        sideways = length * turn - turn * turn * corners[k, 1]
        bulge = max(bulge, 0.125 * np.hypot(turn * turn * corners[k, 0], sideways))
    cell, depth = 0, 0  # the motion is split in 2**depth parts; this is the part being proven
    while True:
        width = 0.5**depth
        for end in range(2):
            s = (cell + end) * width
            x, y, yaw = arc_end(start[0], start[1], start[2], s * length, s * turn)
            _place(corners, x + s * dx, y + s * dy, yaw, both[end * n : (end + 1) * n])
        last = both[n:].copy()
        if _keeps_clear(edges, clearance, _hull(both), bulge * width * width):
            cell += 1
            while depth > 0 and cell % 2 == 0:
                cell, depth = cell // 2, depth - 1
            if depth == 0:
                return True
        elif depth == MAX_HALVINGS or not _keeps_clear(edges, clearance, last, 0.0):
            return False
        else:
            cell, depth = 2 * cell, depth + 1


@compiled
def arc_is_free(scene: FootprintScene, start: Array, length: float, turn: float) -> bool:
    """True if a line, an arc or a turn on the spot from a pose (3,) is proven free."""
    return _motion_free(scene, start, length, turn, 0.0, 0.0)


@compiled
def slide_is_free(scene: FootprintScene, start: Array, goal: Array) -> bool:
    """True if a straight motion between two poses (3,), turning evenly the shorter way, is proven free."""
    dx, dy, turn = goal[0] - start[0], goal[1] - start[1], wrap(goal[2] - start[2])
    return _motion_free(scene, start, 0.0, turn, dx, dy)
