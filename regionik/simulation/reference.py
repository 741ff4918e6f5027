"""A timed plan as what a controller follows: rows at its own period, and set-points of the servos between."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from regionik.simulation.options import SIMULATION
from regionik.timing.limits import tool_velocity
from regionik.timing.trajectory import sample_plan, trajectory
from regionik.values import Plan
from regionik.worlds.arrays import Array, Index, Mask

PERIOD = SIMULATION.controller.period
MIN_ROLLING_SPEED = 1e-3  # speed above which a car's curvature is that of its motion [m/s]


@dataclass(frozen=True, eq=False)
class Reference:
    """A timed plan at even times."""

    time: Array  # (n,) `PERIOD` apart [s]
    # base, base_velocity: (n, 3) in the world, headings unwrapped
    base: Array
    base_velocity: Array
    joints: Array  # (n, dof)
    T_tool: Array  # (n, 4, 4) tool frames in the world
    tool_speed: Array  # (n,) [m/s]
    on_path: Mask  # (n,) where the tool is on its path
    setpoint: Index  # (n,) the last set-point, -1 on transits and before the first

    @cached_property
    def twist(self) -> Array:
        """Velocity of the base in its own frame, (n, 3) [m/s], [rad/s]."""
        c, s = np.cos(self.base[:, 2]), np.sin(self.base[:, 2])
        vx, vy, turn = self.base_velocity.T
        return np.column_stack([c * vx + s * vy, c * vy - s * vx, turn])

    @cached_property
    def curvature(self) -> Array:
        """Curvature of the base's way; where it stands, that of its next motion, (n,) [1/m]."""
        speed, _, turn = self.twist.T
        rolls = np.flatnonzero(np.abs(speed) > MIN_ROLLING_SPEED)
        if not len(rolls):
            return np.zeros(len(speed))
        ahead = rolls[np.minimum(np.searchsorted(rolls, np.arange(len(speed))), len(rolls) - 1)]
        found: Array = turn[ahead] / speed[ahead]
        return found


def reference(plan: Plan) -> Reference:
    """Return a timed plan at the controller's period.

    Raises
    ------
    InputError
        For a plan that is not timed.
    """
    trajectory(plan)  # says what is missing where the plan is not timed
    rows, robot = sample_plan(plan, 1 / PERIOD), plan.world.robot
    sample = rows.sample
    return Reference(
        time=PERIOD * np.arange(len(rows), dtype=np.float64),
        base=sample.base,
        base_velocity=sample.base_velocity,
        joints=sample.joints,
        T_tool=robot.tool(sample.base, sample.joints),
        tool_speed=np.linalg.norm(tool_velocity(robot, *sample.columns[:2]), axis=1),
        on_path=rows.kind != "transit",
        setpoint=rows.setpoint,
    )
