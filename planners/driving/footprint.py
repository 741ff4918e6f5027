"""A convex footprint among walls and obstacles: poses that are free, and whole motions proven free.

The proof splits a motion in time (conservative bounds by subdivision). Over a short time every point of the
footprint stays near the chord of its path: all it sweeps lies in the hull of the footprint at both ends,
grown by how far the paths bulge, which falls with the square of the time. A gap of a micrometre is passed in
steps of a milliradian.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.driving.arcs import arc_end
from regionik.planners.geometry.angles import wrap
from regionik.planners.geometry.polygons import FlatPolygon, contains, nearest_on_segment
from regionik.planners.geometry.vectors import squared
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.obstacles import Shadow

DEEPEST = 16  # halvings of a motion, after which it counts as blocked


def convex_corners(footprint: ArrayLike) -> Array:
    """Return the corners of a convex footprint, counter-clockwise, without those on straight edges.

    Raises
    ------
    InputError
        When it has no area and is not a single point.
    """
    given = frozen(footprint, (None, 2), "footprint")
    if len(given) == 1:
        return given
    hull = shapely.convex_hull(shapely.multipoints(given))
    if not isinstance(hull, Polygon) or hull.area < 1e-9:
        raise InputError("footprint: expected an outline with an area, its corners lie on one line")
    corners = np.asarray(shapely.orient_polygons(hull).exterior.coords)[:-1]
    return frozen(corners, (None, 2), "footprint")


def footprint_width(footprint: ArrayLike) -> float:
    """Smallest distance between two parallel lines with the footprint between them [m].

    Examples
    --------
    >>> round(footprint_width([[0, 0], [0.58, 0], [0.58, 0.38], [0, 0.38]]), 12)
    0.38
    """
    corners = convex_corners(footprint)
    if len(corners) == 1:
        return 0.0
    normals, offsets = side_lines(corners)
    return float((offsets[:, None] - normals @ corners.T).max(axis=1).min())


def side_lines(corners: Array) -> tuple[Array, Array]:
    """Outward normals n (k, 2) and offsets d (k,) of a convex outline: it is where n x <= d for all sides."""
    along = np.roll(corners, -1, axis=0) - corners
    normals: Array = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, None]
    return normals, np.einsum("ij,ij->i", normals, corners)


class FootprintScene(NamedTuple):
    """A footprint, the floor and the obstacles, as values for kernels; made by `footprint_scene`."""

    corners: Array  # (n, 2) of the convex footprint in the base frame, counter-clockwise [m]
    edges: Array  # (m, 4) both ends of every edge of floor and obstacles [m]
    clearance: Array  # (m,) the footprint stays farther from an edge than this [m]
    # vertices, starts: the floor, as `FlatPolygon`
    vertices: Array
    starts: Index
    # solid, solid_starts: the area that obstacles cover, likewise
    solid: Array
    solid_starts: Index


def footprint_scene(
    footprint: ArrayLike,
    floor: Polygon | MultiPolygon,
    obstacles: Sequence[Shadow] = (),
    clearance: float = 0.0,
) -> FootprintScene:
    """Prepare a footprint, a floor and obstacles for the checks of this module.

    Parameters
    ----------
    footprint : (n, 2) array_like
        Corners of a convex outline in the base frame, or one point; the origin may lie anywhere [m].
    floor : Polygon or MultiPolygon
        The footprint stays inside, without clearance [m].
    obstacles : sequence of Shadow
        The footprint keeps ``clearance`` from each of them.
    clearance : float [m]

    Raises
    ------
    InputError
        When the footprint has no area and is no point, or the floor is no polygon.
    """
    flat = FlatPolygon.from_shapely(floor)
    shadows = [shadow for shadow in obstacles if not shadow.core.is_empty]
    tables = [edges_of(flat), *(core_edges(shadow.core) for shadow in shadows)]
    distances = [0.0, *(clearance + shadow.radius for shadow in shadows)]
    bodies = [shadow.core for shadow in shadows if isinstance(shadow.core, Polygon | MultiPolygon)]
    none = FlatPolygon(np.zeros((0, 2)), np.zeros(1, dtype=np.int64))
    covered = FlatPolygon.from_shapely(shapely.union_all(bodies)) if bodies else none
    # Writable copies throughout: one signature, so that the kernels are compiled once.
    return FootprintScene(
        np.array(convex_corners(footprint)),
        np.concatenate(tables),
        np.repeat(distances, [len(table) for table in tables]),
        np.array(flat.vertices),
        np.array(flat.starts),
        np.array(covered.vertices),
        np.array(covered.starts),
    )


def core_edges(core: shapely.Geometry) -> Array:
    """Both ends of every edge of a shadow's core, (n, 4); a point is an edge without length."""
    if isinstance(core, Polygon | MultiPolygon):
        return edges_of(FlatPolygon.from_shapely(core))
    points = shapely.get_coordinates(core)
    if len(points) == 1:
        return np.hstack([points, points])
    return np.hstack([points[:-1], points[1:]])


def edges_of(flat: FlatPolygon) -> Array:
    """Both ends of every edge of a flat polygon, (n, 4)."""
    ends = np.arange(1, len(flat.vertices) + 1)
    ends[flat.starts[1:] - 1] = flat.starts[:-1]
    return np.hstack([flat.vertices, flat.vertices[ends]])


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
def _keeps_clear(scene: FootprintScene, hull: Array, beyond: float) -> bool:
    """True if a convex hull stays farther from every edge than it must, by more than ``beyond``."""
    x0, x1 = hull[:, 0].min(), hull[:, 0].max()
    y0, y1 = hull[:, 1].min(), hull[:, 1].max()
    for m in range(len(scene.edges)):
        edge, need = scene.edges[m], scene.clearance[m] + beyond
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
    """True if the footprint at a pose lies inside the floor and keeps its distance from every obstacle."""
    placed = np.empty_like(scene.corners)
    _place(scene.corners, x, y, yaw, placed)
    return _corner_free(scene, placed) and _keeps_clear(scene, placed, 0.0)


@compiled
def fits_nowhere_near(
    scene: FootprintScene, centre: Array, radius: float, x: float, y: float, yaw: float, by: float
) -> bool:
    """True if the footprint provably fits at no pose that moves each of its points by at most ``by``.

    ``centre`` (2,) and ``radius`` are a circle inside the footprint. Shrunk towards that centre, the
    footprint lies in the footprints at all these poses.
    """
    if by >= radius:
        return False
    shrunk, placed = np.empty_like(scene.corners), np.empty_like(scene.corners)
    for k in range(len(shrunk)):
        for i in range(2):
            shrunk[k, i] = centre[i] + (1.0 - by / radius) * (scene.corners[k, i] - centre[i])
    _place(shrunk, x, y, yaw, placed)
    return not (_corner_free(scene, placed) and _keeps_clear(scene, placed, 0.0))


@compiled
def _corner_free(scene: FootprintScene, placed: Array) -> bool:
    """True if one corner of the footprint is on the floor and not in an obstacle; edges decide the rest."""
    x, y = placed[0]
    return contains(scene.vertices, scene.starts, x, y) and not contains(
        scene.solid, scene.solid_starts, x, y
    )


@compiled
def _motion_free(
    scene: FootprintScene, start: Array, length: float, turn: float, dx: float, dy: float
) -> bool:
    """True if a motion is proven free: along the heading and round, while it also slides by (dx, dy)."""
    n = len(scene.corners)
    both = np.empty((2 * n, 2))
    _place(scene.corners, start[0], start[1], start[2], both[:n])
    if not (_corner_free(scene, both[:n]) and _keeps_clear(scene, both[:n], 0.0)):
        return False
    bulge = 0.0  # an eighth of the largest acceleration of a point bounds its distance from the chord
    for k in range(n):
        sideways = length * turn - turn * turn * scene.corners[k, 1]
        bulge = max(bulge, 0.125 * np.hypot(turn * turn * scene.corners[k, 0], sideways))
    cell, depth = 0, 0  # the motion is split in 2**depth parts; this is the part being proven
    while True:
        width = 0.5**depth
        for end in range(2):
            s = (cell + end) * width
            x, y, yaw = arc_end(start[0], start[1], start[2], s * length, s * turn)
            _place(scene.corners, x + s * dx, y + s * dy, yaw, both[end * n : (end + 1) * n])
        last = both[n:].copy()
        if _keeps_clear(scene, _hull(both), bulge * width * width):
            cell += 1
            while depth > 0 and cell % 2 == 0:
                cell, depth = cell // 2, depth - 1
            if depth == 0:
                return True
        elif depth == DEEPEST or not _keeps_clear(scene, last, 0.0):
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
