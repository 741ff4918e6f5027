"""Base and arm go on together: the least motion of base and joints that leads the tool on its path.

Where an arm has few joints, the places from which a base of some heading meets a pose lie on a line, which no
lattice of places finds; where it has many, postures found place by place may be of another kind each. Here
the base's motion, its rolling and turning if it is on wheels, is that of more joints. From state to state the
tool's way is resolved into motion of all of them, the least by their speeds; joints that go towards a limit
weigh the more the nearer it is.
Source: Whitney, Resolved motion rate control (1969); Chan and Dubey, A weighted least-norm solution based
scheme for avoiding joint limits (1995).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from regionik.areas.standing import room_for
from regionik.moving.path_following import LOOKED_AT, SAG_SHARE, turned_as_asked
from regionik.planners.driving.arcs import arc_end
from regionik.planners.driving.footprint import arc_is_free, slide_is_free
from regionik.planners.solvers.aims import Aims, in_columns, missed_by
from regionik.postures.arm import aim_of, goal_between
from regionik.postures.arm_guard import Guard
from regionik.postures.poses import LARGEST_BEND, Pose, arrays
from regionik.timing.limits import motion_limits
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target, World
from regionik.worlds.speeds import Speeds

STRIDE = 0.02  # of the tool from state to state [m]
TURN_STRIDE = 0.1  # of its frame [rad]
ROUNDS = 20  # of Newton's method
EXACT = 1e-9  # miss of the tool, angles as lengths [m]
FLAT = 1e-4  # singular values below this part of the largest are left out
NEAREST = 0.999  # share of the way from the middle of a joint's range to its end that weighs most


@dataclass(frozen=True, eq=False)
class ResolvedMotion:
    """Motion of a robot with its tool on the path of a world."""

    world: World
    guard: Guard

    def onward(self, i: int, here: Pose) -> list[Pose] | None:
        """States with the tool on its path from set-point i to the next; None where no such way is free."""
        asked = self._asked(i)
        aims = in_columns([aim_of(target) for target in asked])
        poses = [here]
        for k in range(len(asked)):
            pose = self._next(aims.part(slice(k, k + 1)), poses[-1])
            if pose is None:
                return None
            poses.append(pose)
        return poses[1:] if self._holds([self.world.task[i], *asked], poses) else None

    def _asked(self, i: int) -> list[Target]:
        """Targets at most a stride apart from set-point i to the next, that one the last."""
        a, b = self.world.task[i : i + 2]
        turn = 0.0
        if a.direction is not None and b.direction is not None:
            turn = math.acos(min(max(float(a.direction @ b.direction), -1.0), 1.0))
        count = max(1, math.ceil(math.dist(a.position, b.position) / STRIDE), math.ceil(turn / TURN_STRIDE))
        return [goal_between(a, b, k / count) for k in range(1, count + 1)]

    def _next(self, aim: Aims, here: Pose) -> Pose | None:
        """The state that meets one aim by the least motion; None for none."""
        robot = self.world.robot
        lower, upper, n = robot.chain.lower, robot.chain.upper, self._base_parts
        motion = np.zeros(len(self._speeds))
        for _ in range(ROUNDS):
            pose = self._moved(here, motion)
            miss, J = missed_by(robot, aim, np.concatenate([pose.base, pose.joints])[None])
            if float(np.linalg.norm(miss)) <= EXACT:
                break
            by_base = J[0, :, :3] @ _rolling(here, motion) if robot.drive.rolls else J[0, :, :3]
            by_motion = np.column_stack([by_base, J[0, :, 3:]])
            light = self._lightness(here.joints, motion)
            step = _least_step(by_motion, miss[0], light)
            beyond = ((pose.joints <= lower) & (step[n:] < 0)) | ((pose.joints >= upper) & (step[n:] > 0))
            motion = motion + _least_step(by_motion, miss[0], light * np.append(np.ones(n), ~beyond))
            motion[n:] = np.clip(here.joints + motion[n:], lower, upper) - here.joints
            if robot.drive.turning_radius:
                most = abs(motion[0]) / robot.drive.turning_radius
                motion[1] = min(max(motion[1], -most), most)
        else:
            return None
        bent, driven = float(np.abs(motion[n:]).max()), float(np.linalg.norm(motion[: n - 1]))
        return pose if bent <= LARGEST_BEND and driven <= self.world.rules.step else None

    def _moved(self, here: Pose, motion: Array) -> Pose:
        n = self._base_parts
        base = here.base + motion[:n] if n == 3 else np.array(arc_end(*here.base, *motion[:n]))
        return Pose(base, here.joints + motion[n:])

    def _lightness(self, joints: Array, motion: Array) -> Array:
        """Speeds of what moves, less for joints on their way to a limit."""
        chain = self.world.robot.chain
        ranged = np.isfinite(chain.upper - chain.lower)
        low, high = (np.where(ranged, ends, 0.0) for ends in (chain.lower, chain.upper))
        half = np.where(high > low, (high - low) / 2, 1.0)
        arm = motion[self._base_parts :]
        off = np.where(ranged, joints + arm - (low + high) / 2, 0.0) / half
        near = np.minimum(np.abs(off), NEAREST)
        weight = 1 + np.where(off * arm > 0, near / (1 - near**2) ** 2, 0.0)
        return self._speeds * np.concatenate([np.ones(self._base_parts), 1 / np.sqrt(weight)])

    @cached_property
    def _speeds(self) -> Array:
        """Of the base, x, y and yaw, or what it rolls and turns, and of the joints."""
        limits = motion_limits(self.world.robot, self.world.speeds or Speeds())
        turning = 0.0 if self.world.rules.heading == "fixed" else limits.speeds.turn_velocity
        driving = [limits.speeds.base_velocity] * (self._base_parts - 1)
        return np.array([*driving, turning, *limits.joint_velocity])

    @property
    def _base_parts(self) -> int:
        """Number of coordinates of the base's motion."""
        return 2 if self.world.robot.drive.rolls else 3

    def _holds(self, asked: list[Target], poses: list[Pose]) -> bool:
        """Whether the base's way is free, and the tool led along its path with the arm clear."""
        bases, joints = arrays(poses)
        drive, room, turns = self.world.robot.drive, room_for(self.world), np.diff(bases[:, 2])
        hops = zip(bases[:-1], bases[1:], drive.rolled(bases).tolist(), turns.tolist(), strict=True)
        line = np.array([target.position for target in asked])
        sag = SAG_SHARE * self.world.rules.planned_path_tolerance
        if not all(
            arc_is_free(room, a, rolled, turn) if drive.rolls else slide_is_free(room, a, b)
            for a, b, rolled, turn in hops
        ):
            return False
        if self.guard.led(bases, joints, line, LOOKED_AT, sag) < len(turns):
            return False
        tools = self.guard.tools(bases, joints, LOOKED_AT)
        hops_asked = zip(asked[:-1], asked[1:], tools, strict=True)
        if not all(turned_as_asked(*hop) for hop in hops_asked):
            return False
        return self.guard.proven(bases, joints)[0] == len(turns)


def _least_step(by_motion: Array, miss: Array, light: Array) -> Array:
    """The step (m,) against a miss that is least where each part counts by how light it is."""
    step: Array = light * (np.linalg.pinv(by_motion * light, rcond=FLAT) @ miss)
    return step


def _rolling(here: Pose, motion: Array) -> Array:
    """How x, y and yaw at the end of an arc change with what is rolled and turned, (3, 2)."""
    middle = float(here.base[2] + motion[1] / 2)
    c, s = math.cos(middle), math.sin(middle)
    return np.array([[c, -motion[0] / 2 * s], [s, motion[0] / 2 * c], [0.0, 1.0]])
