"""A free floor in connected parts, asked for places at given distances from a target, compiled.

The distances from a target to the places of one connected part are all those between the least and the
largest. So a part holds a place at a distance within [a, b] exactly where its least distance is at most b and
its largest at least a, and the circle at any distance of both intervals meets it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon

from regionik.planners.driving.footprint_scene import core_edges
from regionik.planners.geometry.flat import Index, compiled, nearest_on_segment
from regionik.worlds.arrays import Array

ROWS = 256  # bands of the floor that edges are looked up by
MOST_CUTS = 512  # crossings of one circle with edges that are kept
ROUNDING = 1e-9  # a corner this near to a circle is on it [m]
WIDEST = 0.5  # part of a circle inside the floor that gives one place [rad]


class Parts(NamedTuple):
    """Connected parts of a floor, as values for kernels; made by `parts_of`.

    Attributes
    ----------
    edges : (m, 4) array
        Both ends of every edge [m].
    owner : (m,) array of int
        Part that each edge bounds.
    first : (r + 1,) array of int
        Band k of the floor meets the edges ``listed[first[k]:first[k + 1]]``.
    listed : (l,) array of int
    bottom, height : float
        Of the lowest band, and of each [m].
    corners : (h, 2) array
        Corners of the parts' convex hulls [m].
    hull : (c + 1,) array of int
        Part k has the corners ``hull[k]:hull[k + 1]``.
    """

    edges: Array
    owner: Index
    first: Index
    listed: Index
    bottom: float
    height: float
    corners: Array
    hull: Index


def parts_of(polygons: Sequence[Polygon]) -> Parts:
    """Prepare polygons that do not overlap, each with holes or without.

    Examples
    --------
    >>> parts = parts_of([shapely.box(0, 0, 1, 1), shapely.box(2, 0, 3, 1)])
    >>> inside(parts, 0.5, 0.5), inside(parts, 1.5, 0.5)
    (True, False)
    """
    tables = [core_edges(polygon) for polygon in polygons]
    edges = np.concatenate([np.zeros((0, 4)), *tables])
    owner = np.repeat(np.arange(len(tables)), [len(table) for table in tables])
    low, high = edges[:, 1::2].min(1), edges[:, 1::2].max(1)
    bottom = float(low.min(initial=0.0))
    height = max(float(high.max(initial=1.0)) - bottom, 1e-9) / ROWS
    begin, end = (np.clip(((y - bottom) / height).astype(np.int64), 0, ROWS - 1) for y in (low, high))
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *map(np.arange, begin, end + 1)])
    listed = np.repeat(np.arange(len(edges)), end - begin + 1)
    order = np.argsort(rows, kind="stable")
    first = np.searchsorted(rows[order], np.arange(ROWS + 1))
    hulls = [shapely.get_coordinates(shapely.convex_hull(polygon))[:-1] for polygon in polygons]
    return Parts(
        edges,
        owner.astype(np.int64),
        first.astype(np.int64),
        listed[order].astype(np.int64),
        bottom,
        height,
        np.concatenate([np.zeros((0, 2)), *hulls]),
        np.cumsum([0, *map(len, hulls)]).astype(np.int64),
    )


@compiled
def _band(parts: Parts, y: float) -> int:
    return int(min(ROWS - 1, max(0.0, math.floor((y - parts.bottom) / parts.height))))


@compiled
def inside(parts: Parts, x: float, y: float) -> bool:
    """Whether a place is on the floor."""
    odd = False
    k = _band(parts, y)
    for i in range(parts.first[k], parts.first[k + 1]):
        ax, ay, bx, by = parts.edges[parts.listed[i]]
        if (ay > y) != (by > y) and ((bx - ax) * (y - ay) > (x - ax) * (by - ay)) == (by > ay):
            odd = not odd
    return odd


@compiled
def is_near(parts: Parts, x: float, y: float, by: float) -> bool:
    """Whether some place of the floor is at most ``by`` away [m]."""
    if inside(parts, x, y):
        return True
    for k in range(_band(parts, y - by), _band(parts, y + by) + 1):
        for i in range(parts.first[k], parts.first[k + 1]):
            ax, ay, bx, end = parts.edges[parts.listed[i]]
            if min(ax, bx) - x <= by and x - max(ax, bx) <= by:
                px, py = nearest_on_segment(ax, ay, bx, end, x, y)
                if math.hypot(px - x, py - y) <= by:
                    return True
    return False


@compiled
def distances(parts: Parts, x: float, y: float, far: float, low: Array, high: Array) -> None:
    """Write least and largest distance of every part (c,); infinite and 0 for those beyond ``far`` [m]."""
    low[:], high[:] = np.inf, 0.0
    home = _band(parts, y)
    for k in range(_band(parts, y - far), _band(parts, y + far) + 1):
        for i in range(parts.first[k], parts.first[k + 1]):
            e = parts.listed[i]
            ax, ay, bx, by = parts.edges[e]
            if min(ax, bx) - x <= far and x - max(ax, bx) <= far:
                px, py = nearest_on_segment(ax, ay, bx, by, x, y)
                low[parts.owner[e]] = min(low[parts.owner[e]], math.hypot(px - x, py - y))
    for i in range(parts.first[home], parts.first[home + 1]):
        e = parts.listed[i]
        ax, ay, bx, by = parts.edges[e]
        if (ay > y) != (by > y) and ((bx - ax) * (y - ay) > (x - ax) * (by - ay)) == (by > ay):
            high[parts.owner[e]] = 1.0 - high[parts.owner[e]]  # odd where the target is in the part
    for c in range(len(low)):
        if high[c] == 1.0:
            low[c] = 0.0
        high[c] = 0.0
        if low[c] <= far:
            for i in range(parts.hull[c], parts.hull[c + 1]):
                high[c] = max(high[c], math.hypot(parts.corners[i, 0] - x, parts.corners[i, 1] - y))
        else:
            low[c] = np.inf


@compiled
def _cut(parts: Parts, x: float, y: float, r: float, cuts: Array) -> int:
    """Angles at which a circle crosses edges, ascending; returns how many [rad]."""
    count, far = 0, r + ROUNDING
    for k in range(_band(parts, y - far), _band(parts, y + far) + 1):
        for i in range(parts.first[k], parts.first[k + 1]):
            ax, ay, bx, by = parts.edges[parts.listed[i]]
            ax, ay, bx, by = ax - x, ay - y, bx - x, by - y
            if min(ax, bx) > far or max(ax, bx) < -far:
                continue
            dx, dy = bx - ax, by - ay
            a, b, c = dx * dx + dy * dy, ax * dx + ay * dy, ax * ax + ay * ay - r * r
            if abs(c) <= ROUNDING * (2.0 * r + ROUNDING) and count < len(cuts):
                cuts[count] = math.atan2(ay, ax)  # by rounding neither edge of a corner may be crossed
                count += 1
            root = b * b - a * c
            if root < 0.0 or a == 0.0:
                continue
            root = math.sqrt(root)
            for t in ((-b - root) / a, (-b + root) / a):
                if 0.0 <= t <= 1.0 and count < len(cuts):
                    cuts[count] = math.atan2(ay + t * dy, ax + t * dx)
                    count += 1
    cuts[:count].sort()
    return count


@compiled
def on_circle(parts: Parts, x: float, y: float, r: float, cuts: Array, places: Array, count: int) -> int:
    """Append places of the floor on a circle to ``places`` (k, 2), those in wide arcs first.

    ``cuts`` is scratch. Returns how many places there are now.
    """
    cut = _cut(parts, x, y, r, cuts)
    if cut == 0:
        cuts[0], cut = -math.pi, 1
    for wide in (True, False):
        for k in range(cut):
            start = cuts[k]
            width = cuts[k + 1] - start if k + 1 < cut else cuts[0] + 2 * math.pi - start
            if (width >= WIDEST) != wide or width <= 0.0:
                continue
            middle = start + width / 2
            if not inside(parts, x + r * math.cos(middle), y + r * math.sin(middle)):
                continue
            pieces = 1 + int(width / WIDEST)
            for piece in range(pieces):
                if count == len(places):
                    return count
                angle = start + width * (piece + 0.5) / pieces
                px, py = x + r * math.cos(angle), y + r * math.sin(angle)
                if inside(parts, px, py):
                    places[count, 0], places[count, 1] = px, py
                    count += 1
    return count


@compiled
def meets(low: Array, high: Array, a: float, b: float) -> bool:
    """Whether some part holds a place at a distance within [a, b], given all parts' least and largest."""
    found = False
    for c in range(len(low)):
        found = found or (low[c] <= b and high[c] >= a)
    return found
