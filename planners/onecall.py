"""M-FABRIK from base and joints to base and joints in one compiled call, for arms in one plane.

All that a solver prepares lies in one flat array, so that a call from Python hands over few arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba.extending import is_jitted

from regionik.planners.edgetree import EdgeTree, tree_of
from regionik.planners.fabrik import PATIENCE, bends_between, mfabrik, restarted
from regionik.planners.flat import FlatPolygon, compiled
from regionik.planners.handed import HANDED, address, alike, layout_is_known, row_at
from regionik.planners.kernels import PlaneArm, fit, wrap
from regionik.planners.lanes import Effort
from regionik.planners.passes import Links, Pair, Triple, fast, holds_at, pasted
from regionik.planners.trigonometry import turned, woven
from regionik.worlds.arrays import Array

ROUNDING = 1e-9  # by which a heading may be outside its span [rad]
EVERYWHERE = EdgeTree(np.empty((0, 4)), np.tile([np.inf, np.inf, -np.inf, -np.inf], (2, 1)))  # no area
OneCall = Callable[[Array, object, object, object, Array, Array], tuple[float, int, bool]]
FREE, FACE_TARGET, FIXED = range(3)  # what the heading of the base is to be

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
    tree = tree_of(area.vertices, area.starts) if len(area.vertices) else EVERYWHERE
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


class Seat(NamedTuple):
    """How the arm sits on the base, and how both share a turn.

    ``ahead`` and ``aside`` of the base's middle [m]; ``zero`` is the direction of the arm's plane, seen from
    the base, with the pivot at zero [rad].
    """

    ahead: float
    aside: float
    zero: float
    turning: Turning


@woven
def seat_in(call: Array) -> Seat:
    turning = Turning(
        call[_PIVOT + 1], call[_PIVOT + 2], int(call[_HEADING]), call[_HEADING + 1], call[_HEADING + 2]
    )
    return Seat(call[_MOUNT], call[_MOUNT + 1], call[_PIVOT] + call[_MOUNT + 3], turning)


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


@woven
def bends_at(call: Array, joints: Array) -> Triple:
    """Bends of the links [rad]."""
    return (
        call[_SIGN] * joints[1] + call[_OFFSET],
        call[_SIGN + 1] * joints[2] + call[_OFFSET + 1],
        call[_SIGN + 2] * joints[3] + call[_OFFSET + 2],
    )


@compiled
def axis_at(call: Array, base: Array, joints: Array) -> tuple[float, float, float]:
    """Where base and joints put the arm axis [m], and the direction of the arm's plane [rad]."""
    seat = seat_in(call)
    dx, dy = away(seat, base[2])
    return base[0] + dx, base[1] + dy, base[2] + seat.zero + joints[0]


class Hinge(NamedTuple):
    """How a joint bends a link, ``bend = sign * joint + offset``, and limits of the bend [rad].

    ``middle`` is that of the limits where both are finite, which ``bounded`` says.
    """

    lower: float
    upper: float
    middle: float
    bounded: bool
    sign: float
    offset: float


@woven
def _hinge(lower: float, upper: float, sign: float, offset: float) -> Hinge:
    bounded = np.isfinite(lower) and np.isfinite(upper)
    return Hinge(lower, upper, 0.5 * (lower + upper) if bounded else 0.0, bounded, sign, offset)


@woven
def hinges_in(call: Array) -> tuple[Hinge, Hinge, Hinge]:
    return (
        _hinge(call[_LOWER], call[_UPPER], call[_SIGN], call[_OFFSET]),
        _hinge(call[_LOWER + 1], call[_UPPER + 1], call[_SIGN + 1], call[_OFFSET + 1]),
        _hinge(call[_LOWER + 2], call[_UPPER + 2], call[_SIGN + 2], call[_OFFSET + 2]),
    )


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


@compiled
def arm_in(call: Array) -> PlaneArm:
    return PlaneArm(call[0], call[1], call[_LENGTHS:_LOWER], call[_LOWER:_UPPER], call[_UPPER:_HOLDS])


@compiled
def links_in(call: Array) -> Links:
    lengths = call[_LENGTHS], call[_LENGTHS + 1], call[_LENGTHS + 2]
    return Links((call[0], call[1]), lengths, holds_at(call, _HOLDS))


@compiled
def postures_in(call: Array) -> Array:
    return call[_REST : _REST + 3 * int(call[_POSTURES])].reshape(-1, 3)


@compiled
def area_in(call: Array) -> EdgeTree:
    first = _REST + 3 * int(call[_POSTURES])
    end = first + 4 * int(call[_EDGES])
    return EdgeTree(call[first:end].reshape(-1, 4), call[end:].reshape(-1, 4))


@compiled
def effort_in(call: Array) -> Effort:
    return Effort(int(call[_FACING]), call[_TOLERANCE], int(call[_MOST]), postures_in(call))


@compiled
def pitch_in(call: Array) -> float:
    """Of the last link, NaN where it is free [rad]."""
    pitch: float = call[_PITCH]
    return pitch


@compiled
def span_in(call: Array) -> Pair:
    """Headings that the base keeps to [rad]."""
    return call[_HEADING + 1], call[_HEADING + 2]


@compiled
def keep_span(call: Array, low: float, high: float) -> None:
    """Have the base keep to other headings."""
    call[_HEADING + 1], call[_HEADING + 2] = low, high


@compiled
def free_in(call: Array) -> bool:
    """Whether floor and pitch are free."""
    return call[_EDGES] == 0.0 and not np.isfinite(call[_PITCH])


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
    facing, pitch, tolerance = int(call[_FACING]), call[_PITCH], call[_TOLERANCE]
    most, mobile, area = int(call[_MOST]), call[_MOBILE] != 0.0, area_in(call)
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
