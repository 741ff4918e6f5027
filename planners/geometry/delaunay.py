"""Constrained Delaunay triangles of polygons, by shapely."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon

from regionik.worlds.arrays import Array, Index


def delaunay_triangles(polygon: Polygon | MultiPolygon) -> tuple[Array, Index]:
    """Constrained Delaunay triangles: vertices (v, 2) [m], and indices counter-clockwise, (t, 3)."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    xy = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)[:, :3]
    vertices, corners = np.unique(xy.reshape(-1, 2), axis=0, return_inverse=True)
    return vertices, corners.reshape(-1, 3).astype(np.int64)
