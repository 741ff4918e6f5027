"""Triangle meshes: what pictures show of a robot, and the floor area under part of a solid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.worlds.arrays import Array, Index, frozen, frozen_faces, one_line
from regionik.worlds.errors import InputError

if TYPE_CHECKING:
    import trimesh  # takes long to load: imported by the functions that need it


SHADOW_GRID = 1e-9  # to which corners of a shadow are rounded [m]
SECTION_SHARE = 0.4142  # share of a band of heights at which it is cut, as few meshes have corners there
SHEET_WIDTH = 1e-6  # that a shadow of a sheet is wider than nothing, to either side [m]


def mesh_shadow(
    mesh: trimesh.Trimesh, contains: Callable[[Array], bool], below: float, above: float
) -> BaseGeometry:
    """Return the floor area under what of a solid mesh is between two heights.

    Parameters
    ----------
    mesh : Trimesh
    contains : function of a point (3,)
        Whether it lies in the solid.
    below, above : float
        Highest and lowest height [m].
    """
    part = _sliced(_sliced(mesh, below, -1.0), above, 1.0)
    triangles = shapely.polygons(part.vertices[part.faces][:, :, :2])
    valid = shapely.is_valid(triangles)
    inside = _section(mesh, contains, below, above)
    # Without a grid GEOS silently loses faces of one mesh in fifty: slivers throw its overlay off.
    whole = shapely.union_all([*triangles[valid], *inside], grid_size=SHADOW_GRID)
    lines = shapely.convex_hull(triangles[~valid])  # of upright faces; those of a sheet bound nothing
    sheets = lines[~shapely.covers(shapely.buffer(whole, 2 * SHADOW_GRID), lines)]
    shadow: BaseGeometry = shapely.union_all([whole, *shapely.buffer(sheets, SHEET_WIDTH)])
    return shadow


def winding_number(corners: Sequence[Array], point: Array) -> float:
    """Number of times that a surface winds round a point: the sum of its triangles' solid angles over 4 pi.

    Parameters
    ----------
    corners : three (3, n) arrays
        Coordinates of each corner of all triangles [m].
    point : (3,) array [m]

    Source: Van Oosterom and Strackee, The solid angle of a plane triangle (1983).
    """
    a, b, c = (one - point[:, None] for one in corners)
    la, lb, lc = (np.sqrt(_dot(v, v)) for v in (a, b, c))
    triple = (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
    scale = la * lb * lc + lc * _dot(a, b) + la * _dot(b, c) + lb * _dot(c, a)
    return float(np.arctan2(triple, scale).sum()) / (2 * np.pi)


def _dot(a: Array, b: Array) -> Array:
    """Products of vectors (3, n), (n,)."""
    product: Array = np.einsum("ij,ij->j", a, b)
    return product


def _sliced(mesh: trimesh.Trimesh, height: float, up: float) -> trimesh.Trimesh:
    """Surface of a mesh above a height, or below it where ``up`` is -1 [m]."""
    import trimesh

    if not np.isfinite(height):
        return mesh
    return trimesh.intersections.slice_mesh_plane(  # type: ignore[no-untyped-call]
        mesh, plane_normal=[0, 0, up], plane_origin=[0, 0, height]
    )


def _section(
    mesh: trimesh.Trimesh, contains: Callable[[Array], bool], below: float, above: float
) -> list[BaseGeometry]:
    """Parts of a level section that lie in the solid, of which some have no surface between the heights."""
    import trimesh

    low, high = mesh.vertices[:, 2].min(), mesh.vertices[:, 2].max()
    if above <= low or below >= high:
        return []
    z = above + SECTION_SHARE * (below - above)
    lines = trimesh.intersections.mesh_plane(  # type: ignore[no-untyped-call]
        mesh, plane_normal=[0, 0, 1], plane_origin=[0, 0, z]
    )
    edges = shapely.union_all(shapely.linestrings(lines[:, :, :2]), grid_size=SHADOW_GRID)
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(edges)))
    spots = shapely.get_coordinates(shapely.point_on_surface(faces))
    return [one for one, at in zip(faces, spots, strict=True) if contains(np.append(at, z))]


MERGE_CELL = 1e-5  # corners in one cell of this side are one [m]
FIRST_CELL, CELL_GROWTH = (
    0.7,
    1.25,
)  # first cells that are tried, by the side of triangles of even size, and the next
_MAX_CELLS = 2_000_000  # along each side of a surface


@dataclass(frozen=True, eq=False)
class VisualSurface:
    """A surface of one colour that moves with one arm link."""

    link: int  # index into ``Chain.frames``; `regionik.worlds.links.BASE` for what is fixed to the base
    color: int  # 0xRRGGBB
    vertices: Array  # (n, 3) in the link's frame, in single precision, as files hold them [m]
    faces: Index  # (m, 3) indices of vertices
    stands_for: tuple[str, ...] = ()  # names of the robot's solids that need not be shown beside it

    def __post_init__(self) -> None:
        rounded = np.asarray(self.vertices, dtype=np.float32)
        object.__setattr__(self, "vertices", frozen(rounded, (None, 3), "visual surface: vertices"))
        faces = frozen_faces(self.faces, len(self.vertices), "visual surface: faces")
        object.__setattr__(self, "faces", faces)
        if not 0 <= self.color <= 0xFFFFFF:
            raise InputError(f"visual surface: color: expected 0 to 0xffffff, got {self.color}")
        object.__setattr__(self, "stands_for", tuple(self.stands_for))

    __repr__ = one_line


def coarsened(surfaces: tuple[VisualSurface, ...], most: int) -> tuple[VisualSurface, ...]:
    """Return surfaces with at most about ``most`` triangles in all.

    Corners in one cell of a grid become their mean, triangles in one cell vanish (vertex clustering,
    Rossignac and Borrel, 1993). All surfaces have the same grid, the finest that does.

    >>> corners = np.random.default_rng(1).uniform(size=(300, 3))
    >>> rough = coarsened((VisualSurface(0, 0, corners, np.arange(300).reshape(-1, 3)),), 40)
    >>> len(rough[0].faces) <= 40
    True
    """
    rough = tuple(_clustered(one, MERGE_CELL) for one in surfaces)
    cell = FIRST_CELL * np.sqrt(sum(_area(one) for one in rough) / most)
    while sum(len(one.faces) for one in rough) > most:
        rough = tuple(_clustered(one, cell) for one in rough)
        cell *= CELL_GROWTH
    return tuple(one for one in rough if len(one.faces))


def _area(surface: VisualSurface) -> float:
    """Area of a surface [m2]."""
    a, b, c = surface.vertices[surface.faces].swapaxes(0, 1)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2


def _clustered(surface: VisualSurface, cell: float) -> VisualSurface:
    low = surface.vertices.min(axis=0)
    side = max(cell, float(np.ptp(surface.vertices, axis=0).max()) / _MAX_CELLS)
    x, y, z = ((surface.vertices - low) / side).astype(np.int64).T
    _, which, count = np.unique(
        (x * _MAX_CELLS + y) * _MAX_CELLS + z, return_inverse=True, return_counts=True
    )
    means = [np.bincount(which, column) / count for column in surface.vertices.T]
    faces = which[surface.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    return VisualSurface(surface.link, surface.color, np.column_stack(means), faces)
