"""M-FABRIK with the passes of FABRIK-R: the base follows the pivot of any serial arm, compiled.

Source: M-FABRIK (Santos et al., IEEE Access 2020), Algorithm 1, whose arm is here the rigid bodies of
FABRIK-R (paper 001).
"""

from __future__ import annotations

import numpy as np

from regionik.planners.bodies import Bodies
from regionik.planners.fabrikr import Posture, backward_pass, forward_pass, posture_of
from regionik.planners.flat import Index, clamp, compiled, contains
from regionik.planners.polish import POSITION, Aim
from regionik.planners.reaching import Effort, solve
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
    target: Array,
    effort: Effort,
    joints: Array,
) -> tuple[float, int]:
    """Move arm axis and arm until the tool is on target: passes, restarts, then polishing.

    Parameters
    ----------
    bodies : Bodies
        Pointing ones.
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
    target : (3,) array
        In the world [m].
    joints : (dof,) array
        Overwritten with the answer.

    Returns
    -------
    error [m], passes
    """
    n, passes = len(bodies.slide), 0
    first, nearest, trial, best = place.copy(), place.copy(), joints[:n].copy(), np.inf
    for attempt in range(len(starts) + 1):
        place[:] = first
        trial[:] = joints[:n] if attempt == 0 else starts[attempt - 1]
        posture = posture_of(bodies, trial)
        error, used = follow(bodies, pivot, vertices, rings, place, yaw, rise, target, effort, posture)
        passes += used
        if error <= effort.tolerance:
            for k in range(n):
                joints[k] = posture.joints[k]
            return error, passes
        if error < best:
            best = error
            nearest[:] = place
    place[:] = nearest  # inside the area: the last pass took it there
    aim = Aim(seen(place, yaw, rise, target), POSITION, np.eye(3))
    error, _, used, _, _ = solve(bodies, aim, starts, effort, joints)
    return error, passes + used


@compiled
def follow(
    bodies: Bodies,
    pivot: int,
    vertices: Array,
    rings: Index,
    place: Array,
    yaw: float,
    rise: float,
    target: Array,
    effort: Effort,
    posture: Posture,
) -> tuple[float, int]:
    """Passes from one posture, the base after the root; ``place`` and ``posture`` are overwritten."""
    n, c, s = len(bodies.slide), np.cos(yaw), np.sin(yaw)
    bounded = len(rings) > 1
    # A base that has become inadmissible must move even where the tool is in place already.
    settled = not bounded or contains(vertices, rings, place[0], place[1])
    goal = seen(place, yaw, rise, target)
    for used in range(effort.most_passes + 1):
        error = np.sqrt(((posture.outer[n] - goal) ** 2).sum())
        if (error <= effort.tolerance and settled) or used == effort.most_passes:
            break
        forward_pass(bodies, goal, posture)
        dx, dy = posture.outer[pivot, 0], posture.outer[pivot, 1]
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
        goal[0] -= moved_x
        goal[1] -= moved_y
        backward_pass(bodies, posture)
        settled = True
    return error, used


@compiled
def seen(place: Array, yaw: float, rise: float, target: Array) -> Array:
    """A target in the frame of an arm whose axis stands at a place."""
    c, s = np.cos(yaw), np.sin(yaw)
    dx, dy = target[0] - place[0], target[1] - place[1]
    return np.array([c * dx + s * dy, c * dy - s * dx, target[2] - rise])
