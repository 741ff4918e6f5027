"""One pass of FABRIK over three links in a plane, without a single angle: directions as unit vectors.

Limits of a bend are held by signs of cross products, so that a pass is roots and divisions alone. All here is
woven into the kernels that call it: one target at a time in `fabrik`, many abreast in `lanes`.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np
from numba import njit

from regionik.planners.flat import Kernel, compiled
from regionik.worlds.arrays import Array

Pair = tuple[float, float]
Triple = tuple[float, float, float]
Hold = tuple[float, float, float, float, float, float, float]
Knots = tuple[float, float, float, float, float, float]


def fast(function: Kernel) -> Kernel:
    """Compile as `compiled`, dividing as the processor does: no check then stands between two lanes."""
    return compiled(function, error_model="numpy")


class Links(NamedTuple):
    """An arm as a pass takes it: shoulder [m], lengths of its links [m], limits of their bends."""

    shoulder: Pair
    lengths: Triple
    holds: tuple[Hold, Hold, Hold]


def woven(function: Kernel) -> Kernel:
    """Compile into every kernel that calls it; floats are divided as the processor divides them.

    Types are inferred once and the machine code goes in, which compiles twice as fast as the source going in.
    """
    return cast(Kernel, njit(forceinline=True, error_model="numpy")(function))


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
def placed(shoulder: Pair, lengths: Triple, a: float, b: float, c: float) -> Knots:
    """The knots after the shoulder, from bends [rad]."""
    r1, z1 = shoulder[0] + lengths[0] * np.cos(a), shoulder[1] + lengths[0] * np.sin(a)
    r2, z2 = r1 + lengths[1] * np.cos(a + b), z1 + lengths[1] * np.sin(a + b)
    return r1, z1, r2, z2, r2 + lengths[2] * np.cos(a + b + c), z2 + lengths[2] * np.sin(a + b + c)


@woven
def within(hold: Hold, c: float, s: float) -> bool:
    """Whether a bend, as its cosine and sine, is within its limits."""
    signs = 1.0 if c * hold[0] + s * hold[1] >= 0.0 else 0.0
    signs += 1.0 if hold[2] * s - hold[3] * c >= 0.0 else 0.0
    signs += 1.0 if c * hold[5] - s * hold[4] >= 0.0 else 0.0
    return signs >= hold[6]


@woven
def nearer(hold: Hold, c: float, s: float) -> Pair:
    """The nearer limit of a bend."""
    low = s * hold[0] - c * hold[1] < 0.0
    return (hold[2] if low else hold[4]), (hold[3] if low else hold[5])


@woven
def unit(r: float, z: float, else_r: float, else_z: float) -> Pair:
    """A direction; where there is none the other one, and where neither is, the r axis."""
    none = r == 0.0 and z == 0.0
    r, z = (else_r if none else r), (else_z if none else z)
    length2 = r * r + z * z
    none = length2 == 0.0
    scale = 1.0 / np.sqrt(1.0 if none else length2)
    return (1.0 if none else r * scale), z * scale


@woven
def inner_link(hold: Hold, outer_r: float, outer_z: float, r: float, z: float) -> Pair:
    """Direction of a link whose outer neighbour lies along ``outer``, the neighbour's bend kept in limits."""
    c, s = r * outer_r + z * outer_z, r * outer_z - z * outer_r
    free = within(hold, c, s)
    held_c, held_s = nearer(hold, c, s)
    held_r, held_z = outer_r * held_c + outer_z * held_s, outer_z * held_c - outer_r * held_s
    return (r if free else held_r), (z if free else held_z)


@woven
def outer_link(hold: Hold, inner_r: float, inner_z: float, r: float, z: float) -> Pair:
    """Direction of a link whose inner neighbour lies along ``inner``, its own bend kept in limits."""
    c, s = inner_r * r + inner_z * z, inner_r * z - inner_z * r
    free = within(hold, c, s)
    held_c, held_s = nearer(hold, c, s)
    held_r, held_z = inner_r * held_c - inner_z * held_s, inner_z * held_c + inner_r * held_s
    return (r if free else held_r), (z if free else held_z)


@woven
def inwards(
    root: Pair, lengths: Triple, first: Hold, second: Hold, tool: Pair, aim: Pair, knots: Knots
) -> Knots:
    """Forward reaching from the tool at ``aim``: the root that it comes to, and the two knots after it.

    ``first`` and ``second`` hold the bends behind the first two links. The last link lies along ``tool``, or
    where that is (0, 0) on the line to its old knot.
    """
    r1, z1, r2, z2, _, _ = knots
    free = tool[0] == 0.0 and tool[1] == 0.0
    ur, uz = unit(aim[0] - r2, aim[1] - z2, 1.0, 0.0)
    ur, uz = (ur if free else tool[0]), (uz if free else tool[1])
    r2, z2 = aim[0] - lengths[2] * ur, aim[1] - lengths[2] * uz
    vr, vz = unit(r2 - r1, z2 - z1, 1.0, 0.0)
    vr, vz = inner_link(second, ur, uz, vr, vz)
    r1, z1 = r2 - lengths[1] * vr, z2 - lengths[1] * vz
    wr, wz = unit(r1 - root[0], z1 - root[1], 1.0, 0.0)
    wr, wz = inner_link(first, vr, vz, wr, wz)
    return r1 - lengths[0] * wr, z1 - lengths[0] * wz, r1, z1, r2, z2


@woven
def outwards(
    shoulder: Pair,
    lengths: Triple,
    holds: tuple[Hold, Hold, Hold],
    tool: Pair,
    aim: Pair,
    old: Knots,
    by: float,
) -> Knots:
    """Backward reaching from the shoulder: the three knots after it.

    ``old`` is what `inwards` came to, moved ``by`` along r with the base, the tool then at ``aim``.
    """
    r0, r1, r2 = old[0] + by, old[2] + by, old[4] + by
    z0, z1, z2 = old[1], old[3], old[5]
    ur, uz = unit(r1 - shoulder[0], z1 - shoulder[1], r1 - r0, z1 - z0)
    ur, uz = outer_link(holds[0], 1.0, 0.0, ur, uz)
    n1, m1 = shoulder[0] + lengths[0] * ur, shoulder[1] + lengths[0] * uz
    vr, vz = unit(r2 - n1, z2 - m1, r2 - r1, z2 - z1)
    vr, vz = outer_link(holds[1], ur, uz, vr, vz)
    n2, m2 = n1 + lengths[1] * vr, m1 + lengths[1] * vz
    free = tool[0] == 0.0 and tool[1] == 0.0
    wr, wz = unit(aim[0] - n2, aim[1] - m2, aim[0] - r2, aim[1] - z2)
    wr, wz = (wr if free else tool[0]), (wz if free else tool[1])
    wr, wz = outer_link(holds[2], vr, vz, wr, wz)
    return n1, m1, n2, m2, n2 + lengths[2] * wr, m2 + lengths[2] * wz
