"""Drives of a base in a simulation: they take on a commanded speed with a lag, steer, and slip."""

from __future__ import annotations

import math

import numpy as np

from regionik.simulation.noise import SLIP_TIME
from regionik.simulation.physics import STEP
from regionik.simulation.tracking import LAG
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot
from regionik.worlds.speeds import Speeds

_SHARE = 1 - math.exp(-STEP / LAG)  # of the way to the commanded speed that is made in a step


class BaseDrives:
    """Drives of a base: ``twist`` (3,) is what its wheels say, of the base in its own frame [m/s], [rad/s].

    A base that rolls is a unicycle, or a bicycle that steers: wheels whose contacts are solved for would slip
    by what the solver makes of friction, not by what is asked for.

    Parameters
    ----------
    robot : Robot
    speeds : Speeds
        A car steers no faster.
    slips : (n, 3) array
        Factors of what the base does to what its wheels say, one row a second.
    curvature : float
        That a car's wheels are turned to at first [1/m].
    """

    def __init__(self, robot: Robot, speeds: Speeds, slips: Array, curvature: float) -> None:
        self.twist = np.zeros(3)
        self._wheelbase = robot.turning_radius if not robot.drive.turns_on_the_spot else 0.0
        self._steering = math.atan(self._wheelbase * curvature)
        self._fastest = speeds.steering_velocity * STEP
        self._slips = slips
        self._steps = 0

    def step(self, asked: Array, curvature: float, yaw: float) -> tuple[float, float, float]:
        """Go on by a step, asked for a twist (3,) and, of a car, a curvature [1/m]; the base's velocity.

        Of a base with a heading, in the world: x, y [m/s], yaw [rad/s].
        """
        twist, before = self.twist, self.twist.copy()
        twist += (asked - twist) * _SHARE
        if self._wheelbase:
            wanted = math.atan(self._wheelbase * curvature)
            self._steering += min(max(wanted - self._steering, -self._fastest), self._fastest)
            twist[2] = twist[0] * math.tan(self._steering) / self._wheelbase
        # MuJoCo goes on by the speed that a step ends with: that has to be its middle's.
        gone = (before + twist) / 2 * self._slips[int(self._steps * STEP / SLIP_TIME)]
        ahead, left, turn = gone.tolist()
        self._steps += 1
        middle = yaw + turn * STEP / 2
        c, s = math.cos(middle), math.sin(middle)
        return c * ahead - s * left, s * ahead + c * left, turn
