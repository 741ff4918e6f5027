"""Fewest stops for a world's set-points, without planning any motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from regionik.parking.base_placement import BasePlacement, PlacementSearch, check_arm, short_tour_positions
from regionik.parking.fewest_stops import Parking, ParkingAreas, StopGroup, park, reordered
from regionik.planners.coverage.tours import shortest_order
from regionik.postures.poses import axis_of
from regionik.values import Stop
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.scene import World


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
        For a world without a task, a heading that turns with the target, or an arm without a vertical pivot.

    Examples
    --------
    >>> from regionik.worlds.documents.world_file import load_world
    >>> [(stop.first, stop.last) for stop in stops(load_world("pillar"))]
    [(0, 9), (10, 14)]
    """
    return find(world)[0]


def find(world: World) -> tuple[tuple[Stop, ...], Parking]:
    """Stops as `stops` returns them, and the bound of their number."""
    check(world)
    parking = park(world)
    sequence = in_sequence(world, parking)
    found = [placement.stop(world) for placement in placed(sequence)]
    named = (replace(stop, setpoints=tuple(sequence.order[i] for i in stop.setpoints)) for stop in found)
    return tuple(named), parking


def check(world: World) -> None:
    """Refuse what cannot be done standing still."""
    if not world.task:
        raise InputError(f"{world.name}: task: expected at least one set-point")
    if world.rules.heading == "face_target":
        raise InputError(
            f"{world.name}: rules.heading: face_target turns the base at every set-point, "
            "with stops valid choices: free, fixed"
        )
    flaw = check_arm(world)
    if flaw is not None:
        raise InputError(f"{world.name}: robot: stops expect {flaw}")


@dataclass(frozen=True, eq=False)
class StopSequence:
    """Stops in the order in which they are done.

    Attributes
    ----------
    world : World
        Its set-points in the order of the work.
    order : tuple of int
        Index of each in the world as given.
    parking_areas : ParkingAreas
    groups : tuple of StopGroup
        Of set-points that follow one another.
    spots : tuple of (2,) arrays or None
        Position of the arm axis at each; None leaves it to the criterion.
    """

    world: World
    order: tuple[int, ...]
    parking_areas: ParkingAreas
    groups: tuple[StopGroup, ...]
    spots: tuple[Array | None, ...]

    def after(self, k: int, done: int) -> StopSequence:
        """What is still to do where the place of stop k serves only what comes before set-point ``done``."""
        if self.world.rules.order == "given":
            groups = tuple(self.parking_areas.groups(done))
            return replace(self, groups=groups, spots=(None,) * len(groups))
        left = tuple(i for i in self.groups[k].setpoints if i >= done)
        groups = (StopGroup(left, self.groups[k].places), *self.groups[k + 1 :])
        return replace(self, groups=groups, spots=(None, *self.spots[k + 1 :]))


def in_sequence(world: World, parking: Parking) -> StopSequence:
    """Stops in their order, along a short tour where set-points may be in any order.

    Drives between stops count as straight.
    """
    parking_areas, groups, order = parking.parking_areas, parking.groups, tuple(range(len(world.task)))
    if world.rules.order == "any":
        groups = _along_tour(world, PlacementSearch(world, parking_areas), groups)
        order = tuple(i for group in groups for i in group.setpoints)
        ends = np.cumsum([0, *(len(group.setpoints) for group in groups)]).tolist()
        spans = [tuple(range(a, b)) for a, b in zip(ends[:-1], ends[1:], strict=True)]
        groups = tuple(StopGroup(span, group.places) for span, group in zip(spans, groups, strict=True))
        world = replace(world, task=tuple(world.task[i] for i in order))
        parking_areas = reordered(world, parking_areas)
    spots: tuple[Array | None, ...] = (None,) * len(groups)
    if world.rules.stop_criterion == "distance":
        spots = tuple(short_tour_positions(world, groups))
    return StopSequence(world, order, parking_areas, groups, spots)


def placed(sequence: StopSequence) -> Iterator[BasePlacement]:
    """Yield the best placement of every stop; a stop that no heading serves is split."""
    placements = PlacementSearch(sequence.world, sequence.parking_areas)
    k = 0
    while k < len(sequence.groups):
        placement = placements.best(sequence.groups[k], sequence.spots[k])
        yield placement
        k += 1
        if len(placement.setpoints) < len(sequence.groups[k - 1].setpoints):
            sequence, k = sequence.after(k - 1, placement.setpoints[-1] + 1), 0


def _along_tour(
    world: World, placements: PlacementSearch, groups: tuple[StopGroup, ...]
) -> tuple[StopGroup, ...]:
    """Groups along a tour, their set-points in a short order too."""
    spots = np.array([placements.best(group).axis for group in groups])
    far = np.hypot(*(spots[:, None] - spots[None]).transpose(2, 0, 1))
    lead = None if world.start is None else np.hypot(*(spots - axis_of(world.robot, world.start.base)).T)
    order, _ = shortest_order(far, lead)
    return tuple(_in_short_order(world, groups[n]) for n in order)


def _in_short_order(world: World, group: StopGroup) -> StopGroup:
    spots = np.array([world.task[i].position for i in group.setpoints])
    order, _ = shortest_order(np.linalg.norm(spots[:, None] - spots[None], axis=2))
    return StopGroup(tuple(group.setpoints[n] for n in order), group.places)
