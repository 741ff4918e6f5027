"""Signed distances between convex bodies in closed form, many poses at once.

Along a unit direction, the gap of two convex bodies is a lower bound of their distance. The largest gap is
the distance itself, and it lies along a normal of a face, square to an edge of each, or along the shortest
way between two edges; bodies overlap by minus the largest gap along the first two kinds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.worlds.arrays import Array
from regionik.worlds.obstacles import Prism
from regionik.worlds.robot import LinkBox, LinkCapsule, LinkSolid

SIZE = 200_000  # directions or pairs of edges that are measured together, so that memory stays small
FLAT = 1e-9  # length below which a direction is not told from rounding


@dataclass(frozen=True, eq=False)
class Hull:
    """All points within ``radius`` of the convex hull of ``corners``.

    Attributes
    ----------
    corners : (k, 3) array
        [m]
    edges : (e, 2) array of int
        Indices into ``corners``.
    axes : (a, 3) array
        Unit directions of the edges, parallel ones once.
    normals : (f, 3) array
        Outward unit normals of the faces; of a segment, four square to it.
    radius : float
        [m]
    """

    corners: Array
    edges: NDArray[np.int64]
    axes: Array
    normals: Array
    radius: float

    def placed(self, T: Array) -> Array:
        """Corners in other frames, given the body's poses in them: (..., 4, 4) to (..., k, 3)."""
        corners: Array = self.corners @ T[..., :3, :3].swapaxes(-1, -2) + T[..., None, :3, 3]
        return corners


class Gap(NamedTuple):
    """Distances less both radii, and the unit directions that prove them, from still to moving."""

    distance: Array  # (m,) [m], minus the overlap
    normal: Array  # (m, 3)


def hull_of(solid: LinkSolid) -> Hull:
    """The solid of a link, in the link's frame."""
    match solid:
        case LinkCapsule():
            return _segment(solid.corners, solid.radius)
        case LinkBox():
            axes = solid.T_link_box[:3, :3].T
            edges = [(k, k + bit) for k in range(8) for bit in (1, 2, 4) if not k & bit]
            return Hull(solid.corners, np.array(edges), axes, np.vstack([axes, -axes]), solid.radius)


def hull_of_prism(prism: Prism) -> Hull:
    """An upright prism over the convex hull of its polygon."""
    outline = np.asarray(prism.polygon.convex_hull.exterior.coords)[:-1]
    n = len(outline)
    corners = np.vstack([np.column_stack([outline, np.full(n, z)]) for z in prism.z_range])
    ring = np.column_stack([np.arange(n), np.roll(np.arange(n), -1)])
    edges = np.vstack([ring, ring + n, np.column_stack([np.arange(n), np.arange(n) + n])])
    along = corners[ring[:, 1]] - corners[ring[:, 0]]
    along /= np.linalg.norm(along, axis=1)[:, None]
    up = np.array([[0.0, 0.0, 1.0]])
    sides = np.cross(along, up)  # both ways, so that it does not matter which way the outline runs
    return Hull(corners, edges, np.vstack([along, up]), np.vstack([sides, -sides, up, -up]), 0.0)


def _segment(ends: Array, radius: float) -> Hull:
    """A segment, or a point where its ends meet."""
    along = ends[1] - ends[0]
    length = float(np.linalg.norm(along))
    edge = np.array([[0, 1]])
    if length < FLAT:
        return Hull(ends, edge, np.zeros((0, 3)), np.vstack([np.eye(3), -np.eye(3)]), radius)
    axis = along / length
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    square = np.stack([side, np.cross(axis, side)])
    return Hull(ends, edge, axis[None], np.vstack([square, -square]), radius)


def beyond(still: Hull, corners: Array, normal: Array) -> Array:
    """How far corners (m, k, 3) of a moving hull lie beyond a still one along normals (m, 3), (m,) [m]."""
    gap: Array = np.einsum("mkj,mj->mk", corners, normal).min(-1) - (normal @ still.corners.T).max(-1)
    return gap


def plane_gaps(still: Hull, moving: Hull, T: Array) -> Gap:
    """Largest gaps along normals of faces and square to edges: minus the overlap, or below the distance.

    Parameters
    ----------
    still, moving : Hull
    T : (m, 4, 4) array
        Poses of the moving hull in the frame of the still one.
    """
    many = 2 * (len(still.normals) + len(moving.normals) + len(still.axes) * len(moving.axes))
    blocks = [_plane_gaps(still, moving, T[rows]) for rows in _blocks(len(T), 8 * many)]
    return Gap(*(np.concatenate(column) for column in zip(*blocks, strict=True)))


def gaps(still: Hull, moving: Hull, T: Array) -> Gap:
    """Signed distances of a moving hull from a still one.

    Parameters
    ----------
    still, moving : Hull
    T : (m, 4, 4) array
        Poses of the moving hull in the frame of the still one.
    """
    found, corners = plane_gaps(still, moving, T), moving.placed(T)
    blocks = _blocks(len(T), len(still.edges) * len(moving.edges))
    way = np.concatenate([_between_edges(still, corners[rows], moving) for rows in blocks])
    length = np.linalg.norm(way, axis=1, keepdims=True)
    normal = way / np.maximum(length, FLAT)
    reach = beyond(still, corners, normal) - still.radius - moving.radius
    better = (reach > found.distance) & (length[:, 0] > FLAT)
    distance = np.where(better, reach, found.distance)
    return Gap(distance, np.where(better[:, None], normal, found.normal))


def _plane_gaps(still: Hull, moving: Hull, T: Array) -> Gap:
    turn = T[:, :3, :3].swapaxes(1, 2)
    square = np.cross(still.axes[None, :, None], (moving.axes @ turn)[:, None])
    square = square.reshape(len(T), len(still.axes) * len(moving.axes), 3)
    size = np.linalg.norm(square, axis=-1, keepdims=True)
    square = np.where(size > FLAT, square / np.maximum(size, FLAT), 0.0)
    faces = np.broadcast_to(still.normals, (len(T), *still.normals.shape))
    directions = np.concatenate([faces, moving.normals @ turn, square, -square], axis=1)
    reach = (directions @ moving.placed(T).swapaxes(1, 2)).min(-1) - (directions @ still.corners.T).max(-1)
    reach = np.where(directions.any(-1), reach, -np.inf)
    best = reach.argmax(1)
    rows = np.arange(len(T))
    return Gap(reach[rows, best] - still.radius - moving.radius, directions[rows, best])


def _blocks(rows: int, each: int) -> list[slice]:
    """Slices of rows, `SIZE` numbers or so at a time when every row needs ``each``; at least one slice."""
    stride = max(1, SIZE // each)
    return [slice(k, k + stride) for k in range(0, max(rows, 1), stride)]


def _between_edges(still: Hull, corners: Array, moving: Hull) -> Array:
    """The shortest of the ways from edges of the still hull to edges of the moving one, (m, 3)."""
    a, b = (still.corners[still.edges[:, k]][None, :, None] for k in (0, 1))
    c, d = (corners[:, moving.edges[:, k]][:, None] for k in (0, 1))
    u, v, w = b - a, d - c, c - a
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    uw, vw = _dot(u, w), _dot(v, w)
    # Where the lines are nearest, if that is on both edges; else an end of one edge is nearest to the other.
    det = np.maximum(uu * vv - uv * uv, 1e-300)
    candidates = [
        (_unit((uw * vv - vw * uv) / det), _unit((uw * uv - vw * uu) / det)),
        *((_unit(_ratio(uw + t * uv, uu)), np.full_like(uv, t)) for t in (0.0, 1.0)),
        *((np.full_like(uv, s), _unit(_ratio(s * uv - vw, vv))) for s in (0.0, 1.0)),
    ]
    pairs = len(still.edges) * len(moving.edges)
    ways = np.concatenate(
        [(w + t[..., None] * v - s[..., None] * u).reshape(len(corners), pairs, 3) for s, t in candidates], 1
    )
    nearest: Array = ways[np.arange(len(corners)), _dot(ways, ways).argmin(1)]
    return nearest


def _dot(a: Array, b: Array) -> Array:
    product: Array = (a * b).sum(-1)
    return product


def _unit(t: Array) -> Array:
    clipped: Array = np.clip(t, 0.0, 1.0)
    return clipped


def _ratio(a: Array, b: Array) -> Array:
    """Quotients, and 0 where an edge is a point."""
    ratio: Array = np.where(b > 0, a / np.where(b > 0, b, 1.0), 0.0)
    return ratio
