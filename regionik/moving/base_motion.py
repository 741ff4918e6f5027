"""Motion of a base: driving with the tool lifted, and ways of the base while the tool stays on its path."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from regionik.areas.free_space import FreeSpace, Index
from regionik.ladder import Ladder
from regionik.moving.options import MOVING
from regionik.planners.collision.robot_motion import bases_between
from regionik.planners.driving.arcs import MAX_TURN_STEP, WheeledPath
from regionik.planners.driving.footprint import fits
from regionik.planners.driving.footprint_planner import FootprintPath
from regionik.planners.driving.footprint_scene import FootprintScene
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.geometry.polylines import leg_lengths
from regionik.postures.poses import MAX_JOINT_CHANGE, Pose, axis_of, configuration_pose, pose_of
from regionik.scene import Scene
from regionik.values import Configuration
from regionik.worlds.arrays import Array
from regionik.worlds.drives import displacement

Path = TypeVar("Path", FootprintPath, WheeledPath)
Found = dict[tuple[bytes, bytes, float], Path | NoPathError]  # by both ends and the berth [m]
OPTIONS = MOVING.transits


@dataclass(frozen=True, eq=False)
class Candidate:
    """A configuration at a set-point, and the component its base stands in."""

    configuration: Configuration
    component: int
    way: tuple[Pose, ...] = ()  # to it, with the tool on its path, of one that was found by going on

    @property
    def pose(self) -> Pose:
        """Base and arm."""
        return configuration_pose(self.configuration)


class BasePath(NamedTuple):
    """A path of the base from one set-point to the next, and how far the tool is at each knot."""

    rolls: bool  # how the base goes from knot to knot; see `regionik.worlds.drives.BaseDrive`
    # (k, 3) base poses; where the heading is NaN it is free, and the place is that of the arm axis [m], [rad]
    knots: Array
    tool: Array  # (k,) 0 at the first set-point, 1 at the second

    def places(self, leg: Index, share: Array) -> Array:
        """Poses (n, 3) at shares (n,) of legs (n,); leg k goes from knot k to the next."""
        return bases_between(self.knots, leg, share, self.rolls)


def simultaneous(rolls: bool, knots: Array) -> BasePath:
    """Return a path on which tool and base advance together; a base that has arrived waits for the tool."""
    if len(knots) == 1:
        knots = np.concatenate([knots, knots])
    far = np.concatenate([[0.0], np.cumsum(leg_lengths(knots))])
    return BasePath(rolls, knots, far / far[-1] if far[-1] > 0 else np.linspace(0.0, 1.0, len(knots)))


def halting(rolls: bool, before: Array, after: Array) -> BasePath:
    """Return a path that halts while the tool advances; ``after`` begins where ``before`` ends."""
    return BasePath(rolls, np.concatenate([before, after]), np.repeat([0.0, 1.0], [len(before), len(after)]))


class BasePaths(Protocol):
    """Paths of one kind of base while the tool advances."""

    def between(self, k: int, j: int, here: Array, goal: Array) -> Iterator[BasePath]:
        """Yield paths from a pose in component k to one in j of the next set-point, the simplest first.

        Raises
        ------
        NoPathError
            Where there is none.
        """


@dataclass(frozen=True, eq=False)
class StationaryPaths:
    """Paths of a base that is stationary while the tool advances."""

    scene: Scene

    def between(self, k: int, j: int, here: Array, goal: Array) -> Iterator[BasePath]:
        if np.array_equal(here, goal):
            yield simultaneous(self.scene.robot.drive.rolls, np.stack([here, here]))


@dataclass(frozen=True, eq=False)
class Driver(ABC):
    """Motion of one kind of base; by default its whole footprint is proven collision-free."""

    scene: Scene
    free_space: FreeSpace
    seed: int  # of sampling planners
    methods: dict[str, int] = field(default_factory=dict)  # number of moves that each made

    @abstractmethod
    def route(self, here: Pose, there: Pose, label: int, berth: float = 0.0) -> Array:
        """Return a route over a piece of free floor that keeps ``berth`` from its edge; raise NoPathError."""

    @abstractmethod
    def direct(self, here: Pose, there: Pose, label: int) -> list[Pose] | None:
        """Return the states of the straight motion between two poses, or None if it leaves the floor."""

    @abstractmethod
    def paths(self, ladder: Ladder) -> BasePaths:
        """Return the paths of the base while the tool stays on its path."""

    def onto(self, here: Pose, label: int) -> list[Pose]:
        """Return poses from one onto a piece of free floor, the arm still; the pose alone if it is there.

        Raise NoPathError if there are none.
        """
        return [here]

    def shaped(self) -> Driver:
        """Return a driver of the same base that plans with its whole footprint."""
        return self

    def states(self, here: Pose, there: Pose, route: Array) -> list[Pose]:
        """Return the states strictly between two poses: base along a route (n, 3), joints spread over it."""
        drive, change = self.scene.robot.drive, there.joints - here.joints
        moves = displacement(route[:-1], route[1:])
        ways = np.hypot(moves[:, 0], moves[:, 1])
        efforts = ways + np.abs(moves[:, 2])
        total = float(efforts.sum())
        shares = efforts / total if total > 0 else np.full(len(moves), 1.0 / max(len(moves), 1))
        most = float(np.abs(change).max()) / MAX_JOINT_CHANGE
        rows: list[Pose] = []
        last = here
        for move, way, share, base in zip(moves, ways, shares, route[1:], strict=True):
            next_ = Pose(base, last.joints + share * change)
            parts = max(way / self.scene.rules.step, abs(move[2]) / MAX_TURN_STEP, share * most)
            count = max(1, int(np.ceil(parts * 1.001)))
            parted = np.arange(1, count) / count
            joints = last.joints + parted[:, None] * (next_.joints - last.joints)
            inner = zip(drive.between(last.base, base, parted), joints, strict=True)
            rows += [*(Pose(*pose) for pose in inner), next_]
            last = next_
        return rows[:-1]

    def inside(self, at: Pose, label: int) -> bool:
        """True if the base is collision-free at a pose."""
        return bool(fits(self.scene.footprint_between(at.base), *at.base))

    def extent(self, label: int) -> Array:
        """Return the bounds of x and y of the arm axis on a piece of floor, (2, 2) [m]."""
        return np.reshape(self.scene.floor.polygon.bounds, (2, 2))

    def retreats(self, at: Pose, far: float, label: int) -> Iterator[list[Pose]]:
        """Yield short retreats with the arm still, as their states after the first.

        They go straight in sixteen directions, the one away from the tool first.
        """
        robot, axis = self.scene.robot, axis_of(self.scene.robot, at.base)
        away = float(np.arctan2(*(axis - robot.tool(at.base, at.joints)[:2, 3])[::-1]))
        count = OPTIONS.retreat_directions
        turns = sorted(range(count), key=lambda k: (min(k, count - k), k))
        for k in turns if far > 0 else turns[:1]:
            angle = away + 2 * np.pi * k / count
            spot = axis + far * np.array([np.cos(angle), np.sin(angle)])
            back = Pose(pose_of(robot, spot, at.base[2]), at.joints)
            states = self.direct(at, back, label)
            if states is not None:
                yield [*states, back]

    @property
    def room(self) -> FootprintScene:
        """The footprint and everything from which it keeps its clearance."""
        return self.scene.footprint

    def count(self, method: str) -> None:
        """Count a move that a method made."""
        self.methods[method] = self.methods.get(method, 0) + 1


def found_once(found: Found[Path], a: Array, b: Array, berth: float, search: Callable[[], Path]) -> Path:
    """Return the path between two base poses (3,) with a berth, searched for once, or raise NoPathError."""
    ends = (a.tobytes(), b.tobytes(), berth)
    if ends not in found:
        try:
            found[ends] = search()
        except NoPathError as refusal:
            found[ends] = refusal
    path = found[ends]
    if isinstance(path, NoPathError):
        raise path
    return path
