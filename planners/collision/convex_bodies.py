"""Solids as convex pieces: how they are made, and their distances that have a closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.planners.collision.meshes import BOX, TriangleTree, nearest_triangle, surface, triangle_tree
from regionik.planners.geometry.convex_decomposition import convex_pieces
from regionik.worlds.arrays import Array
from regionik.worlds.links import LinkCapsule, LinkHull, LinkSolid
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Solid, Sphere
from regionik.worlds.polytopes import Polytope, polytope
from regionik.worlds.prepared import made_once

TOUCH = 1e-9  # [m]
BOX_ROWS = 8  # corners of a `LinkBox`; segments have 2, hulls more
UP = np.array([0.0, 0.0, 1.0])
NONE = np.zeros((0, 3))
HALVINGS = 44  # of a segment of some metres: far below a nanometre
_INNER = 0.9  # of the radius of the largest ball in a hull: that of the capsule inside it
_THICKEST = 0.999  # of half a box's least side: radius of the capsule inside it, which keeps some length
_FAN = np.linspace(0.0, 2 * np.pi, 64, endpoint=False)  # level directions out of a round piece [rad]


class Separation(NamedTuple):
    """Signed distance of a link's axis or box from a piece, with its direction and witness point."""

    distance: float  # [m], minus the penetration depth along ``normal`` where they overlap
    normal: Array  # (3,) unit vector from the piece to the hull
    on_axis: Array  # (3,) nearest point of the hull [m]


@dataclass(frozen=True, eq=False)
class Piece:
    """A convex part of a solid, or the surface of a mesh.

    All points within ``disc`` (level) and ``ball`` (any way) of the hull of ``corners``. Where there is a
    disc or a ball, there are one or two corners.
    """

    corners: Array  # (k, 3) [m]
    normals: Array  # (f, 3) outward, of the faces of a convex part with corners
    edges: Array = field(default_factory=lambda: NONE)  # (e, 3) along its edges
    disc: float = 0.0  # [m]
    ball: float = 0.0  # [m]
    surface: Any = None  # the engine's object, of a part with corners
    mesh: Mesh | None = None
    triangles: TriangleTree | None = None  # of a mesh

    def support(self, directions: Array) -> Array:
        """Support function: how far the piece reaches along each direction (..., 3), as (...) [m]."""
        far: Array = (directions @ self.corners.T).max(-1)
        level = np.hypot(directions[..., 0], directions[..., 1])
        reach: Array = far + self.disc * level + self.ball * np.linalg.norm(directions, axis=-1)
        return reach

    def contains(self, point: Array) -> bool:
        """True if a point (3,) is inside or on the surface (fcl overlooks a segment in one triangle)."""
        if self.mesh is None or self.triangles is None:
            return bool((self.normals @ point <= self.support(self.normals) + TOUCH).all())
        low, high = self.triangles.boxes[1].reshape(2, 3)
        within = (low <= point + TOUCH) & (point <= high + TOUCH)
        return bool(within.all()) and (self.gap(point, 2 * TOUCH) <= TOUCH or self.mesh.contains(point))

    def gap(self, point: Array, most: float) -> float:
        """Distance of a point (3,) from the surface of a mesh, ``most`` where it is no less [m]."""
        assert self.triangles is not None
        normal, nearest = np.array([0.0, 0.0, 1.0]), np.empty(3)
        return float(nearest_triangle(self.triangles, point[None].copy(), most, normal, nearest))


def link_piece(solid: LinkSolid) -> Piece:
    """Prepare a link's solid as what others keep away from, in the link's frame."""
    corners = solid.corners
    if isinstance(solid, LinkHull):
        whole = solid.polytope
        return Piece(corners, whole.normals, whole.edges, surface=surface(corners, whole.triangles))
    if len(corners) == 2:
        return Piece(corners, NONE, np.diff(corners, axis=0), ball=solid.radius)
    sides = corners[[4, 2, 1]] - corners[0]
    axes = sides / np.linalg.norm(sides, axis=1)[:, None]
    return Piece(corners, np.vstack([axes, -axes]), axes, surface=surface(corners, BOX))


def solid_pieces(solid: Solid) -> list[Piece]:
    """Cut a solid into convex pieces; a mesh is one piece."""
    match solid:
        case Sphere():
            return [Piece(solid.center[None], NONE, ball=solid.radius)]
        case Cylinder():
            ends = solid.center + np.outer([-solid.height / 2, solid.height / 2], UP)
            return [Piece(ends, NONE, disc=solid.radius)]
        case Mesh():
            engine, tree = surface(solid.vertices, solid.faces), triangle_tree(solid.vertices, solid.faces)
            return [Piece(solid.vertices, NONE, surface=engine, mesh=solid, triangles=tree)]
        case Box():
            c, s = np.cos(solid.yaw), np.sin(solid.yaw)
            level = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * solid.size[:2] / 2
            outline = level @ np.array([[c, s], [-s, c]]) + solid.center[:2]
            return [_prism(outline, *solid.z_range)]
        case Prism():
            return [_prism(outline, *solid.z_range) for outline in convex_pieces(solid.polygon)]


def _prism(outline: Array, bottom: float, top: float) -> Piece:
    """Raise a convex outline (n, 2), counter-clockwise, from one height to another."""
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


@made_once
def inner_capsule(solid: LinkSolid) -> LinkCapsule:
    """Return a capsule as it is, of a box the capsule along its middle, and of a hull one inside."""
    if isinstance(solid, LinkCapsule):
        return solid
    if isinstance(solid, LinkHull):
        return _capsule_in_hull(solid)
    longest = int(np.argmax(solid.size))
    radius = _THICKEST * float(solid.size.min()) / 2
    half = solid.T_link_box[:3, longest] * (solid.size[longest] / 2 - radius)
    middle = solid.T_link_box[:3, 3]
    return LinkCapsule(solid.link, solid.name, middle - half, middle + half, radius)


def _capsule_in_hull(solid: LinkHull) -> LinkCapsule:
    """Return a capsule, a little thinner than the largest ball in a hull, along the hull's longest axis."""
    from scipy.optimize import linprog  # takes long to load

    whole = solid.polytope
    rows = np.column_stack([whole.normals, np.ones(len(whole.normals))])
    best = linprog([0, 0, 0, -1], rows, whole.offsets, bounds=[(None, None)] * 3 + [(0, None)])
    center, radius = best.x[:3], _INNER * float(whole.depth(best.x[:3]))
    along = np.linalg.svd(solid.corners - solid.corners.mean(0), full_matrices=False)[2][0]
    rise, room = whole.normals @ along, whole.offsets - whole.normals @ center - radius
    ends = [min(room[rise * sign > TOUCH] / np.abs(rise[rise * sign > TOUCH])) for sign in (1.0, -1.0)]
    start, end = center - ends[1] * along, center + ends[0] * along
    return LinkCapsule(solid.link, solid.name, start, end, _THICKEST * radius)


def cylinder_separation(piece: Piece, a: Array, b: Array) -> Separation:
    """Distance of a segment from an upright cylinder; 0 where they meet.

    The distance is convex along the segment, so the sign of its slope leads to the least one.
    """
    middle = piece.corners.mean(0)
    (ax, ay, az), (dx, dy, dz) = (a - middle).tolist(), (b - a).tolist()
    half, radius = float(piece.corners[1, 2] - middle[2]), piece.disc
    low, high, t = 0.0, 1.0, 0.0
    for step in range(HALVINGS + 2):
        t = (0.0, 1.0)[step] if step < 2 else (low + high) / 2
        x, y, z = ax + t * dx, ay + t * dy, az + t * dz
        flat = math.hypot(x, y)
        level = max(0.0, 1.0 - radius / flat) if flat > 0 else 0.0
        over = z - min(max(z, -half), half)
        slope = level * (x * dx + y * dy) + over * dz
        if (level == 0 and over == 0) or (step == 0 and slope >= 0) or (step == 1 and slope <= 0):
            break
        if step >= 2:
            low, high = (t, high) if slope < 0 else (low, t)
    gap = np.array([level * x, level * y, over])
    distance = float(np.linalg.norm(gap))
    return Separation(distance, gap / (distance or 1.0), a + t * (b - a))


def within_hull(corners: Array, points: Array) -> NDArray[np.bool_]:
    """True for points (n, 3) that lie in or on a box or hull, by its corners as `LinkSolid` has them."""
    if len(corners) != BOX_ROWS:
        within: NDArray[np.bool_] = polytope(corners).depth(points) >= -TOUCH
        return within
    sides = corners[[4, 2, 1]] - corners[0]
    shares = (points - corners[0]) @ sides.T / (sides**2).sum(1)
    slack = TOUCH / np.linalg.norm(sides, axis=1)
    inside: NDArray[np.bool_] = ((shares >= -slack) & (shares <= 1 + slack)).all(1)
    return inside


def penetration(piece: Piece, corners: Array, own: Polytope | None = None) -> Separation:
    """Penetration of a segment, box or hull: least push out along a face normal, or square to two edges.

    ``own`` is the hull of the corners, where it is known.
    """
    normals, edges = piece.normals, piece.edges
    if piece.disc or piece.ball:
        level = np.column_stack([np.cos(_FAN), np.sin(_FAN), np.zeros(len(_FAN))])
        normals = np.vstack([level, UP, -UP])
        edges = np.vstack([np.column_stack([-level[:, 1], level[:, 0], level[:, 2]]), UP, edges])
    if len(corners) > BOX_ROWS:
        own = own or polytope(corners)
        sides, faces = own.edges, own.normals
    else:
        sides = corners[[4, 2, 1] if len(corners) == BOX_ROWS else [1]] - corners[0]
        faces = sides if len(corners) == BOX_ROWS else NONE
    (x, y, z), (u, v, w) = edges.T[..., None], sides.T  # `np.cross` takes as long as all the rest
    square = np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1).reshape(-1, 3)
    square = np.vstack([square, faces])
    size = np.linalg.norm(square, axis=1)
    square = square[size > 1e-12] / size[size > 1e-12, None]
    normals = np.vstack([normals, square, -square])
    along = normals @ corners.T
    depths = piece.support(normals) - along.min(1)
    k = int(np.argmin(depths))
    return Separation(-float(depths[k]), normals[k], corners[int(np.argmin(along[k]))])
