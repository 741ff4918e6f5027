"""The motion between configurations: the tool stays on its path wherever areas and obstacles allow it.

Base and joints go on together where the tool is turned as asked, as far as that leads. A search of clear
configurations follows what M-FABRIK found, and tries others of the same set-point where the arm would touch
something. Where a run ends, the tool is lifted and the base drives over free floor.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from typing import NamedTuple

import numpy as np
import shapely

from regionik.areas.standing import Standing
from regionik.explain import arm_failures
from regionik.mfabrik import configurations
from regionik.moving.base_motion import Candidate
from regionik.moving.layered_search import LayeredSearch
from regionik.moving.path_search import Ahead, JoinedMotion, PathSearch, SearchStep, path_search
from regionik.planners.progress import tell, track
from regionik.postures.poses import Pose, Row
from regionik.pruning import Pruned, choose_chain, solvers_along, start_place, start_pose
from regionik.scene import Scene
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Explanation, NoPlanFound

TRIES = 16  # candidates tried at the next set-point, or to begin a run from
BEGUN = 3  # of the longest runs of base and joints together, of which one is gone on with by search
SOON = 24  # candidates tried without getting farther before base and joints go on together
ROOM = 0.1  # share of a joint's range that is left to its limits where a run goes back to
FEW = 60  # set-points that they may go through and fail in any case
WAYS = 2, 12  # times as many as the farthest of them went, and on wheels

Start = tuple[Candidate, Ahead]  # of a run, and how it goes on from there without a search


class JoinedRun(NamedTuple):
    """A run of set-points, and the way to the first of them with the tool lifted."""

    way: list[Row]
    steps: list[SearchStep]


def connect_setpoints(
    scene: Scene, pruned: Pruned, standing: Standing, held: Mapping[int, Candidate], seed: int
) -> JoinedMotion:
    """Join the set-points of a world to one motion.

    Those of runs that are done from one place are ``held`` with the base there. Raises NoPlanFound where the
    arm touches something in every posture that was looked at, or cannot get there.
    """
    layers = None
    if scene.robot.drive.rolls:
        layers = LayeredSearch(scene, pruned.ladder, pruned.keep, pruned.breaks, standing)
    search = path_search(scene, pruned.ladder, standing, seed, layers)
    return _Connection(pruned, standing, held, search).made()


@dataclass(frozen=True, eq=False)
class _Connection:
    """Runs through the ladder, within the components that pruning left."""

    pruned: Pruned
    standing: Standing
    held: Mapping[int, Candidate]
    search: PathSearch

    @property
    def scene(self) -> Scene:
        return self.search.scene

    @property
    def _rolls(self) -> bool:
        return self.scene.robot.drive.rolls

    @cached_property
    def nominal(self) -> tuple[Candidate, ...]:
        """What M-FABRIK finds at each set-point from the one before, in components of the least base way.

        Raises NoPlanFound where it does not converge and no search for other postures is allowed.
        """
        scene, pruned, standing = self.scene, self.pruned, self.standing
        chain = choose_chain(pruned, standing, start_place(scene))
        solvers = solvers_along(scene, pruned.ladder, standing, chain)
        task = track("configurations", scene.task)
        goals = configurations(task, solvers, start_pose(scene, pruned, chain[0]))
        left = [i for i, goal in enumerate(goals) if not goal.converged]
        if left and not scene.rules.avoidance:
            raise NoPlanFound(arm_failures.no_posture(scene, left[0]))
        return tuple(Candidate(goal, k) for goal, k in zip(goals, chain, strict=True))

    def made(self) -> JoinedMotion:
        """Join run after run until the path is complete."""
        rows, done, lifts = self.search.start(), list[Candidate](), 0
        most, count = self.scene.rules.max_lift_offs, len(self.scene.task)
        while True:
            way, steps = self._run(len(done), rows[-1].pose if rows else None)
            rows += way
            for step in steps:
                rows += [*step.rows, Row(step.candidate.pose, "setpoint", len(done))]
                done.append(step.candidate)
                tell("motion", len(done), count)
            if len(done) == count:
                return self.search.joined(rows, done)
            lifts += 1
            if most is not None and lifts > most:
                raise NoPlanFound(self._one_lift_too_many(len(done)))

    def _run(self, i: int, here: Pose | None) -> JoinedRun:
        """Move to set-point i with the tool lifted, and the longest run found from there.

        Where the tool is turned as asked, and on wheels, base and joints go on together first. Else, and
        where they get stuck, configurations are searched, those of M-FABRIK first; where that leads nowhere
        soon, base and joints go on together from elsewhere before the search ends.
        """
        count = min((k for k in self.pruned.breaks if k > i), default=len(self.scene.task)) - i
        best: JoinedRun | None = None
        if self._rolls or any(one.direction is not None for one in self.scene.task[i : i + count]):
            best = self._together(i, count, here, self._starts(i, here), resumed=not self._rolls)
        if best is None or len(best.steps) < count:
            best = self._searched(i, count, here, best)
        return best

    def _searched(self, i: int, count: int, here: Pose | None, known: JoinedRun | None) -> JoinedRun:
        """The longest run that a search finds, or that is known, or a whole one begun elsewhere."""
        try:
            way, first = self._arrive(i, here)
        except NoPlanFound:
            if known is None:
                raise
            return known
        run = self.search.run(i, count, first, self._ahead)
        if len(run.longest(SOON)) < count:
            whole = self._together(i, count, here, self._elsewhere(i, here, first), resumed=False)
            if whole is not None:
                return whole
        found = JoinedRun(way, run.longest())
        return found if known is None or len(known.steps) < len(found.steps) else known

    def _together(
        self, i: int, count: int, here: Pose | None, starts: Iterator[Start], *, resumed: bool
    ) -> JoinedRun | None:
        """A whole run of base and joints together from one of some starts; None for none.

        The longest one is ``resumed`` by a search, which may end sooner.
        """
        tried = list[list[SearchStep]]()
        for first, ahead in starts:
            tried.append(self.search.run(i, count, first, ahead).longest())
            if len(tried[-1]) == count and (way := self._unfolded(i, here, first)) is not None:
                return JoinedRun(way, tried[-1])
            if self._in_vain(tried):
                break
        for steps in sorted(tried, key=len, reverse=True)[: BEGUN * resumed]:
            way = self._unfolded(i, here, steps[0].candidate)
            if way is not None:
                return JoinedRun(way, self.search.resumed(i, count, steps, self._ahead).longest())
        return None

    def _in_vain(self, tried: list[list[SearchStep]]) -> bool:
        """Whether no more starts are tried, by the set-points that those before went through."""
        lengths = [len(steps) for steps in tried]
        return sum(lengths) > max(FEW, WAYS[self._rolls] * max(lengths))

    def _unfolded(self, i: int, here: Pose | None, first: Candidate) -> list[Row] | None:
        """The way to where a run begins with the tool lifted, the arm folded on it; None without one."""
        search = self.search
        arrived = search.arrive(i, here, [first], search.transits.folded, hard=0)
        return None if arrived is None else arrived[0]

    def _starts(self, i: int, here: Pose | None) -> Iterator[Start]:
        """Where a run may begin: the one place that does for it, the least motion away, or M-FABRIK's."""
        sampler, goal = self.search.sampler, self._goal(i)
        kept = self._kept(i, goal)
        if i in self.held:
            yield self.held[i], self._standing
        if here is not None:
            yield from self._going(sampler.nearest(i, kept, here))
        yield from self._going(sampler.nominal(i, kept, here or goal.pose, goal))
        yield from self._going(sampler.roomy(i, kept, goal.pose))

    def _elsewhere(self, i: int, here: Pose | None, first: Candidate) -> Iterator[Start]:
        """Where a run may begin but at a first candidate: far from joint limits, then as `_arrive` has it."""
        sampler, goal = self.search.sampler, self.nominal[i]
        kept = self._kept(i, goal)
        yield from self._going(sampler.roomy(i, kept, first.pose))
        yield from self._going(islice(sampler.arrivals(i, kept, here or goal.pose, goal), TRIES))

    def _going(self, begun: Iterator[Candidate]) -> Iterator[Start]:
        """Configurations from which base and joints go on together, the joints back towards their home."""
        return ((first, partial(self._onward, self._home(first))) for first in begun)

    def _home(self, first: Candidate) -> Array | None:
        """Joints that a run from a configuration goes back to: its own ones, off their limits.

        On wheels the base cannot make room for that at once.
        """
        if self._rolls:
            return None
        chain = self.scene.robot.chain
        room = np.where(np.isfinite(chain.upper - chain.lower), ROOM * (chain.upper - chain.lower), 0.0)
        home: Array = np.clip(first.found.joints, chain.lower + room, chain.upper - room)
        return home

    def _goal(self, i: int) -> Candidate:
        """What M-FABRIK finds at a set-point: at the first, before a chain is made, in its widest area."""
        if i > 0 or self._rolls:
            return self.nominal[i]
        ladder, scene = self.pruned.ladder, self.scene
        kept = self.pruned.kept(0)
        k = kept[int(np.argmax(shapely.area(ladder.component[kept])))]
        (solver,) = solvers_along(scene, ladder, self.standing, [k])
        return Candidate(solver(scene.task[0], *start_pose(scene, self.pruned, k)), k)

    def _arrive(self, i: int, here: Pose | None) -> tuple[list[Row], Candidate]:
        """Move to a first candidate at set-point i with the tool lifted, from the start or the last run."""
        search, goal = self.search, self.nominal[i]
        start = here or goal.pose
        for components in (self._kept(i, goal), self._cut(i)):
            found = search.sampler.arrivals(i, components, start, goal)
            arrived = search.arrive(i, here, islice(found, TRIES), search.transits.folded)
            if arrived is not None:
                return arrived
        raise NoPlanFound(search.why_not(i, here, goal))

    def _ahead(self, i: int, here: Candidate) -> Iterator[Candidate]:
        """Candidates at the set-point after i, in components that the base can move to."""
        if i + 1 >= len(self.scene.task):
            return iter(())
        ladder = self.pruned.ladder  # a base may turn into another component where it has come to
        after = set(ladder.group[ladder.ahead[here.component]].tolist())
        goal, sampler = self.nominal[i + 1], self.search.sampler
        components = [k for k in self._kept(i + 1, goal) if int(ladder.group[k]) in after]
        found = sampler.options(i + 1, components, here.pose, goal, together=bool(here.way))
        return islice(found, TRIES)

    def _standing(self, i: int, here: Candidate) -> Iterator[Candidate]:
        """The configuration after set-point i of a run from one place."""
        return iter([self.held[i + 1]] if i + 1 in self.held else [])

    def _onward(self, home: Array | None, i: int, here: Candidate) -> Iterator[Candidate]:
        """The candidate to which base and joints go on together from set-point i."""
        if i + 1 >= len(self.scene.task):
            return iter(())
        return self.search.sampler.resolved_onward(i + 1, here.pose, home)

    def _kept(self, i: int, goal: Candidate) -> list[int]:
        """Components of a set-point that the pruning left, that of what M-FABRIK found first."""
        return sorted(self.pruned.kept(i), key=lambda k: (k != goal.component, k))

    def _cut(self, i: int) -> list[int]:
        """Components of a set-point that the pruning cut, as ways are known that no areas show."""
        rungs, keep = self.pruned.ladder.rungs, self.pruned.keep
        return [k for k in range(rungs[i], rungs[i + 1]) if not keep[k]]

    def _one_lift_too_many(self, i: int) -> Explanation:
        scene, guard, touch = self.scene, self.search.guard, self.search.follower.stops.get(i - 1)
        if touch is None:
            return arm_failures.arm_must_lift(scene, i, "the arm would have to jump", None)
        return arm_failures.arm_must_lift(scene, i, guard.words(touch), guard.cause(touch))
