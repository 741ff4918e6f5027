"""M-FABRIK for states on a way, each from the one before it, in one compiled call; the arm axis is held."""

from __future__ import annotations

import numpy as np

from regionik.planners.geometry.flat import compiled
from regionik.planners.solvers.callsheet import (
    arm_in,
    bends_at,
    effort_in,
    hinges_in,
    keep_span,
    pitch_in,
    seat_in,
    span_in,
)
from regionik.planners.solvers.onecall import alone, away, axis_at, joint_of, shared_turn
from regionik.planners.solvers.planar_arm import nearest_posture
from regionik.worlds.arrays import Array

PITCHES = 180  # of the last link, tried to either side for the posture of least change
TILT = 0.5  # how far to either side [rad]


@compiled
def least_change(
    call: Array, target: Array, base: Array, joints: Array, new_base: Array, new_joints: Array
) -> bool:
    """With the arm axis held, the posture on a target whose bends change least; whether there is one."""
    x, y, _ = axis_at(call, base, joints)
    near, bends, facing = np.array(bends_at(call, joints)), np.empty(3), effort_in(call).facing
    dx, dy = target[0] - x, target[1] - y
    r, plane_yaw = facing * np.hypot(dx, dy), np.arctan2(facing * dy, facing * dx)
    change = nearest_posture(arm_in(call), pitch_in(call), r, target[2], near, bends, PITCHES, TILT)
    if not np.isfinite(change):
        return False
    hinges, seat = hinges_in(call), seat_in(call)
    new_joints[:] = joints
    for i in range(3):
        new_joints[1 + i] = joint_of(hinges[i], bends[i], near[i])
    new_joints[0], new_base[2], fits = shared_turn(plane_yaw - seat.zero, base[2], joints[0], seat.turning)
    dx, dy = away(seat, new_base[2])
    new_base[0], new_base[1] = x - dx, y - dy
    return fits


@compiled
def answer_way(
    call: Array, targets: Array, places: Array, wished: Array, bend: float, base: Array, joints: Array,
    new_bases: Array, new_joints: Array,
) -> int:  # fmt: skip
    """The call for states on a way, each from the one before it, the arm axis held at each.

    FABRIK from the wished posture comes first; where its passes stall or jump, the posture of least change.
    Fills base poses (n, 3) and joints (n, dof), and returns how many states come before the first that has
    none.

    Parameters
    ----------
    call : (k,) array
        As `callsheet.held` gives it.
    targets : (n, 3) array
        [m]
    places : (n, 3) array
        Base poses; where the heading is free it is NaN, and the place is that of the arm axis [m], [rad].
    wished : (n, dof) array
        The pivot's value does not matter: the heading decides on it.
    bend : float
        Change of a joint against the wished posture that counts as a jump [rad].
    base, joints : (3,), (dof,) arrays
        The state before the first.
    """
    call, span = call.copy(), span_in(call)
    yaw, near = base[2], joints.copy()
    for i in range(len(targets)):
        free = np.isnan(places[i, 2])
        start, near[1:] = places[i].copy(), wished[i, 1:]
        if free:
            start[2] = yaw
            x, y, _ = axis_at(call, start, near)
            start[0], start[1] = 2 * start[0] - x, 2 * start[1] - y
        low, high = span if free else (start[2], start[2])
        keep_span(call, low, high)
        _, _, met = alone(call, targets[i], start, near, new_bases[i], new_joints[i])
        off = not met or np.abs(new_joints[i, 1:] - near[1:]).max() > bend
        if off and not least_change(call, targets[i], start, near, new_bases[i], new_joints[i]):
            return i
        if not free:
            new_bases[i] = start
        yaw, near[0] = new_bases[i, 2], new_joints[i, 0]
    return len(targets)
