"""What a call of M-FABRIK needs to know of robot, area and wishes, as one flat array.

So that a call from Python hands over few arrays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.edgetree import EdgeTree, tree_of
from regionik.planners.geometry.flat import FlatPolygon, compiled
from regionik.planners.geometry.trigonometry import woven
from regionik.planners.solvers.lanes import Effort
from regionik.planners.solvers.passes import Links, Pair, Triple, holds_at
from regionik.planners.solvers.planar_arm import PlaneArm
from regionik.worlds.arrays import Array

EVERYWHERE = EdgeTree(np.empty((0, 4)), np.tile([np.inf, np.inf, -np.inf, -np.inf], (2, 1)))  # no area
FREE, FACE_TARGET, FIXED = range(3)  # what the heading of the base is to be

_SHOULDER, _LENGTHS, _LOWER, _UPPER, _HOLDS, _SIGN, _OFFSET, _PIVOT, _MOUNT = 0, 2, 5, 8, 11, 32, 35, 38, 41
_HEADING, FACING, PITCH, TOLERANCE, MOST, _DOF = 45, 48, 49, 50, 51, 52
MOBILE, _POSTURES, _EDGES, _REST = 53, 54, 55, 56  # how many postures and edges follow, then they and boxes


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
    call[MOBILE] = 0
    return call


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
def bends_at(call: Array, joints: Array) -> Triple:
    """Bends of the links [rad]."""
    return (
        call[_SIGN] * joints[1] + call[_OFFSET],
        call[_SIGN + 1] * joints[2] + call[_OFFSET + 1],
        call[_SIGN + 2] * joints[3] + call[_OFFSET + 2],
    )


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
    return Effort(int(call[FACING]), call[TOLERANCE], int(call[MOST]), postures_in(call))


@compiled
def pitch_in(call: Array) -> float:
    """Of the last link, NaN where it is free [rad]."""
    pitch: float = call[PITCH]
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
    return call[_EDGES] == 0.0 and not np.isfinite(call[PITCH])
