"""Robot motion between the states of a plan, and bounds on it that hold between samples.

On a segment from one state to the next the base turns at constant rate the shorter way, and joints move
linearly. An omnidirectional base moves straight; one on wheels rolls along one arc, whose chord has the
heading in the middle of the turn. A point of the robot then has a bounded acceleration a [m per segment^2],
so over a part of the segment of length h it stays within a h^2 / 8 of the chord between the part's ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.values import Motion
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]


class PointBounds(NamedTuple):
    """Upper bounds for points in a frame on every segment, each (..., segments)."""

    distance: Array  # from the frame's origin [m]
    speed: Array  # [m per segment]
    acceleration: Array  # [m per segment^2]


@dataclass(frozen=True, eq=False)
class MotionSegments:
    """All segments of a motion: segment k leads from state k to state k + 1."""

    robot: Robot
    motion: Motion

    def __len__(self) -> int:
        return len(self.motion) - 1

    @cached_property
    def _chord(self) -> Array:
        """Displacement of the base, (segments, 2) [m]."""
        return np.diff(self.motion.base[:, :2], axis=0)

    @cached_property
    def _tangent(self) -> Array:
        """Direction of the heading in the middle of each segment, (segments, 2)."""
        middle = self.motion.base[:-1, 2] + self.turn / 2
        return np.column_stack([np.cos(middle), np.sin(middle)])

    @cached_property
    def rolled(self) -> Array:
        """Arc length the base rolls, negative in reverse, (segments,) [m]; 0 without wheels.

        The chord of an arc of length L and turn w is L sin(w / 2) / (w / 2).
        """
        if not self.robot.drive.rolls:
            return np.zeros(len(self))
        return (self._chord * self._tangent).sum(1) / np.sinc(self.turn / 2 / np.pi)

    @cached_property
    def slide(self) -> Array:
        """Displacement of the base that is not rolled, (segments, 2) [m]; on wheels this is slip."""
        if not self.robot.drive.rolls:
            return self._chord
        across = np.column_stack([-self._tangent[:, 1], self._tangent[:, 0]])
        return (self._chord * across).sum(1)[:, None] * across

    @cached_property
    def base_length(self) -> Array:
        """Length of the base's path, (segments,) [m]."""
        return np.abs(self.rolled) + np.linalg.norm(self.slide, axis=1)

    @cached_property
    def turn(self) -> Array:
        """Turn of the base, the shorter way, half a turn to the left, (segments,) [rad]."""
        return wrap_angle(np.diff(self.motion.base[:, 2]))

    @cached_property
    def joint_change(self) -> Array:
        """Change of every active joint, (segments, dof)."""
        return np.diff(self.motion.joints, axis=0)

    @cached_property
    def _all_joints(self) -> Array:
        """Values of all joints in every state, (states, n): those that mimic others move links too."""
        return self.robot.chain.joint_values(self.motion.joints)

    @cached_property
    def _all_changes(self) -> Array:
        """Change of each of all joints, (segments, n)."""
        return np.diff(self._all_joints, axis=0)

    def base_at(self, segment: Indices, s: Array) -> Array:
        """Base poses at shares s in [0, 1] of segments, (m, 3)."""
        slid = np.column_stack([self.slide[segment], self.turn[segment]])
        pose: Array = self.motion.base[segment] + s[:, None] * slid
        half = s * self.turn[segment] / 2
        chord, middle = s * self.rolled[segment] * np.sinc(half / np.pi), self.motion.base[segment, 2] + half
        pose[:, :2] += chord[:, None] * np.column_stack([np.cos(middle), np.sin(middle)])
        return pose

    def joints_at(self, segment: Indices, s: Array) -> Array:
        """Joint values at shares s in [0, 1] of segments, (m, dof)."""
        return self.motion.joints[segment] + s[:, None] * self.joint_change[segment]

    def frames_at(self, segment: Indices, s: Array) -> Array:
        """Link and tool frames in the world, (m, n + 1, 4, 4)."""
        return self.robot.frames(self.base_at(segment, s), self.joints_at(segment, s))

    def link_pose(self, lower: int, link: int, joints: Array) -> Array:
        """Poses of a link in the frame of a lower link, or of the base (-1), (m, 4, 4)."""
        chain = self.robot.chain
        values = chain.joint_values(joints)
        start = self.robot.T_base_arm if lower < 0 else np.eye(4)
        T = np.broadcast_to(start, (len(joints), 4, 4))
        for k in range(lower + 1, link + 1):
            T = T @ chain.joints[k].T_parent_joint @ chain.joints[k].transform(values[:, k])
        return T

    def acceleration_bound(self, link: int, point: Array) -> Array:
        """Upper bound for the acceleration in the world of a point fixed to a link, (segments,).

        Seen from the base the point has distance r, speed v and acceleration a; the base turns at rate w and
        rolls at speed u along an arc: |acceleration| <= a + w^2 r + 2 w v + u w (centripetal, Coriolis).
        """
        bounds = self.relative_bounds(-1, link, point)
        rate = np.abs(self.turn)
        reach = bounds.distance + float(np.hypot(*self.robot.mount[:2]))
        bound: Array = bounds.acceleration + rate**2 * reach + 2 * rate * bounds.speed
        bound += np.abs(self.rolled) * rate
        return bound

    def relative_bounds(self, lower: int, link: int, point: Array) -> PointBounds:
        """Upper bounds for points (..., 3) fixed to a link, seen from a lower link or the arm's mount (-1).

        Joint by joint from the link down: one that turns at rate w under a point that moves at speed v at a
        distance r from its axis adds w^2 r + 2 w v to the acceleration, and w r to the speed.
        """
        chain = self.robot.chain
        still = np.zeros((*point.shape[:-1], len(self)))
        distance = still + np.linalg.norm(point, axis=-1)[..., None]  # from the joint's origin
        lever = still + np.linalg.norm(np.cross(chain.joints[link].axis, point), axis=-1)[..., None]
        speed, acceleration = still.copy(), still.copy()
        for k in range(link, lower, -1):
            rate = np.abs(self._all_changes[:, k])
            if chain.joints[k].kind == "revolute":
                acceleration += rate**2 * lever + 2 * rate * speed
                speed += rate * lever
            else:
                speed += rate
                ends = np.abs([self._all_joints[:-1, k], self._all_joints[1:, k]])
                distance = distance + ends.max(axis=0)
            distance = distance + float(np.linalg.norm(chain.joints[k].T_parent_joint[:3, 3]))
            lever = distance
        return PointBounds(distance, speed, acceleration)

    @cached_property
    def tool_acceleration_bound(self) -> Array:
        """Upper bound for the acceleration of the tool's position, (segments,) [m per segment^2]."""
        chain = self.robot.chain
        return self.acceleration_bound(len(chain.joints) - 1, chain.T_last_tool[:3, 3])

    @cached_property
    def tool_axis_acceleration_bound(self) -> Array:
        """Upper bound for the second derivative of unit vectors fixed to the tool, (segments,).

        It is the square of the turning rate, at most the sum of the rates of the base and all joints.
        """
        revolute = [joint.kind == "revolute" for joint in self.robot.chain.joints]
        rate: Array = np.abs(self.turn) + np.abs(self._all_changes[:, revolute]).sum(1)
        return rate**2


def wrap_angle(angle: Array) -> Array:
    """Angles brought into (-pi, pi]."""
    wrapped: Array = angle - 2 * np.pi * np.ceil((angle - np.pi) / (2 * np.pi))
    return wrapped


def chord_deviation(acceleration: Array, part: Array) -> Array:
    """Upper bound for a point's distance from its chord over a part of a segment: a h^2 / 8."""
    return acceleration * part**2 / 8
