"""Paths of tool poses through the set-points, so dense that the tool stays on its path between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from regionik.planners.driving.pitch_arm import HeightError, PitchArm, arm_share, pitch_arm
from regionik.planners.driving.pose_tracking import TrackedRun, start_headings, track_runs
from regionik.postures.poses import LARGEST_BEND
from regionik.worlds.arrays import Array
from regionik.worlds.drives import DifferentialDrive
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Target, World

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
