"""A base that rolls: a differential drive, or a car."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from regionik.ladder import Ladder
from regionik.moving.base_motion import BasePath, ShapedDriver, halting, together
from regionik.planners.driving.arcs import WheeledPath
from regionik.planners.driving.footprint import FootprintScene, arc_is_free
from regionik.planners.driving.pose_planner import drive_car, drive_differential
from regionik.postures.poses import Pose
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World


@dataclass(frozen=True, eq=False)
class _WheeledDriver(ShapedDriver, ABC):
    """A base that rolls along lines and arcs, or turns on the spot."""

    @abstractmethod
    def way_in(self, room: FootprintScene, a: Array, b: Array) -> WheeledPath:
        """Way that the base rolls from one pose to another; raises NoPathError."""

    def route(self, here: Pose, there: Pose, label: int, berth: float = 0.0) -> Array:
        """Of the base, (n, 3), each hop a line, an arc or a turn on the spot; see `Driver`."""
        room = self.room._replace(clearance=self.room.clearance + berth) if berth else self.room
        way = self.way_in(room, here.base, there.base)
        self.count(way.method)
        return way.sample(self.world.rules.step)

    def direct(self, here: Pose, there: Pose, label: int) -> list[Pose] | None:
        """Straight motions of base and arm are no rolling; see `Driver`."""
        still = np.array_equal(here.base, there.base)
        return self.interpolator.over(here, there, np.stack([here.base, there.base])) if still else None

    def retreats(self, at: Pose, far: float, label: int) -> Iterator[list[Pose]]:
        """Straight back and straight ahead; see `Driver`."""
        for length in (-far, far) if far else (0.0,):
            if arc_is_free(self.room, at.base, length, 0.0):
                x, y, yaw = at.base
                back = replace(at, base=np.array([x + length * np.cos(yaw), y + length * np.sin(yaw), yaw]))
                yield [*self.interpolator.over(at, back, np.stack([at.base, back.base])), back]

    def paths(self, ladder: Ladder) -> WheeledPaths:
        """See `Driver`."""
        return WheeledPaths(self.world, self)


@dataclass(frozen=True, eq=False)
class DifferentialDriver(_WheeledDriver):
    """Lines and turns on the spot."""

    def way_in(self, room: FootprintScene, a: Array, b: Array) -> WheeledPath:
        """See `_WheeledDriver`."""
        return drive_differential(room, a, b, seed=self.seed)


@dataclass(frozen=True, eq=False)
class CarDriver(_WheeledDriver):
    """Lines and arcs of the turning radius."""

    def way_in(self, room: FootprintScene, a: Array, b: Array) -> WheeledPath:
        """See `_WheeledDriver`."""
        radius = self.world.robot.drive.turning_radius
        return drive_car(room, a, b, turning_radius=radius, seed=self.seed)


@dataclass(frozen=True, eq=False)
class WheeledPaths:
    """A base that rolls: while the tool goes on, after it, or before."""

    world: World
    driver: _WheeledDriver

    def between(self, k: int, j: int, here: Array, goal: Array) -> Iterator[BasePath]:
        """See `BasePaths`."""
        if np.array_equal(here, goal):
            yield together(True, np.stack([here, here]))
            return
        way = self.driver.way_in(self.driver.room, here, goal)
        poses = np.array(way.sample(self.world.rules.step))
        poses[-1] = goal
        yield together(True, poses)
        yield halting(True, here[None], poses)
        yield halting(True, poses, goal[None])
