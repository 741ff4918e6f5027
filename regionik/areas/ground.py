"""Free floor of the arm axis: the floor less the shadows of solids, grown by footprint and clearance.

All areas are sets of arm-axis positions. A footprint keeps its clearance at every heading where the axis
keeps ``clearance`` plus the footprint's largest distance from the axis, and at none where it does not keep
``clearance`` plus the smallest. The first gives inner areas, the second outer ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import STRtree
from shapely.geometry import MultiPoint, MultiPolygon, Point, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.planners.geometry.offsets import grown, shrunk
from regionik.worlds.obstacles import Shadow, Solid
from regionik.worlds.scene import World

GRID = 1e-11  # of corners where a union fails without one, far below the guard [m]
ON_AXIS = 1e-9  # distance at which a footprint is as good as on the arm axis [m]
GUARD = 1e-6  # margin of inner areas at every bound, against rounding [m]

FEW = 12  # vertices, up to which a shadow is left whole where the ground is cut
LARGE = 400  # vertices, from which on a shape is cut to what is looked at before it is worked on

EVERY = (-np.inf, np.inf)  # heading of the base

Geometries = NDArray[np.object_]


@dataclass(frozen=True, eq=False)
class Side:
    """Floor and rejected parts, inner or outer, within a span of headings; ready for bulk booleans."""

    floor: BaseGeometry  # of the axis, without obstacles
    parts: Geometries  # rejected, disjoint polygons
    span: tuple[float, float] = EVERY  # headings of the base [rad]

    @cached_property
    def tree(self) -> STRtree:
        return STRtree(self.parts)

    @cached_property
    def free(self) -> BaseGeometry:
        """Floor less the rejected parts."""
        return shapely.difference(self.floor, shapely.union_all(self.parts))

    @cached_property
    def pieces(self) -> Geometries:
        """Connected pieces of the free floor; none where it is empty."""
        pieces: Geometries = shapely.get_parts(self.free)
        pieces = pieces[~shapely.is_empty(pieces)]  # the parts of an empty polygon are itself
        shapely.prepare(pieces)
        return pieces

    def subtract(self, shapes: Geometries) -> Geometries:
        """Cut many shapes to the floor, and take the rejected parts from them."""
        left = shapes.copy()
        shapely.prepare(self.floor)
        cut = ~shapely.contains_properly(self.floor, left)
        left[cut] = shapely.intersection(left[cut], self.floor)
        which, part = self.tree.query(left, predicate="intersects")
        if not len(which):
            return left
        order = np.argsort(which, kind="stable")
        which, part = which[order], part[order]
        pieces, piece = shapely.get_parts(self._local(left, which, part), return_index=True)
        solid = shapely.get_type_id(pieces) == shapely.GeometryType.POLYGON
        pieces, which = pieces[solid], which[piece[solid]]
        rows, group = np.unique(which, return_inverse=True)
        # Disjoint pieces make a valid multipolygon as they are: no union is needed.
        left[rows] = shapely.difference(left[rows], shapely.multipolygons(pieces, indices=group))
        return left

    def _local(self, shapes: Geometries, which: NDArray[np.intp], part: NDArray[np.intp]) -> Geometries:
        """Parts that intersect shapes, large ones clipped to the shape's surroundings."""
        pieces: Geometries = self.parts[part]
        for k in np.flatnonzero(shapely.get_num_coordinates(self.parts)[part] > LARGE):
            x0, y0, x1, y1 = shapely.bounds(shapes[which[k]])
            pieces[k] = shapely.clip_by_rect(pieces[k], x0 - 0.1, y0 - 0.1, x1 + 0.1, y1 + 0.1)
        return pieces


@dataclass(frozen=True, eq=False)
class Ground:
    """Floor of a world and shadows of its solids, and what they leave of it."""

    floor: Polygon | MultiPolygon
    names: tuple[str, ...]
    shadows: tuple[Shadow, ...]
    clearance: float  # [m]
    far: float  # largest distance of the footprint's edge from the arm axis [m]
    near: float  # smallest one, below zero for an axis beside the footprint [m]

    @cached_property
    def inner(self) -> Side:
        floor = shrunk(self.floor, self.far + GUARD, outside=False)
        return Side(floor, self._taken(self.clearance + GUARD + self.far, inner=True))

    @cached_property
    def outer(self) -> Side:
        if self.near < 0:  # the axis may lie off the floor
            floor = grown(self.floor, -self.near, outside=True)
        else:
            floor = shrunk(self.floor, self.near, outside=True)
        return Side(floor, self._taken(self.clearance + self.near, inner=False))

    def _taken(self, by: float, *, inner: bool) -> Geometries:
        """Shadows grown by clearance and footprint: circumscribed for inner areas, else inscribed."""
        return disjoint(np.array([grow(shadow, by, inner) for shadow in self.shadows], dtype=object))

    def cut_to(self, region: BaseGeometry) -> Ground:
        """The ground cut to what matters to a footprint within a region: floor and shadows."""
        shadows, names = [], []
        for k in self.within(region, self.clearance):
            by = self.clearance + self.shadows[k].radius + GUARD
            core = self.shadows[k].core
            if shapely.get_num_coordinates(core) > FEW:
                core = shapely.intersection(core, shapely.buffer(region, by, join_style="mitre"))
            if not core.is_empty:
                shadows.append(replace(self.shadows[k], core=core))
                names.append(self.names[k])
        parts = shapely.get_parts(shapely.intersection(self.floor, region))
        floor = MultiPolygon([part for part in parts if part.area > 0])
        return replace(self, floor=floor, names=tuple(names), shadows=tuple(shadows))

    def grown_about(self, shape: BaseGeometry, clearance: float) -> list[tuple[str, BaseGeometry]]:
        """Shadows that reject some of an inner area at a clearance: names, and what of them is about it."""
        by = clearance + self.far + GUARD
        x0, y0, x1, y1 = shape.bounds
        found = []
        for k in self.within(shape, by):
            shadow = self.shadows[k]
            if shapely.get_num_coordinates(shadow.core) > LARGE:
                wide = 2 * (by + shadow.radius) + GUARD
                around = shapely.box(x0 - wide, y0 - wide, x1 + wide, y1 + wide)
                shadow = replace(shadow, core=shapely.intersection(shadow.core, around))
            found.append((self.names[k], grow(shadow, by, inner=True)))
        return found

    @cached_property
    def cores(self) -> STRtree:
        """Tree over the shadows' cores."""
        return STRtree([shadow.core for shadow in self.shadows])

    def within(self, shape: BaseGeometry, by: float) -> list[int]:
        """Shadows that may meet a shape once grown by ``by`` [m], in order."""
        widest = max((shadow.radius for shadow in self.shadows), default=0.0)
        found = self.cores.query(shape, predicate="dwithin", distance=(by + widest) * 1.01)
        return np.sort(found).tolist()

    def nearest(self, shape: BaseGeometry) -> tuple[str, float] | None:
        """Name and distance of the shadow nearest to a shape on the floor."""
        gaps = [shadow.distance(shape) for shadow in self.shadows]
        if not gaps:
            return None
        k = int(np.argmin(gaps))
        return self.names[k], gaps[k]


@lru_cache(maxsize=4096)
def shadow_of(solid: Solid, below: float) -> Shadow | None:
    """Shadow of a solid on the floor; cached."""
    return solid.shadow(below)


@lru_cache(maxsize=4096)
def grow(shadow: Shadow, by: float, inner: bool) -> BaseGeometry:
    """A shadow grown by a disc, as a polygon around it (``inner``) or within it; shrunk where less than 0."""
    far = shadow.radius + by
    return grown(shadow.core, far, outside=inner) if far >= 0 else shrunk(shadow.core, -far, outside=inner)


@lru_cache(maxsize=8)
def ground_of(world: World) -> Ground:
    """Ground of a world; cached."""
    robot = world.robot
    found = [(solid.name, shadow_of(solid, robot.body_height)) for solid in world.solids]
    met = [(name, shadow) for name, shadow in found if shadow is not None]
    corners = robot.footprint - robot.mount[:2]
    far = float(np.hypot(corners[:, 0], corners[:, 1]).max())
    outline, axis = MultiPoint(corners).convex_hull, Point(0, 0)
    within = len(corners) > 2 and outline.contains(axis)
    off = float(outline.distance(axis))
    near = float(outline.boundary.distance(axis)) if within else -off if off > ON_AXIS else 0.0
    return Ground(
        floor=world.drivable_floor,
        names=tuple(name for name, _ in met),
        shadows=tuple(shadow for _, shadow in met),
        clearance=world.base_clearance,
        far=far,
        near=near,
    )


def united(shapes: Geometries) -> BaseGeometry:
    """Union of shapes; a single one is itself, not a copy."""
    if len(shapes) == 1:
        one: BaseGeometry = shapes[0]
        return one
    try:
        return shapely.union_all(shapes)
    except shapely.GEOSException:  # slivers where many edges nearly meet
        return shapely.union_all(shapes, grid_size=GRID)


def disjoint(shapes: Geometries) -> Geometries:
    """Union as disjoint polygons."""
    parts: Geometries = shapely.get_parts(shapely.disjoint_subset_union_all(shapes))
    real: Geometries = parts[shapely.area(parts) > 0]
    return real
