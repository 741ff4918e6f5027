"""Ways between poses by RRTConnect, shortened by direct motions, for every kind of base."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from regionik.planners.driving.arcs import moved, wrapped
from regionik.planners.driving.footprint_scene import Room, fits
from regionik.planners.driving.reeds_shepp import PARTS
from regionik.planners.driving.sampling import Curves, connect_poses
from regionik.planners.driving.steering import DUBINS, NOTHING, REEDS_SHEPP, SLIDE, Base, cheapest, link
from regionik.worlds.arrays import Array

ITERATIONS = 8000  # of RRTConnect, a try
ATTEMPTS = 3  # the cheapest is kept
ROUNDS = (24, 31, 40)  # places along a path between which shorter motions are tried, in turn


def direct(room: Room, base: Base, a: Array, b: Array) -> Array | None:
    """Parts (5, 2) of the cheapest free direct motion; None where there is none."""
    parts = np.zeros((PARTS, 2))
    return parts if link(room, base, a, b, np.inf, parts) < np.inf else None


def find(room: Room, base: Base, start: Array, goal: Array, seed: int) -> tuple[Array | None, float]:
    """Poses (k, 3) from start to goal, joined by free direct motions, and their cost; None when it gives up.

    The cheapest of a few tries with different seeds. A try that fails is the last: the next would hardly do
    better.
    """
    best, least = None, np.inf
    for poses in _attempts(room, base, start, goal, seed):
        kept, cost = shortened(room, base, poses)
        if cost < least:
            best, least = kept, cost
    return best, least


def _attempts(room: Room, base: Base, start: Array, goal: Array, seed: int) -> Iterator[Array]:
    parts = np.empty((PARTS, 2))
    metric: Curves = {REEDS_SHEPP: "reeds-shepp", DUBINS: "dubins"}.get(base.kind, "straight")  # type: ignore[assignment]
    for k in range(ATTEMPTS):
        poses = connect_poses(
            room.vertices.min(axis=0),
            room.vertices.max(axis=0),
            start,
            goal,
            lambda p: fits(room, p[0], p[1], p[2]),
            lambda p, q: link(room, base, p, q, np.inf, parts) < np.inf,
            curves=metric,
            radius=base.radius,
            seed=seed * ATTEMPTS + k,
            most=ITERATIONS,
        )
        if poses is None:
            return
        yield poses


def shortened(room: Room, base: Base, poses: Array) -> tuple[Array, float]:
    """A path with direct motions in place of detours, and its cost; never dearer than before.

    First between the poses given, then between places spread over what is left.
    """
    kept, costs = cheapest(room, base, poses)
    best, least = poses[kept], float(costs[-1])
    for count in ROUNDS:
        spread = _spread(room, base, best, count)
        kept, costs = cheapest(room, base, spread)
        if float(costs[-1]) < least:
            best, least = spread[kept], float(costs[-1])
    return best, least


def _spread(room: Room, base: Base, poses: Array, count: int) -> Array:
    """The poses, and about ``count`` more along the motions between them."""
    parts = np.zeros((PARTS, 2))
    pairs = list(zip(poses[:-1], poses[1:], strict=True))
    costs = [link(room, base, a, b, np.inf, parts) for a, b in pairs]
    rows = [poses[:1]]
    for (a, b), cost in zip(pairs, costs, strict=True):
        between = round(count * cost / sum(costs))
        rows += [_along(room, base, a, b, np.arange(1, between + 1) / (between + 1)), b[None]]
    return np.concatenate(rows)


def _along(room: Room, base: Base, a: Array, b: Array, shares: Array) -> Array:
    """Poses at shares of the direct motion between two poses."""
    if base.kind == SLIDE:
        change = np.array([b[0] - a[0], b[1] - a[1], wrapped(b[2] - a[2])])
        slid: Array = a + shares[:, None] * change
        return slid
    parts = np.zeros((PARTS, 2))
    link(room, base, a, b, np.inf, parts)
    weight = np.where(parts[:, 0] == 0, base.weight, 0.0)
    costs = np.abs(parts[:, 0]) + weight * np.abs(parts[:, 1])
    ends = np.cumsum(costs)
    poses = []
    for at in shares * ends[-1]:
        x, y, yaw = a
        for (length, turn), end, cost in zip(parts, ends, costs, strict=True):
            part = 1.0 if end <= at else max(0.0, 1.0 - (end - at) / max(cost, NOTHING))
            x, y, yaw = moved(x, y, yaw, part * length, part * turn)
        poses.append((x, y, yaw))
    return np.array(poses).reshape(-1, 3)
