"""Depth-first search through clear configurations, from set-point to set-point.

In a step the tool goes on along its path from a candidate at one set-point to one at the next. Where no step
leads on, the last one is taken back; the longest run is kept. Where that ends, the tool is lifted and carried
to a candidate from which the next run begins.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from regionik.areas.free_space import FreeSpace
from regionik.explain import arm_failures, failures
from regionik.explain.cut_off import Barrier, barrier, poses_in, walled_off
from regionik.ladder import Ladder
from regionik.moving.base_motion import Candidate, StationaryPaths
from regionik.moving.configuration_sampling import ConfigurationSampler, Evidence
from regionik.moving.drivers import driver_for
from regionik.moving.options import MOVING
from regionik.moving.path_following import Draw, PathFollower, ResolvedMotion
from regionik.moving.transit import TransitPlanner
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.progress import tell
from regionik.planners.tries import count_tries
from regionik.postures.collision_checker import CollisionChecker
from regionik.postures.poses import MotionState, Pose, arrays, axis_of, lifted_states, untimed_motion
from regionik.scene import Scene
from regionik.values import Configuration, Motion
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Cause, Explanation, NoPlanFound

OPTIONS = MOVING.runs

Ahead = Callable[[int, Candidate], Iterator[Candidate]]
Carry = Callable[[Pose, Pose, int], list[Pose] | None]


@dataclass(frozen=True, eq=False)
class JoinedMotion:
    """Configurations joined to one motion."""

    motion: Motion
    setpoints: tuple[Configuration, ...]  # as the motion passes them: the arm re-solved along the way
    methods: dict[str, int]  # how many base moves each method of `drive` made


@dataclass(frozen=True, eq=False)
class SearchStep:
    """A candidate of a run, the states that lead to it, and the candidates that may follow."""

    candidate: Candidate
    states: list[MotionState]
    ahead: Iterator[Candidate]


@dataclass(frozen=True, eq=False)
class PathSearch:
    """Search for runs, with the sampler, follower and transit planner that it uses."""

    scene: Scene
    sampler: ConfigurationSampler
    follower: PathFollower
    transits: TransitPlanner

    @property
    def collision(self) -> CollisionChecker:
        return self.sampler.collision

    def start(self) -> list[MotionState]:
        """Return the state that the robot starts in, if any; raise NoPlanFound if its arm collides there."""
        start, collision = self.scene.start, self.collision
        if start is None:
            return []
        here = Pose(start.base, start.joints)
        proximity = collision.nearest(here)
        if collision.enabled and proximity.kind != "none":
            raise NoPlanFound(
                arm_failures.blocked_arm(self.scene, collision.words(proximity), collision.cause(proximity))
            )
        return [MotionState(here, "transit", -1)]

    def arrive(
        self,
        i: int,
        here: Pose | None,
        candidates: Iterable[Candidate],
        plain: Carry,
        hard: int = OPTIONS.max_whole_body_tries,
    ) -> tuple[list[MotionState], Candidate] | None:
        """Get to a candidate at set-point i with the tool lifted; without ``here`` the robot begins there.

        ``plain`` plans transits to all; to the few of the least bend a ``hard`` one is searched for with base
        and arm.
        """
        if here is None:
            return next((([], candidate) for candidate in candidates), None)
        floor = self.sampler.ladder.floor
        for candidate, way in self._transits(here, candidates, plain, hard):
            if way is None:
                continue
            way = self.transits.shortened(here, way, candidate.pose, int(floor[candidate.component]))
            return lifted_states(here, way, candidate.pose, i - 1, self.scene.robot.drive), candidate
        return None

    def _transits(
        self, here: Pose, candidates: Iterable[Candidate], plain: Carry, hard: int
    ) -> Iterator[tuple[Candidate, list[Pose] | None]]:
        floor, asked = self.sampler.ladder.floor, list[Candidate]()
        for candidate in candidates:
            count_tries()
            asked.append(candidate)
            yield candidate, plain(here, candidate.pose, int(floor[candidate.component]))
        asked.sort(key=lambda one: float(np.abs(one.configuration.joints - here.joints).max()))
        for candidate in asked[:hard]:
            count_tries()
            yield candidate, self.transits.sampled(here, candidate.pose, int(floor[candidate.component]))

    def run(self, i: int, count: int, first: Candidate, ahead: Ahead) -> RunSearch:
        """The search for a run from a candidate at set-point i, over ``count`` set-points at most.

        Given a set-point and a candidate there, ``ahead`` has those of the next one, the likeliest first.
        """
        return self.resumed(i, count, [SearchStep(first, [], iter(()))], ahead)

    def resumed(self, i: int, count: int, steps: Sequence[SearchStep], ahead: Ahead) -> RunSearch:
        """The search for a run that goes on where steps from set-point i have led, or back from there."""
        own = [replace(step, ahead=ahead(k, step.candidate)) for k, step in enumerate(steps, i)]
        return RunSearch(self, i, count, ahead, own, list(own))

    def step(self, k: int, here: Candidate, goal: Candidate, ahead: Ahead) -> SearchStep | None:
        """Return the step from a candidate to one at set-point k; None if the tool cannot follow its path."""
        states = [MotionState(pose, "step", k - 1) for pose in goal.way] or self._followed(k - 1, here, goal)
        if states is None or not self.sampler.meets(states[-1].pose):  # the arm is solved anew on the way
            return None
        arrived = self._arrived(k, goal, states[-1].pose)
        return SearchStep(arrived, states[:-1], ahead(k, arrived))

    def resolved_candidate(
        self, k: int, here: Candidate, draw: Draw, *, back: bool, still: Sequence[int]
    ) -> Candidate | None:
        """Return the candidate at set-point k that base and joints reach together; None if they do not.

        They come from the set-point before it, or ``back`` from the one after. See `ResolvedMotion.onward`.
        """
        found = next(self.sampler.resolved_onward(k, here.pose, draw, back=back, still=still), None)
        if found is None or not self.sampler.meets(found.pose):
            return None
        return self._arrived(k, found, found.pose)

    def _followed(self, i: int, here: Candidate, goal: Candidate) -> list[MotionState] | None:
        """Return the motion from set-point i to the next; a base outside its areas is proven free."""
        states, resolved = self.follower.follow(i, here, goal), self.sampler.resolved
        if states is None or resolved is None or self._in_area(here):
            return states
        return states if resolved.drives([here.pose, *(state.pose for state in states)]) else None

    def _in_area(self, one: Candidate) -> bool:
        axis = axis_of(self.scene.robot, one.pose.base)
        return self.sampler.ladder.flat(one.component).holds(axis)

    def _arrived(self, i: int, candidate: Candidate, pose: Pose) -> Candidate:
        """Return the candidate as the motion reaches it; the iterations stay those of M-FABRIK."""
        tool: Array = self.collision.tools(*arrays([pose, pose]), np.zeros(1))[0, 0, :3, 3]
        error = math.dist(tool, self.scene.task[i].position)
        good = error <= self.scene.rules.tolerance
        found = replace(
            candidate.configuration, base=pose.base, joints=pose.joints, error=error, converged=good
        )
        return replace(candidate, configuration=found)

    def joined(self, states: list[MotionState], candidates: list[Candidate]) -> JoinedMotion:
        """Return the motion of a finished search."""
        methods = dict(sorted(self.transits.driver.methods.items()))
        return JoinedMotion(
            untimed_motion(states), tuple(candidate.configuration for candidate in candidates), methods
        )

    def why_not(self, i: int, here: Pose | None, goal: Candidate | None = None) -> Explanation:
        """Explain what stands in the arm's way at set-point i, or on the way there from ``here``."""
        collision, seen = self.collision, self.sampler.evidence.get(i, Evidence())
        if not seen.postures:
            return arm_failures.no_posture(self.scene, i)
        if here is None and seen.clear:
            return arm_failures.no_fitting_posture(self.scene, i, seen.clear, seen.postures)
        proximity, cut_off = seen.best, here is not None and seen.clear > 0
        walls = None if here is None else self._walls(i, here, seen)
        if walls is not None:
            closest = "" if proximity is None or proximity.kind == "none" else collision.words(proximity)
            return walled_off(self.scene, i, walls, closest)
        if cut_off and self.transits.refusals:
            return failures.no_drive(self.scene, i, self.transits.refusals[0])
        if here is not None and cut_off and goal is not None:
            try:
                piece = int(self.sampler.ladder.floor[goal.component])
                proximity = self.transits.obstruction(here, goal.pose, piece)
            except NoPathError as refusal:  # it drives to other places of this set-point only
                return failures.no_drive(self.scene, i, refusal)
        closest, cause = "no single thing stands in the way", Cause("limits", self.scene.robot.name)
        if proximity is not None and proximity.kind != "none":
            closest, cause = collision.words(proximity), collision.cause(proximity)
        looked = len(seen.places), seen.postures, seen.proven
        return arm_failures.no_clear_posture(self.scene, i, looked, closest, cause, cut_off=cut_off)

    def _walls(self, i: int, here: Pose, seen: Evidence) -> Barrier | None:
        """Return what cuts off the floor from which alone the arm is clear at set-point i, if anything."""
        ladder, free_space, robot = self.sampler.ladder, self.sampler.free_space, self.scene.robot

        def piece(base: Array) -> int | None:
            return free_space.piece_at(axis_of(robot, base), float(base[2]))

        own = piece(here.base)
        if any(piece(base) == own for base in seen.clear_bases):
            return None
        beyond = (ladder.target == i) & (ladder.floor != own)
        if not beyond.any():
            return None
        at = np.array([*axis_of(robot, here.base), here.base[2]])
        return barrier(self.scene, at, poses_in(free_space, ladder.component[beyond], ladder.side[beyond]))


@dataclass(eq=False)
class RunSearch:
    """Search for a run from one candidate, which can be resumed where it stopped."""

    search: PathSearch
    first: int  # set-point where the run begins
    count: int  # of set-points, at most
    ahead: Ahead
    steps: list[SearchStep]  # as far as it is now
    best: list[SearchStep]
    tried: int = 0  # candidates since it got farther
    seen: set[Candidate] = field(default_factory=set)

    def longest(self, patience: int = OPTIONS.max_stalled_candidates) -> list[SearchStep]:
        """Return the longest run found when so many candidates have been tried without progress."""
        tell("run", len(self.best), self.count)
        while self.steps and len(self.best) < self.count and self.tried < patience:
            candidate = next(self.steps[-1].ahead, None)
            if candidate is None:
                self.steps.pop()
            elif candidate not in self.seen:
                self._try(candidate)
        tell("run", self.count, self.count)
        return self.best

    def _try(self, candidate: Candidate) -> None:
        count_tries()
        self.tried += 1
        k = self.first + len(self.steps)
        step = self.search.step(k, self.steps[-1].candidate, candidate, self.ahead)
        if step is None:
            return
        self.seen.add(candidate)
        self.steps.append(step)
        if len(self.steps) > len(self.best):
            self.best, self.tried = list(self.steps), 0
            tell("run", len(self.best), self.count)


def path_search(scene: Scene, ladder: Ladder, free_space: FreeSpace, seed: int) -> PathSearch:
    """Return the search of a world whose base moves with the tool."""
    search = search_from_places(scene, ladder, free_space, seed)
    follower = replace(search.follower, paths=search.transits.driver.paths(ladder))
    sampler = replace(search.sampler, resolved=ResolvedMotion(scene, search.collision))
    return replace(search, sampler=sampler, follower=follower)


def search_from_places(scene: Scene, ladder: Ladder, free_space: FreeSpace, seed: int) -> PathSearch:
    """Return the search of a world whose base is stationary while the tool is on its path."""
    collision = scene.collision
    return PathSearch(
        scene,
        ConfigurationSampler(scene, collision, ladder, free_space, seed),
        PathFollower(scene, ladder, collision, StationaryPaths(scene)),
        transit_planner(scene, free_space, seed),
    )


def transit_planner(scene: Scene, free_space: FreeSpace, seed: int) -> TransitPlanner:
    """Return the planner of motions with the tool lifted."""
    return TransitPlanner(scene, scene.collision, driver_for(scene, free_space, seed))
