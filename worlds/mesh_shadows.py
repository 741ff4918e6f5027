"""Floor area under the part of a closed mesh between two heights."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.worlds.arrays import Array

if TYPE_CHECKING:
    import trimesh  # takes long to load: imported by the functions that need it

GRID = 1e-9  # to which corners of a shadow are rounded [m]
SECTION = 0.4142  # share of a band of heights at which it is cut, as few meshes have corners there
SHEET = 1e-6  # that a shadow of a sheet is wider than nothing, to either side [m]


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
    whole = shapely.union_all([*triangles[valid], *inside], grid_size=GRID)
    lines = shapely.convex_hull(triangles[~valid])  # of upright faces; those of a sheet bound nothing
    sheets = lines[~shapely.covers(shapely.buffer(whole, 2 * GRID), lines)]
    shadow: BaseGeometry = shapely.union_all([whole, *shapely.buffer(sheets, SHEET)])
    return shadow


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
    z = above + SECTION * (below - above)
    lines = trimesh.intersections.mesh_plane(  # type: ignore[no-untyped-call]
        mesh, plane_normal=[0, 0, 1], plane_origin=[0, 0, z]
    )
    edges = shapely.union_all(shapely.linestrings(lines[:, :, :2]), grid_size=GRID)
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(edges)))
    spots = shapely.get_coordinates(shapely.point_on_surface(faces))
    return [one for one, at in zip(faces, spots, strict=True) if contains(np.append(at, z))]
