"""Obstacles: named solids, their distance from points and their shadows on the floor.

A new primitive is a subclass of `Obstacle` here, named in `Solid`; its form in world files goes into
`regionik.worlds.documents.environment`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.affinity import affine_transform
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.worlds.arrays import (
    Array,
    Index,
    check_near_origin,
    freeze,
    frozen,
    frozen_faces,
    transform_points,
)
from regionik.worlds.errors import InputError
from regionik.worlds.shadows import Obstacle, Shadow
from regionik.worlds.surfaces import mesh_shadow, winding_number

if TYPE_CHECKING:
    import trimesh  # takes long to load: imported by the functions that need it


@dataclass(frozen=True, eq=False, repr=False)
class Box(Obstacle):
    """An upright box, turned by yaw about its centre.

    Attributes
    ----------
    name : str
    size : (3,) array
        [m]
    center : (3,) array
        [m]
    yaw : float
        [rad]
    clearance : float or None
        As in `Obstacle` [m].

    Examples
    --------
    >>> Box("crate", [1, 2, 0.5], [0, 0, 0.25]).distance(np.array([1.5, 0, 0.25]))
    1.0
    """

    name: str
    size: Array
    center: Array
    yaw: float = 0.0
    clearance: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze(self, self.name, size=(3,), center=(3,))
        check_near_origin(self.center, f"{self.name}: center")
        _check_positive(self.name, "size", *self.size)
        object.__setattr__(self, "yaw", float(frozen(self.yaw, (), f"{self.name}: yaw")))

    @property
    def bounds(self) -> Array:
        half = np.array([np.hypot(*self.size[:2]), np.hypot(*self.size[:2]), self.size[2]]) / 2
        return np.stack([self.center - half, self.center + half])

    def _shadow(self, below: float, above: float) -> Shadow:
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * self.size[:2] / 2
        return Shadow(Polygon(corners @ np.array([[c, s], [-s, c]]) + self.center[:2]))

    def distance(self, point: Array) -> float:
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        x, y, z = point - self.center
        local = np.array([c * x + s * y, -s * x + c * y, z])
        return _box_distance(np.abs(local) - self.size / 2)

    def transformed(self, T: Array) -> Self:
        turn = float(np.arctan2(T[1, 0], T[0, 0]))
        return replace(self, center=transform_points(T, self.center), yaw=self.yaw + turn)


@dataclass(frozen=True, eq=False, repr=False)
class Cylinder(Obstacle):
    """An upright cylinder.

    Attributes
    ----------
    name : str
    radius, height : float
        [m]
    center : (3,) array
        [m]
    clearance : float or None
        As in `Obstacle` [m].

    Examples
    --------
    >>> Cylinder("post", 0.1, 1.0, [2, 0, 0.5]).z_range
    (0.0, 1.0)
    """

    name: str
    radius: float
    height: float
    center: Array
    clearance: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze(self, self.name, center=(3,))
        check_near_origin(self.center, f"{self.name}: center")
        _check_positive(self.name, "radius and height", self.radius, self.height)

    @property
    def bounds(self) -> Array:
        half = np.array([self.radius, self.radius, self.height / 2])
        return np.stack([self.center - half, self.center + half])

    def _shadow(self, below: float, above: float) -> Shadow:
        return Shadow(Point(self.center[:2]), self.radius)

    def distance(self, point: Array) -> float:
        x, y, z = point - self.center
        return _box_distance(np.array([np.hypot(x, y) - self.radius, abs(z) - self.height / 2]))

    def transformed(self, T: Array) -> Self:
        return replace(self, center=transform_points(T, self.center))


@dataclass(frozen=True, eq=False, repr=False)
class Sphere(Obstacle):
    """A ball.

    Attributes
    ----------
    name : str
    radius : float
        [m]
    center : (3,) array
        [m]
    clearance : float or None
        As in `Obstacle` [m].

    Examples
    --------
    >>> Sphere("ball", 0.5, [0, 0, 1]).distance(np.array([0, 0, 0]))
    0.5
    """

    name: str
    radius: float
    center: Array
    clearance: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze(self, self.name, center=(3,))
        check_near_origin(self.center, f"{self.name}: center")
        _check_positive(self.name, "radius", self.radius)

    @property
    def bounds(self) -> Array:
        return np.stack([self.center - self.radius, self.center + self.radius])

    def _shadow(self, below: float, above: float) -> Shadow:
        off = float(self.center[2] - np.clip(self.center[2], above, below))
        return Shadow(Point(self.center[:2]), float(np.sqrt(self.radius**2 - off**2)))

    def distance(self, point: Array) -> float:
        return float(np.linalg.norm(point - self.center) - self.radius)

    def transformed(self, T: Array) -> Self:
        return replace(self, center=transform_points(T, self.center))


@dataclass(frozen=True, eq=False, repr=False)
class Prism(Obstacle):
    """A floor polygon, with holes or without, raised from one height to another.

    Attributes
    ----------
    name : str
    polygon : Polygon
        Or its corners (n, 2) in order [m].
    bottom, top : float
        [m]
    clearance : float or None
        As in `Obstacle` [m].

    Examples
    --------
    >>> Prism("shelf", [[0, 0], [1, 0], [1, 0.4]], 0.9, 1.0)
    Prism('shelf', polygon=<Polygon>, bottom=0.9, top=1.0)
    """

    name: str
    polygon: Polygon
    bottom: float
    top: float
    clearance: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "polygon", as_polygon(self.polygon, f"{self.name}: polygon"))
        if not isinstance(self.polygon, Polygon):
            parts = shapely.get_num_geometries(self.polygon)
            raise InputError(f"{self.name}: polygon: expected one polygon, got {parts}: a prism for each")
        check_near_origin([self.bottom, self.top], f"{self.name}: z")
        _check_positive(self.name, "height (z from low to high)", self.top - self.bottom)

    @property
    def bounds(self) -> Array:
        x_low, y_low, x_high, y_high = self.polygon.bounds
        return np.array([[x_low, y_low, self.bottom], [x_high, y_high, self.top]])

    @property
    def z_range(self) -> tuple[float, float]:
        return self.bottom, self.top

    def _shadow(self, below: float, above: float) -> Shadow:
        return Shadow(self.polygon)

    def distance(self, point: Array) -> float:
        spot = Point(point[:2])
        flat = self.polygon.boundary.distance(spot)
        flat = -flat if self.polygon.contains(spot) else flat
        middle, half = (self.bottom + self.top) / 2, (self.top - self.bottom) / 2
        return _box_distance(np.array([flat, abs(point[2] - middle) - half]))

    def transformed(self, T: Array) -> Self:
        level = [T[0, 0], T[0, 1], T[1, 0], T[1, 1], T[0, 3], T[1, 3]]
        outline = affine_transform(self.polygon, level)
        return replace(self, polygon=outline, bottom=self.bottom + T[2, 3], top=self.top + T[2, 3])


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(Obstacle):
    """A closed triangle mesh, taken as a solid, or a sheet of triangles.

    Attributes
    ----------
    name : str
    vertices : (n, 3) array
        In the world [m].
    faces : (m, 3) array of int
        Indices of the corners of each triangle.
    sheet : bool
        It is a surface without an inside, as a skin or a scan: it need not be closed, and its triangles may
        lie in any way.
    clearance : float or None
        As in `Obstacle` [m].

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> Mesh("wedge", corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    Mesh('wedge', vertices=<4 x 3 array>, faces=<4 x 3 array>)
    """

    name: str
    vertices: Array
    faces: Index
    sheet: bool = False
    clearance: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze(self, self.name, vertices=(None, 3))
        check_near_origin(self.vertices, f"{self.name}: vertices")
        faces = frozen_faces(self.faces, len(self.vertices), f"{self.name}: mesh")
        if not len(faces):
            raise InputError(f"{self.name}: mesh: expected triangles, got none")
        object.__setattr__(self, "faces", faces)

    @property
    def bounds(self) -> Array:
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @property
    def is_closed(self) -> bool:
        """True where every edge joins two triangles, so that there is an inside."""
        return bool(self._trimesh.is_watertight)

    def _shadow(self, below: float, above: float) -> Shadow:
        return Shadow(mesh_shadow(self._trimesh, self.contains, below, above))

    def distance(self, point: Array) -> float:
        import trimesh

        corners = self.vertices[self.faces[self._perhaps_nearest(point)]]
        spots = np.broadcast_to(point, (len(corners), 3))
        nearest = trimesh.triangles.closest_point(corners, spots)  # type: ignore[no-untyped-call]
        gap = float(np.linalg.norm(nearest - point, axis=1).min())
        return -gap if self.contains(point) else gap

    def _perhaps_nearest(self, point: Array) -> Index:
        """Triangles whose boxes are no farther from a point than the nearest corner."""
        low, high = self._boxes
        gap = np.linalg.norm(np.maximum(np.maximum(low - point, point - high), 0.0), axis=1)
        return np.flatnonzero(gap <= np.linalg.norm(self.vertices[self.faces[:, 0]] - point, axis=1).min())

    def contains(self, point: Array) -> bool:
        """Return True where the surface of a solid winds round the point (winding number above 1/2)."""
        low, high = self._extent
        if self.sheet or (point < low).any() or (point > high).any():
            return False
        return abs(winding_number(self._columns, point)) > 1 / 2

    def transformed(self, T: Array) -> Self:
        return replace(self, vertices=transform_points(T, self.vertices))

    @cached_property
    def _extent(self) -> Array:
        return self.bounds

    @cached_property
    def _boxes(self) -> tuple[Array, Array]:
        """Low and high corners of boxes round triangles, (n, 3) each."""
        corners = self.vertices[self.faces]
        return corners.min(axis=1), corners.max(axis=1)

    @cached_property
    def _columns(self) -> tuple[Array, Array, Array]:
        """Coordinates (3, n) of each corner of all triangles."""
        a, b, c = (np.ascontiguousarray(self.vertices[self.faces[:, k]].T) for k in range(3))
        return a, b, c

    @cached_property
    def _trimesh(self) -> trimesh.Trimesh:
        import trimesh

        return trimesh.Trimesh(self.vertices, self.faces, process=False)


Solid = Box | Cylinder | Sphere | Prism | Mesh


def as_polygon(outline: Polygon | ArrayLike, what: str) -> Any:
    """Return a floor area itself, or the polygon of corners (n, 2).

    An `InputError` says where it is empty, or its outline crosses or touches itself.
    """
    polygon: Any = outline
    if not isinstance(outline, BaseGeometry):
        corners = frozen(outline, (None, 2), what)
        if len(corners) < 3:
            raise InputError(f"{what}: expected at least 3 corners, got {len(corners)}")
        polygon = Polygon(corners)
    if not polygon.is_valid or polygon.is_empty or polygon.area <= 0:
        why = "its area is zero" if polygon.is_valid else shapely.is_valid_reason(polygon)
        raise InputError(f"{what}: expected an outline that does not cross or touch itself: {why}")
    check_near_origin(polygon.bounds, what)
    return polygon


def _box_distance(excess: Array) -> float:
    """Return the signed distance of a point that lies so far beyond each pair of faces."""
    outside = float(np.linalg.norm(np.maximum(excess, 0.0)))
    return outside if outside > 0 else float(excess.max())


def _check_positive(name: str, what: str, *values: float) -> None:
    if not all(0 < value < np.inf for value in values):
        raise InputError(f"{name}: {what} must be above 0, got {', '.join(f'{v:g}' for v in values)}")
