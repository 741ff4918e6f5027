"""Free floor of the arm axis: the floor less the shadows of solids, grown by the base and its clearance.

All areas are sets of arm-axis positions. An outline of the base (`regionik.areas.layers`) keeps its clearance
at every heading where the axis keeps ``clearance`` plus the outline's largest distance from the axis, and at
none where it does not keep ``clearance`` plus the smallest. The first gives inner areas, the second outer
ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import STRtree
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.layers import (
    ROUNDING_MARGIN,
    BodyLayer,
    Geometries,
    all_taken,
    footprint_layer,
    upper_layers,
)
from regionik.areas.options import AREAS
from regionik.planners.driving.footprint_scene import Outline
from regionik.planners.geometry.offsets import grown, shrunk
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World
from regionik.worlds.shadows import Shadow

UNION_GRID = 1e-11  # of corners where a union fails without one, far below the margin against rounding [m]
EVERY = (-np.inf, np.inf)  # heading of the base


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
        return shapely.difference(self.floor, shapely.multipolygons(self.parts))

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
        large = np.flatnonzero(shapely.get_num_coordinates(self.parts)[part] > AREAS.min_cut_vertices)
        around = shapely.bounds(shapes[which[large]]) + [-0.1, -0.1, 0.1, 0.1]
        for k, bounds in zip(large.tolist(), around.tolist(), strict=True):
            pieces[k] = shapely.clip_by_rect(pieces[k], *bounds)
        return pieces


class Nearest(NamedTuple):
    """A solid near to the base, the distance between their shadows and what the base has to keep [m]."""

    name: str
    gap: float
    clearance: float


@dataclass(frozen=True, eq=False)
class Ground:
    """Floor of a world and layers of its base, and what they leave of it."""

    floor: Polygon | MultiPolygon
    base: BodyLayer  # of the footprint
    around: tuple[BodyLayer, ...] = ()  # of what stands above it, from outside
    inside: tuple[BodyLayer, ...] = ()  # from within

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the solids that the footprint could hit."""
        return self.base.names

    @property
    def shadows(self) -> tuple[Shadow, ...]:
        """Shadows of these solids."""
        return self.base.shadows

    @property
    def clearance(self) -> float:
        """That the footprint keeps from each shadow, but for what that asks for beyond it [m]."""
        return self.base.clearance

    @property
    def far(self) -> float:
        """Largest distance of the footprint's edge from the arm axis [m]."""
        return self.base.far

    @property
    def near(self) -> float:
        """Smallest distance of its edge from the arm axis, below zero for an axis beside it [m]."""
        return self.base.near

    @property
    def is_round(self) -> bool:
        """True where headings make next to no difference to what the base could hit."""
        return all(layer.far - layer.near < AREAS.max_round_deviation for layer in (self.base, *self.around))

    @property
    def within(self) -> tuple[BodyLayer, ...]:
        """Layers of what surely rejects: the footprint, and what stands above it from within."""
        return self.base, *self.inside

    @cached_property
    def inner(self) -> Side:
        floor = shrunk(self.floor, self.far + ROUNDING_MARGIN, outside=False)
        return Side(floor, all_taken((self.base, *self.around), inner=True))

    @cached_property
    def outer(self) -> Side:
        if self.near < 0:  # the axis may lie off the floor
            floor = grown(self.floor, -self.near, outside=True)
        else:
            floor = shrunk(self.floor, self.near, outside=True)
        return Side(floor, all_taken(self.within, inner=False))

    def cut_to(self, region: BaseGeometry) -> Ground:
        """The ground cut to what matters to a base within a region: floor and shadows."""
        parts = shapely.get_parts(shapely.intersection(self.floor, region))
        floor = MultiPolygon([part for part in parts if part.area > 0])
        around, inside = (
            tuple(cut for layer in layers if (cut := layer.cut_to(region)).names)
            for layers in (self.around, self.inside)
        )
        return Ground(floor, self.base.cut_to(region), around, inside)

    def rejections(self, shape: BaseGeometry, clearance: float) -> list[tuple[str, str, BaseGeometry]]:
        """What rejects some of an inner area at a clearance: solid, part of the robot, and where."""
        keep = {self.base: clearance, **{layer: layer.clearance for layer in self.around}}
        return [
            (name, layer.part, taken)
            for layer, distance in keep.items()
            for name, taken in layer.grown_about(shape, distance)
        ]

    def upper(self, offset: Array, margin: float = ROUNDING_MARGIN) -> list[Outline]:
        """Outlines above the footprint about another point, (2,) from there to the arm axis [m]."""
        return [layer.moved(offset, margin) for layer in self.around]

    def nearest(self, shape: BaseGeometry) -> Nearest | None:
        """The shadow nearest to a shape on the floor, by what is left of its clearance."""
        found = [
            Nearest(name, shadow.distance(shape), keep)
            for name, shadow, keep in zip(self.names, self.shadows, self.base.keeps, strict=True)
        ]
        return min(found, key=lambda one: one.gap - one.clearance, default=None)


def ground_from(world: World) -> Ground:
    """Return the ground of a world."""
    base = footprint_layer(world)
    around, inside = (upper_layers(world, base, inside=inside) for inside in (False, True))
    return Ground(world.drivable_floor, base, around, inside)


def united(shapes: Geometries) -> BaseGeometry:
    """Union of shapes; a single one is itself, not a copy."""
    if len(shapes) == 1:
        one: BaseGeometry = shapes[0]
        return one
    try:
        return shapely.union_all(shapes)
    except shapely.GEOSException:  # slivers where many edges nearly meet
        return shapely.union_all(shapes, grid_size=UNION_GRID)
