"""Base and arm that follow a target as it moves: one call a cycle, nothing allocated anew for callers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from shapely.geometry.base import BaseGeometry

from regionik.mfabrik import HEADINGS, as_target, finite_numbers, flat_area
from regionik.planners.geometry.polygons import FlatPolygon
from regionik.planners.kernels import compiled_at_once
from regionik.planners.solvers.base_placement import BaseArea, Turning
from regionik.planners.solvers.mfabrik_serial import follow
from regionik.postures.serial_solver import serial_solver
from regionik.worlds.arms import pivot_index, pivot_joints
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Heading, Target


class LiveSolver:
    """A solver that goes on from state to state as a target moves.

    A call takes the next target and moves ``base`` and ``joints`` there by damped least squares on both, the
    least motion from where they are: it does not leap to another posture, as `Solver` may. So a target that
    jumps, or goes where only another posture leads, can be missed; the state is then as near as it came.

    Parameters
    ----------
    robot : Robot
    base : (3,) array_like
        Where the base stands: x, y [m], yaw [rad].
    joints : (dof,) array_like
        Present joint values; those beyond a limit count as at it.
    area : geometry or FlatPolygon, optional
        Admissible area of the arm axis; none leaves the whole floor free.
    tolerance : float
        [m]
    heading : {"free", "face_target", "fixed"}

    Attributes
    ----------
    base, joints : (3,), (dof,) arrays
        The state now: the same arrays all the time, overwritten by each call.
    error : float
        Distance of the tool from the last target [m].

    Examples
    --------
    >>> from regionik.worlds.bundled import robot_named
    >>> live = LiveSolver(robot_named("youbot"), [0, 0, 0], [0, 1.6, -1, 0.5, 0])
    >>> [live([0.45 + 0.01 * k, 0.1, 0.25]) for k in range(3)]
    [True, True, True]
    """

    def __init__(
        self,
        robot: Robot,
        base: ArrayLike,
        joints: ArrayLike,
        area: BaseGeometry | FlatPolygon | None = None,
        tolerance: float = 1e-3,
        heading: Heading = "free",
    ) -> None:
        if not 0 < tolerance < np.inf:
            raise InputError(f"live solver: tolerance must be above 0, got {tolerance}")
        if heading not in HEADINGS:
            raise InputError(f"live solver: heading must be one of {', '.join(HEADINGS)}, got {heading}")
        chain, flat = robot.chain, flat_area(area)
        self.robot, self.tolerance, self.error = robot, tolerance, np.inf
        self.base = finite_numbers(base, 3, "base")
        now = np.clip(finite_numbers(joints, chain.dof, "joints"), chain.lower, chain.upper)
        self._arm = serial_solver(chain, float(robot.mount[2]), tolerance, turns=heading != "fixed")
        self._joints = pivot_joints(chain, now)
        self.joints: Array = self._joints[len(self._joints) - chain.dof :]
        self._pivot, self._area = pivot_index(self._arm.chain), BaseArea(flat.vertices, flat.starts, True)
        pivot = self._arm.chain.active_joints[self._pivot]
        limits = float(pivot.lower), float(pivot.upper)
        self._turning = Turning(*limits, HEADINGS[heading], -np.inf, np.inf)
        with compiled_at_once():
            self(robot.tool(self.base, self.joints)[:3, 3])

    def __call__(self, target: Target | ArrayLike) -> bool:
        """Go on to a target; True where the tool meets it.

        Parameters
        ----------
        target : Target or (3,) array_like
            A bare point leaves the tool's direction free [m].
        """
        goal = self._arm.goal_for(as_target(target))
        self.error, angle, fits = follow(
            goal.sliding, self._pivot, self._turning, self.robot.mount, self._area, goal.aim, goal.effort,
            self.base, self._joints,
        )  # fmt: skip
        return bool(fits and self.error <= self.tolerance and angle <= goal.effort.angle_tolerance)
