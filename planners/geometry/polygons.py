"""Polygons as flat arrays, with compiled point and segment queries.

Every kernel takes ``vertices`` (n, 2) [m] and ``starts`` (m + 1,): ring r is
``vertices[starts[r]:starts[r + 1]]``, not closed. A point is inside when a ray from it crosses the
rings an odd number of times, so holes and parts need no marks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.planners.geometry.vectors import squared
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index
from regionik.worlds.errors import InputError

ON_EDGE = 1e-12  # a point this near to the boundary counts as inside [m]
DEPTH = 1e-9  # a segment may leave the polygon this far, which is rounding and not motion [m]
EVERYWHERE = -np.inf, -np.inf, np.inf, np.inf  # least x and y, and most, of all places [m]


@dataclass(frozen=True, eq=False)
class FlatPolygon:
    """A polygon, or several with holes, as flat vertex arrays."""

    vertices: Array  # (n, 2) [m]
    starts: Index  # (m + 1,) ring r is ``vertices[starts[r]:starts[r + 1]]``, not closed; even-odd rule

    def __post_init__(self) -> None:  # none may write, and kernels are compiled for one kind of array
        self.vertices.flags.writeable = self.starts.flags.writeable = False

    @classmethod
    def from_shapely(cls, geometry: BaseGeometry) -> FlatPolygon:
        """Flatten a Polygon or MultiPolygon.

        Raises
        ------
        InputError
            For any other geometry, and for an empty one.

        Examples
        --------
        >>> flat = FlatPolygon.from_shapely(shapely.box(0, 0, 2, 1))
        >>> contains(flat.vertices, flat.starts, 1.0, 0.5)
        True
        """
        rings = shapely.get_rings(shapely.get_parts(checked_polygon(geometry)))
        ends = np.cumsum(shapely.get_num_coordinates(rings))
        starts = np.append(0, ends - np.arange(1, len(ends) + 1)).astype(np.int64)
        return cls(np.delete(shapely.get_coordinates(rings), ends - 1, axis=0), starts)

    def holds(self, spot: Array) -> bool:
        """True if a point (2,) is inside; see `contains`."""
        return bool(contains(self.vertices, self.starts, spot[0], spot[1]))

    def sees(self, a: Array, b: Array) -> bool:
        """True if the segment between two points (2,) lies inside; see `segment_inside`."""
        return bool(segment_inside(self.vertices, self.starts, a[0], a[1], b[0], b[1]))


def checked_polygon(geometry: BaseGeometry) -> Polygon | MultiPolygon:
    """The geometry itself, refused where it is not a Polygon or MultiPolygon or is empty."""
    if not isinstance(geometry, Polygon | MultiPolygon) or geometry.is_empty:
        raise InputError(
            f"polygon: expected a Polygon or MultiPolygon that is not empty, got {geometry!r:.60}"
        )
    return geometry


@compiled
def nearest_on_segment(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> tuple[float, float]:
    """Nearest point of a segment; a segment without length is its first end."""
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    if length2 == 0.0:
        return ax, ay
    t = min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / length2))
    return ax + t * dx, ay + t * dy


@compiled
def nearest_on_boundary(vertices: Array, starts: Index, x: float, y: float) -> tuple[float, float]:
    """Nearest point of the boundary; the first one where several are as near."""
    best, best_x, best_y = np.inf, np.nan, np.nan
    for r in range(len(starts) - 1):
        ax, ay = vertices[starts[r + 1] - 1]
        for k in range(starts[r], starts[r + 1]):
            bx, by = vertices[k]
            beside = max(0.0, min(ax, bx) - x, x - max(ax, bx))
            above = max(0.0, min(ay, by) - y, y - max(ay, by))
            if beside * beside + above * above < best:  # the box about the segment may come nearer
                px, py = nearest_on_segment(ax, ay, bx, by, x, y)
                gap2 = (px - x) * (px - x) + (py - y) * (py - y)
                if gap2 < best:
                    best, best_x, best_y = gap2, px, py
            ax, ay = bx, by
    return best_x, best_y


@compiled
def near_boundary(vertices: Array, starts: Index, x: float, y: float, within: float) -> bool:
    """True if the boundary comes as near as ``within`` [m]."""
    for r in range(len(starts) - 1):
        ax, ay = vertices[starts[r + 1] - 1]
        for k in range(starts[r], starts[r + 1]):
            bx, by = vertices[k]
            beside = x < min(ax, bx) - within or x > max(ax, bx) + within
            if not (beside or y < min(ay, by) - within or y > max(ay, by) + within):
                px, py = nearest_on_segment(ax, ay, bx, by, x, y)
                if (px - x) * (px - x) + (py - y) * (py - y) <= within * within:
                    return True
            ax, ay = bx, by
    return False


@compiled
def _crossed_oddly(vertices: Array, starts: Index, x: float, y: float) -> bool:
    """True if a ray from the point crosses the rings an odd number of times."""
    inside = False
    for r in range(len(starts) - 1):
        ax, ay = vertices[starts[r + 1] - 1]
        for k in range(starts[r], starts[r + 1]):
            bx, by = vertices[k]
            if (ay > y) != (by > y):
                side = (bx - ax) * (y - ay) - (x - ax) * (by - ay)
                if (side > 0.0) == (by > ay):
                    inside = not inside
            ax, ay = bx, by
    return inside


@compiled
def contains(vertices: Array, starts: Index, x: float, y: float) -> bool:
    """True if the point lies inside or within 1e-12 m of the boundary."""
    inside: bool = _crossed_oddly(vertices, starts, x, y)
    return inside or near_boundary(vertices, starts, x, y, ON_EDGE)


@compiled
def clamp(vertices: Array, starts: Index, x: float, y: float) -> tuple[float, float]:
    """The point itself when it is inside, else the nearest point of the boundary."""
    if _crossed_oddly(vertices, starts, x, y):
        return x, y
    near_x, near_y = nearest_on_boundary(vertices, starts, x, y)
    if squared(near_x - x) + squared(near_y - y) <= ON_EDGE * ON_EDGE:
        return x, y
    return near_x, near_y


@compiled
def clamp_each(vertices: Array, starts: Index, points: Array) -> Array:
    """What `clamp` says of points (n, 2), (n, 2)."""
    clamped = np.empty_like(points)
    for k in range(len(points)):
        clamped[k, 0], clamped[k, 1] = clamp(vertices, starts, points[k, 0], points[k, 1])
    return clamped


@compiled
def _within(vertices: Array, starts: Index, x: float, y: float) -> bool:
    # Half the depth: a gap between two cuts is at most twice as deep anywhere as it is half way.
    return contains(vertices, starts, x, y) or near_boundary(vertices, starts, x, y, DEPTH / 2)


@compiled
def insert_sorted(cuts: Array, count: int, value: float) -> int:
    """Put a value into the sorted head of ``cuts``; returns the new count."""
    k = count
    while k > 0 and cuts[k - 1] > value:
        cuts[k] = cuts[k - 1]
        k -= 1
    cuts[k] = value
    return count + 1


@compiled
def _crossings(
    vertices: Array, starts: Index, a: Array, u: Array, length: float, cuts: Array, count: int
) -> tuple[int, bool]:
    """Put the places where edges touch or cross a segment among the sorted ``cuts`` [m].

    Returns their number, and whether an edge truly cuts the segment in two: all four ends keep more than
    ``DEPTH`` from the other line, so that no rounding can explain it.
    """
    true_cut = False
    for r in range(len(starts) - 1):
        x, y = vertices[starts[r + 1] - 1, 0] - a[0], vertices[starts[r + 1] - 1, 1] - a[1]
        s0, t0 = x * u[1] - y * u[0], x * u[0] + y * u[1]
        for k in range(starts[r], starts[r + 1]):
            x, y = vertices[k, 0] - a[0], vertices[k, 1] - a[1]
            s1, t1 = x * u[1] - y * u[0], x * u[0] + y * u[1]
            if (s0 < 0.0) != (s1 < 0.0):
                t = t0 + (t1 - t0) * s0 / (s0 - s1)
                if 0.0 < t < length:
                    count = insert_sorted(cuts, count, t)
                    sine = abs(s0 - s1) / np.hypot(s0 - s1, t0 - t1)
                    if min(abs(s0), abs(s1)) > DEPTH and min(t, length - t) * sine > DEPTH:
                        true_cut = True
            if abs(s1) <= DEPTH and 0.0 < t1 < length:
                count = insert_sorted(cuts, count, t1)
            s0, t0 = s1, t1
    return count, true_cut


@compiled
def segment_in_either(
    one: Array,
    one_starts: Index,
    other: Array,
    other_starts: Index,
    ax: float,
    ay: float,
    bx: float,
    by: float,
) -> bool:
    """True if the whole segment lies in two closed polygons together, each bit of it in one of them.

    Neither lets it leave both by more than 0.5e-9 m, however short the bit.
    """
    length = np.hypot(bx - ax, by - ay)
    a, u = np.array([ax, ay]), np.array([bx - ax, by - ay]) / max(length, DEPTH)
    cuts = np.empty(2 * (len(one) + len(other)) + 2)
    count = insert_sorted(cuts, insert_sorted(cuts, 0, 0.0), length)
    count, _ = _crossings(one, one_starts, a, u, length, cuts, count)
    count, _ = _crossings(other, other_starts, a, u, length, cuts, count)
    for k in range(count - 1):
        t = 0.5 * (cuts[k] + cuts[k + 1])
        x, y = ax + t * u[0], ay + t * u[1]
        if not _within(one, one_starts, x, y) and not _within(other, other_starts, x, y):
            return False
    return True


@compiled
def segment_inside(vertices: Array, starts: Index, ax: float, ay: float, bx: float, by: float) -> bool:
    """True if the whole segment lies in the closed polygon.

    Touching the boundary, running along it and passing a vertex are allowed. Segments that leave the
    polygon by more than 1e-9 m are refused, those that stay within 0.5e-9 m of it are taken, unless
    they cross it from side to side: a hole of any width is a hole.
    """
    length = np.hypot(bx - ax, by - ay)
    if length <= DEPTH:
        return _within(vertices, starts, ax, ay) and _within(vertices, starts, bx, by)
    a = np.array([ax, ay])
    u = np.array([(bx - ax) / length, (by - ay) / length])
    cuts = np.empty(2 * len(vertices) + 2)
    count = insert_sorted(cuts, insert_sorted(cuts, 0, 0.0), length)
    count, true_cut = _crossings(vertices, starts, a, u, length, cuts, count)
    if true_cut:
        return False
    for k in range(count - 1):
        if cuts[k + 1] - cuts[k] > DEPTH:
            t = 0.5 * (cuts[k] + cuts[k + 1])
            if not _within(vertices, starts, a[0] + t * u[0], a[1] + t * u[1]):
                return False
    return True
