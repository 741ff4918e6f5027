"""Roadmap of an arm on a fixed base: postures, and straight motions between them that are proven clear.

It grows as a tree from one posture, by the shortest motion that is left. A motion is only looked at when it
is the shortest, as in LazyPRM (Bohlin and Kavraki 2000).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from heapq import heappop, heappush
from itertools import pairwise

import numpy as np

from regionik.postures.collision_checker import CollisionChecker, bodies_in, checker_from
from regionik.postures.poses import Pose, arm_states, distinct
from regionik.worlds.arrays import Array, Index
from regionik.worlds.robot import Robot, with_joint_margin
from regionik.worlds.scene import Floor, Rules, Start, World

DRAWN_POSTURES = 300  # postures at random
MAX_TRIES_PER_POSTURE = 4  # motions to a posture that are looked at


@dataclass(frozen=True, eq=False)
class ArmRoadmap:
    """Tree of postures on one base pose."""

    base: Array  # (3,)
    joints: Array  # (n, dof) postures, the root first
    # (n,) posture that each is joined to by a straight motion that is proven clear; -1 for the root
    parent: Index

    def way(self, collision: CollisionChecker, here: Array, there: Array) -> list[Pose] | None:
        """Return the states strictly between two postures: straight, else along the tree with shortcuts.

        None where an end is no posture of the tree, nor a straight motion from the nearest.
        """
        corners = [Pose(self.base, joints) for joints in (here, there)]
        if not goes(collision, self.base, here, there):
            between = (Pose(self.base, self.joints[k]) for k in self._between(here, there))
            corners = distinct([corners[0], *between, corners[1]])
            if not all(
                goes(collision, self.base, a.joints, b.joints) for a, b in (corners[:2], corners[-2:])
            ):
                return None
            corners = list(self._shortened(collision, corners))
        rows = [row for a, b in pairwise(corners) for row in [*arm_states(a, b), b]]
        return rows[:-1]

    def joins(self, collision: CollisionChecker, joints: Array) -> bool:
        """True if a straight motion from the nearest posture of the tree to another is collision-free."""
        return goes(collision, self.base, self.joints[self._nearest(joints)], joints)

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

    def _shortened(self, collision: CollisionChecker, corners: list[Pose]) -> Iterator[Pose]:
        """Corners of a way without those that a straight motion leaves out, tried by halves."""
        k = 0
        yield corners[0]
        while k < len(corners) - 1:
            m = len(corners) - 1
            while m > k + 1 and not goes(collision, self.base, corners[k].joints, corners[m].joints):
                m = (k + 1 + m) // 2
            k = m
            yield corners[k]


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
    drawn = np.random.default_rng(0).uniform(low, high, (DRAWN_POSTURES, robot.chain.dof))
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
    collision: CollisionChecker, roadmap: ArmRoadmap, postures: Array, tries: int = MAX_TRIES_PER_POSTURE
) -> tuple[ArmRoadmap, Index]:
    """A roadmap grown on to clear postures (n, dof), and which of these it holds by now, (k,).

    They come after what it held, each before those that are joined to it. It grows from a clear root alone.
    """
    before, base = len(roadmap.joints), roadmap.base
    nodes = np.vstack([roadmap.joints, postures])
    far = np.abs(nodes[:, None] - nodes[None]).max(axis=2)
    place, parent, queue = (
        {k: k for k in range(before)},
        roadmap.parent.tolist(),
        list[tuple[float, int, int]](),
    )
    missed = np.zeros(len(nodes), dtype=np.intp)
    new = list(place) if collision.proves(Pose(base, roadmap.joints[0])) else []
    while new:
        for k in new:
            for m in range(before, len(nodes)):
                if m not in place:
                    heappush(queue, (float(far[k, m]), k, m))
        new = []
        while queue and not new:
            _, a, b = heappop(queue)
            if b in place or missed[b] >= tries:
                continue
            if goes(collision, base, nodes[a], nodes[b]):
                place[b], new = len(place), [b]
                parent.append(place[a])
            else:
                missed[b] += 1
    held = np.array(list(place), dtype=np.intp)
    return ArmRoadmap(base, nodes[held], np.array(parent, dtype=np.intp)), held[before:] - before


def goes(collision: CollisionChecker, base: Array, here: Array, there: Array) -> bool:
    """True if the straight motion between two postures is proven clear."""
    a, b = Pose(base, here), Pose(base, there)
    return collision.passes([a, *arm_states(a, b), b])
