"""Whether two convex bodies keep apart, in many poses at once.

Each body is all points within a radius of the hull of some corners. A plane between the two is looked for
by Gilbert's method: the point of their difference nearest to the origin is approached in steps, and as soon
as all that is seen in its direction is further away than the radii, there is one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regionik.worlds.arrays import Array

STEPS = 60  # bodies some hundredths of their size apart need a few; after all, they count as touching


@dataclass(frozen=True, eq=False)
class Hull:
    """All points within ``radius`` [m] of the hull of ``corners`` (n, 3) [m]."""

    corners: Array
    radius: float = 0.0


def apart(one: Hull, T_one: Array, other: Hull, T_other: Array) -> NDArray[np.bool_]:
    """In which pairs of poses (n, 4, 4) a plane between two bodies was found, (n,).

    Where it was, they do not touch. Where none was, they do, or nearly.
    """
    found = np.zeros(len(T_one), dtype=bool)
    left = np.arange(len(T_one))
    v = _placed(one.corners.mean(0), T_one) - _placed(other.corners.mean(0), T_other)
    for _ in range(STEPS):
        w = _furthest(one, T_one[left], -v) - _furthest(other, T_other[left], v)
        beyond = (v * w).sum(1) > (one.radius + other.radius) * np.linalg.norm(v, axis=1)
        found[left[beyond]] = True
        step = v - w
        gain, length = (v * step).sum(1), (step * step).sum(1)
        on = ~beyond & (gain > 0)
        if not on.any():
            break
        share = np.minimum(gain[on] / length[on], 1.0)
        left, v = left[on], v[on] - share[:, None] * step[on]
    return found


def _furthest(hull: Hull, T: Array, along: Array) -> Array:
    """The corner furthest along a direction, in each pose (n, 3)."""
    seen = np.argmax(np.einsum("nji,nj->ni", T[:, :3, :3], along) @ hull.corners.T, axis=1)
    return _placed(hull.corners[seen], T)


def _placed(points: Array, T: Array) -> Array:
    """Points (n, 3), or one, of frames (n, 4, 4)."""
    placed: Array = np.einsum("nij,nj->ni", T[:, :3, :3], np.broadcast_to(points, (len(T), 3))) + T[:, :3, 3]
    return placed
