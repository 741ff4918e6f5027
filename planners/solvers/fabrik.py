"""FABRIK passes in the arm's plane, and M-FABRIK's loop over them, compiled."""

from __future__ import annotations

import numpy as np

from regionik.planners.geometry.edgetree import EdgeTree, clamp, likely
from regionik.planners.geometry.flat import compiled
from regionik.planners.geometry.trigonometry import direction, turned, woven
from regionik.planners.solvers.passes import (
    Knots,
    Links,
    Pair,
    Triple,
    fast,
    holds_at,
    inwards,
    outwards,
    placed,
    sight,
)
from regionik.planners.solvers.planar_arm import PlaneArm, fit, place, widest_posture, wrap
from regionik.worlds.arrays import Array

PATIENCE, STALLED = 10, 0.9  # passes in which the error must come down to this share, for a start to go on
STRAIGHT = 1e-12  # a target so near to the axis, seen from above, does not turn the plane [m]


@woven
def bends_between(shoulder: Pair, knots: Knots) -> Triple:
    """Bends of the links between shoulder and knots, each link's against the one before it [rad]."""
    first = direction(knots[1] - shoulder[1], knots[0] - shoulder[0])
    second = direction(knots[3] - knots[1], knots[2] - knots[0])
    return first, second - first, direction(knots[5] - knots[3], knots[4] - knots[2]) - second


@compiled
def _seen(dx: float, dy: float, facing: int, ux: float, uy: float) -> tuple[float, float, float]:
    """The plane's direction towards a target, the old one where it is straight above, and the target's r."""
    rho = np.sqrt(dx * dx + dy * dy)
    if rho > STRAIGHT:
        ux, uy = facing * dx / rho, facing * dy / rho
    return ux, uy, facing * rho


@fast
def mfabrik(
    links: Links,
    area: EdgeTree,
    mobile: bool,
    x: float,
    y: float,
    plane_yaw: float,
    bends: Triple,
    target: Triple,
    facing: int,
    pitch: float,
    tolerance: float,
    most: int,
    patience: int,
) -> tuple[float, int, float, float, float, Knots]:
    """M-FABRIK, Algorithm 1, for a planar arm on an omnidirectional base, from one start.

    Parameters
    ----------
    links : Links
    area : EdgeTree
        Admissible area; without edges the whole floor is free.
    mobile : bool
        False holds the base where it is.
    x, y : float
        Arm axis on the floor [m].
    plane_yaw : float
        Direction of the arm's plane, used while the target is straight above the base [rad].
    bends : three floats
        Start posture [rad].
    target : three floats
        [m]
    facing : +1 or -1
        -1 reaches over the arm's back: the target lies at negative r.
    pitch : float
        Fixed angle of the last link in the plane, NaN where it is free.
    most : int
        Passes after which to give up.
    patience : int
        Passes in which the error must come down, lest the start is given up.

    Returns
    -------
    error [m], iterations, x, y [m], plane_yaw [rad], knots in the plane [m]
    """
    shoulder, lengths, limits = links.shoulder, links.lengths, links.holds
    held = np.isfinite(pitch)
    tool = turned(pitch) if held else (0.0, 0.0)
    second = bends[0] + bends[1]
    knots = placed(shoulder, lengths, turned(bends[0]), turned(second), turned(second + bends[2]))
    bounded = mobile and len(area.edges) > 0
    tx, ty, tz = target
    ux, uy = turned(plane_yaw)
    ex, ey, ez = x + knots[4] * ux - tx, y + knots[4] * uy - ty, knots[5] - tz
    error = np.sqrt(ex * ex + ey * ey + ez * ez)
    iterations, mark, r_t, seen = 0, np.inf, 0.0, tool
    edge = likely(area, x, y) if bounded else 0
    # A base that has become inadmissible must move even where the tool is in place already.
    settled = True
    if bounded and error <= tolerance:
        settled = (x, y) == clamp(area, x, y, edge)[:2]
    if held and abs(wrap(bends[0] + bends[1] + bends[2] - pitch)) > 1e-9:
        settled = False
    while (error > tolerance or not settled) and iterations < most:
        if iterations % patience == patience - 1:
            if error > STALLED * mark:
                break
            mark = error
        iterations += 1
        if iterations == 1:  # the plane turns to the target
            ux, uy, r_t = _seen(tx - x, ty - y, facing, ux, uy)
            seen = sight(tool, (r_t, tz), knots)
        inner, moved = inwards(shoulder, lengths, limits[1], limits[2], seen, (r_t, tz), knots), 0.0  # l. 11
        if mobile:
            shift, before = inner.root - shoulder[0], r_t  # l. 13: projected onto the floor
            x, y = x + shift * ux, y + shift * uy
            if bounded:  # l. 15-19
                x, y, edge = clamp(area, x, y, edge)
                ux, uy, r_t = _seen(tx - x, ty - y, facing, ux, uy)
            else:
                r_t -= shift
                if r_t * facing < 0.0:  # the axis has passed below the target
                    ux, uy, r_t = -ux, -uy, -r_t
            moved = r_t - before
        knots, seen = outwards(shoulder, lengths, limits, tool, (r_t, tz), inner, moved)
        er, ez = knots[4] - r_t, knots[5] - tz
        error = np.sqrt(er * er + ez * ez)
        if held:
            link_r, link_z = knots[4] - knots[2], knots[5] - knots[3]
            along, across = link_r * tool[0] + link_z * tool[1], link_r * tool[1] - link_z * tool[0]
            excess = abs(np.arctan2(across, along))
            if excess > 1e-9:  # a fixed pitch is not met to within the tolerance, but met
                error += tolerance + excess * lengths[2]
        settled = True
    return error, iterations, x, y, direction(uy, ux), knots


@compiled
def solve(
    arm: PlaneArm,
    holds: Array,
    postures: Array,
    area: EdgeTree,
    mobile: bool,
    base: Array,
    plane_yaw: float,
    bends: Array,
    target: Array,
    facing: int,
    pitch: float,
    tolerance: float,
    most: int,
) -> tuple[float, int, int, float]:
    """M-FABRIK with restarts: the given posture, then ``postures`` (k, 3), then the widest one at the base.

    Limits can stall the passes, and a start that stalls is left for the next one; where none gets there, all
    are followed to the end. The last resort looks through the arm's self-motion, so that a base in the
    admissible area is never given up. ``base`` (2,) and ``bends`` (3,) are overwritten with the answer; the
    other arguments are as in `mfabrik`, and ``holds`` as in `Links`.

    Returns
    -------
    error [m], iterations (all starts together), restarts, plane_yaw
    """
    links = Links(
        (arm.shoulder_r, arm.shoulder_z), (arm.lengths[0], arm.lengths[1], arm.lengths[2]), holds_at(holds, 0)
    )
    error, passes, x, y, yaw, knots = mfabrik(
        links, area, mobile, base[0], base[1], plane_yaw, (bends[0], bends[1], bends[2]),
        (target[0], target[1], target[2]), facing, pitch, tolerance, most, min(PATIENCE, most),
    )  # fmt: skip
    restarts = 0
    if error > tolerance:
        error, passes, restarts, yaw = restarted(
            arm, links, postures, area, mobile, base, plane_yaw, bends, target, facing, pitch, tolerance,
            most, passes,
        )  # fmt: skip
    else:
        base[0], base[1] = x, y
        if passes > 0:
            bends[0], bends[1], bends[2] = bends_between(links.shoulder, knots)
    if error <= tolerance and passes > 0:
        for i in range(3):
            bends[i], _ = fit(bends[i], arm.lower[i], arm.upper[i])
    return error, passes, restarts, yaw


@compiled
def restarted(
    arm: PlaneArm,
    links: Links,
    postures: Array,
    area: EdgeTree,
    mobile: bool,
    base: Array,
    plane_yaw: float,
    bends: Array,
    target: Array,
    facing: int,
    pitch: float,
    tolerance: float,
    most: int,
    total: int,
) -> tuple[float, int, int, float]:
    """What `solve` does after ``total`` passes from the given posture; bends may still be whole turns off."""
    point, error = (target[0], target[1], target[2]), np.inf
    for attempt in range(1, 2 * len(postures) + 2):  # once over the starts in a hurry, once to the end
        again, patience = attempt % (len(postures) + 1), PATIENCE if attempt <= len(postures) else most + 1
        start = bends if again == 0 else postures[again - 1]
        error, passes, x, y, yaw, knots = mfabrik(
            links, area, mobile, base[0], base[1], plane_yaw, (start[0], start[1], start[2]), point, facing,
            pitch, tolerance, most, patience,
        )  # fmt: skip
        total += passes
        if error <= tolerance:
            base[0], base[1] = x, y
            bends[0], bends[1], bends[2] = start[0], start[1], start[2]
            if passes > 0:
                bends[0], bends[1], bends[2] = bends_between(links.shoulder, knots)
            return error, total, attempt, yaw
    error_at_best, yaw = _widest_at(arm, area, mobile, base, plane_yaw, bends, target, facing, pitch)
    if np.isfinite(error_at_best):
        return error_at_best, total + 1, 2 * len(postures) + 2, yaw
    return error, total, 2 * len(postures) + 1, plane_yaw


@compiled
def _widest_at(
    arm: PlaneArm,
    area: EdgeTree,
    mobile: bool,
    base: Array,
    plane_yaw: float,
    bends: Array,
    target: Array,
    facing: int,
    pitch: float,
) -> tuple[float, float]:
    """The widest posture from the base, or where the floor is free from any distance.

    Overwrites base and bends; returns the error, infinite where there is none, and the plane's direction.
    """
    x, y = base[0], base[1]
    bounded = len(area.edges) > 0
    if mobile and bounded:
        x, y, _ = clamp(area, x, y, likely(area, x, y))
    dx, dy = target[0] - x, target[1] - y
    rho = np.sqrt(dx * dx + dy * dy)
    yaw = np.arctan2(facing * dy, facing * dx) if rho > STRAIGHT else plane_yaw
    far = arm.lengths[0] + arm.lengths[1] + arm.lengths[2] + abs(arm.shoulder_r)
    found = np.empty(3)
    for k in range(201 if mobile and not bounded else 1):
        if k > 0:
            rho = (k - 0.5) / 200.0 * far
            x, y = target[0] - facing * rho * np.cos(yaw), target[1] - facing * rho * np.sin(yaw)
        if widest_posture(arm, pitch, facing * rho, target[2], found, 1440 if k == 0 else 360):
            base[0], base[1] = x, y
            bends[0], bends[1], bends[2] = found[0], found[1], found[2]
            points = np.empty((4, 2))
            place(arm, bends, points)
            return np.hypot(points[3, 0] - facing * rho, points[3, 1] - target[2]), yaw
    return np.inf, plane_yaw
