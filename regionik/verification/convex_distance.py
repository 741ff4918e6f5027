"""Signed distances between convex bodies, each proven by a direction.

The gap of two convex bodies along a unit direction is a lower bound of their distance, and the largest gap is
the distance itself (separating axis theorem). So whatever the walk of GJK comes to, what is told is proven.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from regionik.planners.collision.gjk import hull_distance
from regionik.worlds.arrays import Array
from regionik.worlds.obstacles import Prism


@dataclass(frozen=True, eq=False)
class RoundedHull:
    """All points within ``radius`` of the convex hull of ``corners``."""

    corners: Array  # (k, 3) [m]
    radius: float  # [m]

    def corners_in(self, T: Array) -> Array:
        """Corners (..., k, 3) in frames in which the body has the poses T (..., 4, 4)."""
        return self.corners @ T[..., :3, :3].swapaxes(-1, -2) + T[..., None, :3, 3]


class SignedDistances(NamedTuple):
    """Distances less both radii, and the unit directions, from fixed to moving, that prove them."""

    distance: Array  # (m,) [m], minus the penetration depth
    normal: Array  # (m, 3)


def prism_hull(prism: Prism) -> RoundedHull:
    """Upright prism over the convex hull of its polygon."""
    outline = np.asarray(prism.polygon.convex_hull.exterior.coords)[:-1]
    ends = [np.column_stack([outline, np.full(len(outline), z)]) for z in prism.z_range]
    return RoundedHull(np.vstack(ends), 0.0)


def gap_along(fixed: RoundedHull, corners: Array, normal: Array) -> Array:
    """Gap from the corners of a fixed hull to corners (m, k, 3) along normals (m, 3), (m,) [m]."""
    return np.einsum("mkj,mj->mk", corners, normal).min(-1) - (normal @ fixed.corners.T).max(-1)


def signed_distances(fixed: RoundedHull, moving: RoundedHull, T: Array) -> SignedDistances:
    """Signed distances of a fixed hull from a moving one, at its poses T (m, 4, 4) in the other's frame."""
    corners, own = moving.corners_in(T), np.ascontiguousarray(fixed.corners)
    normal = np.array([_normal(own, placed) for placed in corners]).reshape(-1, 3)
    return SignedDistances(gap_along(fixed, corners, normal) - fixed.radius - moving.radius, normal)


def _normal(fixed: Array, moving: Array) -> Array:
    """Direction from one hull to another along which their gap is largest; zeros where flat ones meet."""
    normal: Array = moving.mean(0) - fixed.mean(0)
    if hull_distance(moving, fixed, 0.0, normal, np.empty(3))[0] > 0:
        return normal
    try:
        faces = ConvexHull((moving[:, None] - fixed).reshape(-1, 3)).equations
    except QhullError:
        return np.zeros(3)
    return -faces[np.argmax(faces[:, 3]), :3]
