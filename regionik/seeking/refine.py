"""One target looked at as closely as it takes: headings and pitches halved until there is an answer.

A cell is a range of headings of the base and of pitches of the tool. Outside its outer area no place works at
any of them; every place of its inner area works at some. The largest undecided cell is halved first.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.demand import in_plane
from regionik.areas.ground import EVERY, GUARD, ground_of
from regionik.areas.reachable import BACK, FRONT, Family, families_of, fine_reach
from regionik.areas.standing import span_of_rules
from regionik.planners.driving.heading_slabs import slab_free
from regionik.postures.poses import Pose
from regionik.worlds.arrays import Array
from regionik.worlds.obstacles import Shadow
from regionik.worlds.pivoted_arm import reach_bound
from regionik.worlds.planar_arm import planar_arm
from regionik.worlds.scene import Target, World

ARCS = 768  # vertices of a full circle
SIDES, MOST_SIDES = 48, 384  # of the polygons that stand for discs, in wide cells and in narrow ones
NARROW = 0.02  # [rad]
ENOUGH = 1e-4  # widest disc of undecided places below which a cell is halved no more [m]
NARROWEST = 1e-4  # cells that are halved no more [rad]
MOST_CELLS = 300
MOST_TRIES = 16  # inner areas in which a configuration is looked for

Span = tuple[float, float]
Attempt = Callable[[BaseGeometry, Family, Span], Pose | None]


class Refined(NamedTuple):
    """What looking closely came to.

    Attributes
    ----------
    found : Pose or None
    left : geometry
        Where neither a configuration was found nor ruled out; empty where there is proven to be none.
    tried : int
        Inner areas in which a configuration was looked for.
    """

    found: Pose | None
    left: BaseGeometry
    tried: int


class Cell(NamedTuple):
    """Headings of the base, and pitches of the tool where a direction is asked; no pitches where free."""

    heading: Span
    pitch: Span | None


def refine(world: World, target: Target, attempt: Attempt) -> Refined:
    """Halve cells until a configuration is found, or none can be, or too little is left to matter.

    Parameters
    ----------
    world : World
    target : Target
    attempt : callable
        Looks for a configuration in an inner area, given its family and its headings.
    """
    close = _Close(world, target)
    cells = [(-np.inf, 0, close.whole)]
    left: list[BaseGeometry] = []
    tried = count = 0
    for _ in range(MOST_CELLS):
        if not cells:
            break
        cell = heapq.heappop(cells)[2]
        outer = close.outer(cell)
        if outer.is_empty:
            continue
        for family, area in close.inner(cell) if tried < MOST_TRIES else ():
            tried += 1
            found = attempt(area, family, cell.heading)
            if found is not None:
                return Refined(found, Polygon(), tried)
        parts = close.halves(cell) if tried < MOST_TRIES and diameter(outer) > ENOUGH else []
        if not parts:
            left.append(outer)
        for part in parts:
            count += 1
            heapq.heappush(cells, (-outer.area, count, part))
    left += [close.outer(cell) for _, _, cell in cells]
    return Refined(None, shapely.union_all(left) if left else Polygon(), tried)


def diameter(area: BaseGeometry) -> float:
    """Diameter of the largest circle in an area, 0 where it is empty [m].

    Examples
    --------
    >>> round(diameter(shapely.box(0, 0, 3, 1)), 3)
    1.0
    """
    parts = [part for part in shapely.get_parts(area) if part.area > 0]
    return max((2 * float(shapely.maximum_inscribed_circle(part).length) for part in parts), default=0.0)


@dataclass(frozen=True, eq=False)
class _Close:
    """A target's surroundings, and the areas of its cells."""

    world: World
    target: Target

    @property
    def whole(self) -> Cell:
        heading = span_of_rules(self.world)
        if heading == EVERY and not self._turnless:
            heading = (-np.pi, np.pi)
        if self.target.direction is None or not in_plane(self.world.robot.chain, self.target):
            return Cell(heading, None)
        pitch = _pitch_of(self.target.direction)
        low, high = pitch - self.target.cone, pitch + self.target.cone
        return Cell(heading, (max(low, -np.pi / 2), min(high, np.pi / 2)))

    def outer(self, cell: Cell) -> BaseGeometry:
        """No place outside it works at any heading and pitch of the cell."""
        kinds = self._kinds(cell, inner=False)
        _, shapes = fine_reach(self.world, self.target, kinds, cell.heading, ARCS, inner=False)
        if not len(shapes):
            return Polygon()
        return shapely.intersection(shapely.union_all(shapes), self._free(cell.heading)[1])

    def inner(self, cell: Cell) -> Iterator[tuple[Family, BaseGeometry]]:
        """Areas of which every place works at all headings of the cell, the largest first."""
        free = self._free(cell.heading)[0]
        if free.is_empty:
            return
        kinds = self._kinds(cell, inner=True)
        families, shapes = fine_reach(self.world, self.target, kinds, cell.heading, ARCS, inner=True)
        areas = shapely.intersection(shapes, free)
        for k in np.argsort(-shapely.area(areas), kind="stable").tolist():
            if areas[k].area > 0:
                yield families[k], areas[k]

    def halves(self, cell: Cell) -> list[Cell]:
        """The cell cut across its wider side; nothing where neither side can be cut."""
        turn = 0.0 if cell.heading == EVERY else cell.heading[1] - cell.heading[0]
        tilt = 0.0
        if cell.pitch is not None and self.target.orientation is None:
            tilt = cell.pitch[1] - cell.pitch[0]
        if max(turn, tilt) < NARROWEST:
            return []
        if cell.pitch is not None and tilt > turn:
            return [Cell(cell.heading, half) for half in _halved(cell.pitch)]
        return [Cell(half, cell.pitch) for half in _halved(cell.heading)]

    def _kinds(self, cell: Cell, *, inner: bool) -> tuple[Family, ...]:
        target = self.target
        if cell.pitch is None or target.direction is None:
            return Family(FRONT), Family(BACK)
        if target.orientation is not None:
            arm = planar_arm(self.world.robot.chain)
            return families_of(arm, target, (FRONT, BACK), inner=inner)
        pitch = sum(cell.pitch) / 2
        low, high = (pitch, pitch) if inner else cell.pitch
        half = _widest_swing(_pitch_of(target.direction), target.cone, low, high) - (GUARD if inner else 0.0)
        if half <= 0:
            return ()
        azimuth = float(np.arctan2(target.direction[1], target.direction[0]))
        along = Family(FRONT, pitch, azimuth, half, (low, high))
        against = Family(FRONT, np.pi - pitch, azimuth + np.pi, half, (np.pi - high, np.pi - low))
        return tuple(replace(kind, facing=facing) for facing in (FRONT, BACK) for kind in (along, against))

    @cached_property
    def _turnless(self) -> bool:
        """Whether the base is a point that the arm stands on."""
        return not self._outline.any()

    @cached_property
    def _outline(self) -> Array:
        outline: Array = self.world.robot.footprint - self.world.robot.mount[:2]
        return outline

    @cached_property
    def _near(self) -> tuple[BaseGeometry, list[Shadow]]:
        """Floor and shadows that matter to places within reach."""
        ground, span = ground_of(self.world), reach_bound(self.world.robot.chain)
        x, y, by = *self.target.position[:2], span.radius + span.length + 2 * ground.far + GUARD
        box = shapely.box(x - by, y - by, x + by, y + by)
        floor = shapely.intersection(ground.floor, box)
        parts = [part for part in shapely.get_parts(floor) if part.area > 0]
        near = ground.within(box, ground.clearance)
        return MultiPolygon(parts), [ground.shadows[k] for k in near]

    def _free(self, heading: Span) -> tuple[BaseGeometry, BaseGeometry]:
        """Where the axis may stand at all headings of a range, from within, and at some, from outside."""
        if heading not in self._known:
            floor, shadows = self._near
            low, high = (0.0, 0.0) if heading == EVERY else heading
            if floor.is_empty:
                self._known[heading] = Polygon(), Polygon()
            else:
                clearance = ground_of(self.world).clearance
                sides = SIDES if high - low > NARROW else MOST_SIDES
                slab = slab_free(self._outline, floor, shadows, clearance, low, high, sides)
                inner = shapely.buffer(slab.inner, -2 * GUARD, join_style="mitre")
                self._known[heading] = inner, slab.outer
        return self._known[heading]

    @cached_property
    def _known(self) -> dict[Span, tuple[BaseGeometry, BaseGeometry]]:
        return {}


def _halved(span: Span) -> tuple[Span, Span]:
    middle = (span[0] + span[1]) / 2
    return (span[0], middle), (middle, span[1])


def _pitch_of(direction: Array) -> float:
    return float(np.arctan2(direction[2], np.hypot(direction[0], direction[1])))


def _widest_swing(pitch: float, cone: float, low: float, high: float) -> float:
    """Farthest that the plane may turn from a direction's azimuth at pitches of a range [rad].

    A direction at pitch p and swing s is within the cone where sin p sin pitch + cos p cos pitch cos s is no
    less than cos cone; below 0 where no pitch of the range is within the cone.
    """
    looked = [low, high]
    if abs(np.sin(pitch)) < abs(np.cos(cone)):  # else the cone holds the vertical
        looked.append(float(np.arcsin(np.sin(pitch) / np.cos(cone))))
    widest = -1.0
    for p in looked:
        if low <= p <= high:
            level, left = np.cos(p) * np.cos(pitch), np.cos(cone) - np.sin(p) * np.sin(pitch)
            if left <= -level:
                return np.pi
            if left <= level:
                widest = max(widest, float(np.arccos(left / level)))
    return widest
