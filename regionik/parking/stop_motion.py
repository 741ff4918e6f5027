"""The motion of a plan with stops: the arm works while the base stands, the tool is lifted while it drives.

A stop that the arm cannot do in one go, because of what is in its way, is tried from other places of it;
where none does all of it, places of its first half are, and so on, and the rest becomes a stop of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import chain, islice

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.explain.changes import one_lift_off
from regionik.explain.constraints import setpoint
from regionik.mfabrik import Solver
from regionik.moving.base_motion import Candidate
from regionik.moving.options import MOVING
from regionik.moving.path_search import (
    JoinedMotion,
    PathSearch,
    search_from_places,
)
from regionik.parking.options import PARKING
from regionik.parking.parking_areas import StopGroup
from regionik.parking.placements import BasePlacement, PlacementSearch
from regionik.parking.posture_carrier import PostureCarrier
from regionik.parking.stop_sequence import StopSequence
from regionik.planners.geometry.offsets import radius_that_holds
from regionik.planners.progress import tell
from regionik.postures.arm_roadmap import ArmRoadmap
from regionik.postures.poses import MotionState, Pose, distinct
from regionik.scene import Scene
from regionik.values import Configuration, Stop
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Cause, Explanation, NoPlanFound
from regionik.worlds.scene import Target

OPTIONS = PARKING.work


@dataclass(frozen=True, eq=False)
class StopMotion:
    """A motion through all stops."""

    joined: JoinedMotion
    stops: tuple[Stop, ...]
    split: tuple[int, ...]  # set-points before which a stop had to be split
    places: tuple[BaseGeometry, ...]  # for each set-point the places of its stop


def connect_stops(sequence: StopSequence, seed: int) -> StopMotion:
    """Go from stop to stop and do their set-points.

    Where the arm ends in a posture that no way is found from, all begins anew by postures with a way out.

    The stops are found with the place of the largest circle at each; the criterion of the rules then chooses
    among the places from which the same set-points are done, so that no other number of stops comes of it.
    Where none are found, the base first does what it can from where it starts.

    Raises
    ------
    NoPlanFound
        Where the arm touches something in every posture that was looked at, the base finds no way, or
        the tool is lifted more often than the rules allow.
    """
    widest = sequence.widest()
    try:
        found = _connection(widest, seed).made()
    except NoPlanFound:
        staying = _connection(widest, seed)
        first = staying.from_start()
        if first is None:
            raise
        return staying.made(first)
    if sequence.scene.rules.stop_criterion == "tolerance":
        return found
    asked = _connection(sequence.divided([stop.setpoints for stop in found.stops]), seed)
    try:
        chosen = asked.made()
    except NoPlanFound:
        return found
    return replace(chosen, split=found.split) if len(chosen.stops) == len(found.stops) else found


def _connection(sequence: StopSequence, seed: int, *, leaves: bool = False) -> _StopConnection:
    areas = sequence.parking_areas
    search = search_from_places(sequence.scene, areas.ladder, areas.free_space, seed)
    return _StopConnection(sequence, search, leaves=leaves)


@dataclass(frozen=True, eq=False)
class _Attempt:
    """The work done from one place: its states, and a candidate for each set-point that is done."""

    placement: BasePlacement
    states: list[MotionState]
    candidates: list[Candidate]


@dataclass(frozen=True, eq=False)
class _StopConnection:
    """Connection of stops one after the other, each from the place that serves most of it."""

    sequence: StopSequence
    search: PathSearch
    _looked_at: dict[int, list[Candidate]] = field(default_factory=dict)  # by set-point
    _carriers: dict[int, PostureCarrier] = field(default_factory=dict)
    _left: list[ArmRoadmap | None] = field(default_factory=list)  # of the stops that are done
    leaves: bool = False  # only by postures from which the arm is brought to the one it is carried in

    @property
    def scene(self) -> Scene:
        return self.sequence.scene

    @cached_property
    def _placements(self) -> PlacementSearch:
        return PlacementSearch(self.scene, self.sequence.parking_areas)

    def from_start(self) -> _Attempt | None:
        """Return what is done from the start of the robot; None if that is nothing."""
        states = self.search.start()
        if not states or self.scene.rules.order != "given":
            return None
        placement = self._placements.in_place(self.sequence.groups[0], states[-1].pose)
        if placement is None:
            return None
        found = self._attempt(placement, states[-1].pose, MOVING.runs.max_whole_body_tries)
        return found if found.candidates else None

    def made(self, first: _Attempt | None = None) -> StopMotion:
        """Connect stop after stop until all set-points are done."""
        states, found = self.search.start(), list[Candidate]()
        sequence, k = self.sequence, 0
        stops, split, places = list[Stop](), list[int](), list[BaseGeometry]()
        while k < len(sequence.groups):
            group = sequence.groups[k]
            most = self.scene.rules.max_lift_offs
            if most is not None and len(stops) > most:
                raise NoPlanFound(self._one_lift_too_many(group))
            best = first if first is not None and not stops else None
            here = states[-1].pose if states else None
            if best is None:
                try:
                    best = self._best(group, sequence.spots[k], here)
                except NoPlanFound:
                    if here is None or self.leaves or self._gets_out(here):
                        raise
                    return _connection(self.sequence, self.search.sampler.seed, leaves=True).made()
            if k + 1 < len(sequence.groups):
                best = self._farther(best, [*group.setpoints, *sequence.groups[k + 1].setpoints], here)
            states += best.states
            found += best.candidates
            done = best.placement.setpoints[: len(best.candidates)]
            stops.append(best.placement.stop(self.scene, done))
            self._left.append(best.placement.roadmap)
            shown = shapely.union_all(list(group.places.values()))
            places += [self._known(shown, i) for i in done]
            tell("motion", len(found), len(self.scene.task))
            k += 1
            if len(found) == len(self.scene.task):
                break
            if len(done) != len(group.setpoints):
                split += [len(found)] if len(done) < len(group.setpoints) else []
                sequence, k = sequence.after(k - 1, len(found)), 0
        return StopMotion(self.search.joined(states, found), tuple(stops), tuple(split), tuple(places))

    def _known(self, places: BaseGeometry, i: int) -> BaseGeometry:
        """Places of a stop that areas of a set-point know; those of the set-point where they know none."""
        areas = self.sequence.parking_areas
        own = shapely.union_all([areas.areas_at(side)[i] for side in areas.sides])
        if own.covers(places):
            return places
        shared = shapely.intersection(places, own)
        return shared if shared.area > 0 else own

    def _farther(self, done: _Attempt, setpoints: list[int], here: Pose | None) -> _Attempt:
        """More of some set-points than were done from a place: areas need not know that it serves them."""
        if self.scene.rules.order != "given":
            return done
        group = StopGroup(tuple(setpoints), {})
        placement = self._placements.in_place(group, done.candidates[0].pose)
        if placement is None or len(placement.setpoints) <= len(done.candidates):
            return done
        tried = self._attempt(placement, here, MOVING.runs.max_whole_body_tries)
        return tried if len(tried.candidates) > len(done.candidates) else done

    def _best(self, group: StopGroup, spot: Array | None, here: Pose | None) -> _Attempt:
        """The place from which most of a stop is done; places of parts of it where none does all of it."""
        best: _Attempt | None = None
        self.search.transits.refusals.clear()  # those on the way to other stops tell nothing of this one
        placements, count = self._placements, len(group.setpoints)
        while count > (len(best.candidates) if best else 0):
            part = group
            if count < len(group.setpoints):
                some = group.setpoints[:count]
                areas, order = self.sequence.parking_areas, self.scene.rules.order
                part = areas.group(some, order) if group.poses is None else group.of(some)
            first = (one for one in [placements.best(part, spot)] if one is not None)
            hard = MOVING.runs.max_whole_body_tries if count == 1 or self.scene.rules.order == "given" else 1
            for n, placement in enumerate(islice(chain(first, placements.others(part)), OPTIONS.max_places)):
                tried = self._attempt(
                    placement, here, hard if n < OPTIONS.max_whole_body_places or count == 1 else 0
                )
                if best is None or len(tried.candidates) > len(best.candidates):
                    best = tried
                if len(best.candidates) == count:
                    return best
            count //= 2
        if best is None or not best.candidates:
            i = group.setpoints[0]
            # Only now is it measured what the arm touches.
            clear = [one for one in self._looked_at.get(i, []) if self.search.sampler.clear(i, one.pose)]
            raise NoPlanFound(self.search.why_not(i, here, clear[0] if clear else None))
        return best

    def _attempt(self, placement: BasePlacement, here: Pose | None, hard: int) -> _Attempt:
        """The set-points of a stop from one place; in any order the tool may be lifted between them.

        So many postures are worth a search in the space of the whole robot.
        """
        states, done = list[MotionState](), list[Candidate]()
        given = self.scene.rules.order == "given"
        patience = MOVING.runs.max_stalled_candidates if given else OPTIONS.max_linked_motions
        while len(done) < len(placement.setpoints):
            i = placement.setpoints[len(done)]
            came = self._arrive(placement, i, here, hard)
            if came is None:
                break
            before, left = len(done), len(placement.setpoints) - len(done)
            if placement.roadmap is not None and self.scene.rules.max_lift_offs is None:
                left = 1  # its postures are those of a tour of straight motions, which take less time
            run = self.search.run(i, left, came[1], partial(self._ahead, placement))
            for step in run.longest(patience):
                joints = step.candidate.configuration.joints
                if not self._admits(placement, placement.setpoints[len(done)], joints):
                    break
                states += came[0] if len(done) == before else []
                states += [
                    *step.states,
                    MotionState(step.candidate.pose, "setpoint", placement.setpoints[len(done)]),
                ]
                done.append(step.candidate)
            if given or len(done) == before:
                break
            here = states[-1].pose
        return _Attempt(replace(placement, tolerance=self._parking_radius(placement, done)), states, done)

    def _gets_out(self, here: Pose) -> bool:
        """True if a motion of the arm from a pose to its carry posture is found."""
        return self.search.transits.arm_way(here, self.scene.robot.carry) is not None

    def _admits(self, placement: BasePlacement, i: int, joints: Array) -> bool:
        """True if a posture serves a set-point, and the arm can be brought out of it where it has to be."""
        if not self._serves(placement, i, joints):
            return False
        return not self.leaves or self._gets_out(Pose(placement.base, joints))

    def _serves(self, placement: BasePlacement, i: int, joints: Array) -> bool:
        """True if a posture at a set-point is clear, and can be kept all round the circle that is asked for.

        Areas of arms in one plane know it. Those of other arms do not know the limits of a pivot on a base
        that keeps its heading, and are sampled where the tool is oriented: there it is tried on the rim.
        Where a roadmap leads from posture to posture, it has to lead to this one.
        """
        base = placement.base
        if self.scene.model(self.scene.task[i]).exact:
            return self.search.collision.proves(Pose(base, joints))
        roadmap = placement.roadmap
        if roadmap is not None and (joints == placement.near[placement.setpoints.index(i)]).all():
            return True
        if not self._carrier(i).serves(0, base, joints):
            return False
        return roadmap is None or roadmap.joins(self.search.collision, joints)

    def _carrier(self, i: int) -> PostureCarrier:
        if i not in self._carriers:
            self._carriers[i] = PostureCarrier(self.scene.world, self.search.collision, [self.scene.task[i]])
        return self._carriers[i]

    def _parking_radius(self, placement: BasePlacement, done: list[Candidate]) -> float:
        """Radius of the circle all round which postures at the set-points were found, as `_serves` asks."""
        wanted, radius = self.scene.rules.stop_tolerance, placement.tolerance
        for i, candidate in zip(placement.setpoints, done, strict=False):
            if self.scene.model(self.scene.task[i]).exact:
                continue
            carrier, joints = self._carrier(i), candidate.configuration.joints
            reached = partial(carrier.reaches_rim, 0, placement.base, joints)
            radius = radius_that_holds(radius, wanted, reached)
        return radius

    def _arrive(
        self, placement: BasePlacement, i: int, here: Pose | None, hard: int
    ) -> tuple[list[MotionState], Candidate] | None:
        """Get to a set-point of a stop with the tool lifted; the base stays but on the way to the first."""
        first, near = i == placement.setpoints[0], placement.near[placement.setpoints.index(i)].copy()
        components = self._components(placement, i)
        found, roadmap = self._postures(placement, i, components, near), placement.roadmap
        if roadmap is not None:
            own = [self._own_posture(placement, i)]
            self._looked_at.setdefault(i, []).extend(own)
            way = partial(self._driven if first else self._swung, roadmap)
            return self.search.arrive(i, here, own, way, hard if first else 1)
        drives = first and self.scene.rules.order == "any"
        postures = list(islice(found, OPTIONS.max_arrivals if drives else OPTIONS.max_postures))
        if not postures and len(placement.setpoints) == 1:
            postures = list(self._round(i, components, placement.base, near))
        if first:
            return self.search.arrive(i, here, postures, self.search.transits.driven, hard)
        came = self.search.arrive(i, here, postures, self.search.transits.swung, 0)
        return came or self.search.arrive(i, here, postures[:1], self.search.transits.round_about, 0)

    def _own_posture(self, placement: BasePlacement, i: int) -> Candidate:
        """Return the placement's own posture at a set-point."""
        at, target = placement.setpoints.index(i), self.scene.task[i]
        joints, robot = placement.near[at], self.scene.robot
        error = float(np.linalg.norm(robot.tool(placement.base, joints)[:3, 3] - target.position))
        return Candidate(Configuration(placement.base, joints, error, 0, True), placement.chain[at])

    def _swung(self, roadmap: ArmRoadmap, here: Pose, there: Pose, _: int) -> list[Pose] | None:
        """Return the states strictly between two postures of a stop, by its roadmap."""
        return roadmap.way(self.search.collision, here.joints, there.joints)

    def _driven(self, roadmap: ArmRoadmap, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """States strictly between postures of two stops, driven in the posture that their roadmaps share."""
        root, left = roadmap.joints[0], self._left[-1] if self._left else None
        collision, transits = self.search.collision, self.search.transits
        folded, ready = Pose(here.base, root), Pose(there.base, root)
        away: list[Pose] | None = []
        if (here.joints != root).any():
            away = None if left is None else left.way(collision, here.joints, root)
        out = roadmap.way(collision, root, there.joints)
        if away is not None and out is not None:
            drive = transits.carried(folded, ready, piece)
            if drive is not None:
                return distinct([here, *away, folded, *drive, ready, *out, there])[1:-1]
        return transits.driven(here, there, piece)

    def _components(self, placement: BasePlacement, i: int) -> list[int]:
        """Components of a set-point that hold the place, that of the placement first."""
        parking_areas, own = self.sequence.parking_areas, placement.chain[placement.setpoints.index(i)]
        rungs, side = parking_areas.ladder.rungs, parking_areas.ladder.side
        point = shapely.Point(placement.axis)
        found = [k for k in range(rungs[i], rungs[i + 1]) if side[k] == side[own] and parking_areas.usable[k]]
        return [own, *(k for k in found if k != own and parking_areas.ladder.component[k].covers(point))]

    def _ahead(self, placement: BasePlacement, i: int, here: Candidate) -> Iterator[Candidate]:
        """Yield postures at the set-point after i of a stop."""
        if i >= placement.setpoints[-1]:
            return iter(())
        if placement.roadmap is not None:
            return iter([self._own_posture(placement, i + 1)])
        linked = [
            k
            for k in self._components(placement, i + 1)
            if here.component in self.sequence.parking_areas.back[k]
        ]
        found = self._postures(placement, i + 1, linked, here.configuration.joints)
        return islice(found, OPTIONS.max_postures)

    def _postures(
        self, placement: BasePlacement, i: int, components: list[int], near: Array
    ) -> Iterator[Candidate]:
        """Yield collision-free postures on a set-point with the base where it is, the least changed first."""
        target, base = self.scene.task[i], placement.base
        for k in components:
            solver = self.search.sampler.solver(k, float(base[2]))
            for found in _on_target(solver, target, base, near):
                candidate = Candidate(replace(found, base=base), k)
                self._looked_at.setdefault(i, []).append(candidate)
                if self._admits(placement, i, candidate.configuration.joints):
                    yield candidate

    def _round(self, i: int, components: list[int], base: Array, near: Array) -> Iterator[Candidate]:
        """Yield a posture on a set-point that avoids its collision, if all others collide."""
        solver = self.search.sampler.solver(components[0], float(base[2]))
        found = solver.hold(self.scene.task[i], base, near)
        if self.search.collision.enabled and found.converged:
            yield from self.search.sampler.around(i, Candidate(replace(found, base=base), components[0]))

    def _one_lift_too_many(self, group: StopGroup) -> Explanation:
        i, most = group.setpoints[0], self.scene.rules.max_lift_offs
        reason = (
            f"{setpoint(i, len(self.scene.task))} needs one stop more: the base has done "
            f"all before it from {(most or 0) + 1}, each going on for as long as the areas let it, and the "
            f"tool is lifted between two stops; the rules allow {most} lift-offs."
        )
        causes, repairs = (Cause("reach", "room to park", None),), (one_lift_off(self.scene, i),)
        return Explanation("ladder-broken", i, reason, causes, repairs)


def _on_target(solver: Solver, target: Target, base: Array, near: Array) -> Iterator[Configuration]:
    """Postures on a target with the base where it is: those that change least, then those of every kind."""
    for found in (solver.hold(target, base, near), solver.least_change(target, base, near)):
        if found is not None and found.converged:
            yield found
    yield from solver.self_motion(target, base, near, MOVING.sampling.max_pitches)
