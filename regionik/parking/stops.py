"""Stops of a base without their motion: the best placement at each, and the order in which they are done."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import shapely

from regionik.areas.free_space import spread
from regionik.explain.arm_failures import no_posture
from regionik.explain.several import failures_of, naming_all, naming_as_given, together
from regionik.explain.skipping import as_given, leaving_out, naming_each
from regionik.parking.arm_tour import in_short_order
from regionik.parking.fewest_stops import covering_groups, park
from regionik.parking.options import PARKING
from regionik.parking.parking_areas import Parking, ParkingAreas, StopGroup, StopPart
from regionik.parking.placements import BasePlacement, PlacementSearch
from regionik.parking.sampled_poses import PoseCover
from regionik.parking.stop_sequence import StopSequence, stop_sequence
from regionik.planners.coverage.set_cover import least_cover, undominated
from regionik.planners.progress import Progress, listening
from regionik.postures.arm_roadmap import FixedBasePostures
from regionik.reachability.reach import answers_for
from regionik.reachability.unreached import unreached
from regionik.scene import Scene, WorldSource, scene_of, world_of
from regionik.values import Skipped, Stop, Stops
from regionik.worlds.errors import Cause, Explanation, InputError, NoPlanFound

OPTIONS = PARKING.places


def stops(world: WorldSource, *, progress: Progress | None = None) -> Stops:
    """Fewest stops of the base from which all set-points are done standing still.

    By `regionik.worlds.scene.Rules`: ``order`` says whether set-points keep their order, ``stop_criterion``
    which place of a stop is best, ``stop_tolerance`` how large a circle to park in each must have. Solids in
    the arm's way are left to `regionik.plan`, which may need more stops for them; ``unconfirmed`` of a stop
    says at which of its set-points no posture clear of them is known from its place.

    Parameters
    ----------
    world : World, or the name or file of one
        Its ``rules.mode`` does not matter here.
    progress : callable, optional
        Called with stage, done, total.

    Returns
    -------
    Stops
        A tuple of `Stop` in the order of the work.

    Raises
    ------
    NoPlanFound
        Where set-points have no place to park, all of them named; with ``rules.skip_unreachable`` only where
        none has one.
    InputError
        For a world without a task, or a heading that turns with the target.

    Examples
    --------
    >>> [(stop.first, stop.last) for stop in stops("pillar")]
    [(0, 9), (10, 14)]
    """
    with listening(progress):
        scene = scene_of(world_of(world))
        return Stops(find_served(scene)[0], scene.world)


def find_served(scene: Scene) -> tuple[tuple[Stop, ...], Parking, tuple[Skipped, ...]]:
    """Return the stops as `stops` does, the bound of their number, and what the rules let be left out.

    Raises NoPlanFound with all set-points named that have no place to park.
    """
    check(scene)
    if not scene.rules.skip_unreachable:
        try:
            found, parking = find(scene)
        except NoPlanFound as no:
            every = naming_each(scene, no.explanation, park)
            raise NoPlanFound(naming_all(every, len(scene.task))) from None
        return _confirmed(scene, found), parking, ()
    (found, parking), skipped = leaving_out(scene, _find_reachable, lambda _, quick: quick)
    kept = as_given(len(scene.task), skipped)
    return tuple(_renumbered(stop, kept) for stop in found), parking, skipped


def _renumbered(stop: Stop, remaining: Sequence[int]) -> Stop:
    """Return the stop with its set-points numbered as they were given."""
    setpoints, doubts = (tuple(remaining[i] for i in some) for some in (stop.setpoints, stop.unconfirmed))
    return replace(stop, setpoints=setpoints, unconfirmed=doubts)


def _find_reachable(scene: Scene) -> tuple[tuple[Stop, ...], Parking]:
    """Return `find` with its doubts; raise NoPlanFound for set-points that have no clear posture at all."""
    found, parking = find(scene)
    told = _confirmed(scene, found)
    _refuse_unreached(scene, sorted(i for stop in told for i in stop.unconfirmed))
    return told, parking


def _refuse_unreached(scene: Scene, some: Sequence[int]) -> None:
    failures = tuple(unreached(scene, some))
    if failures:
        first, cause = failures[0], Cause("limits", scene.robot.name)
        raise NoPlanFound(Explanation(first.verdict, first.setpoint, first.reason, (cause,), (), failures))


def _confirmed(scene: Scene, stops: Iterable[Stop]) -> tuple[Stop, ...]:
    """Stops that tell at which of their set-points no clear posture is known."""
    return tuple(replace(stop, unconfirmed=_unconfirmed(scene, stop)) for stop in stops)


def _unconfirmed(scene: Scene, stop: Stop) -> tuple[int, ...]:
    answer = answers_for(scene, [scene.task[i] for i in stop.setpoints], tuple(stop.base.tolist()))
    return tuple(i for i, found in zip(stop.setpoints, answer.reachable.tolist(), strict=True) if not found)


def find(scene: Scene) -> tuple[tuple[Stop, ...], Parking]:
    """Return stops for all set-points, and with them the bound of their number."""
    check(scene)
    parking = park(scene)
    sequence = in_sequence(scene, parking)
    with naming_as_given(sequence.order):
        found = [placement.stop(sequence.scene) for placement in placed(sequence)]
    named = (replace(stop, setpoints=tuple(sequence.order[i] for i in stop.setpoints)) for stop in found)
    return tuple(named), parking


def check(scene: Scene) -> None:
    """Refuse a world whose set-points cannot be done standing still."""
    if not scene.task:
        raise InputError(f"{scene.world.name}: task: expected at least one set-point")
    if scene.rules.heading == "face_target":
        raise InputError(
            f"{scene.world.name}: rules.heading: face_target turns the base at every set-point, "
            "but at a stop it stands still; expected free or fixed"
        )


def in_sequence(scene: Scene, parking: Parking) -> StopSequence:
    """Put stops in their order; where any will do, each is one that a heading serves, toured by the arm."""
    if scene.rules.order == "given":
        return stop_sequence(scene, parking.parking_areas, parking.groups)
    areas, groups = _on_the_best_floor(scene, parking)
    placements = PlacementSearch(scene, areas)
    toured = [in_short_order(placements, group) for group in groups]
    sequence = stop_sequence(scene, areas, tuple(group for group, _ in toured))
    return replace(sequence, tours={**sequence.tours, "arm": sum(time for _, time in toured)})


def _on_the_best_floor(scene: Scene, parking: Parking) -> tuple[ParkingAreas, tuple[StopGroup, ...]]:
    """The piece of floor on which fewest stops of one heading each were found, and the stops."""
    found, refused = list[tuple[ParkingAreas, tuple[StopGroup, ...]]](), list[NoPlanFound]()
    for areas in (parking.parking_areas, *parking.elsewhere):
        try:
            found.append((areas, _by_one_heading(scene, replace(parking, parking_areas=areas))))
        except NoPlanFound as no:
            refused.append(no)
    if not found:
        raise min(refused, key=lambda no: len(failures_of(no.explanation)))
    return min(found, key=lambda one: len(one[1]))


def _by_one_heading(scene: Scene, parking: Parking) -> tuple[StopGroup, ...]:
    """Fewest stops found of which one heading serves each: areas do not know how far a pivot turns.

    The least cover by what headings serve from places all over the areas, and by parts that stops split
    into. Of an arm to which a place gives no posture, that of sampled poses.
    """
    placements, groups = PlacementSearch(scene, parking.parking_areas), parking.groups
    if not placements.exact:
        return tuple(_by_poses(placements))
    parts = [part for group in groups for part in _parts(placements, group)]
    if len(parts) <= max(len(groups), parking.lower):
        return groups
    parts += _from_places(placements, parking)
    return tuple(_covering(parking.parking_areas, parts, scene.rules.stop_tolerance))


def _from_places(placements: PlacementSearch, parking: Parking) -> Iterator[StopPart]:
    """What headings serve from the places of faces, and from places all over the areas."""
    for side, spots in parking.spots.items():
        some = spread(shapely.union_all(parking.parking_areas.areas_at(side)), OPTIONS.max_pivot_places, 0)
        for spot in np.concatenate([spots, some]):
            yield from (StopPart(side, spot, found) for found in placements.served(spot, side))


def _by_poses(placements: PlacementSearch) -> Iterator[StopGroup]:
    """Yield stops by the least cover by sampled poses, and for what none of these serves parts of others."""
    scene, areas = placements.scene, placements.parking_areas
    cover = PoseCover(scene, areas)
    if scene.rules.skip_unreachable:  # known before the work that these would spoil
        _refuse_unreached(scene, cover.unserved)
    parts = cover.fewest()
    served = {i for part in parts for i in part.setpoints}
    left, refused = [i for i in range(len(scene.task)) if i not in served], list[Explanation]()
    for group in covering_groups(scene, areas, left):
        try:
            parts += list(_parts(placements, group))
        except NoPlanFound as no:
            refused.append(no.explanation)
    if refused:
        raise NoPlanFound(together(refused))
    for group in _covering(areas, parts, scene.rules.stop_tolerance):
        poses = cover.serving(group.setpoints)
        if not len(poses) and group.postures is not None:  # of what only a pose of its own serves
            poses = group.postures.base[None]
        yield placements.roomiest(replace(group, poses=poses))


def _covering(areas: ParkingAreas, parts: Sequence[StopPart], tolerance: float) -> Iterator[StopGroup]:
    """Yield the least cover of all set-points by parts, each set-point left to one of them."""
    inside = np.zeros((len(parts), areas.ladder.count), dtype=bool)
    for row, part in zip(inside, parts, strict=True):
        row[list(part.setpoints)] = True
    _, first = np.unique(inside, axis=0, return_index=True)
    best = first[undominated(inside[first])]
    chosen = best[list(least_cover(inside[best]).chosen)]
    owner = np.argmax(inside[chosen], axis=0)
    for n, k in enumerate(chosen.tolist()):
        part, own = parts[k], tuple(np.flatnonzero(owner == n).tolist())
        if own:
            places = {part.side: areas.about(own, part.side, part.axis, tolerance)}
            yield StopGroup(part.setpoints, places, part.axis, part.postures).of(own)


def _parts(placements: PlacementSearch, group: StopGroup) -> Iterator[StopPart]:
    """Yield parts of a stop that one heading serves each; what none serves there is tried at all its places.

    Raises NoPlanFound at the end, of all that has no posture at these either.
    """
    refused, order = list[Explanation](), placements.scene.rules.order
    while group.setpoints:
        first = group.setpoints[:1]
        widest = placements.widest(group) or placements.widest(placements.parking_areas.group(first, order))
        if widest is None:
            refused.append(no_posture(placements.scene, first[0]))
        else:
            side = int(placements.parking_areas.ladder.side[widest.chain[0]])
            held = FixedBasePostures(widest.base, widest.setpoints, widest.near, 0.0, widest.roadmap)
            yield StopPart(side, widest.axis, widest.setpoints, None if placements.exact else held)
        done = first if widest is None else widest.setpoints
        group = StopGroup(tuple(i for i in group.setpoints if i not in done), group.places)
    if refused:
        raise NoPlanFound(together(refused))


def placed(sequence: StopSequence) -> Iterator[BasePlacement]:
    """Yield the best placement of every stop; a stop that no heading serves is split."""
    placements = PlacementSearch(sequence.scene, sequence.parking_areas)
    k = 0
    while k < len(sequence.groups):
        placement = placements.best(sequence.groups[k], sequence.spots[k])
        if placement is None:
            raise NoPlanFound(no_posture(sequence.scene, sequence.groups[k].setpoints[0]))
        yield placement
        k += 1
        if len(placement.setpoints) < len(sequence.groups[k - 1].setpoints):
            sequence, k = sequence.after(k - 1, placement.setpoints[-1] + 1), 0
