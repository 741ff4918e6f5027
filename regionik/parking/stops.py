"""Stops of a base without their motion: the best placement at each, and the order in which they are done."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Point

from regionik.areas.reachable import model_of
from regionik.areas.standing import into_span
from regionik.explain.failures import no_posture
from regionik.mfabrik import Solver, solver_for
from regionik.moving.configuration_sampling import spread
from regionik.parking.fewest_stops import Parking, ParkingAreas, StopGroup, depth, park, reordered
from regionik.parking.held_postures import PostureCarrier
from regionik.planners.coverage.tours import short_tour, shortest_order
from regionik.planners.solvers.serial_chain import chain_frames, chain_jacobian, serial_arm
from regionik.postures.arm_guard import guard_of
from regionik.postures.families import Family
from regionik.postures.poses import axis_of, pose_of
from regionik.values import Configuration, Stop
from regionik.worlds.arms import pivot_index
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError, NoPlanFound
from regionik.worlds.scene import World

PLACES = 24  # of a stop that a criterion is asked about before the best is bettered
FINEST = 1e-3  # steps by which it is bettered, at the least [m]
HEADING = 1e-9  # by which the pivot may be over its limits [rad]


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
        """Sequence that is left where the place of stop k serves only the set-points before ``done``."""
        if self.world.rules.order == "given":
            groups = tuple(self.parking_areas.groups(done))
            return replace(self, groups=groups, spots=(None,) * len(groups))
        left = tuple(i for i in self.groups[k].setpoints if i >= done)
        groups = (StopGroup(left, self.groups[k].places), *self.groups[k + 1 :])
        return replace(self, groups=groups, spots=(None, *self.spots[k + 1 :]))


def in_sequence(world: World, parking: Parking) -> StopSequence:
    """Put stops in their order: along a short tour, drives counted as straight, where any order will do."""
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
        regions = [max(group.places.values(), key=lambda area: area.area) for group in groups]
        spots = tuple(short_tour(regions, _start_axis(world)))
    return StopSequence(world, order, parking_areas, groups, spots)


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
    world: World, placements: PlacementSearch, groups: tuple[StopGroup, ...]
) -> tuple[StopGroup, ...]:
    """Groups along a tour, their set-points in a short order too."""
    spots = np.array([_middle(placements, group) for group in groups])
    far = np.hypot(*(spots[:, None] - spots[None]).transpose(2, 0, 1))
    start = _start_axis(world)
    lead = None if start is None else np.hypot(*(spots - start).T)
    order, _ = shortest_order(far, lead)
    return tuple(_in_short_order(world, groups[n]) for n in order)


def _middle(placements: PlacementSearch, group: StopGroup) -> Array:
    """Position of the arm axis at the best placement of a stop, or in the middle of it."""
    best = placements.best(group)
    if best is not None:
        return best.axis
    area = max(group.places.values(), key=lambda area: float(area.area))
    return np.array(shapely.maximum_inscribed_circle(area).coords[0])


def _in_short_order(world: World, group: StopGroup) -> StopGroup:
    """Group with its set-points along a short tour of the tool."""
    spots = np.array([world.task[i].position for i in group.setpoints])
    order, _ = shortest_order(np.linalg.norm(spots[:, None] - spots[None], axis=2))
    return StopGroup(tuple(group.setpoints[n] for n in order), group.places)


@dataclass(frozen=True, eq=False)
class BasePlacement:
    """Pose of the base at a stop and the set-points that it serves.

    Attributes
    ----------
    setpoints, chain : tuple of int
        Set-points, and the component of each that the base stands in.
    axis : (2,) array
        Of the arm [m].
    base : (3,) array
        x, y [m], yaw [rad].
    near : (n, dof) array
        Posture that the arm begins from at each set-point, its pivot running on from one to the next.
    tolerance : float
        Radius of the circle in which all this holds [m].
    """

    setpoints: tuple[int, ...]
    chain: tuple[int, ...]
    axis: Array
    base: Array
    near: Array
    tolerance: float

    def stop(self, world: World) -> Stop:
        """The placement as a plan tells it."""
        return Stop(self.base, self.setpoints, self.tolerance, world.rules.stop_criterion)


class _Heading(NamedTuple):
    """Pose of the base at a place, postures (n, dof) at the first n set-points, and room for both [m]."""

    base: Array
    near: Array
    room: float


@dataclass(frozen=True, eq=False)
class PlacementSearch:
    """Search for the placements of a world's stops."""

    world: World
    parking_areas: ParkingAreas

    def best(self, group: StopGroup, at: Array | None = None) -> BasePlacement | None:
        """Best placement of a stop; it serves only the first of the set-points where none serves all.

        None where no posture was found from any place of a sampled area.

        Parameters
        ----------
        group : StopGroup
        at : (2,) array, optional
            Position of the arm axis, whatever the criterion [m].
        """
        found = [self.at(group, at, s) for s in group.places] if at is not None else []
        if not any(found):
            found = [self._best_of_side(group, s) for s in sorted(group.places)]
        served = [placement for placement in found if placement is not None]
        return max(
            served, key=lambda placement: (len(placement.setpoints), self._score(placement)), default=None
        )

    def others(self, group: StopGroup) -> Iterator[BasePlacement]:
        """Yield other placements, spread over a stop."""
        for s in sorted(group.places):
            for spot in spread(group.places[s], PLACES, 0):
                placement = self.at(group, spot, s)
                if placement is not None:
                    yield placement

    def _best_of_side(self, group: StopGroup, side: int) -> BasePlacement | None:
        """Best placement at one side of those that serve most set-points; None where there is none."""
        area = group.places[side]
        middle = self.at(group, np.array(shapely.maximum_inscribed_circle(area).coords[0]), side)
        central = self.world.rules.stop_criterion in ("tolerance", "distance")
        if central and middle is not None and len(middle.setpoints) == len(group.setpoints):
            return middle
        tried = [middle, *(self.at(group, spot, side) for spot in spread(area, PLACES, 0))]
        found = [placement for placement in tried if placement is not None]
        most = max((len(placement.setpoints) for placement in found), default=0)
        full = [placement for placement in found if len(placement.setpoints) == most]
        best = max(full, key=self._score, default=None)
        return best if central or best is None else self._refined(group, side, best)

    def _refined(self, group: StopGroup, side: int, placement: BasePlacement) -> BasePlacement:
        """Best placement by pattern search: ever smaller steps in eight directions."""
        x0, y0, x1, y1 = group.places[side].bounds
        step, score = max(x1 - x0, y1 - y0) / 8, self._score(placement)
        turns = np.arange(8) * np.pi / 4
        while step > FINEST:
            for move in step * np.column_stack([np.cos(turns), np.sin(turns)]):
                other = self.at(group, placement.axis + move, side)
                if other is not None and len(other.setpoints) >= len(placement.setpoints):
                    better = self._score(other)
                    if better > score + 1e-9:
                        placement, score = other, better
                        break
            else:
                step /= 2
        return placement

    def at(self, group: StopGroup, axis: Array, side: int) -> BasePlacement | None:
        """Placement with the arm axis at a position of a stop; None where it is outside."""
        if depth(group.places[side], axis) < -1e-9:
            return None
        chain = self._chain(group, axis, side)
        if chain is None:
            return None
        span = self.parking_areas.standing.sides[side].span
        turned = self._by_pivot if self._gives_posture(group) else self._by_carrying
        held = turned(group, chain, axis, span)
        if held is None:
            return None
        count = len(held.near)
        room = min(held.room, *(depth(self.parking_areas.ladder.component[k], axis) for k in chain[:count]))
        return BasePlacement(group.setpoints[:count], chain[:count], axis, held.base, held.near, room)

    def _gives_posture(self, group: StopGroup) -> bool:
        """True where a place gives the arm its posture at every set-point, but for a few families."""
        return all(model_of(self.world, self.world.task[i]).exact for i in group.setpoints)

    def _by_pivot(
        self, group: StopGroup, chain: tuple[int, ...], axis: Array, span: tuple[float, float]
    ) -> _Heading | None:
        """The heading that suits the pivot at most set-points."""
        yaw, pivot, count = self._base_heading(self._planes(group, chain, axis), span)
        if count == 0:
            return None
        base = pose_of(self.world.robot, axis, float(np.arctan2(np.sin(yaw), np.cos(yaw))))
        near = np.tile(self.world.robot.carry, (count, 1))
        near[:, pivot_index(self.world.robot.chain)] = pivot[:count]
        return _Heading(base, near, self._pivot_margin(group.setpoints[:count], axis, pivot[:count]))

    def _by_carrying(
        self, group: StopGroup, chain: tuple[int, ...], axis: Array, span: tuple[float, float]
    ) -> _Heading | None:
        """The heading from which one posture is carried along most set-points."""
        solver = _any_heading_solver(self.world, self.parking_areas.ladder.family[chain[0]])
        if self.world.rules.heading == "fixed":
            solver = replace(solver, span=span)
        targets = [self.world.task[i] for i in group.setpoints]
        found = PostureCarrier(self.world, guard_of(self.world), targets).best(solver, axis, span)
        return None if found is None else _Heading(found.base, found.joints, np.inf)

    def _chain(self, group: StopGroup, axis: Array, side: int) -> tuple[int, ...] | None:
        """Deepest component of each set-point around a position, each linked to the next."""
        ladder, narrow = self.parking_areas.ladder, self.parking_areas.narrow
        linked = self.world.rules.order == "given"
        rungs, rows = ladder.rungs, list[dict[int, tuple[float, int]]]()
        for i in group.setpoints:
            row: dict[int, tuple[float, int]] = {}
            for k in range(int(rungs[i]), int(rungs[i + 1])):
                if ladder.side[k] != side or depth(narrow[k], axis) < -1e-7:
                    continue
                room, before = depth(ladder.component[k], axis), -1
                if rows:
                    last = rows[-1]
                    options = [m for m in self.parking_areas.back[k] if m in last] if linked else list(last)
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

    def _planes(self, group: StopGroup, chain: tuple[int, ...], axis: Array) -> Array:
        """Sum of base yaw and pivot that each set-point asks for, continuous along the path [rad]."""
        base, pivot = pose_of(self.world.robot, axis, 0.0), pivot_index(self.world.robot.chain)
        planes = []
        for i, k in zip(group.setpoints, chain, strict=True):
            found = self.posture(i, k, base)
            planes.append(found.base[2] + found.joints[pivot])
        return np.unwrap(planes) if self.world.rules.order == "given" else _gathered(np.array(planes))

    def posture(self, i: int, k: int, base: Array) -> Configuration:
        """Posture on set-point i with the arm axis held, whatever the heading."""
        solver = _any_heading_solver(self.world, self.parking_areas.ladder.family[k])
        return solver.hold(self.world.task[i], base, self.world.robot.carry)

    def _base_heading(self, planes: Array, span: tuple[float, float]) -> tuple[float, Array, int]:
        """Heading, pivot values, and number of first set-points within the pivot's limits.

        The pivot is as near as may be to the middle of its limits.
        """
        joint = self.world.robot.chain.joints[pivot_index(self.world.robot.chain)]
        endless = not np.isfinite(joint.upper - joint.lower)
        middle = 0.0 if endless else (joint.lower + joint.upper) / 2
        for count in range(len(planes), 0, -1):
            some = planes[:count]
            yaw = into_span((some.max() + some.min()) / 2 - middle, span)
            pivot = some - yaw
            if joint.lower - HEADING <= pivot.min() and pivot.max() <= joint.upper + HEADING:
                return float(yaw), planes - yaw, count
        return 0.0, planes, 0

    def _pivot_margin(self, setpoints: tuple[int, ...], axis: Array, pivot: Array) -> float:
        """Offset of the base at which the pivot gets to a limit, for arms in one plane [m]."""
        joint = self.world.robot.chain.joints[pivot_index(self.world.robot.chain)]
        spots = np.array([self.world.task[i].position[:2] for i in setpoints])
        left = np.clip(np.minimum(pivot - joint.lower, joint.upper - pivot), 0.0, np.pi / 2)
        return float((np.hypot(*(spots - axis).T) * np.sin(left)).min())

    def _score(self, placement: BasePlacement) -> float:
        """Score of a placement by the criterion of the rules; higher is better."""
        criterion = self.world.rules.stop_criterion
        if criterion == "clearance":
            side = self.parking_areas.standing.sides[int(self.parking_areas.ladder.side[placement.chain[0]])]
            return float(shapely.distance(shapely.boundary(side.free), Point(placement.axis)))
        if criterion in _MEASURES:
            return min(_MEASURES[criterion](self._jacobian(n, placement)) for n in range(len(placement.near)))
        return placement.tolerance

    def _jacobian(self, at: int, placement: BasePlacement) -> Array:
        """Of the tool's velocity by the joints, at a posture on one of the set-points, (3, dof)."""
        i, joints = placement.setpoints[at], placement.near[at]
        if model_of(self.world, self.world.task[i]).exact:
            joints = self.posture(i, placement.chain[at], placement.base).joints
        arm = serial_arm(self.world.robot.chain)
        n = len(arm.axis)
        frames, J = np.empty((n + 1, 4, 4)), np.empty((6, n))
        chain_frames(arm, joints, frames)
        chain_jacobian(arm, frames, J)
        return J[:3]


def _volume(J: Array) -> float:
    """Manipulability sqrt(det J J^T) (Yoshikawa 1985): volume of the velocity ellipsoid but for a factor."""
    return float(np.sqrt(max(np.linalg.det(J @ J.T), 0.0)))


def _load_capacity(J: Array) -> float:
    """Negative of the largest joint torque for each newton of load at the tool [N m / N]."""
    return -float(np.abs(J[2]).max())


_MEASURES: dict[str, Callable[[Array], float]] = {"manipulability": _volume, "effort": _load_capacity}


@lru_cache(maxsize=256)
def _any_heading_solver(world: World, family: Family) -> Solver:
    """Solver that takes no heed of the rule of heading."""
    return replace(solver_for(world, family), heading="free")


def _gathered(planes: Array) -> Array:
    """Angles (n,) by whole turns into the one turn that begins in the middle of their widest gap."""
    ordered = np.sort(np.mod(planes, 2 * np.pi))
    gaps = np.diff(np.append(ordered, ordered[0] + 2 * np.pi))
    widest = int(np.argmax(gaps))
    across = ordered[widest] + gaps[widest] / 2 + np.pi
    gathered: Array = across + np.mod(planes - across + np.pi, 2 * np.pi) - np.pi
    return gathered
