"""FABRIK passes in the arm's plane, and M-FABRIK's loop over them, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regionik.planners.flat import clamp, compiled, contains
from regionik.planners.kernels import PlaneArm, fit, place, widest_posture, wrap
from regionik.worlds.arrays import Array

Ints = NDArray[np.int64]


@compiled
def forward_reach(arm: PlaneArm, pitch: float, r_t: float, z_t: float, points: Array) -> None:
    """From the tool inwards: each knot on the line to the old one, bends kept within limits."""
    lengths, lower, upper = arm.lengths, arm.lower, arm.upper
    points[3, 0], points[3, 1] = r_t, z_t
    outer = 0.0
    for i in range(2, -1, -1):
        dr, dz = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        angle = np.arctan2(dz, dr)
        if i == 2:
            if np.isfinite(pitch):
                angle = pitch
        else:
            bend, _ = fit(outer - angle, lower[i + 1], upper[i + 1])
            angle = outer - bend
        points[i, 0] = points[i + 1, 0] - lengths[i] * np.cos(angle)
        points[i, 1] = points[i + 1, 1] - lengths[i] * np.sin(angle)
        outer = angle


@compiled
def backward_reach(
    arm: PlaneArm,
    pitch: float,
    points: Array,
    bends: Array,
) -> float:
    """From the shoulder outwards; returns by how much a fixed pitch breaks the last limit [rad]."""
    shoulder_r, shoulder_z, lengths, lower, upper = arm
    old_r, old_z = points[0, 0], points[0, 1]
    points[0, 0], points[0, 1] = shoulder_r, shoulder_z
    inner, excess = 0.0, 0.0
    for i in range(3):
        next_r, next_z = points[i + 1, 0], points[i + 1, 1]
        dr, dz = next_r - points[i, 0], next_z - points[i, 1]
        if dr == 0.0 and dz == 0.0:
            dr, dz = next_r - old_r, next_z - old_z
        wanted = np.arctan2(dz, dr)
        if i == 2 and np.isfinite(pitch):
            wanted = pitch
        bend, over = fit(wanted - inner, lower[i], upper[i])
        if i == 2:
            excess = over
        bends[i] = bend
        inner += bend
        points[i + 1, 0] = points[i, 0] + lengths[i] * np.cos(inner)
        points[i + 1, 1] = points[i, 1] + lengths[i] * np.sin(inner)
        old_r, old_z = next_r, next_z
    return excess if np.isfinite(pitch) else 0.0


@compiled
def mfabrik(
    arm: PlaneArm,
    vertices: Array,
    starts: Ints,
    mobile: bool,
    base: Array,
    plane_yaw: float,
    bends: Array,
    target: Array,
    facing: int,
    pitch: float,
    tolerance: float,
    most: int,
) -> tuple[float, int, float]:
    """M-FABRIK, Algorithm 1, for a planar arm on an omnidirectional base.

    Parameters
    ----------
    vertices, starts : arrays
        Admissible area as flat rings; no rings leave the whole floor free.
    mobile : bool
        False holds the base where it is.
    base : (2,) array
        Arm axis on the floor; overwritten with the answer.
    plane_yaw : float
        Direction of the arm's plane, used while the target is straight above the base.
    bends : (3,) array
        Start posture; overwritten with the answer.
    facing : +1 or -1
        -1 reaches over the arm's back: the target lies at negative r.
    pitch : float
        Fixed angle of the last link in the plane, NaN where it is free.
    most : int
        Passes after which to give up.

    Returns
    -------
    error [m], iterations, plane_yaw
    """
    shoulder_r, _, lengths, _, _ = arm
    points = np.empty((4, 2))
    place(arm, bends, points)
    bounded = len(starts) > 1
    tx, ty, tz = target[0], target[1], target[2]
    ux, uy = np.cos(plane_yaw), np.sin(plane_yaw)
    ex = base[0] + points[3, 0] * ux - tx
    ey = base[1] + points[3, 0] * uy - ty
    ez = points[3, 1] - tz
    error = np.sqrt(ex * ex + ey * ey + ez * ez)
    # A base that has become inadmissible must move even where the tool is in place already.
    settled = not (mobile and bounded) or contains(vertices, starts, base[0], base[1])
    if np.isfinite(pitch) and abs(wrap(bends[0] + bends[1] + bends[2] - pitch)) > 1e-9:
        settled = False
    iterations = 0
    while (error > tolerance or not settled) and iterations < most:
        iterations += 1
        # The plane turns to the target.
        dx, dy = tx - base[0], ty - base[1]
        rho = np.sqrt(dx * dx + dy * dy)
        if rho > 1e-12:
            ux, uy = facing * dx / rho, facing * dy / rho
        r_t = facing * rho
        forward_reach(arm, pitch, r_t, tz, points)  # l. 11
        if mobile:
            shift = points[0, 0] - shoulder_r  # l. 13: projected onto the floor
            x, y = base[0] + shift * ux, base[1] + shift * uy
            if bounded:  # l. 15-19
                x, y = clamp(vertices, starts, x, y)
            base[0], base[1] = x, y
            dx, dy = tx - x, ty - y
            rho = np.sqrt(dx * dx + dy * dy)
            if rho > 1e-12:
                ux, uy = facing * dx / rho, facing * dy / rho
            moved = facing * rho - r_t
            r_t = facing * rho
            for i in range(4):
                points[i, 0] += moved
        excess = backward_reach(arm, pitch, points, bends)
        er, ez = points[3, 0] - r_t, points[3, 1] - tz
        error = np.sqrt(er * er + ez * ez)
        if excess > 1e-9:  # a fixed pitch is not met to within the tolerance, but met
            error += tolerance + excess * lengths[2]
        settled = True
    return error, iterations, np.arctan2(uy, ux)


@compiled
def solve(
    arm: PlaneArm,
    postures: Array,
    vertices: Array,
    starts: Ints,
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

    Limits can stall the passes; the last resort looks through the arm's self-motion, so that a base in the
    admissible area is never given up. Arguments as in `mfabrik`.

    Returns
    -------
    error [m], iterations (all starts together), restarts, plane_yaw
    """
    shoulder_r, _, lengths, _, _ = arm
    first_base = base.copy()
    total = 0
    error = np.inf
    yaw = plane_yaw
    start = bends.copy()
    for attempt in range(len(postures) + 1):
        base[:] = first_base
        bends[:] = start if attempt == 0 else postures[attempt - 1]
        error, passes, yaw = mfabrik(
            arm,
            vertices,
            starts,
            mobile,
            base,
            plane_yaw,
            bends,
            target,
            facing,
            pitch,
            tolerance,
            most,
        )
        total += passes
        if error <= tolerance:
            return error, total, attempt, yaw
    base[:] = first_base
    if mobile and len(starts) > 1:
        base[0], base[1] = clamp(vertices, starts, base[0], base[1])
    dx, dy = target[0] - base[0], target[1] - base[1]
    rho = np.sqrt(dx * dx + dy * dy)
    yaw = np.arctan2(facing * dy, facing * dx) if rho > 1e-12 else plane_yaw
    found = widest_posture(arm, pitch, facing * rho, target[2], bends, 1440)
    if not found and mobile and len(starts) <= 1:
        for k in range(200):
            rho = (k + 0.5) / 200.0 * (lengths.sum() + abs(shoulder_r))
            found = widest_posture(arm, pitch, facing * rho, target[2], bends, 360)
            if found:
                base[0] = target[0] - facing * rho * np.cos(yaw)
                base[1] = target[1] - facing * rho * np.sin(yaw)
                break
    if not found:
        bends[:] = start
        base[:] = first_base
        return error, total, len(postures), plane_yaw
    points = np.empty((4, 2))
    place(arm, bends, points)
    error = np.hypot(points[3, 0] - facing * rho, points[3, 1] - target[2])
    return error, total + 1, len(postures) + 1, yaw


@compiled
def solve_batch(
    arm: PlaneArm,
    postures: Array,
    vertices: Array,
    starts: Ints,
    mobile: bool,
    bases: Array,
    plane_yaws: Array,
    bends: Array,
    targets: Array,
    facing: int,
    pitch: float,
    tolerance: float,
    most: int,
    errors: Array,
    iterations: Ints,
) -> None:
    """`solve` for many targets; ``bases``, ``plane_yaws`` and ``bends`` are overwritten with the answers."""
    for k in range(len(targets)):
        errors[k], iterations[k], _, plane_yaws[k] = solve(
            arm,
            postures,
            vertices,
            starts,
            mobile,
            bases[k],
            plane_yaws[k],
            bends[k],
            targets[k],
            facing,
            pitch,
            tolerance,
            most,
        )
