"""Roadmap of an arm on a fixed base: postures, and straight motions between them that are proven clear.

It grows as a tree from one posture, by the shortest motion that is left. A motion is only looked at when it
is the shortest, as in LazyPRM (Bohlin and Kavraki 2000). RRTConnect finds ways that go round more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from heapq import heappop, heappush
from itertools import pairwise
from typing import TypeVar

import numpy as np

from regionik.planners.driving.sampling import PlanningProblem, connect
from regionik.postures.collision_checker import CollisionChecker, bodies_in, checker_from
from regionik.postures.options import POSTURES
from regionik.postures.poses import Pose, arm_states, distinct
from regionik.worlds.arrays import Array, Index
from regionik.worlds.chain import Chain
from regionik.worlds.robot import Robot, with_joint_margin
from regionik.worlds.scene import Floor, Rules, Start, World

State = TypeVar("State")
OPTIONS = POSTURES.roadmap


@dataclass(frozen=True, eq=False)
class ArmRoadmap:
    """Tree of postures on one base pose."""

    base: Array  # (3,)
    joints: Array  # (n, dof) postures, the root first
    # (n,) posture that each is joined to by a straight motion that is proven clear; -1 for the root
    parent: Index

    def way(self, collision: CollisionChecker, here: Array, there: Array) -> list[Pose] | None:
        """Return the states strictly between two postures: the `corners`, or a shorter way by RRTConnect.

        That is looked for where the corners go far round. None where an end is no posture of the tree, nor a
        straight motion from the nearest.
        """
        corners = self.corners(collision, here, there)
        if corners is None:
            return None
        if _length(corners) > OPTIONS.good_length_ratio * _length([corners[0], corners[-1]]):
            path = arm_path(collision, self.base, here, there, 0, OPTIONS.max_way_iterations)
            if path is not None:
                corners = min(corners, [Pose(self.base, q) for q in path], key=_length)
        return [row for a, b in pairwise(corners) for row in [*arm_states(a, b), b]][:-1]

    def corners(self, collision: CollisionChecker, here: Array, there: Array) -> list[Pose] | None:
        """Corners of the way between two postures, these among them: straight, or by the tree with shortcuts.

        None where one is not joined to the tree.
        """
        ends = [Pose(self.base, joints) for joints in (here, there)]
        if goes(collision, self.base, here, there):
            return ends
        between = (Pose(self.base, self.joints[k]) for k in self._between(*(end.joints for end in ends)))
        corners = distinct([ends[0], *between, ends[1]])

        def clear(a: Pose, b: Pose) -> bool:
            return goes(collision, self.base, a.joints, b.joints)

        if not (clear(*corners[:2]) and clear(*corners[-2:])):
            return None
        return shortened(corners, clear)

    def joins(self, collision: CollisionChecker, joints: Array) -> bool:
        """True if a straight motion from the nearest posture of the tree to another is collision-free."""
        return goes(collision, self.base, self.joints[self._nearest(joints)], joints)

    def with_path(self, path: Array) -> ArmRoadmap:
        """Return the roadmap with a path of postures (n, dof) from one of it, its motions proven clear."""
        added = np.arange(len(path) - 1) + len(self.joints)
        parent = np.concatenate([self.parent, [self._nearest(path[0])], added[:-1]])
        return replace(self, joints=np.vstack([self.joints, path[1:]]), parent=parent)

    def nearest(self, joints: Array) -> Array:
        """Return the posture that is nearest to another one."""
        near: Array = self.joints[self._nearest(joints)]
        return near

    def up_from(self, some: Index) -> Index:
        """Return some postures and all on their ways to the root, each after the one that it is joined to."""
        found = {k for one in set(some.tolist()) for k in self._to_root(one)} | {0}
        return np.array(sorted(found), dtype=np.intp)

    def _nearest(self, joints: Array) -> int:
        return int(np.argmin(np.abs(self.joints - joints).max(axis=1)))

    def _between(self, here: Array, there: Array) -> list[int]:
        """Postures of the tree from the one nearest to an end to the one nearest to the other."""
        out, back = (list(self._to_root(self._nearest(joints))) for joints in (here, there))
        met = next(k for k in out if k in back)
        return [*out[: out.index(met) + 1], *back[: back.index(met)][::-1]]

    def _to_root(self, k: int) -> Iterator[int]:
        while k >= 0:
            yield k
            k = int(self.parent[k])


@dataclass(frozen=True, eq=False)
class FixedBasePostures:
    """Postures at consecutive set-points from one base pose."""

    base: Array  # (3,)
    # Indices of the k set-points among those asked for: the first k, or any where their order is free
    served: tuple[int, ...]
    joints: Array  # (k, dof)
    spare: float  # least distance of a joint to a limit, as a share of its range
    # Of ways from one posture to another and to the carry posture, where those are known
    roadmap: ArmRoadmap | None = None

    def of(self, some: Sequence[int]) -> FixedBasePostures:
        """Return the same for some of the postures, in the order given."""
        return replace(self, served=tuple(range(len(some))), joints=self.joints[list(some)])


def travel_roadmap(world: World) -> ArmRoadmap:
    """Roadmap of the arm alone, no obstacle near: postures drawn at random that are joined to one another.

    Its root is what the arm is driven in. A start's joints are; else of the carry posture and of some drawn
    the one that is joined to most.
    """
    return _roadmap_alone(world.robot, world.floor, world.rules, world.start)


@lru_cache(maxsize=8)
def _roadmap_alone(robot: Robot, floor: Floor, rules: Rules, start: Start | None) -> ArmRoadmap:
    world = World("the arm alone", robot, floor, (), (), rules, start)
    robot = with_joint_margin(robot, rules.criteria)
    collision, base = checker_from(world, bodies_in(world)), np.zeros(3)
    low, high = (
        np.where(np.isfinite(row), row, end)
        for row, end in ((robot.chain.lower, -np.pi), (robot.chain.upper, np.pi))
    )
    drawn = np.random.default_rng(0).uniform(low, high, (OPTIONS.drawn_postures, robot.chain.dof))
    nodes = np.array([q for q in drawn if collision.proves(Pose(base, q))]).reshape(-1, robot.chain.dof)
    root = robot.carry if start is None else start.joints
    best, held = grown_roadmap(collision, rooted_roadmap(base, root), nodes)
    left = np.setdiff1d(np.arange(len(nodes)), held)
    while start is None and len(left) > len(best.joints):
        found, held = grown_roadmap(collision, rooted_roadmap(base, nodes[left[0]]), nodes[left[1:]])
        left = np.setdiff1d(left[1:], left[1:][held])
        if len(found.joints) > len(best.joints):
            best = found
    return best


def rooted_roadmap(base: Array, root: Array) -> ArmRoadmap:
    """Return a roadmap that holds its root (dof,) alone, as a rule the carry posture."""
    return ArmRoadmap(base, root[None], np.array([-1], dtype=np.intp))


def grown_roadmap(
    collision: CollisionChecker, roadmap: ArmRoadmap, postures: Array
) -> tuple[ArmRoadmap, Index]:
    """A roadmap grown on to clear postures (n, dof), and which of these it holds by now, (k,).

    They come after what it held, each before those that are joined to it. It grows from a clear root alone.
    """
    before, base = len(roadmap.joints), roadmap.base
    nodes = np.vstack([roadmap.joints, postures])
    far = np.abs(nodes[:, None] - nodes[None, before:]).max(axis=2)
    ahead = [iter((before + row).tolist()) for row in np.argsort(far, axis=1, kind="stable")]
    place, parent = {k: k for k in range(before)}, roadmap.parent.tolist()
    missed, queue = np.zeros(len(nodes), dtype=np.intp), list[tuple[float, int, int]]()

    def push(k: int) -> None:
        """Queue the shortest motion from a node that was not queued yet."""
        m = next((m for m in ahead[k] if m not in place and missed[m] < OPTIONS.max_tries), None)
        if m is not None:
            heappush(queue, (float(far[k, m - before]), k, m))

    for k in place if collision.proves(Pose(base, roadmap.joints[0])) else ():
        push(k)
    while queue:
        _, a, b = heappop(queue)
        push(a)
        if b in place or missed[b] >= OPTIONS.max_tries:
            continue
        if goes(collision, base, nodes[a], nodes[b]):
            place[b] = len(place)
            parent.append(place[a])
            push(b)
        else:
            missed[b] += 1
    held = np.array(list(place), dtype=np.intp)
    return ArmRoadmap(base, nodes[held], np.array(parent, dtype=np.intp)), held[before:] - before


def goes(collision: CollisionChecker, base: Array, here: Array, there: Array) -> bool:
    """True if the straight motion between two postures is proven clear."""
    a, b = Pose(base, here), Pose(base, there)
    return collision.passes([a, *arm_states(a, b), b])


def _length(poses: Sequence[Pose]) -> float:
    """Return the sum of the largest changes of a joint from posture to posture [rad] or [m]."""
    return float(sum(np.abs(b.joints - a.joints).max() for a, b in pairwise(poses)))


def arm_path(
    collision: CollisionChecker, base: Array, here: Array, there: Array, seed: int, iterations: int
) -> Array | None:
    """Postures (n, dof) from one clear posture to another by straight motions that are proven clear.

    Straight, else by RRTConnect; None where it found no way.
    """
    straight = np.stack([here, there])
    if goes(collision, base, here, there):
        return straight
    problem = PlanningProblem(
        *joint_box(collision.bodies.robot.chain, here, there), here, there,
        lambda q: collision.proves(Pose(base, q)), lambda p, q: goes(collision, base, p, q),
    )  # fmt: skip
    path = connect(problem, seed=seed, iterations=iterations, stride=OPTIONS.max_stride)
    return None if path is None else np.array(shortened(list(path), lambda p, q: goes(collision, base, p, q)))


def joint_box(chain: Chain, start: Array, goal: Array) -> tuple[Array, Array]:
    """Bounds to sample joints within: their limits, or half a turn beyond both ends."""
    low, high = np.minimum(start, goal), np.maximum(start, goal)
    unbounded = ~(np.isfinite(chain.lower) & np.isfinite(chain.upper))
    return np.where(unbounded, low - np.pi, chain.lower), np.where(unbounded, high + np.pi, chain.upper)


def shortened(path: Sequence[State], goes: Callable[[State, State], bool]) -> list[State]:
    """Return a path without what a straight motion that ``goes`` can leave out."""
    kept, k = [path[0]], 0
    while k < len(path) - 1:
        ahead = range(len(path) - 1, k + 1, -1)
        k = next((m for m in ahead if goes(path[k], path[m])), k + 1)
        kept.append(path[k])
    return kept
