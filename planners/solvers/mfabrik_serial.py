"""M-FABRIK with the passes of FABRIK-R: the base follows the pivot of any serial arm, compiled.

Source: M-FABRIK (Santos et al., IEEE Access 2020), Algorithm 1, whose arm is here the rigid bodies of
FABRIK-R (paper 001).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.polygons import near_boundary
from regionik.planners.geometry.vectors import squared
from regionik.planners.kernels import compiled
from regionik.planners.solvers.base_placement import BaseArea, Turning, move_to_area, share_turn
from regionik.planners.solvers.damped_least_squares import (
    MAX_DAMPING,
    MIN_DAMPING,
    POSITION,
    Aim,
    limited_step,
    loosen_turns,
    scale_angles,
    tool_error,
)
from regionik.planners.solvers.fabrikr import Posture, backward_pass, posture_of
from regionik.planners.solvers.multistart_ik import (
    MAX_POLISH_STEPS,
    Effort,
    inward_pass,
    posture_error,
    stalled,
    tolerance_share,
)
from regionik.planners.solvers.rigid_bodies import RigidBodies
from regionik.planners.solvers.serial_chain import SerialArm, chain_jacobian
from regionik.worlds.arrays import Array

EDGE_TOLERANCE = 1e-9  # a base this near to the edge of its area slides along it [m]


class ArmMounting(NamedTuple):
    """Mounting of an arm on its base."""

    # the joint that turns about the vertical through the arm's base frame; what comes before lifts it
    pivot: int
    # yaw, rise: heading and height of the arm's base frame [rad], [m]
    yaw: float
    rise: float


@compiled
def solve_serial(
    bodies: RigidBodies,
    sliding: SerialArm,
    mounting: ArmMounting,
    starts: Array,
    area: BaseArea,
    place: Array,
    aim: Aim,
    effort: Effort,
    joints: Array,
    history: Array,
) -> tuple[float, float, int]:
    """Move arm axis and arm until the tool meets its aim: passes from each start, each end polished.

    Passes that stall leave base and arm to be polished together. They may lead every start into one corner of
    the limits: last of all, starts are polished as they are.

    Parameters
    ----------
    bodies : RigidBodies
        Pointing ones for a position, posing ones for more.
    sliding : SerialArm
        The arm of the bodies after two slides without limits, along x and y of its base frame.
    starts : (r, n) array
        Postures to start again from.
    place : (2,) array
        Arm axis on the floor; overwritten with the answer [m].
    aim : Aim
        In the world.
    joints : (dof,) array
        Overwritten with the answer, or with the nearest posture found, as ``place`` is.
    history : (k,) array
        Overwritten with the errors after the first k passes and steps of polishing [m].

    Returns
    -------
    error [m], angle error [rad], of the answer; passes and steps of polishing in all
    """
    n, count, spent = len(bodies.arm.lower), len(starts) + 1, 0
    first, answer, at, end = place.copy(), joints[:n].copy(), place.copy(), joints[:n].copy()
    best, best_error, best_angle = np.inf, np.inf, np.inf
    for i in range(2 * count if effort.most_passes > 0 else count):
        at[:], end[:] = first, joints[:n]
        if i % count > 0:
            end[:] = starts[i % count - 1]
        error, angle, used = np.inf, np.inf, 0
        if i < count and effort.most_passes > 0:
            error, angle, used = serial_passes(bodies, mounting, area, at, aim, effort, end, history[spent:])
        if tolerance_share(error, angle, effort) > 1.0:
            error, angle, steps = polish_with_base(
                sliding, mounting, area, at, aim, effort, end, history[spent + used :]
            )
            used += steps
        spent += used
        share = tolerance_share(error, angle, effort)
        if share < best:
            best, best_error, best_angle = share, error, angle
            place[:], answer[:] = at, end
        if share <= 1.0:
            break
    for k in range(n):
        joints[k] = answer[k]
    return best_error, best_angle, spent


@compiled
def serial_passes(
    bodies: RigidBodies,
    mounting: ArmMounting,
    area: BaseArea,
    place: Array,
    aim: Aim,
    effort: Effort,
    joints: Array,
    history: Array,
) -> tuple[float, float, int]:
    """M-FABRIK, Algorithm 1, from one posture, until it stalls: misses [m], [rad] and passes.

    Place and ``joints`` (n,) become the nearest that were met with the base in the area.
    """
    c, s, passes = math.cos(mounting.yaw), math.sin(mounting.yaw), 0
    goal, miss, now = in_arm_frame(place, mounting.yaw, mounting.rise, aim), np.empty(6), place.copy()
    posture, trail = posture_of(bodies, joints), np.empty(effort.most_passes + 1)
    best_error, best_angle = posture_error(bodies, goal, posture, miss)  # M-FABRIK, Alg. 1 l. 8
    # A base that has become inadmissible must move even where the tool is in place already.
    admissible = move_to_area(area, place[0], place[1]) == (place[0], place[1])
    best = tolerance_share(best_error, best_angle, effort) if admissible else np.inf
    trail[0] = best
    if best <= 1.0:
        return best_error, best_angle, 0
    while passes < effort.most_passes:  # l. 9
        passes += 1
        inward_pass(bodies, goal, posture)  # l. 11
        dx, dy = posture.outer[mounting.pivot, 0], posture.outer[mounting.pivot, 1]  # l. 13: ProjectPoint
        if mounting.pivot == 0:
            dx, dy = dx - bodies.root[0], dy - bodies.root[1]
        x, y = move_to_area(area, now[0] + c * dx - s * dy, now[1] + s * dx + c * dy)  # l. 15-19
        by_x, by_y = c * (x - now[0]) + s * (y - now[1]), c * (y - now[1]) - s * (x - now[0])
        now[0], now[1] = x, y
        _shift(posture, goal, by_x, by_y)
        backward_pass(bodies, posture)  # l. 21
        error, angle = posture_error(bodies, goal, posture, miss)  # l. 23
        history[passes - 1 : passes] = error
        share = tolerance_share(error, angle, effort)
        if share < best:
            best, best_error, best_angle = share, error, angle
            place[:], joints[:] = now, posture.joints
        trail[passes] = best
        if best <= 1.0 or stalled(trail, passes, False):
            break
    return best_error, best_angle, passes


@compiled
def polish_with_base(
    sliding: SerialArm,
    mounting: ArmMounting,
    area: BaseArea,
    place: Array,
    aim: Aim,
    effort: Effort,
    joints: Array,
    history: Array,
) -> tuple[float, float, int]:
    """Damped least squares on base and joints together: what is left [m], [rad] and steps tried.

    The base slides within its area, along the edge where it stands at that; the pivot turns for both. Place
    and ``joints`` (n,) are overwritten.
    """
    n, rows, reach = len(joints), 3 if aim.kind == POSITION else 6, effort.reach
    frames, J = np.empty((len(sliding.axis) + 1, 4, 4)), np.empty((6, n + 2))
    miss, left, q, step = np.empty(6), np.empty(6), np.zeros(n + 2), np.empty(n + 2)
    place[0], place[1] = move_to_area(area, place[0], place[1])
    goal, first, trial = in_arm_frame(place, mounting.yaw, mounting.rise, aim), place.copy(), q.copy()
    q[2:] = joints
    weight, damping, moved, tried = 0.5 * reach, 1e-3, True, 0
    error, angle = tool_error(sliding, goal, q, frames, miss)
    while tolerance_share(error, angle, effort) > 1.0 and damping <= MAX_DAMPING and tried < MAX_POLISH_STEPS:
        tried += 1
        if moved:  # the frames are those of the joints
            chain_jacobian(sliding, frames, J)
            scale_angles(frames[-1], aim.kind, weight, J)
            loosen_turns(miss, aim.cone, J)
        for i in range(6):
            left[i] = miss[i] if i < 3 else weight * miss[i]
        limited_step(sliding, J, left, rows, damping * reach * reach, q, step)
        x, y, out_x, out_y = _slid(sliding, mounting, area, first, q, step, trial)
        if out_x * out_x + out_y * out_y > 0.0 and near_boundary(
            area.vertices, area.rings, place[0], place[1], EDGE_TOLERANCE
        ):
            _without_slide_along(J, out_x, out_y)
            limited_step(sliding, J, left, rows, damping * reach * reach, q, step)
            x, y, _, _ = _slid(sliding, mounting, area, first, q, step, trial)
        new_error, new_angle = tool_error(sliding, goal, trial, frames, left)
        moved = squared(new_error) + squared(weight * new_angle) < squared(error) + squared(weight * angle)
        if moved:
            q[:], miss[:], place[0], place[1] = trial, left, x, y
            error, angle = new_error, new_angle
            damping = max(0.2 * damping, MIN_DAMPING)
        else:
            damping *= 8.0
        history[tried - 1 : tried] = error
    joints[:] = q[2:]
    return error, angle, tried


@compiled
def follow(
    sliding: SerialArm,
    pivot: int,
    turning: Turning,
    mount: Array,
    area: BaseArea,
    aim: Aim,
    effort: Effort,
    base: Array,
    joints: Array,
) -> tuple[float, float, bool]:
    """Bring the tool to its aim by `polish_with_base` alone, which goes on from where base and arm are.

    Base (3,) and ``joints`` (dof,) of an arm at a mount (4,) in the base frame are overwritten. Passes would
    leap: those of a UR5 take it to another posture each time.

    Returns
    -------
    error [m], angle error [rad], True where the heading is within its span
    """
    n, c, s, now = len(sliding.lower) - 2, math.cos(base[2]), math.sin(base[2]), joints[pivot]
    place = np.array([base[0] + c * mount[0] - s * mount[1], base[1] + s * mount[0] + c * mount[1]])
    q, mounting = joints[:n].copy(), ArmMounting(pivot, base[2] + mount[3], mount[2])
    error, angle, _ = polish_with_base(sliding, mounting, area, place, aim, effort, q, np.empty(0))
    joints[:n] = q
    joints[pivot], base[2], fits = share_turn(base[2] + q[pivot], base[2], now, turning)
    c, s = math.cos(base[2]), math.sin(base[2])
    base[0], base[1] = place[0] - (c * mount[0] - s * mount[1]), place[1] - (s * mount[0] + c * mount[1])
    return error, angle, fits


@compiled
def _slid(
    sliding: SerialArm,
    mounting: ArmMounting,
    area: BaseArea,
    first: Array,
    q: Array,
    step: Array,
    trial: Array,
) -> tuple[float, float, float, float]:
    """Write what a step comes to within area and limits: the place, and the unit vector that was cut off.

    The vector, in the arm's base frame, is zero where the base stays in its area.
    """
    for k in range(len(q)):
        trial[k] = min(max(q[k] + step[k], sliding.lower[k]), sliding.upper[k])
    c, s = math.cos(mounting.yaw), math.sin(mounting.yaw)
    to_x, to_y = first[0] + c * trial[0] - s * trial[1], first[1] + s * trial[0] + c * trial[1]
    x, y = move_to_area(area, to_x, to_y)
    if x == to_x and y == to_y:
        return x, y, 0.0, 0.0
    trial[0], trial[1] = c * (x - first[0]) + s * (y - first[1]), c * (y - first[1]) - s * (x - first[0])
    dx, dy = to_x - x, to_y - y
    off = math.sqrt(dx * dx + dy * dy)
    return x, y, (c * dx + s * dy) / off, (c * dy - s * dx) / off


@compiled
def _without_slide_along(J: Array, x: float, y: float) -> None:
    """Leave of the slides in a Jacobian (6, n + 2) what is at right angles to a unit vector."""
    for i in range(len(J)):
        along = x * J[i, 0] + y * J[i, 1]
        J[i, 0] -= along * x
        J[i, 1] -= along * y


@compiled
def _shift(posture: Posture, goal: Aim, x: float, y: float) -> None:
    """Take chain and target back by what the arm's base frame has moved."""
    for k in range(len(posture.outer)):
        posture.outer[k, 0] -= x
        posture.outer[k, 1] -= y
        posture.inner[k, 0] -= x
        posture.inner[k, 1] -= y
    goal.position[0] -= x
    goal.position[1] -= y


@compiled
def in_arm_frame(place: Array, yaw: float, rise: float, aim: Aim) -> Aim:
    """An aim in the base frame of an arm whose axis stands at a place."""
    c, s = math.cos(yaw), math.sin(yaw)
    dx, dy = aim.position[0] - place[0], aim.position[1] - place[1]
    position = np.array([c * dx + s * dy, c * dy - s * dx, aim.position[2] - rise])
    turn = np.empty((3, 3))
    for i in range(3):
        turn[0, i] = c * aim.turn[0, i] + s * aim.turn[1, i]
        turn[1, i] = c * aim.turn[1, i] - s * aim.turn[0, i]
        turn[2, i] = aim.turn[2, i]
    return Aim(position, aim.kind, turn, aim.cone)
