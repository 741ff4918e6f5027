"""Signed distances between convex bodies in closed form, many poses at once.

The gap of two convex bodies along a unit direction is a lower bound of their distance, and the largest gap is
the distance itself (separating axis theorem). It lies along a face normal, along the cross product of an edge
of each, or along the shortest line between two edges; the penetration depth is minus the largest gap along
the first two kinds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.planners.collision.gjk import hull_distance
from regionik.worlds.arrays import Array
from regionik.worlds.links import LinkBox, LinkCapsule, LinkHull, LinkSolid
from regionik.worlds.obstacles import Prism

BLOCK = 200_000  # directions or pairs of edges measured together, so that memory stays small
DEGENERATE = 1e-9  # length below which a direction is lost in rounding


@dataclass(frozen=True, eq=False)
class RoundedHull:
    """All points within ``radius`` of the convex hull of ``corners``.

    Attributes
    ----------
    corners : (k, 3) array
        [m]
    edges : (e, 2) array of int
        Indices into ``corners``; none of hulls with so many that the walk of GJK is faster.
    axes : (a, 3) array
        Unit directions of the edges, parallel ones once.
    normals : (f, 3) array
        Outward unit normals of the faces; of a segment, four perpendicular to it.
    radius : float
        [m]
    """

    corners: Array
    edges: NDArray[np.int64]
    axes: Array
    normals: Array
    radius: float

    def corners_in(self, T: Array) -> Array:
        """Corners (..., k, 3) in frames in which the body has the poses T (..., 4, 4)."""
        corners: Array = self.corners @ T[..., :3, :3].swapaxes(-1, -2) + T[..., None, :3, 3]
        return corners


class SignedDistances(NamedTuple):
    """Distances less both radii, and the unit directions, from fixed to moving, that prove them."""

    distance: Array  # (m,) [m], minus the penetration depth
    normal: Array  # (m, 3)


def link_hull(solid: LinkSolid) -> RoundedHull:
    """Solid of a link, in the link's frame."""
    match solid:
        case LinkCapsule():
            return _segment(solid.corners, solid.radius)
        case LinkBox():
            axes = solid.T_link_box[:3, :3].T
            edges = [(k, k + bit) for k in range(8) for bit in (1, 2, 4) if not k & bit]
            return RoundedHull(solid.corners, np.array(edges), axes, np.vstack([axes, -axes]), solid.radius)
        case LinkHull():
            whole = solid.polytope
            none = np.zeros((0, 2), dtype=np.int64)
            return RoundedHull(solid.corners, none, whole.edges, whole.normals, solid.radius)


def prism_hull(prism: Prism) -> RoundedHull:
    """Upright prism over the convex hull of its polygon."""
    outline = np.asarray(prism.polygon.convex_hull.exterior.coords)[:-1]
    n = len(outline)
    corners = np.vstack([np.column_stack([outline, np.full(n, z)]) for z in prism.z_range])
    ring = np.column_stack([np.arange(n), np.roll(np.arange(n), -1)])
    edges = np.vstack([ring, ring + n, np.column_stack([np.arange(n), np.arange(n) + n])])
    along = corners[ring[:, 1]] - corners[ring[:, 0]]
    along /= np.linalg.norm(along, axis=1)[:, None]
    up = np.array([[0.0, 0.0, 1.0]])
    sides = np.cross(along, up)  # used both ways, so that the outline may run either way
    return RoundedHull(corners, edges, np.vstack([along, up]), np.vstack([sides, -sides, up, -up]), 0.0)


def _segment(ends: Array, radius: float) -> RoundedHull:
    """Line segment, or a point where its ends meet."""
    along = ends[1] - ends[0]
    length = float(np.linalg.norm(along))
    edge = np.array([[0, 1]])
    if length < DEGENERATE:
        return RoundedHull(ends, edge, np.zeros((0, 3)), np.vstack([np.eye(3), -np.eye(3)]), radius)
    axis = along / length
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    normals = np.stack([side, np.cross(axis, side)])
    return RoundedHull(ends, edge, axis[None], np.vstack([normals, -normals]), radius)


def gap_along(fixed: RoundedHull, corners: Array, normal: Array) -> Array:
    """Gap from the corners of a fixed hull to corners (m, k, 3) along normals (m, 3), (m,) [m]."""
    gap: Array = np.einsum("mkj,mj->mk", corners, normal).min(-1) - (normal @ fixed.corners.T).max(-1)
    return gap


def face_distances(fixed: RoundedHull, moving: RoundedHull, T: Array) -> SignedDistances:
    """Largest gaps along face normals and cross products of edges.

    They are minus the penetration depth where the hulls overlap, and at most the distance elsewhere. Of hulls
    whose edges are not listed only faces count, so that depths may be told too large.

    Parameters
    ----------
    fixed, moving : RoundedHull
    T : (m, 4, 4) array
        Poses of the moving hull in the frame of the fixed one.
    """
    if not _has_edges(fixed, moving):
        fixed, moving = (replace(hull, axes=np.zeros((0, 3))) for hull in (fixed, moving))
    many = 2 * (len(fixed.normals) + len(moving.normals) + len(fixed.axes) * len(moving.axes))
    blocks = [_face_distances(fixed, moving, T[rows]) for rows in _blocks(len(T), 8 * many)]
    return SignedDistances(*(np.concatenate(column) for column in zip(*blocks, strict=True)))


def signed_distances(fixed: RoundedHull, moving: RoundedHull, T: Array) -> SignedDistances:
    """Signed distances of a moving hull from a fixed one.

    Parameters
    ----------
    fixed, moving : RoundedHull
    T : (m, 4, 4) array
        Poses of the moving hull in the frame of the fixed one.
    """
    found, corners = face_distances(fixed, moving, T), moving.corners_in(T)
    if not _has_edges(fixed, moving):
        return _with_planes(fixed, moving, T, found)
    blocks = _blocks(len(T), len(fixed.edges) * len(moving.edges))
    line = np.concatenate([_shortest_between_edges(fixed, corners[rows], moving) for rows in blocks])
    length = np.linalg.norm(line, axis=1, keepdims=True)
    normal = line / np.maximum(length, DEGENERATE)
    gap = gap_along(fixed, corners, normal) - fixed.radius - moving.radius
    better = (gap > found.distance) & (length[:, 0] > DEGENERATE)
    distance = np.where(better, gap, found.distance)
    return SignedDistances(distance, np.where(better[:, None], normal, found.normal))


def _has_edges(fixed: RoundedHull, moving: RoundedHull) -> bool:
    return len(fixed.edges) > 0 and len(moving.edges) > 0


def _with_planes(
    fixed: RoundedHull, moving: RoundedHull, T: Array, found: SignedDistances
) -> SignedDistances:
    """Signed distances, by the plane between the hulls where they are apart: the walk of GJK finds it.

    Where their cores overlap all cross products of edges are looked at.
    """
    distance, normal = found.distance.copy(), found.normal.copy()
    one = np.ascontiguousarray(fixed.corners)
    for k, placed in enumerate(moving.corners_in(T)):
        along, spot = normal[k].copy(), np.empty(3)
        hull_distance(np.ascontiguousarray(placed), one, 0.0, along, spot)
        gap = gap_along(fixed, placed[None], along[None])[0] - fixed.radius - moving.radius
        if gap <= -fixed.radius - moving.radius:
            (gap,), (along,) = _face_distances(fixed, moving, T[k : k + 1])
        if gap > distance[k]:
            distance[k], normal[k] = gap, along
    return SignedDistances(distance, normal)


def _face_distances(fixed: RoundedHull, moving: RoundedHull, T: Array) -> SignedDistances:
    R = T[:, :3, :3].swapaxes(1, 2)
    cross = np.cross(fixed.axes[None, :, None], (moving.axes @ R)[:, None])
    cross = cross.reshape(len(T), len(fixed.axes) * len(moving.axes), 3)
    size = np.linalg.norm(cross, axis=-1, keepdims=True)
    cross = np.where(size > DEGENERATE, cross / np.maximum(size, DEGENERATE), 0.0)
    faces = np.broadcast_to(fixed.normals, (len(T), *fixed.normals.shape))
    directions = np.concatenate([faces, -moving.normals @ R, cross, -cross], axis=1)
    near = (directions @ moving.corners_in(T).swapaxes(1, 2)).min(-1)
    gap = near - (directions @ fixed.corners.T).max(-1)
    gap = np.where(directions.any(-1), gap, -np.inf)
    best = gap.argmax(1)
    rows = np.arange(len(T))
    return SignedDistances(gap[rows, best] - fixed.radius - moving.radius, directions[rows, best])


def _blocks(rows: int, each: int) -> list[slice]:
    """Slices of rows that take about `BLOCK` numbers where every row needs ``each``; at least one."""
    stride = max(1, BLOCK // each)
    return [slice(k, k + stride) for k in range(0, max(rows, 1), stride)]


def _shortest_between_edges(fixed: RoundedHull, corners: Array, moving: RoundedHull) -> Array:
    """Shortest vectors from an edge of the fixed hull to one of the moving hull, (m, 3).

    The nearest points a + s u and c + t v of two lines solve two linear equations in s and t; where they are
    not on both edges, an end of one edge is nearest to the other edge.
    """
    a, b = (fixed.corners[fixed.edges[:, k]][None, :, None] for k in (0, 1))
    c, d = (corners[:, moving.edges[:, k]][:, None] for k in (0, 1))
    u, v, w = b - a, d - c, c - a
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    uw, vw = _dot(u, w), _dot(v, w)
    det = np.maximum(uu * vv - uv * uv, 1e-300)
    candidates = [
        (_clip01((uw * vv - vw * uv) / det), _clip01((uw * uv - vw * uu) / det)),
        *((_clip01(_ratio(uw + t * uv, uu)), np.full_like(uv, t)) for t in (0.0, 1.0)),
        *((np.full_like(uv, s), _clip01(_ratio(s * uv - vw, vv))) for s in (0.0, 1.0)),
    ]
    pairs = len(fixed.edges) * len(moving.edges)
    vectors = np.concatenate(
        [(w + t[..., None] * v - s[..., None] * u).reshape(len(corners), pairs, 3) for s, t in candidates], 1
    )
    shortest: Array = vectors[np.arange(len(corners)), _dot(vectors, vectors).argmin(1)]
    return shortest


def _dot(a: Array, b: Array) -> Array:
    product: Array = (a * b).sum(-1)
    return product


def _clip01(t: Array) -> Array:
    clipped: Array = np.clip(t, 0.0, 1.0)
    return clipped


def _ratio(a: Array, b: Array) -> Array:
    """Quotients, and 0 where an edge is a point."""
    ratio: Array = np.where(b > 0, a / np.where(b > 0, b, 1.0), 0.0)
    return ratio
