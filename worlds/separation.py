"""Separation of convex bodies in many poses.

It is decided by Gilbert's method: the point of the bodies' Minkowski difference nearest to the origin is
approached in steps, and as soon as its support in that direction lies further away than the radii, a plane
separates them. Where steps are many, planes along the bodies' own axes are tried.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from regionik.worlds.arrays import Array, Mask

MAX_STEPS = 60  # bodies some hundredths of their size apart need a few; after all, they count as touching
_TOUCHING = 1e-6  # apart by no more, by rounding [m]
_SUM_WEIGHT = 1e3  # of the sums of weights, which are 1, against lengths [m]


@dataclass(frozen=True, eq=False)
class ConvexBody:
    """All points within ``radius`` [m] of the convex hull of ``corners`` (n, 3) [m]."""

    corners: Array
    radius: float = 0.0

    def support(self, T: Array, along: Array) -> Array:
        """Return the corner furthest along directions (n, 3), at poses (n, 4, 4), as (n, 3)."""
        seen = np.argmax(np.einsum("nji,nj->ni", T[:, :3, :3], along) @ self.corners.T, axis=1)
        return _transformed(self.corners[seen], T)


def separated(one: ConvexBody, T_one: Array, other: ConvexBody, T_other: Array) -> Mask:
    """Return True for each pair of poses (n, 4, 4) at which a plane between two bodies was found, (n,).

    Where none was found, they touch, or nearly.
    """
    found = np.zeros(len(T_one), dtype=bool)
    left = np.arange(len(T_one))
    v = _transformed(one.corners.mean(0), T_one) - _transformed(other.corners.mean(0), T_other)
    for _ in range(MAX_STEPS):
        w = one.support(T_one[left], -v) - other.support(T_other[left], v)
        beyond = (v * w).sum(1) > (one.radius + other.radius) * np.linalg.norm(v, axis=1)
        found[left[beyond]] = True
        step = v - w
        gain, length = (v * step).sum(1), (step * step).sum(1)
        on = ~beyond & (gain > 0)
        if not on.any():
            break
        share = np.minimum(gain[on] / length[on], 1.0)
        left, v = left[on], v[on] - share[:, None] * step[on]
    left = np.flatnonzero(~found)
    if len(left):
        A, B = T_one[left], T_other[left]
        found[left] = _apart_along_axes(one, A, other, B) | _apart_along_axes(other, B, one, A)
    return found


def _apart_along_axes(one: ConvexBody, T_one: Array, other: ConvexBody, T_other: Array) -> Mask:
    """Return True where a plane square to an axis of the frame of ``one`` parts two bodies, (n,).

    Steps need hundreds to part a small body from a large one near the middle of its face.
    """
    R_one = T_one[:, :3, :3].swapaxes(1, 2)
    seen = other.corners @ (R_one @ T_other[:, :3, :3]).swapaxes(1, 2)
    seen += np.einsum("nij,nj->ni", R_one, T_other[:, :3, 3] - T_one[:, :3, 3])[:, None]
    gaps = np.maximum(seen.min(1) - one.corners.max(0), one.corners.min(0) - seen.max(1))
    apart: Mask = gaps.max(1) > one.radius + other.radius
    return apart


def apart_somewhere(one: ConvexBody, T_one: Array, other: ConvexBody, T_other: Array) -> bool:
    """True if two bodies do not touch in one of the poses (n, 4, 4) at least, decided to rounding.

    A plane is soon found, where there is one; where none was, as between a large body and a small one near
    the middle of its face, the nearest points are those of a least-squares problem.
    """
    if separated(one, T_one, other, T_other).any():
        return True
    radii = one.radius + other.radius + _TOUCHING
    return any(_core_distance(one, A, other, B) > radii for A, B in zip(T_one, T_other, strict=True))


def _core_distance(one: ConvexBody, T_one: Array, other: ConvexBody, T_other: Array) -> float:
    """Distance of the hulls of two bodies' corners, of points weighed by 0 or more, 1 in all [m]."""
    p, q = (body.corners @ T[:3, :3].T + T[:3, 3] for body, T in ((one, T_one), (other, T_other)))
    sums = np.zeros((2, len(p) + len(q)))
    sums[0, : len(p)] = sums[1, len(p) :] = _SUM_WEIGHT
    weights, _ = nnls(
        np.vstack([np.concatenate([p, -q]).T, sums]), np.array([0, 0, 0, _SUM_WEIGHT, _SUM_WEIGHT])
    )
    return float(np.linalg.norm(weights[: len(p)] @ p - weights[len(p) :] @ q))


def _transformed(points: Array, T: Array) -> Array:
    """Return points (n, 3), or one for all, moved by transforms (n, 4, 4)."""
    moved: Array = np.einsum("nij,nj->ni", T[:, :3, :3], np.broadcast_to(points, (len(T), 3))) + T[:, :3, 3]
    return moved
