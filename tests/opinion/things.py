"""The solids of a plan's document, as coal and shapely see them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import coal
import numpy as np
import shapely
from numpy.typing import NDArray

Array = NDArray[np.float64]


def _request(tolerance: float) -> Any:
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    request.gjk_tolerance = request.epa_tolerance = tolerance
    return request


FLOOR = "the floor"
BEYOND = 20.0  # that it goes on beyond the edge of where the base may drive, and how thick it is [m]
POINTS = 300  # of a solid
GRID, LOST = 1e-9, 1e-8  # of corners of a shadow [m], and what of a face it may lack [m2]
# What coal says where it finds no depth [m]; it finds one with the two exchanged, or less exactly.
NO_DEPTH = -1e300
REQUESTS, RESULT = (_request(1e-8), _request(1e-6)), coal.DistanceResult()


@dataclass(frozen=True)
class Shape:
    """A convex solid of coal's and where it is fixed."""

    solid: Any
    where: Array  # (4, 4)
    corners: Array | None = None  # of a hull, (n, 3) [m]

    @cached_property
    def ball(self) -> tuple[Array, float]:
        """Middle, in the solid's own frame, and radius of a ball round it."""
        self.solid.computeLocalAABB()
        return np.array(self.solid.aabb_center), float(self.solid.aabb_radius)

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Middle and half the size of a box round the solid, in its own frame."""
        self.solid.computeLocalAABB()
        low, high = (np.array(corner) for corner in (self.solid.aabb_local.min_, self.solid.aabb_local.max_))
        return (low + high) / 2, (high - low) / 2

    @cached_property
    def points(self) -> Array:
        """Some points of its surface and inside, in its own frame, (n, 3); of what robots are made of."""
        rng = np.random.default_rng(0)
        ways = rng.normal(size=(POINTS, 3))
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        match self.solid:
            case coal.Sphere():
                found: Array = self.solid.radius * ways
            case coal.Cylinder():
                level = self.solid.radius * ways[:, :2] / np.linalg.norm(ways[:, :2], axis=1, keepdims=True)
                found = np.column_stack([level, self.solid.halfLength * rng.uniform(-1, 1, POINTS)])
            case coal.Box():
                found = self.solid.halfSide * ways / np.abs(ways).max(1, keepdims=True)
            case _ if self.corners is not None:
                found = rng.dirichlet(np.full(len(self.corners), 0.2), POINTS) @ self.corners
            case _:
                raise TypeError(f"no points of a {type(self.solid).__name__}")
        return found

    @cached_property
    def placed(self) -> Any:
        """Where the solid is fixed, as coal has it."""
        return placed(self.where)


@dataclass(frozen=True)
class Thing:
    """A named obstacle: convex pieces that make it up, or a closed surface, and its floor plan."""

    name: str
    pieces: tuple[Shape, ...]
    surface: Array | None = None  # (n, 3, 3) corners of triangles
    core: Any = None  # on the floor, everything within `radius` of it; None where it is too high
    radius: float = 0.0
    clearance: float | None = None  # that the base keeps from it in place of that of the rules [m]

    def contains(self, point: Array) -> bool:
        """Whether a point lies inside a closed surface, whose rays cross it an odd number of times."""
        if self.surface is None:
            return False
        votes = [_crossings(self.surface, point, ray) % 2 for ray in RAYS]
        return sum(votes) * 2 > len(votes)


RAYS = np.array([[0.31, 0.52, 0.79], [-0.71, 0.12, 0.33], [0.17, -0.83, -0.41]])


def _crossings(triangles: Array, point: Array, ray: Array) -> int:
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    across = np.cross(ray, v)
    slope = (u * across).sum(1)
    safe = np.where(np.abs(slope) < 1e-15, np.inf, slope)
    off = point - a
    s = (off * across).sum(1) / safe
    other = np.cross(off, u)
    t = (other @ ray) / safe
    far = (v * other).sum(1) / safe
    return int(((s > 0) & (t > 0) & (s + t < 1) & (far > 0)).sum())


def distance_of(one: Any, T_one: Any, other: Any, T_other: Any) -> float:
    """Distance of two solids where they are `placed`, below 0 by the depth where they overlap [m]."""
    if isinstance(one, coal.Sphere) and isinstance(other, coal.Cylinder):
        return _off_cylinder(other, T_other.inverse().transform(T_one.getTranslation())) - float(one.radius)
    if isinstance(one, coal.Cylinder) and isinstance(other, coal.Sphere):
        return distance_of(other, T_other, one, T_one)
    pairs = (one, T_one, other, T_other), (other, T_other, one, T_one)
    for request, pair in product(REQUESTS, pairs):
        RESULT.clear()
        gap = float(coal.distance(*pair, request, RESULT))
        if gap > NO_DEPTH:
            break
    return gap


def _off_cylinder(one: Any, point: Array) -> float:
    """Distance of a point in a cylinder's frame from it, below 0 inside, where coal is wrong [m]."""
    aside = float(np.hypot(*point[:2]) - one.radius)
    above = float(abs(point[2]) - one.halfLength)
    return min(max(aside, above), 0.0) + float(np.hypot(max(aside, 0.0), max(above, 0.0)))


def placed(T: Array) -> Any:
    """A frame (4, 4) as coal has it."""
    return coal.Transform3s(np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3]))


def hull_shape(corners: Array) -> Shape:
    """The hull of some points."""
    points = coal.StdVec_Vec3s()
    points.extend(list(corners))
    return Shape(coal.Convex.convexHull(points, False, None), np.eye(4), corners)


def things_of(world: dict[str, Any], below: float) -> list[Thing]:
    """All obstacles and map cells of a world's document; floor plans are of what is lower than ``below``."""
    cells = world["floor"].get("cells", [])
    every = [*world["obstacles"], *({"name": cell["name"], "prism": cell} for cell in cells)]
    return [
        *(replace(_thing(one, below), clearance=one.get("clearance")) for one in every),
        *([_slab(world)] if world["rules"]["solid_floor"] else []),
    ]


def floor_of(world: dict[str, Any]) -> Any:
    """Where the base of a world's document may be: the floor, inside zones to keep in, outside the others."""
    floor = shapely.Polygon(world["floor"]["polygon"], world["floor"].get("holes", []))
    for zone in world.get("zones", []):
        polygon = shapely.Polygon(zone["polygon"], zone.get("holes", []))
        floor = floor & polygon if zone["keep"] == "in" else floor - polygon
    return floor


def asked_of(thing: Thing, rules: dict[str, Any]) -> float:
    """What the base has to keep from a thing [m]."""
    return float(rules["clearance"]) if thing.clearance is None else thing.clearance


def _slab(world: dict[str, Any]) -> Thing:
    """The floor as the arm sees it: everything below z = 0, round about where the base may drive."""
    low, high = np.min(world["floor"]["polygon"], axis=0), np.max(world["floor"]["polygon"], axis=0)
    size = np.array([*(high - low) + 2 * BEYOND, BEYOND])
    T = _at(np.array([*(low + high) / 2, -BEYOND / 2]))
    return Thing(FLOOR, (Shape(coal.Box(*size), T),))


def _thing(entry: dict[str, Any], below: float) -> Thing:
    name = entry["name"]
    if "box" in entry:
        return _box(name, entry["box"], below)
    if "cylinder" in entry:
        one = entry["cylinder"]
        center = np.array(one["center"])
        shape = Shape(coal.Cylinder(one["radius"], one["height"]), _at(center))
        low = center[2] - one["height"] / 2 < below
        return Thing(name, (shape,), None, shapely.Point(center[:2]) if low else None, one["radius"])
    if "sphere" in entry:
        center, radius = np.array(entry["sphere"]["center"]), entry["sphere"]["radius"]
        rise = max(center[2] - below, 0.0)  # of the ball's middle over what counts
        low = rise < radius
        width = float(np.sqrt(radius**2 - rise**2)) if low else 0.0
        core = shapely.Point(center[:2]) if low else None
        return Thing(name, (Shape(coal.Sphere(radius), _at(center)),), None, core, width)
    if "prism" in entry:
        return _prism(name, entry["prism"], below)
    return _mesh(name, entry["mesh"], below)


def _at(center: Array, yaw: float = 0.0) -> Array:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0, center[0]], [s, c, 0, center[1]], [0, 0, 1, center[2]], [0, 0, 0, 1.0]])


def _box(name: str, one: dict[str, Any], below: float) -> Thing:
    size, T = np.array(one["size"]), _at(np.array(one["center"]), one.get("yaw", 0.0))
    corners = [(T @ [sx * size[0] / 2, sy * size[1] / 2, 0, 1])[:2] for sx, sy in SQUARE]
    core = shapely.Polygon(corners) if T[2, 3] - size[2] / 2 < below else None
    return Thing(name, (Shape(coal.Box(*size), T),), None, core)


SQUARE = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def _prism(name: str, one: dict[str, Any], below: float) -> Thing:
    outline = shapely.Polygon(one["polygon"], one.get("holes", []))
    low, high = one["z"]
    pieces = []
    for part in shapely.get_parts(shapely.constrained_delaunay_triangles(outline)):
        corners = np.asarray(part.exterior.coords)[:3]
        pieces.append(hull_shape(np.array([[x, y, z] for z in (low, high) for x, y in corners])))
    return Thing(name, tuple(pieces), None, outline if low < below else None)


def _mesh(name: str, one: dict[str, Any], below: float) -> Thing:
    vertices, faces = np.array(one["vertices"], dtype=float), np.array(one["faces"])
    surface = coal.BVHModelOBBRSS()
    surface.beginModel(len(faces), len(vertices))
    surface.addVertices(vertices)
    surface.addTriangles(faces)
    surface.endModel()
    triangles = vertices[faces]
    flat = [cut for one_ in triangles if len(cut := _lower(one_, below)) > 2]
    plans = [shapely.MultiPoint(cut[:, :2]).convex_hull for cut in flat]
    core = shapely.union_all(plans, grid_size=GRID) if plans else None
    if plans:  # unions may lose parts
        assert shapely.area(shapely.difference(plans, core)).max() < LOST
    return Thing(name, (Shape(surface, np.eye(4)),), triangles, core)


def _lower(triangle: Array, below: float) -> Array:
    """Corners of what of a triangle lies lower than a height."""
    kept = []
    for a, b in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
        if a[2] < below:
            kept.append(a)
        if (a[2] < below) != (b[2] < below):
            kept.append(a + (b - a) * (below - a[2]) / (b[2] - a[2]))
    return np.array(kept).reshape(-1, 3)
