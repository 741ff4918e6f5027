"""Methods of the papers alone: Algorithm 2 of M-FABRIK, and FABRIK with obstacle avoidance.

M-FABRIK and FABRIK-R alone are `regionik.Solver`, the trajectories of de Souza et al. `regionik.polynomial`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.avoidance.avoiding_fabrik import avoid_obstacles, links_clear
from regionik.planners.driving.greedy_steps import greedy_points
from regionik.planners.driving.point_planner import common_part
from regionik.planners.geometry.polygons import FlatPolygon, clamp
from regionik.scene import WorldSource, scene_of, world_of
from regionik.values import Configuration
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError


@dataclass(frozen=True, eq=False)
class BaseSteps:
    """Steps of a base, as Algorithm 2 makes them.

    Attributes
    ----------
    points : (k, 2) array
        From the start on [m].
    arrived : bool
        Whether the last is the goal; else each step from there leads away from it.
    """

    points: Array
    arrived: bool


def base_steps(area: Polygon | MultiPolygon, start: ArrayLike, goal: ArrayLike, step: float) -> BaseSteps:
    """Step towards a goal inside an area, as near to it as a step allows: Algorithm 2 of M-FABRIK.

    Plans take the shortest path where steps do not arrive. Source: Santos et al., IEEE Access 2020.

    Parameters
    ----------
    area : Polygon or MultiPolygon
        Where the base may be [m].
    start, goal : (2,) array_like
        In one part of the area [m].
    step : float
        Longest step, the paper's rho [m].

    Raises
    ------
    NoPathError
        When start or goal is not in the area, or they are in parts of it that do not join.
    InputError
        For an empty area, points that are not two numbers, or a step that is not above 0.

    Examples
    --------
    >>> from shapely import box
    >>> round_it = base_steps(box(0, 0, 4, 2) - box(1.5, 0, 2, 1), [0.5, 0.8], [3.5, 1.2], 0.5)
    >>> round_it.arrived, len(round_it.points)
    (True, 8)
    >>> base_steps(box(0, 0, 4, 2) - box(1.5, 0, 2, 1.9), [0.5, 0.5], [3.5, 0.5], 0.5).arrived
    False
    """
    if not 0.0 < step < np.inf:
        raise InputError(f"step: expected a length above 0 [m], got {step}")
    a, b = frozen(start, (2,), "start"), frozen(goal, (2,), "goal")
    flat = FlatPolygon.from_shapely(common_part(area, a, b))
    ends = [clamp(flat.vertices, flat.starts, *end) for end in (a, b)]
    points, arrived = greedy_points(flat.vertices, flat.starts, *ends[0], *ends[1], float(step))
    return BaseSteps(frozen(points, (None, 2), "points"), bool(arrived))


def avoiding_fabrik(
    world: WorldSource, target: ArrayLike, base: ArrayLike, joints: ArrayLike, *, seed: int = 0
) -> Configuration:
    """Bring the tool to a target from a base that stands still, links turned off what they meet.

    The links keep the rules' ``arm_clearance`` from the world's obstacles, and off the base; they are not
    checked against each other, and the joints' ways to their values are not looked at. Plans ask this first
    of a posture that touches something. Source: Tao et al. (2021), section 4.

    Parameters
    ----------
    world : World, or the name or file of one
    target : (3,) array_like
        [m]
    base : (3,) array_like
        x, y [m], yaw [rad].
    joints : (dof,) array_like
        To start from; they may touch something.
    seed : int
        Of the random rotations. Same input, same answer.

    Returns
    -------
    Configuration
        Converged where the tool is within the rules' ``tolerance`` and every link was clear in the last pass.

    Raises
    ------
    InputError
        For numbers that are not finite, a negative seed, or an arm with joints that mimic others.

    Examples
    --------
    >>> import regionik as rik
    >>> world = rik.load_world("tao3")
    >>> found = avoiding_fabrik(world, world.task[0].position, world.start.base, world.start.joints)
    >>> found.converged
    True
    """
    scene = scene_of(world_of(world))
    robot, chain = scene.robot, scene.robot.chain
    if chain.has_mimics:
        raise InputError(f"{robot.name}: expected an arm without joints that mimic others")
    if seed < 0:
        raise InputError(f"seed: expected a whole number from 0 up, got {seed}")
    spot, place = frozen(target, (3,), "target"), frozen(base, (3,), "base")
    inside = np.linalg.inv(robot.T_world_arm(place))
    found = avoid_obstacles(
        chain,
        inside[:3, :3] @ spot + inside[:3, 3],
        np.array(frozen(joints, (chain.dof,), "joints")),
        links_clear(scene.collision.bodies, place, spot, 0.0),
        tolerance=scene.rules.tolerance,
        seed=seed,
    )
    return Configuration(place, found.joints, found.error, found.iterations, found.converged)
