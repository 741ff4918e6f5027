"""Collision-free configurations at a set-point.

First comes the solution of M-FABRIK, and the one that it finds from the present state. Then the arm alone
avoids obstacles, by FABRIK with obstacle-avoiding rotations. Last comes the null space of the whole robot:
places of the base in the area, and postures of the arm at each.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain as one_after_another

import numpy as np
import shapely
from shapely.geometry import Point

from regionik.areas.free_space import FreeSpace, away, into_span, into_spans, spread
from regionik.areas.reachable import reach_model
from regionik.areas.sampled_reach import sampled_reach
from regionik.ladder import Ladder
from regionik.mfabrik import Solver, solver_for
from regionik.moving.base_motion import Candidate
from regionik.moving.options import MOVING
from regionik.moving.path_following import NO_DRAW, Draw, ResolvedMotion
from regionik.planners.avoidance.clear_posture import ClearPosture
from regionik.planners.collision.proximity import Proximity
from regionik.planners.driving.footprint import fits
from regionik.planners.geometry.angles import wrap
from regionik.planners.geometry.polygons import clamp
from regionik.planners.search.box_search import Verdict
from regionik.planners.solvers.aims import in_columns
from regionik.posture_finder import PostureFinder
from regionik.postures.arm import aim_of
from regionik.postures.collision_checker import CollisionChecker
from regionik.postures.poses import Pose, axis_of, facing, pose_of
from regionik.scene import Scene
from regionik.values import Configuration
from regionik.worlds.arms import turned_back
from regionik.worlds.arrays import Array
from regionik.worlds.joints import nearest_turn

OPTIONS = MOVING.sampling


@dataclass(eq=False)
class Evidence:
    """Record of a search at one set-point."""

    places: set[tuple[float, ...]] = field(default_factory=set)  # of the base that were tried, x and y [m]
    postures: int = 0  # that were tried
    clear: int = 0  # how many of the postures were clear
    proven: int = 0  # places at which there is proven to be no clear posture
    best: Proximity | None = None  # of the posture that came nearest to being clear
    room: float = -np.inf  # by how much that one keeps its distance; negative where it does not [m]
    clear_bases: list[Array] = field(default_factory=list)  # poses (3,) of the base in clear postures

    def add(self, base: Array, proximity: Proximity, room: float) -> None:
        """Record a posture that was tried on a base pose (3,)."""
        self.postures += 1
        if proximity.kind == "none":
            self.clear += 1
            if not self.clear_bases or not np.array_equal(base, self.clear_bases[-1]):
                self.clear_bases.append(base)
        if room > self.room:
            self.best, self.room = proximity, room


@dataclass(frozen=True, eq=False)
class ConfigurationSampler:
    """Sampler of collision-free configurations at the set-points of a world."""

    scene: Scene
    collision: CollisionChecker
    ladder: Ladder
    free_space: FreeSpace
    seed: int
    resolved: ResolvedMotion | None = None
    evidence: dict[int, Evidence] = field(default_factory=dict)  # what was looked at, by set-point
    _places: dict[int, Array] = field(default_factory=dict)
    _clear: dict[tuple[int, int], list[Candidate]] = field(default_factory=dict)
    _futile: dict[tuple[int, int], int] = field(default_factory=dict)
    _nearly: dict[int, list[tuple[float, Candidate]]] = field(default_factory=dict)
    _searched: dict[Candidate, list[Candidate]] = field(default_factory=dict)

    def options(
        self, i: int, components: Sequence[int], here: Pose, nominal: Candidate, *, together: bool = False
    ) -> Iterator[Candidate]:
        """Yield collision-free configurations at set-point i in some components, the likeliest first.

        The robot comes from ``here``, and M-FABRIK found the ``nominal`` one, which is far where base and
        joints have gone on ``together`` to here: then they go on so first.
        """
        known = self.nominal(i, components, here, nominal), self.resolved_onward(i, here)
        likely = known[::-1] if together else known
        return self._meeting(*likely, self._sought(i, components, here))

    def arrivals(
        self, i: int, components: Sequence[int], here: Pose, nominal: Candidate
    ) -> Iterator[Candidate]:
        """Yield collision-free configurations like `options`, for a base that arrives with the tool lifted.

        If no nearby posture is clear, others are tried: an arm with its tool lifted may change its posture.
        """
        known = self.nominal(i, components, here, nominal), self.nearest(i, components, here)
        return self._meeting(*known, self._sought(i, components, here))

    def _meeting(self, *found: Iterator[Candidate]) -> Iterator[Candidate]:
        return (candidate for candidate in one_after_another(*found) if self.meets(candidate.pose))

    def meets(self, at: Pose) -> bool:
        """True if a posture at a set-point meets the rules' criteria; those of `Solver` do anyway."""
        criteria = self.scene.rules.criteria
        return criteria is None or reach_model(self.scene.robot, "point").meets(criteria, at.joints)

    def nominal(
        self, i: int, components: Sequence[int], here: Pose, nominal: Candidate
    ) -> Iterator[Candidate]:
        """Yield the solution of M-FABRIK if it is collision-free."""
        reached = nominal.configuration.converged and nominal.component in components
        if reached and self.clear(i, nominal.pose):
            yield from self._turns(nominal, here)

    def far_from_limits(self, i: int, components: Sequence[int], start: Pose) -> Iterator[Candidate]:
        """Yield collision-free configurations at headings all round, those farthest from joint limits first.

        The base is brought under the arm, or as near as its area lets it. Its arm turns back what the base is
        turned, or is in another posture.
        """
        assert self.resolved is not None
        if self.scene.rules.heading == "face_target":
            return
        robot, axis = self.scene.robot, axis_of(self.scene.robot, start.base)
        found = list[tuple[int, float, Candidate]]()
        for yaw in start.base[2] + 2 * np.pi * np.arange(OPTIONS.max_headings) / OPTIONS.max_headings:
            there = [k for k in components if away(wrap(yaw), self._span(k)) == 0]
            for k in self._by_nearness(there, start)[:1]:
                flat = self.ladder.flat(k)
                base = pose_of(robot, np.array(clamp(flat.vertices, flat.starts, *axis)), wrap(yaw))
                at = Pose(base, turned_back(robot.chain, start.joints, wrap(yaw - start.base[2])))
                still = [self.resolved.states.base_parts - 1]
                known = self.nearest(i, components, at, still), self.other_postures(i, base, k)
                here = list(self._meeting(*known))
                rooms = [float(robot.chain.room_to_limits(one.pose.joints)) for one in here]
                ranked = np.argsort(np.negative(rooms), kind="stable").tolist()
                found += [(rank, -rooms[n], here[n]) for rank, n in enumerate(ranked)]
        yield from (one for *_, one in sorted(found, key=lambda ranked: ranked[:2]))

    def nearest(
        self, i: int, components: Sequence[int], start: Pose, still: Sequence[int] = ()
    ) -> Iterator[Candidate]:
        """Yield the collision-free configuration that takes the least motion; see `ResolvedStates.state`."""
        assert self.resolved is not None
        aim = in_columns([aim_of(self.scene.task[i])])
        pose = self.resolved.states.state(aim, start, still, bend=np.inf)
        if pose is None or abs(pose.base[2] - start.base[2]) > np.pi or not self.meets(pose):
            return
        if fits(self.scene.footprint, *pose.base) and self.clear(i, pose):
            found = Configuration(pose.base, pose.joints, 0.0, 0, True)
            yield from (Candidate(found, k) for k in self._by_nearness(components, pose)[:1])

    def _sought(self, i: int, components: Sequence[int], here: Pose) -> Iterator[Candidate]:
        """Yield other collision-free configurations: by M-FABRIK, by avoidance, or elsewhere in the area."""
        if not self.collision.enabled:
            return
        target, near, rest = self.scene.task[i], components, list[int]()
        if len(self.free_space.sides) > 1:  # those of some headings only by nearness
            ordered = self._by_nearness(components, here)
            near, rest = ordered[: OPTIONS.max_near_components], ordered[OPTIONS.max_near_components :]
        for k in near:
            onward = self.solver(k)(target, here.base, here.joints)
            if onward.converged:
                candidate = Candidate(onward, k)
                yield from [candidate] if self.clear(i, candidate.pose) else self.around(i, candidate)
        nothing = True
        for some in (near, *([k] for k in rest)):
            for candidate in one_after_another.from_iterable(self._elsewhere(i, k, here) for k in some):
                nothing = False
                yield candidate
            if not nothing:
                break
        if nothing:
            yield from self._mended(i, near)

    def _by_nearness(self, components: Sequence[int], here: Pose) -> list[int]:
        """Return the components in the order of the base's distance from them."""
        axis, parts = Point(axis_of(self.scene.robot, here.base)), self.ladder.component[list(components)]
        yaw, spans = here.base[2], self._spans[self.ladder.side[list(components)]]
        turns = np.abs(into_spans(np.full(len(spans), yaw), *spans.T) - yaw)
        order = np.argsort(shapely.distance(parts, axis) + OPTIONS.turn_weight * turns, kind="stable")
        return [components[m] for m in order.tolist()]

    def resolved_onward(
        self,
        i: int,
        here: Pose,
        draw: Draw = NO_DRAW,
        *,
        back: bool = False,
        still: Sequence[int] = (),
    ) -> Iterator[Candidate]:
        """Yield the configuration that base and joints reach together by the least motion, in any component.

        They come from the set-point before, or ``back`` from the one after. Areas of set-points far apart
        need not overlap for that, nor need they show where it stands. See `ResolvedMotion.onward`.
        """
        left = i + 1 if back else i - 1
        way = (
            None if self.resolved is None else self.resolved.onward(left, here, draw, back=back, still=still)
        )
        if way is None:
            return
        found = Configuration(way[-1].base, way[-1].joints, 0.0, 0, True)  # measured on arrival
        for k in self._by_nearness(range(*self.ladder.rungs[i : i + 2]), way[-1])[:1]:
            yield Candidate(found, k, tuple(way))

    def other_postures(self, i: int, base: Array, k: int) -> Iterator[Candidate]:
        """Yield collision-free postures at a base pose, from starts sampled within the joint limits."""
        solver, target = self.solver(k, float(base[2])), self.scene.task[i]
        for start in sampled_reach(self.scene.robot).postures(base, target.position, OPTIONS.max_starts):
            one = solver.least_change(target, base, start)
            if one is not None:
                candidate = Candidate(replace(one, base=base), k)
                if self.clear(i, candidate.pose):
                    yield candidate

    def _turns(self, candidate: Candidate, here: Pose) -> Iterator[Candidate]:
        """Yield a candidate, its unlimited joints turned the shorter way from here, then the longer way."""
        chain, found = self.scene.robot.chain, candidate.configuration
        turns = chain.turning & np.isinf(chain.upper - chain.lower)  # without end
        change = found.joints - here.joints
        near = here.joints + np.where(turns, nearest_turn(change), change)
        turned = (near != found.joints).any()
        yield replace(candidate, configuration=replace(found, joints=near)) if turned else candidate
        for k in np.flatnonzero(turns & (np.abs(near - here.joints) > OPTIONS.min_far_turn)).tolist():
            far = near - 2 * np.pi * np.sign(near - here.joints) * (np.arange(chain.dof) == k)
            yield replace(candidate, configuration=replace(found, joints=far))

    def clear(self, i: int, at: Pose) -> bool:
        """True if the arm is collision-free; what it comes near to is recorded as evidence."""
        return not self.collision.enabled or self._room(i, at) == np.inf

    def _room(self, i: int, at: Pose) -> float:
        """Return the margin of the arm's distance, infinite if it is clear; record it as evidence [m]."""
        proximity = self.collision.nearest(at)
        room = self.collision.room(proximity)
        self._seen(i, at.base).add(at.base, proximity, room)
        return room

    def _seen(self, i: int, base: Array) -> Evidence:
        """Return the record of a set-point, with a place of the base added."""
        seen = self.evidence.setdefault(i, Evidence())
        seen.places.add((float(base[0]), float(base[1])))
        return seen

    def around(self, i: int, candidate: Candidate) -> Iterator[Candidate]:
        """Yield candidates on the same base pose whose arm avoids what it collides with."""
        key = i, candidate.component
        if self._futile.get(key, 0) >= OPTIONS.max_futile_tries:
            return
        around = list(self._as_found(i, candidate, self._finder(i).around(candidate.pose)))
        self._futile[key] = 0 if around else self._futile.get(key, 0) + 1
        yield from around

    def _finder(self, i: int) -> PostureFinder:
        return PostureFinder(self.scene, self.scene.task[i], self.collision, self.seed)

    def _as_found(self, i: int, candidate: Candidate, found: ClearPosture) -> Iterator[Candidate]:
        """Yield the candidate as found, if clear, its base turned if it must face the target."""
        self._seen(i, candidate.configuration.base).proven += found.verdict == Verdict.RULED_OUT
        if found.joints is None:
            return
        at = Pose(candidate.configuration.base, found.joints)
        if self.scene.rules.heading == "face_target":
            at = facing(self.scene.robot, at)
            if away(float(at.base[2]), self._span(candidate.component)) > 0:
                return
        if self.clear(i, at):
            reached = replace(candidate.configuration, base=at.base, joints=at.joints, error=found.error)
            yield replace(candidate, configuration=reached)

    def _elsewhere(self, i: int, k: int, here: Pose) -> Iterator[Candidate]:
        """Yield collision-free postures at places of the base in a component, near places first."""
        axis = axis_of(self.scene.robot, here.base)
        places = self._spread(k)
        for m in np.argsort(np.hypot(*(places - axis).T), kind="stable").tolist():
            found = self._at(i, k, m)
            change = [
                float(np.abs(candidate.configuration.joints - here.joints).max()) for candidate in found
            ]
            for n in np.argsort(change, kind="stable")[: OPTIONS.max_postures_per_place].tolist():
                yield found[n]

    def _mended(self, i: int, components: Sequence[int]) -> Iterator[Candidate]:
        """Yield the postures nearest to being clear after avoidance, then all postures at their places."""
        nearly = [one for k in components for one in self._nearly.get(k, [])]
        nearly = sorted(nearly, key=lambda one: -one[0])[: OPTIONS.max_mended]
        nearest = [candidate for _, candidate in nearly]
        for candidate in nearest:
            yield from self.around(i, candidate)
        for candidate in nearest[: OPTIONS.max_searched]:
            if candidate not in self._searched:  # from wherever the robot comes it is the same search
                found = self._finder(i).thorough(candidate.pose, OPTIONS.max_boxes)
                self._searched[candidate] = list(self._as_found(i, candidate, found))
            yield from self._searched[candidate]

    def _at(self, i: int, k: int, m: int) -> list[Candidate]:
        """Return all collision-free postures at one place; they are computed once."""
        key = (k, m)
        if key not in self._clear:
            target, place = self.scene.task[i], self._spread(k)[m]
            base = pose_of(self.scene.robot, place, self._heading(k, target.position, place))
            found = self.solver(k).self_motion(target, base, self.scene.robot.carry, OPTIONS.max_pitches)
            self._seen(i, base)
            candidates = [Candidate(one, k) for one in found]
            rooms = [self._room(i, candidate.pose) for candidate in candidates]
            self._clear[key] = [
                candidate for candidate, room in zip(candidates, rooms, strict=True) if room == np.inf
            ]
            if candidates and not self._clear[key]:
                best = int(np.argmax(rooms))
                self._nearly.setdefault(k, []).append((rooms[best], candidates[best]))
        return self._clear[key]

    def _heading(self, k: int, target: Array, axis: Array) -> float:
        """Return the heading of a component that is nearest to that towards the target."""
        return into_span(float(np.arctan2(*(target[:2] - axis)[::-1])), self._span(k))

    def _span(self, k: int) -> tuple[float, float]:
        """Return the range of headings of a component [rad]."""
        return self.free_space.sides[int(self.ladder.side[k])].span

    @cached_property
    def _spans(self) -> Array:
        """Headings of each side, (s, 2) [rad]."""
        return np.array([side.span for side in self.free_space.sides])

    def solver(self, k: int, heading: float | None = None) -> Solver:
        """Return M-FABRIK inside a component, at one heading or any of its slab."""
        solver = solver_for(self.scene, self.ladder.family[k], self.ladder.flat(k), self._span(k))
        return solver if heading is None else replace(solver, span=(heading, heading))

    def _spread(self, k: int) -> Array:
        if k not in self._places:
            self._places[k] = spread(self.ladder.component[k], OPTIONS.max_places, self.seed)
        return self._places[k]
