"""Ways of the base while the tool stays on its path from one set-point to the next.

The base first tries to go straight while the tool goes on. Else it moves inside the area of the first
set-point to a place that both share, the tool goes on from there, and the base moves on inside the area of
the second.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
import shapely
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from regionik.driving import AnyHeading, Driver, OnWheels
from regionik.ground import Geometries, ground_of, united
from regionik.mfabrik import axis_of, pose_of
from regionik.planners.flat import FlatPolygon
from regionik.planners.footprint import Slab
from regionik.planners.room import Room, room_of, slides
from regionik.planners.slabgraph import through
from regionik.poses import turn_to
from regionik.pruning import Ladder
from regionik.rolling import on_way
from regionik.standing import Index, Standing, into_span, room_for
from regionik.worlds.arrays import Array
from regionik.worlds.robot import BaseKind
from regionik.worlds.scene import World

INSET = 0.002  # kept from the edge of what two areas share, where there is room [m]
TURN_PART = 0.1  # of a turn about the arm axis, which a base frame elsewhere does by short slides [rad]


class AxisLine(NamedTuple):
    """The arm axis goes straight; the heading is free."""

    start: Array  # (2,) [m]
    end: Array

    @property
    def length(self) -> float:
        return float(np.hypot(*(self.end - self.start)))

    def places(self, shares: Array) -> Array:
        """At shares of the way, (n, 3): of the arm axis, as the heading is free, which is said by NaN."""
        axes = self.start + shares[:, None] * (self.end - self.start)
        return np.column_stack([axes, np.full(len(shares), np.nan)])


class BaseWay(NamedTuple):
    """The base goes from pose to pose as its kind does between states."""

    kind: BaseKind
    start: Array  # (3,) x, y [m], yaw [rad]
    end: Array

    @property
    def length(self) -> float:
        way = turn_to(self.start, self.end)
        return float(np.hypot(way[0], way[1]) + abs(way[2]))

    def places(self, shares: Array) -> Array:
        """Base poses at shares of the way, (n, 3)."""
        return on_way(self.kind, self.start, self.end, shares)


Track = AxisLine | BaseWay


class Move(NamedTuple):
    """A track of the base, and how far between the two set-points the tool is at its ends."""

    track: Track
    tool: tuple[float, float]


class Tracks(Protocol):
    """Ways of one kind of base."""

    def ways(self, k: int, j: int, here: Array, goal: Array) -> Iterator[list[Move]]:
        """Ways from a pose in component k to one in component j of the next set-point, the plainest first.

        Raises
        ------
        NoPathError
            Where there is none.
        """


def tracks_for(world: World, ladder: Ladder, standing: Standing, driver: Driver) -> Tracks:
    """The tracks that suit a base and where it may stand."""
    if isinstance(driver, AnyHeading):
        return AnyHeadingTracks(world, ladder, driver)
    if isinstance(driver, OnWheels):
        return WheelTracks(world, driver)
    return ByHeadingTracks(world, ladder, standing, driver.seed)


@dataclass(frozen=True, eq=False)
class AnyHeadingTracks:
    """The arm axis is led through areas that hold at every heading."""

    world: World
    ladder: Ladder
    driver: AnyHeading

    def ways(self, k: int, j: int, here: Array, goal: Array) -> Iterator[list[Move]]:
        """See `Tracks`."""
        a, b = (axis_of(self.world.robot, pose) for pose in (here, goal))
        if self._within(k, j, a, b):
            yield [Move(AxisLine(a, b), (0.0, 1.0))]
        first, second = self.ladder.component[k], self.ladder.component[j]
        over = _handover(first & second, a, b)
        yield [
            *_held(self.driver.within(first, self.ladder.flat(k), a, over), 0.0),
            Move(AxisLine(over, over), (0.0, 1.0)),
            *_held(self.driver.within(second, self.ladder.flat(j), over, b), 1.0),
        ]

    def _within(self, k: int, j: int, a: Array, b: Array) -> bool:
        """Whether the straight way lies in two components together; most ways lie in one of them."""
        if any(self.ladder.flat(m).sees(a, b) for m in (k, j)):
            return True
        return FlatPolygon.from_shapely(united(self.ladder.component[[k, j]])).sees(a, b)


def _held(points: Array, tool: float) -> list[Move]:
    """The axis along a polyline, the tool held."""
    return [Move(AxisLine(p, q), (tool, tool)) for p, q in zip(points[:-1], points[1:], strict=True)]


@dataclass(frozen=True, eq=False)
class ByHeadingTracks:
    """An omnidirectional base turns and drives through the slabs of a component's group."""

    world: World
    ladder: Ladder
    standing: Standing
    seed: int
    _slabs: dict[int, tuple[Slab, ...]] = field(default_factory=dict)

    def ways(self, k: int, j: int, here: Array, goal: Array) -> Iterator[list[Move]]:
        """See `Tracks`."""
        if slides(room_for(self.world), here, goal):
            yield [Move(BaseWay("omni", here, goal), (0.0, 1.0))]
        over = self._shared(k, j, here, goal)
        if over is None:
            return
        before, after = self._through(k, here, over), self._through(j, over, goal)
        if before is not None and after is not None:
            stand = Move(BaseWay("omni", over, over), (0.0, 1.0))
            yield [*_led("omni", before, 0.0), stand, *_led("omni", after, 1.0)]

    def _shared(self, k: int, j: int, here: Array, goal: Array) -> Array | None:
        """The pose nearest to the way that components of both groups hold."""
        ladder, sides = self.ladder, self.standing.sides
        ends = [axis_of(self.world.robot, pose) for pose in (here, goal)]
        best: tuple[float, Array] | None = None
        for m, n in ladder.edges.tolist():
            if ladder.group[m] != ladder.group[k] or ladder.group[n] != ladder.group[j]:
                continue
            spot = _handover(ladder.component[m] & ladder.component[n], *ends)
            yaw = float(here[2])
            for c in (m, n, m):  # neighbouring slabs share the heading between them
                yaw = into_span(yaw, sides[int(ladder.side[c])].span)
            cost = sum(float(np.hypot(*(spot - end))) for end in ends) + abs(yaw - here[2])
            if best is None or cost < best[0]:
                best = cost, pose_of(self.world.robot, spot, yaw)
        return None if best is None else best[1]

    def _through(self, k: int, a: Array, b: Array) -> Array | None:
        """Base poses from one to another, the arm axis inside the slabs of a component's group."""
        robot, room = self.world.robot, room_for(self.world)
        if slides(room, a, b):
            return np.stack([a, b])
        seen = [np.array([*axis_of(robot, pose), pose[2]]) for pose in (a, b)]
        found = through(_axis_room(self.world), self._group(k), seen[0], seen[1], self.seed)
        if found is None:
            return None
        poses = np.array([pose_of(robot, p[:2], float(p[2])) for p in _parted(found)])
        poses[0], poses[-1] = a, b
        free = all(slides(room, p, q) for p, q in zip(poses[:-1], poses[1:], strict=True))
        return poses if free else None

    def _group(self, k: int) -> tuple[Slab, ...]:
        """What the components of a group cover, slab by slab."""
        group = int(self.ladder.group[k])
        if group not in self._slabs:
            members = np.flatnonzero(self.ladder.group == group)
            self._slabs[group] = tuple(
                Slab(*side.span, shapely.union_all(self._of_side(members, s)), shapely.Polygon())
                for s, side in enumerate(self.standing.sides)
            )
        return self._slabs[group]

    def _of_side(self, members: Index, s: int) -> Geometries:
        part: Geometries = self.ladder.component[members[self.ladder.side[members] == s]]
        return part


def _axis_room(world: World) -> Room:
    ground, robot = ground_of(world), world.robot
    return room_of(robot.footprint - robot.mount[:2], ground.floor, ground.shadows, ground.clearance)


def _parted(poses: Array) -> Array:
    """Poses with turns cut to short ones; headings on without jumps."""
    rows = [poses[0]]
    for pose in poses[1:]:
        last = rows[-1]
        to = np.array([pose[0], pose[1], into_span(float(last[2]), (pose[2], pose[2]))])
        count = max(1, int(np.ceil(abs(to[2] - last[2]) / TURN_PART)))
        rows += [last + (m + 1) / count * (to - last) for m in range(count)]
    return np.array(rows)


def _led(kind: BaseKind, poses: Array, tool: float) -> list[Move]:
    """The base from pose to pose, the tool held."""
    return [Move(BaseWay(kind, p, q), (tool, tool)) for p, q in zip(poses[:-1], poses[1:], strict=True)]


@dataclass(frozen=True, eq=False)
class WheelTracks:
    """A base that rolls: while the tool goes on, after it, or before."""

    world: World
    driver: OnWheels

    def ways(self, k: int, j: int, here: Array, goal: Array) -> Iterator[list[Move]]:
        """See `Tracks`."""
        kind = self.world.robot.base
        if np.array_equal(here, goal):
            yield [Move(BaseWay(kind, here, here), (0.0, 1.0))]
            return
        poses = np.array(self.driver.way(here, goal).sample(self.world.rules.step))
        poses[-1] = goal
        legs = _led(kind, poses, 0.0)
        far = np.cumsum([0.0, *(leg.track.length for leg in legs)])
        shares = (far / far[-1]).tolist()
        yield [Move(leg.track, (u, v)) for leg, u, v in zip(legs, shares[:-1], shares[1:], strict=True)]
        yield [Move(BaseWay(kind, here, here), (0.0, 1.0)), *_led(kind, poses, 1.0)]
        yield [*legs, Move(BaseWay(kind, goal, goal), (0.0, 1.0))]


@dataclass(frozen=True, eq=False)
class StandingTracks:
    """The base stands still while the tool goes on."""

    world: World

    def ways(self, k: int, j: int, here: Array, goal: Array) -> Iterator[list[Move]]:
        """See `Tracks`."""
        if np.array_equal(here, goal):
            yield [Move(BaseWay(self.world.robot.base, here, here), (0.0, 1.0))]


def _handover(shared: BaseGeometry, a: Array, b: Array) -> Array:
    """Place in the shared area nearest to the way from a to b, a little inside where there is room."""
    inside = shared.buffer(-INSET)
    goal = shared if inside.is_empty else inside
    return np.array(shapely.shortest_line(goal, LineString([a, b])).coords[0])
