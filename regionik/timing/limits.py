"""Limits of speed and acceleration, asked of a smooth path and of a motion along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regionik.planners.search.motion_bounds import longest_levers
from regionik.values import Motion
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot
from regionik.worlds.speeds import Speeds

Mask = NDArray[np.bool_]

_ANGLES = np.arange(4) * np.pi / 4  # an octagon stands for the disc of the base's accelerations
_INSIDE = np.cos(np.pi / 8)


@dataclass(frozen=True, eq=False)
class Limits:
    """What a robot's coordinates, x, y, yaw and joints, may do.

    Attributes
    ----------
    robot : Robot
    speeds : Speeds
    joint_velocity, joint_acceleration : (dof,) arrays
    levers : (dof,) array
        How far any point behind a joint moves at most for each unit of it [m].
    reach : float
        Of any point from the base's origin [m].
    """

    robot: Robot
    speeds: Speeds
    joint_velocity: Array
    joint_acceleration: Array
    levers: Array
    reach: float

    def accelerations(self, slope: Array, bend: Array) -> tuple[Array, Array, Array]:
        """Slopes and bends (m, k) of coordinates whose accelerations are limited, and their limits (k,)."""
        s = self.speeds
        turn = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])
        base = np.append(np.full(4, _INSIDE * s.base_acceleration), s.turn_acceleration)
        limits = np.concatenate([base, self.joint_acceleration])
        ways = [np.concatenate([one[:, :2] @ turn, one[:, 2:]], axis=1) for one in (slope, bend)]
        return ways[0], ways[1], limits

    def most(self, z: Array, slope: Array, working: Mask) -> Array:
        """Squares (m,) of the path velocity at which the first velocity limit is met."""
        shares = np.stack(list(self._velocities(z, slope, working).values()))
        with np.errstate(divide="ignore"):
            most: Array = np.minimum(1.0 / shares.max(0) ** 2, 1e6)
        return most

    def shares(self, z: Array, velocity: Array, acceleration: Array, working: Mask) -> dict[str, Array]:
        """How much of each limit a motion makes use of, (n,) each.

        Parameters
        ----------
        z, velocity, acceleration : (n, 3 + dof) arrays
            Of base and joints.
        working : (n,) array of bool
            Whether the tool is on the path.
        """
        joints = np.abs(acceleration[:, 3:]) / self.joint_acceleration
        return {
            **self._velocities(z, velocity, working),
            "joint_acceleration": joints.max(1, initial=0.0),
            "base_acceleration": np.hypot(*acceleration[:, :2].T) / self.speeds.base_acceleration,
            "turn_acceleration": np.abs(acceleration[:, 2]) / self.speeds.turn_acceleration,
        }

    def slowing(self, z: Array, velocity: Array, acceleration: Array, working: Mask) -> Array:
        """Factors (n,) by which a motion must be slower to keep all limits; below 1 it may be faster."""
        shares = self.shares(z, velocity, acceleration, working)
        slower = [np.sqrt(one) if "acceleration" in name else one for name, one in shares.items()]
        found: Array = np.max(slower, axis=0)
        return found

    def closest(self, z: Array, velocity: Array, acceleration: Array) -> list[str]:
        """Which limit a motion is closest to at each instant (n,), but for the tool's speed."""
        on = np.zeros(len(z), dtype=bool)
        shares = self.shares(z, velocity, acceleration, on)
        names, table = list(shares), np.stack(list(shares.values()))
        joints = np.array(self.robot.chain.names)
        worst = {
            "joint_velocity": joints[np.argmax(np.abs(velocity[:, 3:]) / self.joint_velocity, axis=1)],
            "joint_acceleration": joints[
                np.argmax(np.abs(acceleration[:, 3:]) / self.joint_acceleration, axis=1)
            ],
        }
        rows = np.argmax(table, axis=0).tolist()
        return [
            f"{names[r]} of {worst[names[r]][k]}" if names[r] in worst else names[r]
            for k, r in enumerate(rows)
        ]

    def fastest(self, velocity: Array) -> tuple[str, float, float, int]:
        """Which coordinate is furthest beyond its velocity limit: name, speed, limit, row."""
        base = np.hypot(*velocity[:, :2].T)
        speeds = np.column_stack([base, np.abs(velocity[:, 2:])])
        limits = np.concatenate([[self.speeds.base_velocity, self.speeds.turn_velocity], self.joint_velocity])
        row, k = np.unravel_index(int(np.argmax(speeds / limits)), speeds.shape)
        names = ["the base", "the base's heading", *self.robot.chain.names]
        return names[k], float(speeds[row, k]), float(limits[k]), int(row)

    def _velocities(self, z: Array, velocity: Array, working: Mask) -> dict[str, Array]:
        s, yaw = self.speeds, z[:, 2]
        base, turn = velocity[:, :2], np.abs(velocity[:, 2])
        found = {
            "joint_velocity": (np.abs(velocity[:, 3:]) / self.joint_velocity).max(1, initial=0.0),
            "base_velocity": np.hypot(*base.T) / s.base_velocity,
            "turn_velocity": turn / s.turn_velocity,
        }
        if s.wheel_velocity is not None and self.robot.gauge > 0:
            ahead = np.abs(base[:, 0] * np.cos(yaw) + base[:, 1] * np.sin(yaw))
            found["wheel_velocity"] = (ahead + turn * self.robot.gauge / 2) / s.wheel_velocity
        if s.tool_velocity is not None:
            speed = np.where(working, np.linalg.norm(tool_velocity(self.robot, z, velocity), axis=1), 0.0)
            found["tool_velocity"] = speed / s.tool_velocity
        return found

    def moved(self, base: Array, joints: Array) -> Array:
        """Bound of how far any point of the robot moves with changes (n, 3) and (n, dof), (n,) [m]."""
        moved: Array = (
            np.hypot(*base[:, :2].T) + self.reach * np.abs(base[:, 2]) + np.abs(joints) @ self.levers
        )
        return moved

    def working(self, motion: Motion) -> Mask:
        """Over which hops the tool is on the path, (n - 1,)."""
        lifted = motion.kind == "transit"
        working: Mask = ~(lifted[:-1] | lifted[1:])
        return working


def limits_of(robot: Robot, speeds: Speeds) -> Limits:
    """Limits of a robot."""
    velocity, acceleration = speeds.joint_limits(robot.chain)
    levers, reach = longest_levers(robot.chain, robot.chain.dof - 1, robot.chain.T_last_tool[:3, 3])
    from_axis = float(np.hypot(*robot.mount[:2])) + reach
    corners = float(np.hypot(*robot.footprint.T).max())
    return Limits(robot, speeds, velocity, acceleration, levers, max(from_axis, corners))


def tool_velocity(robot: Robot, z: Array, velocity: Array) -> Array:
    """Velocity of the tool's point in the world, (n, 3) [m/s].

    Parameters
    ----------
    robot : Robot
    z, velocity : (n, 3 + dof) arrays
        Base and joints, and their velocities.
    """
    frames = robot.frames(z[:, :3], z[:, 3:])
    tool = frames[:, -1, :3, 3]
    found = np.zeros((len(z), 3))
    found[:, :2] = velocity[:, :2]
    arm = tool[:, :2] - z[:, :2]
    found[:, :2] += velocity[:, 2, None] * np.column_stack([-arm[:, 1], arm[:, 0]])
    for k, joint in enumerate(robot.chain.joints):
        axis = frames[:, k, :3, :3] @ joint.axis
        moved = axis if joint.kind == "prismatic" else np.cross(axis, tool - frames[:, k, :3, 3])
        found += velocity[:, 3 + k, None] * moved
    return found
