"""Following of the tool path from one set-point to the next by base and arm.

The base moves as `base_motion.BasePaths` offers; the arm is solved along the way so that the tool keeps to
its own and nothing jumps. Or both are solved together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from regionik.ladder import Ladder
from regionik.mfabrik import Solver, solver_between
from regionik.moving.base_motion import BasePath, BasePaths, Candidate
from regionik.moving.options import MOVING
from regionik.moving.resolved_states import ResolvedStates
from regionik.planners.collision.proximity import Proximity
from regionik.planners.driving.footprint import arc_is_free, slide_is_free
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.geometry.angles import wrap
from regionik.planners.geometry.polylines import between, laid_out
from regionik.planners.solvers.aims import in_columns
from regionik.postures.arm import aim_of, deviation, goal_between, goals_between
from regionik.postures.collision_checker import CollisionChecker
from regionik.postures.families import Family
from regionik.postures.poses import (
    MAX_JOINT_CHANGE,
    MotionState,
    Pose,
    arrays,
    axis_of,
    configuration_pose,
    pose_of,
)
from regionik.scene import Scene
from regionik.values import Configuration
from regionik.worlds.arms import pivot_index, reach_bound, with_pivot
from regionik.worlds.arrays import Array, Index
from regionik.worlds.scene import Target

OPTIONS = MOVING.following
TURN_SLACK = 1e-7  # rounding allowed at the edge of a cone [rad]
CHECKED_SHARES = np.array([0.25, 0.5, 0.75])  # shares of the way between two states


class SegmentPoint(NamedTuple):
    """A place on a way: the leg, the share of it, and how often the hop to there was halved."""

    leg: int
    share: float
    depth: int = 0


@dataclass(frozen=True, eq=False)
class PathSegment:
    """Motion of base, tool and arm from one set-point to the next, even from knot to knot of its way."""

    base: BasePath
    goals: tuple[Target, Target]  # at both set-points
    joints: Array  # (2, dof) postures wished for there
    family: tuple[Family, Family]
    stride: float  # longest part of the base's way, or of the tool's, between two states [m]
    _targets: dict[SegmentPoint, Target] = field(default_factory=dict)

    @property
    def bare(self) -> bool:
        """True if the orientation of the tool is free."""
        return self.goals[0].direction is None and self.goals[1].direction is None

    @property
    def points(self) -> Array:
        """Return the positions of the tool at every knot, (k, 3) [m]."""
        return self._laid[0]

    @property
    def wished(self) -> Array:
        """Return the preferred joints at every knot, (k, dof)."""
        return self._laid[1]

    def places(self) -> list[SegmentPoint]:
        """Places a stride apart at most, all knots but the first among them."""
        leg, share = self._laid[2:]
        return [SegmentPoint(*one) for one in zip(leg.tolist(), share.tolist(), strict=True)]

    @cached_property
    def _laid(self) -> tuple[Array, Array, Index, Array]:
        spots = np.array([target.position for target in self.goals])
        return laid_out(self.base.knots, self.base.tool, spots, self.joints, self.stride)

    def target(self, at: SegmentPoint) -> Target:
        """Target of the tool at a place; its axis or frame turns evenly."""
        if at not in self._targets:
            self._targets[at] = goal_between(self._at_knots[at.leg], self._at_knots[at.leg + 1], at.share)
        return self._targets[at]

    @cached_property
    def _at_knots(self) -> list[Target]:
        return [goal_between(*self.goals, tool) for tool in self.base.tool.tolist()]

    def families(self, at: SegmentPoint) -> list[Family]:
        """Posture families at both ends of a leg."""
        return [self.family[round(tool)] for tool in self.base.tool[at.leg : at.leg + 2].tolist()]

    def wish(self, near: Pose, here: SegmentPoint, at: SegmentPoint) -> Array:
        """Joints wished for at a place by an arm that comes from another, (dof,).

        They change as those of the segment do, from where the arm is: one that was led round something does
        not jump back.
        """
        was, wished = between(self.wished, *_columns([here, at]))
        joints: Array = near.joints + wished - was
        return joints

    def pitch(self, at: SegmentPoint) -> float:
        """Pitch of the last link at a place [rad]."""
        first, last = (family.pitch for family in self.families(at))
        return first + at.share * wrap(last - first)


@dataclass(frozen=True, eq=False)
class PathFollower:
    """Follower of the tool path."""

    scene: Scene
    ladder: Ladder
    collision: CollisionChecker
    paths: BasePaths
    # What the arm met first on the way on from a set-point
    stops: dict[int, Proximity] = field(default_factory=dict)
    _solvers: dict[Family, Solver] = field(default_factory=dict)

    def follow(self, i: int, here: Candidate, goal: Candidate) -> list[MotionState] | None:
        """From set-point i to i + 1; None where the arm would have to jump, or would touch something."""
        ends = self.scene.task[i], self.scene.task[i + 1]
        joints = np.array([here.configuration.joints, goal.configuration.joints])
        families = self.ladder.family[here.component], self.ladder.family[goal.component]
        stride = min(OPTIONS.tool_stride, self.scene.rules.step)
        try:
            for base in self.paths.between(here.component, goal.component, here.pose.base, goal.pose.base):
                segment = PathSegment(base, ends, joints, families, stride)
                found = self._states(segment, here.pose, goal.pose)
                if isinstance(found, Proximity):
                    self.stops.setdefault(i, found)
                    return None
                if found is not None:
                    return [MotionState(one, "step", i) for one in found]
        except NoPathError:
            pass
        return None

    def _states(self, segment: PathSegment, here: Pose, goal: Pose) -> list[Pose] | Proximity | None:
        """States on a way that keep the tool to its own and the arm clear, or what the arm would touch.

        What holds is taken, up to a hop that does not: that one is halved, as often as it may help. The last
        state is solved anew as the others are; where nothing is smoothed it is the goal as it was found.
        """
        ahead = segment.places()[::-1]  # the next one last
        passed, at = [here], SegmentPoint(0, 0.0)
        before = at
        while ahead:
            tried = [at, *ahead[: -OPTIONS.max_states_at_once - 1 : -1]]
            states, missing = self._solved(segment, tried, passed[-1])
            count, proximity = self._proven(segment, tried[: len(states) + 1], [passed[-1], *states])
            passed += states[:count]
            before = tried[count - 1] if count else before
            at, ahead = tried[count], ahead[: len(ahead) - count]
            if count == len(states) and not missing:
                continue
            if count == len(states):  # a place out of reach: it is so however the tool comes there
                return None
            leg, share, depth = ahead.pop()
            if proximity is not None and (
                depth >= OPTIONS.max_proof_halvings or not self.collision.clear(states[count])
            ):
                return proximity
            if depth >= OPTIONS.max_segment_halvings:
                return None
            done = at.share if at.leg == leg else 0.0
            ahead += [SegmentPoint(leg, share, depth + 1), SegmentPoint(leg, (done + share) / 2, depth + 1)]
        if not self.scene.rules.smooth and self._proven(segment, [before, at], [passed[-2], goal])[0]:
            passed[-1] = goal
        return passed[1:]

    def _solved(self, segment: PathSegment, tried: list[SegmentPoint], near: Pose) -> tuple[list[Pose], bool]:
        """States at all places but the first, where it is ``near``, and whether the next was not found.

        All of them where one compiled call finds them, else one.
        """
        here, *places = tried
        solver = self._solver(segment.families(places[0])[0])
        if not (segment.bare and solver.compiled):
            state = _solve(solver, segment, places[0], near, segment.wish(near, here, places[0]))
            if state is None or not self.collision.proves(state, MOVING.solving.spare_clearance):
                state = self._avoiding(segment, places[0], near) or state
            return ([], True) if state is None else ([state], False)
        leg, share = _columns(places)
        points, wished = (between(knots, leg, share) for knots in (segment.points, segment.wished))
        rows = points, segment.base.places(leg, share), wished
        found = solver.along(*rows, MAX_JOINT_CHANGE / 2, near.base, near.joints)
        states = [Pose(*state) for state in zip(*found, strict=True)]
        return states, len(states) < len(places)

    def _avoiding(self, segment: PathSegment, at: SegmentPoint, near: Pose) -> Pose | None:
        """Return the state at one place whose arm avoids its collision; a free heading adapts."""
        place = segment.base.places(*_columns([at]))[0]
        bound = not np.isnan(place[2])
        base = place if bound else pose_of(self.scene.robot, place[:2], near.base[2])
        still = range(self._resolved.base_parts if bound else 2)
        return self._resolved.state(in_columns([aim_of(segment.target(at))]), Pose(base, near.joints), still)

    @cached_property
    def _resolved(self) -> ResolvedStates:
        return ResolvedStates(self.scene, self.collision)

    def _proven(
        self, segment: PathSegment, places: list[SegmentPoint], poses: list[Pose]
    ) -> tuple[int, Proximity | None]:
        line = between(segment.points, *_columns(places))
        goals = [] if segment.bare else [segment.target(place) for place in places]
        return proven_hops(self.collision, poses, line, goals)

    def _solver(self, family: Family) -> Solver:
        """Solver for what lies between set-points, kept for families that are asked for again."""
        if family not in self._solvers:
            solver = solver_between(self.scene, family)
            tolerance = solver.tolerance * OPTIONS.solve_tolerance_share
            self._solvers[family] = replace(solver, tolerance=tolerance)
        return self._solvers[family]


class Draw(NamedTuple):
    """Where base and joints are drawn to, as far as the tool leaves them free."""

    joints: Array | None = None  # (dof,)
    # (2,) of the arm axis of a base that does not roll, when the tool is at the next set-point [m]
    place: Array | None = None


NO_DRAW = Draw()


@dataclass(frozen=True, eq=False)
class ResolvedMotion:
    """Base and arm go on together by the least motion, by their speeds, that leads the tool on its path.

    Where an arm has few joints, the places from which a base of some heading meets a pose lie on a line,
    which no lattice of places finds; where it has many, postures found place by place may be of another kind
    each.
    """

    scene: Scene
    collision: CollisionChecker

    def onward(
        self,
        i: int,
        here: Pose,
        draw: Draw = NO_DRAW,
        *,
        back: bool = False,
        still: Sequence[int] = (),
    ) -> list[Pose] | None:
        """States with the tool on its path from set-point i to the next, or ``back`` to the one before.

        None where no such way is free. What redundancy leaves open goes where it is drawn to, and some
        coordinates of the base's motion stay ``still``. A hop that is not proven is halved, as often as it
        may help.
        """
        a, b = self.scene.task[i], self.scene.task[i - 1 if back else i + 1]
        count = self._count(a, b)
        # share that is not halved
        least = 0.5 ** (OPTIONS.max_hop_halvings[self.scene.robot.drive.rolls] - 0.5) / count
        ahead, passed, at = list(np.arange(count, 0, -1) / count), [here], 0.0  # the next share last
        while ahead:
            tried = [at, *ahead[: -OPTIONS.max_states_at_once - 1 : -1]]
            goals = _goals(a, b, tried)
            states = self._states_along(goals, np.array(tried), passed[-1], draw, still)
            done = self._valid_hops(goals[: len(states)], states)
            passed += states[1 : done + 1]
            at = tried[done]
            del ahead[len(ahead) - done :]
            if done < len(tried) - 1:
                if ahead[-1] - at < least:
                    return None
                ahead.append((at + ahead[-1]) / 2)
        return passed[1:]

    def _states_along(
        self, goals: list[Target], shares: Array, near: Pose, draw: Draw, still: Sequence[int]
    ) -> list[Pose]:
        """States at targets from ``near`` at the first, one from the other, as far as they are found."""
        states, parts = [near], np.diff(shares) / (1 - shares[:-1])  # of what is left of the way
        for target, part in zip(goals[1:], parts.tolist(), strict=True):
            wished = self._wished(states[-1], draw, part)
            pose = self.states.state(in_columns([aim_of(target)]), states[-1], still, wished=wished)
            if pose is None or math.dist(states[-1].base[:2], pose.base[:2]) > self.scene.rules.step:
                break
            states.append(pose)
        return states

    def _wished(self, here: Pose, draw: Draw, part: float) -> Array:
        """Motion (m,) that a draw wishes for, on a part of the way that is left to the set-point."""
        parts, wished = self.states.base_parts, np.zeros(self.states.base_parts + len(here.joints))
        if draw.place is not None:
            way = draw.place - axis_of(self.scene.robot, here.base)
            most = MOVING.solving.max_drawn_share * self.scene.rules.step
            wished[:2] = way * min(part, most / max(math.hypot(*way), most))
        if draw.joints is not None:
            wished[parts:] = MOVING.solving.homeward_share * (draw.joints - here.joints)
        return wished

    @cached_property
    def states(self) -> ResolvedStates:
        return ResolvedStates(self.scene, self.collision)

    def _count(self, a: Target, b: Target) -> int:
        """Number of hops from one set-point to the next, a stride at most each."""
        turn = 0.0
        if a.direction is not None and b.direction is not None:
            turn = math.acos(min(max(float(a.direction @ b.direction), -1.0), 1.0))
        stride = min(OPTIONS.tool_stride, OPTIONS.reach_stride * reach_bound(self.scene.robot.chain).length)
        steps = math.dist(a.position, b.position) / stride, turn / OPTIONS.turn_stride
        return max(1, *map(math.ceil, steps))

    def drives(self, poses: list[Pose]) -> bool:
        """Whether the base's way through poses is proven free."""
        bases, _ = arrays(poses)
        drive, room = self.scene.robot.drive, self.scene.footprint
        hops = zip(bases[:-1], bases[1:], drive.rolled(bases), np.diff(bases[:, 2]), strict=True)
        return all(
            arc_is_free(room, a, float(rolled), float(turn)) if drive.rolls else slide_is_free(room, a, b)
            for a, b, rolled, turn in hops
        )

    def _valid_hops(self, goals: list[Target], poses: list[Pose]) -> int:
        """Number of hops on which the base's way is free, and the tool led along its path, the arm clear."""
        line = np.array([target.position for target in goals])
        count = proven_hops(self.collision, poses, line, goals)[0]
        while count and not self.drives(poses[: count + 1]):
            count -= 1
        return count


def _goals(a: Target, b: Target, shares: list[float]) -> list[Target]:
    """Targets at shares of the way between two; at its ends all that is asked for there."""
    ends = {0.0: a, 1.0: b}
    between_them = goals_between(a, b, np.array(shares))
    return [ends.get(share, goal) for share, goal in zip(shares, between_them, strict=True)]


def proven_hops(
    collision: CollisionChecker, poses: list[Pose], line: Array, goals: list[Target]
) -> tuple[int, Proximity | None]:
    """Return the number of hops that follow the path, do not jump and are clear, and what stops the next.

    The tool goes along a ``line`` (n, 3), turned as ``goals`` in each of n poses, if in any.
    """
    bases, joints = arrays(poses)
    sag = OPTIONS.sag_share * collision.rules.planned_path_tolerance
    count = collision.count_on_line(bases, joints, line, CHECKED_SHARES, sag)
    if goals:
        tools = collision.tools(bases[: count + 1], joints[: count + 1], CHECKED_SHARES)
        turned = [follows_orientation(*hop) for hop in zip(goals[:-1], goals[1:], tools, strict=False)]
        count = [*turned, False].index(False)
    return collision.proven(bases[: count + 1], joints[: count + 1])


def follows_orientation(p: Target, q: Target, tools: Array) -> bool:
    """True if tool frames between two targets, at `CHECKED_SHARES`, are oriented as these ask."""
    if p.direction is None or q.direction is None:
        return True
    goals = goals_between(p, q, CHECKED_SHARES)
    off = [deviation(one, tool[:3, :3]) for one, tool in zip(goals, tools, strict=True)]
    between_them = abs(off[0] - 2 * off[1] + off[2]) / 8  # that a parabola rises above these three
    return all(angle + between_them <= one.cone + TURN_SLACK for angle, one in zip(off, goals, strict=True))


def _solve(solver: Solver, segment: PathSegment, at: SegmentPoint, near: Pose, wished: Array) -> Pose | None:
    """Pose at one place, as near as may be to the wished posture; see `mfabrik_planar.solve_planar_along`."""
    place = segment.base.places(*_columns([at]))[0]
    tool, pitch, bound = segment.target(at), segment.pitch(at), not np.isnan(place[2])
    if not np.isnan(pitch):
        solver = replace(solver, family=replace(solver.family, pitch=pitch))
    if bound:
        solver = replace(solver, span=(float(place[2]), float(place[2])))
    base = place if bound else pose_of(solver.robot, place[:2], near.base[2])
    chain = with_pivot(solver.robot.chain)
    others = (np.arange(chain.dof) != pivot_index(chain))[-len(wished) :]
    wished = np.where(others, wished, near.joints)  # the heading decides on the pivot
    found: Configuration | None = solver.hold(tool, base, wished)
    if (
        found is None
        or not found.converged
        or np.abs(found.joints - wished)[others].max() > MAX_JOINT_CHANGE / 2
    ):
        found = solver.least_change(tool, base, wished)
    if found is None:
        return None
    return Pose(base, found.joints) if bound else configuration_pose(found)


def _columns(places: list[SegmentPoint]) -> tuple[Index, Array]:
    return np.array([one.leg for one in places]), np.array([one.share for one in places])
