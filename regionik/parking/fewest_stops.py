"""Fewest stops of the base from which all set-points are done standing still.

A position of the base serves set-points one after the other where it lies in a component of each, of one slab
of headings and of postures that the arm can go on between. The number is proven to be the fewest for these
inner areas, each shrunk by the radius of the circle to park in, with headings and solids in the arm's way
left aside; the same count over outer areas is a bound that no base falls below.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from regionik.areas.free_space import Index
from regionik.areas.layers import Geometries
from regionik.explain.changes import smaller_circle
from regionik.explain.constraints import no_way_to, rounded_down, setpoint_at
from regionik.explain.failures import no_place
from regionik.explain.several import together
from regionik.parking.options import PARKING
from regionik.parking.parking_areas import (
    Parking,
    ParkingAreas,
    StopGroup,
    parking_areas_on,
    radius,
    shrunk_by_circle,
)
from regionik.planners.coverage.set_cover import (
    OverlayFaces,
    SetCover,
    apart_areas,
    fewest_runs,
    least_cover,
    least_cover_by_faces,
    overlay_faces,
    stride,
)
from regionik.planners.geometry.offsets import shrunk
from regionik.planners.progress import track
from regionik.pruning import cut_off_from
from regionik.regions import free_spaces_for, outer_areas, round_outer_areas
from regionik.scene import Scene
from regionik.worlds.arrays import Array, Mask
from regionik.worlds.errors import Cause, Explanation, NoPlanFound
from regionik.worlds.scene import Target

OPTIONS = PARKING.places


Unserved = tuple[list[int], ParkingAreas]  # set-points without a place to park, and the areas


def park(scene: Scene) -> Parking:
    """Fewest stops for a world's set-points, in their order or in any.

    Raises
    ------
    NoPlanFound
        Where a set-point has no place to park.
    """
    return park_in_any_order(scene) if scene.rules.order == "any" else park_in_order(scene)


def park_in_order(scene: Scene) -> Parking:
    """Stops that each go on for as long as they can, which makes them fewest (`fewest_runs`).

    Ways to stand and to face come in one after the other until the bound from outer areas is met.
    """
    best: Parking | None = None
    refused = list[Unserved]()
    for free_space, facings in free_spaces_for(scene):
        for parking_areas in parking_areas_on(scene, free_space, facings):
            groups = parking_areas.groups()
            done = groups[-1].setpoints[-1] + 1 if groups else 0
            if done < len(scene.task):
                refused.append(_unserved(parking_areas))
            elif best is None or len(groups) < len(best.groups):
                best = Parking(parking_areas, tuple(groups), 1)
        if best is not None and (len(best.groups) == 1 or len(best.groups) <= scene.once(_fewest_outer_runs)):
            break
    if best is None:
        raise NoPlanFound(_no_rooms(scene, refused))
    lower = 1 if len(best.groups) == 1 else scene.once(_fewest_outer_runs)
    known: dict[str, int | bool | str] = {"lower_bound": lower, "bound": "outer areas"}
    return Parking(best.parking_areas, best.groups, lower, known)


def park_in_any_order(scene: Scene) -> Parking:
    """Fewest stops in any order: the least cover of the set-points by faces of their areas' overlay.

    Headings by slab come in only where a set-point has no place at every heading. Where a place gives the arm
    no posture, areas only say that each set-point has a place: stops are left to poses (`PoseCover`), at all
    headings at which the base fits.
    """
    refused = list[Unserved]()
    exact = all(scene.model(target).exact for target in scene.task)
    ways = list(free_spaces_for(scene))[1::2]
    for free_space, facings in ways if exact else ways[-1:]:
        found: list[ParkingAreas] = []
        for parking_areas in parking_areas_on(scene, free_space, facings):
            unserved = _unserved(parking_areas)
            if unserved[0]:
                refused.append(unserved)
            else:
                found.append(parking_areas)
        if found and exact:
            return min((_covered(scene, areas) for areas in found), key=lambda one: len(one.groups))
        if found:
            return _bounded(scene, found)
    raise NoPlanFound(_no_rooms(scene, refused))


def _covered(scene: Scene, parking_areas: ParkingAreas) -> Parking:
    """The least cover, every set-point assigned to one of the faces that meet it."""
    sides = parking_areas.sides
    known = np.column_stack([parking_areas.areas_at(s) for s in sides])
    groups, part, faces, cover = _least(scene, parking_areas, range(len(scene.task)))
    lower = _fewest_by_outer_areas(scene, known, cover.apart, len(cover.chosen))
    told: dict[str, int | bool | str] = {
        "lower_bound": lower, "bound": "outer areas",
        "fewest_of_inner_areas": cover.lower, "apart": len(cover.apart), "faces": len(faces.polygon),
    }  # fmt: skip
    middle, side = shapely.get_coordinates(shapely.point_on_surface(faces.polygon)), np.array(sides)[part]
    spots = {s: middle[side == s] for s in sides}
    return Parking(parking_areas, groups, lower, told, spots)


def _bounded(scene: Scene, parkings: Sequence[ParkingAreas]) -> Parking:
    """The bound alone, the same on every piece of floor.

    It is of the set-points of which no place is in two outer areas, and of more that need it.
    """
    outer = np.array(round_outer_areas(scene, scene.task, coarse=True), dtype=object)
    lower = _fewest_by_outer_areas(scene, outer[:, None], apart_areas(outer), len(scene.task))
    told: dict[str, int | bool | str] = {"lower_bound": lower, "bound": "outer areas"}
    return Parking(parkings[0], (), lower, told, elsewhere=tuple(parkings[1:]))


def covering_groups(scene: Scene, parking_areas: ParkingAreas, some: Sequence[int]) -> tuple[StopGroup, ...]:
    """Fewest stops of which areas know that each serves its share of some set-points, in any order."""
    return _least(scene, parking_areas, some)[0] if some else ()


def _least(
    scene: Scene, parking_areas: ParkingAreas, some: Sequence[int]
) -> tuple[tuple[StopGroup, ...], Index, OverlayFaces, SetCover]:
    """The least cover of some set-points, as stops and as `least_cover_by_faces` has it."""
    sides, own = np.array(parking_areas.sides, dtype=np.intp), list(some)
    part, faces, cover = least_cover_by_faces([parking_areas.areas_at(s)[own] for s in sides.tolist()])
    groups = _assigned([scene.task[i] for i in own], own, faces, sides[part], cover, parking_areas)
    return tuple(groups), part, faces, cover


def _fewest_by_outer_areas(scene: Scene, known: Geometries, apart: Sequence[int], enough: int) -> int:
    """Lower bound of the stops in any order, whatever the headings and postures; up to ``enough`` is asked.

    No base does all set-points with fewer stops than some of them need. So outer areas, which take long, are
    made for those of which no place serves two, and then only for more that the places found so far miss, by
    areas that are known of each (n, k).
    """
    rows = np.arange(0, len(scene.task), stride(len(scene.task)))
    asked, outer, more = list[int](), np.empty(0, dtype=object), list(apart)
    while True:
        asked += more
        outer = np.concatenate([outer, _outer_places(scene, [scene.task[i] for i in more])])
        faces = overlay_faces(outer)
        bound = least_cover(faces.inside)
        spots = shapely.get_coordinates(shapely.point_on_surface(faces.polygon[list(bound.chosen)]))
        missed = rows[~_served(known, spots)[rows] & ~np.isin(rows, asked)]
        if bound.lower >= enough or not len(missed):
            return bound.lower
        more = missed[:: -(-len(missed) // len(asked))].tolist()


def _served(known: Geometries, spots: Array) -> Mask:
    """Mask (n,) of the set-points of whose known areas (n, k) one is around any of some spots (k, 2)."""
    around: Mask = shapely.intersects_xy(known[:, None], *spots.T[:, :, None]).any(axis=(1, 2))
    return around


def _assigned(
    task: Sequence[Target],
    number: Sequence[int],
    faces: OverlayFaces,
    side: Index,
    cover: SetCover,
    parking_areas: ParkingAreas,
) -> list[StopGroup]:
    """Every set-point to the nearest of the chosen faces that meet it; places are what its areas share."""
    chosen = list(cover.chosen)
    spots = shapely.point_on_surface(faces.polygon[chosen])
    positions = shapely.points(np.array([target.position[:2] for target in task]))
    far = np.where(faces.inside[chosen], shapely.distance(spots[:, None], positions[None]), np.inf)
    owner = np.argmin(far, axis=0)
    groups = []
    for n, (face, spot) in enumerate(zip(chosen, spots, strict=True)):
        members = tuple(number[m] for m in np.flatnonzero(owner == n).tolist())
        if members:
            s = int(side[face])
            groups.append(StopGroup(members, {s: parking_areas.shared(members, s, spot.coords[0])}))
    return groups


def _outer_places(scene: Scene, task: Sequence[Target]) -> Geometries:
    """Places to park for each target, bounded from outside."""
    return shrunk_by_circle(np.array(outer_areas(scene, task), dtype=object), scene, outside=True)


def _fewest_outer_runs(scene: Scene) -> int:
    """Lower bound of the stops in the given order, whatever the headings and postures."""
    areas, count = _outer_places(scene, scene.task), len(scene.task)
    back = [[i - 1] if i else [] for i in range(count)]
    return len(fewest_runs(areas, np.arange(count + 1), back))


def _unserved(parking_areas: ParkingAreas) -> Unserved:
    """Set-points without a place to park."""
    ladder = parking_areas.ladder
    held = set(ladder.target[shapely.area(parking_areas.narrow) > 0].tolist())
    return [i for i in range(ladder.count) if i not in held], parking_areas


def _no_rooms(scene: Scene, refused: Sequence[Unserved]) -> Explanation:
    """Explanation of all set-points without a place to park, on the floor where they are fewest."""
    if not refused:
        return together([no_place(scene, i) for i in range(len(scene.task))])
    # Of as few the last, whose floor is the fullest.
    empty, parking_areas = min(reversed(refused), key=lambda one: len(one[0]))
    return together([no_room(scene, i, parking_areas) for i in track("reasons", empty)])


def no_room(scene: Scene, i: int, parking_areas: ParkingAreas) -> Explanation:
    """Explanation of a set-point i without a place to park."""
    ladder = parking_areas.ladder
    span = slice(int(ladder.rungs[i]), int(ladder.rungs[i + 1]))
    every = ladder.component[span]
    if not len(every):
        return no_place(scene, i)
    if not parking_areas.usable[span].any():
        return cut_off_from(scene, i, parking_areas.piece, ladder, parking_areas.free_space)
    widest = max(radius(area) for area in every[parking_areas.usable[span]])
    wanted = scene.rules.stop_tolerance
    who = setpoint_at(scene.task, i)
    circle = f"circle of radius {wanted:.4f} m to park in"
    proven = shrunk(outer_areas(scene, [scene.task[i]])[0], wanted, outside=True).is_empty
    reason = f"{who} can be reached, but the base has no {circle}; the largest has {widest:.4f} m."
    if not proven:
        reason = f"{no_way_to(who)} from a {circle}; the largest known has {widest:.4f} m, and outer areas "
        reason += "leave room for one."
    left = rounded_down(OPTIONS.sure_circle_share * widest, 4)
    reason += f" A stop_tolerance of at most {left:.4f} m would do."
    causes, repairs = (Cause("floor", "room to park", wanted - widest),), (smaller_circle(scene, left),)
    return Explanation("unreachable" if proven else "undecided", i, reason, causes, repairs)
