"""Clearance of an arm's capsules from each other and from the base they are mounted on; compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.collision.upright_solids import Uprights, least_along, uprights_from
from regionik.planners.kernels import compiled
from regionik.planners.search.motion_bounds import LinkCapsules
from regionik.worlds.arrays import Array, Index

FINE = 20  # golden sections along a link where its distance from the base is measured
NOTHING = 1e-14  # squared sine of the angle between axes that count as parallel


class SelfClearance(NamedTuple):
    """The clearance that an arm keeps from itself and from its base."""

    pairs: Index  # (p, 2) capsules that may touch, the one on the link nearer to the base first
    body: Uprights  # the base in the arm's base frame
    heeds: Index  # (h,) capsules that may touch the base
    clearance: float  # [m]


NO_SELF_CLEARANCE = SelfClearance(
    np.zeros((0, 2), dtype=np.int64), uprights_from([]), np.zeros(0, dtype=np.int64), 0.0
)


@compiled
def self_clearance(capsules: LinkCapsules, own: SelfClearance, ends: Array) -> float:
    """Least distance of capsules, ends (s, 2, 3), from each other and the base, less the clearance [m]."""
    least = np.inf
    for i, k in own.pairs:
        apart = segment_distance(ends[i, 0], ends[i, 1], ends[k, 0], ends[k, 1])
        least = min(least, apart - capsules.radius[i] - capsules.radius[k])
    for k in own.heeds:
        for m in range(len(own.body.disc)):
            r = capsules.radius[k]
            least = min(
                least,
                least_along(own.body, m, ends[k, 0], ends[k, 1], 0.0, 0.0, -np.inf, least + r, FINE) - r,
            )
    return least - own.clearance


@compiled
def segment_distance(a: Array, b: Array, c: Array, d: Array) -> float:
    """Distance of the segments a b and c d [m]."""
    px, py, pz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    qx, qy, qz = d[0] - c[0], d[1] - c[1], d[2] - c[2]
    rx, ry, rz = a[0] - c[0], a[1] - c[1], a[2] - c[2]
    pp, qq = px * px + py * py + pz * pz, qx * qx + qy * qy + qz * qz
    pq = px * qx + py * qy + pz * qz
    pr, qr = px * rx + py * ry + pz * rz, qx * rx + qy * ry + qz * rz
    square = pp * qq - pq * pq
    s = min(1.0, max(0.0, (pq * qr - qq * pr) / square)) if square > NOTHING * pp * qq else 0.0
    best = np.inf
    for _ in range(3):  # each point in turn moves to where it is nearest to the other
        t = min(1.0, max(0.0, (pq * s + qr) / qq)) if qq > 0.0 else 0.0
        s = min(1.0, max(0.0, (pq * t - pr) / pp)) if pp > 0.0 else 0.0
        x, y, z = rx + s * px - t * qx, ry + s * py - t * qy, rz + s * pz - t * qz
        best = min(best, x * x + y * y + z * z)
    return float(np.sqrt(best))
