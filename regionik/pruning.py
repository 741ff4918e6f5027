"""Whole-path areas: the ladder of components, cut to what a full traversal uses.

While the tool rests at set-point i the base may go anywhere within one component of its area; the tool goes
on to i + 1 while the base stands in a component of both. So a path without lift-offs is a chain of components
with non-empty intersections. Source: M-FABRIK, experiment 4 (areas made for the whole path in advance).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from regionik.ground import Geometries, Side
from regionik.reachable import Family
from regionik.regions import PathAreas
from regionik.worlds.arrays import Array

LEAST_AREA = 1e-8  # components and intersections below this are noise [m2]

Mask = NDArray[np.bool_]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Ladder:
    """Components of successive areas, and which of them the base can go between with the tool on the path.

    Attributes
    ----------
    count : int
        Number of set-points.
    component : (m,) array of Polygon
    target : (m,) array of int
        Set-point of each component, ascending.
    family : tuple of Family
    floor : (m,) array of int
        Connected piece of the free floor that holds the component.
    edges : (e, 2) array of int
        Pairs of components of neighbouring set-points that overlap.
    """

    count: int
    component: Geometries
    target: Index
    family: tuple[Family, ...]
    floor: Index
    edges: Index

    def rungs(self) -> Index:
        """First component of every set-point, and the end: ``rungs[i]:rungs[i + 1]`` are those of i."""
        return np.searchsorted(self.target, np.arange(self.count + 1))


@dataclass(frozen=True, eq=False)
class Pruned:
    """A ladder after both cuts.

    Attributes
    ----------
    ladder : Ladder
    keep : (m,) array of bool
        Components that some traversal of their run uses.
    breaks : tuple of int
        Set-points before which the tool must be lifted.
    """

    ladder: Ladder
    keep: Mask
    breaks: tuple[int, ...]

    def area(self, i: int) -> BaseGeometry:
        """What is left of the area of set-point i."""
        rungs = self.ladder.rungs()
        span = slice(rungs[i], rungs[i + 1])
        return shapely.union_all(self.ladder.component[span][self.keep[span]])


def build_ladder(areas: PathAreas, count: int, side: Side) -> Ladder:
    """Split areas into components and join those of neighbouring set-points that overlap.

    Parameters
    ----------
    areas : PathAreas
    count : int
        Number of set-points.
    side : Side
        The ground the areas lie on.
    """
    parts, row = shapely.get_parts(areas.inner, return_index=True)
    real = (shapely.get_type_id(parts) == 3) & (shapely.area(parts) > LEAST_AREA)
    parts, row = parts[real], row[real]
    target = areas.target[row]
    order = np.argsort(target, kind="stable")
    parts, row, target = parts[order], row[order], target[order]
    shapely.prepare(parts)
    kinds = tuple(areas.family[k] for k in row)
    return Ladder(count, parts, target, kinds, _pieces(parts, side), _overlaps(parts, target, kinds, count))


def _pieces(parts: Geometries, side: Side) -> Index:
    """Index of the piece of free floor that holds each component (-1 for none)."""
    spots = shapely.point_on_surface(parts)
    piece = np.full(len(parts), -1, dtype=np.intp)
    which, found = shapely.STRtree(side.pieces).query(spots, predicate="intersects")
    piece[which] = found
    return piece


def _overlaps(parts: Geometries, target: Index, kinds: Sequence[Family], count: int) -> Index:
    """Pairs of components of neighbouring set-points, of like posture, that share an area."""
    rungs = np.searchsorted(target, np.arange(count + 1))
    facing = np.array([kind.facing for kind in kinds])
    pitch = np.array([kind.pitch for kind in kinds])
    first = second = np.empty(0, dtype=np.intp)
    sizes = np.diff(rungs)
    if count > 1 and len(parts):
        inner = target < count - 1
        repeat = np.where(inner, sizes[np.minimum(target + 1, count - 1)], 0)
        here = np.repeat(np.arange(len(parts)), repeat)
        offset = np.arange(len(here)) - np.repeat(np.cumsum(repeat) - repeat, repeat)
        there = rungs[np.minimum(target[here] + 1, count)] + offset
        turn = np.abs(np.nan_to_num(pitch[here] - pitch[there], nan=0.0))
        alike = (facing[here] == facing[there]) & (np.isnan(pitch[here]) == np.isnan(pitch[there]))
        alike &= turn < np.pi / 2
        here, there = here[alike], there[alike]
        touch = shapely.intersects(parts[here], parts[there])
        here, there = here[touch], there[touch]
        shared = shapely.area(shapely.intersection(parts[here], parts[there])) > LEAST_AREA
        first, second = here[shared], there[shared]
    return np.column_stack([first, second]).astype(np.intp).reshape(-1, 2)


def prune(ladder: Ladder, usable: Mask) -> Pruned:
    """Cut, run by run, every component that no full traversal of the run uses.

    Runs are made as long as they go, so that lift-offs are fewest: a run that could go on loses nothing by
    going on.

    Parameters
    ----------
    ladder : Ladder
    usable : (m,) array of bool
        Components that the base can get to at all.
    """
    rungs = ladder.rungs()
    ahead = _neighbours(ladder, forward=True)
    back = _neighbours(ladder, forward=False)
    keep = np.zeros(len(ladder.component), dtype=bool)
    breaks: list[int] = []
    alive = usable[rungs[0] : rungs[1]].copy()
    keep[rungs[0] : rungs[1]] = alive
    start = 0
    for i in range(1, ladder.count):
        # Forward cut: reachable from a component kept one rung before.
        span = np.arange(rungs[i], rungs[i + 1])
        reached = np.array([any(keep[j] for j in back[k]) for k in span], dtype=bool) & usable[span]
        if not reached.any():
            _cut_back(keep, ahead, rungs, start, i)
            breaks.append(i)
            start = i
            reached = usable[span].copy()
        keep[span] = reached
    _cut_back(keep, ahead, rungs, start, ladder.count)
    return Pruned(ladder, keep, tuple(breaks))


def _cut_back(keep: Mask, ahead: list[list[int]], rungs: Index, start: int, stop: int) -> None:
    """Backward cut of one run: a component stays where one kept component follows it."""
    for i in range(stop - 2, start - 1, -1):
        for k in range(rungs[i], rungs[i + 1]):
            keep[k] = keep[k] and any(keep[j] for j in ahead[k])


def _neighbours(ladder: Ladder, *, forward: bool) -> list[list[int]]:
    table: list[list[int]] = [[] for _ in ladder.component]
    for a, b in ladder.edges.tolist():
        if forward:
            table[a].append(b)
        else:
            table[b].append(a)
    return table


def choose_chain(pruned: Pruned, start: Array | None) -> list[int]:
    """One kept component for each set-point, joined within every run, with the least base travel.

    Travel is that of a base that always moves to the nearest point of the next component, as M-FABRIK does.

    Parameters
    ----------
    pruned : Pruned
    start : (2,) array or None
        Where the arm axis stands at first.
    """
    ladder, rungs = pruned.ladder, pruned.ladder.rungs()
    back = _neighbours(ladder, forward=False)
    before: list[int] = [-1] * len(ladder.component)
    best: dict[int, tuple[float, Point]] = {}
    for i in range(ladder.count):
        kept = [k for k in range(rungs[i], rungs[i + 1]) if pruned.keep[k]]
        now: dict[int, tuple[float, Point]] = {}
        for k in kept:
            if i == 0:
                spot = Point(start) if start is not None else ladder.component[k].representative_point()
                now[k] = _go(0.0, spot, ladder.component[k])
                continue
            options = list(best) if i in pruned.breaks else [j for j in back[k] if j in best]
            trips = [(*_go(*best[j], ladder.component[k]), j) for j in options]
            cost, spot, before[k] = min(trips, key=lambda trip: (trip[0], trip[2]))
            now[k] = (cost, spot)
        best = now
    k = min(best, key=lambda k: (best[k][0], k))
    chain = [k]
    while before[k] >= 0:
        k = before[k]
        chain.append(k)
    return chain[::-1]


def _go(cost: float, spot: Point, component: BaseGeometry) -> tuple[float, Point]:
    """Travel to the nearest point of a component, and that point."""
    if component.intersects(spot):
        return cost, spot
    line = shapely.shortest_line(spot, component)
    return cost + line.length, Point(line.coords[-1])
