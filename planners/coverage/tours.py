"""Short tours: open ones through points or sets of them in any order, and one through polygons in theirs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from regionik.planners.coverage.options import COVERAGE
from regionik.planners.coverage.or_opt import improved_tour
from regionik.worlds.arrays import Array

MIN_GAIN = 1e-12  # below which a tour counts as no shorter [m]

Index = NDArray[np.intp]


@dataclass(frozen=True)
class VisitingOrder:
    """An order in which to visit points, each once, without going back to the first."""

    order: tuple[int, ...]
    length: float  # from the start, if there is one, to the last point [m]


def shortest_order(
    distance: ArrayLike, lead: ArrayLike | None = None, tail: ArrayLike | None = None
) -> VisitingOrder:
    """Return a short order in which to visit all points.

    Few points by dynamic programming over subsets (Held and Karp 1962), which is exact; more by local search
    (`or_opt`) on the closed tour through one node besides, as far from every point as the start is.

    Parameters
    ----------
    distance : (n, n) array_like
        Symmetric [m].
    lead, tail : (n,) array_like, optional
        Distance from the start to each point, and from each to the end; 0 by default [m].

    Examples
    --------
    >>> shortest_order(np.abs(np.subtract.outer([3.0, 1.0, 2.0], [3.0, 1.0, 2.0])))
    VisitingOrder(order=(1, 2, 0), length=2.0)
    """
    far = np.asarray(distance, dtype=np.float64)
    first, last = _ends(far, lead), _ends(far, tail)
    if len(far) <= COVERAGE.max_exact_order:
        order = _held_karp(far, first, last)
        return VisitingOrder(tuple(order), _open_length(order, far, first, last))
    tour = improved_tour(_closed(far, first, last))
    tour = np.roll(tour, -int(np.flatnonzero(tour == 0)[0]))
    way = (tour[:1:-1] if tour[1] == 1 else tour[1:-1]) - 2
    return VisitingOrder(tuple(way.tolist()), _open_length(way, far, first, last))


def shortest_tour_of_sets(
    distance: ArrayLike, owner: ArrayLike, lead: ArrayLike | None = None, tail: ArrayLike | None = None
) -> VisitingOrder:
    """Order in which to visit one point of each set, the points themselves chosen too.

    A generalised travelling salesman problem (Noon and Bean 1991): few sets by dynamic programming over
    subsets, which is exact. Of more the order for given points (`shortest_order`) and the best points for
    that order (`shortest_choice`) take turns until nothing is gained, at first with the distance of two sets
    as that of their nearest points.

    Parameters
    ----------
    distance : (m, m) array_like
        Symmetric; infinite where there is no way [m].
    owner : (m,) array_like of int
        Set of each point, all from 0 on.
    lead, tail : (m,) array_like, optional
        As of `shortest_order`.

    Examples
    --------
    >>> apart = np.abs(np.subtract.outer([0.0, 5.0, 6.0, 1.0], [0.0, 5.0, 6.0, 1.0]))
    >>> shortest_tour_of_sets(apart, [0, 0, 1, 2])
    VisitingOrder(order=(3, 1, 2), length=5.0)
    """
    far, own = np.asarray(distance, dtype=np.float64), np.asarray(owner, dtype=np.intp)
    first, last = _ends(far, lead), _ends(far, tail)
    count = int(own.max()) + 1
    if count <= COVERAGE.max_exact_order:
        exact = _held_karp(far, first, last, own)
        return VisitingOrder(tuple(exact), _open_length(exact, far, first, last))
    members = [np.flatnonzero(own == k) for k in range(count)]
    by = np.concatenate(members)
    begins = np.cumsum([0, *(len(some) for some in members[:-1])])
    rows = np.minimum.reduceat(far[:, by], begins, axis=1)[by]
    nearest = np.minimum.reduceat(rows, begins, axis=0)
    ends = [np.minimum.reduceat(row[by], begins) for row in (first, last)]
    order = shortest_order(nearest, *ends).order
    best, length = list[int](), np.inf
    for _ in range(COVERAGE.max_alternations):
        chosen = shortest_choice(far, [members[k] for k in order], first, last)
        now = _open_length(chosen, far, first, last)
        if now >= length - MIN_GAIN:
            break
        best, length = chosen, now
        some = np.array(best)
        again = shortest_order(far[np.ix_(some, some)], first[some], last[some])
        order = tuple(int(own[some[n]]) for n in again.order)
    return VisitingOrder(tuple(best), length)


def shortest_choice(distance: Array, layers: Sequence[Index], lead: Array, tail: Array) -> list[int]:
    """Points, one of each layer (k,), through which a tour of the layers in their order is shortest.

    The other arguments are those of `shortest_tour_of_sets`.
    """
    steps = (distance[np.ix_(here, there)] for here, there in pairwise(layers))
    chosen = _cheapest_through(lead[layers[0]], steps, tail[layers[-1]])
    return [int(layer[k]) for layer, k in zip(layers, chosen, strict=True)]


def _cheapest_through(cost: Array, steps: Iterable[Array], end: Array | float = 0.0) -> list[int]:
    """One option of each layer, by dynamic programming: costs of the first, of steps between, of the last."""
    back = list[Index]()
    for step in steps:
        ways = cost[:, None] + step
        back.append(np.argmin(ways, axis=0))
        cost = ways.min(axis=0)
    chosen = [int(np.argmin(cost + end))]
    for table in back[::-1]:
        chosen.append(int(table[chosen[-1]]))
    return chosen[::-1]


def _ends(far: Array, some: ArrayLike | None) -> Array:
    return np.zeros(len(far)) if some is None else np.asarray(some, dtype=np.float64)


def _closed(far: Array, first: Array, last: Array) -> Array:
    """Weights of closed tours that stand for open ones: a start, and an end at its distances from the points.

    The way from the end back to the start costs so much less than nothing that all short tours take it.
    """
    weights = np.zeros((len(far) + 2, len(far) + 2))
    longest = float(far.max())
    weights[0, 2:] = weights[2:, 0] = first
    weights[1, 2:] = weights[2:, 1] = longest + last  # once in every tour
    weights[2:, 2:] = far
    weights[0, 1] = weights[1, 0] = -4.0 * (longest + float(first.max() + last.max()) + 1.0)
    return weights


def _held_karp(far: Array, first: Array, last: Array, owner: Index | None = None) -> list[int]:
    """Shortest order: C(S, k) = min over m of C(S - k, m) + d(m, k) (Held and Karp 1962).

    S are the sets of points that are visited, k the point that one of these is visited at.
    """
    own = np.arange(len(far)) if owner is None else owner
    if not len(far):
        return []
    bit, full = 1 << own, (1 << int(own.max()) + 1) - 1
    on, column = np.full((full + 1, len(far)), np.inf), np.arange(len(far))
    before = np.full((full + 1, len(far)), -1)
    cost = np.full(len(far), np.inf)
    for seen in range(1, full + 1):
        inside = (seen & bit) > 0
        cost = np.where(inside, on[seen & ~bit, column], np.inf)
        cost = np.where(bit == seen, first, cost)
        ways = cost[:, None] + far
        before[seen] = np.argmin(ways, axis=0)
        on[seen] = ways[before[seen], column]
    k = int(np.argmin(cost + last))
    seen, order = full, [k]
    while seen != bit[k]:
        seen &= ~int(bit[k])
        k = int(before[seen, k])
        order.append(k)
    return order[::-1]


def _open_length(order: Sequence[int] | Index, far: Array, first: Array, last: Array) -> float:
    way = np.asarray(order, dtype=np.intp)
    return float(first[way[:1]].sum() + far[way[:-1], way[1:]].sum() + last[way[-1:]].sum())


def short_tour(regions: Sequence[BaseGeometry], start: Array | None) -> Array:
    """Short tour through regions in their order: one point of each, (n, 2) [m].

    The best tour through some points of each region (dynamic programming), then each point moved to where the
    tour is shortest while its neighbours stay, until that gains nothing. It is not proven the shortest.
    """
    points = _best_of_samples([_sampled(region) for region in regions], start)
    for _ in range(COVERAGE.max_polygon_rounds):
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
    steps = (np.hypot(*(here[:, None] - there).transpose(2, 0, 1)) for here, there in pairwise(samples))
    chosen = _cheapest_through(cost, steps)
    return np.array([spots[k] for spots, k in zip(samples, chosen, strict=True)])


def _between(region: BaseGeometry, before: Array | None, after: Array | None, here: Array) -> Array:
    """Point of a region through which the tour from one point to another is shortest."""
    if before is None or after is None:
        end = after if before is None else before
        return here if end is None else np.array(shapely.shortest_line(region, Point(end)).coords[0])
    line = LineString([before, after])
    if region.intersects(line):
        return np.array(shapely.shortest_line(region & line, Point(here)).coords[0])
    rings = map(shapely.get_coordinates, shapely.get_rings(shapely.get_parts(region)))
    spots = np.vstack([_reflection_points(ring, before, after) for ring in rings])
    ways = np.hypot(*(spots - before).T) + np.hypot(*(spots - after).T)
    best = int(np.argmin(ways))
    now = float(np.hypot(*(here - before)) + np.hypot(*(here - after)))
    return spots[best] if ways[best] < now - MIN_GAIN else here


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
