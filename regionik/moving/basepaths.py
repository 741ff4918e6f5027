"""Ways of the base while the tool stays on its path from one set-point to the next.

The base first tries to go straight while the tool goes on. Else it moves inside the area of the first
set-point to a place that both share, and from there inside the area of the second: at the same time as the
tool, where the area holds at every heading, or halting at that place while the tool goes on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import NamedTuple, Protocol

import numpy as np
import shapely
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import Geometries, ground_of
from regionik.areas.standing import Index, Standing, into_span, room_for
from regionik.mfabrik import axis_of, pose_of
from regionik.moving.driving import AnyHeading, Driver, OnWheels
from regionik.planners.clearance.legs import bases_between, leg_lengths
from regionik.planners.driving.footprint import Slab
from regionik.planners.driving.room import Room, room_of, slides
from regionik.planners.driving.slabgraph import through
from regionik.planners.geometry.flat import segment_in_either
from regionik.pruning import Ladder
from regionik.worlds.arrays import Array
from regionik.worlds.robot import BaseKind
from regionik.worlds.scene import World

INSET = 0.002  # kept from the edge of what two areas share, where there is room [m]
EVENLY = np.array([0.0, 1.0])  # from one knot to another
TURN_PART = 0.1  # of a turn about the arm axis, which a base frame elsewhere does by short slides [rad]


class BaseWay(NamedTuple):
    """A way of the base from one set-point to the next, knot by knot, and how far the tool is at each.

    Attributes
    ----------
    kind : {"omni", "differential", "car"}
        How the base goes from knot to knot.
    knots : (k, 3) array
        Base poses; where the heading is NaN it is free, and the place is that of the arm axis [m], [rad].
    tool : (k,) array
        0 at the first set-point, 1 at the second.
    """

    kind: BaseKind
    knots: Array
    tool: Array

    def places(self, leg: Index, share: Array) -> Array:
        """As the knots are, at shares (n,) of legs (n,): leg k goes from knot k to the next, (n, 3)."""
        places: Array = bases_between(self.knots, leg, share, self.kind != "omni")
        return places


class Tracks(Protocol):
    """Ways of one kind of base."""

    def ways(self, k: int, j: int, here: Array, goal: Array) -> Iterator[BaseWay]:
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

    def ways(self, k: int, j: int, here: Array, goal: Array) -> Iterator[BaseWay]:
        """See `Tracks`."""
        a, b = (axis_of(self.world.robot, pose) for pose in (here, goal))
        if self._within(k, j, a, b):
            yield _together("omni", _at_any_heading(np.array([a, b])))
        for over in self._handovers(k, j, a, b):
            before, after = (
                _at_any_heading(way) for way in (self._inside(k, a, over), self._inside(j, over, b))
            )
            yield _together("omni", np.concatenate([before, after[1:]]))
            yield _halting("omni", before, after)

    def _handovers(self, k: int, j: int, a: Array, b: Array) -> Iterator[Array]:
        """Places that two components share: an end of the way itself, where it is one, comes first."""
        shared = (end for end, other in ((b, k), (a, j)) if self.ladder.flat(other).holds(end))
        yield from islice(shared, 1)
        yield _handover(self.ladder.component[k] & self.ladder.component[j], a, b)

    def _inside(self, k: int, a: Array, b: Array) -> Array:
        """Way of the arm axis in a component, (n, 2)."""
        return a[None] if a is b else self.driver.within(self.ladder.component[k], self.ladder.flat(k), a, b)

    def _within(self, k: int, j: int, a: Array, b: Array) -> bool:
        """Whether the straight way lies in two components together; most ways lie in one of them."""
        one, other = self.ladder.flat(k), self.ladder.flat(j)
        if one.sees(a, b) or other.sees(a, b):
            return True
        return bool(segment_in_either(one.vertices, one.starts, other.vertices, other.starts, *a, *b))


def _at_any_heading(axes: Array) -> Array:
    """Knots (k, 3) of a way of the arm axis (k, 2)."""
    knots = np.full((len(axes), 3), np.nan)
    knots[:, :2] = axes
    return knots


def _together(kind: BaseKind, knots: Array) -> BaseWay:
    """The tool goes on as the base does; a base that is there already stands while it does."""
    if len(knots) == 1:
        knots = np.concatenate([knots, knots])
    if len(knots) == 2:
        return BaseWay(kind, knots, EVENLY)
    far = np.concatenate([[0.0], np.cumsum(leg_lengths(knots))])
    return BaseWay(kind, knots, far / far[-1] if far[-1] > 0 else np.linspace(0.0, 1.0, len(knots)))


def _halting(kind: BaseKind, before: Array, after: Array) -> BaseWay:
    """The base moves, stands while the tool goes on, and moves on: ``after`` begins where ``before`` ends."""
    return BaseWay(kind, np.concatenate([before, after]), np.repeat([0.0, 1.0], [len(before), len(after)]))


@dataclass(frozen=True, eq=False)
class ByHeadingTracks:
    """An omnidirectional base turns and drives through the slabs of a component's group."""

    world: World
    ladder: Ladder
    standing: Standing
    seed: int
    _slabs: dict[int, tuple[Slab, ...]] = field(default_factory=dict)

    def ways(self, k: int, j: int, here: Array, goal: Array) -> Iterator[BaseWay]:
        """See `Tracks`."""
        if slides(room_for(self.world), here, goal):
            yield _together("omni", np.stack([here, goal]))
        over = self._shared(k, j, here, goal)
        if over is None:
            return
        before, after = self._through(k, here, over), self._through(j, over, goal)
        if before is not None and after is not None:  # by way of slabs it is far: the tool rather waits
            yield _halting("omni", before, after)

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


@dataclass(frozen=True, eq=False)
class WheelTracks:
    """A base that rolls: while the tool goes on, after it, or before."""

    world: World
    driver: OnWheels

    def ways(self, k: int, j: int, here: Array, goal: Array) -> Iterator[BaseWay]:
        """See `Tracks`."""
        kind = self.world.robot.base
        if np.array_equal(here, goal):
            yield _together(kind, np.stack([here, here]))
            return
        poses = np.array(self.driver.way(here, goal).sample(self.world.rules.step))
        poses[-1] = goal
        yield _together(kind, poses)
        yield _halting(kind, here[None], poses)
        yield _halting(kind, poses, goal[None])


@dataclass(frozen=True, eq=False)
class StandingTracks:
    """The base stands still while the tool goes on."""

    world: World

    def ways(self, k: int, j: int, here: Array, goal: Array) -> Iterator[BaseWay]:
        """See `Tracks`."""
        if np.array_equal(here, goal):
            yield _together(self.world.robot.base, np.stack([here, here]))


def _handover(shared: BaseGeometry, a: Array, b: Array) -> Array:
    """Place in the shared area nearest to the way from a to b, a little inside where there is room."""
    inside = shared.buffer(-INSET)
    goal = shared if inside.is_empty else inside
    return np.array(shapely.shortest_line(goal, LineString([a, b])).coords[0])
