"""Short tours: an open one through points in any order, and one through polygons in their order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from regionik.planners.coverage.or_opt import improved_tour, one_tree_bound
from regionik.worlds.arrays import Array

MOST_EXACT = 12  # points whose best order is found by dynamic programming over subsets
ROUNDS = 50  # in which points of a tour through polygons are moved
GAIN = 1e-12  # below which a tour counts as no shorter [m]

Index = NDArray[np.intp]


@dataclass(frozen=True)
class VisitingOrder:
    """An order in which to visit points, each once, without going back to the first."""

    order: tuple[int, ...]
    length: float  # from the start, if there is one, to the last point [m]
    lower: float  # no order is shorter [m]


def shortest_order(distance: ArrayLike, lead: ArrayLike | None = None) -> VisitingOrder:
    """Order in which to visit all points, and a lower bound of its length.

    Few points by dynamic programming over subsets (Held and Karp 1962), which is exact; more by local search
    (`or_opt`) on the closed tour through one node besides, as far from every point as the start is.

    Parameters
    ----------
    distance : (n, n) array_like
        Symmetric [m].
    lead : (n,) array_like, optional
        Distance from the start to each point; 0 by default [m].

    Examples
    --------
    >>> shortest_order(np.abs(np.subtract.outer([3.0, 1.0, 2.0], [3.0, 1.0, 2.0])))
    VisitingOrder(order=(1, 2, 0), length=2.0, lower=2.0)
    """
    far = np.asarray(distance, dtype=np.float64)
    first = np.zeros(len(far)) if lead is None else np.asarray(lead, dtype=np.float64)
    if len(far) <= MOST_EXACT:
        order = _held_karp(far, first)
        length = _open_length(order, far, first)
        return VisitingOrder(tuple(order), length, length)
    closed = _closed(far, first)
    tour = improved_tour(closed, 0)
    tour = np.roll(tour, -int(np.flatnonzero(tour == 0)[0]))
    way = (tour[:1:-1] if tour[1] == 1 else tour[1:-1]) - 2
    length = _open_length(way, far, first)
    shift = closed[0, 1] + closed[1, 2]
    lower = one_tree_bound(closed, length + shift) - shift
    return VisitingOrder(tuple(way.tolist()), length, max(0.0, min(length, lower)))


def _closed(far: Array, first: Array) -> Array:
    """Weights of closed tours that stand for open ones: a start, and an end that is no way from any point.

    The way from the end back to the start costs so much less than nothing that all short tours take it.
    """
    weights = np.zeros((len(far) + 2, len(far) + 2))
    longest = float(far.max())
    weights[0, 2:] = weights[2:, 0] = first
    weights[1, 2:] = weights[2:, 1] = longest  # once in every tour, so that trees have the end for a leaf
    weights[2:, 2:] = far
    weights[0, 1] = weights[1, 0] = -4.0 * (longest + float(first.max()) + 1.0)
    return weights


def _held_karp(far: Array, first: Array) -> list[int]:
    """Shortest order: C(S, k) = min over m of C(S - k, m) + d(m, k) (Held and Karp 1962)."""
    n = len(far)
    cost = np.full((1 << n, n), np.inf)
    before = np.full((1 << n, n), -1)
    for k in range(n):
        cost[1 << k, k] = first[k]
    for seen in range(1, 1 << n):
        for k in range(n):
            if not seen >> k & 1 or seen == 1 << k:
                continue
            ways = cost[seen ^ 1 << k] + far[:, k]
            before[seen, k] = int(np.argmin(ways))
            cost[seen, k] = ways[before[seen, k]]
    seen, order = (1 << n) - 1, []
    k = int(np.argmin(cost[seen])) if n else -1
    while k >= 0:
        order.append(k)
        seen, k = seen ^ 1 << k, int(before[seen, k])
    return order[::-1]


def _open_length(order: Sequence[int] | Index, far: Array, first: Array) -> float:
    way = np.asarray(order, dtype=np.intp)
    return float(first[way[0]] + far[way[:-1], way[1:]].sum()) if len(way) else 0.0


def short_tour(regions: Sequence[BaseGeometry], start: Array | None) -> Array:
    """Short tour through regions in their order: one point of each, (n, 2) [m].

    The best tour through some points of each region (dynamic programming), then each point moved to where the
    tour is shortest while its neighbours stay, until that gains nothing. It is not proven the shortest.

    Parameters
    ----------
    start : (2,) array or None
    """
    points = _best_of_samples([_sampled(region) for region in regions], start)
    for _ in range(ROUNDS):
        moved = 0.0
        for i, region in enumerate(regions):
            before = points[i - 1] if i else start
            after = points[i + 1] if i + 1 < len(regions) else None
            better = _between(region, before, after, points[i])
            moved = max(moved, float(np.hypot(*(better - points[i]))))
            points[i] = better
        if moved < 1e-6:
            break
    return points


def _sampled(region: BaseGeometry) -> Array:
    """About fifty corners of a region at most, and a point inside it."""
    corners = shapely.get_coordinates(region)
    middle = shapely.get_coordinates(shapely.point_on_surface(region))
    return np.vstack([middle, corners[:: max(1, len(corners) // 50)]])


def _best_of_samples(samples: list[Array], start: Array | None) -> Array:
    """Shortest tour through one sample of each region, by dynamic programming."""
    cost = np.zeros(len(samples[0])) if start is None else np.hypot(*(samples[0] - start).T)
    back: list[Index] = []
    for here, there in pairwise(samples):
        ways = cost[:, None] + np.hypot(*(here[:, None] - there[None]).transpose(2, 0, 1))
        back.append(np.argmin(ways, axis=0))
        cost = ways.min(axis=0)
    k = int(np.argmin(cost))
    chosen = [k]
    for table in back[::-1]:
        k = int(table[k])
        chosen.append(k)
    return np.array([spots[k] for spots, k in zip(samples, chosen[::-1], strict=True)])


def _between(region: BaseGeometry, before: Array | None, after: Array | None, here: Array) -> Array:
    """Point of a region through which the tour from one point to another is shortest."""
    if before is None or after is None:
        end = after if before is None else before
        return here if end is None else np.array(shapely.shortest_line(region, Point(end)).coords[0])
    line = LineString([before, after])
    if region.intersects(line):
        return np.array(shapely.shortest_line(region & line, Point(here)).coords[0])
    spots = np.vstack(
        [_reflection_points(shapely.get_coordinates(ring), before, after) for ring in _rings(region)]
    )
    ways = np.hypot(*(spots - before).T) + np.hypot(*(spots - after).T)
    best = int(np.argmin(ways))
    now = float(np.hypot(*(here - before)) + np.hypot(*(here - after)))
    return spots[best] if ways[best] < now - GAIN else here


def _rings(region: BaseGeometry) -> list[BaseGeometry]:
    """Rings of all polygons of a region."""
    rings: list[BaseGeometry] = list(shapely.get_rings(shapely.get_parts(region)))
    return rings


def _reflection_points(ring: Array, before: Array, after: Array) -> Array:
    """Point of each edge of a ring with the least sum of distances to both, by reflection in the edge."""
    a, along = ring[:-1], np.diff(ring, axis=0)
    length = np.hypot(*along.T)
    a, along, length = a[length > 0], along[length > 0], length[length > 0]
    unit = along / length[:, None]
    across = np.column_stack([-unit[:, 1], unit[:, 0]])
    heights = [np.abs(((end - a) * across).sum(axis=1)) for end in (before, after)]
    feet = [((end - a) * unit).sum(axis=1) for end in (before, after)]
    total = heights[0] + heights[1]
    share = np.where(total > 0, heights[0] / np.where(total > 0, total, 1.0), 0.5)
    at = np.clip(feet[0] + share * (feet[1] - feet[0]), 0.0, length)
    spots: Array = a + at[:, None] * unit
    return spots
