"""Triangle meshes for display: floor areas, obstacles, links, thick lines."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.view.options import VIEW
from regionik.worlds.arrays import Array, transform_points
from regionik.worlds.links import LinkBox, LinkCapsule, LinkHull, LinkSolid
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Solid, Sphere

OPTIONS = VIEW.scene

# Two triangles a side, counter-clockwise seen from outside; corners as `LinkBox.corners` has them.
_BOX_SIDES = [
    *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5]),  # x
    *([0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]),  # y
    *([0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),  # z
]


class TriangleMesh(NamedTuple):
    """Vertices (n, 3) [m] and faces (m, 3); corners that share a vertex are shaded smoothly."""

    vertices: Array
    faces: NDArray[np.uint32]


def merge(parts: list[TriangleMesh]) -> TriangleMesh:
    """Concatenate meshes."""
    if not parts:
        return TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.uint32))
    first = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + np.uint32(k) for part, k in zip(parts, first, strict=False)]
    return TriangleMesh(np.vstack([part.vertices for part in parts]), np.vstack(faces).astype(np.uint32))


def transform(part: TriangleMesh, T: Array) -> TriangleMesh:
    """Return a mesh moved by a transform (4, 4)."""
    return TriangleMesh(transform_points(T, part.vertices), part.faces)


def split_vertices(part: TriangleMesh) -> TriangleMesh:
    """Return the same faces, in order, with no vertex shared."""
    return _from_corners(part.vertices[part.faces])


def floor_mesh(area: BaseGeometry, z: float = 0.0) -> TriangleMesh:
    """Cut a floor area into triangles at height z [m]."""
    pieces = [small for part in shapely.get_parts(area) for small in _small_pieces(part)]
    cut = [shapely.get_parts(shapely.constrained_delaunay_triangles(p)) for p in pieces]
    corners = (
        shapely.get_coordinates(np.concatenate(cut)).reshape(-1, 4, 2)[:, :3] if cut else np.zeros((0, 3, 2))
    )
    return _from_corners(np.dstack([corners, np.full(corners.shape[:2], z)]))


def _small_pieces(area: BaseGeometry) -> Iterator[Polygon]:
    """Polygons of an area cut in halves until they have few corners: triangles of many take their square."""
    if not isinstance(area, Polygon) or area.area == 0:
        return
    if shapely.get_num_coordinates(area) <= OPTIONS.max_cut_corners:
        yield area
        return
    x0, y0, x1, y1 = area.bounds
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    wide = x1 - x0 > y1 - y0
    for half in ((x0, y0, x, y1), (x, y0, x1, y1)) if wide else ((x0, y0, x1, y), (x0, y, x1, y1)):
        for part in shapely.get_parts(shapely.clip_by_rect(area, *half)):
            yield from _small_pieces(part)


def extrude(area: BaseGeometry, bottom: float, top: float) -> TriangleMesh:
    """Extrude a floor area from one height to another: walls and top, for nobody sees it from below."""
    walls = []
    for polygon in shapely.get_parts(area):
        for ring in (polygon.exterior, *polygon.interiors):
            xy = shapely.get_coordinates(ring)
            a, b = xy[:-1], xy[1:]
            low, high = np.full((len(a), 1), bottom), np.full((len(a), 1), top)
            a0, b0, a1, b1 = (np.hstack(p) for p in ((a, low), (b, low), (a, high), (b, high)))
            walls += [np.stack([a0, b0, b1], axis=1), np.stack([a0, b1, a1], axis=1)]
    return merge([_from_corners(np.vstack(walls)), floor_mesh(area, top)])


def capsule(start: Array, end: Array, radius: float) -> TriangleMesh:
    """All points within ``radius`` of a segment; a sphere where its ends coincide."""
    along = np.asarray(end) - np.asarray(start)
    length = float(np.linalg.norm(along))
    arc = np.linspace(0.0, np.pi / 2, 6)
    r = radius * np.concatenate([np.sin(arc), np.cos(arc)])
    z = np.concatenate([-radius * np.cos(arc), length + radius * np.sin(arc)])
    turn = (
        np.eye(3) if length == 0 else np.column_stack([*_perpendicular(along[None] / length), along / length])
    )
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn, start
    return transform(_revolve(r, z), T)


def tubes(points: Array, radius: float) -> TriangleMesh:
    """A polyline (n, 3) as n - 1 thin prisms, ``2 * TUBE_SIDES`` faces each, in order."""
    a, b = points[:-1], points[1:]
    along = b - a
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.where(length > 0, along / np.where(length > 0, length, 1.0), [1.0, 0.0, 0.0])
    u, v = _perpendicular(along)
    angle = 2 * np.pi * np.arange(OPTIONS.tube_sides) / OPTIONS.tube_sides
    ring = radius * (np.cos(angle)[:, None, None] * u + np.sin(angle)[:, None, None] * v)
    overlap = 0.5 * radius * along  # neighbours overlap, so that bends show no gap
    vertices = np.concatenate([a - overlap + ring, b + overlap + ring]).transpose(1, 0, 2).reshape(-1, 3)
    k = np.arange(OPTIONS.tube_sides)
    after = (k + 1) % OPTIONS.tube_sides
    one = np.concatenate(
        [
            np.column_stack([k, after, after + OPTIONS.tube_sides]),
            np.column_stack([k, after + OPTIONS.tube_sides, k + OPTIONS.tube_sides]),
        ]
    )
    faces = one[None] + 2 * OPTIONS.tube_sides * np.arange(len(a))[:, None, None]
    return TriangleMesh(vertices, faces.reshape(-1, 3).astype(np.uint32))


def arrow(start: Array, end: Array, radius: float) -> TriangleMesh:
    """An arrow between two points (3,) [m]; one shorter than its head is all head."""
    along = end - start
    length = float(np.linalg.norm(along))
    if length == 0.0:
        return merge([])
    head = min(length, 6 * radius)
    T = np.eye(4)
    T[:3, 2] = along / length
    T[:3, 0], T[:3, 1] = _perpendicular(T[None, :3, 2])
    T[:3, 3] = end - head * T[:3, 2]
    cone = _revolve(radius * np.array([0.0, 2.5, 0.0]), np.array([0.0, 0.0, head]))
    shaft = [tubes(np.stack([start, T[:3, 3]]), radius)] if length > head else []
    return merge([*shaft, transform(cone, T)])


def spheres(centers: Array, radius: float) -> TriangleMesh:
    """Small spheres at points (n, 3), of equally many faces each, fewer where there are many points."""
    steps, around = (7, 12) if len(centers) <= 300 else (3, 4)
    arc = np.linspace(0.0, np.pi, steps)
    one = _revolve(radius * np.sin(arc), -radius * np.cos(arc), around)
    vertices = (np.asarray(centers)[:, None, :] + one.vertices).reshape(-1, 3)
    faces = one.faces + len(one.vertices) * np.arange(len(centers))[:, None, None]
    return TriangleMesh(vertices, faces.reshape(-1, 3).astype(np.uint32))


def wheel(center: Array, radius: float, width: float) -> TriangleMesh:
    """A wheel at a centre (3,) that rolls along x."""
    half = width / 2
    rim, side = radius * np.array([0.0, 1.0, 1.0, 0.0]), np.array([-half, -half, half, half])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]], center
    flat = transform(_revolve(rim, side), T)
    return split_vertices(flat)


def obstacle_mesh(body: Solid) -> TriangleMesh:
    """The surface of an obstacle."""
    match body:
        case Box() | Cylinder():
            return extrude(shadow_polygon(body), *body.z_range)
        case Sphere():
            return capsule(body.center, body.center, body.radius)
        case Prism():
            return extrude(body.polygon, body.bottom, body.top)
        case Mesh():
            return split_vertices(TriangleMesh(body.vertices, body.faces.astype(np.uint32)))


def link_mesh(body: LinkSolid) -> TriangleMesh:
    """The surface of a link's solid, in the link's frame."""
    match body:
        case LinkCapsule():
            return capsule(body.start, body.end, body.radius)
        case LinkBox():
            return _from_corners(body.corners[_BOX_SIDES])
        case LinkHull():
            return _from_corners(body.corners[body.polytope.triangles])


def shadow_polygon(body: Solid) -> BaseGeometry:
    """The shadow of a whole obstacle on the floor, circles as polygons."""
    shadow = body.shadow()
    return Polygon() if shadow is None else shadow.shape(quad_segs=OPTIONS.facets // 4)


def _from_corners(corners: Array) -> TriangleMesh:
    """A mesh of triangles (m, 3, 3) that share no vertex, so that edges look sharp."""
    faces = np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)
    return TriangleMesh(corners.reshape(-1, 3), faces)


def _perpendicular(along: Array) -> tuple[Array, Array]:
    """Two unit vectors (n, 3) that complete unit vectors (n, 3) to right-handed frames."""
    pick = np.where(np.abs(along[:, 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    u = np.cross(pick, along)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(along, u)
    return (u, v) if len(along) != 1 else (u[0], v[0])


def _revolve(r: Array, z: Array, around: int = OPTIONS.facets) -> TriangleMesh:
    """The surface of revolution of a profile (n,) about the z axis."""
    angle = 2 * np.pi * np.arange(around) / around
    vertices = np.stack(
        [np.outer(r, np.cos(angle)), np.outer(r, np.sin(angle)), np.repeat(z[:, None], around, axis=1)],
        axis=-1,
    )
    i, k = np.meshgrid(np.arange(len(r) - 1), np.arange(around), indexing="ij")
    a, b = i * around + k, i * around + (k + 1) % around
    faces = np.concatenate(
        [np.stack([a, b, b + around], axis=-1), np.stack([a, b + around, a + around], axis=-1)]
    )
    return TriangleMesh(vertices.reshape(-1, 3), faces.reshape(-1, 3).astype(np.uint32))
