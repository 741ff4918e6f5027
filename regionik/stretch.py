"""The tool goes on along its path from one set-point to the next, and base and arm with it.

The base first tries to go straight while the tool goes on; else it moves inside the area of i to a place
shared with the area of i + 1, the tool goes on from there, and the base moves on inside the area of i + 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from regionik.avoid import Spot
from regionik.guard import Guard
from regionik.hops import Driver
from regionik.mfabrik import Solver, axis_of, pose_of, solver_for
from regionik.planners import kernels
from regionik.planners.flat import FlatPolygon, segment_inside
from regionik.planners.touching import Touch
from regionik.poses import LARGEST_BEND, Pose, Row, between, pose, turn_to
from regionik.pruning import Ladder
from regionik.reachable import Family
from regionik.worlds.arrays import Array
from regionik.worlds.errors import RegionikError
from regionik.worlds.pivot import pivot_of
from regionik.worlds.scene import World

TOOL_STRIDE = 0.05  # longest way of base or tool between two states on the path [m]
SOLVE_TOLERANCE = 0.1  # arms between set-points are solved to this share of the tolerance
SAG_SHARE = 0.3  # share of the path tolerance that motion between two states may use
DEEPEST = 6  # halvings before a stretch counts as discontinuous
CLOSEST = 3  # halvings before a motion that is not proven clear counts as blocked


class _BlockedError(RegionikError):
    """The arm would touch something on the way."""

    def __init__(self, touch: Touch) -> None:
        super().__init__("the arm would touch something")
        self.touch = touch


@dataclass(frozen=True, eq=False)
class Leg:
    """Part of a stretch: arm axis, tool and wished posture each go straight from one end to the other."""

    axis: tuple[Array, Array]
    tool: tuple[Array, Array]
    joints: tuple[Array, Array]
    family: tuple[Family, Family]

    def at(self, share: float) -> tuple[Array, Array, Array, float]:
        """Axis, tool, wished joints and pitch at a share of the way."""
        axis, tool, joints = (a + share * (b - a) for a, b in (self.axis, self.tool, self.joints))
        first, last = self.family[0].pitch, self.family[1].pitch
        return axis, tool, joints, first + share * kernels.wrap(last - first)

    @property
    def length(self) -> float:
        return max(float(np.linalg.norm(b - a)) for a, b in (self.axis, self.tool))


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
    driver: Driver
    stops: dict[int, Touch] = field(default_factory=dict)
    _joined: dict[tuple[int, int], FlatPolygon] = field(default_factory=dict)

    def follow(self, i: int, here: Spot, goal: Spot) -> list[Row] | None:
        """From set-point i to i + 1; None where the arm would have to jump, or would touch something."""
        try:
            return self._straight(i, here, goal) or self._by_handover(i, here, goal)
        except _BlockedError as blocked:
            self.stops.setdefault(i, blocked.touch)
            return None

    def _straight(self, i: int, here: Spot, goal: Spot) -> list[Row] | None:
        a, b = (axis_of(self.world.robot, spot.pose.base) for spot in (here, goal))
        flat = self._flat(here.component, goal.component)
        if not segment_inside(flat.vertices, flat.starts, a[0], a[1], b[0], b[1]):
            return None
        return self._go(i, here.pose, [self._leg(i, (here, goal), (a, b), (0, 1), (0.0, 1.0))])

    def _by_handover(self, i: int, here: Spot, goal: Spot) -> list[Row] | None:
        k, j = here.component, goal.component
        components = self.ladder.component
        a, b = (axis_of(self.world.robot, spot.pose.base) for spot in (here, goal))
        over = _handover(components[k] & components[j], a, b)
        before = self.driver.drive(components[k], a, over)
        after = self.driver.drive(components[j], over, b)
        ways = [(p, q, 0, 0) for p, q in _pairs(before)]
        ways += [(over, over, 0, 1)]
        ways += [(p, q, 1, 1) for p, q in _pairs(after)]
        tool = float(np.linalg.norm(self.world.task[i + 1].position - self.world.task[i].position))
        far = np.cumsum([0.0] + [float(np.hypot(*(q - p))) + (t - s) * tool for p, q, s, t in ways])
        shares = far / far[-1] if far[-1] > 0 else np.linspace(0.0, 1.0, len(far))
        legs = [
            self._leg(i, (here, goal), (p, q), (s, t), (float(u), float(v)))
            for (p, q, s, t), u, v in zip(ways, shares[:-1], shares[1:], strict=True)
        ]
        return self._go(i, here.pose, legs)

    def _leg(
        self,
        i: int,
        spots: tuple[Spot, Spot],
        axis: tuple[Array, Array],
        ends: tuple[int, int],
        shares: tuple[float, float],
    ) -> Leg:
        """A leg between two places of the axis; ``ends`` say at which of the two set-points the tool is."""
        tools = [self.world.task[i + end].position for end in ends]
        first, last = spots[0].found.joints, spots[1].found.joints
        wished = [first + share * (last - first) for share in shares]
        families = [self.ladder.family[spots[end].component] for end in ends]
        return Leg(axis, (tools[0], tools[1]), (wished[0], wished[1]), (families[0], families[1]))

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
        """States along a leg, as many as keep the tool on its way and the arm clear."""
        stride = min(TOOL_STRIDE, self.world.rules.step)
        shares = np.linspace(0.0, 1.0, max(1, int(np.ceil(leg.length / stride))) + 1)[1:]
        solver = solver_for(self.world, leg.family[0])
        solver = replace(solver, tolerance=solver.tolerance * SOLVE_TOLERANCE)
        passed = [here]
        done = 0.0

        def advance(share: float, depth: int) -> bool:
            nonlocal done
            there = _solve(solver, leg, share, passed[-1])
            if there is not None and self._holds(passed[-1], there, leg.at(done)[1], leg.at(share)[1]):
                touch = self.guard.stop(passed[-1], there)
                if touch is None:
                    passed.append(there)
                    done = share
                    return True
                if depth >= CLOSEST or not self.guard.clear(there):
                    raise _BlockedError(touch)
            return depth < DEEPEST and advance((done + share) / 2, depth + 1) and advance(share, depth + 1)

        return passed[1:] if all(advance(float(share), 0) for share in shares) else None

    def _holds(self, here: Pose, there: Pose, p: Array, q: Array) -> bool:
        """Whether the tool stays by the segment pq between two states, and nothing jumps."""
        turn = turn_to(here.base, there.base)
        if np.hypot(*turn[:2]) > self.world.rules.step or abs(turn[2]) > LARGEST_BEND:
            return False
        if np.abs(there.joints - here.joints).max() > LARGEST_BEND:
            return False
        shares = np.array([0.25, 0.5, 0.75])
        filled = [between(here, there, share) for share in shares]
        base, joints = (np.array(part) for part in zip(*((f.base, f.joints) for f in filled), strict=True))
        tools = self.world.robot.tool(base, joints)[:, :3, 3]
        along = shares[:, None] * (q - p) + p
        worst = float(np.linalg.norm(tools - along, axis=1).max())
        return worst <= SAG_SHARE * self.world.rules.path_tolerance

    def _flat(self, k: int, j: int) -> FlatPolygon:
        """Two components together, kept."""
        if (k, j) not in self._joined:
            both = shapely.union(self.ladder.component[k], self.ladder.component[j])
            self._joined[k, j] = FlatPolygon.from_shapely(both)
        return self._joined[k, j]


def _solve(solver: Solver, leg: Leg, share: float, near: Pose) -> Pose | None:
    """Pose at a share of a leg, as near as may be to the wished posture.

    FABRIK from the wished posture first; where its passes stall or jump, the posture of least change.
    """
    axis, tool, wished, pitch = leg.at(share)
    here = replace(solver, family=replace(solver.family, pitch=pitch))
    base = pose_of(solver.robot, axis, near.base[2])
    others = np.arange(len(wished)) != pivot_of(solver.robot.chain)
    wished = np.where(others, wished, near.joints)  # the heading decides on the pivot
    found = here.hold(tool, base, wished)
    if found.converged and np.abs(found.joints - wished)[others].max() <= LARGEST_BEND / 2:
        return pose(found)
    nearest = here.least_change(tool, base, wished)
    return None if nearest is None else pose(nearest)


def _handover(shared: BaseGeometry, a: Array, b: Array) -> Array:
    """Place in the shared area nearest to the way from a to b, a little inside where there is room."""
    inside = shared.buffer(-0.002)
    goal = shared if inside.is_empty else inside
    return np.array(shapely.shortest_line(goal, LineString([a, b])).coords[0])


def _pairs(points: Array) -> list[tuple[Array, Array]]:
    return list(zip(points[:-1], points[1:], strict=True))
