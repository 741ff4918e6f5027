"""Rings and ring sectors cut to a floor, exactly: their boundary as segments and arcs, compiled.

A boundary is what of the ring's circles and sides lies on the floor, and what of the floor's edges lies in
the ring. Each of these curves is cut where it crosses the others, and each part is kept or not by its middle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.cells import Cells, within
from regionik.planners.geometry.flat import Index, compiled, insert, nearest_on_segment
from regionik.worlds.arrays import Array

TURN = 2.0 * math.pi
SAME = 1e-12  # parts of a curve that are shorter do not count [m]
MOST_CUTS = 1024  # of one curve, at first


class Sectors(NamedTuple):
    """Rings and ring sectors, as values for kernels.

    Attributes
    ----------
    center : (n, 2) array
    low, high : (n,) array
        Radii, 0 <= low < high [m].
    azimuth, half : (n,) array
        Middle and half of each sector; whole rings where half a turn or more [rad].
    """

    center: Array
    low: Array
    high: Array
    azimuth: Array
    half: Array


class Outline(NamedTuple):
    """Boundaries of many areas, the inside to the left of every piece.

    Attributes
    ----------
    first : (n + 1,) array of int
        Area i has the pieces ``first[i]:first[i + 1]``; none where it is empty.
    pieces : (m, 5) array
        Segments as x, y, x, y, 0; arcs about the area's center as angles from and to, 0, 0 and the radius,
        which is below 0 where the arc is passed from the second angle to the first [m, rad].
    """

    first: Index
    pieces: Array


@compiled
def outlines(cells: Cells, sectors: Sectors) -> Outline:
    """What of many rings and ring sectors is on a floor."""
    n = len(sectors.low)
    first, pieces, count = np.zeros(n + 1, np.int64), np.empty((32 * n + 64, 5)), 0
    stamp, near = np.full(len(cells.edges), -1, np.int64), np.empty(len(cells.edges), np.int64)
    apart = np.empty((len(cells.edges), 2))
    cuts, curve = np.empty(MOST_CUTS), np.empty(5)
    for i in range(n):
        k = _near(cells, sectors.center[i], sectors.low[i], sectors.high[i], i, stamp, near, apart)
        most = count + 8 * (k + 4) + 4 * k + 16
        if most > len(pieces):
            larger = np.empty((2 * most, 5))
            larger[:count] = pieces[:count]
            pieces = larger
        if 6 * k + 16 > len(cuts):
            cuts = np.empty(12 * k + 32)
        for part in range(4):
            if _curve(sectors, i, part, curve):
                count = _on_floor(cells, sectors.center[i], near[:k], apart, curve, cuts, pieces, count)
        for m in range(k):
            edge, whole = (
                cells.edges[near[m]],
                apart[m, 0] >= sectors.low[i] and apart[m, 1] <= sectors.high[i],
            )
            if whole and sectors.half[i] >= math.pi:
                pieces[count, :4], pieces[count, 4] = edge, 0.0
                count += 1
            else:
                count = _in_ring(edge, sectors, i, cuts, pieces, count)
        first[i + 1] = count
    return Outline(first, pieces[:count].copy())


@compiled
def measures(outline: Outline, center: Array) -> Array:
    """Area of each (n,), by Green's theorem [m2]."""
    found = np.zeros(len(center))
    for i in range(len(center)):
        x, y = center[i]
        for k in range(outline.first[i], outline.first[i + 1]):
            a, b, c, d, r = outline.pieces[k]
            found[i] += r * abs(r) * (b - a) / 2 if r != 0.0 else ((a - x) * (d - y) - (c - x) * (b - y)) / 2
    return found


@compiled
def holds(cells: Cells, sectors: Sectors, i: int, x: float, y: float) -> bool:
    """Whether a place lies in an area."""
    return _in_sector(sectors, i, x, y) and within(cells, x, y)


@compiled
def nearest_place(
    cells: Cells, sectors: Sectors, outline: Outline, i: int, x: float, y: float
) -> tuple[float, float]:
    """The place itself where an area holds it, else the nearest of its boundary; NaN where it is empty."""
    if holds(cells, sectors, i, x, y):
        return x, y
    cx, cy = sectors.center[i]
    best, bx, by = np.inf, np.nan, np.nan
    for k in range(outline.first[i], outline.first[i + 1]):
        a, b, c, d, r = outline.pieces[k]
        if r == 0.0:
            px, py = nearest_on_segment(a, b, c, d, x, y)
        else:
            angle = a + (math.atan2(y - cy, x - cx) - a) % TURN
            if angle > b:  # the nearer end
                angle = a if angle - b > a + TURN - angle else b
            px, py = cx + abs(r) * math.cos(angle), cy + abs(r) * math.sin(angle)
        far = (px - x) * (px - x) + (py - y) * (py - y)
        if far < best:
            best, bx, by = far, px, py
    return bx, by


@compiled
def _near(
    cells: Cells, center: Array, low: float, far: float, i: int, stamp: Index, near: Index, apart: Array
) -> int:
    """Write the edges that come into a ring, each once, and how far off they are; returns how many."""
    left = max(0, math.floor((center[0] - far - cells.x) / cells.size))
    right = min(cells.columns - 1, math.floor((center[0] + far - cells.x) / cells.size))
    bottom = max(0, math.floor((center[1] - far - cells.y) / cells.size))
    top = min(cells.rows - 1, math.floor((center[1] + far - cells.y) / cells.size))
    count = 0
    for row in range(bottom, top + 1):
        for cell in range(row * cells.columns + left, row * cells.columns + right + 1):
            for k in range(cells.first[cell], cells.first[cell + 1]):
                e = cells.listed[k]
                if stamp[e] != i:
                    stamp[e] = i
                    ax, ay, bx, by = cells.edges[e]
                    ax, ay, bx, by = ax - center[0], ay - center[1], bx - center[0], by - center[1]
                    most = max(ax * ax + ay * ay, bx * bx + by * by)
                    if most >= low * low:
                        x, y = nearest_on_segment(ax, ay, bx, by, 0.0, 0.0)
                        least = x * x + y * y
                        if least <= far * far:
                            near[count], apart[count, 0], apart[count, 1] = (
                                e,
                                math.sqrt(least),
                                math.sqrt(most),
                            )
                            count += 1
    return count


@compiled
def _curve(sectors: Sectors, i: int, part: int, curve: Array) -> bool:
    """Write outer arc, inner arc, or one of the two sides of a sector as a piece, if it is there."""
    low, high, half = sectors.low[i], sectors.high[i], min(sectors.half[i], math.pi)
    begin, end = sectors.azimuth[i] - half, sectors.azimuth[i] + half
    if part < 2:
        curve[0], curve[1], curve[2], curve[3] = begin, end, 0.0, 0.0
        curve[4] = high if part == 0 else -low
        return bool(part == 0 or low > 0.0)
    x, y = sectors.center[i]
    angle = begin if part == 2 else end
    c, s = math.cos(angle), math.sin(angle)
    near, far = (low, high) if part == 2 else (high, low)
    curve[0], curve[1], curve[2], curve[3] = x + near * c, y + near * s, x + far * c, y + far * s
    curve[4] = 0.0
    return bool(half < math.pi)


@compiled
def _on_floor(
    cells: Cells,
    center: Array,
    near: Index,
    apart: Array,
    curve: Array,
    cuts: Array,
    pieces: Array,
    count: int,
) -> int:
    """Append what of a curve of a ring lies on the floor."""
    r = abs(curve[4])
    length = (curve[1] - curve[0]) if r > 0.0 else math.hypot(curve[2] - curve[0], curve[3] - curve[1])
    n = insert(cuts, insert(cuts, 0, 0.0), length)
    ux, uy = ((curve[2] - curve[0]) / length, (curve[3] - curve[1]) / length) if r == 0.0 else (0.0, 0.0)
    for m in range(len(near)):
        ax, ay, bx, by = cells.edges[near[m]]
        if r > 0.0:
            if apart[m, 0] > r or apart[m, 1] < r:
                continue
            ax, ay, bx, by = ax - center[0], ay - center[1], bx - center[0], by - center[1]
            ok, s, t = _crossed(ax, ay, bx - ax, by - ay, r)
            for one in (s, t):
                if ok and 0.0 <= one <= 1.0:
                    turn = (math.atan2(ay + one * (by - ay), ax + one * (bx - ax)) - curve[0]) % TURN
                    if turn < length:
                        n = insert(cuts, n, turn)
        else:
            a, b = ux * (ay - curve[1]) - uy * (ax - curve[0]), ux * (by - curve[1]) - uy * (bx - curve[0])
            if (a > 0.0) != (b > 0.0):
                t = a / (a - b)
                along = ux * (ax + t * (bx - ax) - curve[0]) + uy * (ay + t * (by - ay) - curve[1])
                if 0.0 < along < length:
                    n = insert(cuts, n, along)
    for k in range(n - 1):
        if (cuts[k + 1] - cuts[k]) * (r if r > 0.0 else 1.0) <= SAME:
            continue
        middle = (cuts[k] + cuts[k + 1]) / 2
        if r > 0.0:
            x, y = center[0] + r * math.cos(curve[0] + middle), center[1] + r * math.sin(curve[0] + middle)
        else:
            x, y = curve[0] + middle * ux, curve[1] + middle * uy
        if within(cells, x, y):
            pieces[count, 4] = curve[4]
            if r > 0.0:
                pieces[count, 0], pieces[count, 1] = curve[0] + cuts[k], curve[0] + cuts[k + 1]
                pieces[count, 2] = pieces[count, 3] = 0.0
            else:
                pieces[count, 0], pieces[count, 1] = curve[0] + cuts[k] * ux, curve[1] + cuts[k] * uy
                pieces[count, 2], pieces[count, 3] = curve[0] + cuts[k + 1] * ux, curve[1] + cuts[k + 1] * uy
            count += 1
    return count


@compiled
def _in_ring(edge: Array, sectors: Sectors, i: int, cuts: Array, pieces: Array, count: int) -> int:
    """Append what of an edge lies in a ring or ring sector."""
    x, y = sectors.center[i]
    ax, ay, dx, dy = edge[0] - x, edge[1] - y, edge[2] - edge[0], edge[3] - edge[1]
    n = insert(cuts, insert(cuts, 0, 0.0), 1.0)
    for r in (sectors.low[i], sectors.high[i]):
        ok, s, t = _crossed(ax, ay, dx, dy, r)
        for one in (s, t):
            if ok and 0.0 < one < 1.0:
                n = insert(cuts, n, one)
    if sectors.half[i] < math.pi:
        for side in (-sectors.half[i], sectors.half[i]):
            c, s = math.cos(sectors.azimuth[i] + side), math.sin(sectors.azimuth[i] + side)
            off, climb = c * ay - s * ax, c * dy - s * dx
            if climb != 0.0 and 0.0 < -off / climb < 1.0:
                n = insert(cuts, n, -off / climb)
    length = math.hypot(dx, dy)
    for k in range(n - 1):
        middle = (cuts[k] + cuts[k + 1]) / 2
        if (cuts[k + 1] - cuts[k]) * length > SAME and _in_sector(
            sectors, i, edge[0] + middle * dx, edge[1] + middle * dy
        ):
            pieces[count, 0], pieces[count, 1] = edge[0] + cuts[k] * dx, edge[1] + cuts[k] * dy
            pieces[count, 2], pieces[count, 3] = edge[0] + cuts[k + 1] * dx, edge[1] + cuts[k + 1] * dy
            pieces[count, 4] = 0.0
            count += 1
    return count


@compiled
def _in_sector(sectors: Sectors, i: int, x: float, y: float) -> bool:
    dx, dy = x - sectors.center[i, 0], y - sectors.center[i, 1]
    square = dx * dx + dy * dy
    if square < sectors.low[i] ** 2 or square > sectors.high[i] ** 2:
        return False
    if sectors.half[i] >= math.pi:
        return True
    turn = (math.atan2(dy, dx) - sectors.azimuth[i] + math.pi) % TURN - math.pi
    return bool(abs(turn) <= sectors.half[i])


@compiled
def _crossed(ax: float, ay: float, dx: float, dy: float, r: float) -> tuple[bool, float, float]:
    """Where a line crosses a circle about the origin, as shares of the way from a."""
    square, along = dx * dx + dy * dy, ax * dx + ay * dy
    root = along * along - square * (ax * ax + ay * ay - r * r)
    if root <= 0.0:
        return False, 0.0, 0.0
    root = math.sqrt(root)
    return True, (-along - root) / square, (-along + root) / square
