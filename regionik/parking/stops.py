"""Stops of a base without their motion: the best placement at each, and the order in which they are done."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import shapely
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from regionik.explain.arm_failures import no_posture
from regionik.moving.configuration_sampling import spread
from regionik.parking.fewest_stops import Parking, park
from regionik.parking.held_postures import HeldPostures
from regionik.parking.parking_areas import ParkingAreas, StopGroup, reordered
from regionik.parking.placements import BasePlacement, PlacementSearch
from regionik.parking.sampled_poses import PoseCover
from regionik.planners.coverage.set_cover import least_cover, undominated
from regionik.planners.coverage.tours import VisitingOrder, short_tour, shortest_order
from regionik.planners.geometry.shortest_paths import route
from regionik.postures.poses import axis_of
from regionik.values import Stop
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError, NoPlanFound
from regionik.worlds.scene import World

PLACES = 1500  # all over the areas of a side that are looked at where a pivot splits stops


def stops(world: World) -> tuple[Stop, ...]:
    """Fewest stops of the base from which all set-points are done standing still.

    By `regionik.worlds.scene.Rules`: ``order`` says whether set-points keep their order, ``stop_criterion``
    which place of a stop is best, ``stop_tolerance`` how large a circle to park in each must have. Solids in
    the arm's way are left to `regionik.plan`, which may need more stops for them.

    Parameters
    ----------
    world : World
        Its ``rules.mode`` does not matter here.

    Returns
    -------
    tuple of Stop
        In the order of the work.

    Raises
    ------
    NoPlanFound
        Where a set-point has no place to park.
    InputError
        For a world without a task, or a heading that turns with the target.

    Examples
    --------
    >>> from regionik.worlds.documents.world_file import load_world
    >>> [(stop.first, stop.last) for stop in stops(load_world("pillar"))]
    [(0, 9), (10, 14)]
    """
    return find(world)[0]


def find(world: World) -> tuple[tuple[Stop, ...], Parking]:
    """Return the stops as `stops` does, and with them the bound of their number."""
    check(world)
    parking = park(world)
    sequence = in_sequence(world, parking)
    found = [placement.stop(world) for placement in placed(sequence)]
    named = (replace(stop, setpoints=tuple(sequence.order[i] for i in stop.setpoints)) for stop in found)
    return tuple(named), parking


def check(world: World) -> None:
    """Refuse a world whose set-points cannot be done standing still."""
    if not world.task:
        raise InputError(f"{world.name}: task: expected at least one set-point")
    if world.rules.heading == "face_target":
        raise InputError(
            f"{world.name}: rules.heading: face_target turns the base at every set-point, "
            "with stops valid choices: free, fixed"
        )


@dataclass(frozen=True, eq=False)
class StopSequence:
    """Stops in the order in which they are done."""

    world: World  # its set-points in the order of the work
    order: tuple[int, ...]  # index of each in the world as given
    parking_areas: ParkingAreas
    groups: tuple[StopGroup, ...]  # of set-points that follow one another
    spots: tuple[Array | None, ...]  # (2,) position of the arm axis at each; None leaves it to the criterion
    # Lengths and lower bounds of the drives between the middles of stops, and of the tool's way in them,
    # where any order will do [m]
    tours: Mapping[str, float]

    def after(self, k: int, done: int) -> StopSequence:
        """Sequence that is left where the place of stop k serves only the set-points before ``done``."""
        if self.world.rules.order == "given":
            groups = tuple(self.parking_areas.groups(done))
            return replace(self, groups=groups, spots=(None,) * len(groups))
        left = tuple(i for i in self.groups[k].setpoints if i >= done)
        rest = replace(self.groups[k].of(left), held=None)
        groups = (rest, *self.groups[k + 1 :])
        return replace(self, groups=groups, spots=(None, *self.spots[k + 1 :]))

    def widest(self) -> StopSequence:
        """The same stops, the place of each in the middle of the largest circle."""
        if self.world.rules.stop_criterion == "tolerance":
            return self
        rules = replace(self.world.rules, stop_criterion="tolerance")
        return replace(self, world=replace(self.world, rules=rules), spots=(None,) * len(self.groups))

    def divided(self, setpoints: Sequence[tuple[int, ...]]) -> StopSequence:
        """The same work, by stops that serve given set-points, at the places that the criterion wants."""
        areas, order = self.parking_areas, self.world.rules.order
        known = {group.setpoints: group for group in self.groups}
        groups = tuple(known.get(some) or areas.group(some, order) for some in setpoints)
        return replace(self, groups=groups, spots=_wanted(self.world, groups))


def in_sequence(world: World, parking: Parking) -> StopSequence:
    """Put stops in their order: along a short tour of the floor, where any order will do."""
    parking_areas, groups, order = parking.parking_areas, parking.groups, tuple(range(len(world.task)))
    tours: dict[str, float] = {}
    if world.rules.order == "any":
        groups = _by_one_heading(world, parking)
        groups, tours = _along_tour(world, parking_areas, groups)
        order = tuple(i for group in groups for i in group.setpoints)
        ends = np.cumsum([0, *(len(group.setpoints) for group in groups)]).tolist()
        spans = [tuple(range(a, b)) for a, b in zip(ends[:-1], ends[1:], strict=True)]
        groups = tuple(replace(one, setpoints=span) for span, one in zip(spans, groups, strict=True))
        world = replace(world, task=tuple(world.task[i] for i in order))
        parking_areas = reordered(world, parking_areas, order)
    return StopSequence(world, order, parking_areas, groups, _wanted(world, groups), tours)


@dataclass(frozen=True, eq=False)
class _Part:
    """Set-points that are done from one place of the arm axis, by the side of its standing."""

    side: int
    axis: Array
    setpoints: tuple[int, ...]
    held: HeldPostures | None = None  # at the set-points, where a place does not give the arm its posture

    def of(self, setpoints: tuple[int, ...]) -> _Part:
        """Return the part for some of the set-points."""
        held, at = self.held, [self.setpoints.index(i) for i in setpoints]
        return replace(self, setpoints=setpoints, held=None if held is None else held.of(at))


def _by_one_heading(world: World, parking: Parking) -> tuple[StopGroup, ...]:
    """Fewest stops found of which one heading serves each: areas do not know how far a pivot turns.

    The least cover by what headings serve from places all over the areas, and by parts that stops split
    into. Of an arm to which a place gives no posture, that of sampled poses.
    """
    placements, groups = PlacementSearch(world, parking.parking_areas), parking.groups
    if placements.exact:
        parts = [part for group in groups for part in _parts(placements, group)]
        if len(parts) <= max(len(groups), parking.lower):
            return groups
        parts = _covering([*parts, *_from_places(placements, parking)], len(world.task))
    else:
        parts = _from_poses(placements, parking)
    return tuple(
        StopGroup(
            part.setpoints,
            {part.side: parking.parking_areas.shared(part.setpoints, part.side, part.axis)},
            part.axis,
            part.held,
        )
        for part in parts
    )


def _from_places(placements: PlacementSearch, parking: Parking) -> Iterator[_Part]:
    """What headings serve from the places of faces, and from places all over the areas."""
    for side, spots in parking.spots.items():
        some = spread(shapely.union_all(parking.parking_areas.areas_at(side)), PLACES, 0)
        for spot in np.concatenate([spots, some]):
            yield from (_Part(side, spot, found) for found in placements.served(spot, side))


def _from_poses(placements: PlacementSearch, parking: Parking) -> list[_Part]:
    """The least cover by sampled poses, and parts of stops for what none of these serves."""
    found = PoseCover(placements.world, parking).fewest()
    parts = [_Part(pose.side, pose.axis, pose.held.served, pose.held) for pose in found]
    served = {i for part in parts for i in part.setpoints}
    for group in parking.groups:
        left = tuple(i for i in group.setpoints if i not in served)
        parts += _parts(placements, group.of(left))
    return _covering(parts, len(placements.world.task))


def _covering(parts: Sequence[_Part], count: int) -> list[_Part]:
    """The least cover of all set-points by parts, each set-point left to one of them."""
    inside = np.zeros((len(parts), count), dtype=bool)
    for row, part in zip(inside, parts, strict=True):
        row[list(part.setpoints)] = True
    _, first = np.unique(inside, axis=0, return_index=True)
    best = first[undominated(inside[first])]
    chosen = best[list(least_cover(inside[best]).chosen)]
    owner = np.argmax(inside[chosen], axis=0)
    members = [tuple(np.flatnonzero(owner == n).tolist()) for n in range(len(chosen))]
    return [parts[k].of(own) for k, own in zip(chosen.tolist(), members, strict=True) if own]


def _parts(placements: PlacementSearch, group: StopGroup) -> Iterator[_Part]:
    while group.setpoints:
        widest = placements.widest(group)
        if widest is None:
            raise NoPlanFound(no_posture(placements.world, group.setpoints[0]))
        side = int(placements.parking_areas.ladder.side[widest.chain[0]])
        held = HeldPostures(widest.base, widest.setpoints, widest.near, 0.0, widest.roadmap)
        yield _Part(side, widest.axis, widest.setpoints, None if placements.exact else held)
        left = tuple(i for i in group.setpoints if i not in widest.setpoints)
        group = StopGroup(left, group.places)


def _wanted(world: World, groups: Sequence[StopGroup]) -> tuple[Array | None, ...]:
    """Position of the arm axis at each stop that the criterion wants, where it says so of all at once."""
    if world.rules.stop_criterion != "distance":
        return (None,) * len(groups)
    regions = [max(group.places.values(), key=lambda area: area.area) for group in groups]
    return tuple(short_tour(regions, _start_axis(world)))


def placed(sequence: StopSequence) -> Iterator[BasePlacement]:
    """Yield the best placement of every stop; a stop that no heading serves is split."""
    placements = PlacementSearch(sequence.world, sequence.parking_areas)
    k = 0
    while k < len(sequence.groups):
        placement = placements.best(sequence.groups[k], sequence.spots[k])
        if placement is None:
            raise NoPlanFound(no_posture(sequence.world, sequence.groups[k].setpoints[0]))
        yield placement
        k += 1
        if len(placement.setpoints) < len(sequence.groups[k - 1].setpoints):
            sequence, k = sequence.after(k - 1, placement.setpoints[-1] + 1), 0


def _start_axis(world: World) -> Array | None:
    """Position of the arm axis at the start (2,), if the world has one [m]."""
    return None if world.start is None else axis_of(world.robot, world.start.base)


def _along_tour(
    world: World, parking_areas: ParkingAreas, groups: tuple[StopGroup, ...]
) -> tuple[tuple[StopGroup, ...], dict[str, float]]:
    """Groups along a tour, their set-points in a short order too, and how long these are [m]."""
    spots = np.array([_middle(group) for group in groups])
    start, floor = _start_axis(world), parking_areas.floor
    lead = None if start is None else np.array([_drive(floor, start, spot) for spot in spots])
    far = np.zeros((len(spots), len(spots)))
    for a, b in combinations(range(len(spots)), 2):
        far[a, b] = far[b, a] = _drive(floor, spots[a], spots[b])
    drive = shortest_order(far, lead)
    work = [_in_short_order(world, group) for group in groups]
    tours = {
        "drive": drive.length,
        "drive_lower_bound": drive.lower,
        "tool": sum(tour.length for _, tour in work),
        "tool_lower_bound": sum(tour.lower for _, tour in work),
    }
    return tuple(work[n][0] for n in drive.order), tours


def _drive(floor: BaseGeometry, here: Array, there: Array) -> float:
    """Length of a short way over the floor; straight where an end is off it [m]."""
    straight = LineString([here, there])
    ends = shapely.points([here, there])
    if floor.covers(straight) or not floor.covers(shapely.multipoints(ends)):
        return float(straight.length)
    way = route(floor, here, there)
    return float(straight.length if way is None else np.hypot(*np.diff(way, axis=0).T).sum())


def _middle(group: StopGroup) -> Array:
    """Middle of the largest circle of a stop's largest side (2,) [m]."""
    area = max(group.places.values(), key=lambda area: float(area.area))
    return np.array(shapely.maximum_inscribed_circle(area).coords[0])


def _in_short_order(world: World, group: StopGroup) -> tuple[StopGroup, VisitingOrder]:
    """Group with its set-points along a short tour of the tool."""
    spots = np.array([world.task[i].position for i in group.setpoints])
    tour = shortest_order(np.linalg.norm(spots[:, None] - spots[None], axis=2))
    setpoints = tuple(group.setpoints[n] for n in tour.order)
    return group.of(setpoints), tour
