"""The tool goes on along its path from one set-point to the next, and base and arm with it.

The base moves as `basepaths` offers; the arm is solved along the way so that the tool keeps to its own and
nothing jumps.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from regionik.avoid import Spot
from regionik.basepaths import Move, Track, Tracks
from regionik.demand import between as asked_between
from regionik.demand import deviation
from regionik.guard import Guard
from regionik.mfabrik import Solver, pose_of, solver_between
from regionik.plan import Configuration
from regionik.planners import kernels
from regionik.planners.drive import NoPathError
from regionik.planners.touching import Touch
from regionik.poses import LARGEST_BEND, Pose, Row, arrays, pose
from regionik.pruning import Ladder
from regionik.reachable import Family
from regionik.worlds.arrays import Array
from regionik.worlds.errors import RegionikError
from regionik.worlds.pivot import pivot_of, pivoted
from regionik.worlds.scene import Target, World

TOOL_STRIDE = 0.05  # longest way of base or tool between two states on the path [m]
SOLVE_TOLERANCE = 0.1  # arms between set-points are solved to this share of the tolerance
SAG_SHARE = 0.3  # share of the path tolerance that motion between two states may use
TURN_SLACK = 1e-7  # rounding allowed at the edge of a cone [rad]
DEEPEST = 6  # halvings before a stretch counts as discontinuous
LOOKED_AT = np.array([0.25, 0.5, 0.75])  # shares of the way between two states
CLOSEST = 3  # halvings before a motion that is not proven clear counts as blocked


class _BlockedError(RegionikError):
    """The arm would touch something on the way."""

    def __init__(self, touch: Touch) -> None:
        super().__init__("the arm would touch something")
        self.touch = touch


@dataclass(frozen=True, eq=False)
class Leg:
    """Part of a stretch: base on a track, tool and wished posture straight from one end to the other.

    What the tool's axis or frame is asked turns evenly with it.
    """

    track: Track
    tool: tuple[Target, Target]
    joints: tuple[Array, Array]
    family: tuple[Family, Family]

    @property
    def bare(self) -> bool:
        """Whether the tool may be turned as it will."""
        return self.tool[0].direction is None and self.tool[1].direction is None

    def target(self, share: float) -> Target:
        """What the tool is asked at a share of the way."""
        return asked_between(*self.tool, share)

    def points(self, shares: Array) -> Array:
        """Where the tool is at shares of the way, (n, 3) [m]."""
        first, last = (end.position for end in self.tool)
        spots: Array = first + shares[:, None] * (last - first)
        spots[shares >= 1.0] = last
        return spots

    def wished(self, shares: Array) -> Array:
        """Joints at shares of the way, (n, dof)."""
        return self.joints[0] + shares[:, None] * (self.joints[1] - self.joints[0])

    def pitch(self, share: float) -> float:
        """Of the last link."""
        first, last = self.family[0].pitch, self.family[1].pitch
        return first + share * kernels.wrap(last - first)

    @property
    def length(self) -> float:
        way = self.tool[1].position - self.tool[0].position
        return max(self.track.length, float(np.linalg.norm(way)))


@dataclass(frozen=True, eq=False)
class Stretcher:
    """Moves the robot with its tool on the path.

    Attributes
    ----------
    stops : dict of int to Touch
        What the arm met first on the way on from a set-point.
    """

    world: World
    ladder: Ladder
    guard: Guard
    tracks: Tracks
    stops: dict[int, Touch] = field(default_factory=dict)
    _solvers: dict[Family, Solver] = field(default_factory=dict)

    def follow(self, i: int, here: Spot, goal: Spot) -> list[Row] | None:
        """From set-point i to i + 1; None where the arm would have to jump, or would touch something."""
        try:
            for moves in self.tracks.ways(here.component, goal.component, here.pose.base, goal.pose.base):
                rows = self._go(i, here.pose, self._legs(i, (here, goal), moves))
                if rows is not None:
                    return rows
        except NoPathError:
            return None
        except _BlockedError as blocked:
            self.stops.setdefault(i, blocked.touch)
        return None

    def _legs(self, i: int, spots: tuple[Spot, Spot], moves: list[Move]) -> list[Leg]:
        """Moves with what the tool does on them, and the postures wished for."""
        ends = self.world.task[i], self.world.task[i + 1]
        way = float(np.linalg.norm(ends[1].position - ends[0].position))
        first, last = spots[0].found.joints, spots[1].found.joints
        families = [self.ladder.family[spot.component] for spot in spots]
        far = np.cumsum([0.0] + [move.track.length + (move.tool[1] - move.tool[0]) * way for move in moves])
        shares = far / far[-1] if far[-1] > 0 else np.linspace(0.0, 1.0, len(far))
        legs = []
        for move, u, v in zip(moves, shares[:-1].tolist(), shares[1:].tolist(), strict=True):
            tool = [asked_between(*ends, share) for share in move.tool]
            wished = [first + share * (last - first) for share in (u, v)]
            family = [families[round(share)] for share in move.tool]
            legs.append(Leg(move.track, (tool[0], tool[1]), (wished[0], wished[1]), (family[0], family[1])))
        return legs

    def _go(self, i: int, here: Pose, legs: list[Leg]) -> list[Row] | None:
        rows: list[Row] = []
        for leg in legs:
            part = self._states(leg, here)
            if part is None:
                return None
            rows += [Row(one, "step", i) for one in part]
            here = part[-1] if part else here
        return rows

    def _states(self, leg: Leg, here: Pose) -> list[Pose] | None:
        """States along a leg that keep the tool on its way and the arm clear.

        What holds is taken, up to a hop that does not: that one is halved, as often as it may help.
        """
        solver = self._solver(leg.family[0])
        stride = min(TOOL_STRIDE, self.world.rules.step)
        shares = np.linspace(0.0, 1.0, max(1, int(np.ceil(leg.length / stride))) + 1)[:0:-1]
        ahead = [(share, 0) for share in shares.tolist()]  # and how often it was halved; the next one last
        passed, done = [here], 0.0
        while ahead:
            tried = np.array([done, *(share for share, _ in ahead[::-1])])
            states, missing = _solved(solver, leg, tried[1:], passed[-1])
            count, touch = self._proven(leg, tried, [passed[-1], *states])
            passed += states[:count]
            done, ahead = float(tried[count]), ahead[: len(ahead) - count]
            if count == len(states) and not missing:
                continue
            share, depth = ahead.pop()
            if touch is not None and (depth >= CLOSEST or not self.guard.clear(states[count])):
                raise _BlockedError(touch)
            if depth >= DEEPEST:
                return None
            ahead += [(share, depth + 1), ((done + share) / 2, depth + 1)]
        return passed[1:]

    def _proven(self, leg: Leg, tried: Array, poses: list[Pose]) -> tuple[int, Touch | None]:
        """How many hops lead the tool as asked, jump nowhere and are clear; what stops the next one."""
        bases, joints = arrays(poses)
        line, rules = leg.points(tried[: len(poses)]), self.world.rules
        count = self.guard.led(bases, joints, line, LOOKED_AT, SAG_SHARE * rules.path_tolerance)
        if not leg.bare:
            tools = self.guard.tools(bases[: count + 1], joints[: count + 1], LOOKED_AT)
            asked = [leg.target(share) for share in tried[: count + 1].tolist()]
            turned = [_turned(*hop) for hop in zip(asked[:-1], asked[1:], tools, strict=True)]
            count = [*turned, False].index(False)
        return self.guard.proven(bases[: count + 1], joints[: count + 1])

    def _solver(self, family: Family) -> Solver:
        """Solver for what lies between set-points, kept for families that are asked for again."""
        if family not in self._solvers:
            solver = solver_between(self.world, family)
            self._solvers[family] = replace(solver, tolerance=solver.tolerance * SOLVE_TOLERANCE)
        return self._solvers[family]


def _turned(p: Target, q: Target, tools: Array) -> bool:
    """Whether tool frames on the way between two targets are turned as asked."""
    if p.direction is None or q.direction is None:
        return True
    asked = [asked_between(p, q, share) for share in LOOKED_AT.tolist()]
    pairs = zip(asked, tools, strict=True)
    return all(deviation(one, tool[:3, :3]) <= one.cone + TURN_SLACK for one, tool in pairs)


def _solved(solver: Solver, leg: Leg, shares: Array, near: Pose) -> tuple[list[Pose], bool]:
    """States at shares of a leg, each from the one before, and whether the one after them was not found.

    All of them where one compiled call finds them, else the first.
    """
    if not (leg.bare and solver.compiled):
        state = _solve(solver, leg, shares[:1], near)
        return ([], True) if state is None else ([state], False)
    points, places, wished = leg.points(shares), leg.track.places(shares), leg.wished(shares)
    found = solver.along(points, places, wished, LARGEST_BEND / 2, near.base, near.joints)
    states = [Pose(*state) for state in zip(*found, strict=True)]
    return states, len(states) < len(shares)


def _solve(solver: Solver, leg: Leg, shares: Array, near: Pose) -> Pose | None:
    """Pose at one share of a leg, as near as may be to the wished posture; see `onecall.answer_way`."""
    share, place, wished = float(shares[0]), leg.track.places(shares)[0], leg.wished(shares)[0]
    tool, pitch, bound = leg.target(share), leg.pitch(share), not np.isnan(place[2])
    if not np.isnan(pitch):
        solver = replace(solver, family=replace(solver.family, pitch=pitch))
    if bound:
        solver = replace(solver, span=(float(place[2]), float(place[2])))
    base = place if bound else pose_of(solver.robot, place[:2], near.base[2])
    chain = pivoted(solver.robot.chain)
    others = (np.arange(chain.dof) != pivot_of(chain))[-len(wished) :]
    wished = np.where(others, wished, near.joints)  # the heading decides on the pivot
    found: Configuration | None = solver.hold(tool, base, wished)
    if found is None or not found.converged or np.abs(found.joints - wished)[others].max() > LARGEST_BEND / 2:
        found = solver.least_change(tool, base, wished)
    if found is None:
        return None
    return Pose(base, found.joints) if bound else pose(found)
