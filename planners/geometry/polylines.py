"""Polylines: cut into short parts, their lengths, and values spread along them."""

from __future__ import annotations

import math

import numpy as np

from regionik.planners.geometry.vectors import minus, norm, row
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index


@compiled
def leg_lengths(knots: Array) -> Array:
    """Lengths (k - 1,) of legs between base poses (k, 3), turns counted as metres; NaN headings are free."""
    lengths = np.empty(len(knots) - 1)
    for n in range(len(lengths)):
        x, y, turn = knots[n + 1] - knots[n]
        turn = (turn + math.pi) % (2 * math.pi) - math.pi
        lengths[n] = np.hypot(x, y) + (0.0 if math.isnan(turn) else abs(turn))
    return lengths


@compiled
def laid_out(
    knots: Array, tool: Array, spots: Array, joints: Array, stride: float
) -> tuple[Array, Array, Index, Array]:
    """Lay out a motion from knot to knot: tool positions and joints at the knots, and where to cut the legs.

    Parameters
    ----------
    knots : (k, 3) array
        Base poses [m], [rad].
    tool : (k,) array
        Part of the tool's straight way that is done at every knot.
    spots, joints : (2, 3), (2, dof) arrays
        Where the tool is at both ends [m], and joints wished for there.
    stride : float
        Longest part of the base's way, or of the tool's, between two cuts [m].

    Returns
    -------
    points : (k, 3) array
        Where the tool is at every knot [m].
    wished : (k, dof) array
        Joints there, spread over the lengths of base's and tool's way together.
    leg, share : (n,) arrays
        Leg and share of it of cuts that are a stride apart at most, all knots but the first among them.
    """
    count, base, goes = len(knots), leg_lengths(knots), norm(minus(row(spots, 1), row(spots, 0)))
    far, pieces = np.zeros(count), np.empty(count - 1, dtype=np.int64)
    for n in range(count - 1):
        moves = (tool[n + 1] - tool[n]) * goes
        far[n + 1] = far[n] + base[n] + moves
        pieces[n] = max(1, math.ceil(max(base[n], moves) / stride))
    far = far / far[-1] if far[-1] > 0.0 else np.arange(count) / max(count - 1, 1)
    leg, share = np.empty(pieces.sum(), dtype=np.int64), np.empty(pieces.sum())
    at = 0
    for n in range(count - 1):
        for k in range(1, pieces[n] + 1):
            leg[at], share[at] = n, k / pieces[n]
            at += 1
    ends = np.zeros(count, dtype=np.int64)
    return between(spots, ends, tool), between(joints, ends, far), leg, share


@compiled
def between(knots: Array, leg: Index, share: Array) -> Array:
    """Interpolate knots (k, m) at shares (n,) of legs (n,), as (n, m); a share of 1 is the next knot."""
    values = np.empty((len(leg), knots.shape[1]))
    for n in range(len(leg)):
        a, b = knots[leg[n]], knots[leg[n] + 1]
        for i in range(len(a)):
            values[n, i] = b[i] if share[n] >= 1.0 else a[i] + share[n] * (b[i] - a[i])
    return values


@compiled
def cut(path: Array, step: float) -> Array:
    """Cut every leg of a path (k, 2) into equal parts no longer than ``step`` [m]; the points given stay."""
    legs = len(path) - 1
    parts = np.ones(legs, np.int64)
    for k in range(legs):
        # The tiny allowance keeps a leg of 0.3 / 0.1 steps from being cut in four by rounding.
        way = np.hypot(path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1])
        parts[k] = max(1, int(np.ceil(way / step - 1e-9)))
    points, n = np.empty((parts.sum() + 1, 2)), 1
    points[0] = path[0]
    for k in range(legs):
        for m in range(1, parts[k]):
            points[n] = path[k] + (path[k + 1] - path[k]) * (m / parts[k])
            n += 1
        points[n] = path[k + 1]
        n += 1
    return points


def spread_along(path: Array, step: float, parts: int) -> tuple[Array, Array]:
    """Shares of a path's length that cut its legs to steps, and the path to at least so many parts.

    Returns the shares strictly between 0 and 1, (n,), and the points there, (n, 2) [m].
    """
    points = cut(path, step)
    lengths = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    total = float(lengths[-1])
    shares = np.sort(np.append(lengths / (total or 1.0), np.arange(parts) * (1.0 / max(parts, 1))))
    kept = shares[(np.diff(shares, prepend=0.0) > 1e-9) & (shares < 1.0)]
    return kept, np.column_stack([np.interp(kept * total, lengths, row) for row in points.T])
