"""Distances between surfaces of triangles. The only file that imports fcl.

fcl's solvers for convex shapes (GJK, EPA) are left alone on purpose: where edges run parallel their answers
were centimetres too large, and the signed distance of an axis that ends in a corner never came back.
"""

from __future__ import annotations

import math
import threading
from functools import lru_cache
from typing import TypeAlias

import fcl
import numpy as np
from numpy.typing import NDArray

from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError

Surface: TypeAlias = fcl.CollisionObject
_REQUEST = fcl.DistanceRequest(enable_nearest_points=True)
_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
BOX = np.vstack([_QUADS[:, [0, 1, 2]], _QUADS[:, [0, 2, 3]]])  # triangles of corners ordered as by `LinkBox`


def between(a: Surface, b: Surface) -> tuple[float, Array, Array]:
    """Distance of two surfaces, and the two points; 0 where they meet."""
    found = fcl.DistanceResult()
    distance = fcl.distance(a, b, _REQUEST, found)
    on_a, on_b = found.nearest_points
    return max(0.0, float(distance)), on_a, on_b


def surface(vertices: Array, faces: NDArray[np.int64]) -> Surface:
    """Triangles, each three rows of vertices."""
    middle = (vertices.min(0) + vertices.max(0)) / 2
    model = fcl.BVHModel()
    model.beginModel(len(vertices), len(faces))
    model.addSubModel(vertices - middle, np.array(faces))
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform(np.eye(3), middle))


def segment(a: Array, b: Array) -> Surface:
    """A segment, until the next one as long is asked for by the same thread.

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
    """A box of corners (8, 3) as `LinkBox` orders them, until the next one as large, as `segment`."""
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
