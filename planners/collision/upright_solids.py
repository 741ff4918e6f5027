"""Convex upright solids as flat arrays, with signed distances of points and segments, compiled.

Every solid is all points within ``ball`` (any way) and ``disc`` (level) of an outline raised from one
height to another: prisms have an outline, cylinders and balls one point.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from regionik.planners.collision.convex_bodies import Piece
from regionik.planners.geometry.polygons import nearest_on_segment
from regionik.planners.geometry.vectors import minus, norm
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index
from regionik.worlds.errors import InputError

GOLDEN = (5.0**0.5 - 1.0) / 2.0
AGREE = 1e-13  # rounding between two ways to one distance [m]
LEVEL = 1e-12  # a normal tilted less than this is level


class Uprights(NamedTuple):
    """m solids for kernels; the outline of solid k is ``outlines[starts[k]:starts[k + 1]]``."""

    outlines: Array  # (n, 2) convex, counter-clockwise, not closed [m]
    starts: Index  # (m + 1,)
    # low, high: (m,) heights of the outline [m]
    low: Array
    high: Array
    disc: Array  # (m,) [m]
    ball: Array  # (m,) [m]


def uprights_from(pieces: Sequence[Piece]) -> Uprights:
    """Flatten the pieces of solids.

    Raises
    ------
    InputError
        For a mesh, and for a part that does not stand upright.
    """
    outlines = [_outline(piece) for piece in pieces]
    heights = np.array([(p.corners[:, 2].min(), p.corners[:, 2].max()) for p in pieces]).reshape(-1, 2)
    return Uprights(
        np.concatenate([np.zeros((0, 2)), *outlines]),
        np.concatenate([[0], np.cumsum([len(outline) for outline in outlines])]).astype(np.int64),
        heights[:, 0].copy(),
        heights[:, 1].copy(),
        np.array([p.disc for p in pieces], dtype=np.float64),
        np.array([p.ball for p in pieces], dtype=np.float64),
    )


def _outline(piece: Piece) -> Array:
    """Corners of the lower face of a piece, in order round it."""
    if (piece.disc or piece.ball) and np.ptp(piece.corners[:, :2], axis=0).max() == 0.0:
        return piece.corners[:1, :2]
    tilt = np.minimum(np.abs(piece.normals[:, 2]), 1.0 - np.abs(piece.normals[:, 2]))
    if piece.mesh is not None or not len(piece.normals) or (tilt > LEVEL).any():
        raise InputError("solid: expected a box, cylinder, sphere or prism, got a mesh or a tilted part")
    floor = piece.corners[piece.corners[:, 2] == piece.corners[:, 2].min(), :2]
    away = floor - floor.mean(0)
    outline: Array = floor[np.argsort(np.arctan2(away[:, 1], away[:, 0]), kind="stable")]
    return outline


def inradii(solids: Uprights) -> Array:
    """Upper bounds of how far any point of a solid is inside it, (m,) [m]."""
    deep = np.minimum(solids.disc, (solids.high - solids.low) / 2) + solids.ball
    for k, (first, last) in enumerate(zip(solids.starts[:-1], solids.starts[1:], strict=True)):
        if last - first > 1:
            corners = solids.outlines[first:last]
            edges = np.roll(corners, -1, axis=0) - corners
            inward = np.column_stack([-edges[:, 1], edges[:, 0]]) / np.hypot(*edges.T)[:, None]
            widths = (corners @ inward.T).max(0) - (corners * inward).sum(1)
            deep[k] = min(widths.min(), solids.high[k] - solids.low[k]) / 2
    return deep


@compiled
def _length(x: float, y: float) -> float:
    """Length of a vector; hypot guards against overflow at several times the cost."""
    return float(np.sqrt(x * x + y * y))


@compiled
def signed_distance(solids: Uprights, k: int, x: float, y: float, z: float) -> float:
    """Distance of a point from solid k; inside, minus the way to the nearest face [m]."""
    first, last = solids.starts[k], solids.starts[k + 1]
    over = max(solids.low[k] - z, z - solids.high[k])
    if last - first == 1:
        level = _length(x - solids.outlines[first, 0], y - solids.outlines[first, 1])
        if solids.ball[k] > 0.0:
            return float(_length(level, max(over, 0.0)) - solids.ball[k])
        level -= solids.disc[k]
    else:
        level = _from_outline(solids.outlines[first:last], x, y)
    if level <= 0.0 or over <= 0.0:
        return float(max(level, over))
    return _length(level, over)


@compiled
def _from_outline(outline: Array, x: float, y: float) -> float:
    """Signed distance of a point (x, y) from a convex outline [m]."""
    beyond, gap2 = -np.inf, np.inf
    ax, ay = outline[-1]
    for k in range(len(outline)):
        bx, by = outline[k]
        dx, dy = bx - ax, by - ay
        beyond = max(beyond, ((x - ax) * dy - (y - ay) * dx) / _length(dx, dy))
        ax, ay = bx, by
    if beyond <= 0.0:
        return beyond
    ax, ay = outline[-1]
    for k in range(len(outline)):
        bx, by = outline[k]
        px, py = nearest_on_segment(ax, ay, bx, by, x, y)
        gap2 = min(gap2, (px - x) * (px - x) + (py - y) * (py - y))
        ax, ay = bx, by
    return float(np.sqrt(gap2))


@compiled
def distance_along(solids: Uprights, k: int, a: Array, b: Array, t: float) -> float:
    """Signed distance of the point at share ``t`` of the segment from a to b [m]."""
    x, y, z = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])
    return signed_distance(solids, k, x, y, z)


@compiled
def nearest_to_axis(solids: Uprights, k: int, a: Array, b: Array, growth: float) -> tuple[float, float]:
    """Least distance of a segment from the axis of a cylinder, or the middle of a ball, plus ``growth`` t.

    Returns the share t of the segment from a to b, and the least sum less the radius [m].
    """
    first = solids.starts[k]
    rise = b[2] - a[2] if solids.ball[k] > 0.0 else 0.0
    over = solids.low[k] - a[2] if solids.ball[k] > 0.0 else 0.0
    dx, dy = b[0] - a[0], b[1] - a[1]
    px, py = solids.outlines[first, 0] - a[0], solids.outlines[first, 1] - a[1]
    square = dx * dx + dy * dy + rise * rise
    along = px * dx + py * dy + over * rise
    t = 0.0 if growth >= 0.0 else 1.0
    if square > growth * growth:
        off2 = max(0.0, px * px + py * py + over * over - along * along / square)
        t = along / square - growth * np.sqrt(off2 / (square * (square - growth * growth)))
        t = min(1.0, max(0.0, t))
    x, y, z = px - t * dx, py - t * dy, over - t * rise
    return t, np.sqrt(x * x + y * y + z * z) + growth * t - solids.disc[k] - solids.ball[k]


@compiled
def least_along(
    solids: Uprights,
    k: int,
    a: Array,
    b: Array,
    at_a: float,
    at_b: float,
    low: float,
    high: float,
    steps: int,
) -> float:
    """Least signed distance along a segment, with what is added growing evenly from ``at_a`` to ``at_b`` [m].

    The sum is convex along the segment, so golden-section search closes in on its least value from above. It
    stops as soon as a value is below ``low``, or it is sure that none is below ``high``.
    """
    if solids.starts[k + 1] - solids.starts[k] == 1:
        t, least = nearest_to_axis(solids, k, a, b, at_b - at_a)
        value = distance_along(solids, k, a, b, t) + at_a + t * (at_b - at_a)
        # The way to the axis bounds the distance from below, so the two agree only in the least value.
        if least + at_a >= high or value <= least + at_a + AGREE:
            return value
    start, end, s, t = 0.0, 1.0, 1.0 - GOLDEN, GOLDEN
    slope = abs(at_b - at_a) + norm(minus(b, a))
    least = signed_distance(solids, k, a[0], a[1], a[2]) + at_a
    least = min(least, signed_distance(solids, k, b[0], b[1], b[2]) + at_b)
    at_s = distance_along(solids, k, a, b, s) + at_a + s * (at_b - at_a)
    at_t = distance_along(solids, k, a, b, t) + at_a + t * (at_b - at_a)
    for _ in range(steps):
        least = min(least, min(at_s, at_t))
        if least < low or min(at_s, at_t) - slope * (end - start) * (1.0 - GOLDEN) >= high:
            break
        if at_s <= at_t:
            end, t, at_t = t, s, at_s
            s = end - GOLDEN * (end - start)
            at_s = distance_along(solids, k, a, b, s) + at_a + s * (at_b - at_a)
        else:
            start, s, at_s = s, t, at_t
            t = start + GOLDEN * (end - start)
            at_t = distance_along(solids, k, a, b, t) + at_a + t * (at_b - at_a)
    return min(least, min(at_s, at_t))
