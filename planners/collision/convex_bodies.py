"""Convex pieces of solids: support, containment, and the distances that have a closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.planners.collision.gjk import hull_gap
from regionik.planners.collision.meshes import FaceTree
from regionik.worlds.arrays import Array
from regionik.worlds.obstacles import Mesh
from regionik.worlds.robot import LinkBox, LinkCapsule, LinkSolid

TOUCH = 1e-9  # [m]
UP = np.array([0.0, 0.0, 1.0])
NONE = np.zeros((0, 3))
HALVINGS = 44  # of a segment of some metres: far below a nanometre
WITHIN = 0.999  # of half a box's least side: radius of the capsule inside it, which keeps some length
ROUND = np.linspace(0.0, 2 * np.pi, 64, endpoint=False)


class Separation(NamedTuple):
    """A hull (of a link's axis or box) and a piece: distance, and the unit direction from the piece to it."""

    distance: float  # [m], minus the way out along ``normal`` where they overlap
    normal: Array  # (3,)
    on_axis: Array  # (3,) [m]


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
    surface: Any = None  # the engine's triangles, of a part with corners
    mesh: Mesh | None = None
    faces: FaceTree | None = None  # of a mesh

    def support(self, directions: Array) -> Array:
        """How far the piece reaches along each direction (..., 3), as (...)."""
        far: Array = (directions @ self.corners.T).max(-1)
        level = np.hypot(directions[..., 0], directions[..., 1])
        reach: Array = far + self.disc * level + self.ball * np.linalg.norm(directions, axis=-1)
        return reach


def contains(piece: Piece, point: Array) -> bool:
    """Whether a point is inside or on the surface, where fcl overlooks a segment within one triangle."""
    if piece.mesh is None or piece.faces is None:
        return bool((piece.normals @ point <= piece.support(piece.normals) + TOUCH).all())
    low, high = piece.faces.boxes[1].reshape(2, 3)
    within = (low <= point + TOUCH) & (point <= high + TOUCH)
    return bool(within.all()) and piece.mesh.distance(point) <= TOUCH


def from_ball(piece: Piece, a: Array, b: Array) -> Separation:
    """Signed distance from a ball, or from a capsule."""
    if len(piece.corners) == 2:
        way, on_axis = np.zeros(3), np.empty(3)
        gap = hull_gap(np.stack([a, b]), piece.corners, 0.0, way, on_axis)[0]
        return Separation(max(0.0, gap) - piece.ball, way, on_axis)
    along = b - a
    t = float(np.clip((piece.corners[0] - a) @ along / max(float(along @ along), 1e-300), 0.0, 1.0))
    on_axis = a + t * along
    away = on_axis - piece.corners[0]
    length = float(np.linalg.norm(away))
    return Separation(length - piece.ball, away / length if length > 0 else UP, on_axis)


def from_cylinder(piece: Piece, a: Array, b: Array) -> tuple[float, Array, Array]:
    """Distance from an upright cylinder and the two points; 0 where the segment enters it.

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
    on_axis = a + t * (b - a)
    return float(np.linalg.norm(gap)), on_axis, on_axis - gap


def within_box(corners: Array, points: Array) -> NDArray[np.bool_]:
    """Which points (n, 3) lie in or on a box, given by its corners as `LinkBox` orders them."""
    sides = corners[[4, 2, 1]] - corners[0]
    shares = (points - corners[0]) @ sides.T / (sides**2).sum(1)
    slack = TOUCH / np.linalg.norm(sides, axis=1)
    inside: NDArray[np.bool_] = ((shares >= -slack) & (shares <= 1 + slack)).all(1)
    return inside


def way_out(piece: Piece, corners: Array) -> Separation:
    """Least push that frees a segment or box: along a normal of a face, or square to an edge of each."""
    if piece.disc:
        level = np.column_stack([np.cos(ROUND), np.sin(ROUND), np.zeros(len(ROUND))])
        normals = np.vstack([level, UP, -UP])
        edges = np.vstack([np.column_stack([-level[:, 1], level[:, 0], level[:, 2]]), UP])
    else:
        normals = piece.normals
        edges = piece.edges
    sides = corners[[4, 2, 1] if len(corners) == 8 else [1]] - corners[0]
    square = np.cross(edges[:, None], sides).reshape(-1, 3)
    if len(corners) == 8:
        square = np.vstack([square, sides])
    size = np.linalg.norm(square, axis=1)
    square = square[size > 1e-12] / size[size > 1e-12, None]
    normals = np.vstack([normals, square, -square])
    along = normals @ corners.T
    depths = piece.support(normals) - along.min(1)
    k = int(np.argmin(depths))
    return Separation(-float(depths[k]), normals[k], corners[int(np.argmin(along[k]))])


def inner_capsule(solid: LinkSolid) -> LinkCapsule:
    """Return a capsule as it is, and of a box the capsule along its middle."""
    if isinstance(solid, LinkCapsule):
        return solid
    return _along(solid)


def _along(solid: LinkBox) -> LinkCapsule:
    longest = int(np.argmax(solid.size))
    radius = WITHIN * float(solid.size.min()) / 2
    half = solid.T_link_box[:3, longest] * (solid.size[longest] / 2 - radius)
    middle = solid.T_link_box[:3, 3]
    return LinkCapsule(solid.link, solid.name, middle - half, middle + half, radius)
