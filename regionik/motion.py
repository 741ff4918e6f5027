"""The motion between configurations: the tool stays on its path wherever areas and obstacles allow it.

Where the tool is turned as asked, and on wheels, runs of base and joints together are grown from
configurations at one set-point, where they are stuck, along a base path through the areas, and midway. A
search of clear configurations follows what M-FABRIK found, and tries others of the same set-point where the
arm would touch something. Where a run ends, the tool is lifted and the base drives over free floor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from typing import NamedTuple

import numpy as np
import shapely

from regionik.areas.free_space import FreeSpace
from regionik.explain import arm_failures
from regionik.mfabrik import configurations
from regionik.moving.base_guide import BaseGuide, base_guide
from regionik.moving.base_motion import Candidate
from regionik.moving.grown_runs import GrownRun, RunGrowth, Seeds
from regionik.moving.options import MOVING
from regionik.moving.path_search import (
    JoinedMotion,
    PathSearch,
    SearchStep,
    path_search,
)
from regionik.moving.stationary_bases import StationaryBase, component_around, stationary_bases
from regionik.planners.progress import tell, track
from regionik.postures.poses import MotionState, Pose, pose_of
from regionik.pruning import Pruned, choose_chain, solvers_along, start_place, start_pose
from regionik.scene import Scene
from regionik.worlds.arms import reach_bound
from regionik.worlds.errors import Cause, Explanation, NoPlanFound
from regionik.worlds.strokes import stroke_span

OPTIONS = MOVING.runs
BASE_COORDINATES = 0, 1, 2  # coordinates of a base that stands


class JoinedRun(NamedTuple):
    """A run of set-points, and the way to the first of them with the tool lifted."""

    way: list[MotionState]
    steps: list[SearchStep]


def connect_setpoints(scene: Scene, pruned: Pruned, free_space: FreeSpace, seed: int) -> JoinedMotion:
    """Join the set-points of a world to one motion.

    Raises NoPlanFound where the arm touches something in every posture that was looked at, or cannot get
    there.
    """
    search = path_search(scene, pruned.ladder, free_space, seed)
    return _Connection(pruned, free_space, search, RunGrowth(search)).made()


@dataclass(frozen=True, eq=False)
class _Connection:
    """Connection of the set-points by runs through the ladder, within the components that pruning left."""

    pruned: Pruned
    free_space: FreeSpace
    search: PathSearch
    growth: RunGrowth

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
        scene, pruned, free_space = self.scene, self.pruned, self.free_space
        chain = choose_chain(pruned, free_space, start_place(scene))
        solvers = solvers_along(scene, pruned.ladder, free_space, chain)
        task = track("configurations", scene.task)
        goals = configurations(task, solvers, start_pose(scene, pruned, chain[0]))
        left = [i for i, goal in enumerate(goals) if not goal.converged]
        if left and not scene.rules.avoidance:
            raise NoPlanFound(arm_failures.no_posture(scene, left[0]))
        return tuple(Candidate(goal, k) for goal, k in zip(goals, chain, strict=True))

    def made(self) -> JoinedMotion:
        """Join run after run until the path is complete."""
        states, done, lifts = self.search.start(), list[Candidate](), 0
        most, count = self.scene.rules.max_lift_offs, len(self.scene.task)
        while True:
            way, steps = self._run(len(done), states[-1].pose if states else None)
            states += way
            for step in steps:
                states += [*step.states, MotionState(step.candidate.pose, "setpoint", len(done))]
                done.append(step.candidate)
                tell("motion", len(done), count)
            if len(done) == count:
                return self.search.joined(states, done)
            lifts += 1
            if most is not None and lifts > most:
                raise NoPlanFound(self._refused_lift(len(done), arm_failures.arm_must_lift))

    def _run(self, i: int, here: Pose | None) -> JoinedRun:
        """Return the transit to set-point i and the longest run found from there that ends between strokes.

        A stroke in which it gets stuck at once is tried alone; only where the rules allow it the tool is
        lifted within one.
        """
        within = self.scene.within_strokes
        end = min((k for k in self.pruned.breaks if k > i), default=len(self.scene.task))
        found = self._longest(i, end, here)
        stuck = i + len(found.steps)
        if stuck == end or not within[stuck]:
            return found
        first, after = stroke_span(within, stuck)
        if first > i:
            return JoinedRun(found.way, found.steps[: first - i])
        alone = self._longest(i, min(after, end), here)
        if len(alone.steps) > len(found.steps):
            found, stuck = alone, i + len(alone.steps)
        if stuck < min(after, end) and not self.scene.rules.lift_within:
            raise NoPlanFound(self._refused_lift(stuck, arm_failures.arm_must_lift_within))
        return found

    def _longest(self, i: int, end: int, here: Pose | None) -> JoinedRun:
        """Return the transit to set-point i and the longest run found from there, up to before ``end``.

        Without smoothing the configurations of M-FABRIK come first, as in its paper. With it a base that does
        for the whole run stands still. Else, where the tool is turned as asked, and on wheels, base and
        joints go on together, and configurations are searched where they are stuck. Elsewhere they are
        searched first, those of M-FABRIK before others.
        """
        if not self.scene.rules.smooth:
            return self._searched(i, end, here)
        stationary = self._stationary_run(i, end, here)
        if stationary is not None:
            return stationary
        if not self._rolls and all(one.direction is None for one in self.scene.task[i:end]):
            return self._searched(i, end, here, OPTIONS.max_base_first_candidates)
        known = self._together(i, end, here)
        if known is None:
            return self._searched(i, end, here)
        return known if len(known.steps) == end - i else self._resumed(i, end, known)

    def _stationary_run(self, i: int, end: int, here: Pose | None) -> JoinedRun | None:
        """Return a whole run with a stationary base; None if there is none."""
        if not self.scene.rules.avoidance:
            return None
        ladder, keep, passed = self.pruned.ladder, self.pruned.keep, 0
        for base in stationary_bases(self.scene, ladder, keep, self.free_space, i, end):
            growth = RunGrowth(self.search, BASE_COORDINATES)
            runs = growth.runs_from(i, end, partial(self._postures, base), [i])
            found = self._arrived(i, end, here, (run for run in runs if run.end >= end))
            passed += growth.passed
            if found is not None or passed > OPTIONS.stationary_budget_factor * (end - i):
                return found
        return None

    def _postures(self, base: StationaryBase, at: int) -> Iterator[Candidate]:
        """Yield collision-free postures at a set-point with a stationary base."""
        component = component_around(self.scene, self.pruned.ladder, self.pruned.keep, at, base)
        return self.search.sampler.other_postures(at, base.pose, component)

    def _together(self, i: int, end: int, here: Pose | None) -> JoinedRun | None:
        """Return the longest run of base and joints together from set-point i; None if there is none."""
        grown = list[GrownRun]()
        for run in self._grown(i, end, partial(self._seeds, i, here)):
            whole = self._arrived(i, end, here, [run] if run.end >= end else [])
            if whole is not None:
                return whole
            grown.append(run)
        grown.sort(key=lambda run: run.end)
        return self._arrived(i, end, here, (run for run in grown[::-1] if run.end < end))

    def _grown(self, i: int, end: int, seeds: Seeds) -> Iterator[GrownRun]:
        """Yield runs from set-point i towards ``end``: by the least motion, then along a base path.

        That leads through the areas, where the least motion may have come up against something. Wheels only
        begin on it: they cannot be drawn aside.
        """
        yield from self.growth.runs_from(i, end, seeds, [i])
        areas = [self.pruned.ladder.component[self.pruned.components_at(k)] for k in range(i, end)]
        guide = base_guide(i, areas, reach_bound(self.scene.robot.chain).length)
        if guide is not None:
            guided = RunGrowth(self.search, guide=None if self._rolls else guide.at)
            yield from guided.runs_from(i, end, partial(self._along, guide, seeds), [i, *guide.narrow])
        yield from self.growth.runs_from(i, end, seeds, [(i + end) // 2])

    def _along(self, guide: BaseGuide, seeds: Seeds, at: int) -> Iterator[Candidate]:
        """Where a run along a base path may begin: on it, far from joint limits, or anywhere."""
        robot, kept = self.scene.robot, self.pruned.components_at(at)
        start = Pose(pose_of(robot, guide.at(at), 0.0), robot.carry)
        yield from self.search.sampler.far_from_limits(at, kept, start)
        yield from seeds(at)

    def _arrived(self, i: int, end: int, here: Pose | None, runs: Iterable[GrownRun]) -> JoinedRun | None:
        """Return the first of some runs whose set-point i the arm can get to; None if there is none."""
        for run in runs:
            steps = run.between(i, end)
            way = self._unfolded(i, here, steps[0].candidate)
            if way is not None:
                return JoinedRun(way, steps)
        return None

    def _resumed(self, i: int, end: int, known: JoinedRun) -> JoinedRun:
        """Return a run that a search has extended from where it was stuck."""
        run = self.search.resumed(i, end - i, known.steps, self._ahead)
        return JoinedRun(known.way, run.longest(OPTIONS.max_resumed_candidates))

    def _searched(
        self, i: int, end: int, here: Pose | None, soon: int = OPTIONS.max_stalled_candidates
    ) -> JoinedRun:
        """Return the longest run that a search finds; if that takes long, base and joints move together."""
        way, first = self._arrive(i, here)
        run = self.search.run(i, end - i, first, self._ahead)
        if len(run.longest(soon)) < end - i and soon < OPTIONS.max_stalled_candidates:
            whole = self._together(i, end, here)
            if whole is not None and len(whole.steps) == end - i:
                return whole
        return JoinedRun(way, run.longest())

    def _seeds(self, i: int, here: Pose | None, at: int) -> Iterator[Candidate]:
        """Where a run through a set-point ``at`` may begin that is to lead from set-point i.

        The least motion from here, where M-FABRIK has it, far from joint limits, and where else it is clear.
        """
        sampler, goal = self.search.sampler, self._goal(at)
        kept, start = self._components_at(at, goal), here or goal.pose
        if here is not None and at == i:
            yield from sampler.nearest(at, kept, here)
        yield from sampler.nominal(at, kept, start, goal)
        yield from sampler.far_from_limits(at, kept, goal.pose)
        yield from islice(sampler.arrivals(at, kept, start, goal), OPTIONS.max_candidates)

    def _unfolded(self, i: int, here: Pose | None, first: Candidate) -> list[MotionState] | None:
        """Return the transit to the first state of a run, with the arm folded; None if there is none."""
        search = self.search
        arrived = search.arrive(i, here, [first], search.transits.folded, hard=0)
        return None if arrived is None else arrived[0]

    def _goal(self, i: int) -> Candidate:
        """Return M-FABRIK's solution at a set-point; at the first, without a chain, in its widest area."""
        if i > 0 or self._rolls:
            return self.nominal[i]
        ladder, scene = self.pruned.ladder, self.scene
        kept = self.pruned.components_at(0)
        k = kept[int(np.argmax(shapely.area(ladder.component[kept])))]
        (solver,) = solvers_along(scene, ladder, self.free_space, [k])
        return Candidate(solver(scene.task[0], *start_pose(scene, self.pruned, k)), k)

    def _arrive(self, i: int, here: Pose | None) -> tuple[list[MotionState], Candidate]:
        """Return the transit to a first candidate at set-point i, from the start or the last run."""
        search, goal = self.search, self.nominal[i]
        start = here or goal.pose
        for components in (self._components_at(i, goal), self._cut(i)):
            found = search.sampler.arrivals(i, components, start, goal)
            arrived = search.arrive(i, here, islice(found, OPTIONS.max_candidates), search.transits.folded)
            if arrived is not None:
                return arrived
        raise NoPlanFound(search.why_not(i, here, goal))

    def _ahead(self, i: int, here: Candidate) -> Iterator[Candidate]:
        """Yield candidates at the set-point after i, in components that the base can move to."""
        if i + 1 >= len(self.scene.task):
            return iter(())
        ladder = self.pruned.ladder  # a base may turn into another component where it has come to
        after = set(ladder.group[ladder.ahead[here.component]].tolist())
        goal, sampler = self.nominal[i + 1], self.search.sampler
        components = [k for k in self._components_at(i + 1, goal) if int(ladder.group[k]) in after]
        found = sampler.options(i + 1, components, here.pose, goal, together=bool(here.way))
        return islice(found, OPTIONS.max_candidates)

    def _components_at(self, i: int, goal: Candidate) -> list[int]:
        """Return the components of a set-point that pruning left, that of M-FABRIK's solution first."""
        return sorted(self.pruned.components_at(i), key=lambda k: (k != goal.component, k))

    def _cut(self, i: int) -> list[int]:
        """Return the components that pruning cut: a motion may exist where the areas show none."""
        return self.pruned.ladder.components_at(~self.pruned.keep, i)

    def _refused_lift(
        self, i: int, told: Callable[[Scene, int, str, Cause | None], Explanation]
    ) -> Explanation:
        scene, collision, proximity = self.scene, self.search.collision, self.search.follower.stops.get(i - 1)
        if proximity is None:
            return told(scene, i, "the arm would have to jump", None)
        return told(scene, i, collision.words(proximity), collision.cause(proximity))
