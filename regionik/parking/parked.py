"""The motion of a plan with stops: the arm works while the base stands, the tool is lifted while it drives.

A stop that the arm cannot do in one go, because of what is in its way, is tried from other places of it;
where none does all of it, places of its first half are, and so on, and the rest becomes a stop of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import chain, islice

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.motion import HARD_TRIES, Course
from regionik.moving.avoid import PITCHES, Avoider, Evidence, Spot
from regionik.moving.basepaths import StandingTracks
from regionik.moving.driving import driver_for
from regionik.moving.hops import Hops
from regionik.moving.stretch import Stretcher
from regionik.moving.transit import Carrier
from regionik.parking.fewest import Group
from regionik.parking.placing import Bay, Placing
from regionik.parking.stops import Work
from regionik.postures.guard import guard_of
from regionik.postures.poses import Pose, Row, between, columns
from regionik.reasons import explain, explain_arm
from regionik.values import Configuration, Stop
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Cause, Explanation, NoPlanFound, Repair
from regionik.worlds.pivoted_arm import pivot_index
from regionik.worlds.scene import World

PLACES = 8  # of a stop that are tried
HARD_PLACES = 2  # of these, how many of a stop with more set-points are worth a search for the way there
POSTURES = 8  # at one set-point that are tried from the one before
PATIENCE = 200  # of them without getting farther before another place is tried

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class Attended:
    """A motion through all stops.

    Attributes
    ----------
    course : Course
    stops : tuple of Stop
    split : tuple of int
        Set-points before which a stop had to be split.
    places : tuple of geometry
        For each set-point the places of its stop.
    """

    course: Course
    stops: tuple[Stop, ...]
    split: tuple[int, ...]
    places: tuple[BaseGeometry, ...]


def attend(work: Work, seed: int, progress: Progress | None = None) -> Attended:
    """Go from stop to stop and do their set-points.

    Raises
    ------
    NoPlanFound
        Where the arm touches something in every posture that was looked at, the base finds no way, or
        the tool is lifted more often than the rules allow.
    """
    world, floors = work.world, work.floors
    guard = guard_of(world)
    hops = Hops(world, guard)
    driver = driver_for(world, hops, floors.standing, seed)
    avoider = Avoider(world, guard, floors.ladder, floors.standing, seed)
    stretcher = Stretcher(world, floors.ladder, guard, StandingTracks(world))
    attendant = _Attendant(work, avoider, stretcher, Carrier(world, guard, hops, driver))
    done = attendant.through(progress or (lambda *_: None))
    course = Course(columns(attendant.rows), tuple(attendant.found), dict(sorted(driver.methods.items())))
    return replace(done, course=course)


@dataclass(frozen=True, eq=False)
class _Step:
    """A spot of a stop, how the tool came there, and what may follow."""

    spot: Spot
    rows: list[Row]
    ahead: Iterator[Spot]


@dataclass(frozen=True, eq=False)
class _Attempt:
    """What was done from one place: states, and a spot for each set-point done."""

    bay: Bay
    rows: list[Row]
    spots: list[Spot]


@dataclass(frozen=True, eq=False)
class _Attendant:
    work: Work
    avoider: Avoider
    stretcher: Stretcher
    carrier: Carrier
    rows: list[Row] = field(default_factory=list)
    found: list[Configuration] = field(default_factory=list)

    @property
    def world(self) -> World:
        return self.work.world

    def through(self, tell: Progress) -> Attended:
        """Stop after stop until all set-points are done."""
        self._start()
        placing, work, k = Placing(self.world, self.work.floors), self.work, 0
        stops, split, places = list[Stop](), list[int](), list[BaseGeometry]()
        while k < len(work.groups):
            group = work.groups[k]
            most = self.world.rules.max_lift_offs
            if most is not None and len(stops) > most:
                raise NoPlanFound(self._one_lift_too_many(group))
            best = self._best(group, placing, work.spots[k], self.rows[-1].pose if self.rows else None)
            self.rows.extend(best.rows)
            self.found.extend(spot.found for spot in best.spots)
            done = best.bay.setpoints[: len(best.spots)]
            stops.append(replace(best.bay.stop(self.world), setpoints=done))
            places += [shapely.union_all(list(group.places.values()))] * len(done)
            tell("motion", len(self.found), len(self.world.task))
            k += 1
            if len(done) < len(group.setpoints):
                split.append(len(self.found))
                work, k = work.after(k - 1, len(self.found)), 0
        return Attended(
            Course(columns(self.rows), tuple(self.found), {}), tuple(stops), tuple(split), tuple(places)
        )

    def _start(self) -> None:
        """The robot where it starts, if its arm is clear there."""
        start, guard = self.world.start, self.avoider.guard
        if start is None:
            return
        here = Pose(start.base, start.joints)
        touch = guard.touch(here)
        if guard.on and touch.kind != "none":
            raise NoPlanFound(explain_arm.blocked_arm(self.world, guard.words(touch), guard.cause(touch)))
        self.rows.append(Row(here, "transit", -1))

    def _best(self, group: Group, placing: Placing, spot: Array | None, here: Pose | None) -> _Attempt:
        """The place from which most of a stop is done; places of parts of it where none does all of it."""
        best: _Attempt | None = None
        count = len(group.setpoints)
        while count > (len(best.spots) if best else 0):
            part = group
            if count < len(group.setpoints):
                part = self.work.floors.group(group.setpoints[:count], self.world.rules.order)
            for n, bay in enumerate(islice(chain([placing.best(part, spot)], placing.others(part)), PLACES)):
                tried = self._attempt(bay, here, HARD_TRIES if n < HARD_PLACES or count == 1 else 0)
                if best is None or len(tried.spots) > len(best.spots):
                    best = tried
                if len(best.spots) == count:
                    return best
            count //= 2
        if best is None or not best.spots:
            raise NoPlanFound(self._why_not(group.setpoints[0], here))
        return best

    def _attempt(self, bay: Bay, here: Pose | None, hard: int) -> _Attempt:
        """The set-points of a stop from one place; in any order the tool may be lifted between them.

        So many postures are worth a search in the space of the whole robot.
        """
        rows, spots = list[Row](), list[Spot]()
        while len(spots) < len(bay.setpoints):
            came = self._arrive(bay, len(spots), here, hard)
            if came is None:
                break
            rows += came[0]
            for step in self._run(bay, len(spots), came[1]):
                rows += [*step.rows, Row(step.spot.pose, "setpoint", bay.setpoints[len(spots)])]
                spots.append(step.spot)
            here = rows[-1].pose
            if self.world.rules.order == "given":
                break
        return _Attempt(bay, rows, spots)

    def _arrive(self, bay: Bay, p: int, here: Pose | None, hard: int) -> tuple[list[Row], Spot] | None:
        """Get to a set-point of a stop with the tool lifted; the base stays but on the way to the first."""
        i, near = bay.setpoints[p], np.array(self.world.robot.carry)
        near[pivot_index(self.world.robot.chain)] = bay.pivot[p]
        components = self._components(bay, i)
        spots = list(islice(self._postures(i, components, bay.base, near), POSTURES))
        if not spots and len(bay.setpoints) == 1:
            spots = list(self._round(i, components, bay.base, near))
        if here is None:
            return ([], spots[0]) if spots else None
        piece = self.work.floors.piece
        ways = [(self.carrier.folded, spots), (self.carrier.sampled, spots[:hard])]
        for carried, some in ways if p == 0 else ways[:1]:
            for spot in some:
                way = carried(here, spot.pose, piece)
                if way is not None and (p == 0 or all(np.array_equal(at.base, bay.base) for at in way)):
                    if i > 0 and not way:  # however short the way, the tool leaves its path on it
                        way = [between(here, spot.pose, 0.5, self.world.robot.base)]
                    return [Row(pose, "transit", i - 1) for pose in way], spot
        return None

    def _components(self, bay: Bay, i: int) -> list[int]:
        """Components of a set-point that hold the place, that of the bay first."""
        floors, own = self.work.floors, bay.chain[bay.setpoints.index(i)]
        rungs, side = floors.ladder.rungs, floors.ladder.side
        point = shapely.Point(bay.axis)
        found = [k for k in range(rungs[i], rungs[i + 1]) if side[k] == side[own] and floors.usable[k]]
        return [own, *(k for k in found if k != own and floors.ladder.component[k].covers(point))]

    def _run(self, bay: Bay, p: int, first: Spot) -> list[_Step]:
        """The longest way found of the tool along its path while the base stands still."""
        steps = [_Step(first, [], self._ahead(bay, p, first))]
        best, tried = list(steps), 0
        while steps and len(best) < len(bay.setpoints) - p and tried < PATIENCE:
            q = p + len(steps) - 1
            spot = next(steps[-1].ahead, None)
            if spot is None:
                steps.pop()
                continue
            rows = self.stretcher.follow(bay.setpoints[q], steps[-1].spot, spot)
            tried += 1
            if rows is None:
                continue
            arrived = self._arrived(bay.setpoints[q + 1], spot, rows[-1].pose)
            steps.append(_Step(arrived, rows[:-1], self._ahead(bay, q + 1, arrived)))
            if len(steps) > len(best):
                best, tried = list(steps), 0
        return best

    def _ahead(self, bay: Bay, p: int, here: Spot) -> Iterator[Spot]:
        """Postures on the set-point after one of a stop."""
        if p + 1 >= len(bay.setpoints):
            return iter(())
        i = bay.setpoints[p + 1]
        linked = [k for k in self._components(bay, i) if here.component in self.work.floors.back[k]]
        return islice(self._postures(i, linked, bay.base, here.found.joints), POSTURES)

    def _postures(self, i: int, components: list[int], base: Array, near: Array) -> Iterator[Spot]:
        """Clear postures on a set-point with the base where it is, the least changed first."""
        target, yaw = self.world.task[i], float(base[2])
        for k in components:
            solver = replace(self.avoider.solver(k), span=(yaw, yaw))
            plain = [solver.hold(target, base, near), solver.least_change(target, base, near)]
            some = [one for one in plain if one is not None and one.converged]
            for found in chain(some, solver.self_motion(target, base, near, PITCHES)):
                spot = Spot(replace(found, base=base), k)
                if self.avoider.clear(i, spot.pose):
                    yield spot

    def _round(self, i: int, components: list[int], base: Array, near: Array) -> Iterator[Spot]:
        """A posture on a set-point led round what it touches, where all others touch something."""
        solver = replace(self.avoider.solver(components[0]), span=(float(base[2]), float(base[2])))
        found = solver.hold(self.world.task[i], base, near)
        if self.avoider.guard.on and found.converged:
            yield from self.avoider.around(i, Spot(replace(found, base=base), components[0]))

    def _arrived(self, i: int, spot: Spot, pose: Pose) -> Spot:
        """The spot as the motion reaches it."""
        tool = self.world.robot.tool(pose.base, pose.joints)[:3, 3]
        error = float(np.linalg.norm(tool - self.world.task[i].position))
        good = error <= self.world.rules.tolerance
        found = replace(spot.found, base=pose.base, joints=pose.joints, error=error, converged=good)
        return replace(spot, found=found)

    def _why_not(self, i: int, here: Pose | None) -> Explanation:
        """What stands in the arm's way at set-point i, or on the way there."""
        guard, seen = self.avoider.guard, self.avoider.evidence.get(i, Evidence())
        if here is not None and seen.clear > 0 and self.carrier.refusals:
            return explain_arm.no_drive(self.world, i, self.carrier.refusals[0])
        closest, cause = "no single thing stands in the way", Cause("limits", self.world.robot.name)
        if seen.best is not None:
            closest, cause = guard.words(seen.best), guard.cause(seen.best)
        looked = seen.places, seen.postures, seen.proven
        return explain_arm.no_clear_posture(self.world, i, looked, closest, cause, cut_off=seen.clear > 0)

    def _one_lift_too_many(self, group: Group) -> Explanation:
        """One stop more than the rules let the tool be lifted."""
        i, most = group.setpoints[0], self.world.rules.max_lift_offs
        reason = (
            f"{explain.setpoint(i, len(self.world.task))} needs one stop more: the base has done "
            f"all before it from {(most or 0) + 1}, each going on for as long as the areas let it, and the "
            f"tool is lifted between two stops; the rules allow {most} lift-offs."
        )
        repair = Repair("lift-off", f"set-point {i + 1}", 1.0, f"allow a lift-off before set-point {i + 1}")
        return Explanation("ladder-broken", i, reason, (Cause("reach", "room to park", None),), (repair,))
