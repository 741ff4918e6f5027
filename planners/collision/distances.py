"""Distances between arm links and solids, with the points that witness them.

A link is a segment with a radius, so its distance is that of the segment less the radius, or a box. fcl
measures both against surfaces of triangles, and its word is taken where it is proven, by `_proven`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionik.planners.collision.convex_bodies import (
    NONE,
    TOUCH,
    UP,
    Piece,
    Separation,
    contains,
    from_ball,
    from_cylinder,
    way_out,
    within_box,
)
from regionik.planners.collision.gjk import hull_gap
from regionik.planners.collision.meshes import BOX, between, box, face_tree, nearest_face, segment, surface
from regionik.planners.geometry.convex_decomposition import convex_pieces
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Solid, Sphere
from regionik.worlds.robot import LinkSolid

EXACT = 1e-8  # of a distance that a plane proves [m]


class Near(NamedTuple):
    """The nearest solid to a link."""

    distance: float  # [m], negative where they overlap
    solid: int  # index into Obstacles.solids, -1 where there is none
    on_link: Array  # (3,) [m]
    on_solid: Array  # (3,) [m]


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Solids prepared for distance queries; made by `obstacles_from`.

    Attributes
    ----------
    solids : tuple of Solid
    pieces : tuple of Piece
        Convex parts, and meshes whole.
    owner : (m,) array of int
        The solid of each piece.
    low, high : (m, 3) array
        Boxes along the axes round the pieces [m].
    """

    solids: tuple[Solid, ...]
    pieces: tuple[Piece, ...]
    owner: NDArray[np.int64]
    low: Array
    high: Array


def obstacles_from(solids: Sequence[Solid]) -> Obstacles:
    """Cut solids into convex pieces and prepare them for distance queries; kept for the last few scenes."""
    return _obstacles(tuple(solids))


@lru_cache(maxsize=8)
def _obstacles(solids: tuple[Solid, ...]) -> Obstacles:
    parts = [(k, piece) for k, solid in enumerate(solids) for piece in _pieces(solid)]
    pieces = tuple(piece for _, piece in parts)
    owner = np.array([k for k, _ in parts], dtype=np.int64)
    axes = np.eye(3)
    high = np.array([piece.support(axes) for piece in pieces]).reshape(-1, 3)
    low = -np.array([piece.support(-axes) for piece in pieces]).reshape(-1, 3)
    return Obstacles(solids, pieces, owner, low, high)


def capsule_distance(
    obstacles: Obstacles,
    start: ArrayLike,
    end: ArrayLike,
    radius: float,
    *,
    only: Sequence[int] | None = None,
) -> Near:
    """Distance of a capsule from the nearest solid.

    Where the capsule's axis enters a convex piece, the distance is minus the shortest way out of that piece
    (of cylinders: the shortest of a fine fan of ways); inside a mesh it is minus the way to its surface.

    Parameters
    ----------
    obstacles : Obstacles
    start, end : (3,) array_like
        Ends of the capsule's axis [m].
    radius : float
        [m]
    only : sequence of int, optional
        Indices of the solids to look at; all by default.

    Returns
    -------
    Near
        Infinite and -1 where there is no solid.

    Raises
    ------
    InputError
        When a number is not finite.
    """
    a, b = frozen(start, (3,), "capsule: start"), frozen(end, (3,), "capsule: end")
    frozen(radius, (), "capsule: radius")
    gaps = aabb_gaps(obstacles, a[None], b[None], np.array([radius]))[0]
    if only is not None:
        gaps = np.where(np.isin(obstacles.owner, only), gaps, np.inf)
    best, owner = Separation(np.inf, UP, np.full(3, np.nan)), -1
    for k in np.argsort(gaps, kind="stable"):
        if gaps[k] >= best.distance - radius:
            break
        found = separation(obstacles.pieces[k], a, b)
        if found.distance < best.distance:
            best, owner = found, int(obstacles.owner[k])
    if owner < 0:
        return Near(np.inf, -1, best.on_axis, best.on_axis)
    on_link = best.on_axis - radius * best.normal
    return Near(best.distance - radius, owner, on_link, best.on_axis - best.distance * best.normal)


def aabb_gaps(obstacles: Obstacles, starts: Array, ends: Array, radii: ArrayLike) -> Array:
    """Lower bounds of the distances between capsules and pieces, from their boxes along the axes.

    Parameters
    ----------
    obstacles : Obstacles
    starts, ends : (n, 3) array
        [m]
    radii : (n,) array_like
        [m]

    Returns
    -------
    (n, m) array
        [m]; -inf where the box of a capsule's axis meets that of a piece.
    """
    low, high = np.minimum(starts, ends)[:, None], np.maximum(starts, ends)[:, None]
    gaps: Array = box_gaps(obstacles, low, high) - np.asarray(radii)[:, None]
    return gaps


def solids_within(obstacles: Obstacles, point: Array, reach: float) -> list[tuple[float, int]]:
    """Distances [m] of a point from the solids within ``reach`` of it, and their indices, nearest first."""
    spot = point[None, None]
    near = np.unique(obstacles.owner[box_gaps(obstacles, spot, spot)[0] <= reach]).tolist()
    gaps = sorted((float(obstacles.solids[k].distance(point)), k) for k in near)
    return [(gap, k) for gap, k in gaps if gap <= reach]


def box_gaps(obstacles: Obstacles, low: Array, high: Array) -> Array:
    """Distances between boxes (n, 1, 3) and the boxes of all pieces, (n, m); -inf where they meet [m]."""
    square = np.zeros((len(low), len(obstacles.pieces)))
    for k in range(3):
        apart = np.maximum(low[..., k] - obstacles.high[:, k], obstacles.low[:, k] - high[..., k])
        square += np.maximum(apart, 0.0) ** 2
    return np.where(square > 0, np.sqrt(square), -np.inf)


def separation(piece: Piece, start: Array, end: Array) -> Separation:
    """Signed distance of a segment from a piece; the numbers must be finite."""
    if piece.ball:
        return from_ball(piece, start, end)
    if piece.disc:
        distance, on_axis, on_piece = from_cylinder(piece, start, end)
    else:
        distance, on_axis, on_piece = between(segment(start, end), piece.surface)
    inside = distance > 0 and not piece.disc and contains(piece, start)
    if distance > 0 and not inside:
        if piece.disc:
            return Separation(distance, (on_axis - on_piece) / distance, on_axis)
        return _proven(piece, np.stack([start, end]), distance, on_axis, on_piece)
    if piece.mesh is None:
        return way_out(piece, np.stack([start, end]))
    gap = -min(0.0, piece.mesh.distance(start)) if inside else 0.0
    out = on_piece - on_axis
    return Separation(-min(gap, distance), out / distance if distance > 0 else UP, on_axis)


def hull_separation(piece: Piece, corners: Array) -> Separation:
    """Signed distance of a segment (2, 3), or of a box (8, 3) with corners as `LinkBox` orders them.

    A box that is within a mesh, or a mesh within a box, is as deep as their surfaces are apart; a box that
    cuts the surface of a mesh counts as a nanometre deep. A cylinder and a box are never nearer than told,
    and not a micrometre farther. The numbers must be finite.
    """
    if len(corners) == 2:
        return separation(piece, corners[0], corners[1])
    if piece.disc:
        way, on_box = np.zeros(3), np.empty(3)
        distance = hull_gap(corners, piece.corners, piece.disc, way, on_box)[0]
        return Separation(distance, way, on_box) if distance > TOUCH else way_out(piece, corners)
    other = segment(piece.corners[0], piece.corners[-1]) if piece.ball else piece.surface
    distance, on_box, on_piece = between(box(corners), other)
    swallowed = distance > 0 and bool(within_box(corners, piece.corners).any())
    inside = swallowed or (distance > 0 and not piece.ball and contains(piece, corners[0]))
    if distance > 0 and not inside:
        return _proven(piece, corners, distance, on_box, on_piece)
    if piece.mesh is None:
        return way_out(piece, corners)
    normal = (on_piece - on_box) / distance if distance > 0 else -UP
    return Separation(-max(distance, TOUCH), normal, on_box)


def _proven(piece: Piece, corners: Array, distance: float, on_link: Array, on_piece: Array) -> Separation:
    """What fcl says of surfaces that are apart, if that is proven; else what our own walk finds.

    A plane proves it of convex solids; of meshes, that no triangle is nearer. Of edges that are parallel but
    for rounding fcl may leave out the nearest points: it told of a link 7 cm beside a wall that it was 8 cm
    away.
    """
    normal, gap = (on_link - on_piece) / distance, distance
    if piece.faces is not None:
        on_link, most = on_link.copy(), distance - EXACT
        nearer = nearest_face(piece.faces, corners, most, normal, on_link)
        gap = nearer if nearer < most else distance
    elif (corners @ normal).min() - (piece.corners @ normal).max() < distance - EXACT:
        normal, on_link = np.zeros(3), np.empty(3)
        gap = hull_gap(corners, piece.corners, 0.0, normal, on_link)[0]
    if gap <= TOUCH and piece.mesh is None:
        return way_out(piece, corners)
    return Separation(float(gap) - piece.ball, normal, on_link)


def link_piece(solid: LinkSolid) -> Piece:
    """A link's solid, prepared as what others keep away from, in the link's frame."""
    corners = solid.corners
    if len(corners) == 2:
        return Piece(corners, NONE, np.diff(corners, axis=0), ball=solid.radius)
    axes = (corners[[4, 2, 1]] - corners[0]) / np.linalg.norm(corners[[4, 2, 1]] - corners[0], axis=1)[
        :, None
    ]
    return Piece(corners, np.vstack([axes, -axes]), axes, surface=surface(corners, BOX))


def _pieces(solid: Solid) -> list[Piece]:
    match solid:
        case Sphere():
            return [Piece(solid.center[None], NONE, ball=solid.radius)]
        case Cylinder():
            ends = solid.center + np.outer([-solid.height / 2, solid.height / 2], UP)
            return [Piece(ends, NONE, disc=solid.radius)]
        case Mesh():
            flat, tree = surface(solid.vertices, solid.faces), face_tree(solid.vertices, solid.faces)
            return [Piece(solid.vertices, NONE, surface=flat, mesh=solid, faces=tree)]
        case Box():
            c, s = np.cos(solid.yaw), np.sin(solid.yaw)
            level = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * solid.size[:2] / 2
            outline = level @ np.array([[c, s], [-s, c]]) + solid.center[:2]
            return [_prism(outline, *solid.z_range)]
        case Prism():
            return [_prism(outline, *solid.z_range) for outline in convex_pieces(solid.polygon)]


def _prism(outline: Array, bottom: float, top: float) -> Piece:
    """A convex outline, counter-clockwise, raised from one height to another."""
    n = len(outline)
    corners = np.vstack([np.column_stack([outline, np.full(n, z)]) for z in (bottom, top)])
    fan = [[0, k, k + 1] for k in range(1, n - 1)]
    lid = [[n, n + k, n + k + 1] for k in range(1, n - 1)]
    sides = [[k, (k + 1) % n, n + k] for k in range(n)] + [
        [(k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)
    ]
    edges = np.roll(outline, -1, 0) - outline
    level = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    normals = np.vstack([np.column_stack([level, np.zeros(n)]), UP, -UP])
    edges = np.vstack([np.column_stack([-level[:, 1], level[:, 0], np.zeros(n)]), UP])
    return Piece(corners, normals, edges, surface=surface(corners, np.array(fan + lid + sides)))
