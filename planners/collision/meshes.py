"""Surfaces of triangles: their distances by fcl, and a tree that tells whether any triangle is nearer.

The only file that imports fcl. Its solvers for convex shapes (GJK, EPA) are left alone on purpose: where
edges run parallel their answers were centimetres too large, and the signed distance of an axis that ends in a
corner never came back.
"""

from __future__ import annotations

import math
import threading
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import fcl
import numpy as np
from numpy.typing import NDArray

from regionik.planners.collision.gjk import hull_distance, support_points
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError

Surface: TypeAlias = fcl.CollisionObject
_REQUEST = fcl.DistanceRequest(enable_nearest_points=True)
_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
BOX = np.vstack([_QUADS[:, [0, 1, 2]], _QUADS[:, [0, 2, 3]]])  # triangles of corners ordered as by `LinkBox`


def surface_distance(a: Surface, b: Surface) -> tuple[float, Array, Array]:
    """Distance of two surfaces, and the witness points; 0 where they meet."""
    found = fcl.DistanceResult()
    distance = fcl.distance(a, b, _REQUEST, found)
    on_a, on_b = found.nearest_points
    return max(0.0, float(distance)), on_a, on_b


def surface(vertices: Array, faces: NDArray[np.int64]) -> Surface:
    """Make a surface of triangles (m, 3), each three rows of vertices (n, 3) [m]."""
    middle = (vertices.min(0) + vertices.max(0)) / 2
    model = fcl.BVHModel()
    model.beginModel(len(vertices), len(faces))
    model.addSubModel(vertices - middle, np.array(faces))
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform(np.eye(3), middle))


def segment(a: Array, b: Array) -> Surface:
    """Lay a segment between two points; it is moved when the thread asks for the next one as long.

    Raises
    ------
    InputError
        When a number is not finite: fcl would call such a pose free.
    """
    length, pose = _pose(a, b)
    axis = _axis(round(length, 12), threading.get_ident())
    axis.setTransform(pose)
    return axis


def box(corners: Array) -> Surface:
    """Lay a box of corners (8, 3) as `LinkBox` orders them; it is moved like a `segment`."""
    middle, sides = corners.mean(0), corners[[4, 2, 1]] - corners[0]
    if not math.isfinite(float(middle.sum())):
        raise InputError(f"box: every number must be finite, got {corners.tolist()}")
    size = np.linalg.norm(sides, axis=1)
    solid = _box(*np.round(size, 12).tolist(), threading.get_ident())
    solid.setTransform(fcl.Transform((sides / size[:, None]).T, middle))
    return solid


def _pose(a: Array, b: Array) -> tuple[float, fcl.Transform]:
    """Length of a segment, and the transform that lays one along z onto it."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    x, y, z = bx - ax, by - ay, bz - az
    length = math.sqrt(x * x + y * y + z * z)
    if not math.isfinite(length):
        raise InputError(f"capsule: every number must be finite, got {a.tolist()} and {b.tolist()}")
    x, y, z = (x / length, y / length, z / length) if length > 0 else (0.0, 0.0, 1.0)
    s = math.copysign(1.0, z)
    u = -1.0 / (s + z)
    v = x * y * u
    turn = np.array([[1 + s * x * x * u, v, x], [s * v, s + y * y * u, y], [-s * x, -y, z]])
    return length, fcl.Transform(turn, np.array([(ax + bx) / 2, (ay + by) / 2, (az + bz) / 2]))


@lru_cache(maxsize=512)
def _axis(length: float, thread: int) -> Surface:
    """A segment along z as a triangle without area; one for each thread, because it is moved about."""
    half = length / 2
    return surface(np.array([[0, 0, -half], [0, 0, half], [0, 0, half]]), np.array([[0, 1, 2]]))


@lru_cache(maxsize=512)
def _box(x: float, y: float, z: float, thread: int) -> Surface:
    return surface(_SIGNS * np.array([x, y, z]) / 2, BOX)


LEAF = 4  # triangles


class TriangleTree(NamedTuple):
    """Triangles in a tree of boxes, as values for kernels; made by `triangle_tree`.

    The tree is a full binary one kept as an array: node i has the children 2 i and 2 i + 1, and the last half
    of the nodes are leaves of a few triangles each. Triangles that share a leaf lie beside each other.
    """

    triangles: Array  # (m, 3, 3) corners, in the order of the leaves [m]
    boxes: Array  # (2 n, 6) least x, y, z and largest x, y, z of every node; the first row is not used [m]


def triangle_tree(vertices: Array, faces: NDArray[np.int64]) -> TriangleTree:
    """Sort triangles into a tree, each half of a node along its longest side."""
    leaves = 1
    while leaves * LEAF < len(faces):
        leaves *= 2
    corners = vertices[faces]
    triangles = np.ascontiguousarray(corners[_by_leaf(corners.mean(1), np.arange(len(faces)), leaves)])
    sides = np.full((leaves * LEAF, 6), np.inf)  # least, and minus the largest: both grow towards the least
    sides[: len(triangles)] = np.hstack([triangles.min(1), -triangles.max(1)])
    boxes = np.full((2 * leaves, 6), np.inf)
    boxes[leaves:] = sides.reshape(leaves, LEAF, 6).min(1)
    while leaves > 1:
        leaves //= 2
        boxes[leaves : 2 * leaves] = boxes[2 * leaves : 4 * leaves].reshape(leaves, 2, 6).min(1)
    boxes[:, 3:] *= -1
    return TriangleTree(triangles, boxes)


def _by_leaf(middles: Array, which: NDArray[np.int64], leaves: int) -> NDArray[np.int64]:
    """The triangles in the order of their leaves, of which only the last are not full."""
    if len(which) <= LEAF:
        return which
    half, longest = LEAF * leaves // 2, int(np.ptp(middles[which], axis=0).argmax())
    ranked = which[np.argsort(middles[which, longest], kind="stable")]
    parts = (_by_leaf(middles, part, leaves // 2) for part in (ranked[:half], ranked[half:]))
    return np.concatenate(list(parts))


@compiled
def _skip_subtree(i: int) -> int:
    """The next node in depth-first order that is not below this one; 0 behind the last."""
    while i & 1:
        i >>= 1
    return i + 1 if i > 0 else 0


@compiled
def nearest_triangle(tree: TriangleTree, A: Array, most: float, normal: Array, spot: Array) -> float:
    """Distance of the hull of A (n, 3) from the triangles, where it is less than ``most``, else that [m].

    ``normal`` is a unit direction from the triangles to A, the better the faster. Where something is nearer,
    it is overwritten with that in which it is, and ``spot`` with the point of A nearest to the triangles.
    """
    triangles, boxes = tree
    low, high = np.empty(3), np.empty(3)
    for d in range(3):
        low[d], high[d] = A[:, d].min(), A[:, d].max()
    along, place = np.empty(3), np.empty(3)
    leaves, least, i = len(boxes) // 2, most, 1
    while i > 0:
        square = 0.0
        for d in range(3):
            aside = max(boxes[i, d] - high[d], low[d] - boxes[i, 3 + d], 0.0)
            square += aside * aside
        if square >= least * least:
            i = _skip_subtree(i)
        elif i < leaves:
            i *= 2
        else:
            first = (i - leaves) * LEAF
            for k in range(first, min(first + LEAF, len(triangles))):
                if support_points(A, triangles[k], normal)[2] >= least:
                    continue
                along[:] = 0.0
                gap = max(hull_distance(A, triangles[k], 0.0, along, place)[0], 0.0)
                if gap < least:
                    least = gap
                    normal[:] = along
                    spot[:] = place
            i = _skip_subtree(i)
    return least
