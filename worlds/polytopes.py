"""Convex polytopes by their corners: faces, edges, and how deep a point lies in one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from regionik.worlds.arrays import Array, Index
from regionik.worlds.errors import InputError

_DIRECTION_DECIMALS = 9  # decimals to which directions are told apart


@dataclass(frozen=True, eq=False)
class Polytope:
    """The convex hull of corners, with all that its corners tell."""

    corners: Array  # (n, 3) as given; some may lie inside [m]
    triangles: Index  # (m, 3) rows of ``corners``, counter-clockwise seen from outside
    normals: Array  # (f, 3) outward unit normals of the faces
    offsets: Array  # (f,) points x inside have ``normals @ x <= offsets`` [m]
    edges: Array  # (e, 3) unit directions of the edges, each once

    def depth(self, points: Array) -> Array:
        """Return the depth of points (..., 3) below the nearest plane of a face, negative outside [m]."""
        below: Array = (self.offsets - points @ self.normals.T).min(-1)
        return below

    def moved(self, T: Array) -> Polytope:
        """Return the polytope moved by a transform (4, 4)."""
        turn = T[:3, :3]
        normals, corners = self.normals @ turn.T, self.corners @ turn.T + T[:3, 3]
        offsets = self.offsets + normals @ T[:3, 3]
        return Polytope(corners, self.triangles, normals, offsets, self.edges @ turn.T)


def polytope(corners: Array) -> Polytope:
    """Return the polytope with given corners (n, 3): an `InputError` where all lie in one plane."""
    try:
        hull = ConvexHull(corners)
    except (QhullError, ValueError):
        raise InputError("expected at least four corners that do not lie in one plane") from None
    normals, offsets = hull.equations[:, :3], -hull.equations[:, 3]
    ends = corners[hull.simplices]
    turned = (np.cross(ends[:, 1] - ends[:, 0], ends[:, 2] - ends[:, 0]) * normals).sum(1) < 0
    triangles = np.where(turned[:, None], hull.simplices[:, ::-1], hull.simplices)
    faces = np.unique(np.round(hull.equations, _DIRECTION_DECIMALS), axis=0, return_index=True)[1]
    beyond = (corners @ normals.T).max(0)  # Qhull's planes may miss a corner by rounding
    return Polytope(
        corners,
        triangles.astype(np.int64),
        normals[faces],
        np.maximum(offsets, beyond)[faces],
        _edge_directions(corners, hull),
    )


def _edge_directions(corners: Array, hull: ConvexHull) -> Array:
    """Return the directions (e, 3) of edges between faces that are not in one plane."""
    k, corner = np.nonzero(hull.neighbors > np.arange(len(hull.simplices))[:, None])
    normals, other = hull.equations[:, :3], hull.neighbors[k, corner]
    bent = (normals[k] * normals[other]).sum(axis=1) < 1 - 10.0**-_DIRECTION_DECIMALS
    a, b = (corners[hull.simplices[k, (corner + n) % 3][bent]] for n in (1, 2))
    directions = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
    lead = directions[np.arange(len(directions)), np.argmax(np.abs(directions), axis=1)]
    directions *= np.sign(lead)[:, None]
    once = np.unique(np.round(directions, _DIRECTION_DECIMALS), axis=0)
    units: Array = once / np.linalg.norm(once, axis=1)[:, None]
    return units
