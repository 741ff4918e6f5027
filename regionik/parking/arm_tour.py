"""Tours of the arm at a stop: in which posture each set-point is done, and in which order.

A generalised travelling salesman problem, in the time that the arm takes from one posture to another at its
joints' full speed. RoboTSP (Suarez-Ruiz, Lembono and Pham 2018) orders the points first and chooses postures
then; here the two take turns. What is chosen is proven only then, and what does not hold is left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy.spatial.distance import cdist

from regionik.parking.options import PARKING
from regionik.parking.parking_areas import StopGroup
from regionik.parking.placements import PlacementSearch
from regionik.parking.posture_carrier import PostureCarrier
from regionik.planners.coverage.tours import VisitingOrder, shortest_order, shortest_tour_of_sets
from regionik.postures.arm_roadmap import FixedBasePostures
from regionik.scene import Scene
from regionik.worlds.arms import pivot_index
from regionik.worlds.arrays import Array, Index
from regionik.worlds.limits import Speeds

OPTIONS = PARKING.tour


def in_short_order(placements: PlacementSearch, group: StopGroup) -> tuple[StopGroup, float]:
    """Return the group with its set-points along a short tour at its widest place, and the arm's time [s].

    Where a place gives the arm its posture there are no others, and the tool keeps to its path where it can:
    the order is that of its way.
    """
    if group.postures is not None:
        held, tour = _toured(placements.scene, group, group.postures)
        setpoints = tuple(group.setpoints[n] for n in tour.order)
        return replace(group, setpoints=setpoints, postures=held), tour.length
    scene = placements.scene
    spots = np.array([scene.task[i].position for i in group.setpoints])
    way = shortest_order(cdist(spots, spots)).order
    ordered = group.of(tuple(group.setpoints[n] for n in way))
    return ordered, _timed(placements, ordered)


def _timed(placements: PlacementSearch, group: StopGroup) -> float:
    """Return the arm's time for what the widest place serves of a group, in its order [s]."""
    placement = placements.widest(group)
    if placement is None:
        return 0.0
    pivot = pivot_index(placements.scene.robot.chain)
    joints = np.array([placements.joints_at(n, placement) for n in range(len(placement.setpoints))])
    joints[:, pivot] = placement.near[:, pivot]
    return float(np.diagonal(_times(joints, _velocity(placements.scene)), 1).sum())


def _velocity(scene: Scene) -> Array:
    """Return the velocity limit of each joint (dof,)."""
    return (scene.world.speeds or Speeds()).joint_limits(scene.robot.chain)[0]


def _toured(
    scene: Scene, group: StopGroup, postures: FixedBasePostures
) -> tuple[FixedBasePostures, VisitingOrder]:
    """Return the postures in the order of a tour, and that order as indices into the group."""
    carrier = PostureCarrier(scene.world, scene.collision, [scene.task[i] for i in group.setpoints])
    arm = _ArmTour(carrier, postures, _velocity(scene))
    chosen, tour = arm.proven(arm.continued(arm.branches()))
    return replace(postures, joints=chosen.joints), replace(tour, order=tuple(chosen.owner.tolist()))


@dataclass(frozen=True, eq=False)
class _Branches:
    """Postures at the set-points of a stop."""

    joints: Array  # (m, dof)
    owner: Index  # (m,) set-point of each

    def of(self, some: Index) -> _Branches:
        return _Branches(self.joints[some], self.owner[some])

    def joined(self, joints: Array, owner: Index) -> _Branches:
        """Return these and those others that differ from them at the same set-point."""
        known = (self.joints[self.owner == k] for k in owner)
        off = [np.abs(rows - q).max(axis=1).min() for rows, q in zip(known, joints, strict=True)]
        new = np.flatnonzero(np.array(off) > OPTIONS.same_posture)
        return _Branches(np.vstack([self.joints, joints[new]]), np.concatenate([self.owner, owner[new]]))


@dataclass(frozen=True, eq=False)
class _ArmTour:
    """The search for a tour at one pose of the base, where a posture is known at every set-point."""

    carrier: PostureCarrier
    postures: FixedBasePostures
    velocity: Array  # (dof,)

    _seen: set[tuple[int, int]] = field(default_factory=set)  # motions between branches that were looked at

    def branches(self) -> _Branches:
        """Return the known postures, then families of others."""
        every = np.arange(len(self.postures.joints))
        found = _Branches(self.postures.joints, every)
        for owner, joints in self.carrier.families(self.postures.base, every, OPTIONS.max_families):
            found = found.joined(joints, owner)
        return found

    def continued(self, branches: _Branches) -> _Branches:
        """Return the branches and more: along the shortest tour, postures continued from the one before."""
        for _ in range(OPTIONS.max_continuation_rounds):
            far = _times(branches.joints, self.velocity)
            chosen = branches.of(np.array(self._shortest(branches, far).order))
            more = self.carrier.continued(self.postures.base, chosen.owner, chosen.joints)
            before, branches = len(branches.owner), branches.joined(more, chosen.owner)
            if len(branches.owner) == before:
                break
        return branches

    def proven(self, branches: _Branches) -> tuple[_Branches, VisitingOrder]:
        """The shortest tour found of postures that hold, those known among them, which come first.

        Its length counts motions that are not clear by the way round.
        """
        far, left = _times(branches.joints, self.velocity), np.ones(len(branches.owner), dtype=bool)
        holds = np.arange(len(left)) < len(self.postures.joints)
        for k in range(OPTIONS.max_rounds):
            some = np.flatnonzero(left if k < OPTIONS.max_proof_rounds - 1 else holds)
            tour = self._shortest(branches.of(some), far[np.ix_(some, some)])
            order = some[list(tour.order)]
            new = order[~holds[order]]
            holds[new] = [self._holds(branches, n) for n in new.tolist()]
            left[new] = holds[new]
            if holds[order].all() and not self._ways_round(branches, order, far):
                break
        return branches.of(order), tour

    def _holds(self, branches: _Branches, n: int) -> bool:
        """True if a posture is clear, holds all round the parking circle, and is joined to the roadmap."""
        joints, roadmap, carrier = branches.joints[n], self.postures.roadmap, self.carrier
        if not carrier.serves(int(branches.owner[n]), self.postures.base, joints):
            return False
        return roadmap is None or roadmap.joins(carrier.collision, joints)

    def _ways_round(self, branches: _Branches, order: Index, far: Array) -> bool:
        """Count motions of a tour that are not clear by the way round; true where one was new."""
        roadmap, found = self.postures.roadmap, False
        for a, b in pairwise(order.tolist() if roadmap is not None else []):
            if roadmap is None or (a, b) in self._seen:
                continue
            self._seen.update([(a, b), (b, a)])
            way = roadmap.corners(self.carrier.collision, branches.joints[a], branches.joints[b])
            if way is not None:
                states = [pose.joints for pose in way]
                time = float((np.abs(np.diff(states, axis=0)) / self.velocity).max(axis=1).sum())
                found |= time > far[a, b] + 1e-9
                far[a, b] = far[b, a] = time
        return found

    def _shortest(self, branches: _Branches, far: Array) -> VisitingOrder:
        """Return the shortest tour from the roadmap's root, the posture for driving, and back to it."""
        if self.postures.roadmap is None:
            return shortest_tour_of_sets(far, branches.owner)
        root = self.postures.roadmap.joints[:1]
        ends = cdist(root / self.velocity, branches.joints / self.velocity, "chebyshev")[0]
        return shortest_tour_of_sets(far, branches.owner, ends, ends)


def _times(joints: Array, velocity: Array) -> Array:
    """Time of straight motions between postures, the slowest joint at its full speed (m, m) [s]."""
    far: Array = cdist(joints / velocity, joints / velocity, "chebyshev")
    return far
