"""A footprint among walls and obstacles: where it fits, and motions of it that are proven to be free.

The proof splits a motion in time. Over a short time every point of the footprint stays near the chord of its
path: all it sweeps lies in the hull of the footprint at both ends, grown by how far the paths bulge, which
falls with the square of the time. A gap of a micrometre is passed in steps of a milliradian.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.driving.arcs import arc_inside, moved, wrapped
from regionik.planners.geometry.flat import FlatPolygon, Index, compiled, contains, nearest_on_segment
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.obstacles import Shadow

DEEPEST = 16  # halvings of a motion, after which it counts as blocked


class Room(NamedTuple):
    """A footprint and all it keeps away from, as values for kernels; made by `room_of` or `bare_room`.

    Attributes
    ----------
    corners : (n, 2) array
        Of the convex footprint in the base frame, counter-clockwise [m]. None at all: the base is a point,
        and it may touch the walls.
    edges : (m, 4) array
        Both ends of every edge of floor and obstacles [m].
    keep : (m,) array
        The footprint stays farther from an edge than this [m].
    vertices, starts
        The floor, as `FlatPolygon`.
    solid, solid_starts
        What obstacles cover, likewise.
    """

    corners: Array
    edges: Array
    keep: Array
    vertices: Array
    starts: Index
    solid: Array
    solid_starts: Index


def bare_room(free: Polygon | MultiPolygon) -> Room:
    """The room of a point that may go anywhere in a polygon, and along its boundary."""
    flat = FlatPolygon.from_shapely(free)
    return _room(np.zeros((0, 2)), np.zeros((0, 4)), np.zeros(0), flat, None)


def room_of(
    footprint: ArrayLike,
    floor: Polygon | MultiPolygon,
    obstacles: Sequence[Shadow] = (),
    clearance: float = 0.0,
) -> Room:
    """Prepare a footprint, a floor and obstacles.

    Parameters
    ----------
    footprint : (n, 2) array_like
        Corners of a convex outline in the base frame, or one point; the origin may lie anywhere [m].
    floor : Polygon or MultiPolygon
        The footprint stays inside, without clearance [m].
    obstacles : sequence of Shadow
        The footprint keeps ``clearance`` from each of them.
    clearance : float
        [m]

    Raises
    ------
    InputError
        When the footprint is not convex, the clearance is negative or the floor is no polygon.
    """
    if not 0 <= clearance < np.inf:
        raise InputError(f"clearance: expected 0 or above, got {clearance}")
    flat = FlatPolygon.from_shapely(floor)
    cores = [shadow.core for shadow in obstacles if not shadow.core.is_empty]
    keeps = [clearance + shadow.radius for shadow in obstacles if not shadow.core.is_empty]
    tables = [edges_of(flat.vertices, flat.starts), *(core_edges(core) for core in cores)]
    counts = [len(table) for table in tables]
    bodies = [core for core in cores if isinstance(core, Polygon | MultiPolygon)]
    covered = FlatPolygon.from_shapely(shapely.union_all(bodies)) if bodies else None
    return _room(outline(footprint), np.concatenate(tables), np.repeat([0.0, *keeps], counts), flat, covered)


def _room(corners: Array, edges: Array, keep: Array, floor: FlatPolygon, solid: FlatPolygon | None) -> Room:
    """Arrays of one kind throughout, so that the kernels are compiled once."""
    none = FlatPolygon(np.zeros((0, 2)), np.zeros(1, dtype=np.int64))
    kept = solid or none
    return Room(
        np.array(corners),
        np.array(edges),
        np.array(keep),
        np.array(floor.vertices),
        np.array(floor.starts),
        np.array(kept.vertices),
        np.array(kept.starts),
    )


def outline(footprint: ArrayLike) -> Array:
    """Corners of a convex footprint, counter-clockwise, without those on straight edges.

    Raises
    ------
    InputError
        When it is not convex, or has no area and is not a single point.
    """
    given = frozen(footprint, (None, 2), "footprint")
    if len(given) == 1:
        return given
    if len(given) < 3:
        raise InputError("footprint: expected one point or at least three corners")
    hull = shapely.convex_hull(shapely.multipoints(given))
    if not isinstance(hull, Polygon) or hull.area < 1e-9:
        raise InputError("footprint: expected an outline with an area, its corners lie on one line")
    ring = Polygon(given)
    if not ring.is_valid or hull.area - ring.area > 1e-9 * hull.area:
        more = 100 * (hull.area / ring.area - 1) if ring.is_valid else np.inf
        raise InputError(f"footprint: expected a convex outline, its convex hull is {more:.3g} % larger")
    corners = np.asarray(shapely.orient_polygons(hull).exterior.coords)[:-1]
    return frozen(corners, (None, 2), "footprint")


def core_edges(core: shapely.Geometry) -> Array:
    """Edges of a shadow's core; a point is an edge without length."""
    if isinstance(core, Polygon | MultiPolygon):
        flat = FlatPolygon.from_shapely(core)
        return edges_of(flat.vertices, flat.starts)
    points = shapely.get_coordinates(core)
    pairs = points if len(points) == 1 else points[:-1]
    return np.hstack([pairs, points if len(points) == 1 else points[1:]])


def edges_of(vertices: Array, starts: Index) -> Array:
    """Both ends of every edge of a flat polygon, (n, 4)."""
    ends = np.arange(1, len(vertices) + 1)
    ends[starts[1:] - 1] = starts[:-1]
    return np.hstack([vertices, vertices[ends]])


@compiled
def _cross(o: Array, a: Array, x: float, y: float) -> float:
    return float((a[0] - o[0]) * (y - o[1]) - (a[1] - o[1]) * (x - o[0]))


@compiled
def _hull(points: Array) -> Array:
    """Corners of the convex hull, counter-clockwise (Andrew's chain)."""
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
def _apart(ax: float, ay: float, bx: float, by: float, edge: Array) -> float:
    """Square of the distance of two segments that do not cross."""
    least = np.inf
    for x, y in ((ax, ay), (bx, by)):
        px, py = nearest_on_segment(edge[0], edge[1], edge[2], edge[3], x, y)
        least = min(least, (px - x) ** 2 + (py - y) ** 2)
    for k in (0, 2):
        px, py = nearest_on_segment(ax, ay, bx, by, edge[k], edge[k + 1])
        least = min(least, (px - edge[k]) ** 2 + (py - edge[k + 1]) ** 2)
    return least


@compiled
def _meets(hull: Array, edge: Array) -> bool:
    """Whether a segment meets a convex polygon: its part on the inner side of every edge is not empty."""
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
def _keeps(room: Room, hull: Array, beyond: float) -> bool:
    """Whether a convex hull stays farther from every edge than it must, by more than ``beyond``."""
    x0, x1 = hull[:, 0].min(), hull[:, 0].max()
    y0, y1 = hull[:, 1].min(), hull[:, 1].max()
    for m in range(len(room.edges)):
        edge, need = room.edges[m], room.keep[m] + beyond
        beside = min(edge[0], edge[2]) > x1 + need or max(edge[0], edge[2]) < x0 - need
        if beside or min(edge[1], edge[3]) > y1 + need or max(edge[1], edge[3]) < y0 - need:
            continue
        if _meets(hull, edge):
            return False
        px, py = hull[-1]
        for k in range(len(hull)):
            if _apart(px, py, hull[k, 0], hull[k, 1], edge) <= need * need:
                return False
            px, py = hull[k]
    return True


@compiled
def _place(corners: Array, x: float, y: float, yaw: float, out: Array) -> None:
    c, s = math.cos(yaw), math.sin(yaw)
    for k in range(len(corners)):
        out[k, 0] = x + c * corners[k, 0] - s * corners[k, 1]
        out[k, 1] = y + s * corners[k, 0] + c * corners[k, 1]


@compiled
def fits(room: Room, x: float, y: float, yaw: float) -> bool:
    """Whether the footprint at a pose lies inside the floor and keeps its distance from every obstacle."""
    if not len(room.corners):
        return contains(room.vertices, room.starts, x, y)
    placed = np.empty_like(room.corners)
    _place(room.corners, x, y, yaw, placed)
    return _begins(room, placed) and _keeps(room, placed, 0.0)


@compiled
def surely_out(room: Room, heart: Array, radius: float, x: float, y: float, yaw: float, by: float) -> bool:
    """Whether the footprint fits at no pose at which each of its points is at most ``by`` from where it is.

    ``heart`` (2,) and ``radius`` are a circle inside the footprint. Shrunk towards its heart, the footprint
    lies in all the others.
    """
    if by >= radius:
        return False
    shrunk, placed = np.empty_like(room.corners), np.empty_like(room.corners)
    for k in range(len(shrunk)):
        for i in range(2):
            shrunk[k, i] = heart[i] + (1.0 - by / radius) * (room.corners[k, i] - heart[i])
    _place(shrunk, x, y, yaw, placed)
    return not (_begins(room, placed) and _keeps(room, placed, 0.0))


@compiled
def _begins(room: Room, placed: Array) -> bool:
    """Whether one corner of the footprint is on the floor and not in an obstacle; edges decide the rest."""
    x, y = placed[0]
    return contains(room.vertices, room.starts, x, y) and not contains(room.solid, room.solid_starts, x, y)


@compiled
def _free(room: Room, start: Array, length: float, turn: float, dx: float, dy: float) -> bool:
    """Whether a motion is proven free: along the heading and round, while it also slides by (dx, dy)."""
    n = len(room.corners)
    both = np.empty((2 * n, 2))
    _place(room.corners, start[0], start[1], start[2], both[:n])
    if not (_begins(room, both[:n]) and _keeps(room, both[:n], 0.0)):
        return False
    bulge = 0.0  # an eighth of the largest acceleration of a point, per motion
    for k in range(n):
        sideways = length * turn - turn * turn * room.corners[k, 1]
        bulge = max(bulge, 0.125 * math.hypot(turn * turn * room.corners[k, 0], sideways))
    cell, depth = 0, 0  # the motion is split in 2**depth parts; this is the part being proven
    while True:
        width = 0.5**depth
        for end in range(2):
            s = (cell + end) * width
            x, y, yaw = moved(start[0], start[1], start[2], s * length, s * turn)
            _place(room.corners, x + s * dx, y + s * dy, yaw, both[end * n : (end + 1) * n])
        last = both[n:].copy()
        if _keeps(room, _hull(both), bulge * width * width):
            cell += 1
            while depth > 0 and cell % 2 == 0:
                cell, depth = cell // 2, depth - 1
            if depth == 0:
                return True
        elif depth == DEEPEST or not _keeps(room, last, 0.0):
            return False
        else:
            cell, depth = 2 * cell, depth + 1


@compiled
def rolls(room: Room, start: Array, length: float, turn: float) -> bool:
    """Whether a line, an arc or a turn on the spot from a pose (3,) is free, exactly or by proof."""
    if not len(room.corners):
        return arc_inside(room.vertices, room.starts, start[0], start[1], start[2], length, turn)
    return _free(room, start, length, turn, 0.0, 0.0)


@compiled
def slides(room: Room, start: Array, goal: Array) -> bool:
    """Whether a straight motion between two poses (3,), turning evenly the shorter way, is free."""
    dx, dy, turn = goal[0] - start[0], goal[1] - start[1], wrapped(goal[2] - start[2])
    if not len(room.corners):
        length, yaw = math.hypot(dx, dy), math.atan2(dy, dx)
        return arc_inside(room.vertices, room.starts, start[0], start[1], yaw, length, 0.0)
    return _free(room, start, 0.0, turn, dx, dy)
