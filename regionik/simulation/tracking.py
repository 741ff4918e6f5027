"""Tracking of a timed plan by a mobile manipulator whose base is never quite where it should be.

The base follows the plan's speeds and is led back to its way; the arm takes up what the base is off, so that
the tool is where the plan has it. The control law needs an estimate of the base pose, the arm's kinematics
and the plan, and nothing of the simulation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from regionik.planners.geometry.angles import wrap
from regionik.planners.solvers.serial_chain import chain_frames, chain_jacobian, serial_arm
from regionik.simulation.noise import twist_step
from regionik.simulation.options import SIMULATION
from regionik.simulation.reference import PERIOD, Reference
from regionik.worlds.arrays import Array
from regionik.worlds.limits import Speeds
from regionik.worlds.robot import Robot

OPTIONS = SIMULATION.controller

TAKEN_ON = 1 - math.exp(-PERIOD / SIMULATION.robot.base_lag)  # share of a change of speed in one period


@dataclass(frozen=True, eq=False)
class Command:
    """Command of a controller for one `PERIOD`."""

    twist: Array  # (3,) of the base in its own frame [m/s], [rad/s]
    curvature: float  # that a car steers to [1/m]
    joints: Array  # (dof,) to be reached at the end
    added: Array  # (dof,) their difference from those of the plan


@dataclass(frozen=True, eq=False)
class TrackingController:
    """Controller of base and arm, once each `PERIOD`."""

    robot: Robot
    speeds: Speeds  # limits that its commands keep
    plan: Reference

    def command(self, k: int, pose: Array, twist: Array, joints: Array) -> Command:
        """Command for the time from row k to the next.

        The base is taken to be at a pose (3,), ``twist`` (3,) is what its wheels say of its motion in its own
        frame, ``joints`` (dof,) are those of the command before.
        """
        wanted = self._base_twist(k, pose)
        asked = twist + (wanted - twist) / TAKEN_ON  # the drives' lag makes that the one wanted
        ahead = pose + twist_step(pose[2], (twist + wanted) / 2, PERIOD)
        reached = self._arm_joints(k + 1, ahead, joints)
        bend = 0.0 if self.robot.drive.turns_on_the_spot else self._curvature(k, wanted)
        return Command(asked, bend, reached, reached - self.plan.joints[k + 1])

    def _base_twist(self, k: int, pose: Array) -> Array:
        """Twist (3,) wanted of the base in its own frame at the end of row k, estimated at a pose (3,)."""
        planned, off = self.plan.twist[k + 1].copy(), self.plan.base[k] - pose
        off[2] = wrap(off[2])
        off[:2] = _turned(off[:2], -pose[2])
        if not self.robot.drive.rolls:
            planned[:2] = _turned(planned[:2], off[2])
            return self._limited(planned + OPTIONS.base_gain * off)
        # The way back to the path is critically damped in the way that is driven, whatever the speed.
        ahead, turn = planned[0], planned[2]
        back = ahead * off[1] / OPTIONS.way_back**2 + 2 * abs(ahead) * off[2] / OPTIONS.way_back
        spin = OPTIONS.base_gain * off[2] if self.robot.drive.turns_on_the_spot else 0.0
        return self._limited(np.array([ahead + OPTIONS.base_gain * off[0], 0.0, turn + back + spin]))

    def _curvature(self, k: int, wanted: Array) -> float:
        """Curvature to steer a car by, of which a twist (3,) is wanted at the end of row k [1/m]."""
        planned, bend = self.plan.twist[k + 1], float(self.plan.curvature[k])
        if abs(planned[0]) > OPTIONS.min_steered_speed:  # slower ones do not bring it back
            bend += (wanted[2] - planned[2]) / planned[0]
        most = 1 / self.robot.turning_radius
        return min(max(bend, -most), most)

    def _arm_joints(self, k: int, pose: Array, joints: Array) -> Array:
        """Joint values (dof,) for row k, from those of the row before and the base pose (3,) expected then.

        One step of damped least squares on the tool's frame, drawn to the plan's posture. With the tool off
        its path the arm keeps that posture: no point of it then strays farther than the base takes it.
        """
        arm, plan = serial_arm(self.robot.chain), self.plan
        n = len(joints)
        frames, J = np.empty((len(arm.axis) + 1, 4, 4)), np.empty((6, n))
        chain_frames(arm, joints, frames)
        chain_jacobian(arm, frames, J)
        off = pose - plan.base[k]
        off[2] = wrap(off[2])
        T_world_arm = self.robot.T_world_arm(plan.base[k] + self._taken_up[k] * off)
        wanted = np.linalg.solve(T_world_arm, plan.T_tool[k])
        turn = OPTIONS.turn_length * _turn(frames[-1], wanted)
        error = np.concatenate([wanted[:3, 3] - frames[-1, :3, 3], turn])
        J[3:] *= OPTIONS.turn_length
        away = joints - plan.joints[k]
        step = np.linalg.solve(J.T @ J + self._damping * np.eye(n), J.T @ error - self._damping * away)
        most = self._joint_velocity * PERIOD
        lower = np.maximum(self.robot.chain.lower, plan.joints[k] - OPTIONS.max_added)
        upper = np.minimum(self.robot.chain.upper, plan.joints[k] + OPTIONS.max_added)
        limited: Array = np.clip(joints + np.clip(step, -most, most), lower, upper)
        return limited

    def _limited(self, twist: Array) -> Array:
        """Slow down a twist (3,) that is beyond the base's limits, in all its parts alike."""
        most = self.speeds.base_velocity, self.speeds.turn_velocity
        used = max(float(np.hypot(twist[0], twist[1])) / most[0], abs(float(twist[2])) / most[1], 1.0)
        return twist / used

    @cached_property
    def _taken_up(self) -> Array:
        """Share of what the base is off that the arm takes up, (n,): all of it with the tool on its path."""
        rows, on_path = np.arange(len(self.plan.time)), np.flatnonzero(self.plan.on_path)
        if not len(on_path):
            return np.zeros(len(rows))
        after = np.searchsorted(on_path, rows).clip(max=len(on_path) - 1)
        away = np.abs(on_path[[after, np.maximum(after - 1, 0)]] - rows).min(axis=0)
        taken_up: Array = np.clip(1 - away * PERIOD / OPTIONS.fade_time, 0.0, 1.0)
        return taken_up

    @cached_property
    def _damping(self) -> float:
        """Weight of the arm's deviation from the plan: longer arms turn less for the same way [m2]."""
        chain = self.robot.chain
        frames = [*(joint.T_parent_joint for joint in chain.joints[1:]), chain.T_last_tool]
        return (OPTIONS.damping * sum(float(np.linalg.norm(T[:3, 3])) for T in frames)) ** 2

    @cached_property
    def _joint_velocity(self) -> Array:
        return self.speeds.joint_limits(self.robot.chain)[0]


def _turned(vector: Array, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def _turn(T: Array, wanted: Array) -> Array:
    """Rotation vector (3,) of a small turn from one frame's axes to another's [rad]."""
    R = wanted[:3, :3] @ T[:3, :3].T
    return np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
