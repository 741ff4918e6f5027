"""Free space of the base: where it may stand, by heading.

Areas that hold at every heading need room for the circle around the footprint. Where that is too much, a full
turn is divided into slabs of heading: within a slab the footprint needs room for its turns in it alone. The
base goes from one slab to the next where it may stand in both.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import EVERY, Ground, Side, united
from regionik.areas.layers import ROUNDING_MARGIN, BodyLayer, Geometries, disjoint
from regionik.areas.options import AREAS
from regionik.planners.driving.footprint import fits
from regionik.planners.driving.footprint_scene import FootprintScene, footprint_scene
from regionik.planners.driving.heading_slabs import (
    free_at_some,
    outline_scene,
    slab_areas,
    slab_rejections,
    slabs_along,
)
from regionik.planners.geometry.offsets import grown
from regionik.postures.families import Family
from regionik.worlds.arrays import Array
from regionik.worlds.joints import nearest_turn
from regionik.worlds.robot import Robot
from regionik.worlds.scene import World

MIN_AREA = 1e-8  # smaller areas are none, and areas that share less do not overlap [m2]

Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


class Pieces(NamedTuple):
    """Connected parts of the free floor of every side."""

    polygon: Geometries  # (n,)
    side: Index  # (n,)
    label: Index  # (n,) the same for parts that driving and turning connect


@dataclass(frozen=True, eq=False)
class PathAreas:
    """Admissible inner areas of many targets, one row for each target, side, family and reach interval."""

    target: Index  # (m,) ascending
    family: tuple[Family, ...]
    side: Index  # (m,) of the free space
    inner: Geometries  # (m,)

    def sorted_by(self, target: Index) -> PathAreas:
        """Return the rows in the order of other numbers of their targets, (m,)."""
        by = np.argsort(target, kind="stable")
        family = tuple(self.family[k] for k in by.tolist())
        return PathAreas(target[by], family, self.side[by], self.inner[by])


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Free floor of the base: one side for every heading, or one a slab round the full turn, or both.

    Of both, the side for every heading comes first. ``drives`` joins pieces that sides do not: pairs of parts
    of the floor between which a drive is known.
    """

    sides: tuple[Side, ...]
    drives: tuple[tuple[int, int], ...] = ()

    @cached_property
    def spans(self) -> Array:
        """Lowest and highest heading of each side, (n, 2) [rad]."""
        return np.array([side.span for side in self.sides])

    @cached_property
    def pieces(self) -> Pieces:
        """Pieces of the whole free floor."""
        found = [side.pieces for side in self.sides]
        side = np.repeat(np.arange(len(found)), [len(part) for part in found])
        polygon: Geometries = np.concatenate(found)
        if len(found) == 1:  # pieces of one side are apart
            return Pieces(polygon, side, np.arange(len(polygon)))
        pairs = shapely.STRtree(polygon).query(polygon, predicate="intersects")
        a, b = pairs[:, self.beside(*side[pairs])]
        real = shapely.area(shapely.intersection(polygon[a], polygon[b])) > MIN_AREA
        joined = np.vstack([np.column_stack([a[real], b[real]]), *(np.array([pair]) for pair in self.drives)])
        return Pieces(polygon, side, component_labels(len(polygon), joined))

    @cached_property
    def somewhere(self) -> Side:
        """Floor that is free at some heading of the sides, as one side."""
        return Side(
            united(np.array([side.free for side in self.sides], dtype=object)), np.empty(0, dtype=object)
        )

    def with_drive(self, a: int, b: int) -> FreeSpace:
        """Return the free space with the pieces of two labels as one."""
        first = [int(np.flatnonzero(self.pieces.label == label)[0]) for label in (a, b)]
        return replace(self, drives=(*self.drives, (first[0], first[1])))

    def whole(self, label: int) -> Geometries:
        """Return all parts with one label."""
        parts: Geometries = self.pieces.polygon[self.pieces.label == label]
        return parts

    def beside(self, a: Index, b: Index) -> Mask:
        """Mask of the pairs of sides that are the same, or neighbours in heading."""
        every, apart = int(self.sides[0].span == EVERY), np.abs(a - b)
        near: Mask = (apart <= 1) | (apart == len(self.sides) - every - 1)
        return near | (np.minimum(a, b) < every)

    def piece_at(self, axis: Array, yaw: float) -> int | None:
        """Return the label of the piece nearest to a pose; None where there is no floor at all."""
        polygons, side, label = self.pieces
        if not len(polygons):
            return None
        off = np.array([away(yaw, self.sides[s].span) for s in side.tolist()])
        gaps = shapely.distance(polygons, Point(axis)) + off
        return int(label[int(np.argmin(gaps))])


def away(yaw: float, span: tuple[float, float]) -> float:
    """Angle from a heading to a span of headings, the shorter way [rad].

    Examples
    --------
    >>> round(away(6.0, (-0.1, 0.1)), 4), away(6.2, (-0.1, 0.1))
    (0.1832, 0.0)
    """
    return abs(into_span(yaw, span) - yaw)


def into_span(yaw: float, span: tuple[float, float]) -> float:
    """The heading within a span that is nearest to a heading, the shorter way round from it [rad]."""
    return float(into_spans(np.array(yaw), *span))


def into_spans(yaw: Array, low: float | Array, high: float | Array) -> Array:
    """Headings (n,) each as `into_span` has it, within one span or within n of them [rad]."""
    every = np.subtract(high, low) >= 2 * np.pi
    low, high = np.where(every, -np.pi, low), np.where(every, np.pi, high)  # `EVERY` has no middle
    middle, half = (low + high) / 2, (high - low) / 2
    off = nearest_turn(yaw - middle)
    over: Array = off - np.clip(off, -half, half)
    return np.where(every, yaw, yaw - over)


def component_labels(count: int, pairs: Index) -> Index:
    """Connected components of a graph of ``count`` nodes: the label of each, (count,)."""
    ones = np.ones(len(pairs), dtype=bool)
    graph = coo_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    label: Index = connected_components(graph, directed=False)[1].astype(np.intp)
    return label


@dataclass(frozen=True, eq=False)
class FreeFloor:
    """Free floor of a base at the headings that rules allow, divided by heading as stages ask."""

    ground: Ground
    headings: tuple[float, float]  # that the rules allow, `EVERY` or one [rad]

    @property
    def turns_matter(self) -> bool:
        """True where the free floor depends on the heading."""
        return self.headings == EVERY and not self.ground.is_round

    @cached_property
    def anywhere(self) -> FreeSpace:
        """One side: for every heading, or for the one that the rules fix."""
        ground = self.ground
        if self.headings != EVERY and not ground.is_round:
            return FreeSpace(_slab_sides(ground.floor, ground.base, ground.around, np.array([self.headings])))
        return FreeSpace((Side(ground.inner.floor, ground.inner.parts, self.headings),))

    @cached_property
    def by_heading(self) -> FreeSpace:
        """One side a slab of headings; `anywhere` where slabs make no difference."""
        if not self.turns_matter:
            return self.anywhere
        return _inner_slabs(self.ground.floor, self.ground.base, self.ground.around)

    @cached_property
    def turning(self) -> FreeSpace:
        """A side for every heading and one a slab; `anywhere` where slabs make no difference.

        Within a slab an arm without a pivot reaches next to nothing: it works where the base turns as it
        likes, and the base drives by slabs from one such place to the next.
        """
        if not self.turns_matter:
            return self.anywhere
        return FreeSpace((*self.anywhere.sides, *self.by_heading.sides))

    @cached_property
    def outer(self) -> FreeSpace:
        """Outer free floor by slab: no place outside a side is free at any heading of its slab."""
        ground = self.ground
        if not self.turns_matter:
            return FreeSpace((Side(ground.outer.floor, ground.outer.parts, self.headings),))
        return _outer_slabs(ground.floor, ground.base, ground.inside)


def headings_of(world: World) -> tuple[float, float]:
    """Headings that the rules allow [rad]."""
    if world.rules.heading != "fixed":
        return EVERY
    yaw = 0.0 if world.start is None else float(world.start.base[2])
    return yaw, yaw


def footprint_on(ground: Ground, robot: Robot, outline: Array | None = None) -> FootprintScene:
    """Outlines of a base in its frame and all they must keep clear of, with a margin against rounding.

    The footprint's outline may be another, (n, 2).
    """
    outline = robot.footprint if outline is None else outline
    return footprint_scene(
        outline,
        ground.floor,
        ground.shadows,
        ground.clearance + ROUNDING_MARGIN,
        ground.upper(robot.mount[:2]),
    )


def stands_about(ground: Ground, robot: Robot, base: Array, by: float) -> bool:
    """True if the base may stand, at its heading, at all places within a distance of a pose (3,) [m]."""
    outline = robot.footprint
    if by > 0:  # of a point, too
        whole = grown(shapely.convex_hull(shapely.multipoints(outline)), by, outside=True)
        outline = shapely.get_coordinates(shapely.convex_hull(whole).exterior)[:-1]
    scene = footprint_on(ground, robot, outline)
    upper = scene.upper._replace(clearance=scene.upper.clearance + by)
    return bool(fits(scene._replace(upper=upper), *base.tolist()))


@lru_cache(maxsize=8)
def _inner_slabs(floor: Polygon, base: BodyLayer, around: tuple[BodyLayer, ...]) -> FreeSpace:
    """Cached by its inputs: worlds that differ in task or height of the mount share it."""
    return FreeSpace(_slab_sides(floor, base, around, _bounds(floor, base, around)))


@lru_cache(maxsize=8)
def _outer_slabs(floor: Polygon, base: BodyLayer, inside: tuple[BodyLayer, ...]) -> FreeSpace:
    bounds = _bounds(floor, base, inside)
    areas = slab_areas(np.array(base.outline.corners), floor, base.shadows, base.clearance, bounds)
    none = np.empty(0, dtype=object)
    scenes = [outline_scene(layer.outline, floor) for layer in inside]
    sides = []
    for area in areas:
        free = area.outer
        for scene in scenes:
            free &= free_at_some(scene, area.low, area.high)
        sides.append(Side(free, none, (area.low, area.high)))
    return FreeSpace(tuple(sides))


def _slab_sides(
    floor: Polygon, base: BodyLayer, around: tuple[BodyLayer, ...], bounds: Array
) -> tuple[Side, ...]:
    upper = [layer.moved(np.zeros(2), ROUNDING_MARGIN) for layer in around]
    corners, keep = np.array(base.outline.corners), base.clearance + ROUNDING_MARGIN
    found = slab_rejections(corners, floor, base.shadows, keep, bounds, upper)
    spans = [(low, high) for low, high in bounds.tolist()]
    return tuple(Side(one.floor, disjoint(one.taken), span) for one, span in zip(found, spans, strict=True))


def _bounds(floor: Polygon, base: BodyLayer, upper: tuple[BodyLayer, ...]) -> Array:
    """Headings of the slabs, those with a side of an outline along a wall among them."""
    corners = np.array(base.outline.corners)
    scene = footprint_scene(corners, floor, base.shadows, base.clearance, [layer.outline for layer in upper])
    return slabs_along(scene, AREAS.heading_slabs, AREAS.max_wall_directions)


def spread(area: BaseGeometry, count: int, seed: int) -> Array:
    """Points (n, 2) spread evenly over a polygon, at most ``count`` of them and at least one."""
    from scipy.stats import qmc  # takes long to load

    x0, y0, x1, y1 = area.bounds
    share = area.area / max((x1 - x0) * (y1 - y0), 1e-12)
    draws = int(np.ceil(count / max(share, 0.02)))
    unit = qmc.Halton(2, scramble=True, rng=np.random.default_rng(seed)).random(draws)
    points = unit * (x1 - x0, y1 - y0) + (x0, y0)
    inside = points[shapely.contains_xy(area, points)][:count]
    middle: Point = area.representative_point()
    return inside if len(inside) else np.array([[middle.x, middle.y]])
