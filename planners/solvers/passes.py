"""One pass of FABRIK over three links in a plane, without a single angle: directions as unit vectors.

Limits of a bend are held by signs of cross products, so that a pass is roots and divisions alone. Both ways
lay the last link along the same line, from its inner knot to the target, so that a pass has five roots. All
here is woven into the kernels that call it: one target at a time in `fabrik`, many abreast in `lanes`.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np
from numba import njit

from regionik.planners.geometry.flat import Kernel
from regionik.planners.geometry.trigonometry import woven
from regionik.worlds.arrays import Array

Pair = tuple[float, float]
Triple = tuple[float, float, float]
Hold = tuple[float, float, float, float, float, float, float]
Knots = tuple[float, float, float, float, float, float]

NO_DIRECTION = 1e-300  # square of a length from which no direction is taken [m2]


def fast(function: Kernel) -> Kernel:
    """Compile as `compiled`, reckoning as `woven` does: no check then stands between two lanes."""
    return cast(Kernel, njit(cache=True, error_model="numpy", fastmath={"contract"})(function))


def pasted(function: Kernel) -> Kernel:
    """Paste the source into the few kernels that call it: nothing is then compiled and linked twice."""
    return cast(Kernel, njit(inline="always", error_model="numpy", fastmath={"contract"})(function))


class Links(NamedTuple):
    """An arm as a pass takes it: shoulder [m], lengths of its links [m], limits of their bends."""

    shoulder: Pair
    lengths: Triple
    holds: tuple[Hold, Hold, Hold]


def holds_of(lower: Array, upper: Array) -> Array:
    """Limits of bends (m,), (m,) [rad] as directions, (7 m,).

    Of each: cosine and sine of the middle, of the lower limit, of the upper one, and how many of three signs
    say that a bend is within: beyond the lower limit, before the upper one, on the side of the middle. All
    three where the limits are less than half a turn apart, any one where more, none where nothing is limited.
    """
    rows = []
    for low, high in zip(lower.tolist(), upper.tolist(), strict=True):
        if np.isinf(low) != np.isinf(high):  # bends are then counted within half a turn of zero
            low, high = (low, max(low, np.pi)) if np.isinf(high) else (min(high, -np.pi), high)
        wide = high - low
        middle = 0.0 if np.isinf(wide) else 0.5 * (low + high)
        needed = 0.0 if wide >= 2 * np.pi else 1.0 if wide >= np.pi else 3.0
        angles = (middle, low, high) if needed else (0.0, 0.0, 0.0)
        rows.append([turn(angle) for angle in angles for turn in (np.cos, np.sin)] + [needed])
    return np.array(rows, dtype=np.float64).ravel()


class Inner(NamedTuple):
    """What `inwards` comes to: r of the root, the two knots after it [m], the directions of all links."""

    root: float
    first: Pair
    second: Pair
    u: Pair
    v: Pair
    w: Pair


@woven
def hold_at(holds: Array, k: int) -> Hold:
    """Seven numbers from place ``k`` of flat ones: a row of `holds_of`."""
    return (
        holds[k], holds[k + 1], holds[k + 2], holds[k + 3], holds[k + 4], holds[k + 5], holds[k + 6],
    )  # fmt: skip


@woven
def holds_at(holds: Array, k: int) -> tuple[Hold, Hold, Hold]:
    """All three rows of `holds_of`, flat from place ``k``."""
    return hold_at(holds, k), hold_at(holds, k + 7), hold_at(holds, k + 14)


@woven
def placed(shoulder: Pair, lengths: Triple, u: Pair, v: Pair, w: Pair) -> Knots:
    """The knots after the shoulder, from the directions of the links."""
    r1, z1 = shoulder[0] + lengths[0] * u[0], shoulder[1] + lengths[0] * u[1]
    r2, z2 = r1 + lengths[1] * v[0], z1 + lengths[1] * v[1]
    return r1, z1, r2, z2, r2 + lengths[2] * w[0], z2 + lengths[2] * w[1]


@woven
def within(hold: Hold, c: float, s: float) -> bool:
    """Whether a bend, as its cosine and sine, is within its limits."""
    beside = c * hold[0] + s * hold[1] >= 0.0
    beyond = hold[2] * s - hold[3] * c >= 0.0
    before = c * hold[5] - s * hold[4] >= 0.0
    needed = hold[6]
    return (beside & beyond & before) | ((beside | beyond | before) & (needed <= 1.0)) | (needed <= 0.0)


@woven
def nearer(hold: Hold, c: float, s: float) -> Pair:
    """The nearer limit of a bend."""
    low = s * hold[0] - c * hold[1] < 0.0
    return (hold[2] if low else hold[4]), (hold[3] if low else hold[5])


@woven
def unit(r: float, z: float, other: Pair) -> Pair:
    """A direction; where there is none the other one."""
    length2 = r * r + z * z
    if length2 < NO_DIRECTION:
        return other
    scale = np.sqrt(length2) * (1.0 / length2)  # root and quotient at a time
    return r * scale, z * scale


@woven
def inner_link(hold: Hold, outer: Pair, along: Pair) -> Pair:
    """Direction of a link whose outer neighbour lies along ``outer``, the neighbour's bend kept in limits."""
    c, s = along[0] * outer[0] + along[1] * outer[1], along[0] * outer[1] - along[1] * outer[0]
    if within(hold, c, s):
        return along
    c, s = nearer(hold, c, s)
    return outer[0] * c + outer[1] * s, outer[1] * c - outer[0] * s


@woven
def outer_link(hold: Hold, inner: Pair, along: Pair) -> Pair:
    """Direction of a link whose inner neighbour lies along ``inner``, its own bend kept in limits."""
    c, s = inner[0] * along[0] + inner[1] * along[1], inner[0] * along[1] - inner[1] * along[0]
    if within(hold, c, s):
        return along
    c, s = nearer(hold, c, s)
    return inner[0] * c - inner[1] * s, inner[1] * c + inner[0] * s


@woven
def sight(tool: Pair, aim: Pair, knots: Knots) -> Pair:
    """Direction of the last link before the first pass: ``tool``, or where that is (0, 0) to ``aim``."""
    to_r, to_z = unit(aim[0] - knots[2], aim[1] - knots[3], (1.0, 0.0))
    free = tool[0] == 0.0 and tool[1] == 0.0
    return (to_r if free else tool[0]), (to_z if free else tool[1])


@woven
def inwards(
    root: Pair, lengths: Triple, first: Hold, second: Hold, sight: Pair, aim: Pair, knots: Knots
) -> Inner:
    """Forward reaching from the tool at ``aim``, the last link along ``sight``.

    ``first`` and ``second`` hold the bends behind the first two links.
    """
    r1, z1, r2, z2, _, _ = knots
    r2, z2 = aim[0] - lengths[2] * sight[0], aim[1] - lengths[2] * sight[1]
    v = inner_link(second, sight, unit(r2 - r1, z2 - z1, (1.0, 0.0)))
    r1, z1 = r2 - lengths[1] * v[0], z2 - lengths[1] * v[1]
    u = inner_link(first, v, unit(r1 - root[0], z1 - root[1], (1.0, 0.0)))
    return Inner(r1 - lengths[0] * u[0], (r1, z1), (r2, z2), u, v, sight)


@woven
def outwards(
    shoulder: Pair,
    lengths: Triple,
    holds: tuple[Hold, Hold, Hold],
    tool: Pair,
    aim: Pair,
    inner: Inner,
    by: float,
) -> tuple[Knots, Pair]:
    """Backward reaching from the shoulder: the three knots after it, and the next pass's ``sight``.

    What `inwards` came to has moved ``by`` along r with the base, the tool then at ``aim``. The last link
    lies along ``tool``, or where that is (0, 0) on the line to ``aim``.
    """
    r1, z1 = inner.first[0] + by, inner.first[1]
    r2, z2 = inner.second[0] + by, inner.second[1]
    u = outer_link(holds[0], (1.0, 0.0), unit(r1 - shoulder[0], z1 - shoulder[1], inner.u))
    r1, z1 = shoulder[0] + lengths[0] * u[0], shoulder[1] + lengths[0] * u[1]
    v = outer_link(holds[1], u, unit(r2 - r1, z2 - z1, inner.v))
    r2, z2 = r1 + lengths[1] * v[0], z1 + lengths[1] * v[1]
    to_r, to_z = unit(aim[0] - r2, aim[1] - z2, inner.w)
    free = tool[0] == 0.0 and tool[1] == 0.0
    sight = (to_r if free else tool[0]), (to_z if free else tool[1])
    w = outer_link(holds[2], v, sight)
    return (r1, z1, r2, z2, r2 + lengths[2] * w[0], z2 + lengths[2] * w[1]), sight
