"""Paths between poses by RRTConnect, shortcut by steering, for every kind of base."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from regionik.planners.driving.arcs import arc_end, wrapped
from regionik.planners.driving.footprint_scene import FootprintScene, fits
from regionik.planners.driving.reeds_shepp import MOTIONS
from regionik.planners.driving.sampling import Curves, connect_poses
from regionik.planners.driving.steering import DUBINS, NEGLIGIBLE, REEDS_SHEPP, SLIDE, Steering, steer
from regionik.planners.geometry.polygons import Index, compiled
from regionik.worlds.arrays import Array

ITERATIONS = 8000  # of RRTConnect in an attempt
ATTEMPTS = 3  # the cheapest is kept
ROUNDS = (24, 31, 40)  # poses along a path between which shortcuts are tried, in turn


def direct(scene: FootprintScene, base: Steering, a: Array, b: Array) -> Array | None:
    """Motions (5, 2) of the cheapest free steered path; None where there is none."""
    motions = np.zeros((MOTIONS, 2))
    return motions if steer(scene, base, a, b, np.inf, motions) < np.inf else None


def plan_poses(
    scene: FootprintScene, base: Steering, start: Array, goal: Array, seed: int
) -> tuple[Array | None, float]:
    """Poses (k, 3) from start to goal, each steered freely to the next, and their cost; None if none is
    found.

    The cheapest of a few attempts with different seeds. An attempt that fails is the last: the next would
    hardly do better.
    """
    best, least = None, np.inf
    for poses in _attempts(scene, base, start, goal, seed):
        kept, cost = shortcut(scene, base, poses)
        if cost < least:
            best, least = kept, cost
    return best, least


def _attempts(scene: FootprintScene, base: Steering, start: Array, goal: Array, seed: int) -> Iterator[Array]:
    """Paths of RRTConnect, up to the first attempt that finds none."""
    motions = np.empty((MOTIONS, 2))
    metric: Curves = {REEDS_SHEPP: "reeds-shepp", DUBINS: "dubins"}.get(base.kind, "straight")  # type: ignore[assignment]
    for k in range(ATTEMPTS):
        poses = connect_poses(
            scene.vertices.min(axis=0),
            scene.vertices.max(axis=0),
            start,
            goal,
            lambda p: fits(scene, p[0], p[1], p[2]),
            lambda p, q: steer(scene, base, p, q, np.inf, motions) < np.inf,
            curves=metric,
            radius=base.radius,
            seed=seed * ATTEMPTS + k,
            iterations=ITERATIONS,
        )
        if poses is None:
            return
        yield poses


def shortcut(scene: FootprintScene, base: Steering, poses: Array) -> tuple[Array, float]:
    """Path with steered shortcuts in place of detours, and its cost; never dearer than before.

    First between the poses given, then between poses spread over the path that is left.
    """
    kept, costs = _cheapest(scene, base, poses)
    best, least = poses[kept], float(costs[-1])
    for count in ROUNDS:
        spread = _spread(scene, base, best, count)
        kept, costs = _cheapest(scene, base, spread)
        if float(costs[-1]) < least:
            best, least = spread[kept], float(costs[-1])
    return best, least


@compiled
def _cheapest(scene: FootprintScene, base: Steering, poses: Array) -> tuple[Index, Array]:
    """Indices of the poses of a path to keep for the cheapest steered path, and the cost up to each.

    By dynamic programming over all pairs; the cost is infinite where the path is not free.
    """
    n = len(poses)
    cost, before = np.full(n, np.inf), np.full(n, -1)
    cost[0] = 0.0
    motions = np.empty((MOTIONS, 2))
    for j in range(1, n):
        for i in range(j - 1, -1, -1):
            if cost[i] < cost[j]:
                new = cost[i] + steer(scene, base, poses[i], poses[j], cost[j] - cost[i], motions)
                if new < cost[j]:
                    cost[j], before[j] = new, i
    kept = np.empty(n, dtype=np.int64)
    count, k = 0, n - 1
    while k >= 0:
        kept[count] = k
        count, k = count + 1, before[k]
    kept = kept[:count][::-1].copy()
    return kept, cost[kept]


def _spread(scene: FootprintScene, base: Steering, poses: Array, count: int) -> Array:
    """The poses of a path, and about ``count`` more spread between them."""
    motions = np.zeros((MOTIONS, 2))
    pairs = list(zip(poses[:-1], poses[1:], strict=True))
    costs = [steer(scene, base, a, b, np.inf, motions) for a, b in pairs]
    rows = [poses[:1]]
    for (a, b), cost in zip(pairs, costs, strict=True):
        between = round(count * cost / sum(costs))
        rows += [_along(scene, base, a, b, np.arange(1, between + 1) / (between + 1)), b[None]]
    return np.concatenate(rows)


def _along(scene: FootprintScene, base: Steering, a: Array, b: Array, shares: Array) -> Array:
    """Poses at shares of the cost of the steered path between two poses."""
    if base.kind == SLIDE:
        change = np.array([b[0] - a[0], b[1] - a[1], wrapped(b[2] - a[2])])
        slid: Array = a + shares[:, None] * change
        return slid
    motions = np.zeros((MOTIONS, 2))
    steer(scene, base, a, b, np.inf, motions)
    weight = np.where(motions[:, 0] == 0, base.weight, 0.0)
    costs = np.abs(motions[:, 0]) + weight * np.abs(motions[:, 1])
    ends = np.cumsum(costs)
    poses = []
    for at in shares * ends[-1]:
        x, y, yaw = a
        for (length, turn), end, cost in zip(motions, ends, costs, strict=True):
            part = 1.0 if end <= at else max(0.0, 1.0 - (end - at) / max(cost, NEGLIGIBLE))
            x, y, yaw = arc_end(x, y, yaw, part * length, part * turn)
        poses.append((x, y, yaw))
    return np.array(poses).reshape(-1, 3)


def pose_text(pose: Array) -> str:
    """A pose as messages name it.

    Examples
    --------
    >>> pose_text(np.array([1.0, 0.5, 1.57]))
    '(1.000, 0.500, 1.570 rad)'
    """
    return f"({pose[0]:z.3f}, {pose[1]:z.3f}, {pose[2]:z.3f} rad)"
