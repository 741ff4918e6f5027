"""Runs of set-points with base and joints moving together, grown from a configuration towards both ends.

A motion with the tool on its path may be gone through either way, so a run need not begin where the path
does. Where the farthest run is stuck, and where the areas are narrowest, others are begun, and grow back to
where it began and onward past there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from regionik.moving.base_motion import Candidate
from regionik.moving.options import MOVING
from regionik.moving.path_following import Draw
from regionik.moving.path_search import PathSearch, SearchStep
from regionik.planners.progress import tell
from regionik.planners.tries import count_tries
from regionik.postures.poses import MotionState, Pose
from regionik.worlds.arrays import Array

OPTIONS = MOVING.runs

Seeds = Callable[[int], Iterator[Candidate]]  # configurations at a set-point, the likeliest first


@dataclass(frozen=True, eq=False)
class GrownRun:
    """Configurations at consecutive set-points, each with the states that connect it to the one before."""

    first: int  # set-point
    steps: list[SearchStep]

    @property
    def end(self) -> int:
        """Set-point after the last."""
        return self.first + len(self.steps)

    def between(self, i: int, end: int) -> list[SearchStep]:
        """Return the steps of some of its set-points; the first has no states before it."""
        first, *others = self.steps[i - self.first : end - self.first]
        return [_begun(first.candidate), *others]


@dataclass(frozen=True, eq=False)
class RunGrowth:
    """Growth of runs, with those that were grown before."""

    search: PathSearch
    still: Sequence[int] = ()  # coordinates of the base's motion that stay as they are
    # Place (2,) of the arm axis that the base is drawn to, by set-point
    guide: Callable[[int], Array] | None = None
    known: list[GrownRun] = field(default_factory=list)

    @property
    def passed(self) -> int:
        """Number of set-points that all its runs have passed through."""
        return sum(len(run.steps) for run in self.known)

    def runs_from(self, i: int, end: int, seeds: Seeds, begins: Sequence[int]) -> Iterator[GrownRun]:
        """Yield runs through set-point i towards ``end``, none of which gets less far than one before.

        They begin at some set-points, and where the farthest is stuck as long as that leads farther. After a
        whole one there may be more, where that one does not do.
        """
        farthest = known = i
        for run in self._through(i):
            farthest = known = run.end
            yield run
        begun = set[int]()
        while farthest < end or farthest == known:
            left = [k for k in (farthest, *begins) if k not in begun and (farthest > known or k in begins)]
            if not left:
                break
            at, passed, before = left[0], list[int](), farthest
            begun.add(at)
            for seed in seeds(at):
                run = self._grown(at, seed, range(i, end))
                self.known.append(run)
                passed.append(len(run.steps))
                if run.first == i and run.end >= farthest:
                    farthest = run.end
                    tell("run", farthest - i, end - i)
                    yield run
                if (at > i and before < farthest < end) or self._in_vain(passed):
                    break

    def _through(self, i: int) -> list[GrownRun]:
        """Return the known runs through a set-point, the one that gets farthest last."""
        return sorted((run for run in self.known if run.first <= i < run.end), key=lambda run: run.end)

    def _in_vain(self, passed: list[int]) -> bool:
        """True if no more seeds are to be tried, by the set-points that earlier runs passed through."""
        return sum(passed) > max(
            OPTIONS.min_setpoint_budget,
            OPTIONS.setpoint_budget_factors[self.search.scene.robot.drive.rolls] * max(passed),
        )

    def _grown(self, i: int, seed: Candidate, within: range) -> GrownRun:
        """Return the run through a configuration at set-point i, inside a range of set-points."""
        home = self._home(seed)
        before = self._continued(seed, range(i - 1, within.start - 1, -1), home)
        after = self._continued(seed, range(i + 1, within.stop), home)
        first = i - len(before)
        met = [seed, *before][::-1]
        steps = [_begun(met[0])]
        for k, (here, there) in enumerate(pairwise(met), first):  # its way leads back from there to here
            steps.append(_step(k, [*here.way[-2::-1]], there))
        steps += [_step(k, there.way[:-1], there) for k, there in enumerate(after, i)]
        return GrownRun(first, steps)

    def _continued(self, here: Candidate, setpoints: range, home: Array | None) -> list[Candidate]:
        """Return configurations at set-points that base and joints reach together, as far as they do."""
        found = list[Candidate]()
        for k in setpoints:
            count_tries()
            draw = Draw(home, None if self.guide is None else self.guide(k))
            there = self.search.resolved_candidate(k, here, draw, back=setpoints.step < 0, still=self.still)
            if there is None:
                break
            found.append(there)
            here = there
        return found

    def _home(self, seed: Candidate) -> Array | None:
        """Return the joints that a run tends back to: those of its first configuration, off their limits.

        On wheels the base cannot make room for that at once.
        """
        if self.search.scene.robot.drive.rolls:
            return None
        chain = self.search.scene.robot.chain
        room = np.where(
            np.isfinite(chain.upper - chain.lower), OPTIONS.min_limit_share * (chain.upper - chain.lower), 0.0
        )
        home: Array = np.clip(seed.configuration.joints, chain.lower + room, chain.upper - room)
        return home


def _begun(first: Candidate) -> SearchStep:
    return SearchStep(first, [], iter(()))


def _step(i: int, way: Sequence[Pose], there: Candidate) -> SearchStep:
    """Return the step from set-point i to a candidate at the next, with the states strictly between."""
    return SearchStep(there, [MotionState(pose, "step", i) for pose in way], iter(()))
