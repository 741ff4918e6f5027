"""Motion with the tool lifted: the arm is folded, the base drives over free floor, the arm unfolds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from regionik.ground import Side
from regionik.guard import Guard
from regionik.mfabrik import axis_of, pose_of
from regionik.planners.drive import NoPathError, drive, resample
from regionik.planners.flat import FlatPolygon, contains, segment_inside
from regionik.planners.sampling import State, connect
from regionik.planners.touching import Touch
from regionik.poses import LARGEST_BEND, Pose, turn_to
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

TURN_STRIDE = 0.1  # largest turn of the base between two states [rad]
WITHDRAWALS = (0.0, 0.1, 0.2, 0.4, 0.6)  # how far the base draws back before the arm folds [m]
WAYS = 16  # directions of drawing back
BERTHS = (0.0, 0.04, 0.08, 0.16)  # kept from the edge of the free floor beyond what the base needs [m]
ITERATIONS = 3000  # of RRTConnect in the space of the whole robot
STRIDE = 1.0  # its longest motion, metres and radians together


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
        spots = [_into(free, a), _into(free, b)]
        if np.hypot(*(spots[1] - spots[0])) < 1e-9:
            return np.array([a, b])
        found = drive(free, spots[0], spots[1], step=self.world.rules.step, seed=self.seed)
        self.methods[found.method] = self.methods.get(found.method, 0) + 1
        points = np.array(found.points)
        points[0], points[-1] = a, b
        return points


@dataclass(frozen=True, eq=False)
class Carrier:
    """Moves the robot with its tool lifted."""

    world: World
    side: Side
    guard: Guard
    driver: Driver

    def folded(self, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """States strictly between two poses on one piece of free floor; None where the arm cannot pass so.

        The arm is folded at once where that keeps it clear, else after drawing back; it unfolds likewise.
        """
        plain = self._carried(here, there, piece)
        if self._clear([here, *plain, there]):
            return plain
        lead = self._onto(here, piece)
        out = next(self._withdrawals(lead[-1], piece), None)
        back = next(self._withdrawals(there, piece), None)
        if out is None or back is None or not self._clear(lead):
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
        spot = _into(self.side.pieces[piece], axis)
        if spot is axis:
            return [here]
        there = Pose(pose_of(self.world.robot, spot, here.base[2]), here.joints)
        return [here, *self._straight(here, there), there]

    def _carried(self, here: Pose, there: Pose, piece: int) -> list[Pose]:
        """Fold where the robot stands, drive in the carry posture, unfold; short ways without folding."""
        a, b = axis_of(self.world.robot, here.base), axis_of(self.world.robot, there.base)
        path = self.driver.drive(self.side.pieces[piece], a, b)
        if len(path) == 2 and float(np.hypot(*(b - a))) <= 2 * self.world.rules.step:
            return self._along(here, there, path)
        lifted, lowered = self._lifted(here), self._lifted(there)
        return [
            *self._along(here, lifted, np.array([a, a])),
            lifted,
            *self._along(lifted, lowered, path),
            lowered,
            *self._along(lowered, there, np.array([b, b])),
        ]

    def _driven(self, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """Drive with a still arm, giving things the widest berth that is needed."""
        a, b = (axis_of(self.world.robot, pose.base) for pose in (here, there))
        for berth in BERTHS:
            free = self.side.pieces[piece].buffer(-berth)
            if free.is_empty:
                return None
            try:
                drive = self._along(here, there, self.driver.drive(free, a, b))
            except NoPathError:
                return None
            if self._clear([here, *drive, there]):
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
                    *self._along(here, back, np.array([axis, spot])),
                    back,
                    *self._along(back, folded, np.array([spot, spot])),
                    folded,
                ]
                if self._clear([here, *way]):
                    yield way

    def sampled(self, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """States strictly between two poses by RRTConnect in the space of axis, heading and joints."""
        flat, lead = self._flat(piece), self._onto(here, piece)
        if not self._clear(lead):
            return None
        here = lead[-1]
        start, goal = self._spread_out(here, here), self._spread_out(there, here)
        lower, upper = self._box(flat, start, goal)

        def free(state: State) -> bool:
            inside = bool(contains(flat.vertices, flat.starts, state[0], state[1]))
            return inside and self.guard.clear(self._pose(self._read(state)))

        def clear(p: State, q: State) -> bool:
            return self._goes(flat, self._pose(self._read(p)), self._pose(self._read(q)))

        path = connect(
            lower, upper, start, goal, free, clear, seed=self.driver.seed, most=ITERATIONS, stride=STRIDE
        )
        if path is None:
            return None
        self.driver.methods["whole body"] = self.driver.methods.get("whole body", 0) + 1
        poses = self._shortened(flat, [here, *(self._pose(q) for q in path[1:-1]), there])
        rows = [row for a, b in zip(poses[:-1], poses[1:], strict=True) for row in [*self._straight(a, b), b]]
        return [*lead[1:], *rows[:-1]]

    def _shortened(self, flat: FlatPolygon, poses: list[Pose]) -> list[Pose]:
        """Poses without those that a straight motion, proven clear, can leave out."""
        kept, k = [poses[0]], 0
        while k < len(poses) - 1:
            ahead = range(len(poses) - 1, k + 1, -1)
            k = next((m for m in ahead if self._goes(flat, poses[k], poses[m])), k + 1)
            kept.append(poses[k])
        return kept

    def _goes(self, flat: FlatPolygon, here: Pose, there: Pose) -> bool:
        """Whether a straight motion stays on the free floor, and keeps the arm clear."""
        a, b = (axis_of(self.world.robot, pose.base) for pose in (here, there))
        inside = bool(segment_inside(flat.vertices, flat.starts, a[0], a[1], b[0], b[1]))
        return inside and self._clear([here, *self._straight(here, there), there])

    def _spread_out(self, pose: Pose, near: Pose) -> Array:
        """A pose as axis, heading and joints in one row, the heading within half a turn of another's."""
        yaw = near.base[2] + turn_to(near.base, pose.base)[2]
        return np.array([*axis_of(self.world.robot, pose.base), yaw, *pose.joints])

    def _pose(self, q: Array) -> Pose:
        return Pose(pose_of(self.world.robot, q[:2], float(q[2])), q[3:])

    def _read(self, state: State) -> Array:
        return np.array([state[i] for i in range(3 + self.world.robot.chain.dof)])

    def _box(self, flat: FlatPolygon, start: Array, goal: Array) -> tuple[Array, Array]:
        """Where to sample: the floor's extent, a turn about the start's heading, joint limits."""
        chain = self.world.robot.chain
        ends = np.stack([start, goal])
        low, high = ends.min(axis=0), ends.max(axis=0)
        low[:2], high[:2] = flat.vertices.min(axis=0), flat.vertices.max(axis=0)
        if self.world.rules.heading != "fixed":
            low[2], high[2] = start[2] - np.pi, start[2] + np.pi
        unbounded = ~(np.isfinite(chain.lower) & np.isfinite(chain.upper))
        low[3:] = np.where(unbounded, low[3:] - np.pi, chain.lower)
        high[3:] = np.where(unbounded, high[3:] + np.pi, chain.upper)
        return low, high

    def _straight(self, here: Pose, there: Pose) -> list[Pose]:
        ends = [axis_of(self.world.robot, pose.base) for pose in (here, there)]
        return self._along(here, there, np.array(ends))

    def _along(self, here: Pose, there: Pose, path: Array) -> list[Pose]:
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

    def _lifted(self, at: Pose) -> Pose:
        """Carry posture with the pivot left where it is, so that the arm folds in its own plane."""
        q = np.array(self.world.robot.carry)
        q[0] = at.joints[0]
        return Pose(at.base, q)

    def _clear(self, poses: Sequence[Pose]) -> bool:
        """Whether a motion is proven clear, its two ends aside."""
        pairs = zip(poses[:-1], poses[1:], strict=True)
        return not self.guard.on or all(self.guard.stop(a, b) is None for a, b in pairs)

    def _flat(self, piece: int) -> FlatPolygon:
        return FlatPolygon.from_shapely(self.side.pieces[piece])


def _into(free: BaseGeometry, spot: Array) -> Array:
    """The spot, or the nearest point of the polygon."""
    point = Point(spot)
    if free.covers(point):
        return spot
    return np.array(shapely.shortest_line(free, point).coords[0])
