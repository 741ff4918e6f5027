"""Refinement of one target's areas, by bisection of the headings of the base and the pitches of the tool.

A cell is a range of headings and of pitches. Its outer area holds all places that may work at any of them,
its inner area places that work at some. The cell with the largest outer area is bisected first.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import EVERY
from regionik.areas.layers import ROUNDING_MARGIN
from regionik.areas.reach_model import FineReachTable, ReachModel
from regionik.areas.reachable import reach_model
from regionik.planners.driving.heading_slabs import ConvexScene, convex_scene, free_at_all, free_at_some
from regionik.planners.search.box_search import NO_SIDE, Verdict, begin, explore, left_open, verdict_of
from regionik.postures.arm import goal_of
from regionik.postures.families import BACK, FRONT, Family, families_along
from regionik.postures.poses import Pose
from regionik.reach_table import fine_reach
from regionik.reachability.options import REACHABILITY
from regionik.reachability.target_search import TargetSearch
from regionik.regions import reach_of, round_outer_areas
from regionik.scene import Scene
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target

OPTIONS = REACHABILITY.refinement


Span = tuple[float, float]
KnownArea = tuple[Family, BaseGeometry]


class Refinement(NamedTuple):
    """Outcome of the finer areas of a target."""

    pose: Pose | None
    left: BaseGeometry  # places neither found to work nor ruled out; empty where there is proven to be none
    tried: int  # inner areas searched for a configuration


class HeadingCell(NamedTuple):
    """Headings of the base, and pitches of the tool where a direction is asked."""

    heading: Span
    pitch: Span | None


def refine(search: TargetSearch, likely: Sequence[KnownArea] = ()) -> Refinement:
    """Bisect cells until a configuration is found, or is ruled out, or only small areas are left.

    Inner areas are searched, first those that are ``likely``, coarse ones at all headings. Once the search is
    exhausted no cell is looked at closer, as where there is an inner area there is no proof.
    """
    close = _CloseAreas(search, tuple(likely))
    heading, pitch = close.whole
    boxes = begin(_judge, close, *_boxes([heading], pitch))
    if np.pi < heading[1] - heading[0] < np.inf and verdict_of(boxes) == Verdict.OPEN:
        ends = np.linspace(*heading, OPTIONS.first_cells + 1).tolist()
        boxes = begin(_judge, close, *_boxes(list(zip(ends[:-1], ends[1:], strict=True)), pitch))
    boxes = explore(_judge, close, boxes, OPTIONS.max_cells, 1)
    if close.pose is not None:
        return Refinement(close.pose, Polygon(), close.tried)
    cells = [close.cell(boxes.low[slot], boxes.high[slot]) for slot in left_open(boxes).tolist()]
    left: BaseGeometry = shapely.union_all([close.outer(cell) for cell in cells])
    return Refinement(None, left if close.has_inner or left.is_empty else left & close.reach, close.tried)


def _boxes(headings: Sequence[Span], pitch: Span) -> tuple[Array, Array]:
    """Low and high ends of cells, each (k, 2)."""
    low, high = np.moveaxis(np.array([(heading, pitch) for heading in headings]), 2, 0)
    return low.copy(), high.copy()


def _judge(close: _CloseAreas, low: Array, high: Array) -> tuple[Verdict, float, int]:
    """Judge a cell of headings and pitches; its key is the area that is open."""
    cell = close.cell(low, high)
    outer = close.outer(cell)
    if outer.is_empty:
        return Verdict.RULED_OUT, 0.0, NO_SIDE
    if close.attempts(cell):
        return Verdict.PROVEN, outer.area, NO_SIDE
    settled = close.is_exhausted or diameter(outer) <= OPTIONS.min_disc or close.stays_open(cell)
    return Verdict.OPEN, outer.area, NO_SIDE if settled else close.widest_side(cell)


def diameter(area: BaseGeometry) -> float:
    """Diameter of the largest circle in an area, 0 where it is empty [m].

    Examples
    --------
    >>> round(diameter(shapely.box(0, 0, 3, 1)), 3)
    1.0
    """
    parts = [part for part in shapely.get_parts(area) if part.area > 0]
    return max((2 * float(shapely.maximum_inscribed_circle(part).length) for part in parts), default=0.0)


@dataclass(eq=False)
class _CloseAreas:
    """Areas of a target's cells, and the outcome of the attempts in the inner ones."""

    search: TargetSearch
    likely: tuple[KnownArea, ...] = ()
    pose: Pose | None = None
    tried: int = 0
    _outer: dict[HeadingCell, BaseGeometry] = field(default_factory=dict)
    _free: dict[Span, BaseGeometry] = field(default_factory=dict)
    _free_inside: dict[Span, BaseGeometry] = field(default_factory=dict)
    _scenes: dict[Span, ConvexScene] = field(default_factory=dict)
    _inside: dict[HeadingCell, FineReachTable] = field(default_factory=dict)

    @property
    def scene(self) -> Scene:
        return self.search.scene

    @property
    def target(self) -> Target:
        return self.search.target

    @property
    def is_exhausted(self) -> bool:
        """True where no other inner area is searched."""
        return self.tried >= OPTIONS.max_tries or self.search.is_exhausted

    @property
    def whole(self) -> tuple[Span, Span]:
        """All headings and pitches."""
        heading = self.scene.free_floor.headings
        if heading == EVERY and self._outline.any():  # else the base is a point below the arm axis
            heading = (-np.pi, np.pi)
        if not self._tilts or self.target.direction is None:
            return heading, (0.0, 0.0)
        pitch = _pitch_of(self.target.direction)
        low, high = pitch - self.target.cone, pitch + self.target.cone
        return heading, (max(low, -np.pi / 2), min(high, np.pi / 2))

    @cached_property
    def _tilts(self) -> bool:
        """True where the areas depend on the tool's pitch."""
        return self.target.direction is not None and self._model.exact

    def cell(self, low: Array, high: Array) -> HeadingCell:
        """The cell that a box (2,), (2,) stands for."""
        heading, pitch = zip(low.tolist(), high.tolist(), strict=True)
        return HeadingCell(heading, pitch if self._tilts else None)

    def attempts(self, cell: HeadingCell) -> bool:
        """Search the inner areas of a cell for a configuration, the largest first; True if found."""
        for family, area in self.inner(cell) if self.pose is None and not self.is_exhausted else ():
            if self.is_exhausted:
                break
            self.tried += 1
            self.pose = self.search.within(area, family, cell.heading)
            if self.pose is not None:
                return True
        return False

    def outer(self, cell: HeadingCell) -> BaseGeometry:
        """No place outside it works at any heading and pitch of the cell."""
        if cell not in self._outer:
            kinds = self._kinds(cell, inner=False)
            _, shapes = fine_reach(self.scene, self.target, kinds, cell.heading, inner=False)
            free = self._free_at_some(cell.heading) if len(shapes) else Polygon()
            self._outer[cell] = shapely.intersection(shapely.union_all(shapes), free)
        return self._outer[cell]

    def inner(self, cell: HeadingCell) -> Iterator[KnownArea]:
        """Areas of which every place works at all headings of the cell, the largest first.

        Of all headings the likely ones, where there are some.
        """
        if self.likely and (cell.heading, cell.pitch or (0.0, 0.0)) == self.whole:
            yield from self.likely
            return
        families, shapes = self._reach_inside(cell)
        if not shapely.intersects(shapes, self.outer(cell)).any():
            return
        areas = shapely.intersection(shapes, self._free_at_all(cell.heading))
        for k in np.argsort(-shapely.area(areas), kind="stable").tolist():
            if areas[k].area > 0:
                yield families[k], areas[k]

    def stays_open(self, cell: HeadingCell) -> bool:
        """True where no narrower heading decides: the reach is the same, and has open places free at all."""
        if self._tilts or not self._model.turns_freely(self.scene.rules, (0.0, 0.0)):
            return False
        outer = self.outer(cell)
        if shapely.intersects(self._reach_inside(cell)[1], outer).any():
            return False
        free: BaseGeometry = outer & self._free_at_all(cell.heading)
        return not free.is_empty and (free & self.reach).area > 0

    def _reach_inside(self, cell: HeadingCell) -> FineReachTable:
        if cell not in self._inside:
            kinds = self._kinds(cell, inner=True)
            self._inside[cell] = fine_reach(self.scene, self.target, kinds, cell.heading, inner=True)
        return self._inside[cell]

    def widest_side(self, cell: HeadingCell) -> int:
        """The side to bisect: headings 0, pitches 1, or `NO_SIDE` where both are narrow."""
        turn = 0.0 if cell.heading == EVERY else cell.heading[1] - cell.heading[0]
        tilt = 0.0
        if cell.pitch is not None and self.target.orientation is None:
            tilt = cell.pitch[1] - cell.pitch[0]
        if max(turn, tilt) < OPTIONS.min_cell_width:
            return NO_SIDE
        return 1 if tilt > turn else 0

    def _kinds(self, cell: HeadingCell, *, inner: bool) -> tuple[Family, ...]:
        target = self.target
        if cell.pitch is None or target.direction is None:
            return Family(FRONT), Family(BACK)
        if target.orientation is not None:
            return self._model.families(target, (FRONT, BACK), inner=inner)
        pitch = sum(cell.pitch) / 2
        low, high = (pitch, pitch) if inner else cell.pitch
        half = _widest_swing(_pitch_of(target.direction), target.cone, low, high) - (
            ROUNDING_MARGIN if inner else 0.0
        )
        if half <= 0:
            return ()
        azimuth = float(np.arctan2(target.direction[1], target.direction[0]))
        both = families_along(azimuth, pitch, half, (low, high))
        return tuple(replace(kind, facing=facing) for facing in (FRONT, BACK) for kind in both)

    @property
    def _model(self) -> ReachModel:
        return reach_model(self.scene.robot, goal_of(self.target))

    @cached_property
    def _outline(self) -> Array:
        outline: Array = self.scene.robot.footprint - self.scene.robot.mount[:2]
        return outline

    @cached_property
    def _about(self) -> BaseGeometry:
        """No place outside it works at any heading; most of the reach is often gone already."""
        return round_outer_areas(self.scene, [self.target], coarse=True)[0]

    def _free_at_some(self, heading: Span) -> BaseGeometry:
        """Places of the axis at some heading of a range, from outside, and about the target alone."""
        if heading not in self._free:
            about = self._about_at(heading)
            if not (about.is_empty or self.is_exhausted):
                about = self._cut_by_slab(heading, about)
            self._free[heading] = about
        return self._free[heading]

    def _free_at_all(self, heading: Span) -> BaseGeometry:
        """Places of the axis at all headings of a range, from within; none where none were asked for."""
        if heading not in self._free_inside:
            scene = self._scenes.get(heading)
            inner = Polygon() if scene is None else free_at_all(scene, *_turn(heading))
            self._free_inside[heading] = shapely.buffer(inner, -2 * ROUNDING_MARGIN, join_style="mitre")
        return self._free_inside[heading]

    def _about_at(self, heading: Span) -> BaseGeometry:
        """No place outside it works at a heading of the range, by the narrowest range known about it."""
        wider = [span for span in self._free if span[0] <= heading[0] and heading[1] <= span[1]]
        if not wider:
            return self._about
        about = self._free[min(wider, key=lambda span: span[1] - span[0])]
        exact = heading[1] - heading[0] <= OPTIONS.narrow_cell and not self.has_inner
        return about & self.reach if exact else about

    @property
    def has_inner(self) -> bool:
        """True where an inner area is known: then nothing rules the target out but what the arm touches."""
        return bool(self.likely) or self.tried > 0

    @cached_property
    def reach(self) -> BaseGeometry:
        """Reach at the target's own height, which is slow: that of its layer, which comes first, is more."""
        return reach_of(self.scene, self.target)

    def _cut_by_slab(self, heading: Span, about: BaseGeometry) -> BaseGeometry:
        """Some places, as far as a heading is free of the floor and the shadows that matter to them."""
        ground, (low, high) = self.scene.ground, _turn(heading)
        by = OPTIONS.max_rotated_share * ground.far + ROUNDING_MARGIN
        x0, y0, x1, y1 = shapely.bounds(shapely.get_parts(about)).T
        near = ground.cut_to(shapely.union_all(shapely.box(x0 - by, y0 - by, x1 + by, y1 + by)))
        if near.floor.is_empty:
            return Polygon()
        sides = OPTIONS.disc_sides if high - low > OPTIONS.narrow_cell else OPTIONS.narrow_disc_sides
        scene = convex_scene(self._outline, near.floor, near.shadows, near.clearance, sides, about)
        self._scenes[heading] = scene
        return free_at_some(scene, low, high)


def _turn(heading: Span) -> Span:
    """A range of headings; one of them where all are the same."""
    return (0.0, 0.0) if heading == EVERY else heading


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
