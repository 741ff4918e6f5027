"""M-FABRIK with the passes of FABRIK-R: the base follows the pivot of any serial arm, compiled.

Source: M-FABRIK (Santos et al., IEEE Access 2020), Algorithm 1, whose arm is here the rigid bodies of
FABRIK-R (paper 001).
"""

from __future__ import annotations

import numpy as np

from regionik.planners.geometry.flat import Index, clamp, compiled, contains
from regionik.planners.solvers.damped_least_squares import Aim
from regionik.planners.solvers.fabrikr import Posture, backward_pass, posture_of
from regionik.planners.solvers.multistart_ik import Effort, inward_pass, share_of, solve, tool_misses
from regionik.planners.solvers.rigid_bodies import Bodies
from regionik.worlds.arrays import Array


@compiled
def roam(
    bodies: Bodies,
    pivot: int,
    starts: Array,
    vertices: Array,
    rings: Index,
    place: Array,
    yaw: float,
    rise: float,
    aim: Aim,
    effort: Effort,
    joints: Array,
) -> tuple[float, float, int]:
    """Move arm axis and arm until the tool meets its aim: passes, restarts, then polishing.

    Parameters
    ----------
    bodies : Bodies
        Pointing ones for a position, posing ones for more.
    pivot : int
        The joint that turns about the vertical through the arm's base frame; what comes before lifts it.
    starts : (r, n) array
        Postures to start again from.
    vertices, rings : arrays
        Admissible area as flat rings; no rings leave the whole floor free.
    place : (2,) array
        Arm axis on the floor; overwritten with the answer [m].
    yaw, rise : float
        Heading and height of the arm's base frame [rad], [m].
    aim : Aim
        In the world.
    joints : (dof,) array
        Overwritten with the answer.

    Returns
    -------
    error [m], angle error [rad], passes
    """
    n, passes = len(bodies.slide), 0
    first, nearest, trial, best = place.copy(), place.copy(), joints[:n].copy(), np.inf
    for attempt in range(len(starts) + 1):
        place[:] = first
        trial[:] = joints[:n] if attempt == 0 else starts[attempt - 1]
        posture = posture_of(bodies, trial)
        error, angle, used = follow(bodies, pivot, vertices, rings, place, yaw, rise, aim, effort, posture)
        passes += used
        share = share_of(error, angle, effort)
        if share <= 1.0:
            for k in range(n):
                joints[k] = posture.joints[k]
            return error, angle, passes
        if share < best:
            best = share
            nearest[:] = place
    place[:] = nearest  # inside the area: the last pass took it there
    error, angle, used, _, _ = solve(bodies, seen(place, yaw, rise, aim), starts, effort, joints)
    return error, angle, passes + used


@compiled
def follow(
    bodies: Bodies,
    pivot: int,
    vertices: Array,
    rings: Index,
    place: Array,
    yaw: float,
    rise: float,
    aim: Aim,
    effort: Effort,
    posture: Posture,
) -> tuple[float, float, int]:
    """Passes from one posture, the base after the root; ``place`` and ``posture`` are overwritten."""
    n, c, s = len(bodies.slide), np.cos(yaw), np.sin(yaw)
    bounded = len(rings) > 1
    # A base that has become inadmissible must move even where the tool is in place already.
    settled = not bounded or contains(vertices, rings, place[0], place[1])
    goal, miss = seen(place, yaw, rise, aim), np.empty(6)
    for used in range(effort.most_passes + 1):
        error, angle = tool_misses(bodies, goal, posture, miss)
        if (share_of(error, angle, effort) <= 1.0 and settled) or used == effort.most_passes:
            break
        inward_pass(bodies, goal, posture)
        dx, dy = posture.outer[pivot, 0], posture.outer[pivot, 1]
        if pivot == 0:
            dx, dy = dx - bodies.root[0], dy - bodies.root[1]
        x, y = place[0] + c * dx - s * dy, place[1] + s * dx + c * dy
        if bounded:
            x, y = clamp(vertices, rings, x, y)
        moved_x, moved_y = c * (x - place[0]) + s * (y - place[1]), c * (y - place[1]) - s * (x - place[0])
        place[0], place[1] = x, y
        for k in range(n + 1):  # the chain comes along with the target
            posture.outer[k, 0] -= moved_x
            posture.outer[k, 1] -= moved_y
            posture.inner[k, 0] -= moved_x
            posture.inner[k, 1] -= moved_y
        goal.position[0] -= moved_x
        goal.position[1] -= moved_y
        backward_pass(bodies, posture)
        settled = True
    return error, angle, used


@compiled
def seen(place: Array, yaw: float, rise: float, aim: Aim) -> Aim:
    """An aim in the frame of an arm whose axis stands at a place."""
    c, s = np.cos(yaw), np.sin(yaw)
    dx, dy = aim.position[0] - place[0], aim.position[1] - place[1]
    position = np.array([c * dx + s * dy, c * dy - s * dx, aim.position[2] - rise])
    turn = np.empty((3, 3))
    for i in range(3):
        turn[0, i] = c * aim.turn[0, i] + s * aim.turn[1, i]
        turn[1, i] = c * aim.turn[1, i] - s * aim.turn[0, i]
        turn[2, i] = aim.turn[2, i]
    return Aim(position, aim.kind, turn, aim.cone)
