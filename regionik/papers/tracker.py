"""Plans by Xu's tracker: a differential base and a pitch arm follow set-points of full orientation.

Every pose is met in closed form, so that only the heading of the base at the first pose and the elbow are
searched, until `verify` finds a plan valid. That choice alone keeps clear of solids; the tracker avoids
nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from regionik.explain.constraints import no_way_to, setpoint_at
from regionik.explain.failures import invalid_plan
from regionik.papers.options import PAPERS
from regionik.papers.pitch_arm import HeightError, arm_share, pitch_arm
from regionik.papers.pose_tracking import TrackedRun, TrackingRobot, start_headings, track_runs
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.driving.pose_planner import drive_wheeled
from regionik.planners.progress import tell
from regionik.postures.arm import goals_between
from regionik.postures.poses import (
    MAX_JOINT_CHANGE,
    MotionState,
    Pose,
    arm_states,
    axis_of,
    lift_offs,
    motion_stats,
    untimed_motion,
)
from regionik.scene import Scene
from regionik.values import Configuration, Motion, Plan, PlannedArea, Report
from regionik.verification.verifier import verify
from regionik.worlds.arrays import Array
from regionik.worlds.drives import DifferentialDrive, wheel_travel
from regionik.worlds.errors import Cause, Explanation, NoPlanFound
from regionik.worlds.robot import Robot, with_joint_margin
from regionik.worlds.scene import Target

OPTIONS = PAPERS.tracker

SAME = 1e-9  # [rad] or [m]
# That the pivot, which may stand there for long, keeps off its limits: smooth motions overshoot [rad]
OFF_LIMITS = 1e-3


def can_track(scene: Scene) -> bool:
    """True if the tracker can plan a world: wheels, a pitch arm ahead of them, and full orientations."""
    full = all(target.orientation is not None for target in scene.task)
    return full and tracking_robot(scene.robot) is not None


def tracking_robot(robot: Robot) -> TrackingRobot | None:
    """Robot as the tracker sees it: a pitch arm straight ahead of two driven wheels; None for any other."""
    x, y, lift, yaw = robot.mount.tolist()
    if not isinstance(robot.drive, DifferentialDrive) or x <= 0 or y != 0 or yaw != 0:
        return None
    arm, chain = pitch_arm(robot.chain), robot.chain
    off = OFF_LIMITS * (np.arange(chain.dof) == 0)
    return None if arm is None else TrackingRobot(arm, x, lift, chain.lower + off, chain.upper - off)


def plan_tracked(scene: Scene, seed: int) -> Plan:
    """Plan a world that the tracker can plan (`can_track`).

    Raises NoPlanFound when a height is out of reach, or no heading of the base at the first set-point leads
    to a valid plan.
    """
    robot = tracking_robot(with_joint_margin(scene.robot, scene.rules.criteria))
    assert robot is not None, "asked of a world that the tracker can plan"
    tell("tracker", 0, 0)
    reports, no_way = list[Report](), list[str]()
    try:
        for k, found in enumerate(tracked_paths(scene, robot)):
            tell("tracker", k, 0)
            try:
                made = _plan_of(scene, seed, robot, found)
            except NoPathError as error:
                no_way.append(str(error))
                continue
            report = verify(made)
            if report.ok:
                return replace(made, stats={**made.stats, "margins": report.margins})
            reports.append(report)
    except HeightError as error:
        raise NoPlanFound(_out_of_reach(scene, error)) from None
    raise NoPlanFound(_none_holds(scene, reports, no_way))


def _motion_of(scene: Scene, seed: int, path: TrackedPath) -> Motion:
    """States of all runs and of the drives to them, with the tool lifted; raises NoPathError."""
    start, states, k = scene.start, list[MotionState](), 0
    here = None if start is None else Pose(start.base, start.joints)
    if here is not None:
        states.append(MotionState(here, "transit", -1))
    for run in path.runs:
        poses = [Pose(base, joints) for base, joints in zip(run.base, run.joints, strict=True)]
        if here is not None:
            states += [MotionState(pose, "transit", -1) for pose in _lifted(scene, seed, here, poses[0])]
        for pose in poses:
            reached = k == 0 or path.owner[k] != path.owner[k - 1]
            states.append(MotionState(pose, "setpoint" if reached else "step", path.owner[k]))
            k += 1
        here = poses[-1]
    if start is not None and same(start.base, start.joints, states[1].pose.base, states[1].pose.joints):
        del states[0]
    return untimed_motion(states)


def _lifted(scene: Scene, seed: int, here: Pose, there: Pose) -> list[Pose]:
    """States between two poses with the tool lifted: fold the arm, drive, and unfold it."""
    if same(here.base, here.joints, there.base, there.joints):
        return []
    carry = scene.robot.carry
    room, planner = scene.footprint_between(here.base, there.base), scene.rules.base_planner
    way = drive_wheeled(room, here.base, there.base, seed=seed, planner=planner)
    driven = [Pose(base, carry) for base in way.sample(scene.rules.step * 0.999)]
    folded = Pose(there.base, carry)
    return [*arm_states(here, driven[0]), *driven[:-1], folded, *arm_states(folded, there)]


def _plan_of(scene: Scene, seed: int, robot: TrackingRobot, path: TrackedPath) -> Plan:
    motion = _motion_of(scene, seed, path)
    methods = {"tracker": sum(len(run.base) - 1 for run in path.runs)}
    if drives := len(path.runs) - (scene.start is None):
        methods["drive"] = drives
    at = np.flatnonzero(motion.kind == "setpoint")
    tools = scene.robot.tool(motion.base[at], motion.joints[at])[:, :3, 3]
    misses = tools - [target.position for target in scene.task]
    found = tuple(
        Configuration(motion.base[k], motion.joints[k], float(np.linalg.norm(miss)), 0, True)
        for k, miss in zip(at.tolist(), misses, strict=True)
    )
    free = shapely.union_all(scene.ground.inner.pieces)
    areas = tuple(
        _area(robot, target, free, axis_of(scene.robot, one.base))
        for target, one in zip(scene.task, found, strict=True)
    )
    stats = motion_stats(scene.robot.drive, found, motion, methods)
    return Plan(scene.world, seed, found, motion, areas, lift_offs(motion), (), stats)


def _area(robot: TrackingRobot, target: Target, free: BaseGeometry, axis: Array) -> PlannedArea:
    """Positions of the axis for a set-point: curves and points, drawn a little to either side.

    Under an upright tool a circle for each elbow, under a leaning one a point. The area for the whole path is
    the point that the plan takes.
    """
    T = tool_frame(target)
    curves = []
    for elbow in (1, -1):
        for facing in (1, -1):
            share = arm_share(robot.arm, T, robot.lift, elbow=elbow, facing=facing)
            if not _holds(robot, share.joints):
                continue
            if share.upright:
                middle, out, wide = Point(T[:2, 3]), abs(share.out), OPTIONS.drawn_width
                curves.append(middle.buffer(out + wide, 64) - middle.buffer(out - wide, 64))
            else:
                way = np.array([np.cos(share.turn), np.sin(share.turn)])
                curves.append(Point(T[:2, 3] - share.out * way).buffer(OPTIONS.drawn_width))
    reach, taken = shapely.union_all(curves), Point(axis).buffer(OPTIONS.drawn_width)
    return PlannedArea((reach & free) | taken, taken, reach - free - taken)


def _out_of_reach(scene: Scene, error: HeightError) -> Explanation:
    below = error.height < error.low
    off = error.low - error.height if below else error.height - error.high
    low, high, asked, missing = (1000 * value for value in (error.low, error.high, error.height, off))
    reason = (
        f"{no_way_to(setpoint_at(scene.task, error.index))}: with this very tool direction and its last "
        f"joint at zero, as the tracker keeps it, the arm attains heights of {low:.2f} to {high:.2f} mm, "
        f"wherever the base stands; {asked:.2f} mm is asked for, {missing:.2f} mm too "
        f"{'low' if below else 'high'}. Other postures are not ruled out."
    )
    return Explanation("undecided", error.index, reason, (Cause("reach", scene.robot.name, off),))


def _none_holds(scene: Scene, reports: Sequence[Report], no_way: Sequence[str]) -> Explanation:
    """First violation of the plan that stays valid for longest, or the first drive without a path."""
    tried = len(reports) + len(no_way)
    many = f"{tried} ways to follow the set-points were tried, from all headings of the base and both elbows"
    if reports:
        first = [min(report.violations, key=lambda v: v.state or 0) for report in reports]
        farthest = max(first, key=lambda violation: violation.state or 0)
        told = invalid_plan(scene.world, [farthest])
        return replace(told, reason=f"{many}. Of the one that goes farthest: {farthest.text}.")
    if no_way:
        return Explanation("ladder-broken", 0, f"{many}. {no_way[0]}.", (Cause("floor", "floor"),))
    reason = (
        "No way was found to follow the set-points: from all headings of the base and both elbows that "
        "were tried some joint leaves its limits."
    )
    return Explanation("no-posture", None, reason, (Cause("limits", scene.robot.name),))


@dataclass(frozen=True, eq=False)
class TrackedPath:
    """Runs through set-points and poses between, the tool lifted between runs; empty where none can."""

    owner: list[int]  # of each pose: the set-point, or the one before a pose between
    runs: tuple[TrackedRun, ...]


def tracked_paths(scene: Scene, robot: TrackingRobot) -> Iterator[TrackedPath]:
    """Yield paths from all headings of the base and both elbows: fewest lift-offs first, then least travel.

    A new run begins where a joint would leave its limits; starts from which no runs follow are left out.
    Raises HeightError with the index of the set-point, or of the one before.
    """
    given = () if scene.start is None else (float(scene.start.base[2]),)
    starts = [
        (heading, elbow)
        for elbow in (1, -1)
        if _attains_all(scene, robot, elbow)
        for heading in (*given, *start_headings(robot, tool_frame(scene.task[0]), elbow))
    ]
    for most in (1.0, np.inf):
        found = [_tracked(scene, robot, *start, most) for start in starts]
        yield from sorted((one for one in found if one.runs), key=lambda one: _cost(scene, one))
        starts = [start for start, one in zip(starts, found, strict=True) if not one.runs]


def _cost(scene: Scene, path: TrackedPath) -> tuple[int, float]:
    """Number of drives with the tool lifted, and travel of the faster wheel besides [m]."""
    start, first = scene.start, path.runs[0]
    away = start is not None and not same(start.base, start.joints, first.base[0], first.joints[0])
    ways = (np.abs(wheel_travel(run.base, scene.robot.gauge)).max(1).sum() for run in path.runs)
    return len(path.runs) + away, float(sum(ways))


def same(base: Array, joints: Array, other: Array, others: Array) -> bool:
    """True if two states of the robot are the same."""
    return bool(max(np.abs(base - other).max(), np.abs(joints - others).max()) <= SAME)


def _attains_all(scene: Scene, robot: TrackingRobot, elbow: int) -> bool:
    """True if shoulder and elbow are within limits at all set-points, the arm facing them or not."""
    frames = [tool_frame(target) for target in scene.task]
    shares = [
        [arm_share(robot.arm, T, robot.lift, k, elbow=elbow, facing=side) for side in (1, -1)]
        for k, T in enumerate(frames)
    ]
    return all(any(_holds(robot, share.joints[:2]) for share in both) for both in shares)


def _holds(robot: TrackingRobot, joints: Array) -> bool:
    """True if the joints after the pivot, the first so many of them, are within limits."""
    lower, upper = robot.lower[1 : 1 + len(joints)], robot.upper[1 : 1 + len(joints)]
    return bool(((joints >= lower - SAME) & (joints <= upper + SAME)).all())


def _tracked(
    scene: Scene, robot: TrackingRobot, heading: float | None, elbow: int, most: float
) -> TrackedPath:
    """Runs along a path whose segments are halved until the motion between poses keeps the rules."""
    parts = [1] * len(scene.task)
    for _ in range(OPTIONS.max_halvings):
        poses, owner = _path(scene.task, parts)
        try:
            runs = track_runs(robot, poses, heading=heading, elbow=elbow, most=most)
        except HeightError as error:  # between two set-points: named by the one before
            raise HeightError(owner[error.index], error.height, error.low, error.high) from None
        coarse = {owner[k] for k in _coarse_poses(scene, np.array(poses), runs)} if runs else set()
        if not coarse:
            break
        parts = [2 * n if i in coarse else n for i, n in enumerate(parts)]
    return TrackedPath(owner, runs)


def _path(task: tuple[Target, ...], parts: list[int]) -> tuple[list[Array], list[int]]:
    """Poses with the segment after each set-point in a number of parts, turned evenly, and their owners."""
    poses, owner = [tool_frame(task[0])], [0]
    for i, (a, b) in enumerate(pairwise(task)):
        between = goals_between(a, b, np.arange(1, parts[i]) / parts[i])
        poses += [tool_frame(target) for target in (*between, b)]
        owner += [i] * (parts[i] - 1) + [i + 1]
    return poses, owner


def tool_frame(target: Target) -> Array:
    """Homogeneous transform (4, 4) of a set-point."""
    T = np.eye(4)
    assert target.orientation is not None, "the tracker needs full orientations"
    T[:3, :3], T[:3, 3] = target.orientation, target.position
    return T


def _coarse_poses(scene: Scene, poses: Array, runs: tuple[TrackedRun, ...]) -> list[int]:
    """Indices of poses up to whose next the robot moves too far, or the tool leaves its path."""
    rules, robot = scene.rules, scene.robot
    base, joints = (np.concatenate([getattr(run, part) for run in runs]) for part in ("base", "joints"))
    bend, move = np.diff(joints, axis=0), np.diff(poses, axis=0)
    cone = min(target.cone for target in scene.task)
    lifted = np.cumsum([len(run.base) for run in runs])[:-1] - 1  # steps from one run to the next
    slide, arc = robot.drive.parts(base[:-1], base[1:])
    turn = slide[:, 2]
    turn[lifted] = 0.0
    coarse = (np.abs(arc) > rules.step) | (np.abs(bend) > MAX_JOINT_CHANGE).any(1)
    swung = np.abs(np.diff(turn)) > OPTIONS.max_swing
    coarse[:-1] |= swung
    coarse[1:] |= swung
    for s in (0.25, 0.5, 0.75):
        tool = robot.tool(robot.drive.between(base[:-1], base[1:], s), joints[:-1] + s * bend)
        off = np.linalg.norm(tool - poses[:-1] - s * move, axis=1)
        coarse |= (off[:, 3] > rules.planned_path_tolerance / 2) | (off[:, 2] > cone / 2)
    coarse[lifted] = False
    return np.flatnonzero(coarse).tolist()
