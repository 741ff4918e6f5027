"""Moves of base and arm with the tool lifted: straight in axis, heading and joints, cut into states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from regionik.guard import Guard
from regionik.mfabrik import axis_of, pose_of
from regionik.planners.drive import drive, resample
from regionik.planners.flat import FlatPolygon, segment_inside
from regionik.poses import LARGEST_BEND, Pose, turn_to
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

TURN_STRIDE = 0.1  # largest turn of the base between two states [rad]


@dataclass(frozen=True, eq=False)
class Driver:
    """Drives the base inside polygons.

    Attributes
    ----------
    world : World
    seed : int
    methods : dict
        How many moves each method made.
    """

    world: World
    seed: int
    methods: dict[str, int] = field(default_factory=dict)

    def drive(self, free: BaseGeometry, a: Array, b: Array) -> Array:
        """Way of the arm axis from a to b inside a polygon, (k, 2)."""
        # Ends may lie outside by rounding, or by the gap between the exact and the inner area.
        spots = [into(free, a), into(free, b)]
        if np.hypot(*(spots[1] - spots[0])) < 1e-9:
            return np.array([a, b])
        found = drive(free, spots[0], spots[1], step=self.world.rules.step, seed=self.seed)
        self.methods[found.method] = self.methods.get(found.method, 0) + 1
        points = np.array(found.points)
        points[0], points[-1] = a, b
        return points


@dataclass(frozen=True, eq=False)
class Hops:
    """States between poses, and whether the arm is clear on them."""

    world: World
    guard: Guard

    def along(self, here: Pose, there: Pose, path: Array) -> list[Pose]:
        """States strictly between two poses: axis along a path, heading and joints spread over it."""
        robot = self.world.robot
        turn = turn_to(here.base, there.base)[2]
        lever = float(np.hypot(*robot.mount[:2]))
        step = self.world.rules.step / (1.0 + lever)
        points = resample(path, step * 0.999)
        lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        swing = max(abs(turn) / TURN_STRIDE, float(np.abs(there.joints - here.joints).max()) / LARGEST_BEND)
        if lever > 0:
            swing = max(swing, abs(turn) * lever / (step * 0.5))
        stops = lengths / lengths[-1] if lengths[-1] > 0 else np.array([0.0, 1.0])
        shares = np.union1d(stops, np.linspace(0.0, 1.0, int(np.ceil(swing)) + 1))[1:-1]
        shares = shares[np.diff(shares, prepend=0.0) > 1e-9]
        poses = []
        for share in shares:
            at = share * lengths[-1]
            axis = np.array([np.interp(at, lengths, points[:, d]) for d in (0, 1)])
            if lengths[-1] == 0:
                axis = points[0]
            base = pose_of(robot, axis, here.base[2] + share * turn)
            poses.append(Pose(base, here.joints + share * (there.joints - here.joints)))
        return poses

    def straight(self, here: Pose, there: Pose) -> list[Pose]:
        """States strictly between two poses, the axis moving straight."""
        ends = [axis_of(self.world.robot, pose.base) for pose in (here, there)]
        return self.along(here, there, np.array(ends))

    def goes(self, flat: FlatPolygon, here: Pose, there: Pose) -> bool:
        """Whether a straight motion stays on the free floor, and keeps the arm clear."""
        a, b = (axis_of(self.world.robot, pose.base) for pose in (here, there))
        inside = bool(segment_inside(flat.vertices, flat.starts, a[0], a[1], b[0], b[1]))
        return inside and self.clear([here, *self.straight(here, there), there])

    def clear(self, poses: Sequence[Pose]) -> bool:
        """Whether a motion is proven clear, its two ends aside."""
        pairs = zip(poses[:-1], poses[1:], strict=True)
        return not self.guard.on or all(self.guard.stop(a, b) is None for a, b in pairs)


def into(free: BaseGeometry, spot: Array) -> Array:
    """The spot, or the nearest point of the polygon."""
    point = Point(spot)
    if free.covers(point):
        return spot
    return np.array(shapely.shortest_line(free, point).coords[0])
