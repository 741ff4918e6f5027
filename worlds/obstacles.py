"""Named solids and their shadows on the floor."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely
import trimesh
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError


@dataclass(frozen=True)
class Shadow:
    """A floor area given exactly: all points within ``radius`` of ``core``.

    Discs keep their exact radius this way, so that growing them costs no accuracy.
    """

    core: BaseGeometry
    radius: float = 0.0

    def distance(self, other: BaseGeometry) -> float:
        """Distance from the shadow to a shape on the floor, 0 where they meet [m]."""
        return max(0.0, float(self.core.distance(other)) - self.radius)


@dataclass(frozen=True, eq=False)
class Box:
    """A box that stands upright, turned by yaw about its centre."""

    name: str
    size: Array  # (3,) [m]
    center: Array  # (3,) [m]
    yaw: float = 0.0

    def __post_init__(self) -> None:
        _freeze(self, size=(3,), center=(3,))
        _above_zero(self.name, "size", *self.size)

    @property
    def z_range(self) -> tuple[float, float]:
        half = self.size[2] / 2
        return float(self.center[2] - half), float(self.center[2] + half)

    def shadow(self, below: float) -> Shadow | None:
        """Floor area of the part lower than ``below`` [m]; None where there is no such part."""
        if self.z_range[0] >= below:
            return None
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * self.size[:2] / 2
        return Shadow(Polygon(corners @ np.array([[c, s], [-s, c]]) + self.center[:2]))

    def distance(self, point: Array) -> float:
        """Signed distance of a point, negative inside [m]."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        x, y, z = point - self.center
        local = np.array([c * x + s * y, -s * x + c * y, z])
        return _box_distance(np.abs(local) - self.size / 2)


@dataclass(frozen=True, eq=False)
class Cylinder:
    """An upright cylinder."""

    name: str
    radius: float  # [m]
    height: float  # [m]
    center: Array  # (3,) [m]

    def __post_init__(self) -> None:
        _freeze(self, center=(3,))
        _above_zero(self.name, "radius and height", self.radius, self.height)

    @property
    def z_range(self) -> tuple[float, float]:
        return float(self.center[2] - self.height / 2), float(self.center[2] + self.height / 2)

    def shadow(self, below: float) -> Shadow | None:
        """Floor area of the part lower than ``below`` [m]; None where there is no such part."""
        return Shadow(Point(self.center[:2]), self.radius) if self.z_range[0] < below else None

    def distance(self, point: Array) -> float:
        """Signed distance of a point, negative inside [m]."""
        x, y, z = point - self.center
        return _box_distance(np.array([np.hypot(x, y) - self.radius, abs(z) - self.height / 2]))


@dataclass(frozen=True, eq=False)
class Sphere:
    """A ball."""

    name: str
    radius: float  # [m]
    center: Array  # (3,) [m]

    def __post_init__(self) -> None:
        _freeze(self, center=(3,))
        _above_zero(self.name, "radius", self.radius)

    @property
    def z_range(self) -> tuple[float, float]:
        return float(self.center[2] - self.radius), float(self.center[2] + self.radius)

    def shadow(self, below: float) -> Shadow | None:
        """Floor area of the part lower than ``below`` [m]; None where there is no such part."""
        if self.z_range[0] >= below:
            return None
        over = max(0.0, self.center[2] - below)
        return Shadow(Point(self.center[:2]), float(np.sqrt(self.radius**2 - over**2)))

    def distance(self, point: Array) -> float:
        """Signed distance of a point, negative inside [m]."""
        return float(np.linalg.norm(point - self.center) - self.radius)


@dataclass(frozen=True, eq=False)
class Prism:
    """A floor polygon, with holes or without, raised from one height to another."""

    name: str
    polygon: Polygon
    bottom: float  # [m]
    top: float  # [m]

    def __post_init__(self) -> None:
        if not self.polygon.is_valid or self.polygon.is_empty:
            why = shapely.is_valid_reason(self.polygon)
            raise InputError(f"{self.name}: polygon must be simple and not empty: {why}")
        _above_zero(self.name, "height (z from low to high)", self.top - self.bottom)

    @property
    def z_range(self) -> tuple[float, float]:
        return self.bottom, self.top

    def shadow(self, below: float) -> Shadow | None:
        """Floor area of the part lower than ``below`` [m]; None where there is no such part."""
        return Shadow(self.polygon) if self.bottom < below else None

    def distance(self, point: Array) -> float:
        """Signed distance of a point, negative inside [m]."""
        spot = Point(point[:2])
        flat = self.polygon.boundary.distance(spot)
        flat = -flat if self.polygon.contains(spot) else flat
        middle, half = (self.bottom + self.top) / 2, (self.top - self.bottom) / 2
        return _box_distance(np.array([flat, abs(point[2] - middle) - half]))


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed triangle mesh, taken as a solid."""

    name: str
    vertices: Array  # (n, 3) [m], in the world
    faces: np.ndarray = field(repr=False)  # (m, 3) int

    def __post_init__(self) -> None:
        _freeze(self, vertices=(None, 3))
        faces = np.array(self.faces, dtype=np.int64)
        if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
            raise InputError(f"{self.name}: mesh: expected triangles, got shape {faces.shape}")
        if faces.min() < 0 or faces.max() >= len(self.vertices):
            raise InputError(f"{self.name}: mesh: a triangle names a vertex that is not there")
        faces.flags.writeable = False
        object.__setattr__(self, "faces", faces)

    @property
    def z_range(self) -> tuple[float, float]:
        return float(self.vertices[:, 2].min()), float(self.vertices[:, 2].max())

    def shadow(self, below: float) -> Shadow | None:
        """Floor area of the part lower than ``below`` [m]; None where there is no such part."""
        if self.z_range[0] >= below:
            return None
        part = trimesh.intersections.slice_mesh_plane(  # type: ignore[no-untyped-call]
            self._trimesh, plane_normal=[0, 0, -1], plane_origin=[0, 0, below]
        )
        triangles = shapely.polygons(part.vertices[part.faces][:, :, :2])
        return Shadow(shapely.union_all(triangles[shapely.is_valid(triangles)]))

    def distance(self, point: Array) -> float:
        """Signed distance of a point, negative inside [m]."""
        corners = self.vertices[self.faces]
        spots = np.broadcast_to(point, (len(corners), 3))
        nearest = trimesh.triangles.closest_point(corners, spots)  # type: ignore[no-untyped-call]
        gap = float(np.linalg.norm(nearest - point, axis=1).min())
        return -gap if self.contains(point) else gap

    def contains(self, point: Array) -> bool:
        """Whether the surface winds round the point (generalised winding number above 1/2)."""
        a, b, c = (self.vertices[self.faces[:, k]] - point for k in range(3))
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        triple = np.einsum("ij,ij->i", a, np.cross(b, c))
        scale = la * lb * lc + lc * _dot(a, b) + la * _dot(b, c) + lb * _dot(c, a)
        return bool(abs(np.arctan2(triple, scale).sum()) > np.pi)

    @cached_property
    def _trimesh(self) -> trimesh.Trimesh:
        return trimesh.Trimesh(self.vertices, self.faces, process=False)


Solid = Box | Cylinder | Sphere | Prism | Mesh


def _dot(a: Array, b: Array) -> Array:
    product: Array = np.einsum("ij,ij->i", a, b)
    return product


def _box_distance(excess: Array) -> float:
    """Signed distance from how far a point lies beyond each face pair."""
    outside = float(np.linalg.norm(np.maximum(excess, 0.0)))
    return outside if outside > 0 else float(excess.max())


def _freeze(solid: object, **shapes: tuple[int | None, ...]) -> None:
    for key, shape in shapes.items():
        what = f"{solid.name}: {key}"  # type: ignore[attr-defined]
        object.__setattr__(solid, key, frozen(getattr(solid, key), shape, what))


def _above_zero(name: str, what: str, *values: float) -> None:
    if not all(0 < value < np.inf for value in values):
        raise InputError(f"{name}: {what} must be above 0, got {', '.join(f'{v:g}' for v in values)}")
