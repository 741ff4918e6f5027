"""Proven bounds of the distance between convex hulls, compiled.

The walk to the nearest points is that of Gilbert, Johnson and Keerthi (1988), the least point of each simplex
that of Wolfe (1976). The bounds do not rest on the walk: along any direction v the distance is at least
(min over A of v . a - max over B of v . b) / |v|, and the best such bound met is returned.
"""

from __future__ import annotations

import math

import numpy as np

from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array

MAX_STEPS = 64  # polytopes take less than ten; only discs need more
TOUCHING = 1e-12  # a distance that counts as none [m]
TIGHT = 1e-10  # between lower and upper bound where the walk ends [m]
_FLAT = 1e-13  # of a simplex against its size, where it has lost a dimension


@compiled
def hull_distance(A: Array, B: Array, disc: float, normal: Array, spot: Array) -> tuple[float, float]:
    """Bounds of the distance of the hull of A from the hull of B grown level by a disc.

    Parameters
    ----------
    A : (n, 3) array
    B : (m, 3) array
    disc : float [m]
    normal : (3,) array
        A first guess of the direction from B to A, or zeros. Overwritten with the unit direction along which
        the hulls are ``lower`` apart.
    spot : (3,) array
        Overwritten with the point of A nearest to B.

    Returns
    -------
    lower, upper : float
        [m]; ``lower`` is at most 0 where the hulls meet.
    """
    points, places, weights = np.empty((4, 3)), np.empty((4, 3)), np.zeros(4)
    v = normal.copy()
    if v[0] == 0.0 and v[1] == 0.0 and v[2] == 0.0:
        v[:] = A[0] - B[0]
        if v[0] == 0.0 and v[1] == 0.0 and v[2] == 0.0:
            v[2] = 1.0
    count, lower, upper = 0, -np.inf, np.inf
    for _ in range(MAX_STEPS):
        size = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        if count > 0:
            if size >= upper:
                break
            upper = size
        if size < TOUCHING or count == 4:
            break
        i, j, gap = support_points(A, B, v)
        level = math.sqrt(v[0] * v[0] + v[1] * v[1])
        bound = (gap - disc * level) / size
        if bound > lower:
            lower = bound
            for d in range(3):
                normal[d] = v[d] / size
        if upper - lower <= TIGHT:
            break
        push = disc / level if level > 0.0 else 0.0
        for d in range(3):
            places[count, d] = A[i, d]
            points[count, d] = A[i, d] - B[j, d] - (push * v[d] if d < 2 else 0.0)
        weights[count] = 1.0 if count == 0 else 0.0
        count = _nearest_of_simplex(points, places, weights, count + 1, v)
    for d in range(3):
        spot[d] = 0.0
        for k in range(count):
            spot[d] += weights[k] * places[k, d]
    return lower, upper


@compiled
def support_points(A: Array, B: Array, v: Array) -> tuple[int, int, float]:
    """Support points: the corner of A least far along v, that of B farthest, and the gap between them."""
    i, low = 0, np.inf
    for k in range(len(A)):
        along = A[k, 0] * v[0] + A[k, 1] * v[1] + A[k, 2] * v[2]
        if along < low:
            i, low = k, along
    j, high = 0, -np.inf
    for k in range(len(B)):
        along = B[k, 0] * v[0] + B[k, 1] * v[1] + B[k, 2] * v[2]
        if along > high:
            j, high = k, along
    return i, j, low - high


@compiled
def _nearest_of_simplex(points: Array, places: Array, weights: Array, count: int, v: Array) -> int:
    """Write the point of a simplex nearest to the origin into v, and drop the corners that it does not need.

    Returns how many corners are left.
    """
    full = np.empty(4)
    while _affine_weights(points, count, full):
        part, worst = 1.0, -1
        for k in range(count):
            if full[k] <= 0.0:
                share = weights[k] / (weights[k] - full[k]) if weights[k] > 0.0 else 0.0
                if share < part or worst < 0:
                    part, worst = share, k
        for k in range(count):
            weights[k] += part * (full[k] - weights[k])
        if worst < 0:
            break
        count -= 1
        points[worst], places[worst], weights[worst] = points[count], places[count], weights[count]
    else:
        count -= 1  # the newest corner lies in the plane of the others
    for d in range(3):
        v[d] = 0.0
        for k in range(count):
            v[d] += weights[k] * points[k, d]
    return count


@compiled
def _affine_weights(points: Array, count: int, full: Array) -> bool:
    """Weights of the point nearest to the origin in the span of all corners; False where it is degenerate."""
    n = count - 1
    G, x, edge = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for r in range(n):
        for d in range(3):
            edge[r, d] = points[r + 1, d] - points[0, d]
        x[r] = 0.0
        for d in range(3):
            x[r] -= edge[r, d] * points[0, d]
        for c in range(r + 1):
            G[r, c] = edge[r, 0] * edge[c, 0] + edge[r, 1] * edge[c, 1] + edge[r, 2] * edge[c, 2]
            G[c, r] = G[r, c]
    for k in range(n):
        whole = edge[k, 0] * edge[k, 0] + edge[k, 1] * edge[k, 1] + edge[k, 2] * edge[k, 2]
        if G[k, k] <= _FLAT * whole:
            return False
        for r in range(k + 1, n):
            share = G[r, k] / G[k, k]
            for c in range(k, n):
                G[r, c] -= share * G[k, c]
            x[r] -= share * x[k]
    full[0] = 1.0
    for k in range(n - 1, -1, -1):
        for c in range(k + 1, n):
            x[k] -= G[k, c] * x[c]
        x[k] /= G[k, k]
        full[k + 1] = x[k]
        full[0] -= x[k]
    return True
