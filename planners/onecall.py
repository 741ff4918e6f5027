"""M-FABRIK from base and joints to base and joints in one compiled call, for arms in one plane.

All that a solver prepares lies in one flat array, so that a call from Python hands over few arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import is_jitted
from numpy.typing import NDArray

from regionik.planners.edgetree import EdgeTree, tree_of
from regionik.planners.fabrik import PATIENCE, mfabrik, solve
from regionik.planners.flat import FlatPolygon, Index, compiled
from regionik.planners.kernels import PlaneArm, fit, wrap
from regionik.planners.lanes import abreast
from regionik.planners.passes import Knots, Links, holds_at
from regionik.worlds.arrays import Array

ROUNDING = 1e-9  # by which a heading may be outside its span [rad]
FREE, FACE_TARGET, FIXED = range(3)  # what the heading of the base is to be
REFUSED, MISSED, MET = range(3)  # how a call ends

_SHOULDER, _LENGTHS, _LOWER, _UPPER, _HOLDS, _SIGN, _OFFSET, _PIVOT, _MOUNT = 0, 2, 5, 8, 11, 32, 35, 38, 41
_HEADING, _FACING, _PITCH, _TOLERANCE, _MOST, _DOF = 45, 48, 49, 50, 51, 52
_MOBILE, _POSTURES, _EDGES, _REST = 53, 54, 55, 56  # how many postures and edges follow, then they and boxes


class Turning(NamedTuple):
    """How base and pivot share a turn.

    Attributes
    ----------
    lower, upper : float
        Limits of the pivot [rad].
    heading : int
        `FREE`, `FACE_TARGET` or `FIXED`.
    low, high : float
        Span of headings that the base keeps to [rad].
    """

    lower: float
    upper: float
    heading: int
    low: float
    high: float


class Joined(NamedTuple):
    """How joints and base make bends and places, and when to be content.

    Attributes
    ----------
    sign, offset : (3,) array
        ``bend = sign * joint + offset`` [rad].
    zero : float
        Direction of the arm's plane, seen from its base frame, with the pivot at zero [rad].
    mount : (4,) array
        Arm base in the base frame: x, y, z [m], yaw [rad].
    facing : int
    pitch : float
        Of the last link, NaN where it is free [rad].
    tolerance : float
        [m]
    most : int
        Passes from each start.
    dof : int
    """

    sign: Array
    offset: Array
    zero: float
    mount: Array
    facing: int
    pitch: float
    tolerance: float
    most: int
    dof: int


def packed(
    arm: PlaneArm, holds: Array, postures: Array, joined: Joined, turning: Turning, area: FlatPolygon
) -> Array:
    """All that a call needs to know, as one flat array."""
    tree = tree_of(area.vertices, area.starts)
    parts = (
        [arm.shoulder_r, arm.shoulder_z], arm.lengths, arm.lower, arm.upper, holds.ravel(), joined.sign,
        joined.offset, [joined.zero, turning.lower, turning.upper], joined.mount,
        [turning.heading, turning.low, turning.high, joined.facing, joined.pitch, joined.tolerance],
        [joined.most, joined.dof, 1, len(postures), len(tree.edges)],
        postures.ravel(), tree.edges.ravel(), tree.boxes.ravel(),
    )  # fmt: skip
    return np.concatenate([np.asarray(part, dtype=np.float64) for part in parts])


def held(call: Array) -> Array:
    """The same for a call that leaves the arm axis where it is."""
    call = np.array(call)
    call[_MOBILE] = 0
    return call


@compiled
def into_span(yaw: float, low: float, high: float) -> float:
    """The heading within a span that is nearest to a heading, the shorter way round from it [rad]."""
    if high - low >= 2 * np.pi:
        return yaw
    half = 0.5 * (high - low)
    off = -wrap(0.5 * (low + high) - yaw)
    return yaw if abs(off) <= half else yaw - off + (half if off > 0.0 else -half)


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
    lower, upper, heading, low, high = turning
    if heading == FACE_TARGET:
        pivot = min(max(0.0, lower), upper)
        yaw += wrap(plane - yaw - pivot)
        return pivot, yaw, abs(into_span(yaw, low, high) - yaw) <= ROUNDING
    if heading == FIXED:
        low, high = yaw, yaw
    yaw = into_span(yaw, low, high)  # the base turns into its span, and on by what the pivot cannot take
    turned = now + wrap(plane - yaw - now)
    pivot = min(max(turned, lower), upper)
    yaw += turned - pivot
    if abs(into_span(yaw, low, high) - yaw) > ROUNDING:
        yaw = into_span(yaw, low, high)
        pivot, over = fit(plane - yaw, lower, upper)
        if over > 0.0:
            yaw += wrap(plane - yaw - pivot)
    return pivot, yaw, abs(into_span(yaw, low, high) - yaw) <= ROUNDING


@compiled
def axis_at(call: Array, base: Array, joints: Array) -> tuple[float, float, float]:
    """Where base and joints put the arm axis [m], and the direction of the arm's plane [rad]."""
    x, y = call[_MOUNT], call[_MOUNT + 1]
    plane_yaw = base[2] + call[_MOUNT + 3] + call[_PIVOT] + joints[0]
    if x == 0.0 and y == 0.0:
        return base[0], base[1], plane_yaw
    c, s = np.cos(base[2]), np.sin(base[2])
    return base[0] + (c * x - s * y), base[1] + (s * x + c * y), plane_yaw


@compiled
def bend_at(call: Array, joints: Array, i: int) -> float:
    """Bend of link i [rad]."""
    bend: float = call[_SIGN + i] * joints[1 + i] + call[_OFFSET + i]
    return bend


@compiled
def _bend(call: Array, knots: Knots, joints: Array) -> None:
    """Write the bends of the links between shoulder and knots in the place of the hinges' joints."""
    first = np.arctan2(knots[1] - call[1], knots[0] - call[0])
    second = np.arctan2(knots[3] - knots[1], knots[2] - knots[0])
    third = np.arctan2(knots[5] - knots[3], knots[4] - knots[2])
    joints[1], _ = fit(first, call[_LOWER], call[_UPPER])
    joints[2], _ = fit(second - first, call[_LOWER + 1], call[_UPPER + 1])
    joints[3], _ = fit(third - second, call[_LOWER + 2], call[_UPPER + 2])


@compiled
def _hinge(call: Array, i: int, bend: float, now: float) -> float:
    """Joint value of a bend, taken to the turn within its limits, or without any nearest to ``now``."""
    lower, upper, sign, offset = call[_LOWER + i], call[_UPPER + i], call[_SIGN + i], call[_OFFSET + i]
    middle = sign * now + offset
    if np.isfinite(lower) and np.isfinite(upper):
        middle = 0.5 * (lower + upper)
    value: float = sign * (middle + wrap(bend - middle) - offset)
    return value


@compiled
def _stand(
    call: Array, x: float, y: float, plane_yaw: float, yaw: float, now: float
) -> tuple[float, float, float, float, bool]:
    """Base pose and pivot for an axis and a plane's direction, and whether the heading fits."""
    turning = Turning(
        call[_PIVOT + 1], call[_PIVOT + 2], int(call[_HEADING]), call[_HEADING + 1], call[_HEADING + 2]
    )
    pivot, yaw, fits = share_turn(plane_yaw - call[_PIVOT] - call[_MOUNT + 3], yaw, now, turning)
    ahead, aside = call[_MOUNT], call[_MOUNT + 1]
    if ahead != 0.0 or aside != 0.0:
        c, s = np.cos(yaw), np.sin(yaw)
        x, y = x - (c * ahead - s * aside), y - (s * ahead + c * aside)
    return x, y, yaw, pivot, fits


@compiled
def arm_in(call: Array) -> PlaneArm:
    return PlaneArm(call[0], call[1], call[_LENGTHS:_LOWER], call[_LOWER:_UPPER], call[_UPPER:_HOLDS])


@compiled
def links_in(call: Array) -> Links:
    lengths = call[_LENGTHS], call[_LENGTHS + 1], call[_LENGTHS + 2]
    return Links((call[0], call[1]), lengths, holds_at(call, _HOLDS))


@compiled
def area_in(call: Array) -> EdgeTree:
    first = _REST + 3 * int(call[_POSTURES])
    end = first + 4 * int(call[_EDGES])
    return EdgeTree(call[first:end].reshape(-1, 4), call[end:].reshape(-1, 4))


@compiled
def _solved(
    call: Array,
    target: Array,
    base: Array,
    joints: Array,
    new_base: Array,
    new_joints: Array,
) -> tuple[float, int, int]:
    if len(target) != 3 or len(base) != 3 or len(joints) != int(call[_DOF]):
        return np.nan, 0, REFUSED
    total = 0.0  # infinities and NaN do not cancel
    for i in range(3):
        total += abs(target[i]) + abs(base[i])
    for i in range(len(joints)):
        total += abs(joints[i])
    if not np.isfinite(total):
        return np.nan, 0, REFUSED
    x, y, plane_yaw = axis_at(call, base, joints)
    bends = bend_at(call, joints, 0), bend_at(call, joints, 1), bend_at(call, joints, 2)
    links = links_in(call)
    facing, pitch, tolerance = int(call[_FACING]), call[_PITCH], call[_TOLERANCE]
    most, mobile, area = int(call[_MOST]), call[_MOBILE] != 0.0, area_in(call)
    point = (target[0], target[1], target[2])
    error, passes, new_x, new_y, yaw, knots = mfabrik(
        links, area, mobile, x, y, plane_yaw, bends, point,
        facing, pitch, tolerance, most, min(PATIENCE, most),
    )  # fmt: skip
    new_base[0], new_base[1], new_joints[1], new_joints[2], new_joints[3] = new_x, new_y, *bends
    if error > tolerance:
        new_base[0], new_base[1] = x, y
        error, passes, _, yaw = solve(
            arm_in(call), call[_HOLDS:_SIGN],
            call[_REST : _REST + 3 * int(call[_POSTURES])].reshape(-1, 3), area, mobile,
            new_base[:2], plane_yaw, new_joints[1:4], target, facing, pitch, tolerance, most,
        )  # fmt: skip
    elif passes > 0:
        _bend(call, knots, new_joints)
    for i in range(3):
        new_joints[1 + i] = _hinge(call, i, new_joints[1 + i], joints[1 + i])
    for i in range(4, len(joints)):
        new_joints[i] = joints[i]
    new_base[0], new_base[1], new_base[2], new_joints[0], fits = _stand(
        call, new_base[0], new_base[1], yaw, base[2], joints[0]
    )
    return error, passes, MET if fits and error <= tolerance else MISSED


@cache
def one_call() -> Callable[..., Any]:
    """The compiled call: ``(call, target, base, joints, new_base, new_joints)``.

    It fills the last two and returns error [m], passes, and `REFUSED`, `MISSED` or `MET`. Refused is what has
    another length or is not finite; what is no contiguous array of floats is a TypeError, but where
    NUMBA_DISABLE_JIT leaves kernels plain Python.
    """
    given = types.Array(types.float64, 1, "C", readonly=True)
    filled = types.Array(types.float64, 1, "C")
    kernel: Any = _solved
    if is_jitted(kernel):
        kernel.compile((filled, given, given, given, filled, filled))
        kernel.disable_compile()
    call: Callable[..., Any] = kernel
    return call


@compiled
def answer_all(
    call: Array, targets: Array, bases: Array, joints: Array,
    new_bases: Array, new_joints: Array, errors: Array, passes: Index, met: NDArray[np.bool_],
) -> None:  # fmt: skip
    """The call for many rows, all finite; on a free floor with the pitch free 32 of them abreast.

    Fills bases (n, 3), joints (n, dof), errors [m], passes and whether a target is met (n,).
    """
    n = len(targets)
    if call[_EDGES] > 0.0 or np.isfinite(call[_PITCH]):
        for k in range(n):
            errors[k], passes[k], end = _solved(
                call, targets[k], bases[k], joints[k], new_bases[k], new_joints[k]
            )
            met[k] = end == MET
        return
    axes, planes, bends = np.empty((n, 2)), np.empty(n), np.empty((n, 3))
    for k in range(n):
        axes[k, 0], axes[k, 1], planes[k] = axis_at(call, bases[k], joints[k])
        for i in range(3):
            bends[k, i] = bend_at(call, joints[k], i)
    links = links_in(call)
    facing, tolerance = int(call[_FACING]), call[_TOLERANCE]
    abreast(links, facing, tolerance, int(call[_MOST]), targets, axes, planes, bends, errors, passes)
    for k in range(n):
        if errors[k] > tolerance:
            errors[k], passes[k], end = _solved(
                call, targets[k], bases[k], joints[k], new_bases[k], new_joints[k]
            )
            met[k] = end == MET
            continue
        for i in range(3):
            bend = bends[k, i]
            if passes[k] > 0:
                bend, _ = fit(bend, call[_LOWER + i], call[_UPPER + i])
            new_joints[k, 1 + i] = _hinge(call, i, bend, joints[k, 1 + i])
        for i in range(4, joints.shape[1]):
            new_joints[k, i] = joints[k, i]
        new_bases[k, 0], new_bases[k, 1], new_bases[k, 2], new_joints[k, 0], met[k] = _stand(
            call, axes[k, 0], axes[k, 1], planes[k], bases[k, 2], joints[k, 0]
        )
