"""Stops in the order of the work: along a short tour of the floor, their set-points along one of the tool."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
import shapely
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from regionik.parking.parking_areas import ParkingAreas, StopGroup, reordered
from regionik.planners.coverage.tours import short_tour, shortest_order
from regionik.planners.geometry.shortest_paths import shortest_path
from regionik.postures.poses import axis_of
from regionik.scene import Scene
from regionik.worlds.arrays import Array


@dataclass(frozen=True, eq=False)
class StopSequence:
    """Stops in the order in which they are done."""

    scene: Scene  # its set-points in the order of the work
    order: tuple[int, ...]  # index of each in the world as given
    parking_areas: ParkingAreas
    groups: tuple[StopGroup, ...]  # of set-points that follow one another
    spots: tuple[Array | None, ...]  # (2,) position of the arm axis at each; None leaves it to the criterion
    # Lengths of the drives between the middles of stops and of the tool's way in them [m], and the arm's time
    # in them [s], where any order will do
    tours: Mapping[str, float]

    def after(self, k: int, done: int) -> StopSequence:
        """Sequence that is left where the place of stop k serves only the set-points before ``done``."""
        if self.scene.rules.order == "given":
            groups = tuple(self.parking_areas.groups(done))
            return replace(self, groups=groups, spots=(None,) * len(groups))
        left = tuple(i for i in self.groups[k].setpoints if i >= done)
        rest = replace(self.groups[k].of(left), postures=None)
        groups = (rest, *self.groups[k + 1 :])
        return replace(self, groups=groups, spots=(None, *self.spots[k + 1 :]))

    def widest(self) -> StopSequence:
        """The same stops, the place of each in the middle of the largest circle."""
        if self.scene.rules.stop_criterion == "tolerance":
            return self
        rules = replace(self.scene.rules, stop_criterion="tolerance")
        return replace(self, scene=self.scene.changed(rules=rules), spots=(None,) * len(self.groups))

    def divided(self, setpoints: Sequence[tuple[int, ...]]) -> StopSequence:
        """The same work, by stops that serve given set-points, at the places that the criterion wants."""
        areas, order = self.parking_areas, self.scene.rules.order
        known = {group.setpoints: group for group in self.groups}
        for some in setpoints:  # parts of stops that were split
            for group in self.groups:
                if group.poses is not None and set(some) < set(group.setpoints):
                    known[some] = group.of(some)
        groups = tuple(known.get(some) or areas.group(some, order) for some in setpoints)
        return replace(self, groups=groups, spots=_preferred_axes(self.scene, groups))


def stop_sequence(scene: Scene, parking_areas: ParkingAreas, groups: tuple[StopGroup, ...]) -> StopSequence:
    """Put stops in the order of the set-points: the world's, or along a short tour where any will do."""
    order = tuple(range(len(scene.task)))
    tours: dict[str, float] = {}
    if scene.rules.order == "any":
        groups, tours = _along_tour(scene, parking_areas, groups)
        order = tuple(i for group in groups for i in group.setpoints)
        ends = np.cumsum([0, *(len(group.setpoints) for group in groups)]).tolist()
        spans = [tuple(range(a, b)) for a, b in pairwise(ends)]
        groups = tuple(replace(one, setpoints=span) for span, one in zip(spans, groups, strict=True))
        scene = scene.changed(task=tuple(scene.task[i] for i in order))
        parking_areas = reordered(scene, parking_areas, order)
    return StopSequence(scene, order, parking_areas, groups, _preferred_axes(scene, groups), tours)


def _preferred_axes(scene: Scene, groups: Sequence[StopGroup]) -> tuple[Array | None, ...]:
    """Position of the arm axis at each stop that the criterion wants, where it says so of all at once."""
    if scene.rules.stop_criterion != "distance":
        return (None,) * len(groups)
    regions = [max(group.places.values(), key=lambda area: area.area) for group in groups]
    return tuple(short_tour(regions, _start_axis(scene)))


def _start_axis(scene: Scene) -> Array | None:
    """Position of the arm axis at the start (2,), if the world has one [m]."""
    return None if scene.start is None else axis_of(scene.robot, scene.start.base)


def _along_tour(
    scene: Scene, parking_areas: ParkingAreas, groups: tuple[StopGroup, ...]
) -> tuple[tuple[StopGroup, ...], dict[str, float]]:
    """Groups along a tour, and how long that and the tool's way in the order of each are [m]."""
    spots = np.array([_middle(group) for group in groups])
    start, floor = _start_axis(scene), parking_areas.floor
    lead = None if start is None else np.array([_drive(floor, start, spot) for spot in spots])
    far = np.zeros((len(spots), len(spots)))
    for a, b in combinations(range(len(spots)), 2):
        far[a, b] = far[b, a] = _drive(floor, spots[a], spots[b])
    drive = shortest_order(far, lead)
    tours = {"drive": drive.length, "tool": sum(_tool_way(scene, group) for group in groups)}
    return tuple(groups[n] for n in drive.order), tours


def _drive(floor: BaseGeometry, here: Array, there: Array) -> float:
    """Length of a short way over the floor; straight where an end is off it [m]."""
    straight = LineString([here, there])
    ends = shapely.points([here, there])
    if floor.covers(straight) or not floor.covers(shapely.multipoints(ends)):
        return float(straight.length)
    way = shortest_path(floor, here, there)
    return float(straight.length if way is None else np.hypot(*np.diff(way, axis=0).T).sum())


def _middle(group: StopGroup) -> Array:
    """Middle of the largest circle of a stop's largest side (2,) [m]."""
    area = max(group.places.values(), key=lambda area: float(area.area))
    return np.array(shapely.maximum_inscribed_circle(area).coords[0])


def _tool_way(scene: Scene, group: StopGroup) -> float:
    """Length of the tool's way along a group's set-points [m]."""
    spots = np.array([scene.task[i].position for i in group.setpoints])
    return float(np.linalg.norm(np.diff(spots, axis=0), axis=1).sum())
