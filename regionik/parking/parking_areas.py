"""Areas to park in: those of set-points, shrunk by the circle to park in, and the stops that they allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry.base import BaseGeometry

from regionik.areas.free_space import FreeSpace, PathAreas, away
from regionik.areas.layers import Geometries
from regionik.ladder import Ladder, Mask, build_ladder
from regionik.parking.pivot_turns import EDGE_TOLERANCE
from regionik.planners.coverage.set_cover import fewest_runs
from regionik.planners.geometry.offsets import shrunk
from regionik.postures.arm_roadmap import FixedBasePostures
from regionik.postures.poses import axis_of
from regionik.regions import path_areas
from regionik.scene import Scene
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Order


@dataclass(frozen=True, eq=False)
class StopGroup:
    """Set-points that one stop can serve, and all positions from which it does."""

    setpoints: tuple[int, ...]
    places: dict[int, BaseGeometry]  # by side of the free space; shrunk by the circle to park in
    # (2,) position of the arm axis from which one heading is known to serve all of them [m]
    spot: Array | None = None
    # Postures at the set-points on a pose of the base there, where a place does not give the arm its own
    postures: FixedBasePostures | None = None
    poses: Array | None = None  # (n, 3) other bases there with a clear posture at each set-point

    def of(self, setpoints: tuple[int, ...]) -> StopGroup:
        """Return the group for some of the set-points, in the order given."""
        held, at = self.postures, [self.setpoints.index(i) for i in setpoints]
        return replace(self, setpoints=setpoints, postures=None if held is None else held.of(at))


@dataclass(frozen=True, eq=False)
class StopPart:
    """Set-points that are done from one place of the arm axis (2,), by side of the free space."""

    side: int
    axis: Array
    setpoints: tuple[int, ...]
    # at the set-points, where a place does not give the arm its posture
    postures: FixedBasePostures | None = None


@dataclass(frozen=True, eq=False)
class ParkingAreas:
    """Areas to park in, for one free space and some facings."""

    free_space: FreeSpace
    facings: tuple[int, ...]
    piece: int  # label of the floor that the base gets to
    areas: PathAreas
    ladder: Ladder
    usable: Mask  # (m,) components on the floor that the base gets to
    narrow: Geometries  # (m,) components shrunk by the circle to park in
    _areas: dict[int, Geometries] = field(default_factory=dict)

    @cached_property
    def back(self) -> tuple[tuple[int, ...], ...]:
        """For each component those of the set-point before that the arm comes from on a stationary base."""
        back: list[list[int]] = [[] for _ in self.ladder.component]
        for m, k in self.ladder.edges.tolist():
            if self.ladder.side[m] == self.ladder.side[k]:
                back[k].append(m)
        return tuple(map(tuple, back))

    @cached_property
    def floor(self) -> BaseGeometry:
        """The piece of floor that the base can reach, at any heading."""
        return shapely.union_all(self.free_space.whole(self.piece))

    def groups(self, begin: int = 0, end: int | None = None) -> list[StopGroup]:
        """Return the fewest groups of set-points ``begin`` to ``end`` in their order, with their places."""
        rungs = self.ladder.rungs[begin : None if end is None else end + 1]
        offset = int(rungs[0])
        back = [[m - offset for m in row if m >= offset] for row in self.back[offset : int(rungs[-1])]]
        runs = fewest_runs(self.narrow[offset:], rungs - offset, back)
        return [
            StopGroup(
                tuple(range(begin + run.first, begin + run.last + 1)),
                self._by_side({k + offset: area for k, area in run.ends.items()}),
            )
            for run in runs
        ]

    @cached_property
    def sides(self) -> list[int]:
        """Return the sides of the free space that have areas."""
        return sorted(set(self.ladder.side.tolist()))

    def group(self, setpoints: tuple[int, ...], order: Order) -> StopGroup:
        """Return the group of given set-points with all their places, in their order or in any."""
        if order == "given":
            return self.groups(setpoints[0], setpoints[-1] + 1)[0]
        shared = {s: shapely.intersection_all(self.areas_at(s)[list(setpoints)]) for s in self.sides}
        return StopGroup(setpoints, {s: area for s, area in shared.items() if area.area > 0})

    def areas_at(self, side: int) -> Geometries:
        """Return the places to park at one side, by set-point, whatever the posture."""
        if side not in self._areas:
            own, target = self.ladder.side == side, self.ladder.target
            parts = [self.narrow[own & (target == i)] for i in range(self.ladder.count)]
            self._areas[side] = np.array([shapely.union_all(part) for part in parts], dtype=object)
        return self._areas[side]

    def shared(self, setpoints: Sequence[int], side: int, near: ArrayLike) -> BaseGeometry:
        """The connected part of what areas share that is nearest to a place; empty where they share none."""
        parts = shapely.get_parts(shapely.intersection_all(self.areas_at(side)[list(setpoints)]))
        if not len(parts):
            return shapely.Polygon()
        return parts[int(np.argmin(shapely.distance(parts, shapely.Point(near))))]

    def about(self, setpoints: Sequence[int], side: int, axis: Array, tolerance: float) -> BaseGeometry:
        """What areas share around a place that serves set-points; the circle to park in where they do not."""
        shared, place = self.shared(setpoints, side, axis), shapely.Point(axis)
        return shared if shared.covers(place) else place.buffer(max(tolerance, 1e-3))  # wide enough to see

    def nearest(self, setpoints: Sequence[int], axis: Array, yaw: float) -> tuple[int, ...]:
        """Component of each set-point nearest to a pose in heading, then in place."""
        off = np.array([away(yaw, side.span) for side in self.free_space.sides])[self.ladder.side]
        chain = list[int]()
        for i in setpoints:
            own = np.arange(*self.ladder.rungs[i : i + 2])
            far = shapely.distance(self.ladder.component[own], shapely.Point(axis))
            chain.append(int(own[np.lexsort((far, off[own]))[0]]))
        return tuple(chain)

    def deepest_chain(
        self, setpoints: Sequence[int], axis: Array, side: int, linked: bool
    ) -> tuple[int, ...] | None:
        """Component of each set-point around a position, the least depth the most; ``linked`` to the next."""
        rows = list[dict[int, tuple[float, int]]]()
        for i in setpoints:
            row: dict[int, tuple[float, int]] = {}
            for k in self._own(i, side):
                if depth(self.narrow[k], axis) < -EDGE_TOLERANCE:
                    continue
                room, before = depth(self.ladder.component[k], axis), -1
                if rows:
                    last = rows[-1]
                    options = [m for m in self.back[k] if m in last] if linked else list(last)
                    if not options:
                        continue
                    before = max(options, key=lambda m: last[m][0])
                    room = min(room, last[before][0])
                row[k] = (room, before)
            if not row:
                return None
            rows.append(row)
        k = max(rows[-1], key=lambda m: rows[-1][m][0])
        chain = [k]
        for row in rows[:0:-1]:
            k = row[k][1]
            chain.append(k)
        return tuple(chain[::-1])

    def nearest_chain(self, setpoints: Sequence[int], axis: Array, side: int) -> tuple[int, ...]:
        """Component of each set-point nearest to a position, linked to the one before, while there is one."""
        chain = list[int]()
        for i in setpoints:
            linked = [k for k in self._own(i, side) if not chain or chain[-1] in self.back[k]]
            if not linked:
                break
            chain.append(min(linked, key=lambda k: -depth(self.ladder.component[k], axis)))
        return tuple(chain)

    def _own(self, i: int, side: int) -> list[int]:
        """Components of a set-point at one side."""
        rungs = self.ladder.rungs[i : i + 2].tolist()
        return [k for k in range(*rungs) if self.ladder.side[k] == side]

    def _by_side(self, ends: dict[int, BaseGeometry]) -> dict[int, BaseGeometry]:
        sides = sorted({int(self.ladder.side[k]) for k in ends})
        return {
            s: shapely.union_all([area for k, area in ends.items() if self.ladder.side[k] == s])
            for s in sides
        }


@dataclass(frozen=True, eq=False)
class Parking:
    """Fewest stops and a lower bound of their number."""

    parking_areas: ParkingAreas
    groups: tuple[StopGroup, ...]
    lower: int  # no base needs fewer stops
    known: dict[str, int | bool | str] = field(default_factory=dict)  # how the bound is
    # (n, 2) by side, in any order: places of all sets of set-points whose areas meet, the largest of them [m]
    spots: dict[int, Array] = field(default_factory=dict)
    # Areas on other pieces of floor that serve all, where areas do not tell on which fewer stops do
    elsewhere: tuple[ParkingAreas, ...] = ()

    def stats(self, count: int) -> dict[str, int | bool | str]:
        """What is told of so many stops, which headings or the motion may have split, and of their bound."""
        return {"count": count, "proven_fewest": count <= self.lower, **self.known}


def parking_areas_on(scene: Scene, free_space: FreeSpace, facings: tuple[int, ...]) -> list[ParkingAreas]:
    """Areas on each piece of floor that the base may be on."""
    areas = path_areas(scene, facings=facings, free_space=free_space)
    ladder = build_ladder(areas, len(scene.task), free_space)
    narrow = shrunk_by_circle(ladder.component, scene, outside=False)
    found = []
    for piece in _pieces(scene, free_space, ladder):
        usable = ladder.floor == piece
        own = narrow.copy()
        own[~usable] = shapely.Polygon()
        found.append(ParkingAreas(free_space, facings, piece, areas, ladder, usable, own))
    return found


def reordered(scene: Scene, parking_areas: ParkingAreas, order: Sequence[int]) -> ParkingAreas:
    """Parking areas for a world of the same set-points in another order, by the index that each had."""
    areas, free_space, place = parking_areas.areas, parking_areas.free_space, np.argsort(order)
    moved = areas.sorted_by(place[areas.target])
    ladder = build_ladder(moved, len(scene.task), free_space)
    by = np.argsort(
        place[parking_areas.ladder.target], kind="stable"
    )  # as rows of areas, so their components
    narrow, usable = parking_areas.narrow[by], parking_areas.usable[by]
    return ParkingAreas(free_space, parking_areas.facings, parking_areas.piece, moved, ladder, usable, narrow)


def _pieces(scene: Scene, free_space: FreeSpace, ladder: Ladder) -> list[int]:
    """Pieces of free floor that the base may work on: the one it starts on, or any."""
    if scene.start is None:
        return sorted(set(ladder.floor.tolist()) - {-1})
    piece = free_space.piece_at(axis_of(scene.robot, scene.start.base), float(scene.start.base[2]))
    return [] if piece is None else [piece]


def shrunk_by_circle(shapes: Geometries, scene: Scene, *, outside: bool) -> Geometries:
    """Places whose circle to park in lies in a shape, bounded from outside or from inside."""
    by = scene.rules.stop_tolerance
    if by == 0.0:
        return shapes
    return np.array([shrunk(shape, by, outside=outside) for shape in shapes], dtype=object)


def radius(area: BaseGeometry) -> float:
    """Radius of the largest circle inside an area [m]."""
    return float(shapely.maximum_inscribed_circle(area).length)


def depth(area: BaseGeometry, axis: Array) -> float:
    """Distance of a position to the boundary of an area, below 0 outside [m]."""
    point = shapely.Point(axis)
    far = float(shapely.distance(shapely.boundary(area), point))
    return far if area.covers(point) else -far
