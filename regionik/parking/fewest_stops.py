"""Fewest stops of the base from which all set-points are done standing still.

A position of the base serves set-points one after the other where it lies in a component of each, of one slab
of headings and of postures that the arm can go on between. The number is proven to be the fewest for these
inner areas, each shrunk by the radius of the circle to park in, with headings and solids in the arm's way
left aside; the same count over outer areas is a bound that no base falls below.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import Geometries
from regionik.areas.standing import Index, PathAreas, Standing
from regionik.explain.constraints import no_way_to, setpoint_at
from regionik.explain.failures import cut_off, no_place
from regionik.ladder import Ladder, Mask, build_ladder
from regionik.parking.held_postures import HeldPostures
from regionik.planners.coverage.set_cover import (
    OverlayFaces,
    SetCover,
    fewest_runs,
    least_cover,
    least_cover_by_faces,
    overlay_faces,
    stride,
)
from regionik.planners.geometry.offsets import shrunk
from regionik.postures.poses import axis_of
from regionik.regions import outer_areas, path_areas, ways_to_stand
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Cause, Explanation, NoPlanFound
from regionik.worlds.scene import Order, Target, World


@dataclass(frozen=True, eq=False)
class StopGroup:
    """Set-points that one stop can serve, and all positions that do.

    Attributes
    ----------
    setpoints : tuple of int
    places : dict of int to geometry
        By side of the standing; shrunk by the circle to park in.
    spot : (2,) array or None
        Position of the arm axis from which one heading is known to serve all of them [m].
    held : HeldPostures or None
        Postures at the set-points on a pose of the base there, where a place does not give the arm its own.
    """

    setpoints: tuple[int, ...]
    places: dict[int, BaseGeometry]
    spot: Array | None = None
    held: HeldPostures | None = None

    def of(self, setpoints: tuple[int, ...]) -> StopGroup:
        """Return the group for some of the set-points, in the order given."""
        held, at = self.held, [self.setpoints.index(i) for i in setpoints]
        return replace(self, setpoints=setpoints, held=None if held is None else held.of(at))


@dataclass(frozen=True, eq=False)
class ParkingAreas:
    """Areas to park in, under one way to stand and to face.

    Attributes
    ----------
    standing : Standing
    facings : tuple of int
    piece : int
        Label of the floor that the base gets to.
    areas : PathAreas
    ladder : Ladder
    usable : (m,) array of bool
        Components on the floor that the base gets to.
    narrow : (m,) array of geometry
        Components shrunk by the circle to park in.
    back : tuple of tuples of int
        For each component those of the set-point before that the arm comes from while the base stands still.
    """

    standing: Standing
    facings: tuple[int, ...]
    piece: int
    areas: PathAreas
    ladder: Ladder
    usable: Mask
    narrow: Geometries
    back: tuple[tuple[int, ...], ...]

    @cached_property
    def floor(self) -> BaseGeometry:
        """The piece of floor that the base gets to, at any heading."""
        floor: BaseGeometry = shapely.union_all(self.standing.whole(self.piece))
        return floor

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(self.narrow)

    def around(self, axis: Array, within: float) -> Index:
        """Components, shrunk by the circle to park in, that are this near to a position of the arm axis."""
        near: Index = np.sort(self._tree.query(shapely.Point(axis), predicate="dwithin", distance=within))
        return near

    def groups(self, begin: int = 0) -> list[StopGroup]:
        """Fewest groups of set-points in their order, from one of them on, with their places."""
        return self._groups(begin, self.ladder.count)

    def _groups(self, begin: int, end: int) -> list[StopGroup]:
        rungs = self.ladder.rungs[begin : end + 1]
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

    def group(self, setpoints: tuple[int, ...], order: Order) -> StopGroup:
        """Group of given set-points with all their places: in their order, or in any."""
        if order == "given":
            first, last = setpoints[0], setpoints[-1]
            return self._groups(first, last + 1)[0]
        sides = sorted(set(self.ladder.side.tolist()))
        shared = {s: shapely.intersection_all(self.areas_at(s)[list(setpoints)]) for s in sides}
        return StopGroup(setpoints, {s: area for s, area in shared.items() if area.area > 0})

    @cached_property
    def _areas(self) -> dict[int, Geometries]:
        return {s: _areas_of(self, s) for s in sorted(set(self.ladder.side.tolist()))}

    def areas_at(self, side: int) -> Geometries:
        """Places to park at one side, by set-point, whatever the posture."""
        return self._areas[side]

    def shared(self, setpoints: Sequence[int], side: int, near: ArrayLike) -> BaseGeometry:
        """The connected part of what areas share that is nearest to a place."""
        parts = shapely.get_parts(shapely.intersection_all(self.areas_at(side)[list(setpoints)]))
        return parts[int(np.argmin(shapely.distance(parts, shapely.Point(near))))]

    def _by_side(self, ends: dict[int, BaseGeometry]) -> dict[int, BaseGeometry]:
        sides = sorted({int(self.ladder.side[k]) for k in ends})
        return {
            s: shapely.union_all([area for k, area in ends.items() if self.ladder.side[k] == s])
            for s in sides
        }


@dataclass(frozen=True, eq=False)
class Parking:
    """Fewest stops and a lower bound of their number.

    Attributes
    ----------
    parking_areas : ParkingAreas
    groups : tuple of StopGroup
    lower : int
        No base needs fewer stops.
    stats : dict
        How the bound is known.
    spots : dict of int to (n, 2) array
        By side, in any order: places of all sets of set-points whose areas meet, the largest of them [m].
    """

    parking_areas: ParkingAreas
    groups: tuple[StopGroup, ...]
    lower: int
    stats: dict[str, int | bool | str] = field(default_factory=dict)
    spots: dict[int, Array] = field(default_factory=dict)


def park(world: World) -> Parking:
    """Fewest stops for a world's set-points, in their order or in any.

    Raises
    ------
    NoPlanFound
        Where a set-point has no place to park.
    """
    return park_in_any_order(world) if world.rules.order == "any" else park_in_order(world)


def park_in_order(world: World) -> Parking:
    """Stops that each go on for as long as they can, which makes them fewest (`fewest_runs`).

    Ways to stand and to face come in one after the other until the bound from outer areas is met.
    """
    best: Parking | None = None
    refused: NoPlanFound | None = None
    for standing, facings in ways_to_stand(world):
        for parking_areas in _parking_areas(world, standing(world), facings, None):
            groups = parking_areas.groups()
            done = groups[-1].setpoints[-1] + 1 if groups else 0
            if done < len(world.task):
                refused = refused or NoPlanFound(no_room(world, done, parking_areas))
            elif best is None or len(groups) < len(best.groups):
                best = Parking(parking_areas, tuple(groups), 1)
        if best is not None and len(best.groups) <= _lower_bound_in_order(world, best.groups):
            break
    if best is None:
        raise refused or NoPlanFound(no_place(world, 0))
    lower = _lower_bound_in_order(world, best.groups)
    stats: dict[str, int | bool | str] = {
        "count": len(best.groups),
        "lower_bound": lower,
        "bound": "outer areas",
    }
    return Parking(best.parking_areas, best.groups, lower, stats)


def park_in_any_order(world: World) -> Parking:
    """Fewest stops in any order: the least cover of the set-points by faces of their areas' overlay.

    Headings by slab come in only where a set-point has no place at every heading.
    """
    refused: NoPlanFound | None = None
    for standing, facings in list(ways_to_stand(world))[1::2]:
        found: list[Parking] = []
        for parking_areas in _parking_areas(world, standing(world), facings, None):
            empty = np.flatnonzero(_component_counts(parking_areas) == 0)
            if len(empty):
                refused = refused or NoPlanFound(no_room(world, int(empty[0]), parking_areas))
            else:
                found.append(_covered(world, parking_areas))
        if found:
            return min(found, key=lambda one: len(one.groups))
    raise refused or NoPlanFound(no_place(world, 0))


def _component_counts(parking_areas: ParkingAreas) -> Index:
    """Number of components of each set-point that leave room to park."""
    real = shapely.area(parking_areas.narrow) > 0
    return np.bincount(parking_areas.ladder.target[real], minlength=parking_areas.ladder.count).astype(
        np.intp
    )


def _covered(world: World, parking_areas: ParkingAreas) -> Parking:
    """The least cover, every set-point assigned to one of the faces that meet it."""
    sides = sorted(set(parking_areas.ladder.side.tolist()))
    part, faces, cover = least_cover_by_faces([parking_areas.areas_at(s) for s in sides])
    side = np.array(sides, dtype=np.intp)[part]
    groups = _assigned(world.task, faces, side, cover, parking_areas)
    some = world.task[:: stride(len(world.task))]  # none does with fewer than some of the set-points need
    outer = _shrunk(_outer(world, some), world, outside=True)
    bound = least_cover(overlay_faces(outer).inside)
    stats: dict[str, int | bool | str] = {
        "count": len(groups), "lower_bound": bound.lower, "bound": "outer areas",
        "fewest_of_inner_areas": cover.lower, "apart": cover.apart, "faces": len(faces.polygon),
    }  # fmt: skip
    middle = shapely.get_coordinates(shapely.point_on_surface(faces.polygon))
    spots = {s: middle[side == s] for s in sides}
    return Parking(parking_areas, tuple(groups), bound.lower, stats, spots)


def _areas_of(parking_areas: ParkingAreas, side: int) -> Geometries:
    """Places to park at one side, by set-point."""
    ladder, own = parking_areas.ladder, parking_areas.ladder.side == side
    parts = [parking_areas.narrow[own & (ladder.target == i)] for i in range(ladder.count)]
    areas = np.empty(ladder.count, dtype=object)
    areas[:] = [shapely.union_all(part) for part in parts]
    return areas


def _assigned(
    task: Sequence[Target], faces: OverlayFaces, side: Index, cover: SetCover, parking_areas: ParkingAreas
) -> list[StopGroup]:
    """Every set-point to the nearest of the chosen faces that meet it; places are what its areas share."""
    chosen = list(cover.chosen)
    spots = shapely.point_on_surface(faces.polygon[chosen])
    positions = shapely.points(np.array([target.position[:2] for target in task]))
    far = np.where(faces.inside[chosen], shapely.distance(spots[:, None], positions[None]), np.inf)
    owner = np.argmin(far, axis=0)
    groups = []
    for n, (face, spot) in enumerate(zip(chosen, spots, strict=True)):
        members = tuple(np.flatnonzero(owner == n).tolist())
        if members:
            s = int(side[face])
            groups.append(StopGroup(members, {s: parking_areas.shared(members, s, spot.coords[0])}))
    return groups


def _parking_areas(
    world: World, standing: Standing, facings: tuple[int, ...], known: PathAreas | None
) -> list[ParkingAreas]:
    """Areas on each piece of floor that the base may be on."""
    areas = known or path_areas(world, facings=facings, standing=standing)
    ladder = build_ladder(areas, len(world.task), standing)
    narrow = _shrunk(ladder.component, world, outside=False)
    back: list[list[int]] = [[] for _ in ladder.component]
    for m, k in ladder.edges.tolist():
        if ladder.side[m] == ladder.side[k]:
            back[k].append(m)
    found = []
    for piece in _pieces(world, standing, ladder):
        usable = ladder.floor == piece
        own = narrow.copy()
        own[~usable] = shapely.Polygon()
        linked = tuple(map(tuple, back))
        found.append(ParkingAreas(standing, facings, piece, areas, ladder, usable, own, linked))
    return found


def reordered(world: World, parking_areas: ParkingAreas, order: Sequence[int]) -> ParkingAreas:
    """Parking areas for a world of the same set-points in another order.

    Parameters
    ----------
    world : World
        Its set-points in that order.
    parking_areas : ParkingAreas
    order : sequence of int
        Index of each as they were.
    """
    areas = parking_areas.areas
    target = np.argsort(order)[areas.target]
    by = np.argsort(target, kind="stable")
    family = tuple(areas.family[k] for k in by.tolist())
    moved = PathAreas(target[by], family, areas.side[by], areas.reach[by], areas.inner[by])
    found = _parking_areas(world, parking_areas.standing, parking_areas.facings, moved)
    return next(one for one in found if one.piece == parking_areas.piece)


def _pieces(world: World, standing: Standing, ladder: Ladder) -> list[int]:
    """Pieces of free floor that the base may work on: the one it starts on, or any."""
    if world.start is None:
        return sorted(set(ladder.floor.tolist()) - {-1})
    piece = standing.piece_at(axis_of(world.robot, world.start.base), float(world.start.base[2]))
    return [] if piece is None else [piece]


def _outer(world: World, task: Sequence[Target]) -> Geometries:
    areas = np.empty(len(task), dtype=object)
    areas[:] = outer_areas(world, task)
    return areas


def _shrunk(shapes: Geometries, world: World, *, outside: bool) -> Geometries:
    """Places whose circle to park in lies in a shape, bounded from outside or from inside."""
    by = world.rules.stop_tolerance
    if by == 0.0:
        return shapes
    return np.array([shrunk(shape, by, outside=outside) for shape in shapes], dtype=object)


def _lower_bound_in_order(world: World, known: Sequence[StopGroup]) -> int:
    """Lower bound of the stops, whatever the headings and postures: fewest runs of outer areas.

    No stop is known to be saved where there is only one, so nothing is asked of the areas then.
    """
    return 1 if len(known) == 1 else _fewest_outer_runs(world)


@lru_cache(maxsize=8)
def _fewest_outer_runs(world: World) -> int:
    areas = _shrunk(_outer(world, world.task), world, outside=True)
    count = len(areas)
    back = [[i - 1] if i else [] for i in range(count)]
    return len(fewest_runs(areas, np.arange(count + 1), back))


def no_room(world: World, i: int, parking_areas: ParkingAreas) -> Explanation:
    """Explanation of a set-point i without a place to park."""
    rungs = parking_areas.ladder.rungs
    span = slice(int(rungs[i]), int(rungs[i + 1]))
    every = parking_areas.ladder.component[span]
    if not len(every):
        return no_place(world, i)
    if not parking_areas.usable[span].any():
        piece = parking_areas.ladder.floor[parking_areas.usable][:1].tolist() or [
            int(parking_areas.ladder.floor[span][0])
        ]
        return cut_off(
            world, i, shapely.union_all(parking_areas.standing.whole(piece[0])), shapely.union_all(every)
        )
    widest = max(radius(area) for area in every[parking_areas.usable[span]])
    wanted = world.rules.stop_tolerance
    who = setpoint_at(world.task, i)
    circle = f"circle of radius {wanted:.4f} m to park in"
    proven = shrunk(outer_areas(world, [world.task[i]])[0], wanted, outside=True).is_empty
    if proven:
        reason = f"{who} can be reached, but the base has no {circle}; the largest has {widest:.4f} m."
    else:
        reason = (
            f"{no_way_to(who)} from a {circle}; the largest known has {widest:.4f} m, and outer "
            "areas leave room for one."
        )
    reason += f" A stop_tolerance of at most {widest:.4f} m would do."
    cause = Cause("floor", "room to park", wanted - widest)
    return Explanation("unreachable" if proven else "undecided", i, reason, (cause,))


def radius(area: BaseGeometry) -> float:
    """Radius of the largest circle inside an area [m]."""
    return float(shapely.maximum_inscribed_circle(area).length)


def depth(area: BaseGeometry, axis: Array) -> float:
    """Distance of a position to the boundary of an area, below 0 outside [m]."""
    point = shapely.Point(axis)
    far = float(shapely.distance(shapely.boundary(area), point))
    return far if area.covers(point) else -far
