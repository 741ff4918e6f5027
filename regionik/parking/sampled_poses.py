"""Sampled base poses that serve most set-points in any order, for arms whose place determines no posture.

Poses are drawn over the free floor, at any heading, and more of them around those that the prices of a linear
cover favour, as in column generation (Gilmore and Gomory 1961). What a pose serves is found in two steps:
postures that are clear, which is soon known, and of these the ones that a roadmap joins and that keep all
round the circle to park in. The second is only asked of the poses of a least cover, and the cover is taken
again until it is known of all; a few more are drawn beside those that serve less than they may. So no cover
by the poses drawn has fewer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely

from regionik.areas.free_space import into_spans, spread
from regionik.areas.layers import Geometries
from regionik.parking.options import PARKING
from regionik.parking.parking_areas import ParkingAreas, StopPart, shrunk_by_circle
from regionik.parking.pivot_turns import HEADING_ROUNDING
from regionik.parking.posture_carrier import PostureCarrier
from regionik.planners.coverage.set_cover import cover_prices, least_cover
from regionik.postures.arm_roadmap import FixedBasePostures
from regionik.postures.poses import Pose, pose_of
from regionik.regions import round_outer_areas
from regionik.scene import Scene
from regionik.worlds.arrays import Array, Index, Mask

OPTIONS = PARKING.cover


Prove = Callable[["_Drawn"], FixedBasePostures | None]


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A sampled base pose with collision-free postures (n, dof) at set-points."""

    side: int
    row: Array  # (3,) of the arm axis [m], yaw [rad]
    base: Array
    served: Index
    joints: Array
    inside: Mask  # of all set-points, where one was found


@dataclass(frozen=True, eq=False)
class PoseCover:
    """Covers of a world's set-points by base poses sampled all over the floor of its parking areas."""

    scene: Scene
    parking_areas: ParkingAreas

    def fewest(self) -> list[StopPart]:
        """Return what the poses of a least cover serve; what none of those drawn serves is left out.

        Set-points that no roadmap joins to others are served by poses of their own, and those that no pose
        keeps by more that are drawn for them alone.
        """
        every = np.arange(len(self.scene.task))
        found = self._least(self._drawn, every, self._joined)
        found += self._least(self._drawn, _left(every, found), self._clear_postures)
        left = _left(every, found)
        return found + self._least(list(self._about(left.tolist())), left, self._clear_postures)

    def _least(self, poses: list[_Drawn], some: Index, prove: Prove) -> list[StopPart]:
        return _ProvenCover(poses, some, prove, self._beside).least()

    @cached_property
    def _drawn(self) -> list[_Drawn]:
        """Poses drawn all over, then around those that prices favour while that makes a linear cover less."""
        rng, every = np.random.default_rng(0), np.arange(len(self.scene.task))
        drawn = list(self._looked_at(self._all_over(rng)))
        best, since, k = np.inf, 0, 0
        while since < OPTIONS.max_futile_rounds and k < OPTIONS.max_rounds:
            inside = _served(drawn, every)
            prices, missed = cover_prices(inside), np.flatnonzero(~inside.any(axis=0)).tolist()
            need = float(prices.sum()) + len(missed)
            since = 0 if need < best - 1e-9 else since + 1
            best = min(best, need)
            rows = [self._near(i, k, rng) for i in missed]
            shrinkages = min(k, OPTIONS.max_shrinkages)
            deviation = OPTIONS.first_deviation * OPTIONS.deviation_shrinkage**shrinkages
            top = np.argsort(-(inside @ prices), kind="stable")[: OPTIONS.max_favoured].tolist()
            rows += [drawn[n].row + _shaken(rng, deviation, OPTIONS.poses_around) for n in top]
            if rows:
                drawn += self._looked_at(np.vstack(rows))
            k += 1
        return drawn

    @property
    def unserved(self) -> list[int]:
        """Set-points at which no pose drawn has a clear posture."""
        every = np.arange(len(self.scene.task))
        return np.flatnonzero(~_served(self._drawn, every).any(axis=0)).tolist()

    def serving(self, setpoints: Sequence[int]) -> Array:
        """Return the bases (n, 3) drawn that have clear postures at all of some set-points."""
        rows = _served(self._drawn, np.array(setpoints)).all(axis=1)
        return np.array([self._drawn[k].base for k in np.flatnonzero(rows)]).reshape(-1, 3)

    def _beside(self, pose: _Drawn) -> list[_Drawn]:
        """A few more poses close to one."""
        rng = np.random.default_rng(len(pose.served))
        return list(self._looked_at(pose.row + _shaken(rng, OPTIONS.beside_deviation, OPTIONS.poses_beside)))

    def _joined(self, pose: _Drawn) -> FixedBasePostures | None:
        return self._carrier.joined(pose.base, pose.served, pose.joints)

    def _clear_postures(self, pose: _Drawn) -> FixedBasePostures | None:
        return self._carrier.clear_postures(pose.base, pose.served, pose.joints)

    def _about(self, setpoints: Iterable[int]) -> Iterator[_Drawn]:
        """More poses for each of some set-points: those drawn have clear postures there that do not keep."""
        rng = np.random.default_rng(1)
        seeds = range(OPTIONS.max_rounds, OPTIONS.max_rounds + OPTIONS.max_futile_rounds)
        rows = [self._near(i, seed, rng) for i in setpoints for seed in seeds]
        return self._looked_at(np.vstack(rows)) if rows else iter(())

    @cached_property
    def _carrier(self) -> PostureCarrier:
        return PostureCarrier(self.scene.world, self.scene.collision, self.scene.task)

    def _all_over(self, rng: np.random.Generator) -> Array:
        """Return poses (n, 3) spread over the floor from which some set-point may be reached."""
        area = shapely.union_all(self._outer) & shapely.union_all(self._floors)
        if area.area == 0.0:
            return np.empty((0, 3))
        count = int(np.clip(OPTIONS.poses_per_square_metre * area.area, OPTIONS.min_poses, OPTIONS.max_poses))
        return self._headed(spread(area, count, 0), rng, self.scene.free_floor.headings)

    def _near(self, i: int, seed: int, rng: np.random.Generator) -> Array:
        """Poses (n, 3) spread over the floor from which one set-point may be reached, and its known areas.

        A known area is often so small a part that none would be drawn there.
        """
        sides = self.parking_areas.free_space.sides
        parts = [
            (
                self._outer[i] & shapely.union_all(self._floors),
                self.scene.free_floor.headings,
                OPTIONS.poses_for_unserved,
            )
        ]
        for s in self.parking_areas.sides:
            parts.append((self.parking_areas.areas_at(s)[i], sides[s].span, OPTIONS.poses_in_known))
        rows = [
            self._headed(spread(area, count, seed + 1), rng, span)
            for area, span, count in parts
            if area.area > 0
        ]
        return np.vstack([np.empty((0, 3)), *rows])

    def _headed(self, places: Array, rng: np.random.Generator, span: tuple[float, float]) -> Array:
        """Places with headings within a span."""
        low, high = span if span[1] - span[0] < 2 * np.pi else (-np.pi, np.pi)
        return np.column_stack([places, rng.uniform(low, high, len(places))])

    def _looked_at(self, rows: Array) -> Iterator[_Drawn]:
        """Yield those of poses (n, 3) that the base may park at and that serve something."""
        if self.scene.rules.heading == "fixed":
            rows[:, 2] = self.scene.free_floor.headings[0]
        sides = self._sides(rows)
        near = np.column_stack([shapely.intersects_xy(area, *rows.T[:2]) for area in self._outer])
        root = self._carrier.root
        for k in np.flatnonzero((sides >= 0) & near.any(axis=1)).tolist():
            base = pose_of(self.scene.robot, rows[k, :2], float(rows[k, 2]))
            if self._carrier.collision.proves(Pose(base, root)):
                found, joints = self._carrier.neighboring(base, np.flatnonzero(near[k]))
                if len(found):
                    inside = np.isin(np.arange(len(self.scene.task)), found)
                    yield _Drawn(int(sides[k]), rows[k], base, found, joints, inside)

    def _sides(self, rows: Array) -> Index:
        """Side of the free space at each of some poses (n, 3) with room for the circle to park in, or -1."""
        found = np.full(len(rows), -1, dtype=np.intp)
        for s, (side, floor) in enumerate(
            zip(self.parking_areas.free_space.sides, self._floors, strict=True)
        ):
            here = np.abs(into_spans(rows[:, 2], *side.span) - rows[:, 2]) <= HEADING_ROUNDING
            found[(found < 0) & here & shapely.contains_xy(floor, *rows.T[:2])] = s
        return found

    @cached_property
    def _floors(self) -> Geometries:
        """The floor that the base gets to by side, shrunk by the circle to park in."""
        polygon, side, label = self.parking_areas.free_space.pieces
        own = label == self.parking_areas.piece
        parts = [
            shapely.union_all(polygon[own & (side == s)])
            for s in range(len(self.parking_areas.free_space.sides))
        ]
        floors = shrunk_by_circle(np.array(parts, dtype=object), self.scene, outside=False)
        shapely.prepare(floors)
        return floors

    @cached_property
    def _outer(self) -> Geometries:
        """Outer area of each set-point."""
        areas = np.array(round_outer_areas(self.scene, self.scene.task, coarse=True), dtype=object)
        shapely.prepare(areas)
        return areas


@dataclass(eq=False)
class _ProvenCover:
    """The search for a least cover by poses of which it is proven what they serve."""

    poses: list[_Drawn]
    setpoints: Index  # (n,)
    prove: Prove
    beside: Callable[[_Drawn], list[_Drawn]]  # more poses, asked for where one serves less than it may
    count: int = field(init=False)  # of poses at first
    inside: Mask = field(init=False)  # (p, n) True where a pose may serve one of the set-points
    proven: dict[int, FixedBasePostures | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.count = len(self.poses)
        self.inside = _served(self.poses, self.setpoints)

    def least(self) -> list[StopPart]:
        """What the poses of a least cover are proven to serve."""
        held = ((self.poses[k], self.proven.get(k)) for k in self._chosen())
        return [StopPart(pose.side, pose.row[:2], one.served, one) for pose, one in held if one is not None]

    def _chosen(self) -> tuple[int, ...]:
        chosen: tuple[int, ...] = ()
        for _ in range(OPTIONS.max_covers):
            left = self.inside.any(axis=0)
            if not left.any():
                return chosen
            cover = least_cover(self.inside[:, left], OPTIONS.max_nodes)
            chosen, known = cover.chosen, self._of_known()
            if known is not None and len(known) <= cover.lower:
                return known
            new = [k for k in chosen if k not in self.proven]
            if not new:
                return chosen
            for k in new:
                self._ask(k)
        return self._of_known() or chosen

    def _of_known(self) -> tuple[int, ...] | None:
        """The least cover by poses whose postures are proven; None where these do not cover."""
        known = sorted(k for k, held in self.proven.items() if held is not None)
        left = self.inside.any(axis=0)
        if not known or not self.inside[known][:, left].any(axis=0).all():
            return None
        return tuple(known[n] for n in least_cover(self.inside[known][:, left], OPTIONS.max_nodes).chosen)

    def _ask(self, k: int) -> None:
        held = self.prove(self.poses[k])
        self.proven[k] = held
        if k < self.count and (held is None or len(held.served) < np.count_nonzero(self.inside[k])):
            more = self.beside(self.poses[k])
            self.poses = [*self.poses, *more]
            self.inside = np.vstack([self.inside, _served(more, self.setpoints)])
        self.inside[k] = False if held is None else np.isin(self.setpoints, held.served)


def _left(every: Index, parts: Sequence[StopPart]) -> Index:
    """Return those of some set-points that no part serves."""
    served = [i for part in parts for i in part.setpoints]
    return every[~np.isin(every, served)]


def _served(poses: Sequence[_Drawn], setpoints: Index) -> Mask:
    """Mask (p, n) of the set-points at which each of some poses has a clear posture."""
    if not poses:
        return np.zeros((0, len(setpoints)), dtype=bool)
    return np.array([pose.inside for pose in poses])[:, setpoints]


def _shaken(rng: np.random.Generator, by: float, count: int) -> Array:
    """Return random offsets (count, 3) of poses around one, with a deviation [m]."""
    return rng.normal(size=(count, 3)) * (by, by, OPTIONS.heading_deviation * by)
