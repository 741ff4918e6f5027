"""Limits of speed, acceleration and jerk, and how much of them coordinates use at instants."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from regionik.values import Motion
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.limits import Speeds
from regionik.worlds.robot import Robot

ROOTS = {"velocity": 1.0, "acceleration": 1 / 2, "jerk": 1 / 3}  # by which time stretches with a share
THICKNESS = 0.05  # of links, about the lines from joint to joint [m]

SIDES = 32  # of the polygon inside the disc of the base's accelerations
_ANGLES = np.arange(SIDES // 2) * 2 * np.pi / SIDES
_INSIDE = np.cos(np.pi / SIDES)


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Limits of a robot's coordinates q: x, y, yaw and joints."""

    robot: Robot
    speeds: Speeds
    # Length of lines along the tool's axes that count as part of it; long ones keep it from turning [m]
    pointer: float = 0.0
    # Greatest speed of the tool on its way to each set-point, as `World.work_speeds`; none for no bounds
    work_speeds: Array = field(default_factory=lambda: np.empty(0))
    lead: float = 0.0  # time before and after a slower part of the path at which its speed holds already [s]

    @cached_property
    def joint_velocity(self) -> Array:
        """Limits, (dof,)."""
        return self.speeds.joint_limits(self.robot.chain)[0]

    @cached_property
    def joint_acceleration(self) -> Array:
        """Limits, (dof,)."""
        return self.speeds.joint_limits(self.robot.chain)[1]

    @cached_property
    def joint_jerk(self) -> Array:
        """Limits, infinite for none, (dof,)."""
        return self.speeds.joint_jerks(self.robot.chain)

    @property
    def blend(self) -> float:
        """By which any point of the robot may leave the motion [m]."""
        return self.speeds.blend

    def limited_derivatives(self, q_s: Array, q_ss: Array) -> tuple[Array, Array, Array]:
        """Path derivatives (m, k) of coordinates whose accelerations are limited, and their limits (k,)."""
        s = self.speeds
        directions = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])
        base = np.append(np.full(len(_ANGLES), _INSIDE * s.base_acceleration), s.turn_acceleration)
        limits = np.concatenate([base, self.joint_acceleration])
        first, second = (np.concatenate([one[:, :2] @ directions, one[:, 2:]], axis=1) for one in (q_s, q_ss))
        return first, second, limits

    def tool_speeds(self, motion: Motion) -> Array:
        """Greatest speed of the tool on each segment, infinite where none is asked, (n - 1,) [m/s]."""
        asked = self.tool_speeds_to(motion.leads_to(), segments_on_path(motion))
        return asked if self.lead == 0 else self._extended(motion, asked)

    def tool_speeds_to(self, setpoint: Index, on_path: Mask) -> Array:
        """The same of segments (m,) that lead to set-points, with the tool on its path or not."""
        own = np.append(self.work_speeds, np.inf)[np.minimum(setpoint, len(self.work_speeds))]
        common = self.speeds.tool_velocity
        return np.where(on_path, own if common is None else np.minimum(own, common), np.inf)

    def _extended(self, motion: Motion, asked: Array) -> Array:
        """Speeds (n - 1,) of which slower ones hold for the lead beyond their segments, on the path alone."""
        tools, on_path = self.robot.tool(motion.base, motion.joints)[:, :3, 3], segments_on_path(motion)
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tools, axis=0), axis=1))])
        part, found = np.cumsum(~on_path), asked.copy()
        changes = 1 + np.flatnonzero((asked[1:] != asked[:-1]) & on_path[1:] & on_path[:-1])
        for k in changes.tolist():
            slow = min(asked[k - 1], asked[k])
            if asked[k - 1] > slow:
                first, end = int(np.searchsorted(way, way[k] - slow * self.lead, side="right")) - 1, k
            else:
                first, end = k, int(np.searchsorted(way, way[k] + slow * self.lead))
            rows = np.arange(max(first, 0), end)
            rows = rows[part[rows] == part[k]]
            found[rows] = np.minimum(found[rows], slow)
        return found

    def largest_squared_velocity(self, q: Array, q_s: Array, tool_speed: Array) -> Array:
        """Squares (m,) of the path velocity at which the first velocity limit is met; see `usage`."""
        shares = np.stack(list(self._velocity_usage(q, q_s, tool_speed).values()))
        with np.errstate(divide="ignore"):
            most: Array = np.minimum(1.0 / shares.max(0) ** 2, 1e6)
        return most

    @property
    def ramp(self) -> float:
        """Time in which every limited jerk brings its acceleration from zero to its limit [s]."""
        s = self.speeds
        base = (s.base_acceleration, s.base_jerk), (s.turn_acceleration, s.turn_jerk)
        times = [most / jerk for most, jerk in base if jerk is not None]
        return float(max(*times, *(self.joint_acceleration / self.joint_jerk), 0.0))

    def usage(
        self, q: Array, velocity: Array, acceleration: Array, tool_speed: Array, jerk: Array | None = None
    ) -> dict[str, Array]:
        """Share of each limit that a motion uses, (n,) each.

        Parameters
        ----------
        q, velocity, acceleration, jerk : (n, 3 + dof) arrays
            Of base and joints; no jerk where it is not limited.
        tool_speed : (n,) array
            Greatest of the tool, infinite for none [m/s].
        """
        s, joints = self.speeds, np.abs(acceleration[:, 3:]) / self.joint_acceleration
        usage = {
            **self._velocity_usage(q, velocity, tool_speed),
            "joint_acceleration": joints.max(1, initial=0.0),
            "base_acceleration": np.hypot(*acceleration[:, :2].T) / s.base_acceleration,
            "turn_acceleration": np.abs(acceleration[:, 2]) / s.turn_acceleration,
        }
        if jerk is not None and s.joint_jerk is not None:
            usage["joint_jerk"] = (np.abs(jerk[:, 3:]) / self.joint_jerk).max(1, initial=0.0)
        if jerk is not None and s.base_jerk is not None:
            usage["base_jerk"] = np.hypot(*jerk[:, :2].T) / s.base_jerk
        if jerk is not None and s.turn_jerk is not None:
            usage["turn_jerk"] = np.abs(jerk[:, 2]) / s.turn_jerk
        return usage

    def slowdown(
        self, q: Array, velocity: Array, acceleration: Array, tool_speed: Array, jerk: Array | None = None
    ) -> Array:
        """Factors (n,) by which a motion must be slower to keep all limits; below 1 it may be faster."""
        usage = self.usage(q, velocity, acceleration, tool_speed, jerk)
        factors = [share ** ROOTS[name.rpartition("_")[2]] for name, share in usage.items()]
        return np.max(factors, axis=0)

    def most_used(
        self, q: Array, velocity: Array, acceleration: Array, jerk: Array | None = None
    ) -> list[str]:
        """Limit that a motion uses most at each instant (n,), but for the tool's speed."""
        usage = self.usage(q, velocity, acceleration, np.full(len(q), np.inf), jerk)
        names, joints, joint = list(usage), np.array(self.robot.chain.names), dict[str, NDArray[np.str_]]()
        rates = {"joint_velocity": velocity, "joint_acceleration": acceleration, "joint_jerk": jerk}
        for name, rate in rates.items():
            if rate is not None:
                joint[name] = joints[np.argmax(np.abs(rate[:, 3:]) / getattr(self, name), axis=1)]
        found = [names[row] for row in np.argmax(np.stack(list(usage.values())), axis=0).tolist()]
        return [f"{name} of {joint[name][k]}" if name in joint else name for k, name in enumerate(found)]

    def fastest_coordinate(self, velocity: Array) -> tuple[str, float, float, int]:
        """Coordinate that uses its velocity limit most: name, speed, limit and row."""
        base = np.hypot(*velocity[:, :2].T)
        speeds = np.column_stack([base, np.abs(velocity[:, 2:])])
        limits = np.concatenate([[self.speeds.base_velocity, self.speeds.turn_velocity], self.joint_velocity])
        row, k = np.unravel_index(int(np.argmax(speeds / limits)), speeds.shape)
        names = ["the base", "the base's heading", *self.robot.chain.names]
        return names[k], float(speeds[row, k]), float(limits[k]), int(row)

    def _velocity_usage(self, q: Array, velocity: Array, tool_speed: Array) -> dict[str, Array]:
        s, yaw = self.speeds, q[:, 2]
        base, turn = velocity[:, :2], np.abs(velocity[:, 2])
        usage = {
            "joint_velocity": (np.abs(velocity[:, 3:]) / self.joint_velocity).max(1, initial=0.0),
            "base_velocity": np.hypot(*base.T) / s.base_velocity,
            "turn_velocity": turn / s.turn_velocity,
        }
        if s.wheel_velocity is not None and self.robot.gauge > 0:
            ahead = np.abs(base[:, 0] * np.cos(yaw) + base[:, 1] * np.sin(yaw))
            usage["wheel_velocity"] = (ahead + turn * self.robot.gauge / 2) / s.wheel_velocity
        if np.isfinite(tool_speed).any():
            usage["tool_velocity"] = (
                np.linalg.norm(tool_velocity(self.robot, q, velocity), axis=1) / tool_speed
            )
        return usage

    def displacement(self, q: Array, other: Array) -> Array:
        """Upper bound for any point's distance between states q and others (n, 3 + dof), (n,) [m].

        Points of the arm are those within `THICKNESS` of straight lines from joint to joint, and to the tool,
        and the ends of its pointers.
        """
        return self.displacement_from(q, self.robot.frames(q[:, :3], q[:, 3:]), other)

    def displacement_from(self, q: Array, frames: Array, other: Array) -> Array:
        """`displacement` of q whose frames (n, k, 4, 4) are known, (n,) [m]."""
        here, there = frames[..., :3, :], self.robot.frames(other[:, :3], other[:, 3:])[..., :3, :]
        moved = np.linalg.norm((there - here)[..., 3], axis=2)
        turned = np.linalg.norm((there - here)[..., :3], axis=(2, 3)) / np.sqrt(2)
        arm = np.maximum(moved[:, :-1], moved[:, 1:]) + THICKNESS * turned[:, :-1]
        arm[:, -1] = np.maximum(arm[:, -1], moved[:, -1] + self.pointer * turned[:, -1])
        base, corners = other[:, :3] - q[:, :3], float(np.hypot(*self.robot.footprint.T).max())
        return np.maximum(arm.max(1), np.hypot(*base[:, :2].T) + corners * np.abs(base[:, 2]))


def segments_on_path(motion: Motion) -> Mask:
    """Segments over which the tool is on its path, (n - 1,)."""
    lifted = motion.kind == "transit"
    return ~(lifted[:-1] | lifted[1:])


def tool_velocity(robot: Robot, q: Array, velocity: Array) -> Array:
    """Velocity of the tool's point in the world, of base and joints q (n, 3 + dof), (n, 3) [m/s]."""
    frames = robot.frames(q[:, :3], q[:, 3:])
    tool = frames[:, -1, :3, 3]
    arm, turn = tool[:, :2] - q[:, :2], velocity[:, 2, None]
    J = robot.chain.point_jacobian(frames, tool, len(robot.chain.joints))
    found = np.einsum("nk,nkj->nj", velocity[:, 3:], J)
    found[:, :2] += velocity[:, :2] + turn * np.column_stack([-arm[:, 1], arm[:, 0]])
    return found
