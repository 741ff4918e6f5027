"""The motion between configurations: the tool stays on its path wherever areas and obstacles allow it.

A run of set-points is a walk through spots, each a clear configuration at one set-point; a step of the walk
is the tool going on to the next. The walk follows what M-FABRIK found. Where the arm would touch something,
other spots of the same set-point are tried, and where none can be come to, earlier steps are taken back.
Where a run ends, the tool is lifted and the base drives over free floor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from regionik.areas.standing import Standing
from regionik.moving.avoid import Avoider, Evidence, Spot
from regionik.moving.basepaths import tracks_for
from regionik.moving.driving import driver_for
from regionik.moving.hops import Hops
from regionik.moving.rolled import travel_headings
from regionik.moving.stretch import Stretcher
from regionik.moving.transit import Carrier
from regionik.planners.driving.drive import NoPathError
from regionik.postures.guard import guard_of
from regionik.postures.poses import Pose, Row, arrays, between, columns
from regionik.pruning import Pruned
from regionik.reasons import explain_arm
from regionik.values import Configuration, Motion
from regionik.worlds.errors import Cause, Explanation, NoPlanFound
from regionik.worlds.scene import Start, World

TRIES = 16  # spots of the next set-point tried from one spot
HARD_TRIES = 3  # of them, how many are worth a search in the space of the whole robot
PATIENCE = 200  # spots tried without getting farther before the tool is lifted

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class Course:
    """What `connect` hands on.

    Attributes
    ----------
    motion : Motion
    setpoints : tuple of Configuration
        As the motion passes them: the arm re-solved along the way.
    methods : dict
        How many base moves each method of `drive` made.
    """

    motion: Motion
    setpoints: tuple[Configuration, ...]
    methods: dict[str, int]


def connect(
    world: World,
    pruned: Pruned,
    chain: list[int],
    goals: tuple[Configuration, ...],
    standing: Standing,
    seed: int,
    progress: Progress | None = None,
) -> Course:
    """Join configurations to one motion.

    Parameters
    ----------
    world : World
    pruned : Pruned
        The ladder, and the set-points before which the tool is lifted.
    chain : list of int
        Component of each set-point.
    goals : tuple of Configuration
        From M-FABRIK, one for each set-point.
    standing : Standing
        Where the base may stand; transits drive over its free pieces.
    seed : int
    progress : callable, optional
        Called with stage, done, total.

    Raises
    ------
    NoPlanFound
        Where the arm touches something in every posture that was looked at, or cannot get there.
    """
    guard, ladder = guard_of(world), pruned.ladder
    hops = Hops(world, guard)
    driver = driver_for(world, hops, standing, seed)
    travel = None if world.robot.base == "omni" else travel_headings(world.robot, goals)
    avoider = Avoider(world, guard, ladder, standing, seed, travel)
    carrier = Carrier(world, guard, hops, driver)
    stretcher = Stretcher(world, ladder, guard, tracks_for(world, ladder, standing, driver))
    nominal = tuple(Spot(goal, k) for goal, k in zip(goals, chain, strict=True))
    walker = _Walker(world, pruned, nominal, avoider, stretcher, carrier, progress or (lambda *_: None))
    rows, spots = walker.walk()
    return Course(columns(rows), tuple(spot.found for spot in spots), dict(sorted(driver.methods.items())))


@dataclass(frozen=True, eq=False)
class _Step:
    """A spot of a run, how the tool came there, and what may follow."""

    spot: Spot
    rows: list[Row]
    ahead: Iterator[Spot]


@dataclass(frozen=True, eq=False)
class _Walker:
    world: World
    pruned: Pruned
    nominal: tuple[Spot, ...]
    avoider: Avoider
    stretcher: Stretcher
    carrier: Carrier
    tell: Progress

    def walk(self) -> tuple[list[Row], list[Spot]]:
        """Run after run until the path is done."""
        rows: list[Row] = []
        spots: list[Spot] = []
        lifts = -1
        while len(spots) < len(self.nominal):
            lifts += 1
            if self.world.rules.max_lift_offs is not None and lifts > self.world.rules.max_lift_offs:
                raise NoPlanFound(self._one_lift_too_many(len(spots)))
            way, first = self._arrive(len(spots), rows[-1].pose if rows else None)
            rows += way
            for step in self._run(len(spots), first):
                rows += [*step.rows, Row(step.spot.pose, "setpoint", len(spots))]
                spots.append(step.spot)
                self.tell("motion", len(spots), len(self.nominal))
        return rows, spots

    def _arrive(self, i: int, here: Pose | None) -> tuple[list[Row], Spot]:
        """Get to a first spot of set-point i with the tool lifted, from the start or the last run."""
        rows = []
        if here is None and self.world.start is not None:
            here = self._start(self.world.start)
            rows = [Row(here, "transit", -1)]
        found = self.avoider.arrivals(i, self._kept(i), here or self.nominal[i].pose, self.nominal[i])
        spots = islice(found, TRIES)
        if here is None:
            first = next(spots, None)
            if first is not None:
                return [], first
        for spot, way in self._ways(here, spots) if here is not None else ():
            if way is not None and here is not None:
                if i > 0 and not way:  # however short the way, the tool leaves its path on it
                    way = [between(here, spot.pose, 0.5, self.world.robot.base)]
                return rows + [Row(pose, "transit", i - 1) for pose in way], spot
        raise NoPlanFound(self._why_not(i, here))

    def _start(self, start: Start) -> Pose:
        """The pose the robot starts in, if its arm is clear there."""
        guard, here = self.avoider.guard, Pose(start.base, start.joints)
        touch = guard.touch(here)
        if guard.on and touch.kind != "none":
            raise NoPlanFound(explain_arm.blocked_arm(self.world, guard.words(touch), guard.cause(touch)))
        return here

    def _ways(self, here: Pose, spots: Iterator[Spot]) -> Iterator[tuple[Spot, list[Pose] | None]]:
        """Lifted ways to spots: the plain ones to all, then searches to the first few."""
        floor, asked = self.pruned.ladder.floor, []
        for spot in spots:
            asked.append(spot)
            yield spot, self.carrier.folded(here, spot.pose, int(floor[spot.component]))
        for spot in asked[:HARD_TRIES]:
            yield spot, self.carrier.sampled(here, spot.pose, int(floor[spot.component]))

    def _why_not(self, i: int, here: Pose | None) -> Explanation:
        """What stands in the arm's way at set-point i, or on the way there."""
        guard, seen = self.avoider.guard, self.avoider.evidence.get(i, Evidence())
        touch, cut_off = seen.best, here is not None and seen.clear > 0
        if cut_off and self.carrier.refusals:
            return explain_arm.no_drive(self.world, i, self.carrier.refusals[0])
        if here is not None and cut_off:
            piece = int(self.pruned.ladder.floor[self.nominal[i].component])
            try:
                touch = self.carrier.obstruction(here, self.nominal[i].pose, piece)
            except NoPathError as refusal:  # it drives to other places of this set-point only
                return explain_arm.no_drive(self.world, i, refusal)
        closest, cause = "no single thing stands in the way", Cause("limits", self.world.robot.name)
        if touch is not None:
            closest, cause = guard.words(touch), guard.cause(touch)
        looked = seen.places, seen.postures, seen.proven
        return explain_arm.no_clear_posture(self.world, i, looked, closest, cause, cut_off=cut_off)

    def _one_lift_too_many(self, i: int) -> Explanation:
        """What would have the tool lifted before set-point i, against the rules."""
        guard, touch = self.avoider.guard, self.stretcher.stops.get(i - 1)
        if touch is None:
            return explain_arm.arm_must_lift(self.world, i, "the arm would have to jump", None)
        return explain_arm.arm_must_lift(self.world, i, guard.words(touch), guard.cause(touch))

    def _run(self, i: int, first: Spot) -> list[_Step]:
        """The longest walk found from a spot of set-point i, to the end of the run at most."""
        end = min((k for k in self.pruned.breaks if k > i), default=len(self.nominal))
        steps = [_Step(first, [], self._ahead(i, first))]
        best, longest, tried, seen = list(steps), 1, 0, set[Spot]()
        while steps and longest < end - i and tried < PATIENCE:
            k = i + len(steps) - 1
            spot = next(steps[-1].ahead, None)
            if spot is None:
                if len(steps) > len(best):  # a copy only where a step is taken back
                    best = list(steps)
                steps.pop()
                continue
            if spot in seen:
                continue
            rows = self.stretcher.follow(k, steps[-1].spot, spot)
            tried += 1
            if rows is None or not self.avoider.meets(rows[-1].pose):  # the arm is solved anew on the way
                continue
            seen.add(spot)
            arrived = self._arrived(k + 1, spot, rows)
            steps.append(_Step(arrived, rows[:-1], self._ahead(k + 1, arrived)))
            if len(steps) > longest:
                longest, tried = len(steps), 0
        return best if len(best) == longest else steps

    def _ahead(self, i: int, here: Spot) -> Iterator[Spot]:
        """Spots of the set-point after i, in components that the base can go on to."""
        if i + 1 >= len(self.nominal):
            return iter(())
        ladder = self.pruned.ladder  # a base may turn into another component where it has come to
        after = {m for k in ladder.ahead[here.component] for m in ladder.members[k]}
        components = [k for k in self._kept(i + 1) if k in after]
        return islice(self.avoider.options(i + 1, components, here.pose, self.nominal[i + 1]), TRIES)

    def _kept(self, i: int) -> list[int]:
        """Components of a set-point that the pruning left, the chosen one first."""
        rungs = self.pruned.ladder.rungs
        kept = [k for k in range(rungs[i], rungs[i + 1]) if self.pruned.keep[k]]
        return sorted(kept, key=lambda k: (k != self.nominal[i].component, k))

    def _arrived(self, i: int, spot: Spot, rows: list[Row]) -> Spot:
        """The spot as the motion reaches it; iterations stay those of M-FABRIK."""
        pose, rules, guard = rows[-1].pose, self.world.rules, self.stretcher.guard
        tool = guard.tools(*arrays([pose, pose]), np.zeros(1))[0, 0, :3, 3]
        error = math.dist(tool, self.world.task[i].position)
        found = Configuration(pose.base, pose.joints, error, spot.found.iterations, error <= rules.tolerance)
        return Spot(found, spot.component)
