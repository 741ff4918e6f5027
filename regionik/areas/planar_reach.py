"""Reach of an arm in one vertical plane: exact rings and ring sectors, for any tool direction.

With the plane at azimuth a and the tool at a signed distance r from the axis in it, the axis stands at
c = p - r (cos a, sin a) for a tool at p. The r that postures within limits reach at a height are intervals
(`planners.reach.rings`); a takes every direction that the family allows and that base and pivot turn to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np

from regionik.areas.layers import GUARD
from regionik.areas.reach_model import (
    FineRows,
    Index,
    ReachModel,
    ReachQuery,
    Rows,
    Sectors,
    sector_polygons,
    wide_enough,
)
from regionik.planners.reach.criteria_paving import distances_within_thresholds
from regionik.planners.reach.rings import FREE, reach_intervals, reach_spans
from regionik.planners.solvers.planar_kinematics import PlanarLinkage
from regionik.planners.solvers.posture_criteria import Thresholds, posture_margin, thresholds_of
from regionik.postures.arm import Arm
from regionik.postures.families import BACK, FRONT, Family, families_of
from regionik.postures.planar_solver import PlanarSolver
from regionik.worlds.arms import PlanarArm
from regionik.worlds.arrays import Array
from regionik.worlds.criteria import Criteria
from regionik.worlds.robot import check_criteria
from regionik.worlds.scene import Target

Arc = tuple[float, float]  # middle and half width [rad]


@dataclass(frozen=True, eq=False)
class PlanarReach(ReachModel):
    """Reach of an arm in one vertical plane, its tool along the last link where a direction is asked."""

    arm: PlanarArm  # the robot's chain in the plane

    exact: ClassVar[bool] = True
    shows_all_postures: ClassVar[bool] = True

    @cached_property
    def plane(self) -> PlanarLinkage:
        """The arm for kernels, heights counted from the floor; its arrays are writable, as they expect."""
        arm = self.arm
        lengths, lower, upper = (np.array(part, order="C") for part in (arm.lengths, arm.lower, arm.upper))
        return PlanarLinkage(float(arm.shoulder[0]), self._shoulder, lengths, lower, upper)

    @property
    def _shoulder(self) -> float:
        """Height of the first hinge over the floor [m]."""
        return float(self.arm.shoulder[1] + self.robot.mount[2])

    def rows(self, targets: Sequence[Target], query: ReachQuery) -> Rows:
        self.thresholds(query.rules.criteria)
        positions = np.array([target.position for target in targets]).reshape(-1, 3)
        alike: dict[tuple[Family, ...], list[int]] = {}
        for i, target in enumerate(targets):
            alike.setdefault(self.families(target, query.facings, inner=query.inner), []).append(i)
        found: list[Family] = []
        parts = [np.empty((0, 4))]
        for kinds, members in alike.items():
            for pitches in sorted({family.pitches for family in kinds}):
                owner, spans = self.intervals(
                    query.rules.criteria, positions[members, 2], pitches, query.facings, inner=query.inner
                )
                for family in (one for one in kinds if one.pitches == pitches):
                    parts.append(_ahead(np.array(members)[owner], len(found), family, spans, query))
                    found.append(family)
        table = np.concatenate(parts)
        table = table[np.argsort(table[:, 0], kind="stable")]
        arcs = [self._arcs(family, query) for family in found]
        which, kind, rings = _sectors(positions[:, :2], found, table, arcs)
        return which, tuple(found[k] for k in kind.tolist()), sector_polygons(rings, query)

    def fine_rows(self, target: Target, kinds: Sequence[Family], query: ReachQuery) -> FineRows:
        parts = [np.empty((0, 4))]
        for k, family in enumerate(kinds):
            spans = reach_intervals(self.arm, self._shoulder, target.position[2:], family.pitches)[0]
            parts.append(_ahead(np.zeros(len(spans)), k, family, spans, query))
        turns = [[arc for arc in self._arcs(one, query) if arc[1] > 0] for one in kinds]
        _, kind, rings = _sectors(target.position[None, :2], kinds, np.concatenate(parts), turns)
        return tuple(kinds[k] for k in kind.tolist()), sector_polygons(rings, query)

    def intervals(
        self,
        criteria: Criteria | None,
        heights: Array,
        pitches: tuple[float, float] = FREE,
        facings: Sequence[int] = (FRONT, BACK),
        *,
        inner: bool,
    ) -> tuple[Index, Array]:
        """Intervals of signed distance r with a posture that meets all criteria together.

        Heights (n,) are those of the tool over the floor [m]; ``pitches`` bounds the angle of the last link
        in the plane [rad]. ``inner`` ones are proven, others not ruled out. Returned are the height of each
        interval, (m,) ascending, and its ends, (m, 2), ascending at each height; none crosses 0 [m].
        """
        front, back = FRONT in facings, BACK in facings
        owner, reach = reach_spans(self.arm, self._shoulder, heights, pitches, front=front, back=back)
        asked = self.thresholds(criteria)
        if asked is None or criteria is None:
            return owner, reach
        side = 0 if inner or asked[0] is asked[1] else 1
        bounds = np.searchsorted(owner, np.arange(len(heights) + 1)).tolist()
        found = [np.empty((0, 2))]
        for z, a, b in zip(heights.tolist(), bounds[:-1], bounds[1:], strict=True):
            known = tuple((low, high) for low, high in reach[a:b].tolist())
            found.append(_split(_paved(self, criteria, side, pitches, z, known)[0 if inner else 1]))
        return np.repeat(np.arange(len(heights)), [len(rows) for rows in found[1:]]), np.concatenate(found)

    def distances(self, criteria: Criteria | None, heights: Array, *, inner: bool) -> list[Array]:
        """|r| in front of the axis and behind it; see `ReachModel`."""
        owner, reach = self.intervals(criteria, heights, inner=inner)
        return np.split(np.sort(np.abs(reach), axis=1), np.searchsorted(owner, np.arange(1, len(heights))))

    def families(self, target: Target, facings: tuple[int, ...], *, inner: bool) -> tuple[Family, ...]:
        return families_of(self.arm, target, facings, inner=inner)

    def solver(
        self, family: Family, tolerance: float, *, turns: bool = True, criteria: Criteria | None = None
    ) -> Arm:
        """FABRIK in the arm's plane; see `ReachModel`."""
        asked = self.thresholds(criteria)
        return PlanarSolver(self.arm, self.plane, family, tolerance, asked and asked[0])

    def thresholds(self, criteria: Criteria | None) -> tuple[Thresholds, Thresholds] | None:
        """Thresholds that criteria set besides limits, for inner and for outer areas; None for none.

        Raises InputError for criteria that the arm cannot be held to.
        """
        if criteria is None or not criteria.beyond_limits:
            return None
        check_criteria(criteria, self.robot)
        return thresholds_of(self.arm, self.robot, criteria)

    def meets(self, criteria: Criteria | None, joints: Array) -> bool:
        asked = self.thresholds(criteria)
        if not super().meets(criteria, joints):
            return False
        return asked is None or bool(posture_margin(self.plane, asked[0], self.arm.bends(joints)) >= 0.0)

    def _arcs(self, family: Family, query: ReachQuery) -> list[Arc]:
        """Directions the plane may take: the family's own, cut to what base and pivot turn to."""
        own, span, (low, high) = (family.azimuth, family.half), query.span, self.pivot(query.rules)
        half = (span[1] - span[0] + high - low) / 2
        if not half < np.pi:
            return [own]
        half = half - query.guard if query.inner else half + GUARD  # a plane that cannot turn has a sliver
        if half <= 0:
            return []
        yaw = float(self.robot.mount[3]) + self.arm.pivot_zero
        middle = yaw + (span[0] + span[1] + low + high) / 2
        return _common_arcs(own, (middle, half))


@lru_cache(maxsize=4096)
def _paved(
    model: PlanarReach,
    criteria: Criteria,
    side: int,
    pitches: tuple[float, float],
    z: float,
    known: tuple[tuple[float, float], ...],
) -> tuple[Array, Array]:
    asked = thresholds_of(model.arm, model.robot, criteria)[side]
    return distances_within_thresholds(model.plane, asked, pitches, z, np.array(known).reshape(-1, 2))


def _split(spans: Array) -> Array:
    """Spans (m, 2) of signed distance, ascending, of which none crosses the axis."""
    low, high = spans.T
    across = (low < 0) & (high > 0)
    behind = np.column_stack([low, np.where(across, 0.0, high)])
    ahead = np.column_stack([np.zeros(int(across.sum())), high[across]])
    both: Array = np.concatenate([behind, ahead])
    return both[np.argsort(both[:, 0], kind="stable")]


def _ahead(owner: Array | Index, k: int, family: Family, spans: Array, query: ReachQuery) -> Array:
    """Rows of owner, number k, low and high of what a family reaches of signed distances (m, 2)."""
    low, high = spans.T
    front = low >= 0
    a, b = np.where(front, low, -high), np.where(front, high, -low)
    rows = np.column_stack([owner, np.full(len(owner), k), a, b])
    return rows[((low + high) * family.facing > 0) & wide_enough(a, b, query)]


def _sectors(
    centers: Array, kinds: Sequence[Family], table: Array, arcs: Sequence[Sequence[Arc]]
) -> tuple[Index, Index, Sectors]:
    """Rings cut to the directions of their families: target and family of each sector, and the sectors.

    Targets are at ``centers`` (n, 2) [m]; the table (m, 4) has rows of target, family, low and high; ``arcs``
    are the directions that the plane may take, of each family.
    """
    which, kind = table[:, :2].astype(np.intp).T
    counts = np.array([len(several) for several in arcs], dtype=np.intp)
    times = counts[kind]
    row = np.repeat(np.arange(len(kind)), times)
    arc = (np.cumsum(counts) - counts)[kind[row]] + np.arange(len(row)) - (np.cumsum(times) - times)[row]
    which, kind = which[row], kind[row]
    middle, half = np.array([one for several in arcs for one in several]).reshape(-1, 2)[arc].T
    behind = np.array([np.pi if family.facing == FRONT else 0.0 for family in kinds])
    return which, kind, Sectors(centers[which], table[row, 2], table[row, 3], middle + behind[kind], half)


def _common_arcs(a: Arc, b: Arc) -> list[Arc]:
    """Intersection of two arcs given by center and half width: none, one or two arcs."""
    if a[1] >= np.pi:
        return [b]
    if b[1] >= np.pi:
        return [a]
    shift = (b[0] - a[0] + np.pi) % (2 * np.pi) - np.pi
    arcs = []
    for turn in (-2 * np.pi, 0.0, 2 * np.pi):
        low = max(-a[1], shift + turn - b[1])
        high = min(a[1], shift + turn + b[1])
        if high > low:
            arcs.append((a[0] + (low + high) / 2, (high - low) / 2))
    return arcs
