"""How a base gets about with the tool lifted: omnidirectional at any heading or by heading, or on wheels."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
import shapely
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import GUARD, ground_of
from regionik.areas.standing import Standing, room_for
from regionik.mfabrik import axis_of, pose_of
from regionik.moving.hops import Hops
from regionik.planners.driving.drive import NoPathError, drive, drive_inside
from regionik.planners.driving.room import Room, fits, rolls, slides
from regionik.planners.driving.shape import drive_shape
from regionik.planners.driving.wheels import Way, drive_car, drive_differential
from regionik.planners.geometry.flat import FlatPolygon
from regionik.postures.poses import Pose
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

WAYS = 16  # directions of drawing back


class Driver(Protocol):
    """What carrying the tool asks of a base."""

    @property
    def methods(self) -> dict[str, int]:
        """How many moves each method made."""

    @property
    def seed(self) -> int:
        """Of sampling planners."""

    def onto(self, here: Pose, label: int) -> list[Pose]:
        """From a pose onto the free floor of a piece, the arm still; the pose alone where it is there.

        Raises NoPathError.
        """

    def route(self, here: Pose, there: Pose, label: int, berth: float = 0.0) -> Array:
        """Way over a piece of free floor, with ``berth`` more kept from its edge; raises NoPathError."""

    def states(self, here: Pose, there: Pose, route: Array) -> list[Pose]:
        """States strictly between two poses along a route."""

    def direct(self, here: Pose, there: Pose, label: int) -> list[Pose] | None:
        """States of the straight motion between two poses; None where it leaves the floor."""

    def inside(self, at: Pose, label: int) -> bool:
        """Whether the base may stand there."""

    def extent(self, label: int) -> Array:
        """Least and greatest x and y of the arm axis on a piece of floor, (2, 2) [m]."""

    def retreats(self, at: Pose, far: float, label: int) -> Iterator[list[Pose]]:
        """Short ways off, the arm still, the likeliest first: states after the first, to the last."""


def driver_for(world: World, hops: Hops, standing: Standing, seed: int) -> Driver:
    """The driver that suits a base and where it may stand."""
    if world.robot.base != "omni":
        return OnWheels(world, hops, seed)
    if len(standing.sides) == 1:
        return AnyHeading(world, hops, standing, seed)
    return ByHeading(world, hops, seed)


@dataclass(frozen=True, eq=False)
class AnyHeading:
    """An omnidirectional base on floor that is free at every heading: the arm axis is driven as a point."""

    world: World
    hops: Hops
    standing: Standing
    seed: int
    methods: dict[str, int] = field(default_factory=dict)
    _floors: dict[int, FlatPolygon] = field(default_factory=dict)

    def onto(self, here: Pose, label: int) -> list[Pose]:
        """A robot may start where only its heading keeps it clear; see `Driver`."""
        axis = axis_of(self.world.robot, here.base)
        spot = into(self._piece(label), axis)
        if spot is axis:
            return [here]
        there = Pose(pose_of(self.world.robot, spot, here.base[2]), here.joints)
        shaped = ByHeading(self.world, self.hops, self.seed)
        return [here, *shaped.states(here, there, shaped.route(here, there, label)), there]

    def route(self, here: Pose, there: Pose, label: int, berth: float = 0.0) -> Array:
        """Of the arm axis, (k, 2); see `Driver`."""
        a, b = (axis_of(self.world.robot, pose.base) for pose in (here, there))
        piece = self._piece(label)
        free = piece.buffer(-berth) if berth else piece
        if free.is_empty:
            raise NoPathError("no floor is left", a, b)
        flat = FlatPolygon.from_shapely(free) if berth else self._flat(label)
        return self.within(free, flat, a, b)

    def within(self, free: BaseGeometry, flat: FlatPolygon, a: Array, b: Array) -> Array:
        """Way of the arm axis from a to b inside a polygon, also given for kernels, (k, 2)."""
        # Ends may lie outside by rounding, or by the gap between the exact and the inner area.
        spots = [p if flat.holds(p) else into(free, p) for p in (a, b)]
        if math.dist(*spots) < 1e-9:
            return np.array([a, b])
        step = self.world.rules.step
        if isinstance(free, Polygon):
            found = drive_inside(free, flat, *spots, step=step, seed=self.seed)
        else:
            found = drive(free, *spots, step=step, seed=self.seed)
        self._count(found.method)
        points = np.array(found.points)
        points[0], points[-1] = a, b
        return points

    def states(self, here: Pose, there: Pose, route: Array) -> list[Pose]:
        """Heading and joints spread over the route; see `Driver`."""
        return self.hops.along(here, there, route)

    def direct(self, here: Pose, there: Pose, label: int) -> list[Pose] | None:
        """The axis moves straight; see `Driver`."""
        a, b = (axis_of(self.world.robot, pose.base) for pose in (here, there))
        return self.hops.straight(here, there) if self._flat(label).sees(a, b) else None

    def inside(self, at: Pose, label: int) -> bool:
        """See `Driver`."""
        return self._flat(label).holds(axis_of(self.world.robot, at.base))

    def extent(self, label: int) -> Array:
        """See `Driver`."""
        return np.reshape(self._piece(label).bounds, (2, 2))

    def retreats(self, at: Pose, far: float, label: int) -> Iterator[list[Pose]]:
        """Straight off in sixteen directions, away from the tool first; see `Driver`."""
        for spot in _fan(self.world, at, far):
            back = Pose(pose_of(self.world.robot, spot, at.base[2]), at.joints)
            states = self.direct(at, back, label)
            if states is not None:
                yield [*states, back]

    def _count(self, method: str) -> None:
        self.methods[method] = self.methods.get(method, 0) + 1

    def _piece(self, label: int) -> BaseGeometry:
        piece: BaseGeometry = self.standing.pieces.polygon[label]
        return piece

    def _flat(self, label: int) -> FlatPolygon:
        """A piece of the free floor for kernels, kept."""
        if label not in self._floors:
            self._floors[label] = FlatPolygon.from_shapely(self._piece(label))
        return self._floors[label]


@dataclass(frozen=True, eq=False)
class _Shaped:
    """A base whose footprint is moved as it is, proven free."""

    world: World
    hops: Hops
    seed: int
    methods: dict[str, int] = field(default_factory=dict)

    @property
    def room(self) -> Room:
        return room_for(self.world)

    def onto(self, here: Pose, label: int) -> list[Pose]:
        """It is there wherever it fits; see `Driver`."""
        return [here]

    def states(self, here: Pose, there: Pose, route: Array) -> list[Pose]:
        """Joints spread over the base's poses; see `Driver`."""
        return self.hops.over(here, there, route)

    def inside(self, at: Pose, label: int) -> bool:
        """See `Driver`."""
        return bool(fits(self.room, *at.base))

    def extent(self, label: int) -> Array:
        """See `Driver`."""
        return np.reshape(self.world.floor.polygon.bounds, (2, 2))

    def _count(self, method: str) -> None:
        self.methods[method] = self.methods.get(method, 0) + 1


@dataclass(frozen=True, eq=False)
class ByHeading(_Shaped):
    """An omnidirectional base that turns so as to pass where its circle would not."""

    def route(self, here: Pose, there: Pose, label: int, berth: float = 0.0) -> Array:
        """Of the base, (n, 3); see `Driver`."""
        ground, robot = ground_of(self.world), self.world.robot
        found = drive_shape(
            robot.footprint,
            ground.floor,
            here.base,
            there.base,
            obstacles=ground.shadows,
            clearance=ground.clearance + GUARD + berth,
            seed=self.seed,
        )
        self._count(found.method)
        return found.poses

    def direct(self, here: Pose, there: Pose, label: int) -> list[Pose] | None:
        """The base goes straight and turns evenly; see `Driver`."""
        bases = np.stack([here.base, there.base])
        return self.hops.over(here, there, bases) if slides(self.room, *bases) else None

    def retreats(self, at: Pose, far: float, label: int) -> Iterator[list[Pose]]:
        """Straight off in sixteen directions, away from the tool first; see `Driver`."""
        for spot in _fan(self.world, at, far):
            back = Pose(pose_of(self.world.robot, spot, at.base[2]), at.joints)
            states = self.direct(at, back, label)
            if states is not None:
                yield [*states, back]


@dataclass(frozen=True, eq=False)
class OnWheels(_Shaped):
    """A base that rolls: a differential drive, or a car."""

    def route(self, here: Pose, there: Pose, label: int, berth: float = 0.0) -> Array:
        """Of the base, (n, 3), each hop a line, an arc or a turn on the spot; see `Driver`."""
        way = self.way(here.base, there.base, berth)
        self._count(way.method)
        return way.sample(self.world.rules.step)

    def way(self, a: Array, b: Array, berth: float = 0.0) -> Way:
        """How the base rolls from one pose to another; raises NoPathError."""
        robot = self.world.robot
        room = self.room
        if berth:
            room = room._replace(keep=room.keep + berth)
        if robot.base == "differential":
            return drive_differential(room, a, b, seed=self.seed)
        return drive_car(room, a, b, turning_radius=robot.turning_radius, seed=self.seed)

    def direct(self, here: Pose, there: Pose, label: int) -> list[Pose] | None:
        """Straight motions of base and arm are no rolling; see `Driver`."""
        still = np.array_equal(here.base, there.base)
        return self.hops.over(here, there, np.stack([here.base, there.base])) if still else None

    def retreats(self, at: Pose, far: float, label: int) -> Iterator[list[Pose]]:
        """Straight back and straight ahead; see `Driver`."""
        for length in (-far, far) if far else (0.0,):
            if rolls(self.room, at.base, length, 0.0):
                x, y, yaw = at.base
                back = replace(at, base=np.array([x + length * np.cos(yaw), y + length * np.sin(yaw), yaw]))
                yield [*self.hops.over(at, back, np.stack([at.base, back.base])), back]


def into(free: BaseGeometry, spot: Array) -> Array:
    """The spot, or the nearest point of the polygon."""
    point = Point(spot)
    if free.covers(point):
        return spot
    return np.array(shapely.shortest_line(free, point).coords[0])


def _fan(world: World, at: Pose, far: float) -> Iterator[Array]:
    """Places of the arm axis round it, straight away from the tool first."""
    axis = axis_of(world.robot, at.base)
    away = float(np.arctan2(*(axis - world.robot.tool(at.base, at.joints)[:2, 3])[::-1]))
    turns = sorted(range(WAYS), key=lambda k: (min(k, WAYS - k), k))
    for k in turns if far > 0 else turns[:1]:
        angle = away + 2 * np.pi * k / WAYS
        yield axis + far * np.array([np.cos(angle), np.sin(angle)])
