"""M-FABRIK from base and joints to base and joints in one compiled call, for arms in one plane."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba.extending import is_jitted

from regionik.planners.geometry.flat import compiled
from regionik.planners.geometry.trigonometry import turned, woven
from regionik.planners.solvers.callsheet import (
    FACE_TARGET,
    FACING,
    FIXED,
    MOBILE,
    MOST,
    PITCH,
    TOLERANCE,
    Hinge,
    Seat,
    Turning,
    area_in,
    arm_in,
    bends_at,
    hinges_in,
    links_in,
    postures_in,
    seat_in,
)
from regionik.planners.solvers.fabrik import PATIENCE, bends_between, mfabrik, restarted
from regionik.planners.solvers.handed import HANDED, address, alike, layout_is_known, row_at
from regionik.planners.solvers.passes import Pair, fast, pasted
from regionik.planners.solvers.planar_arm import fit, wrap
from regionik.worlds.arrays import Array

ROUNDING = 1e-9  # by which a heading may be outside its span [rad]
OneCall = Callable[[Array, object, object, object, Array, Array], tuple[float, int, bool]]


@woven
def into_span(yaw: float, low: float, high: float) -> float:
    """The heading within a span that is nearest to a heading, the shorter way round from it [rad]."""
    half = 0.5 * (high - low)
    if half >= np.pi:
        return yaw
    off = -wrap(0.5 * (low + high) - yaw)
    return yaw if abs(off) <= half else yaw - off + (half if off > 0.0 else -half)


@woven
def shared_turn(plane: float, yaw: float, now: float, turning: Turning) -> tuple[float, float, bool]:
    """As `share_turn`, for kernels."""
    lower, upper, heading, low, high = turning
    if heading == FACE_TARGET:
        pivot = min(max(0.0, lower), upper)
        yaw += wrap(plane - yaw - pivot)
        return pivot, yaw, abs(into_span(yaw, low, high) - yaw) <= ROUNDING
    if heading == FIXED:
        low, high = yaw, yaw
    yaw = into_span(yaw, low, high)  # the base turns into its span, and on by what the pivot cannot take
    to = now + wrap(plane - yaw - now)
    pivot = min(max(to, lower), upper)
    yaw += to - pivot
    end = into_span(yaw, low, high)
    if abs(end - yaw) <= ROUNDING:
        return pivot, yaw, True
    pivot, over = fit(plane - end, lower, upper)
    if over <= 0.0:
        return pivot, end, True
    end += wrap(plane - end - pivot)
    return pivot, end, abs(into_span(end, low, high) - end) <= ROUNDING


@compiled
def share_turn(plane: float, yaw: float, now: float, turning: Turning) -> tuple[float, float, bool]:
    """SetBaseOrientation of Algorithm 1: the turn to the arm's plane shared between pivot and base.

    Parameters
    ----------
    plane : float
        What the base's heading and the pivot must add up to, by whole turns [rad].
    yaw, now : float
        Heading and pivot as they are [rad].

    Returns
    -------
    pivot, heading [rad], whether that is within its span
    """
    return shared_turn(plane, yaw, now, turning)


@woven
def offset(seat: Seat, heading: Pair) -> Pair:
    """From the base to the arm axis, the base's heading as cosine and sine [m]."""
    c, s = heading
    return c * seat.ahead - s * seat.aside, s * seat.ahead + c * seat.aside


@woven
def away(seat: Seat, yaw: float) -> Pair:
    """The same from the heading [rad]."""
    if seat.ahead == 0.0 and seat.aside == 0.0:
        return 0.0, 0.0
    return offset(seat, turned(yaw))


@compiled
def axis_at(call: Array, base: Array, joints: Array) -> tuple[float, float, float]:
    """Where base and joints put the arm axis [m], and the direction of the arm's plane [rad]."""
    seat = seat_in(call)
    dx, dy = away(seat, base[2])
    return base[0] + dx, base[1] + dy, base[2] + seat.zero + joints[0]


@woven
def within_limits(hinge: Hinge, bend: float) -> float:
    """A bend to the last digit within its limits; see `kernels.fit` [rad]."""
    near = hinge.middle + wrap(bend - hinge.middle)
    near = hinge.lower if near < hinge.lower else near
    return hinge.upper if near > hinge.upper else near


@woven
def joint_of(hinge: Hinge, bend: float, before: float) -> float:
    """Joint value of a bend, taken to the turn within its limits, else nearest to the bend before."""
    middle = hinge.middle if hinge.bounded else before
    value: float = hinge.sign * (middle + wrap(bend - middle) - hinge.offset)
    return value


@pasted
def solved(
    call: Array, target: Array, base: Array, joints: Array, new_base: Array, new_joints: Array
) -> tuple[float, int, bool]:
    """One call: error [m], passes, whether the target is met; fills the last two.

    Minus one pass refuses what is not finite.
    """
    nothing = 0.0  # times what is not finite it is NaN, and stays so
    for i in range(3):
        nothing += 0.0 * target[i] + 0.0 * base[i]
    for i in range(len(joints)):
        nothing += 0.0 * joints[i]
    if nothing != 0.0:
        return np.nan, -1, False
    x, y, plane_yaw = axis_at(call, base, joints)
    bends = bends_at(call, joints)
    links, hinges = links_in(call), hinges_in(call)
    facing, pitch, tolerance = int(call[FACING]), call[PITCH], call[TOLERANCE]
    most, mobile, area = int(call[MOST]), call[MOBILE] != 0.0, area_in(call)
    error, passes, new_x, new_y, yaw, knots = mfabrik(
        links, area, mobile, x, y, plane_yaw, bends, (target[0], target[1], target[2]),
        facing, pitch, tolerance, most, min(PATIENCE, most),
    )  # fmt: skip
    new_base[0], new_base[1], new_joints[1], new_joints[2], new_joints[3] = new_x, new_y, *bends
    if error > tolerance:
        new_base[0], new_base[1] = x, y
        error, passes, _, yaw = restarted(
            arm_in(call), links, postures_in(call), area, mobile, new_base[:2], plane_yaw, new_joints[1:4],
            target, facing, pitch, tolerance, most, passes,
        )  # fmt: skip
    elif passes > 0:
        new_joints[1], new_joints[2], new_joints[3] = bends_between(links.shoulder, knots)
    if error <= tolerance and passes > 0:
        for i in range(3):
            new_joints[1 + i] = within_limits(hinges[i], new_joints[1 + i])
    for i in range(3):
        new_joints[1 + i] = joint_of(hinges[i], new_joints[1 + i], bends[i])
    for i in range(4, len(joints)):
        new_joints[i] = joints[i]
    seat = seat_in(call)
    new_joints[0], new_base[2], fits = shared_turn(yaw - seat.zero, base[2], joints[0], seat.turning)
    dx, dy = away(seat, new_base[2])
    new_base[0], new_base[1] = new_base[0] - dx, new_base[1] - dy
    return error, passes, fits and error <= tolerance


@fast
def _handed(
    call: int, target: int, base: int, joints: int, new_base: int, new_joints: int
) -> tuple[float, int, bool]:
    room = address(new_base)
    if (
        alike(address(target), room)
        and alike(address(base), room)
        and alike(address(joints), address(new_joints))
    ):
        return solved(
            row_at(address(call)), row_at(address(target)), row_at(address(base)), row_at(address(joints)),
            row_at(room), row_at(address(new_joints)),
        )  # fmt: skip
    return np.nan, -1, False


@fast
def alone(
    call: Array, target: Array, base: Array, joints: Array, new_base: Array, new_joints: Array
) -> tuple[float, int, bool]:
    """`solved` for rows that are copied: it is then compiled for one kind of arrays only."""
    return solved(call, target.copy(), base.copy(), joints.copy(), new_base, new_joints)


def _looked_at(
    call: Array, target: object, base: object, joints: object, new_base: Array, new_joints: Array
) -> tuple[float, int, bool]:
    """As `_handed`, where Python itself looks at what it hands over."""
    for given, room in ((target, new_base), (base, new_base), (joints, new_joints)):
        if type(given) is not np.ndarray or given.dtype != room.dtype or given.shape != room.shape:
            return np.nan, -1, False
    return alone(call, target, base, joints, new_base, new_joints)  # type: ignore[arg-type]


@cache
def one_call() -> OneCall:
    """The call from Python: ``(call, target, base, joints, new_base, new_joints)``.

    It fills the last two, which are trusted as ``call`` is, and returns error [m], passes and whether the
    target is met. Minus one pass refuses what is not finite and what is no plain row of floats as long as the
    one that is to be filled.
    """
    kernel: Any = _handed
    if not is_jitted(kernel) or not layout_is_known():
        return _looked_at
    kernel.compile((HANDED,) * 6)
    call: OneCall = kernel.get_overload((HANDED,) * 6)
    return call
