"""Three-vectors for kernels: what is computed is a tuple of floats, so that nothing is allocated."""

from __future__ import annotations

import math

import numpy as np

from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array

Vector = tuple[float, float, float]
AnyVector = Vector | Array  # (3,)


@compiled
def row(points: Array, k: int) -> Vector:
    """Row k of points (n, 3)."""
    return points[k, 0], points[k, 1], points[k, 2]


@compiled
def put(points: Array, k: int, a: Vector) -> None:
    """Write row k of points (n, 3)."""
    points[k, 0], points[k, 1], points[k, 2] = a[0], a[1], a[2]


@compiled
def plus(a: AnyVector, b: AnyVector) -> Vector:
    """Sum a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def minus(a: AnyVector, b: AnyVector) -> Vector:
    """Difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def scaled(a: Vector, s: float) -> Vector:
    """Multiple s a."""
    return a[0] * s, a[1] * s, a[2] * s


@compiled
def dot(a: AnyVector, b: AnyVector) -> float:
    """Scalar product a . b."""
    product: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


@compiled
def cross(a: AnyVector, b: AnyVector) -> Vector:
    """Cross product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def squared(x: float) -> float:
    """Product x x: a power may be rounded otherwise."""
    return x * x


@compiled
def norm(a: AnyVector) -> float:
    """Length |a|."""
    length: float = np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    return length


@compiled
def across(a: Vector, axis: Vector) -> Vector:
    """Component of a normal to a unit axis: a - (a . axis) axis."""
    return minus(a, scaled(axis, dot(a, axis)))


@compiled
def turned(R: Array, a: Vector) -> Vector:
    """Product R a."""
    return (
        R[0, 0] * a[0] + R[0, 1] * a[1] + R[0, 2] * a[2],
        R[1, 0] * a[0] + R[1, 1] * a[1] + R[1, 2] * a[2],
        R[2, 0] * a[0] + R[2, 1] * a[1] + R[2, 2] * a[2],
    )


@compiled
def turned_back(R: Array, a: Vector) -> Vector:
    """Product R^T a."""
    return (
        R[0, 0] * a[0] + R[1, 0] * a[1] + R[2, 0] * a[2],
        R[0, 1] * a[0] + R[1, 1] * a[1] + R[2, 1] * a[2],
        R[0, 2] * a[0] + R[1, 2] * a[1] + R[2, 2] * a[2],
    )


@compiled
def rotated(axis: Vector, angle: float, a: Vector) -> Vector:
    """Rotation of a about a unit axis n: cos(t) a + sin(t) n x a + (1 - cos(t)) (n . a) n (Rodrigues)."""
    c, s = math.cos(angle), math.sin(angle)
    lift = (1.0 - c) * dot(axis, a)
    x, y, z = cross(axis, a)
    return (
        c * a[0] + s * x + lift * axis[0],
        c * a[1] + s * y + lift * axis[1],
        c * a[2] + s * z + lift * axis[2],
    )
