"""FABRIK's two passes over the three links of a planar arm, joint limits kept, compiled.

Source: FABRIK (Aristidou and Lasenby, Graphical Models 2011), as M-FABRIK (Santos et al., IEEE Access 2020)
uses it. Directions are unit vectors (r, z) and limits are kept by signs of cross products: a pass takes no
angle. A chain is its knots after the shoulder: elbow, wrist and tool, as r, z, r, z, r, z [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.kernels import compiled

Pair = tuple[float, float]
Triple = tuple[float, float, float]
Knots = tuple[float, float, float, float, float, float]

ANY: Pair = (0.0, 0.0)  # of the last link: it may point anywhere
MIN_SQUARED_LENGTH = 1e-300  # square of a length from which no direction is taken [m2]


class BendLimits(NamedTuple):
    """Limits of a bend as unit vectors."""

    # middle, lower, upper: cosine and sine of the middle of the limits and of both limits
    middle: Pair
    lower: Pair
    upper: Pair
    # number of conditions that a bend within limits meets, of three: on the middle's side, above the lower
    # limit, below the upper one. 3 where the limits are less than half a turn apart, 1 where they are more, 0
    # where there are none.
    signs: float


class PlanarLinks(NamedTuple):
    """A planar arm for the passes: shoulder (r, z) [m], lengths of its links [m], limits of their bends."""

    shoulder: Pair
    lengths: Triple
    limits: tuple[BendLimits, BendLimits, BendLimits]


def bend_limits(low: float, high: float) -> BendLimits:
    """Limits of a bend [rad] as unit vectors."""
    if np.isinf(low) != np.isinf(high):  # bends are then counted within half a turn of zero
        low, high = (low, max(low, np.pi)) if np.isinf(high) else (min(high, -np.pi), high)
    wide = high - low
    if wide >= 2 * np.pi:
        return BendLimits((1.0, 0.0), (1.0, 0.0), (1.0, 0.0), 0.0)
    angles = np.array([0.5 * (low + high), low, high])
    middle, lower, upper = zip(np.cos(angles).tolist(), np.sin(angles).tolist(), strict=True)
    return BendLimits(middle, lower, upper, 1.0 if wide >= np.pi else 3.0)


@compiled
def direction(angle: float) -> Pair:
    """Unit vector of an angle [rad]."""
    return math.cos(angle), math.sin(angle)


@compiled
def knots_at(links: PlanarLinks, bends: Triple) -> Knots:
    """Forward kinematics in the plane."""
    u, v = direction(bends[0]), direction(bends[0] + bends[1])
    return _knots(links, u, v, direction(bends[0] + bends[1] + bends[2]))


@compiled
def bends_of(links: PlanarLinks, knots: Knots) -> Triple:
    """Bends of the links, each link's against the one before it [rad]."""
    first = math.atan2(knots[1] - links.shoulder[1], knots[0] - links.shoulder[0])
    second = math.atan2(knots[3] - knots[1], knots[2] - knots[0])
    return first, second - first, math.atan2(knots[5] - knots[3], knots[4] - knots[2]) - second


@compiled
def forward_reaching(links: PlanarLinks, tool: Pair, target: Pair, knots: Knots) -> tuple[float, Knots]:
    """From the tool, put on the target, in to the shoulder: the r to which that is pulled, and the knots.

    The last link lies along ``tool``, or where that is `ANY` on the line to the old wrist.
    """
    a, b, c = links.lengths
    w = tool if tool != ANY else _unit(target[0] - knots[2], target[1] - knots[3])
    r2, z2 = target[0] - c * w[0], target[1] - c * w[1]
    v = _limited(links.limits[2], w, _unit(r2 - knots[0], z2 - knots[1]), -1.0)
    r1, z1 = r2 - b * v[0], z2 - b * v[1]
    u = _limited(links.limits[1], v, _unit(r1 - links.shoulder[0], z1 - links.shoulder[1]), -1.0)
    return r1 - a * u[0], (r1, z1, r2, z2, target[0], target[1])


@compiled
def backward_reaching(links: PlanarLinks, tool: Pair, target: Pair, knots: Knots) -> Knots:
    """From the shoulder out to the tool; the last link lies as in `forward_reaching`."""
    u = _unit(knots[0] - links.shoulder[0], knots[1] - links.shoulder[1])
    u = _limited(links.limits[0], (1.0, 0.0), u, 1.0)
    r1, z1 = links.shoulder[0] + links.lengths[0] * u[0], links.shoulder[1] + links.lengths[0] * u[1]
    v = _limited(links.limits[1], u, _unit(knots[2] - r1, knots[3] - z1), 1.0)
    r2, z2 = r1 + links.lengths[1] * v[0], z1 + links.lengths[1] * v[1]
    w = tool if tool != ANY else _unit(target[0] - r2, target[1] - z2)
    return _knots(links, u, v, _limited(links.limits[2], v, w, 1.0))


@compiled
def _knots(links: PlanarLinks, u: Pair, v: Pair, w: Pair) -> Knots:
    """The knots from the directions of the links."""
    a, b, c = links.lengths
    r1, z1 = links.shoulder[0] + a * u[0], links.shoulder[1] + a * u[1]
    r2, z2 = r1 + b * v[0], z1 + b * v[1]
    return r1, z1, r2, z2, r2 + c * w[0], z2 + c * w[1]


@compiled
def _unit(r: float, z: float) -> Pair:
    """The direction of a vector, along r where it has none."""
    length2 = r * r + z * z
    if length2 < MIN_SQUARED_LENGTH:
        return 1.0, 0.0
    scale = 1.0 / math.sqrt(length2)
    return r * scale, z * scale


@compiled
def _limited(limits: BendLimits, fixed: Pair, free: Pair, sense: float) -> Pair:
    """A link's direction, the bend between it and a ``fixed`` neighbour kept within limits.

    ``sense`` is 1 where the neighbour is the inner one, -1 where it is the outer one.
    """
    c, s = fixed[0] * free[0] + fixed[1] * free[1], sense * (fixed[0] * free[1] - fixed[1] * free[0])
    if _within(limits, c, s):
        return free
    below = s * limits.middle[0] - c * limits.middle[1] < 0.0
    c, s = limits.lower if below else limits.upper
    s *= sense
    return fixed[0] * c - fixed[1] * s, fixed[1] * c + fixed[0] * s


@compiled
def _within(limits: BendLimits, c: float, s: float) -> bool:
    """True where a bend, given by cosine and sine, is within its limits."""
    beside = c * limits.middle[0] + s * limits.middle[1] >= 0.0
    beyond = limits.lower[0] * s - limits.lower[1] * c >= 0.0
    before = c * limits.upper[1] - s * limits.upper[0] >= 0.0
    if limits.signs > 1.0:
        return beside and beyond and before
    return limits.signs == 0.0 or beside or beyond or before
