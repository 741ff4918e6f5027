"""Distances between solids of links and obstacles, with their witness points.

A link is a capsule, so its distance is that of a segment less the radius, or a box. fcl measures both against
surfaces of triangles, and its answer is taken where `_proven` confirms it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionik.planners.collision.convex_bodies import (
    BOX_ROWS,
    TOUCH,
    UP,
    Piece,
    Separation,
    cylinder_separation,
    penetration,
    solid_pieces,
    within_hull,
)
from regionik.planners.collision.gjk import hull_distance
from regionik.planners.collision.meshes import (
    box,
    nearest_triangle,
    segment,
    surface_distance,
)
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.obstacles import Solid
from regionik.worlds.polytopes import Polytope

EXACT = 1e-8  # of a distance that a plane proves [m]


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Solids prepared for distance queries; made by `obstacles_from`."""

    solids: tuple[Solid, ...]
    pieces: tuple[Piece, ...]  # convex parts, and meshes whole
    owner: NDArray[np.int64]  # (m,) the solid of each piece
    # low, high: (m, 3) boxes along the axes round the pieces [m]
    low: Array
    high: Array


def obstacles_from(solids: Sequence[Solid]) -> Obstacles:
    """Cut solids into convex pieces and prepare them for distance queries; kept for the last few scenes."""
    return _obstacles(tuple(solids))


@lru_cache(maxsize=8)
def _obstacles(solids: tuple[Solid, ...]) -> Obstacles:
    return obstacles_among(solids, enumerate(solids))


def obstacles_among(solids: tuple[Solid, ...], parts: Iterable[tuple[int, Solid]]) -> Obstacles:
    """Prepare parts of some of many solids, each with its solid's number: of the rest there are no pieces."""
    owned = [(k, piece) for k, part in parts for piece in solid_pieces(part)]
    pieces = tuple(piece for _, piece in owned)
    owner = np.array([k for k, _ in owned], dtype=np.int64)
    return Obstacles(solids, pieces, owner, *_bounding_boxes(pieces))


def _bounding_boxes(pieces: Sequence[Piece]) -> tuple[Array, Array]:
    """Low and high corners of boxes along the axes round pieces, (m, 3) each [m]."""
    axes = np.eye(3)
    high = np.array([piece.support(axes) for piece in pieces]).reshape(-1, 3)
    low = -np.array([piece.support(-axes) for piece in pieces]).reshape(-1, 3)
    return low, high


def nearest_distance(obstacles: Obstacles, start: ArrayLike, end: ArrayLike, radius: float) -> float:
    """Signed distance of the nearest solid from a capsule, infinite where there is none [m].

    Where the capsule's axis enters a convex piece, the distance is minus the penetration depth (of
    cylinders: along the best of a fine fan of directions); inside a mesh it is minus that from its surface.

    Parameters
    ----------
    start, end : (3,) array_like
        Ends of the capsule's axis [m].
    radius : float [m]

    Raises
    ------
    InputError
        When a number is not finite.
    """
    a, b = frozen(start, (3,), "capsule: start"), frozen(end, (3,), "capsule: end")
    frozen(radius, (), "capsule: radius")
    gaps = box_distances(obstacles, np.minimum(a, b)[None, None], np.maximum(a, b)[None, None])[0] - radius
    best = np.inf
    for k in np.argsort(gaps, kind="stable"):
        if gaps[k] >= best:
            break
        best = min(best, hull_separation(obstacles.pieces[k], np.stack([a, b])).distance - radius)
    return best


def solids_within(obstacles: Obstacles, point: Array, reach: float) -> list[tuple[float, int]]:
    """Distances [m] of a point from the solids within ``reach`` of it, and their indices, nearest first."""
    spot = point[None, None]
    near = np.unique(obstacles.owner[box_distances(obstacles, spot, spot)[0] <= reach]).tolist()
    gaps = sorted((float(obstacles.solids[k].distance(point)), k) for k in near)
    return [(gap, k) for gap, k in gaps if gap <= reach]


def box_distances(obstacles: Obstacles, low: Array, high: Array) -> Array:
    """Distances between boxes (n, 1, 3) and the boxes of all pieces, (n, m); -inf where they meet [m]."""
    square = np.zeros((len(low), len(obstacles.pieces)))
    for k in range(3):
        apart = np.maximum(low[..., k] - obstacles.high[:, k], obstacles.low[:, k] - high[..., k])
        square += np.maximum(apart, 0.0) ** 2
    return np.where(square > 0, np.sqrt(square), -np.inf)


def hull_separation(piece: Piece, corners: Array, own: Polytope | None = None) -> Separation:
    """Signed distance from a piece of a segment (2, 3), box (8, 3) or hull, by the corners of `LinkSolid`.

    A solid within a mesh, or a mesh within a solid, is as deep as their surfaces are apart; one that cuts the
    surface of a mesh counts as a nanometre deep. The distance of a cylinder from a box or hull is never too
    large, and too small by less than a micrometre. The numbers must be finite. ``own`` is the hull of the
    corners, where it is known.
    """
    if piece.disc and len(corners) == 2:
        found = cylinder_separation(piece, *corners)
        return found if found.distance > 0 else penetration(piece, corners)
    if piece.disc or piece.ball or len(corners) > BOX_ROWS:
        if piece.mesh is not None:
            return _hull_from_mesh(piece, corners)
        normal, on_link = np.zeros(3), np.empty(3)
        distance = hull_distance(corners, piece.corners, piece.disc, normal, on_link)[0]
        if distance > TOUCH:
            return Separation(distance - piece.ball, normal, on_link)
        return penetration(piece, corners, own)
    link = segment(*corners) if len(corners) == 2 else box(corners)
    distance, on_link, on_piece = surface_distance(link, piece.surface)
    inside = distance > 0 and (_engulfs(corners, piece) or piece.contains(corners[0]))
    if distance > 0 and not inside:
        return _proven(piece, corners, distance, on_link, on_piece)
    if piece.mesh is None:
        return penetration(piece, corners)
    normal = (on_piece - on_link) / distance if distance > 0 else -UP
    return Separation(-max(distance, TOUCH), normal, on_link)


def _engulfs(corners: Array, piece: Piece) -> bool:
    """True if some corner of a piece lies in a box or hull."""
    if len(corners) <= 2:
        return False
    low, high = corners.min(0) - TOUCH, corners.max(0) + TOUCH
    near = piece.corners[((low <= piece.corners) & (piece.corners <= high)).all(1)]
    return len(near) > 0 and bool(within_hull(corners, near).any())


def keeps_apart(piece: Piece, corners: Array, least: float, own: Polytope | None = None) -> bool:
    """Tell whether a hull keeps a distance from a piece [m]; see `hull_separation`, which takes longer.

    How deep a hull overlaps a piece from which it has to be apart does not matter.
    """
    if least > TOUCH and piece.mesh is None and (piece.disc or len(corners) > BOX_ROWS):
        distance = hull_distance(corners, piece.corners, piece.disc, np.zeros(3), np.empty(3))[0]
        return bool(distance - piece.ball >= least)
    return hull_separation(piece, corners, own).distance >= least


def _hull_from_mesh(piece: Piece, corners: Array) -> Separation:
    """Signed distance of a hull, by its corners, from a mesh: by the tree of its triangles alone."""
    assert piece.mesh is not None
    assert piece.triangles is not None
    normal, on_hull = corners[0] - piece.mesh.vertices[0], corners[0].copy()
    normal /= max(float(np.linalg.norm(normal)), TOUCH)
    most = float(np.linalg.norm(corners[0] - piece.mesh.vertices[piece.mesh.faces[0, 0]])) + 2 * TOUCH
    distance = nearest_triangle(piece.triangles, np.ascontiguousarray(corners), most, normal, on_hull)
    if distance <= 0 or _engulfs(corners, piece) or piece.contains(corners[0]):
        return Separation(-max(distance, TOUCH), -normal, on_hull)
    return Separation(distance, normal, on_hull)


def _proven(piece: Piece, corners: Array, distance: float, on_link: Array, on_piece: Array) -> Separation:
    """The distance that fcl found of surfaces that are apart, if it is proven; else that found by `gjk`.

    A separating plane proves it of convex solids; of meshes, that no triangle is nearer. Of edges that are
    parallel but for rounding fcl may overlook the nearest points: of a link 7 cm beside a wall it said 8 cm.
    """
    normal, gap = (on_link - on_piece) / distance, distance
    if piece.triangles is not None:
        on_link, most = on_link.copy(), distance - EXACT
        nearer = nearest_triangle(piece.triangles, corners, most, normal, on_link)
        gap = nearer if nearer < most else distance
    elif (corners @ normal).min() - (piece.corners @ normal).max() < distance - EXACT:
        normal, on_link = np.zeros(3), np.empty(3)
        gap = hull_distance(corners, piece.corners, 0.0, normal, on_link)[0]
    if gap <= TOUCH and piece.mesh is None:
        return penetration(piece, corners)
    return Separation(float(gap), normal, on_link)
