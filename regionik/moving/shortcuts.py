"""Shortcuts of a motion with the tool lifted: the base goes a shorter way, then base and arm move at once.

As in Geraerts and Overmars, Creating high-quality paths for motion planning, 2007, between places drawn
anywhere on the motion: straight ones of the whole robot, and partial ones, on which the base or the arm goes
straight, or at another pace, while the other goes as before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from regionik.moving.base_motion import Driver
from regionik.moving.options import MOVING
from regionik.planners.driving.arcs import MAX_TURN_STEP
from regionik.postures.collision_checker import CollisionChecker
from regionik.postures.poses import MAX_JOINT_CHANGE, Pose, arrays, distinct, pose_between
from regionik.scene import Scene
from regionik.worlds.arrays import Array
from regionik.worlds.drives import displacement
from regionik.worlds.limits import Speeds

GOOD_COST_RATIO = 1.02  # times the least way or time, which is short enough
OPTIONS = MOVING.transits
MIN_SAVED_LENGTH = 1e-4  # by a shortcut at least [m]
NEARLY = 0.999  # of how far apart states may be
FILLED = 1e-9  # by which a state may lie beside the motion between others that makes it needless [m], [rad]
SAME_SHARE = 1e-6  # shares of a way or of a hop nearer to each other are one state

Pace = Literal["straight", "even", "kept"]  # straight, along the way as it is at one speed, or as it was
PACE_KINDS: tuple[Pace, ...] = "straight", "even", "kept"
PACES = [(base, arm) for base in PACE_KINDS for arm in PACE_KINDS][:-1]  # all but as it was


class Course(NamedTuple):
    """The motion of base or arm alone."""

    share: Array  # (n,) of the time, from 0 to 1
    rows: Array  # (n, ...) base poses or postures


@dataclass(frozen=True, eq=False)
class Shortcuts:
    """Shortcuts on one piece of the free floor."""

    collision: CollisionChecker  # proves the arm clear
    driver: Driver  # and the base on the floor
    piece: int

    def shorter(self, poses: list[Pose]) -> list[Pose]:
        """Return a clear motion with the same ends whose base goes no farther, or is on wheels."""
        if self.driver.scene.robot.drive.rolls:
            return poses
        rng, failed = np.random.default_rng(self.driver.seed), 0
        least = GOOD_COST_RATIO * travel([poses[0], poses[-1]]) + MIN_SAVED_LENGTH
        u, v = 0.0, len(poses) - 1.0  # the whole first
        for _ in range(OPTIONS.max_shortcuts):
            if failed == OPTIONS.max_failed_shortcuts or travel(poses) <= least:
                break
            found = self._taken(poses, (u, v), PACES[0], travel, MIN_SAVED_LENGTH)
            poses, failed = (poses, failed + 1) if found is None else (found, 0)
            u, v = np.sort(rng.uniform(0, len(poses) - 1, 2)).tolist()
        return poses

    def quicker(self, poses: list[Pose]) -> list[Pose]:
        """Return a clear motion with the same ends that takes no longer, its base on a way no longer."""
        clock = Clock(self.driver.scene)
        rng, failed = np.random.default_rng(self.driver.seed), 0
        enough = GOOD_COST_RATIO * clock.whole([poses[0], poses[-1]]) + OPTIONS.min_saved_time
        for k in range(OPTIONS.max_quicker_shortcuts):
            times = clock.times(poses)
            if failed == OPTIONS.max_failed_quicker or clock.whole(poses) <= enough:
                break
            first = k < len(PACES)  # the whole, at each pace
            span = np.array([0.0, times[-1]]) if first else np.sort(rng.uniform(0, times[-1], 2))
            paces = PACES[k] if first else PACES[rng.integers(len(PACES))]
            u, v = np.interp(span, times, np.arange(len(times))).tolist()
            found = self._taken(poses, (u, v), paces, clock.whole, OPTIONS.min_saved_time)
            poses, failed = (poses, failed + 1) if found is None else (found, 0)
        return poses

    def _taken(
        self,
        poses: list[Pose],
        ends: tuple[float, float],
        paces: tuple[Pace, Pace],
        cost: Callable[[list[Pose]], float],
        saved: float,
    ) -> list[Pose] | None:
        """Return the motion with a shortcut between two places; None without gain or proof."""
        u, v = (round(end) if abs(end - round(end)) < SAME_SHARE else end for end in ends)
        i, j = int(u), int(np.ceil(v))
        here, there = (self._at(poses, end) for end in (u, v))
        states = self._between(distinct([here, *poses[i + 1 : j], there]), *paces)
        if not states:
            return None
        part = self._thinned(distinct([poses[i], *states, poses[j]]))
        whole = [*poses[:i], *part, *poses[j + 1 :]]
        if cost(whole) > cost(poses) - saved or not self.collision.passes(part):
            return None
        return whole

    def _thinned(self, poses: list[Pose]) -> list[Pose]:
        """The motion without states that their neighbours fill in, none farther apart than a plan's may be.

        Else a motion that is merged with another has the states of both, and ever more of them.
        """
        kept = poses[:1]
        for pose, there in pairwise(poses[1:]):
            if not self._fills_in(kept[-1], pose, there):
                kept.append(pose)
        return [*kept, poses[-1]]

    def _fills_in(self, here: Pose, pose: Pose, there: Pose) -> bool:
        """True if a pose is on the motion between two states that are near enough to one another."""
        scene, (start, *to) = self.driver.scene, np.hstack(arrays([here, pose, there]))
        moves = np.array(to) - start
        moves[:, :3] = displacement(start[:3], np.array(to)[:, :3])
        part, whole = moves
        way, turn, bend = float(np.hypot(*whole[:2])), abs(float(whole[2])), float(np.abs(whole[3:]).max())
        stride = max(way / scene.rules.step, turn / MAX_TURN_STEP, bend / MAX_JOINT_CHANGE)
        if stride > NEARLY or not (square := whole @ whole):
            return False
        filled = pose_between(here, there, float(part @ whole / square), scene.robot.drive)
        off = displacement(filled.base, pose.base), filled.joints - pose.joints
        return max(float(np.abs(one).max()) for one in off) <= FILLED

    def _between(self, poses: list[Pose], base: Pace, arm: Pace) -> list[Pose]:
        """Another motion with the same ends, at these paces; none where the base leaves the floor."""
        clock, (bases, joints) = Clock(self.driver.scene), arrays(poses)
        kept = clock.times(poses)
        if base == "straight":
            states = self.driver.direct(poses[0], poses[-1], self.piece)
            if states is None:
                return []
            bases = arrays([poses[0], *states, poses[-1]])[0]
        if arm == "straight":
            joints = joints[[0, -1]]
        drives = Course(_shares(kept if base == "kept" else _sums(clock.base(bases))), bases)
        swings = Course(_shares(kept if arm == "kept" else _sums(clock.arm(joints))), joints)
        return [poses[0], *self._merged(drives, swings)[1:-1], poses[-1]]

    def _merged(self, drives: Course, swings: Course) -> list[Pose]:
        """States of base and arm together, no farther apart than a plan's may be."""
        k = np.clip(np.searchsorted(drives.share, swings.share), 1, len(drives.share) - 1)
        off = np.abs(drives.share[[k - 1, k]] - swings.share).min(axis=0)
        share = np.sort(np.concatenate([drives.share, swings.share[off > SAME_SHARE]]))
        bends = np.abs(np.diff(_rows_at(swings, share), axis=0)).max(axis=1)
        parts = np.maximum(np.ceil(bends / MAX_JOINT_CHANGE * 1.001), 1).astype(int).tolist()
        cuts = [k + np.arange(count) / count for k, count in enumerate(parts)]
        share = np.interp(np.concatenate([*cuts, [len(parts)]]), np.arange(len(share)), share)
        index = np.interp(share, drives.share, np.arange(len(drives.share)))
        bases = self.driver.scene.robot.drive.sampled(drives.rows, index)
        return [Pose(*one) for one in zip(bases, _rows_at(swings, share), strict=True)]

    def _at(self, poses: list[Pose], u: float) -> Pose:
        """Return the pose at a place on a motion."""
        k, drive = int(u), self.driver.scene.robot.drive
        return poses[k] if u == k else pose_between(poses[k], poses[k + 1], u - k, drive)


@dataclass(frozen=True, eq=False)
class Clock:
    """Time of motions at full speed, and of changing it at full acceleration."""

    scene: Scene

    @cached_property
    def _speeds(self) -> Speeds:
        return self.scene.world.speeds or Speeds()

    def base(self, bases: Array) -> Array:
        """Of each hop of the base through poses (n, 3) at full speed, (n - 1,) [s]."""
        slide, rolled = self.scene.robot.drive.parts(bases[:-1], bases[1:])
        way = np.hypot(slide[:, 0], slide[:, 1]) + np.abs(rolled)
        turn: Array = np.abs(slide[:, 2]) / self._speeds.turn_velocity
        return np.maximum(way / self._speeds.base_velocity, turn)

    def arm(self, joints: Array) -> Array:
        """Of each hop of the arm through postures (n, dof) at full speed, (n - 1,) [s]."""
        speed = self._speeds.joint_limits(self.scene.robot.chain)[0]
        return (np.abs(np.diff(joints, axis=0)) / speed).max(axis=1)

    def times(self, poses: list[Pose]) -> Array:
        """When the robot comes to each pose at full speed, (n,) [s]."""
        bases, joints = arrays(poses)
        return _sums(np.maximum(self.base(bases), self.arm(joints)))

    def whole(self, poses: list[Pose]) -> float:
        """Of a motion from rest to rest, half of each jump of its speed made before it and half after [s]."""
        (bases, joints), hops = arrays(poses), np.diff(self.times(poses))
        moves = np.column_stack([displacement(bases[:-1], bases[1:]), np.diff(joints, axis=0)])[hops > 0]
        speed = np.pad(moves / hops[hops > 0, None], ((1, 1), (0, 0)))
        jumps = np.abs(np.diff(speed, axis=0))
        base = np.hypot(jumps[:, 0], jumps[:, 1]) / self._speeds.base_acceleration
        turn = jumps[:, 2] / self._speeds.turn_acceleration
        arm = (jumps[:, 3:] / self._speeds.joint_limits(self.scene.robot.chain)[1]).max(axis=1)
        return float(hops.sum() + np.maximum(np.maximum(base, turn), arm).sum() / 2)


def travel(poses: list[Pose]) -> float:
    """Return the length of the base's path from state to state [m]."""
    places = np.array([pose.base[:2] for pose in poses])
    return float(np.hypot(*np.diff(places, axis=0).T).sum())


def _sums(hops: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(hops)])


def _shares(times: Array) -> Array:
    """Return times as shares of the last one; they are evenly spaced if that is 0."""
    return times / times[-1] if times[-1] > 0 else np.linspace(0, 1, len(times))


def _rows_at(course: Course, share: Array) -> Array:
    """Rows (n, m) at shares of the time, straight between those given."""
    return np.column_stack([np.interp(share, course.share, column) for column in course.rows.T])
