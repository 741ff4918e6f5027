"""The motion between configurations: the tool stays on its path wherever areas and obstacles allow it.

The search follows what M-FABRIK found. Where the arm would touch something, other configurations of the same
set-point are tried. Where a run ends, the tool is lifted and the base drives over free floor.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice

from regionik.areas.standing import Standing
from regionik.explain import arm_failures
from regionik.moving.base_motion import Candidate
from regionik.moving.layered_search import LayeredSearch
from regionik.moving.path_search import JoinedMotion, PathSearch, SearchStep, path_search
from regionik.planners.progress import tell
from regionik.postures.poses import Pose, Row
from regionik.pruning import Pruned
from regionik.values import Configuration
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Explanation, NoPlanFound
from regionik.worlds.scene import World

TRIES = 16  # candidates tried at the next set-point, or to begin a run from
BEGUN = 3  # of the longest runs of base and joints together, of which one is gone on with by search
FEW = 60  # set-points that they may go through and fail in any case
WAYS = 2, 12  # times as many as the farthest of them went, and on wheels


def connect_configurations(
    world: World,
    pruned: Pruned,
    chain: list[int],
    goals: tuple[Configuration, ...],
    standing: Standing,
    seed: int,
) -> JoinedMotion:
    """Join configurations, one for each set-point, to one motion.

    ``chain`` has the component of each. Raises NoPlanFound where the arm touches something in every posture
    that was looked at, or cannot get there.
    """
    ladder, layers = pruned.ladder, None
    if world.robot.drive.rolls:
        layers = LayeredSearch(world, ladder, pruned.keep, pruned.breaks, standing)
    search = path_search(world, ladder, standing, seed, layers)
    nominal = tuple(Candidate(goal, k) for goal, k in zip(goals, chain, strict=True))
    return _Connection(pruned, nominal, search).made()


@dataclass(frozen=True, eq=False)
class _Connection:
    """Runs through the ladder, within the components that pruning left."""

    pruned: Pruned
    nominal: tuple[Candidate, ...]
    search: PathSearch

    def made(self) -> JoinedMotion:
        """Join run after run until the path is complete."""
        rows, done, lifts = self.search.start(), list[Candidate](), 0
        most = self.search.world.rules.max_lift_offs
        while True:
            way, steps = self._run(len(done), rows[-1].pose if rows else None)
            rows += way
            for step in steps:
                rows += [*step.rows, Row(step.candidate.pose, "setpoint", len(done))]
                done.append(step.candidate)
                tell("motion", len(done), len(self.nominal))
            if len(done) == len(self.nominal):
                return self.search.joined(rows, done)
            lifts += 1
            if most is not None and lifts > most:
                raise NoPlanFound(self._one_lift_too_many(len(done)))

    def _run(self, i: int, here: Pose | None) -> tuple[list[Row], list[SearchStep]]:
        """Move to set-point i with the tool lifted, and the longest run found from there.

        First base and joints go on together along the path, from one start after the other. Where they get
        stuck, the graph of configurations is searched from where they came farthest.
        """
        count = min((k for k in self.pruned.breaks if k > i), default=len(self.nominal)) - i
        tried = list[list[SearchStep]]()
        for first in self._starts(i, here):
            ahead = partial(self._together, first.found.joints)
            tried.append(self.search.run(i, count, first, ahead).longest())
            if len(tried[-1]) == count and (way := self._unfolded(i, here, first)) is not None:
                return way, tried[-1]
            if self._in_vain(tried):
                break
        way, begun = self._begun(i, here, tried)
        return way, self.search.resumed(i, count, begun, self._ahead).longest()

    def _in_vain(self, tried: list[list[SearchStep]]) -> bool:
        """Whether no more starts are tried, by the set-points that those before went through."""
        lengths = [len(steps) for steps in tried]
        return sum(lengths) > max(FEW, WAYS[self.search.sampler.layers is not None] * max(lengths))

    def _begun(
        self, i: int, here: Pose | None, tried: list[list[SearchStep]]
    ) -> tuple[list[Row], list[SearchStep]]:
        """The longest of some runs that the robot gets to with the tool lifted, and the way there."""
        for steps in sorted(tried, key=len, reverse=True)[:BEGUN]:
            way = self._unfolded(i, here, steps[0].candidate)
            if way is not None:
                return way, steps
        way, first = self._arrive(i, here)
        return way, [SearchStep(first, [], iter(()))]

    def _unfolded(self, i: int, here: Pose | None, first: Candidate) -> list[Row] | None:
        """The way to where a run begins with the tool lifted, the arm folded on it; None without one."""
        search = self.search
        arrived = search.arrive(i, here, [first], search.transits.folded, hard=0)
        return None if arrived is None else arrived[0]

    def _starts(self, i: int, here: Pose | None) -> Iterator[Candidate]:
        """Where base and joints may begin to go on together: the least motion away, or as M-FABRIK found."""
        sampler, kept, goal = self.search.sampler, self._kept(i), self.nominal[i]
        if here is not None:
            yield from sampler.nearest(i, kept, here)
        yield from sampler.nominal(i, kept, here or goal.pose, goal)
        yield from sampler.roomy(i, kept, goal.pose)

    def _arrive(self, i: int, here: Pose | None) -> tuple[list[Row], Candidate]:
        """Move to a first candidate at set-point i with the tool lifted, from the start or the last run."""
        search, goal = self.search, self.nominal[i]
        start = here or goal.pose
        for components in (self._kept(i), self._cut(i)):
            found = search.sampler.arrivals(i, components, start, goal)
            arrived = search.arrive(i, here, islice(found, TRIES), search.transits.folded)
            if arrived is not None:
                return arrived
        raise NoPlanFound(search.why_not(i, here, goal))

    def _ahead(self, i: int, here: Candidate) -> Iterator[Candidate]:
        """Candidates at the set-point after i, in components that the base can move to."""
        if i + 1 >= len(self.nominal):
            return iter(())
        ladder = self.pruned.ladder  # a base may turn into another component where it has come to
        after = set(ladder.group[ladder.ahead[here.component]].tolist())
        components = [k for k in self._kept(i + 1) if int(ladder.group[k]) in after]
        goal, sampler = self.nominal[i + 1], self.search.sampler
        found = sampler.options(i + 1, components, here.pose, goal, together=bool(here.way))
        return islice(found, TRIES)

    def _together(self, home: Array, i: int, here: Candidate) -> Iterator[Candidate]:
        """The candidate to which base and joints go on together from set-point i."""
        if i + 1 >= len(self.nominal):
            return iter(())
        return self.search.sampler.resolved_onward(i + 1, here.pose, home)

    def _kept(self, i: int) -> list[int]:
        """Components of a set-point that the pruning left, the chosen one first."""
        return sorted(self.pruned.kept(i), key=lambda k: (k != self.nominal[i].component, k))

    def _cut(self, i: int) -> list[int]:
        """Components of a set-point that the pruning cut, as ways are known that no areas show."""
        rungs, keep = self.pruned.ladder.rungs, self.pruned.keep
        return [k for k in range(rungs[i], rungs[i + 1]) if not keep[k]]

    def _one_lift_too_many(self, i: int) -> Explanation:
        world, guard, touch = self.search.world, self.search.guard, self.search.follower.stops.get(i - 1)
        if touch is None:
            return arm_failures.arm_must_lift(world, i, "the arm would have to jump", None)
        return arm_failures.arm_must_lift(world, i, guard.words(touch), guard.cause(touch))
