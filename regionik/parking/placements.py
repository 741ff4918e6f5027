"""Best placements of the base at a stop: the place, the heading, and postures that the arm begins from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, islice

import numpy as np
import shapely
from shapely.geometry import Point

from regionik.areas.free_space import away, into_span, spread, stands_about
from regionik.mfabrik import Solver, solver_for
from regionik.parking.options import PARKING
from regionik.parking.parking_areas import ParkingAreas, StopGroup, depth
from regionik.parking.parking_probability import (
    is_probable,
    likely_parking_probability,
    not_probable,
    parking_probability,
)
from regionik.parking.pivot_turns import EDGE_TOLERANCE, HEADING_ROUNDING, PivotTurns, gathered
from regionik.parking.posture_carrier import PostureCarrier
from regionik.planners.coverage.set_cover import undominated
from regionik.planners.solvers.serial_chain import chain_frames, chain_jacobian, serial_arm
from regionik.postures.arm_roadmap import ArmRoadmap, FixedBasePostures
from regionik.postures.families import Family
from regionik.postures.poses import Pose, axis_of, pose_of
from regionik.scene import Scene
from regionik.values import Configuration, Stop
from regionik.worlds.arms import pivot_index
from regionik.worlds.arrays import Array, Index
from regionik.worlds.chain import Chain
from regionik.worlds.errors import NoPlanFound

OPTIONS = PARKING.places


@dataclass(frozen=True, eq=False)
class BasePlacement:
    """Pose of the base at a stop and the set-points that it serves."""

    setpoints: tuple[int, ...]
    chain: tuple[int, ...]  # component of each that the base stands in
    axis: Array  # (2,) of the arm [m]
    base: Array  # (3,) x, y [m], yaw [rad]
    # (n, dof) posture that the arm begins from at each set-point, its pivot running on from one to the next
    near: Array
    tolerance: float  # radius of the circle in which all this holds [m]
    roadmap: ArmRoadmap | None = None  # of ways between the postures, where those are known

    def stop(self, scene: Scene, setpoints: tuple[int, ...] = ()) -> Stop:
        """The placement as a plan tells it, for all its set-points or for some."""
        served, likely = setpoints or self.setpoints, None
        if scene.rules.parking is not None:
            likely = parking_probability(scene, self.base, served)
        return Stop(self.base, served, self.tolerance, scene.rules.stop_criterion, likely)


@dataclass(frozen=True, eq=False)
class PlacementSearch:
    """Search for the placements of a world's stops.

    The set-points that a stop serves do not depend on the criterion of the rules: those of its `widest`
    placement are served, and the criterion chooses among placements that serve just these.
    """

    scene: Scene
    parking_areas: ParkingAreas
    _widest: dict[StopGroup, BasePlacement | None] = field(default_factory=dict)

    @cached_property
    def _pivot(self) -> PivotTurns:
        areas = self.parking_areas
        return PivotTurns(self.scene, areas.free_space, areas.ladder, areas.narrow)

    def best(self, group: StopGroup, at: Array | None = None) -> BasePlacement | None:
        """Best placement of a stop, with the arm axis at (2,) where the criterion wants it there [m].

        It serves the first of the set-points where none serves all. None where no posture was found from any
        place of a sampled area. Where the criterion has one less probably good after parking than asked, the
        most probable is taken, of as many set-points as can be; `NoPlanFound` where the first alone is not.
        """
        wanted = self._by_criterion(group, at)
        if wanted is None or is_probable(self.scene, wanted.base, wanted.setpoints):
            return wanted
        found: BasePlacement | None = None
        enough, too_many = 0, len(wanted.setpoints) + 1
        while too_many - enough > 1:
            count = too_many - 1 if too_many > len(wanted.setpoints) else (enough + too_many) // 2
            tried = self._by_probability._by_criterion(self._first(group, wanted.setpoints[:count]), None)
            if tried is not None and is_probable(self.scene, tried.base, tried.setpoints):
                found, enough = tried, count
            else:
                too_many = count
        if found is None:
            raise NoPlanFound(not_probable(self.scene, wanted.setpoints[0], (tried or wanted).base))
        return found

    def _first(self, group: StopGroup, setpoints: tuple[int, ...]) -> StopGroup:
        """Group of the first set-points of a stop, at all their places."""
        if group.poses is not None:
            return group.of(setpoints)
        return self.parking_areas.group(setpoints, self.scene.rules.order)

    @cached_property
    def _by_probability(self) -> PlacementSearch:
        """The same search with the probability as its criterion."""
        rules = replace(self.scene.rules, stop_criterion="probability")
        return replace(self, scene=self.scene.changed(rules=rules))

    def _by_criterion(self, group: StopGroup, at: Array | None) -> BasePlacement | None:
        """Best placement by the criterion alone; see `best`."""
        widest = self._leading(self.widest(group), group)
        if widest is None:
            widest = self.widest(replace(group.of(group.setpoints[:1]), postures=None))
        if widest is None:
            return None
        if group.poses is not None:
            return self._best_of_poses(group, widest, at)
        part, criterion = StopGroup(widest.setpoints, group.places), self.scene.rules.stop_criterion
        if at is not None:
            return self._served([self.at(part, at, s) for s in part.places], part) or widest
        if criterion in ("tolerance", "distance"):
            return widest
        found = [widest, *(self._best_of_side(part, s) for s in sorted(part.places))]
        return self._served(found, part)

    def _leading(self, placement: BasePlacement | None, group: StopGroup) -> BasePlacement | None:
        """The placement for the set-points before the first that it leaves out; None without any."""
        if placement is None or len(placement.setpoints) == len(group.setpoints):
            return placement
        pairs = zip(placement.setpoints, group.setpoints, strict=False)
        count = next((n for n, (a, b) in enumerate(pairs) if a != b), len(placement.setpoints))
        setpoints, chain = (row[:count] for row in (placement.setpoints, placement.chain))
        near = placement.near[:count]
        return replace(placement, setpoints=setpoints, chain=chain, near=near) if count else None

    def widest(self, group: StopGroup) -> BasePlacement | None:
        """The placement that serves most set-points, and of those the one with the largest circle found."""
        if group not in self._widest and group.poses is not None:
            known = [] if group.postures is None else [self._on(group, group.postures)]
            self._widest[group] = next(chain(known, self._on_poses(group)), None)
        if group not in self._widest:
            found = [one for s in sorted(group.places) for one in self._wide(group, s)]
            most = max(found, key=lambda one: (len(one.setpoints), one.tolerance), default=None)
            self._widest[group] = most
        return self._widest[group]

    def _wide(self, group: StopGroup, side: int) -> list[BasePlacement]:
        """Placement in the middle of the largest circle of a side; others too where it does not serve all."""
        area = group.places[side]
        known = None if group.spot is None else self.at(group, group.spot, side)
        middle = self.at(group, np.array(shapely.maximum_inscribed_circle(area).coords[0]), side)
        if middle is not None and len(middle.setpoints) == len(group.setpoints):
            return [middle]
        return [one for one in [middle, known, *self._spread(group, side)] if one is not None]

    def served(self, axis: Array, side: int) -> list[tuple[int, ...]]:
        """Sets of set-points that one heading serves from a place, none of them a part of another.

        Only for arms that a place gives their posture.
        """
        areas = self.parking_areas.areas_at(side)
        inside = tuple(np.flatnonzero(shapely.intersects_xy(areas, *axis)).tolist())
        turns = self._pivot.turns(inside, axis, side) if inside else None
        if turns is None:
            return []
        fits = np.unique(turns.room.max(axis=1) >= self.scene.rules.stop_tolerance, axis=0)
        fits = fits[undominated(fits)]
        return [tuple(i for i, fit in zip(inside, row, strict=True) if fit) for row in fits.tolist()]

    def others(self, group: StopGroup) -> Iterator[BasePlacement]:
        """Yield other placements, spread over a stop."""
        some = [self._spread(group, s) for s in sorted(group.places)]
        for placement in self._on_poses(group) if group.poses is not None else chain(*some):
            leading = self._leading(placement, group)
            if leading is None or not is_probable(self.scene, leading.base, leading.setpoints):
                continue
            yield leading

    def roomiest(self, group: StopGroup) -> StopGroup:
        """Group that holds, of a few of its poses that serve all of it, the one with the largest circle."""
        if group.postures is None or group.poses is None:
            return group
        found = [self._on(group, group.postures), *self._on_poses(group, OPTIONS.max_roomiest_poses)]
        best = max(found, key=lambda one: one.tolerance)
        held = FixedBasePostures(best.base, tuple(range(len(best.near))), best.near, 0.0, best.roadmap)
        return replace(group, spot=best.axis, postures=held)

    def _on(self, group: StopGroup, postures: FixedBasePostures) -> BasePlacement:
        """Return the placement on the base pose of postures, which hold all round its circle."""
        base, some = postures.base, tuple(group.setpoints[n] for n in postures.served)
        axis = axis_of(self.scene.robot, base)
        components = self.parking_areas.nearest(some, axis, float(base[2]))
        targets = [self.scene.task[i] for i in some]
        carrier = PostureCarrier(self.scene.world, self.scene.collision, targets)
        room = carrier.widest_circle(base, postures.joints, self._floor_around(axis, float(base[2])))
        return BasePlacement(some, components, axis, base, postures.joints, room, postures.roadmap)

    def _floor_around(self, axis: Array, yaw: float) -> float:
        """Radius of the circle of free floor around a pose [m]."""
        sides = self.parking_areas.free_space.sides
        return max(depth(side.free, axis) for side in sides if away(yaw, side.span) <= HEADING_ROUNDING)

    def _on_poses(self, group: StopGroup, count: int = OPTIONS.max_poses) -> Iterator[BasePlacement]:
        """Yield placements on poses of a stop, of so many far apart, that are proven to serve all of it."""
        poses = np.empty((0, 3)) if group.poses is None else group.poses
        carrier = PostureCarrier(
            self.scene.world, self.scene.collision, [self.scene.task[i] for i in group.setpoints]
        )
        every = np.arange(len(group.setpoints))
        for base in poses[farthest_first(poses, count)]:
            held = carrier.at(base, every)
            if held is not None and len(held.served) == len(every):
                yield self._on(group, held)

    def _spread(self, group: StopGroup, side: int) -> Iterator[BasePlacement]:
        """Yield placements spread over one side of a stop."""
        quick = self._gives_posture(group) and not self._is_slow
        count = OPTIONS.max_places if quick else OPTIONS.max_slow_places
        for spot in spread(group.places[side], count, 0):
            placement = self.at(group, spot, side)
            if placement is not None:
                yield placement

    def _served(self, placements: Sequence[BasePlacement | None], group: StopGroup) -> BasePlacement | None:
        """Of placements that serve a whole stop the best by the criterion."""
        whole = [one for one in placements if one is not None and len(one.setpoints) == len(group.setpoints)]
        return max(whole, key=self._score, default=None)

    def _best_of_poses(self, group: StopGroup, widest: BasePlacement, at: Array | None) -> BasePlacement:
        """Best by the criterion of the placements on poses of a stop, or the one nearest to a place (2,)."""
        if at is None and self.scene.rules.stop_criterion in ("tolerance", "distance"):
            return widest
        count = OPTIONS.max_slow_places if self._is_slow else OPTIONS.max_places
        whole = islice(self._on_poses(group), count)
        found = [widest, *(one for one in whole if one.setpoints == widest.setpoints)]
        if at is not None:
            return min(found, key=lambda one: float(np.hypot(*(one.axis - at))))
        return max(found, key=self._score)

    def _best_of_side(self, group: StopGroup, side: int) -> BasePlacement | None:
        """Best placement at one side of those that serve all set-points; None where there is none.

        By pattern search from the best of those spread over it: ever smaller steps in eight directions.
        """
        placement = self._served(list(self._spread(group, side)), group)
        if placement is None:
            return None
        x0, y0, x1, y1 = group.places[side].bounds
        step, score = max(x1 - x0, y1 - y0) / 8, self._score(placement)
        turns = np.arange(8) * np.pi / 4
        finest, worth = OPTIONS.min_step, 1e-9
        if self._is_slow:
            finest, worth = OPTIONS.min_probability_step, OPTIONS.min_probability_gain
        while step > finest:
            for move in step * np.column_stack([np.cos(turns), np.sin(turns)]):
                other = self.at(group, placement.axis + move, side)
                if other is not None and len(other.setpoints) == len(group.setpoints):
                    better = self._score(other)
                    if better > score + worth:
                        placement, score = other, better
                        break
            else:
                step /= 2
        return placement

    def at(self, group: StopGroup, axis: Array, side: int) -> BasePlacement | None:
        """Placement with the arm axis at a position of a stop; None where it is outside."""
        if depth(group.places[side], axis) < -1e-9:
            return None
        if self.scene.rules.order == "any" and self._gives_posture(group):
            faced = self._faced(group, axis, side)
            return None if faced is None else self._along(group, faced[0], axis, side, faced[1])
        linked = self.scene.rules.order == "given"
        chain = self.parking_areas.deepest_chain(group.setpoints, axis, side, linked)
        return None if chain is None else self._along(group, chain, axis, side)

    def in_place(self, group: StopGroup, pose: Pose) -> BasePlacement | None:
        """Return the placement at the robot's own pose, for the first set-points its posture continues to.

        It need not be in an area, as those of arms whose posture no place gives are not all that there is.
        """
        sides, wanted = self.parking_areas.free_space.sides, self.scene.rules.stop_tolerance
        if self._gives_posture(group) or not stands_about(
            self.scene.ground, self.scene.robot, pose.base, wanted
        ):
            return None
        axis, yaw = axis_of(self.scene.robot, pose.base), float(pose.base[2])
        side = min(range(len(sides)), key=lambda s: away(yaw, sides[s].span))
        carrier = PostureCarrier(
            self.scene.world, self.scene.collision, [self.scene.task[i] for i in group.setpoints]
        )
        chain = self.parking_areas.nearest_chain(group.setpoints, axis, side)
        joints = carrier.continued_from(pose)
        count = min(len(chain), len(joints))
        if count == 0:
            return None
        return BasePlacement(group.setpoints[:count], chain[:count], axis, pose.base, joints[:count], wanted)

    def _along(
        self, group: StopGroup, chain: tuple[int, ...], axis: Array, side: int, yaw: float | None = None
    ) -> BasePlacement | None:
        """Placement with the arm axis at a position, by components, at a known heading or at any."""
        if self._gives_posture(group):
            held, room = self._by_pivot(group, chain, axis, side, yaw)
        else:
            held, room = self._by_carrying(group, chain, axis, side), np.inf
        if held is None:
            return None
        setpoints, held_in = (tuple(row[n] for n in held.served) for row in (group.setpoints, chain))
        room = min(room, *(depth(self.parking_areas.ladder.component[k], axis) for k in held_in))
        return BasePlacement(setpoints, held_in, axis, held.base, held.joints, room, held.roadmap)

    @property
    def exact(self) -> bool:
        """True where a place gives the arm its posture at every set-point."""
        return all(self._exact)

    def _gives_posture(self, group: StopGroup) -> bool:
        """True where a place gives the arm its posture at every set-point, but for a few families."""
        return all(self._exact[i] for i in group.setpoints)

    @cached_property
    def _exact(self) -> list[bool]:
        return [self.scene.model(target).exact for target in self.scene.task]

    def _by_pivot(
        self, group: StopGroup, chain: tuple[int, ...], axis: Array, side: int, known: float | None
    ) -> tuple[FixedBasePostures | None, float]:
        """The heading that suits the pivot at most set-points, amid its turns or one known, and room [m]."""
        joint = self.scene.robot.chain.active_joints[pivot_index(self.scene.robot.chain)]
        middle = (joint.lower + joint.upper) / 2 if np.isfinite(joint.upper - joint.lower) else 0.0
        planes = self._planes(group, chain, axis)
        span = self.parking_areas.free_space.sides[side].span
        for count in range(len(planes), 0, -1):
            some = planes[:count]
            yaw = into_span(float(some.max() + some.min()) / 2 - middle, span)
            options = [(yaw, some - yaw)]
            if known is not None:
                options.append((known, middle + np.mod(some - known - middle + np.pi, 2 * np.pi) - np.pi))
            rooms = [self._pivot_margin(group.setpoints[:count], axis, pivot) for _, pivot in options]
            yaw, pivot = options[int(np.argmax(rooms))]
            if max(rooms) >= self.scene.rules.stop_tolerance - 1e-9:
                base = pose_of(self.scene.robot, axis, float(np.arctan2(np.sin(yaw), np.cos(yaw))))
                near = np.tile(self.scene.robot.carry, (count, 1))
                near[:, pivot_index(self.scene.robot.chain)] = pivot
                return FixedBasePostures(base, tuple(range(count)), near, 0.0), max(rooms)
        return None, 0.0

    def _by_carrying(
        self, group: StopGroup, chain: tuple[int, ...], axis: Array, side: int
    ) -> FixedBasePostures | None:
        """The heading from which most set-points are done."""
        span = self.parking_areas.free_space.sides[side].span
        solver = self.scene.once(_any_heading_solver, self.parking_areas.ladder.family[chain[0]])
        if self.scene.rules.heading == "fixed":
            solver = replace(solver, span=span)
        targets = [self.scene.task[i] for i in group.setpoints]
        carrier = PostureCarrier(self.scene.world, self.scene.collision, targets)
        return carrier.best(solver, axis, span)

    def _faced(self, group: StopGroup, axis: Array, side: int) -> tuple[tuple[int, ...], float] | None:
        """Components around a position, of the facings in which one heading serves most, and that heading."""
        turns = self._pivot.turns(group.setpoints, axis, side)
        if turns is None:
            return None
        best, mixed = np.argmax(turns.room, axis=1), turns.room.max(axis=1)
        rooms = np.concatenate(
            [turns.room[:, 0], turns.room[:, 1], mixed]
        )  # of one facing where that is as wide
        facings = np.concatenate([np.zeros_like(best), np.ones_like(best), best])
        fits = rooms >= self.scene.rules.stop_tolerance - EDGE_TOLERANCE
        count = np.argmin(np.column_stack([fits, np.zeros(len(fits), dtype=bool)]), axis=1)
        spare = np.array([row[: max(n, 1)].min() for row, n in zip(rooms, count.tolist(), strict=True)])
        both = np.arange(len(rooms)) >= 2 * len(best)
        k = np.lexsort((both, -np.round(spare, 3), -count))[0]
        column = np.arange(len(group.setpoints))
        chain = np.where(rooms[k] > -np.inf, turns.component[facings[k], column], turns.component.max(axis=0))
        return tuple(chain.tolist()), float(turns.yaw[k % len(best)])

    def _planes(self, group: StopGroup, chain: tuple[int, ...], axis: Array) -> Array:
        """Sum of base yaw and pivot that each set-point asks for, continuous along the path [rad]."""
        base, pivot = pose_of(self.scene.robot, axis, 0.0), pivot_index(self.scene.robot.chain)
        planes = []
        for i, k in zip(group.setpoints, chain, strict=True):
            found = self.posture(i, k, base)
            planes.append(found.base[2] + found.joints[pivot])
        return np.unwrap(planes) if self.scene.rules.order == "given" else gathered(np.array(planes))

    def posture(self, i: int, k: int, base: Array) -> Configuration:
        """Posture on set-point i with the arm axis held, whatever the heading."""
        solver = self.scene.once(_any_heading_solver, self.parking_areas.ladder.family[k])
        return solver.hold(self.scene.task[i], base, self.scene.robot.carry)

    def _pivot_margin(self, setpoints: tuple[int, ...], axis: Array, pivot: Array) -> float:
        """Offset of the base at which the pivot gets to a limit, for arms in one plane [m]."""
        joint = self.scene.robot.chain.active_joints[pivot_index(self.scene.robot.chain)]
        spots = np.array([self.scene.task[i].position[:2] for i in setpoints])
        left = np.minimum(pivot - joint.lower, joint.upper - pivot) + HEADING_ROUNDING
        off = np.hypot(*(spots - axis).T) * np.sin(np.clip(left, -np.pi / 2, np.pi / 2))
        return float(np.where(left >= np.pi, np.inf, off).min())

    @property
    def _is_slow(self) -> bool:
        """True where the score of a placement takes much longer than the placement."""
        return self.scene.rules.stop_criterion == "probability"

    def _score(self, placement: BasePlacement) -> float:
        """Score of a placement by the criterion of the rules; higher is better."""
        criterion = self.scene.rules.stop_criterion
        if criterion == "clearance":
            side = self.parking_areas.free_space.sides[
                int(self.parking_areas.ladder.side[placement.chain[0]])
            ]
            return float(shapely.distance(shapely.boundary(side.free), Point(placement.axis)))
        if criterion == "probability":
            return likely_parking_probability(self.scene, placement.base, placement.setpoints)
        if criterion in ("manipulability", "effort"):
            postures = [self.joints_at(n, placement) for n in range(len(placement.near))]
            return min(posture_score(self.scene.robot.chain, joints, criterion) for joints in postures)
        return placement.tolerance

    def joints_at(self, at: int, placement: BasePlacement) -> Array:
        """Posture (dof,) at one of the set-points of a placement, by its place there."""
        i, near = placement.setpoints[at], placement.near
        if self.scene.model(self.scene.task[i]).exact:
            return self.posture(i, placement.chain[at], placement.base).joints
        return near[at]


def farthest_first(poses: Array, count: int) -> Index:
    """Places of at most so many poses (n, 3), the one in their middle first, each far from those before."""
    if not len(poses):
        return np.empty(0, dtype=np.intp)
    spots = np.column_stack([poses[:, :2], np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    chosen = [int(np.argmin(np.linalg.norm(spots - spots.mean(axis=0), axis=1)))]
    far = np.linalg.norm(spots - spots[chosen[0]], axis=1)
    while len(chosen) < min(count, len(poses)):
        chosen.append(int(np.argmax(far)))
        far = np.minimum(far, np.linalg.norm(spots - spots[chosen[-1]], axis=1))
    return np.array(chosen)


def posture_score(chain: Chain, joints: Array, criterion: str) -> float:
    """Score of a posture: its manipulability, or minus its largest joint torque by load [N m / N].

    Manipulability is sqrt(det J J^T) (Yoshikawa 1985), the load one newton at the tool.
    """
    arm, frames, J = serial_arm(chain), np.empty((len(chain.joints) + 1, 4, 4)), np.empty((6, chain.dof))
    chain_frames(arm, joints, frames)
    chain_jacobian(arm, frames, J)
    if criterion == "effort":
        return -float(np.abs(J[2]).max())
    return float(np.sqrt(max(np.linalg.det(J[:3] @ J[:3].T), 0.0)))


def _any_heading_solver(scene: Scene, family: Family) -> Solver:
    """Solver that takes no heed of the rule of heading."""
    return replace(solver_for(scene, family), heading="free")
