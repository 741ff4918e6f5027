"""Drivers of bases: omnidirectional at any heading or by heading, and on wheels.

An omnidirectional base has its arm axis driven as a point where every heading is free, else its footprint.
While the tool goes on from one set-point to the next, the base first tries to go straight. Else it moves
inside the area of the first set-point to a place that both share, and from there inside the area of the
second: at the same time as the tool, where the area holds at every heading, or halting at that place while
the tool goes on. A base on wheels rolls to its next pose, and the tool goes on during that, before or after.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.free_space import FreeSpace, into_span, into_spans
from regionik.areas.ground import EVERY
from regionik.areas.layers import ROUNDING_MARGIN, Geometries
from regionik.ladder import Ladder
from regionik.moving.base_motion import (
    BasePath,
    Driver,
    Found,
    found_once,
    halting,
    simultaneous,
)
from regionik.moving.options import MOVING
from regionik.planners.driving.arcs import MAX_TURN_STEP, WheeledPath, arc_end
from regionik.planners.driving.footprint import arc_is_free, fits, slide_is_free
from regionik.planners.driving.footprint_planner import FootprintFloor, FootprintPath, path_through_slabs
from regionik.planners.driving.footprint_scene import footprint_scene
from regionik.planners.driving.heading_slabs import Slab
from regionik.planners.driving.point_planner import NoPathError, drive_point, drive_point_inside
from regionik.planners.driving.pose_planner import drive_wheeled, steered_path
from regionik.planners.geometry.polygons import FlatPolygon, segment_in_either
from regionik.planners.geometry.polylines import spread_along
from regionik.postures.poses import MAX_JOINT_CHANGE, Pose, axis_of, pose_of
from regionik.scene import Scene
from regionik.worlds.arrays import Array, Index
from regionik.worlds.drives import displacement

OPTIONS = MOVING.transits
ROUNDING = 1e-6  # by which ends of a way may lie off the floor [m]
LEAD_LENGTHS = [sign * 0.01 * 1.5**k for k in range(16) for sign in (1, -1)]  # straight ahead and back [m]


def driver_for(scene: Scene, free_space: FreeSpace, seed: int) -> Driver:
    """Return the driver that suits a base and where it may stand."""
    if scene.robot.drive.rolls:
        return WheeledDriver(scene, free_space, seed)
    at_any_heading = len(free_space.sides) == 1
    return (AnyHeadingDriver if at_any_heading else ByHeadingDriver)(scene, free_space, seed)


@dataclass(frozen=True, eq=False)
class AnyHeadingDriver(Driver):
    """Driver over floor that is free at every heading: the arm axis is planned for as a point."""

    _floors: dict[int, FlatPolygon] = field(default_factory=dict)

    def onto(self, here: Pose, label: int) -> list[Pose]:
        """Return poses to the free floor from a start that only its heading keeps clear."""
        axis = axis_of(self.scene.robot, here.base)
        spot = _nearest_inside(self._piece(label), axis)
        if spot is axis:
            return [here]
        there = Pose(pose_of(self.scene.robot, spot, here.base[2]), here.joints)
        bases = np.stack([here.base, there.base])
        if slide_is_free(self.scene.footprint_between(*bases), *bases):
            return [here, *super().states(here, there, bases), there]
        shaped = self.shaped()
        return [here, *shaped.states(here, there, shaped.route(here, there, label)), there]

    def route(self, here: Pose, there: Pose, label: int, berth: float = 0.0) -> Array:
        """Of the arm axis, (k, 2)."""
        a, b = (axis_of(self.scene.robot, pose.base) for pose in (here, there))
        piece = self._piece(label)
        if not shapely.dwithin(piece, shapely.points([a, b]), ROUNDING).all():
            raise NoPathError("it would stand where only its heading leaves it room")
        if berth:
            return self._off_the_edge(label, a, b, berth)
        return self.within(piece, self._flat(label), a, b)

    def _off_the_edge(self, label: int, a: Array, b: Array, berth: float) -> Array:
        """Return a route that keeps a berth from the edge of a piece, except straight on at its ends."""
        piece, flat = self._piece(label), self._flat(label)
        free = piece.buffer(-berth)
        if free.is_empty:
            raise NoPathError("no floor is left")
        spots = [_nearest_inside(free, p) for p in (a, b)]
        ends = [_nearest_inside(piece, p) for p in (a, b)]
        if not all(flat.sees(end, spot) for end, spot in zip(ends, spots, strict=True)):
            raise NoPathError("it would leave the floor on its way off the edge")
        inside = self.within(free, FlatPolygon.from_shapely(free), *spots)
        lead, tail = ([p] if spot is not p else [] for p, spot in zip((a, b), spots, strict=True))
        return np.array([*lead, *inside, *tail])

    def within(self, free: BaseGeometry, flat: FlatPolygon, a: Array, b: Array) -> Array:
        """Way of the arm axis from a to b inside a polygon, also given for kernels, (k, 2)."""
        # Ends may lie outside by rounding.
        spots = [p if flat.holds(p) else _nearest_inside(free, p) for p in (a, b)]
        if math.dist(*spots) < 1e-9:
            return np.array([a, b])
        step = self.scene.rules.step
        if isinstance(free, Polygon):
            found = drive_point_inside(free, flat, *spots, step=step)
        else:
            found = drive_point(free, *spots, step=step)
        self.count(found.method)
        points = np.array(found.points)
        points[0], points[-1] = a, b
        return points

    def states(self, here: Pose, there: Pose, route: Array) -> list[Pose]:
        """Axis along a route (n, 2), heading and joints spread over it."""
        robot = self.scene.robot
        turn = displacement(here.base, there.base)[2]
        # The base moves by no more than the axis does and the mount swings about it.
        way = float(np.hypot(*np.diff(route, axis=0).T).sum())
        way += abs(turn) * float(np.hypot(*robot.mount[:2]))
        step = self.scene.rules.step * 0.999
        bend = float(np.abs(there.joints - here.joints).max())
        parts = max(abs(turn) / MAX_TURN_STEP, bend / MAX_JOINT_CHANGE, way / step)
        shares, axes = spread_along(np.array(route), step, int(np.ceil(parts)))
        bases = np.column_stack([np.zeros((len(shares), 2)), here.base[2] + shares * turn])
        bases[:, :2] = axes - axis_of(robot, bases)
        joints = here.joints + shares[:, None] * (there.joints - here.joints)
        return [Pose(*pose) for pose in zip(bases, joints, strict=True)]

    def direct(self, here: Pose, there: Pose, label: int) -> list[Pose] | None:
        """The base goes straight and turns evenly; the axis does where the footprint has no room for that."""
        bases = np.stack([here.base, there.base])
        if slide_is_free(self.scene.footprint_between(*bases), *bases):
            return super().states(here, there, bases)
        a, b = (axis_of(self.scene.robot, pose.base) for pose in (here, there))
        return self.states(here, there, np.array([a, b])) if self._flat(label).sees(a, b) else None

    def inside(self, at: Pose, label: int) -> bool:
        return self._flat(label).holds(axis_of(self.scene.robot, at.base))

    def extent(self, label: int) -> Array:
        return np.reshape(self._piece(label).bounds, (2, 2))

    def shaped(self) -> Driver:
        """It turns, which a fixed heading forbids."""
        if self.scene.rules.heading == "fixed":
            return self
        return ByHeadingDriver(self.scene, self.free_space, self.seed, self.methods)

    def paths(self, ladder: Ladder) -> AnyHeadingPaths:
        return AnyHeadingPaths(ladder, self)

    def _piece(self, label: int) -> BaseGeometry:
        return self.free_space.pieces.polygon[label]

    def _flat(self, label: int) -> FlatPolygon:
        """Return a piece of the free floor for kernels; it is cached."""
        if label not in self._floors:
            self._floors[label] = FlatPolygon.from_shapely(self._piece(label))
        return self._floors[label]


@dataclass(frozen=True, eq=False)
class ByHeadingDriver(Driver):
    """Driver that turns the base to pass where its circumscribed circle does not fit."""

    _paths: Found[FootprintPath] = field(default_factory=dict)
    _floors: dict[tuple[float, bool], FootprintFloor] = field(default_factory=dict)  # by berth and margin

    def route(self, here: Pose, there: Pose, label: int, berth: float = 0.0) -> Array:
        """Of the base, (n, 3)."""
        a, b = here.base, there.base
        found = found_once(self._paths, a, b, berth, lambda: self._searched(a, b, berth))
        self.count(found.method)
        return found.poses

    def _searched(self, a: Array, b: Array, berth: float) -> FootprintPath:
        floor, planner = self._floor_between(a, b, berth), self.scene.rules.base_planner
        return floor.drive(a, b, seed=self.seed, planner=planner)

    def _floor_between(self, a: Array, b: Array, berth: float) -> FootprintFloor:
        """Return the floor for a drive between two base poses (3,), prepared once for all of one kind."""
        ground, robot = self.scene.ground_between(a, b), self.scene.robot
        key = (berth, ground is self.scene.ground)
        if key not in self._floors:
            margin = ROUNDING_MARGIN + berth
            upper, keep = ground.upper(robot.mount[:2], margin), ground.clearance + margin
            self._floors[key] = FootprintFloor(robot.footprint, ground.floor, ground.shadows, keep, upper)
        return self._floors[key]

    def direct(self, here: Pose, there: Pose, label: int) -> list[Pose] | None:
        """The base goes straight and turns evenly."""
        bases = np.stack([here.base, there.base])
        free = slide_is_free(self.scene.footprint_between(*bases), *bases)
        return self.states(here, there, bases) if free else None

    def paths(self, ladder: Ladder) -> ByHeadingPaths:
        return ByHeadingPaths(ladder, self)


@dataclass(frozen=True, eq=False)
class WheeledDriver(Driver):
    """Driver of a base that rolls along lines and arcs, or turns on the spot."""

    _paths: Found[WheeledPath] = field(default_factory=dict)

    def path(self, a: Array, b: Array, berth: float = 0.0) -> WheeledPath:
        """Return a path on wheels between two poses, searched for once; raise NoPathError."""
        return found_once(self._paths, a, b, berth, lambda: self._searched(a, b, berth))

    def _searched(self, a: Array, b: Array, berth: float) -> WheeledPath:
        room, radius = self.scene.footprint_between(a, b), self.scene.robot.drive.turning_radius
        room = room.with_berth(berth) if berth else room
        planner = self.scene.rules.base_planner
        return drive_wheeled(room, a, b, turning_radius=radius, seed=self.seed, planner=planner)

    def onto(self, here: Pose, label: int) -> list[Pose]:
        """Straight on or back to where a base that touches its bounds may turn, if that leads there."""
        if fits(self.room, *here.base):
            return [here]
        x, y, yaw = here.base
        for length in LEAD_LENGTHS:
            there = replace(here, base=np.array(arc_end(x, y, yaw, length, 0.0)))
            room = self.scene.footprint_between(here.base, there.base)
            if fits(self.room, *there.base) and arc_is_free(room, here.base, length, 0.0):
                return [here, *self.states(here, there, np.stack([here.base, there.base])), there]
        return [here]

    def route(self, here: Pose, there: Pose, label: int, berth: float = 0.0) -> Array:
        """Of the base, (n, 3), each hop a line, an arc or a turn on the spot."""
        path = self.path(here.base, there.base, berth)
        self.count(path.method)
        return path.sample(self.scene.rules.step)

    def direct(self, here: Pose, there: Pose, label: int) -> list[Pose] | None:
        """Return None: a straight motion of base and arm violates the rolling constraint."""
        still = np.array_equal(here.base, there.base)
        return self.states(here, there, np.stack([here.base, there.base])) if still else None

    def retreats(self, at: Pose, far: float, label: int) -> Iterator[list[Pose]]:
        """Yield retreats straight back and straight ahead."""
        x, y, yaw = at.base
        for length in (-far, far) if far else (0.0,):
            if arc_is_free(self.scene.footprint_between(at.base), at.base, length, 0.0):
                back = replace(at, base=np.array(arc_end(x, y, yaw, length, 0.0)))
                yield [*self.states(at, back, np.stack([at.base, back.base])), back]

    def paths(self, ladder: Ladder) -> WheeledPaths:
        return WheeledPaths(self)


@dataclass(frozen=True, eq=False)
class AnyHeadingPaths:
    """Paths of the arm axis through areas that hold at every heading."""

    ladder: Ladder
    driver: AnyHeadingDriver

    def between(self, k: int, j: int, here: Array, goal: Array) -> Iterator[BasePath]:
        a, b = (axis_of(self.driver.scene.robot, pose) for pose in (here, goal))
        if self._within(k, j, a, b):
            yield simultaneous(False, _at_any_heading(np.array([a, b])))
        for over in self._handovers(k, j, a, b):
            before, after = (
                _at_any_heading(way) for way in (self._inside(k, a, over), self._inside(j, over, b))
            )
            yield simultaneous(False, np.concatenate([before, after[1:]]))
            yield halting(False, before, after)

    def _handovers(self, k: int, j: int, a: Array, b: Array) -> Iterator[Array]:
        """Places that two components share: an end of the way itself, where it is one, comes first."""
        shared = (end for end, other in ((b, k), (a, j)) if self.ladder.flat(other).holds(end))
        yield from islice(shared, 1)
        both = _shared_area(*self.ladder.component[[[k], [j]]])
        yield _nearest_to(both, a, b)[0]

    def _inside(self, k: int, a: Array, b: Array) -> Array:
        """Way of the arm axis in a component, (n, 2)."""
        return a[None] if a is b else self.driver.within(self.ladder.component[k], self.ladder.flat(k), a, b)

    def _within(self, k: int, j: int, a: Array, b: Array) -> bool:
        """True if the straight way lies in two components together; most ways lie in one of them."""
        one, other = self.ladder.flat(k), self.ladder.flat(j)
        if one.sees(a, b) or other.sees(a, b):
            return True
        return bool(segment_in_either(one.vertices, one.starts, other.vertices, other.starts, *a, *b))


@dataclass(frozen=True, eq=False)
class ByHeadingPaths:
    """Paths on which the base turns and drives through the heading slabs of a component's group."""

    ladder: Ladder
    driver: ByHeadingDriver
    _slabs: dict[int, tuple[Slab, ...]] = field(default_factory=dict)
    _overlaps: dict[tuple[int, int], tuple[Index, Geometries]] = field(default_factory=dict)

    def between(self, k: int, j: int, here: Array, goal: Array) -> Iterator[BasePath]:
        if slide_is_free(self.driver.room, here, goal):
            yield simultaneous(False, np.stack([here, goal]))
        over = self._shared(k, j, here, goal)
        if over is None:
            return
        before, after = self._through(k, here, over), self._through(j, over, goal)
        if before is not None and after is not None:  # by way of slabs it is far: the tool rather waits
            yield halting(False, before, after)

    def _shared(self, k: int, j: int, here: Array, goal: Array) -> Array | None:
        """Pose that components of both groups hold, the nearest to the way; None where they share none."""
        pairs, areas = self._common(int(self.ladder.group[k]), int(self.ladder.group[j]))
        ends = [axis_of(self.driver.scene.robot, pose) for pose in (here, goal)]
        if not len(pairs):
            return None
        spots, yaws = _nearest_to(areas, *ends), np.full(len(pairs), here[2])
        one, other = self.driver.free_space.spans[self.ladder.side[pairs.T]]
        for span in (one, other, one):  # neighbouring slabs share the heading between them
            yaws = into_spans(yaws, *span.T)
        ways = sum(np.linalg.norm(spots - end, axis=1) for end in ends)
        n = int(np.argmin(ways + np.abs(yaws - here[2])))
        return pose_of(self.driver.scene.robot, spots[n], float(yaws[n]))

    def _common(self, one: int, other: int) -> tuple[Index, Geometries]:
        """Pairs (n, 2) of components of two groups that overlap, and what each pair shares."""
        if (one, other) not in self._overlaps:
            ladder = self.ladder
            pairs = ladder.edges[(ladder.group[ladder.edges] == (one, other)).all(axis=1)]
            self._overlaps[one, other] = pairs, _shared_area(*ladder.component[pairs].T)
        return self._overlaps[one, other]

    def _through(self, k: int, a: Array, b: Array) -> Array | None:
        """Base poses from one to another, the arm axis inside the slabs of a component's group."""
        robot, room = self.driver.scene.robot, self.driver.room
        if slide_is_free(room, a, b):
            return np.stack([a, b])
        seen = [np.array([*axis_of(robot, pose), pose[2]]) for pose in (a, b)]
        ground, about_axis = self.driver.scene.ground, robot.footprint - robot.mount[:2]
        upper = ground.upper(np.zeros(2))
        scene = footprint_scene(about_axis, ground.floor, ground.shadows, ground.clearance, upper)
        found = path_through_slabs(scene, self._group(k), seen[0], seen[1])
        if found is None:
            return None
        poses = np.array([pose_of(robot, p[:2], float(p[2])) for p in _short_turns(found)])
        poses[0], poses[-1] = a, b
        free = all(slide_is_free(room, p, q) for p, q in zip(poses[:-1], poses[1:], strict=True))
        return poses if free else None

    def _group(self, k: int) -> tuple[Slab, ...]:
        """Areas that the components of a group cover, slab by slab; those for every heading are in each."""
        group = int(self.ladder.group[k])
        if group not in self._slabs:
            members, part, side = self.ladder.group == group, self.ladder.component, self.ladder.side
            spans = {s: one.span for s, one in enumerate(self.driver.free_space.sides)}
            every = [s for s, span in spans.items() if span == EVERY]
            self._slabs[group] = tuple(
                Slab(*spans[s], shapely.union_all(part[members & np.isin(side, [s, *every])]), Polygon())
                for s in spans
                if s not in every
            )
        return self._slabs[group]


@dataclass(frozen=True, eq=False)
class WheeledPaths:
    """Paths of a base that rolls: while the tool advances, after it, or before.

    It goes as it is steered; on a way that has to be searched for the arm hardly ever holds the tool.
    """

    driver: WheeledDriver

    def between(self, k: int, j: int, here: Array, goal: Array) -> Iterator[BasePath]:
        if np.array_equal(here, goal):
            yield simultaneous(True, np.stack([here, here]))
            return
        radius = self.driver.scene.robot.drive.turning_radius
        path = steered_path(self.driver.room, here, goal, turning_radius=radius)
        if path is None:
            return
        poses = np.array(path.sample(self.driver.scene.rules.step))
        poses[-1] = goal
        yield simultaneous(True, poses)
        yield halting(True, here[None], poses)
        yield halting(True, poses, goal[None])


def _short_turns(poses: Array) -> Array:
    """Poses (n, 3) with long turns cut into short ones, headings continuous."""
    rows = [poses[0]]
    for pose in poses[1:]:
        last = rows[-1]
        to = np.array([pose[0], pose[1], into_span(float(last[2]), (pose[2], pose[2]))])
        count = max(1, int(np.ceil(abs(to[2] - last[2]) / OPTIONS.max_turn_part)))
        rows += [last + (m + 1) / count * (to - last) for m in range(count)]
    return np.array(rows)


def _nearest_inside(free: BaseGeometry, spot: Array) -> Array:
    """The spot itself where the area covers it, else the nearest point of the area."""
    point = Point(spot)
    if free.covers(point):
        return spot
    return np.array(shapely.shortest_line(free, point).coords[0])


def _at_any_heading(axes: Array) -> Array:
    """Knots (k, 3) of a way of the arm axis (k, 2)."""
    return np.column_stack([axes, np.full(len(axes), np.nan)])


def _shared_area(one: Geometries, other: Geometries) -> Geometries:
    """What areas share pair by pair, without its rim where there is room."""
    shared = shapely.intersection(one, other)
    inside = shapely.buffer(shared, -OPTIONS.edge_inset)
    return np.asarray(np.where(shapely.is_empty(inside), shared, inside))


def _nearest_to(areas: Geometries, a: Array, b: Array) -> Array:
    """Places in areas nearest to the way from a to b, (n, 2)."""
    lines = shapely.shortest_line(areas, LineString([a, b]))
    return np.array(shapely.get_coordinates(lines)[::2])
