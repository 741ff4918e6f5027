"""Layers of the base: an outline at some heights, and the shadows of what it could hit there.

The footprint is the first, up to the body's height and with the base's clearance. What stands above it
(`regionik.worlds.body`) has layers of its own, with the arm's clearance; only those are kept that may reject
more than the footprint does.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import STRtree
from shapely.geometry import MultiPoint, Point
from shapely.geometry.base import BaseGeometry

from regionik.areas.options import AREAS
from regionik.planners.driving.footprint_scene import Outline
from regionik.planners.geometry.offsets import grown, shrunk
from regionik.worlds.arrays import Array
from regionik.worlds.body import (
    BodyPrism,
    Corners,
    fixed_prisms,
    lift_range,
    lifted_prisms,
    pivot_discs,
)
from regionik.worlds.obstacles import Box, Cylinder, Prism, Solid
from regionik.worlds.scene import World
from regionik.worlds.self_collision import base_name
from regionik.worlds.shadows import Shadow

ON_AXIS = 1e-9  # distance at which a footprint is as good as on the arm axis [m]
ROUNDING_MARGIN = 1e-6  # margin of inner areas at every bound, against rounding [m]


Geometries = NDArray[np.object_]


@dataclass(frozen=True)
class BodyLayer:
    """A convex outline of the base at some heights, and the shadows of solids at these heights.

    Attributes
    ----------
    part : str
        Name of the robot's solid that the outline is of.
    outline : Outline
        About the arm axis, in the base's directions [m].
    names : tuple of str
        Of the solids whose shadows the outline keeps clear of.
    own : frozenset of str
        Names of those that ask for a clearance of their own.
    """

    part: str
    outline: Outline
    names: tuple[str, ...]
    own: frozenset[str] = frozenset()

    @property
    def shadows(self) -> tuple[Shadow, ...]:
        return self.outline.shadows

    @property
    def clearance(self) -> float:
        """That is kept from each shadow, but for what it asks for beyond it [m]."""
        return self.outline.clearance

    @property
    def keeps(self) -> list[float]:
        """Clearance from each shadow [m]."""
        return [self.clearance + shadow.more for shadow in self.shadows]

    @cached_property
    def far(self) -> float:
        """Largest distance of the outline's edge from the arm axis [m]."""
        return float(np.hypot(*np.array(self.outline.corners).T).max())

    @cached_property
    def near(self) -> float:
        """Smallest distance of the outline's edge from the arm axis, below zero for an axis beside it [m]."""
        shape, axis = MultiPoint(self.outline.corners).convex_hull, Point(0, 0)
        if len(self.outline.corners) > 2 and shape.contains(axis):
            return float(shape.boundary.distance(axis))
        off = float(shape.distance(axis))
        return -off if off > ON_AXIS else 0.0

    def taken(self, *, inner: bool) -> list[BaseGeometry]:
        """Shadows grown by clearance and outline: circumscribed for inner areas, else inscribed."""
        by = self.clearance + (ROUNDING_MARGIN + self.far if inner else self.near)
        return [grow(shadow, by, inner) for shadow in self.shadows]

    def grown_about(self, shape: BaseGeometry, clearance: float) -> list[tuple[str, BaseGeometry]]:
        """Shadows that reject some of an inner area at a clearance: names, and what of them is about it.

        Solids that ask for a clearance of their own keep that.
        """
        x0, y0, x1, y1 = shape.bounds
        found = []
        most = max(clearance, self.clearance) if self.own else clearance
        for k in self.within(shape, most + self.far + ROUNDING_MARGIN):
            shadow, keep = self.shadows[k], self.clearance if self.names[k] in self.own else clearance
            by = keep + self.far + ROUNDING_MARGIN
            if shapely.get_num_coordinates(shadow.core) > AREAS.min_cut_vertices:
                wide = 2 * (by + shadow.kept) + ROUNDING_MARGIN
                around = shapely.box(x0 - wide, y0 - wide, x1 + wide, y1 + wide)
                shadow = replace(shadow, core=shapely.intersection(shadow.core, around))
            found.append((self.names[k], grow(shadow, by, inner=True)))
        return found

    def cut_to(self, region: BaseGeometry) -> BodyLayer:
        """Return the layer cut to what matters to an outline within a region."""
        shadows, names = [], []
        for k in self.within(region, self.clearance):
            by = self.clearance + self.shadows[k].kept + ROUNDING_MARGIN
            core = self.shadows[k].core
            if shapely.get_num_coordinates(core) > AREAS.max_whole_vertices:
                core = shapely.intersection(core, shapely.buffer(region, by, join_style="mitre"))
            if not core.is_empty:
                shadows.append(replace(self.shadows[k], core=core))
                names.append(self.names[k])
        return replace(self, outline=replace(self.outline, shadows=tuple(shadows)), names=tuple(names))

    def keeping(self, which: Sequence[int]) -> BodyLayer:
        """Return the layer with some of its shadows."""
        shadows = tuple(self.shadows[k] for k in which)
        names = tuple(self.names[k] for k in which)
        return replace(self, outline=replace(self.outline, shadows=shadows), names=names)

    @cached_property
    def cores(self) -> STRtree:
        """Tree over the shadows' cores."""
        return STRtree([shadow.core for shadow in self.shadows])

    def within(self, shape: BaseGeometry, by: float) -> list[int]:
        """Shadows that may meet a shape once grown by ``by`` [m], in order."""
        widest = max((shadow.kept for shadow in self.shadows), default=0.0)
        found = self.cores.query(shape, predicate="dwithin", distance=(by + widest) * 1.01)
        return np.sort(found).tolist()

    def moved(self, offset: Array, margin: float = 0.0) -> Outline:
        """Return the outline about a point, (2,) from there to the arm axis, with so much more kept [m]."""
        corners = np.array(self.outline.corners) + offset
        return replace(self.outline, corners=as_corners(corners), clearance=self.clearance + margin)


def footprint_layer(world: World) -> BodyLayer:
    """Return the layer of the footprint."""
    robot = world.robot
    found = [(solid, shadow_of(solid, robot.body_height, 0.0)) for solid in world.solids]
    met = [(solid, shadow) for solid, shadow in found if shadow is not None]
    own = frozenset(solid.name for solid, _ in met if solid.clearance is not None)
    corners = as_corners(robot.footprint - robot.mount[:2])
    shadows = tuple(_with_own_clearance(shadow, solid, world) for solid, shadow in met)
    outline = Outline(corners, shadows, world.base_clearance)
    return BodyLayer(base_name(robot), outline, tuple(solid.name for solid, _ in met), own)


def _with_own_clearance(shadow: Shadow, solid: Solid, world: World) -> Shadow:
    """Return the shadow of a solid with what the base keeps from that beyond the rules' clearance."""
    if solid.clearance is None:
        return shadow
    return replace(shadow, more=solid.clearance - world.rules.clearance)


def upper_layers(world: World, footprint: BodyLayer, *, inside: bool) -> tuple[BodyLayer, ...]:
    """Return the layers of what is fixed to the base: around it, or ``inside`` it for what surely rejects.

    What a pivot's link takes up in every posture, and what lifts carry at each height, is among both.
    """
    robot = world.robot
    fixed = layers_of(world, fixed_prisms(robot, inside=inside), footprint, inside=inside)
    always = (*pivot_discs(robot), *lifted_prisms(robot, lift_range(robot), inside=True))
    return *fixed, *layers_of(world, always, footprint, inside=True)


def layers_of(
    world: World, prisms: Iterable[BodyPrism], footprint: BodyLayer, *, inside: bool
) -> tuple[BodyLayer, ...]:
    """Return layers of prisms, but for those whose shadows the footprint's cover."""
    keep = 0.0 if inside else world.arm_clearance  # above and below, too, what is to be clear is around
    found = []
    for prism in prisms:
        corners = as_corners(np.array(prism.outline) - world.robot.mount[:2])
        met = [
            (solid.name, shadow)
            for solid in _beyond_footprint(world, corners, footprint)
            if (shadow := shadow_of(solid, prism.high + keep, prism.low - keep)) is not None
        ]
        if met:
            names, shadows = zip(*met, strict=True)
            found.append(BodyLayer(prism.part, Outline(corners, shadows, world.arm_clearance), names))
    return _without_repeats(found)


def _beyond_footprint(world: World, corners: Corners, footprint: BodyLayer) -> Iterator[Solid]:
    """Yield the solids that may reject an outline where they do not reject the footprint."""
    covered = {
        asked: _is_covered(corners, world.arm_clearance - asked, footprint)
        for asked in set(map(world.base_clearance_from, world.solids))
    }
    for solid in world.solids:
        asked = world.base_clearance_from(solid)
        if not (covered[asked] and _stands_upright(solid, world.robot.body_height)):
            yield solid


def _without_repeats(layers: Sequence[BodyLayer]) -> tuple[BodyLayer, ...]:
    """Return layers without the shadows that a wider one has as well, which rejects more by each."""
    shapes = [shapely.convex_hull(shapely.multipoints(layer.outline.corners)) for layer in layers]
    kept: list[tuple[BaseGeometry, BodyLayer]] = []
    for k in sorted(range(len(layers)), key=lambda k: -shapes[k].area):
        wider = {one for shape, other in kept if shape.covers(shapes[k]) for one in other.shadows}
        layer = layers[k].keeping([n for n, one in enumerate(layers[k].shadows) if one not in wider])
        kept += [(shapes[k], layer)] if layer.shadows else []
    return tuple(layer for _, layer in kept)


def _is_covered(corners: Corners, more: float, footprint: BodyLayer) -> bool:
    """True if an outline grown by so much ``more`` than the footprint lies within that."""
    shape = shapely.convex_hull(shapely.multipoints(footprint.outline.corners))
    room = grown(shape, -more, outside=False) if more < 0 else shrunk(shape, more, outside=False)
    return bool(room.covers(MultiPoint(corners)))


def _stands_upright(solid: Solid, height: float) -> bool:
    """True if the footprint's layer has all of a solid's shadow, as it is the same at each height."""
    low, high = solid.z_range
    return isinstance(solid, Box | Cylinder | Prism) and low < height and high > 0


def as_corners(points: Array) -> Corners:
    """Return points (n, 2) as tuples, which can be compared."""
    return tuple((x, y) for x, y in points.tolist())


@lru_cache(maxsize=4096)
def shadow_of(solid: Solid, below: float, above: float) -> Shadow | None:
    """Shadow of a solid on the floor between two heights; cached."""
    return solid.shadow(below, above)


@lru_cache(maxsize=4096)
def grow(shadow: Shadow, by: float, inner: bool) -> BaseGeometry:
    """A shadow grown by a disc, as a polygon around it (``inner``) or within it; shrunk where less than 0."""
    far = shadow.kept + by
    return grown(shadow.core, far, outside=inner) if far >= 0 else shrunk(shadow.core, -far, outside=inner)


def all_taken(layers: Sequence[BodyLayer], *, inner: bool) -> Geometries:
    """Union of what layers reject, as disjoint polygons."""
    return disjoint(np.array([one for layer in layers for one in layer.taken(inner=inner)], dtype=object))


def surely_taken(layers: Iterable[BodyLayer], name: str) -> tuple[tuple[Shadow, float], ...]:
    """Return a solid's shadows, and how far to grow each for what it rejects at every heading [m]."""
    return tuple(
        (shadow, layer.clearance + layer.near)
        for layer in layers
        for one, shadow in zip(layer.names, layer.shadows, strict=True)
        if one == name
    )


def disjoint(shapes: Geometries) -> Geometries:
    """Union as disjoint polygons."""
    parts: Geometries = shapely.get_parts(shapely.disjoint_subset_union_all(shapes))
    real: Geometries = parts[shapely.area(parts) > 0]
    return real
