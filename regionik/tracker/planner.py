"""Plans by Xu's tracker: a differential base and a pitch arm follow set-points of full orientation.

Every pose is met in closed form, so that only the heading of the base at the first pose and the elbow are
searched, until `verify` finds a plan valid. That choice alone keeps clear of solids; the tracker avoids
nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import shapely
from scipy.spatial.transform import Rotation
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import ground_of
from regionik.explain.failures import invalid_plan
from regionik.explain.sentences import no_way_to, setpoint_at
from regionik.mfabrik import axis_of
from regionik.planners.driving.footprint import FootprintScene, footprint_scene
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.driving.pose_planner import drive_differential
from regionik.planners.driving.pose_tracking import (
    HeightError,
    PitchArm,
    TrackedRun,
    arm_share,
    pitch_arm,
    start_headings,
    track_runs,
)
from regionik.postures.poses import LARGEST_BEND, Pose, Row, columns, figures, lift_offs
from regionik.values import Configuration, Motion, Plan, PlannedArea, Report
from regionik.verification.verifier import verify
from regionik.worlds.arrays import Array
from regionik.worlds.drives import DifferentialDrive
from regionik.worlds.errors import Cause, Explanation, NoPlanFound
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Target, World

Progress = Callable[[str, int, int], None]

DRAWN = 0.005  # half the drawn width of the curves that the axis may stand on [m]


def follows(world: World) -> bool:
    """True if the tracker can plan a world: wheels, a pitch arm ahead of them, and full orientations."""
    full = all(target.orientation is not None for target in world.task)
    return full and arm_of(world.robot) is not None


def follow(world: World, seed: int, progress: Progress) -> Plan:
    """Plan a world that the tracker can plan (`follows`).

    Raises
    ------
    NoPlanFound
        When a height is out of reach, or no heading of the base at the first set-point leads to a valid plan.
    """
    arm = arm_of(world.robot)
    assert arm is not None, "asked of a world that the tracker follows"
    progress("tracker", 0, 0)
    rejected = _Rejected(world)
    joiner = _RunJoiner(world, seed)
    try:
        for k, found in enumerate(tracked_paths(world, arm)):
            progress("tracker", k, 0)
            try:
                motion = joiner.motion(found)
            except NoPathError as error:
                rejected.no_way.append(str(error))
                continue
            made = _plan_of(world, seed, arm, motion, joiner.methods(found))
            report = verify(made)
            if report.ok:
                return replace(made, stats={**made.stats, "margins": report.margins})
            rejected.reports.append(report)
    except HeightError as error:
        raise NoPlanFound(_out_of_reach(world, error)) from None
    raise NoPlanFound(rejected.explanation())


@dataclass(frozen=True, eq=False)
class _RunJoiner:
    """Joins runs to one motion; between two the tool is lifted and the base driven."""

    world: World
    seed: int

    def motion(self, found: TrackedPath) -> Motion:
        """States of all runs and of the drives to them; raises NoPathError."""
        start, rows, k = self.world.start, [], 0
        here = None if start is None else Pose(start.base, start.joints)
        if here is not None:
            rows.append(Row(here, "transit", -1))
        for run in found.runs:
            poses = [Pose(base, joints) for base, joints in zip(run.base, run.joints, strict=True)]
            if here is not None:
                rows += [Row(pose, "transit", -1) for pose in self._between(here, poses[0])]
            for pose in poses:
                rows.append(Row(pose, "setpoint" if found.path.exact[k] else "step", found.path.owner[k]))
                k += 1
            here = poses[-1]
        if start is not None and same(start.base, start.joints, rows[1].pose.base, rows[1].pose.joints):
            del rows[0]
        return columns(rows)

    def methods(self, found: TrackedPath) -> dict[str, int]:
        """Steps tracked and drives between runs."""
        drives = len(found.runs) - (self.world.start is None)
        return {"tracker": sum(len(run.base) - 1 for run in found.runs)} | (
            {"drive": drives} if drives else {}
        )

    def _between(self, here: Pose, there: Pose) -> list[Pose]:
        """States between two poses with the tool lifted: fold the arm, drive, and unfold it."""
        if same(here.base, here.joints, there.base, there.joints):
            return []
        carry = self.world.robot.carry
        way = drive_differential(self._room, here.base, there.base, seed=self.seed)
        driven = [Pose(base, carry) for base in way.sample(self.world.rules.step * 0.999)]
        unfolded = _bent(Pose(there.base, carry), there)
        return [*_bent(here, driven[0]), *driven[:-1], *unfolded[:-1]]

    @property
    def _room(self) -> FootprintScene:
        ground, robot = ground_of(self.world), self.world.robot
        return footprint_scene(robot.footprint, ground.floor, ground.shadows, self.world.rules.clearance)


def _bent(here: Pose, there: Pose) -> list[Pose]:
    """States after the first up to the second, the base at rest."""
    change = there.joints - here.joints
    n = max(1, int(np.ceil(np.abs(change).max() / LARGEST_BEND)))
    return [Pose(here.base, here.joints + k / n * change) for k in range(n + 1)][1:]


def _plan_of(world: World, seed: int, arm: PitchArm, motion: Motion, methods: dict[str, int]) -> Plan:
    at = np.flatnonzero(motion.kind == "setpoint")
    tools = world.robot.tool(motion.base[at], motion.joints[at])[:, :3, 3]
    found = tuple(
        Configuration(
            motion.base[k], motion.joints[k], float(np.linalg.norm(tool - target.position)), 0, True
        )
        for k, tool, target in zip(at.tolist(), tools, world.task, strict=True)
    )
    free = shapely.union_all(ground_of(world).inner.pieces)
    areas = tuple(
        _area(world, arm, target, free, axis_of(world.robot, one.base))
        for target, one in zip(world.task, found, strict=True)
    )
    stats = figures(world.robot.drive, found, motion, methods)
    return Plan(world, seed, found, motion, areas, lift_offs(motion), (), stats)


def _area(world: World, arm: PitchArm, target: Target, free: BaseGeometry, axis: Array) -> PlannedArea:
    """Positions of the axis for a set-point: curves and points, drawn `DRAWN` to either side.

    Under an upright tool a circle for each elbow, under a leaning one a point. The area for the whole path is
    the point that the plan takes.
    """
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = target.orientation, target.position
    lower, upper = world.robot.chain.lower - SAME, world.robot.chain.upper + SAME
    curves = []
    for elbow in (1, -1):
        for facing in (1, -1):
            share = arm_share(arm, T, float(world.robot.mount[2]), elbow=elbow, facing=facing)
            if (share.joints < lower[1:4]).any() or (share.joints > upper[1:4]).any():
                continue
            if share.upright:
                ring = Point(T[:2, 3])
                curves.append(
                    ring.buffer(abs(share.out) + DRAWN, 64) - ring.buffer(abs(share.out) - DRAWN, 64)
                )
            else:
                way = np.array([np.cos(share.turn), np.sin(share.turn)])
                curves.append(Point(T[:2, 3] - share.out * way).buffer(DRAWN))
    reach, taken = shapely.union_all(curves), Point(axis).buffer(DRAWN)
    return PlannedArea((reach & free) | taken, taken, reach - free - taken)


def _out_of_reach(world: World, error: HeightError) -> Explanation:
    """Explanation of a height that the arm does not attain."""
    i = error.index
    nearest = error.low if error.height < error.low else error.high
    off, which = abs(nearest - error.height), "low" if error.height < error.low else "high"
    low, high, asked, missing = (
        f"{1000 * value:.2f}" for value in (error.low, error.high, error.height, off)
    )
    who = setpoint_at(world.task, i)
    reason = (
        f"{no_way_to(who)}: with this very tool direction and its last joint at zero, as the tracker "
        f"keeps it, the arm attains heights of {low} to {high} mm, wherever the base stands; {asked} mm is "
        f"asked for, {missing} mm too {which}. Other postures are not ruled out."
    )
    return Explanation("undecided", i, reason, (Cause("reach", world.robot.name, off),))


@dataclass(frozen=True, eq=False)
class _Rejected:
    """Paths that gave no valid plan, and why."""

    world: World
    reports: list[Report] = field(default_factory=list)
    no_way: list[str] = field(default_factory=list)

    def explanation(self) -> Explanation:
        """First violation of the plan that stays valid for longest, or the first drive without a path."""
        tried = len(self.reports) + len(self.no_way)
        many = (
            f"{tried} ways to follow the set-points were tried, from all headings of the base and both elbows"
        )
        if self.reports:
            first = [min(report.violations, key=lambda v: v.state or 0) for report in self.reports]
            farthest = max(first, key=lambda violation: violation.state or 0)
            told = invalid_plan(self.world, [farthest])
            return replace(told, reason=f"{many}. Of the one that goes farthest: {farthest.text}.")
        if self.no_way:
            return Explanation("ladder-broken", 0, f"{many}. {self.no_way[0]}.", (Cause("floor", "floor"),))
        reason = (
            "No way was found to follow the set-points: from all headings of the base and both elbows that "
            "were tried some joint leaves its limits."
        )
        return Explanation("no-posture", None, reason, (Cause("limits", self.world.robot.name),))


FINEST = 6  # halvings of the segment between two set-points at most
SAME = 1e-9  # [rad] or [m]


@dataclass(frozen=True, eq=False)
class PosePath:
    """Poses of the tool: all set-points, and some between.

    Attributes
    ----------
    poses : list of (4, 4) arrays
    owner : list of int
        The set-point, or the one before a pose between.
    exact : list of bool
        True for a set-point.
    """

    poses: list[Array]
    owner: list[int]
    exact: list[bool]


@dataclass(frozen=True, eq=False)
class TrackedPath:
    """Runs that follow the poses of a path, the tool lifted between them; empty where none can."""

    path: PosePath
    runs: tuple[TrackedRun, ...]


def arm_of(robot: Robot) -> PitchArm | None:
    """Pitch arm of a robot that the tracker can plan for, straight ahead of two driven wheels; else None."""
    x, y, _, yaw = robot.mount
    if not isinstance(robot.drive, DifferentialDrive) or x <= 0 or y != 0 or yaw != 0:
        return None
    return pitch_arm(robot.chain)


def tracked_paths(world: World, arm: PitchArm) -> Iterator[TrackedPath]:
    """Yield paths from all headings of the base and both elbows: fewest lift-offs first, then least travel.

    A new run begins where a joint would leave its limits; starts from which no runs follow are left out.

    Raises
    ------
    HeightError
        With the index of the set-point, or of the one before.
    """
    first, lift = _pose(world.task[0]), float(world.robot.mount[2])
    given = () if world.start is None else (float(world.start.base[2]),)
    starts = [
        (heading, elbow)
        for elbow in (1, -1)
        if _within_limits(world, arm, elbow)
        for heading in (*given, *start_headings(arm, first, lift, elbow))
    ]
    for most in (1.0, np.inf):
        found = [_tracked(world, arm, *start, most) for start in starts]
        yield from sorted((one for one in found if one.runs), key=lambda one: _cost(world, one))
        starts = [start for start, one in zip(starts, found, strict=True) if not one.runs]


def _cost(world: World, found: TrackedPath) -> tuple[int, float]:
    """Number of drives with the tool lifted, and travel of the faster wheel besides [m]."""
    start, first = world.start, found.runs[0]
    away = start is not None and not same(start.base, start.joints, first.base[0], first.joints[0])
    ways = (np.abs(run.wheels(world.robot.gauge)).max(1).sum() for run in found.runs)
    return len(found.runs) + away, float(sum(ways))


def same(base: Array, joints: Array, other: Array, others: Array) -> bool:
    """True if two states of the robot are the same."""
    return bool(max(np.abs(base - other).max(), np.abs(joints - others).max()) <= SAME)


def _within_limits(world: World, arm: PitchArm, elbow: int) -> bool:
    """True if shoulder and elbow are within limits at all set-points, the arm facing them or not."""
    chain, lift = world.robot.chain, float(world.robot.mount[2])
    for k, target in enumerate(world.task):
        shares = [arm_share(arm, _pose(target), lift, k, elbow=elbow, facing=facing) for facing in (1, -1)]
        joints = np.array([share.joints[:2] for share in shares])
        if not ((joints >= chain.lower[1:3] - SAME) & (joints <= chain.upper[1:3] + SAME)).all(1).any():
            return False
    return True


def _tracked(world: World, arm: PitchArm, heading: float | None, elbow: int, most: float) -> TrackedPath:
    """Runs along a path whose segments are halved until the motion between poses keeps the rules."""
    robot, parts = world.robot, [1] * len(world.task)
    for _ in range(FINEST):
        path = _path(world.task, parts)
        try:
            runs = track_runs(
                arm,
                path.poses,
                ahead=float(robot.mount[0]),
                lift=float(robot.mount[2]),
                lower=robot.chain.lower,
                upper=robot.chain.upper,
                heading=heading,
                elbow=elbow,
                most=most,
            )
        except HeightError as error:  # between two set-points: named by the one before
            raise HeightError(path.owner[error.index], error.height, error.low, error.high) from None
        coarse = {path.owner[k] for k in _coarse_poses(world, path, runs)} if runs else set()
        if not coarse:
            break
        parts = [2 * n if i in coarse else n for i, n in enumerate(parts)]
    return TrackedPath(path, runs)


def _path(task: tuple[Target, ...], parts: list[int]) -> PosePath:
    """Path with the segment after each set-point in a number of parts, turned evenly."""
    poses, owner = [_pose(task[0])], [0]
    for i, (a, b) in enumerate(pairwise(task)):
        here, there = _pose(a), _pose(b)
        turn = Rotation.from_matrix(here[:3, :3].T @ there[:3, :3]).as_rotvec()
        for k in range(1, parts[i]):
            s, T = k / parts[i], np.eye(4)
            T[:3, :3] = here[:3, :3] @ Rotation.from_rotvec(s * turn).as_matrix()
            T[:3, 3] = here[:3, 3] + s * (there[:3, 3] - here[:3, 3])
            poses.append(T)
        poses.append(there)
        owner += [i] * (parts[i] - 1) + [i + 1]
    exact = [k == 0 or i != owner[k - 1] for k, i in enumerate(owner)]
    return PosePath(poses, owner, exact)


def _pose(target: Target) -> Array:
    """Homogeneous transform (4, 4) of a set-point."""
    T = np.eye(4)
    assert target.orientation is not None, "the tracker needs full orientations"
    T[:3, :3], T[:3, 3] = target.orientation, target.position
    return T


def _coarse_poses(world: World, path: PosePath, runs: tuple[TrackedRun, ...]) -> list[int]:
    """Indices of poses up to whose next the robot moves too far, or the tool leaves its path."""
    rules, robot = world.rules, world.robot
    base, joints = (np.concatenate([getattr(run, part) for run in runs]) for part in ("base", "joints"))
    poses = np.array(path.poses)
    bend, move = np.diff(joints, axis=0), np.diff(poses, axis=0)
    cone = min(target.cone for target in world.task)
    arc = np.concatenate([run.length for run in runs])[1:]
    coarse = (np.abs(arc) > rules.step) | (np.abs(bend) > LARGEST_BEND).any(1)
    for s in (0.25, 0.5, 0.75):
        tool = robot.tool(robot.drive.between(base[:-1], base[1:], s), joints[:-1] + s * bend)
        off = np.linalg.norm(tool - poses[:-1] - s * move, axis=1)
        coarse |= (off[:, 3] > rules.path_tolerance / 2) | (off[:, 2] > cone / 2)
    coarse[np.cumsum([len(run.base) for run in runs])[:-1] - 1] = False  # there the tool is lifted
    return np.flatnonzero(coarse).tolist()
