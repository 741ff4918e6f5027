"""A convex footprint, the floor and obstacles, as values for checks (`regionik.planners.driving.footprint`).

A base may have other outlines above its footprint, each among the obstacles at its own heights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.geometry.polygons import FlatPolygon
from regionik.worlds.arrays import Array, Index, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.shadows import Shadow


def convex_corners(footprint: ArrayLike) -> Array:
    """Return the corners of a convex footprint, counter-clockwise, without those on straight edges.

    Raises
    ------
    InputError
        When it has no area and is not a single point.
    """
    given = frozen(footprint, (None, 2), "footprint")
    if len(given) == 1:
        return given
    hull = shapely.convex_hull(shapely.multipoints(given))
    if not isinstance(hull, Polygon) or hull.area < 1e-9:
        raise InputError("footprint: expected an outline with an area, its corners lie on one line")
    corners = np.asarray(shapely.orient_polygons(hull).exterior.coords)[:-1]
    return frozen(corners, (None, 2), "footprint")


def footprint_width(footprint: ArrayLike) -> float:
    """Smallest distance between two parallel lines with the footprint between them [m].

    Examples
    --------
    >>> round(footprint_width([[0, 0], [0.58, 0], [0.58, 0.38], [0, 0.38]]), 12)
    0.38
    """
    corners = convex_corners(footprint)
    if len(corners) == 1:
        return 0.0
    normals, offsets = side_lines(corners)
    return float((offsets[:, None] - normals @ corners.T).max(axis=1).min())


def side_lines(corners: Array) -> tuple[Array, Array]:
    """Outward normals n (k, 2) and offsets d (k,) of a convex outline: it is where n x <= d for all sides."""
    along = np.roll(corners, -1, axis=0) - corners
    normals: Array = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, None]
    return normals, np.einsum("ij,ij->i", normals, corners)


class UpperOutlines(NamedTuple):
    """Outlines of the base above its footprint, each among the obstacles at its own heights."""

    corners: Array  # (n, 2) of the convex outlines in the base frame, counter-clockwise [m]
    edges: Array  # (m, 4) both ends of every edge of obstacles [m]
    clearance: Array  # (m,) the outline stays farther from an edge than this [m]
    solid: Array  # (k, 2) vertices of the areas that obstacles cover [m]
    solid_starts: Index  # (r + 1,) first vertex of each ring
    # (p + 1,) first of each outline's
    corner_starts: Index
    edge_starts: Index
    ring_starts: Index


class FootprintScene(NamedTuple):
    """A footprint, the floor and the obstacles, as values for kernels; made by `footprint_scene`."""

    corners: Array  # (n, 2) of the convex footprint in the base frame, counter-clockwise [m]
    edges: Array  # (m, 4) both ends of every edge of floor and obstacles [m]
    clearance: Array  # (m,) the footprint stays farther from an edge than this [m]
    # vertices, starts: the floor, as `FlatPolygon`
    vertices: Array
    starts: Index
    # solid, solid_starts: the area that obstacles cover, likewise
    solid: Array
    solid_starts: Index
    upper: UpperOutlines  # what else of the base keeps clear of obstacles

    def with_berth(self, berth: float) -> FootprintScene:
        """Return the scene with so much more kept from every edge [m]."""
        upper = self.upper._replace(clearance=self.upper.clearance + berth)
        return self._replace(clearance=self.clearance + berth, upper=upper)


@dataclass(frozen=True)
class Outline:
    """A convex outline of the base at some heights, and the shadows of what it could hit there."""

    corners: tuple[tuple[float, float], ...]  # counter-clockwise [m]
    shadows: tuple[Shadow, ...]
    clearance: float  # that it keeps from each of them, but for what they ask for beyond it [m]


def footprint_scene(
    footprint: ArrayLike,
    floor: Polygon | MultiPolygon,
    obstacles: Sequence[Shadow] = (),
    clearance: float = 0.0,
    upper: Sequence[Outline] = (),
) -> FootprintScene:
    """Prepare a footprint, a floor and obstacles for the checks of this module.

    Parameters
    ----------
    footprint : (n, 2) array_like
        Corners of a convex outline in the base frame, or one point; the origin may lie anywhere [m].
    floor : Polygon or MultiPolygon
        The footprint stays inside, without clearance [m].
    obstacles : sequence of Shadow
        The footprint keeps ``clearance`` from each of them, and what each asks for beyond it.
    clearance : float [m]
    upper : sequence of Outline
        Other outlines of the base, each among obstacles of its own; the floor does not bind them.

    Raises
    ------
    InputError
        When the footprint has no area and is no point, or the floor is no polygon.
    """
    flat = FlatPolygon.from_shapely(floor)
    edges, distances, covered = _obstacle_tables(obstacles, clearance)
    rim = edges_of(flat)
    # Writable copies throughout: one signature, so that the kernels are compiled once.
    return FootprintScene(
        np.array(convex_corners(footprint)),
        np.concatenate([rim, edges]),
        np.concatenate([np.zeros(len(rim)), distances]),
        np.array(flat.vertices),
        np.array(flat.starts),
        np.array(covered.vertices),
        np.array(covered.starts),
        _upper_outlines(upper),
    )


def _obstacle_tables(obstacles: Sequence[Shadow], clearance: float) -> tuple[Array, Array, FlatPolygon]:
    """Edges (m, 4) of shadows, the distance to keep from each (m,), and the area that shadows cover."""
    shadows = [shadow for shadow in obstacles if not shadow.core.is_empty]
    tables = [np.zeros((0, 4)), *(core_edges(shadow.core) for shadow in shadows)]
    distances = [0.0, *(clearance + shadow.kept for shadow in shadows)]
    bodies = [shadow.core for shadow in shadows if isinstance(shadow.core, Polygon | MultiPolygon)]
    none = FlatPolygon(np.zeros((0, 2)), np.zeros(1, dtype=np.int64))
    covered = FlatPolygon.from_shapely(shapely.union_all(bodies)) if bodies else none
    return np.concatenate(tables), np.repeat(distances, [len(table) for table in tables]), covered


def _upper_outlines(outlines: Sequence[Outline]) -> UpperOutlines:
    corners = [np.array(convex_corners(np.array(one.corners))) for one in outlines]
    tables = [_obstacle_tables(one.shadows, one.clearance) for one in outlines]
    vertices = [flat.vertices for _, _, flat in tables]
    firsts = _starts(vertices)
    rings = [flat.starts[:-1] + first for (_, _, flat), first in zip(tables, firsts[:-1], strict=True)]
    return UpperOutlines(
        np.concatenate([np.zeros((0, 2)), *corners]),
        np.concatenate([np.zeros((0, 4)), *(edges for edges, _, _ in tables)]),
        np.concatenate([np.zeros(0), *(distances for _, distances, _ in tables)]),
        np.concatenate([np.zeros((0, 2)), *vertices]),
        np.concatenate([*rings, firsts[-1:]]),
        _starts(corners),
        _starts([edges for edges, _, _ in tables]),
        _starts(rings),
    )


def _starts(tables: Sequence[Array]) -> Index:
    """First row of each table where they stand one after the other, and how many rows there are, (n + 1,)."""
    return np.cumsum([0, *map(len, tables)], dtype=np.int64)


def core_edges(core: shapely.Geometry) -> Array:
    """Both ends of every edge of a shadow's core, (n, 4); a point is an edge without length."""
    if isinstance(core, Polygon | MultiPolygon):
        return edges_of(FlatPolygon.from_shapely(core))
    points = shapely.get_coordinates(core)
    if len(points) == 1:
        return np.hstack([points, points])
    return np.hstack([points[:-1], points[1:]])


def edges_of(flat: FlatPolygon) -> Array:
    """Both ends of every edge of a flat polygon, (n, 4)."""
    ends = np.arange(1, len(flat.vertices) + 1)
    ends[flat.starts[1:] - 1] = flat.starts[:-1]
    return np.hstack([flat.vertices, flat.vertices[ends]])
