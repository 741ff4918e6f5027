"""A way from knot to knot, cut into short parts, and what lies where on it, compiled."""

from __future__ import annotations

import math

import numpy as np

from regionik.planners.clearance.robot_motion import hop_between, stand
from regionik.planners.geometry.polygons import Index, compiled
from regionik.worlds.arrays import Array


@compiled
def leg_lengths(knots: Array) -> Array:
    """Of the legs between base poses (k, 3), turns counting as metres; a heading of NaN is free, (k - 1,)."""
    lengths = np.empty(len(knots) - 1)
    for n in range(len(lengths)):
        x, y, turn = knots[n + 1] - knots[n]
        turn = (turn + math.pi) % (2 * math.pi) - math.pi
        lengths[n] = math.hypot(x, y) + (0.0 if math.isnan(turn) else abs(turn))
    return lengths


@compiled
def laid_out(
    knots: Array, tool: Array, spots: Array, joints: Array, stride: float
) -> tuple[Array, Array, Index, Array]:
    """What base, tool and arm pass on a way, and where to cut it.

    Parameters
    ----------
    knots : (k, 3) array
        Base poses [m], [rad].
    tool : (k,) array
        Part of the tool's straight way that is done at every knot.
    spots, joints : (2, 3), (2, dof) arrays
        Where the tool is at both ends [m], and joints wished for there.
    stride : float
        Longest part of the base's way, or of the tool's, between two cuts [m].

    Returns
    -------
    points : (k, 3) array
        Where the tool is at every knot [m].
    wished : (k, dof) array
        Joints there, spread over the lengths of base's and tool's way together.
    leg, share : (n,) arrays
        Places that are a stride apart at most, all knots but the first among them.
    """
    count, base, goes = len(knots), leg_lengths(knots), np.linalg.norm(spots[1] - spots[0])
    far, pieces = np.zeros(count), np.empty(count - 1, dtype=np.int64)
    for n in range(count - 1):
        moves = (tool[n + 1] - tool[n]) * goes
        far[n + 1] = far[n] + base[n] + moves
        pieces[n] = max(1, math.ceil(max(base[n], moves) / stride))
    far = far / far[-1] if far[-1] > 0.0 else np.linspace(0.0, 1.0, count)
    leg, share = np.empty(pieces.sum(), dtype=np.int64), np.empty(pieces.sum())
    at = 0
    for n in range(count - 1):
        for k in range(1, pieces[n] + 1):
            leg[at], share[at] = n, k / pieces[n]
            at += 1
    ends = np.zeros(count, dtype=np.int64)
    return between(spots, ends, tool), between(joints, ends, far), leg, share


@compiled
def between(knots: Array, leg: Index, share: Array) -> Array:
    """Values (n, m) at shares (n,) of legs (n,) between knots (k, m), the knots themselves at their ends."""
    values = np.empty((len(leg), knots.shape[1]))
    for n in range(len(leg)):
        a, b = knots[leg[n]], knots[leg[n] + 1]
        for i in range(len(a)):
            values[n, i] = b[i] if share[n] >= 1.0 else a[i] + share[n] * (b[i] - a[i])
    return values


@compiled
def bases_between(knots: Array, leg: Index, share: Array, rolls: bool) -> Array:
    """Base poses (n, 3) at shares (n,) of legs (n,), on the way that every reader of a plan fills in.

    Headings run on from the first knot of a leg; where they are NaN, they stay so.
    """
    bases, still = np.empty((len(leg), 3)), np.empty(0)
    for n in range(len(leg)):
        hop = hop_between(knots[leg[n]], still, knots[leg[n] + 1], still, rolls)
        if rolls:
            bases[n, 0], bases[n, 1], bases[n, 2] = stand(hop, share[n])
        else:
            bases[n] = hop.base + share[n] * hop.drive
    return bases
