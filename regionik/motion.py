"""The motion between configurations: the tool stays on its path wherever the areas allow it.

Between set-points i and i + 1 of one run the base first tries to go straight while the tool goes on; else it
moves inside the area of i to a place shared with the area of i + 1, the tool goes on from there, and the base
moves on inside the area of i + 1. Where a run ends, the tool is lifted and the base drives over free floor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from regionik.ground import Side
from regionik.mfabrik import Solver, axis_of, pose_of, solver_for
from regionik.plan import Configuration, Motion
from regionik.planners import kernels
from regionik.planners.drive import drive, resample
from regionik.planners.flat import FlatPolygon, segment_inside
from regionik.pruning import Ladder
from regionik.reachable import Family
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

TOOL_STRIDE = 0.05  # longest way of base or tool between two states on the path [m]
TURN_STRIDE = 0.1  # largest turn of the base between two states [rad]
SOLVE_TOLERANCE = 0.1  # arms between set-points are solved to this share of the tolerance
SAG_SHARE = 0.3  # share of the path tolerance that motion between two states may use
DEEPEST = 6  # halvings before a stretch counts as discontinuous
LARGEST_BEND = 0.5  # change of a joint between two states above which the arm has jumped [rad]

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class Pose:
    """Where base and arm are."""

    base: Array  # (3,)
    joints: Array  # (dof,)


@dataclass(frozen=True, eq=False)
class Row:
    """One state under construction."""

    pose: Pose
    kind: str
    setpoint: int


@dataclass(frozen=True, eq=False)
class Course:
    """What `connect` hands on.

    Attributes
    ----------
    motion : Motion
    setpoints : tuple of Configuration
        As the motion passes them: the arm re-solved along the way.
    methods : dict
        How many base moves each method of `drive` made.
    """

    motion: Motion
    setpoints: tuple[Configuration, ...]
    methods: dict[str, int]


def connect(
    world: World,
    ladder: Ladder,
    chain: list[int],
    breaks: tuple[int, ...],
    goals: tuple[Configuration, ...],
    side: Side,
    seed: int,
    progress: Progress | None = None,
) -> Course:
    """Join configurations to one motion.

    Parameters
    ----------
    world : World
    ladder : Ladder
    chain : list of int
        Component of each set-point.
    breaks : tuple of int
        Set-points before which the tool is lifted.
    goals : tuple of Configuration
        From M-FABRIK, one for each set-point.
    side : Side
        The ground; transits drive over its free pieces.
    seed : int
    progress : callable, optional
        Called with stage, done, total.
    """
    mover = _Mover(world, ladder, side, seed, {})
    rows: list[Row] = []
    passed: list[Configuration] = []
    if world.start is not None:
        here = Pose(world.start.base, world.start.joints)
        rows.append(Row(here, "transit", -1))
        rows += mover.transit(here, _pose(goals[0]), ladder.floor[chain[0]], -1)
    for i, goal in enumerate(goals):
        arrived = goal
        if i > 0:
            here = _pose(passed[-1])
            stretch = None if i in breaks else mover.follow(i - 1, chain[i - 1], chain[i], here, goal)
            if stretch is None:
                rows += mover.transit(here, _pose(goal), ladder.floor[chain[i]], i - 1)
            else:
                rows += stretch[:-1]
                arrived = _arrive(world, i, stretch[-1].pose, goal)
        rows.append(Row(_pose(arrived), "setpoint", i))
        passed.append(arrived)
        if progress is not None:
            progress("motion", i + 1, len(goals))
    return Course(_columns(rows), tuple(passed), dict(sorted(mover.methods.items())))


@dataclass(frozen=True, eq=False)
class _Mover:
    world: World
    ladder: Ladder
    side: Side
    seed: int
    methods: dict[str, int]

    def follow(self, i: int, k: int, j: int, here: Pose, goal: Configuration) -> list[Row] | None:
        """From set-point i to i + 1 with the tool on the path; None where the arm would have to jump."""
        ladder, robot = self.ladder, self.world.robot
        a, b = axis_of(robot, here.base), axis_of(robot, goal.base)
        start, end = self.world.task[i].position, self.world.task[i + 1].position
        families = ladder.family[k], ladder.family[j]
        free = shapely.union(ladder.component[k], ladder.component[j])
        flat = FlatPolygon.from_shapely(free)
        if segment_inside(flat.vertices, flat.starts, a[0], a[1], b[0], b[1]):
            rows = self._leg(i, here, a, b, start, end, *families)
            if rows is not None:
                return rows
        shared = ladder.component[k] & ladder.component[j]
        over = _handover(shared, a, b)
        to_over = self._drive(ladder.component[k], a, over)
        from_over = self._drive(ladder.component[j], over, b)
        rows = []
        legs = [(p, q, start, start, families[0], families[0]) for p, q in _pairs(to_over)]
        legs.append((over, over, start, end, *families))
        legs += [(p, q, end, end, families[1], families[1]) for p, q in _pairs(from_over)]
        for leg in legs:
            part = self._leg(i, here, *leg)
            if part is None:
                return None
            rows += part
            here = rows[-1].pose if rows else here
        return rows

    def transit(self, here: Pose, there: Pose, piece: int, setpoint: int) -> list[Row]:
        """Drive over free floor with the tool lifted and the arm in its carry posture."""
        robot = self.world.robot
        a, b = axis_of(robot, here.base), axis_of(robot, there.base)
        near = float(np.hypot(*(b - a))) <= 2 * self.world.rules.step
        path = self._drive(self.side.pieces[piece], a, b)
        if near and len(path) == 2:
            return self._carry(here, there, path, setpoint)
        lifted = Pose(here.base, _carried(robot.carry, here.joints))
        lowered = Pose(there.base, _carried(robot.carry, there.joints))
        rows = self._carry(here, lifted, np.array([a, a]), setpoint)
        rows.append(Row(lifted, "transit", setpoint))
        rows += self._carry(lifted, lowered, path, setpoint)
        rows.append(Row(lowered, "transit", setpoint))
        return rows + self._carry(lowered, there, np.array([b, b]), setpoint)

    def _drive(self, free: BaseGeometry, a: Array, b: Array) -> Array:
        """Base path from a to b inside a polygon; counts the method used."""
        # Ends may lie outside by rounding, or by the gap between the exact and the inner area.
        spots = [_into(free, a), _into(free, b)]
        if np.hypot(*(spots[1] - spots[0])) < 1e-9:
            return np.array([a, b])
        found = drive(free, spots[0], spots[1], step=self.world.rules.step, seed=self.seed)
        self.methods[found.method] = self.methods.get(found.method, 0) + 1
        points = np.array(found.points)
        points[0], points[-1] = a, b
        return points

    def _leg(
        self, i: int, here: Pose, a: Array, b: Array, start: Array, end: Array, first: Family, last: Family
    ) -> list[Row] | None:
        """Axis from a to b while the tool goes from start to end; the arm solved at every state."""
        far = max(np.hypot(*(b - a)), float(np.linalg.norm(end - start)))
        stride = min(TOOL_STRIDE, self.world.rules.step)
        shares = np.linspace(0.0, 1.0, max(1, int(np.ceil(far / stride))) + 1)[1:]
        rows: list[Row] = []
        done = 0.0
        base = solver_for(self.world, first)
        pitches = np.array([first.pitch, first.pitch + kernels.wrap(last.pitch - first.pitch)])

        def pose_at(share: float, near: Pose) -> Pose | None:
            pitch = float(pitches @ (1 - share, share))
            solver = replace(
                base,
                tolerance=base.tolerance * SOLVE_TOLERANCE,
                family=replace(first, pitch=pitch),
            )
            return _solve_near(solver, a + share * (b - a), start + share * (end - start), near)

        def advance(share: float, depth: int) -> bool:
            nonlocal here, done
            there = pose_at(share, here)
            chord = start + done * (end - start), start + share * (end - start)
            if there is not None and self._holds(here, there, *chord):
                here, done = there, share
                rows.append(Row(there, "step", i))
                return True
            return depth < DEEPEST and advance((done + share) / 2, depth + 1) and advance(share, depth + 1)

        return rows if all(advance(float(share), 0) for share in shares) else None

    def _holds(self, here: Pose, there: Pose, p: Array, q: Array) -> bool:
        """Whether the tool stays by the segment pq between two states, and nothing jumps."""
        if np.hypot(*(there.base - here.base)[:2]) > self.world.rules.step:
            return False
        if np.abs(there.joints - here.joints).max() > LARGEST_BEND:
            return False
        if abs(kernels.wrap(there.base[2] - here.base[2])) > LARGEST_BEND:
            return False
        shares = np.array([0.25, 0.5, 0.75])[:, None]
        base = here.base + shares * _turn_to(here.base, there.base)
        joints = here.joints + shares * (there.joints - here.joints)
        tools = self.world.robot.tool(base, joints)[:, :3, 3]
        along = shares * (q - p) + p
        worst = float(np.linalg.norm(tools - along, axis=1).max())
        return worst <= SAG_SHARE * self.world.rules.path_tolerance

    def _carry(self, here: Pose, there: Pose, path: Array, setpoint: int) -> list[Row]:
        """States strictly between two poses: axis along a path, heading and joints spread over it."""
        robot = self.world.robot
        turn = _turn_to(here.base, there.base)[2]
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
        rows = []
        for share in shares:
            at = share * lengths[-1]
            axis = np.array([np.interp(at, lengths, points[:, d]) for d in (0, 1)])
            if lengths[-1] == 0:
                axis = points[0]
            base = pose_of(robot, axis, here.base[2] + share * turn)
            rows.append(
                Row(Pose(base, here.joints + share * (there.joints - here.joints)), "transit", setpoint)
            )
        return rows


def _solve_near(solver: Solver, axis: Array, target: Array, near: Pose) -> Pose | None:
    """Pose with the arm axis on a spot and the tool on target, as near as may be to another pose.

    FABRIK from the near posture first; where its passes stall or jump, the posture of least change.
    """
    base = pose_of(solver.robot, axis, near.base[2])
    found = solver.hold(target, base, near.joints)
    if found.converged and np.abs(found.joints - near.joints).max() <= LARGEST_BEND / 2:
        return Pose(found.base, found.joints)
    nearest = solver.least_change(target, base, near.joints)
    return None if nearest is None else _pose(nearest)


def _handover(shared: BaseGeometry, a: Array, b: Array) -> Array:
    """Place in the shared area nearest to the way from a to b, a little inside where there is room."""
    inside = shared.buffer(-0.002)
    goal = shared if inside.is_empty else inside
    return np.array(shapely.shortest_line(goal, LineString([a, b])).coords[0])


def _into(free: BaseGeometry, spot: Array) -> Array:
    """The spot, or the nearest point of the polygon."""
    point = Point(spot)
    if free.covers(point):
        return spot
    return np.array(shapely.shortest_line(free, point).coords[0])


def _pairs(points: Array) -> list[tuple[Array, Array]]:
    return list(zip(points[:-1], points[1:], strict=True))


def _turn_to(here: Array, there: Array) -> Array:
    """Base difference, yaw the shorter way."""
    step = there - here
    return np.array([step[0], step[1], kernels.wrap(step[2])])


def _carried(carry: Array, joints: Array) -> Array:
    """Carry posture with the pivot left where it is, so that the arm folds in its own plane."""
    q = np.array(carry)
    q[0] = joints[0]
    return q


def _pose(configuration: Configuration) -> Pose:
    return Pose(configuration.base, configuration.joints)


def _arrive(world: World, i: int, pose: Pose, goal: Configuration) -> Configuration:
    """The configuration as the motion reaches it; iterations stay those of M-FABRIK."""
    tool = world.robot.tool(pose.base, pose.joints)[:3, 3]
    error = float(np.linalg.norm(tool - world.task[i].position))
    return Configuration(pose.base, pose.joints, error, goal.iterations, error <= world.rules.tolerance)


def _columns(rows: list[Row]) -> Motion:
    return Motion(
        base=np.array([row.pose.base for row in rows]),
        joints=np.array([row.pose.joints for row in rows]),
        kind=np.array([row.kind for row in rows]),
        setpoint=np.array([row.setpoint for row in rows], dtype=np.int64),
        time=np.full(len(rows), np.nan),
    )
