"""Poses of the base that serve most set-points, of arms whose posture no place gives, in any order.

Poses are drawn all over the areas, at each place at the headings from which most of some set-points are
reached. What a pose serves is found in two steps: postures that are clear, which is soon known, and of these
the ones that a roadmap joins and that keep all round the circle to park in. The second is only asked of the
poses of a least cover, and the cover is taken again until it is known of all. So no cover by the poses drawn
has fewer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely

from regionik.areas.layers import Geometries
from regionik.areas.standing import spread
from regionik.parking.arm_roadmap import HeldPostures
from regionik.parking.held_postures import PostureCarrier
from regionik.parking.parking_areas import Parking, StopPart
from regionik.planners.coverage.set_cover import least_cover
from regionik.postures.arm_guard import guard_of
from regionik.postures.poses import pose_of
from regionik.worlds.arms import pivot_index, with_pivot
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.scene import World

PLACES = 48  # at which poses are looked for
DRAWN = 4  # times as many that these are chosen from
HEADINGS = 8  # at each, of a base that may stand at any
SOME = 12  # set-points by which they are compared
BEST = 2  # headings that are kept at each
NODES = 200  # of branch and bound for a cover
ROUNDS = 40  # in which a cover is taken


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A pose that was drawn, and clear postures (n, dof) at set-points."""

    side: int
    axis: Array
    base: Array
    found: Index
    joints: Array


@dataclass(frozen=True, eq=False)
class PoseCover:
    """Covers of a world's set-points by poses drawn all over its areas."""

    world: World
    parking: Parking
    _proven: dict[int, HeldPostures | None] = field(default_factory=dict)

    def fewest(self) -> list[StopPart]:
        """Return what the poses of a least cover serve; what none of those drawn serves is left out."""
        poses = self._drawn
        inside = np.zeros((len(poses), len(self.world.task)), dtype=bool)
        for row, pose in zip(inside, poses, strict=True):
            row[pose.found] = True
        chosen: tuple[int, ...] = ()
        for _ in range(ROUNDS):
            left = inside.any(axis=0)
            if not left.any():
                break
            cover = least_cover(inside[:, left], NODES)
            chosen = cover.chosen
            known = self._of_known(inside)
            if known is not None and len(known) <= cover.lower:
                chosen = known
                break
            new = [k for k in chosen if k not in self._proven]
            if not new:
                break
            for k in new:
                self._prove(k, inside)
        held = ((poses[k], self._proven.get(k)) for k in chosen)
        return [StopPart(pose.side, pose.axis, one.served, one) for pose, one in held if one is not None]

    def _of_known(self, inside: Mask) -> tuple[int, ...] | None:
        """The least cover by poses whose postures are proven; None where these do not cover."""
        known = sorted(k for k, held in self._proven.items() if held is not None)
        left = inside.any(axis=0)
        if not known or not inside[known][:, left].any(axis=0).all():
            return None
        return tuple(known[n] for n in least_cover(inside[known][:, left], NODES).chosen)

    def _prove(self, k: int, inside: Mask) -> None:
        pose = self._drawn[k]
        held = self._carrier.joined(pose.base, pose.found, pose.joints)
        self._proven[k] = held
        inside[k] = False
        if held is not None:
            inside[k, list(held.served)] = True

    @cached_property
    def _carrier(self) -> PostureCarrier:
        return PostureCarrier(self.world, guard_of(self.world), self.world.task)

    @cached_property
    def _drawn(self) -> list[_Drawn]:
        return [pose for spot in self._spots() for pose in self._at(*spot)]

    def _spots(self) -> list[tuple[int, Array]]:
        """Middles of the stops that areas know, and places drawn all over the areas, by side."""
        areas = self.parking.parking_areas
        found = [
            (side, np.array(shapely.maximum_inscribed_circle(area).coords[0]))
            for group in self.parking.groups
            for side, area in group.places.items()
        ]
        count = max(1, PLACES // len(self.parking.spots))
        for side in self.parking.spots:
            found += [(side, spot) for spot in _spread_by_areas(areas.areas_at(side), count)]
        return found

    def _at(self, side: int, axis: Array) -> Iterator[_Drawn]:
        """Poses at a place: at the headings from which most of some set-points are reached."""
        inside = np.flatnonzero(shapely.intersects_xy(self.parking.parking_areas.areas_at(side), *axis))
        some = inside[:: max(1, len(inside) // SOME)]
        bases = [pose_of(self.world.robot, axis, yaw) for yaw in self._headings(side)]
        count = [len(self._carrier.neighboring(base, some)[0]) for base in bases]
        for n in np.argsort(-np.array(count), kind="stable")[:BEST].tolist():
            if count[n]:
                yield _Drawn(side, axis, bases[n], *self._carrier.neighboring(bases[n], inside))

    def _headings(self, side: int) -> list[float]:
        low, high = self.parking.parking_areas.standing.sides[side].span
        arm = with_pivot(self.world.robot.chain)
        joint = arm.active_joints[pivot_index(arm)]
        if high - low < 2 * np.pi:
            return [(low + high) / 2]
        count = HEADINGS if joint.upper - joint.lower < 2 * np.pi else BEST
        return [2 * np.pi * n / count for n in range(count)]


def _spread_by_areas(areas: Geometries, count: int) -> Array:
    """At most so many places in areas, one after the other that lies in most, those taken counting less."""
    places = spread(shapely.union_all(areas), DRAWN * count, 0)
    inside = np.column_stack([shapely.contains_xy(area, places) for area in areas]).astype(float)
    taken, chosen = np.ones(len(areas)), list[int]()
    for _ in range(min(count, len(places))):
        chosen.append(int(np.argmax(inside @ (1 / taken))))
        taken += inside[chosen[-1]]
        inside[chosen[-1]] = 0.0
    return places[chosen]
