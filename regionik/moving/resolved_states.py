"""States with the tool on its path: the least motion of base and joints from a state that lead it there.

Distances of what is near, and of the footprint from the floor's edge, are half-spaces of that motion: links
go round what they would touch. Joints that go towards a limit weigh the more the nearer it is.
Source: Whitney, Resolved motion rate control (1969); Chan and Dubey, A weighted least-norm solution based
scheme for avoiding joint limits (1995); Faverjon and Tournassoud, A local based approach for path planning of
manipulators with a high number of degrees of freedom (1987), whose dampers keep what is near apart.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from regionik.moving.options import MOVING
from regionik.moving.state_constraints import ARM_MARGIN, StateConstraints
from regionik.planners.collision.proximity import NearPairs
from regionik.planners.driving.arcs import arc_end
from regionik.planners.smoothing.quadratic_program import least_weighted
from regionik.planners.solvers.aims import ANGLE_LENGTH, missed_by
from regionik.planners.solvers.damped_least_squares import POSITION, Aims
from regionik.postures.collision_checker import CollisionChecker
from regionik.postures.poses import MAX_JOINT_CHANGE, Pose
from regionik.scene import Scene
from regionik.worlds.arrays import Array
from regionik.worlds.limits import Speeds

OPTIONS = MOVING.solving


class _HalfSpace(NamedTuple):
    """Motions whose ``change`` (m,) of a distance is at least so much."""

    change: Array
    least: float


@dataclass(frozen=True, eq=False)
class ResolvedStates:
    """Finds states of a robot in a world."""

    scene: Scene
    collision: CollisionChecker

    def state(
        self,
        aim: Aims,
        start: Pose,
        still: Sequence[int] = (),
        bend: float = MAX_JOINT_CHANGE,
        wished: Array | None = None,
    ) -> Pose | None:
        """The state that meets one aim by the least motion from a start; None for none.

        Some coordinates of the base's motion stay ``still``; no joint goes farther than ``bend``. What
        redundancy leaves open goes to a ``wished`` motion (m,) of base and joints.
        """
        if self.scene.rules.heading == "face_target":  # which no motion of base and joints together keeps
            return None
        chain, n = self.scene.robot.chain, self.base_parts
        motion, rows = np.zeros(len(self._speeds)), self._floor_rows(start)
        wished = np.zeros(len(motion)) if wished is None else wished
        low, high = np.full((2, len(motion)), [[-np.inf], [np.inf]])
        low[n:] = np.maximum(chain.lower - start.joints, -bend)
        high[n:] = np.minimum(chain.upper - start.joints, bend)
        fixed = self._speeds == 0.0
        fixed[list(still)] = True
        low[fixed] = high[fixed] = 0.0
        cone, missed = ANGLE_LENGTH * float(aim.cones[0]), list[float]()
        led = 3 if cone > 0 or aim.kinds[0] == POSITION else 6  # equations; a cone is a half-space
        for _ in range(OPTIONS.max_newton_steps):
            pose = self._moved(start, motion)
            here = np.concatenate([pose.base, pose.joints])[None]
            (miss,), (J,) = missed_by(self.scene.robot, aim, here)
            turned = float(np.linalg.norm(miss[3:]))
            missed.append(max(math.hypot(*miss[:3], max(turned - cone, 0.0)), OPTIONS.tool_tolerance))
            near, met = None, missed[-1] == OPTIONS.tool_tolerance
            if self.collision.enabled and (met or len(missed) == 1):  # between these those of the first hold
                near = self._constraints.near(here)
            tight = abs(motion[1]) * self.scene.robot.drive.turning_radius > abs(motion[0]) + 1e-12
            if met and (near is None or near.room.min(initial=np.inf) > self.collision.spare) and not tight:
                return pose
            if min(missed[-OPTIONS.max_stalled_steps :]) > min(missed):
                return None
            J = self._by_motion(J, start, motion)
            rows += _cone_rows(miss[3:], J[3:], motion, cone, first=len(missed) == 1)
            rows += [] if near is None else self._near_rows(near, here, start, motion)
            asked = rows + self._arc_rows(motion)
            weight = np.where(fixed, 1.0, self._lightness(start.joints, motion)) ** -2
            step = least_weighted(
                weight, wished, J[:led], miss[:led],
                np.array([row.change for row in asked]).reshape(-1, len(motion)),
                np.array([row.least - row.change @ motion for row in asked]),
                low - motion, high - motion,
            )  # fmt: skip
            if step is None:
                return None
            wished = np.zeros(len(motion))
            motion = np.clip(motion + step, low, high)
        return None

    def _arc_rows(self, motion: Array) -> list[_HalfSpace]:
        """A car turns no more than its steering allows, going on as it goes."""
        radius, ways = self.scene.robot.drive.turning_radius, np.zeros((2, len(motion)))
        if not radius or not motion.any():
            return []
        ways[:, :2] = [[math.copysign(1.0, motion[0]), side * radius] for side in (-1.0, 1.0)]
        return [_HalfSpace(way, 0.0) for way in ways]

    def _by_motion(self, J: Array, start: Pose, motion: Array) -> Array:
        """How the motion changes what states do, (k, m)."""
        by_base = J[:, :3] @ _rolling(start, motion) if self.scene.robot.drive.rolls else J[:, :3]
        return np.column_stack([by_base, J[:, 3:]])

    def _floor_rows(self, start: Pose) -> list[_HalfSpace]:
        """How the footprint may go on towards what it is near to."""
        spaces = self._constraints.on_floor(np.concatenate([start.base, start.joints])[None])
        ways = self._by_motion(spaces.normal, start, np.zeros(len(self._speeds)))
        return [_HalfSpace(*one) for one in zip(ways, np.minimum(spaces.least, 0.0), strict=True)]

    def _near_rows(self, near: NearPairs, here: Array, start: Pose, motion: Array) -> list[_HalfSpace]:
        """How the arm may go on towards what it is near to; most of the way where there is much."""
        room = near.room - self.collision.spare - OPTIONS.spare_clearance
        changes = self._by_motion(self._constraints.approach(near, here), start, motion)
        most = np.maximum(np.maximum(room / 2, room - ARM_MARGIN), 0.0)
        least = np.where(room > -OPTIONS.spare_clearance, -most, -room)
        return [_HalfSpace(*one) for one in zip(changes, (changes @ motion + least).tolist(), strict=True)]

    @cached_property
    def _constraints(self) -> StateConstraints:
        return StateConstraints(
            self.scene.robot, self.collision, self.scene.footprint, np.empty(0, dtype=object), np.zeros(1)
        )

    def _moved(self, here: Pose, motion: Array) -> Pose:
        n = self.base_parts
        base = here.base + motion[:n] if n == 3 else np.array(arc_end(*here.base, *motion[:n]))
        return Pose(base, here.joints + motion[n:])

    def _lightness(self, joints: Array, motion: Array) -> Array:
        """Speeds of what moves, less for joints on their way to a limit."""
        chain = self.scene.robot.chain
        ranged = np.isfinite(chain.upper - chain.lower)
        low, high = (np.where(ranged, ends, 0.0) for ends in (chain.lower, chain.upper))
        half = np.where(high > low, (high - low) / 2, 1.0)
        arm = motion[self.base_parts :]
        off = np.where(ranged, joints + arm - (low + high) / 2, 0.0) / half
        near = np.minimum(np.abs(off), OPTIONS.max_range_share)
        weight = 1 + np.where(off * arm > 0, near / (1 - near**2) ** 2, 0.0)
        return self._speeds * np.concatenate([np.ones(self.base_parts), 1 / np.sqrt(weight)])

    @cached_property
    def _speeds(self) -> Array:
        """Of the base, x, y and yaw, or what it rolls and turns, and of the joints."""
        speeds = self.scene.world.speeds or Speeds()
        turning = 0.0 if self.scene.rules.heading == "fixed" else speeds.turn_velocity
        driving = [speeds.base_velocity] * (self.base_parts - 1)
        return np.array([*driving, turning, *speeds.joint_limits(self.scene.robot.chain)[0]])

    @property
    def base_parts(self) -> int:
        """Number of coordinates of the base's motion."""
        return 2 if self.scene.robot.drive.rolls else 3


def _cone_rows(miss: Array, J: Array, motion: Array, cone: float, first: bool) -> list[_HalfSpace]:
    """The tool's turn stays within a cone: on this side of its edge, and at ``first`` in a box about it."""
    if cone == 0:
        return []
    ways = [*np.eye(3), *-np.eye(3)] if first else []
    ways.append(miss / max(float(np.linalg.norm(miss)), 1e-300))
    return [_HalfSpace(way @ J, float(way @ (J @ motion + miss)) - cone) for way in ways]


def _rolling(here: Pose, motion: Array) -> Array:
    """How x, y and yaw at the end of an arc change with what is rolled and turned, (3, 2)."""
    middle = float(here.base[2] + motion[1] / 2)
    c, s = math.cos(middle), math.sin(middle)
    return np.array([[c, -motion[0] / 2 * s], [s, motion[0] / 2 * c], [0.0, 1.0]])
