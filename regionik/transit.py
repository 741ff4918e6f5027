"""Motion with the tool lifted: the arm is folded, the base drives over free floor, the arm unfolds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from regionik.ground import Side
from regionik.guard import Guard
from regionik.hops import Driver, Hops, into
from regionik.mfabrik import axis_of, pose_of
from regionik.planners.drive import NoPathError
from regionik.planners.flat import FlatPolygon, segment_inside
from regionik.planners.touching import Touch
from regionik.poses import Pose
from regionik.wholebody import WholeBody
from regionik.worlds.pivot import pivot_of
from regionik.worlds.scene import World

TURN_STRIDE = 0.1  # largest turn of the base between two states [rad]
WITHDRAWALS = (0.0, 0.1, 0.2, 0.4, 0.6)  # how far the base draws back before the arm folds [m]
WAYS = 16  # directions of drawing back
BERTHS = (0.0, 0.04, 0.08, 0.16)  # kept from the edge of the free floor beyond what the base needs [m]
ITERATIONS = 3000  # of RRTConnect in the space of the whole robot
STRIDE = 1.0  # its longest motion, metres and radians together


@dataclass(frozen=True, eq=False)
class Carrier:
    """Moves the robot with its tool lifted."""

    world: World
    side: Side
    guard: Guard
    driver: Driver
    _floors: dict[int, FlatPolygon] = field(default_factory=dict)

    @property
    def hops(self) -> Hops:
        return Hops(self.world, self.guard)

    def sampled(self, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """States strictly between two poses, on a way found in the space of the whole robot."""
        lead = self._onto(here, piece)
        if not self.hops.clear(lead):
            return None
        space = WholeBody(self.world, self.hops, self._flat(piece))
        way = space.way(lead[-1], there, self.driver.seed)
        if way is None:
            return None
        self.driver.methods["whole body"] = self.driver.methods.get("whole body", 0) + 1
        pairs = zip(way[:-1], way[1:], strict=True)
        rows = [row for a, b in pairs for row in [*self.hops.straight(a, b), b]]
        return [*lead[1:], *rows[:-1]]

    def folded(self, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """States strictly between two poses on one piece of free floor; None where the arm cannot pass so.

        The arm is folded at once where that keeps it clear, else after drawing back; it unfolds likewise.
        """
        plain = self._carried(here, there, piece)
        if self.hops.clear([here, *plain, there]):
            return plain
        lead = self._onto(here, piece)
        out = next(self._withdrawals(lead[-1], piece), None)
        back = next(self._withdrawals(there, piece), None)
        if out is None or back is None or not self.hops.clear(lead):
            return None
        drive = self._driven(out[-1], back[-1], piece)
        return None if drive is None else [*lead[1:], *out, *drive, *back[::-1]]

    def obstruction(self, here: Pose, there: Pose, piece: int) -> Touch | None:
        """What the arm meets first where it is folded, driven and unfolded without looking."""
        poses = [here, *self._carried(here, there, piece), there]
        met = next((touch for touch in map(self.guard.touch, poses) if touch.kind != "none"), None)
        if met is not None:  # tells how deep, where a proof only tells that it ended
            return met
        stops = (self.guard.stop(a, b) for a, b in zip(poses[:-1], poses[1:], strict=True))
        return next((touch for touch in stops if touch is not None), None)

    def _onto(self, here: Pose, piece: int) -> list[Pose]:
        """From a pose straight onto the free floor, the arm still; the pose alone where it is there already.

        A robot may start where only its heading keeps it clear.
        """
        axis = axis_of(self.world.robot, here.base)
        spot = into(self.side.pieces[piece], axis)
        if spot is axis:
            return [here]
        there = Pose(pose_of(self.world.robot, spot, here.base[2]), here.joints)
        return [here, *self.hops.straight(here, there), there]

    def _carried(self, here: Pose, there: Pose, piece: int) -> list[Pose]:
        """Fold where the robot stands, drive in the carry posture, unfold; short ways without folding."""
        a, b = axis_of(self.world.robot, here.base), axis_of(self.world.robot, there.base)
        path = self.driver.drive(self.side.pieces[piece], a, b)
        if len(path) == 2 and float(np.hypot(*(b - a))) <= 2 * self.world.rules.step:
            return self.hops.along(here, there, path)
        lifted, lowered = self._lifted(here), self._lifted(there)
        return [
            *self.hops.along(here, lifted, np.array([a, a])),
            lifted,
            *self.hops.along(lifted, lowered, path),
            lowered,
            *self.hops.along(lowered, there, np.array([b, b])),
        ]

    def _driven(self, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """Drive with a still arm, giving things the widest berth that is needed."""
        a, b = (axis_of(self.world.robot, pose.base) for pose in (here, there))
        for berth in BERTHS:
            free = self.side.pieces[piece].buffer(-berth)
            if free.is_empty:
                return None
            try:
                drive = self.hops.along(here, there, self.driver.drive(free, a, b))
            except NoPathError:
                return None
            if self.hops.clear([here, *drive, there]):
                return drive
        return None

    def _withdrawals(self, here: Pose, piece: int) -> Iterator[list[Pose]]:
        """Clear ways from a pose to the carry posture: back with a still arm, then fold."""
        flat = self._flat(piece)
        axis = axis_of(self.world.robot, here.base)
        tool = self.world.robot.tool(here.base, here.joints)[:2, 3]
        away = float(np.arctan2(*(axis - tool)[::-1]))
        turns = sorted(range(WAYS), key=lambda k: (min(k, WAYS - k), k))
        for far in WITHDRAWALS:
            for k in turns if far > 0 else turns[:1]:
                angle = away + 2 * np.pi * k / WAYS
                spot = axis + far * np.array([np.cos(angle), np.sin(angle)])
                if not segment_inside(flat.vertices, flat.starts, *axis, *spot):
                    continue
                back = Pose(pose_of(self.world.robot, spot, here.base[2]), here.joints)
                folded = self._lifted(back)
                way = [
                    *self.hops.along(here, back, np.array([axis, spot])),
                    back,
                    *self.hops.along(back, folded, np.array([spot, spot])),
                    folded,
                ]
                if self.hops.clear([here, *way]):
                    yield way

    def _lifted(self, at: Pose) -> Pose:
        """Carry posture with the pivot left where it is, so that the arm folds in its own plane."""
        q = np.array(self.world.robot.carry)
        pivot = pivot_of(self.world.robot.chain)
        q[pivot] = at.joints[pivot]
        return Pose(at.base, q)

    def _flat(self, piece: int) -> FlatPolygon:
        """A piece of the free floor for kernels, kept."""
        if piece not in self._floors:
            self._floors[piece] = FlatPolygon.from_shapely(self.side.pieces[piece])
        return self._floors[piece]
