"""What a simulated execution of a plan came to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from regionik.simulation.options import SIMULATION
from regionik.simulation.reference import Reference
from regionik.values import Plan
from regionik.worlds.arrays import Array
from regionik.worlds.joints import nearest_turn
from regionik.worlds.limits import Execution, Speeds

OPTIONS = SIMULATION.run


@dataclass(frozen=True)
class Contact:
    """Two solids that touched though the plan does not let them."""

    time: float  # when they first did [s]
    one: str  # name of the robot's solid
    other: str  # name of an obstacle, or of another solid of the robot
    depth: float  # deepest overlap [m]

    @property
    def text(self) -> str:
        """What touches what, and how deep."""
        return f"{self.one} touches {self.other}, {1000 * self.depth:.1f} mm deep at most"


@dataclass(frozen=True, eq=False)
class SimulatedRun:
    """A simulated execution of a plan, row by row at the controller's period.

    Attributes
    ----------
    plan : Plan
    reference : Reference
        The plan at the same times.
    base, estimate : (n, 3) arrays
        Where the base was, and where the robot took it to be: x, y [m], yaw [rad].
    covariance : (n, 3, 3) array
        Of the estimate's error.
    joints : (n, dof) array
    velocity : (n, 3 + dof) array
        Of the base in the world and of the joints.
    tool : (n, 3) array
        [m]
    tool_speed : (n,) array
        [m/s]
    contacts : tuple of Contact
        In the order in which they began.
    tolerance : float
        Largest tool error allowed on the path [m].
    """

    plan: Plan
    reference: Reference
    base: Array
    estimate: Array
    covariance: Array
    joints: Array
    velocity: Array
    tool: Array
    tool_speed: Array
    contacts: tuple[Contact, ...]
    tolerance: float

    def __repr__(self) -> str:
        state = "ok" if self.ok else self.failure
        return f"SimulatedRun({self.plan.world.name}: {float(self.time[-1]):.2f} s, {state})"

    @property
    def time(self) -> Array:
        """Times of the rows, (n,) [s]."""
        return self.reference.time

    @cached_property
    def tool_error(self) -> Array:
        """Distance of the tool from where the plan has it at that moment, (n,) [m]."""
        error: Array = np.linalg.norm(self.tool - self.reference.T_tool[:, :3, 3], axis=1)
        return error

    @cached_property
    def tool_spread(self) -> Array:
        """Standard deviation of the tool's place along the direction in which it is known least, (n,) [m].

        It is that of the estimate, which no arm takes up.
        """
        x, y = (self.tool - self.base)[:, :2].T
        J = np.zeros((len(x), 2, 3))
        J[:, 0, 0] = J[:, 1, 1] = 1.0
        J[:, 0, 2], J[:, 1, 2] = -y, x
        spread = np.linalg.eigvalsh(J @ self.covariance @ J.transpose(0, 2, 1))[:, -1].astype(np.float64)
        found: Array = np.sqrt(np.maximum(spread, 0.0))
        return found

    @cached_property
    def arm_error(self) -> Array:
        """Largest distance of any point of the arm's solids from where the plan has it, (n,) [m]."""
        rows = range(0, len(self.time), OPTIONS.rows_at_once)
        return np.concatenate([self._arm_error(slice(first, first + OPTIONS.rows_at_once)) for first in rows])

    def _arm_error(self, rows: slice) -> Array:
        robot, error = self.plan.world.robot, np.zeros(len(self.time[rows]))
        poses = (self.base, self.joints), (self.reference.base, self.reference.joints)
        off, planned = (robot.frames(base[rows], joints[rows]) for base, joints in poses)
        moved = off - planned
        for solid in robot.solids:
            T = moved[:, solid.link]
            away = np.einsum("nij,kj->nki", T[:, :3, :3], solid.corners) + T[:, None, :3, 3]
            error = np.maximum(error, np.linalg.norm(away, axis=2).max(axis=1))
        return error

    @cached_property
    def execution(self) -> Execution:
        """Errors of this run as ``rules.execution`` takes them, rounded up."""
        turned = self.base[:, 2] - self.reference.base[:, 2]
        heading = np.abs(nearest_turn(turned)).max()
        tool, figures = self.tool_error[self.reference.on_path].max(initial=0.0), self.figures
        errors = figures["base_error"], heading, tool, max(float(self.arm_error.max()), float(tool))
        grid = OPTIONS.error_grid
        return Execution(*(round(float(np.ceil(error / grid)) * grid, 9) for error in errors))

    @property
    def ok(self) -> bool:
        """True where the tool kept its tolerance on the path and nothing touched."""
        return not self.failure

    @cached_property
    def failure(self) -> str:
        """The first moment at which the run fails, and why; empty where it does not."""
        left = np.flatnonzero(self.reference.on_path & (self.tool_error > self.tolerance))
        moments = [(contact.time, contact.text) for contact in self.contacts]
        if len(left):
            first = int(left[0])
            text = f"the tool is {1000 * self.tool_error[first]:.1f} mm off its path, {self._place(first)}"
            moments.append((float(self.time[first]), f"{text}, allowed are {1000 * self.tolerance:g} mm"))
        time, text = min(moments, default=(0.0, ""))
        return f"at {time:.2f} s {text}" if text else ""

    @cached_property
    def figures(self) -> dict[str, Any]:
        """Plain numbers about the run.

        ``tool_error`` on the path: median, 95th percentile and worst [m]. ``speed_held``: share of the time
        on the path at which the tool's speed is as planned, to 2 % of the nominal speed: the
        ``tool_velocity`` that was asked for, else the highest on the path. ``base_error``: largest distance
        of the base from its place [m]. ``used``: largest share of each speed limit and of joint ranges.
        """
        on_path = self.reference.on_path
        error = self.tool_error[on_path] if on_path.any() else np.zeros(1)
        off = np.hypot(*(self.base - self.reference.base)[:, :2].T)
        return {
            "duration": float(self.time[-1]),
            "tool_error": {
                "median": float(np.median(error)),
                "p95": float(np.percentile(error, 95)),
                "worst": float(error.max()),
            },
            "speed_held": self._speed_shares,
            "base_error": float(off.max()),
            "contacts": len(self.contacts),
            "used": self._used,
        }

    @property
    def _speed_shares(self) -> float:
        on_path, planned = self.reference.on_path, self.reference.tool_speed
        if not planned[on_path].any():
            return 1.0  # the tool rests wherever it works
        nominal = (self.plan.world.speeds or Speeds()).tool_velocity or float(planned[on_path].max())
        near = np.abs(self.tool_speed - planned)[on_path] <= OPTIONS.speed_band * nominal
        return float(near.mean())

    @property
    def _used(self) -> dict[str, float]:
        chain, speeds = self.plan.world.robot.chain, self.plan.world.speeds or Speeds()
        joint_limits = speeds.joint_limits(chain)[0]
        speed = np.hypot(self.velocity[:, 0], self.velocity[:, 1])
        bounded = np.isfinite(chain.upper - chain.lower) & (chain.upper > chain.lower)
        lower, upper = chain.lower[bounded], chain.upper[bounded]
        range_used = np.abs(2 * self.joints[:, bounded] - lower - upper) / (upper - lower)
        return {
            "joint_velocity": float((np.abs(self.velocity[:, 3:]) / joint_limits).max()),
            "base_velocity": float(speed.max() / speeds.base_velocity),
            "turn_velocity": float(np.abs(self.velocity[:, 2]).max() / speeds.turn_velocity),
            "joint_range": float(range_used.max(initial=0.0)),
        }

    def _place(self, row: int) -> str:
        last = int(self.reference.setpoint[: row + 1].max())
        return "before the first set-point" if last < 0 else f"after set-point {last + 1}"
