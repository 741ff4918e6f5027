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
import shapely

from regionik.areas.ground import united
from regionik.areas.layers import ROUNDING_MARGIN, Geometries
from regionik.areas.reach_model import (
    FineReachTable,
    Index,
    ReachModel,
    ReachQuery,
    ReachTable,
    Sectors,
    sector_polygons,
    wide_enough,
)
from regionik.planners.reach.criteria_paving import distances_within_thresholds
from regionik.planners.reach.rings import FREE, reach_spans
from regionik.planners.solvers.planar_kinematics import PlanarLinkage
from regionik.planners.solvers.posture_criteria import Thresholds, posture_margin, thresholds_of
from regionik.postures.arm import Arm
from regionik.postures.families import BACK, FRONT, Band, Family, families_of
from regionik.postures.planar_solver import PlanarSolver
from regionik.worlds.arms import PlanarArm
from regionik.worlds.arrays import Array
from regionik.worlds.limits import Criteria
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

    def table(self, targets: Sequence[Target], query: ReachQuery) -> ReachTable:
        self.thresholds(query.rules.criteria)
        positions = np.array([target.position for target in targets]).reshape(-1, 3)
        alike: dict[tuple[Family, ...], list[int]] = {}
        for i, target in enumerate(targets):
            alike.setdefault(self.families(target, query.facings, inner=query.inner), []).append(i)
        found: list[Family] = []
        which, shapes = [np.empty(0, dtype=np.intp)], [np.empty(0, dtype=object)]
        for kinds, members in alike.items():
            heights, level = np.unique(positions[members, 2], return_inverse=True)
            for family in sorted(kinds, key=lambda kind: kind.bands[0].pitches):
                owner, rings = self._rings(family, heights, query, query.rules.criteria)
                row, member = _spread(owner, level, len(heights))
                which.append(np.array(members, dtype=np.intp)[member])
                shapes.append(rings[row])
                found += [family] * len(row)
        rows, places = np.concatenate(which), np.concatenate(shapes)
        order = np.argsort(rows, kind="stable")
        rows, families = rows[order], tuple(found[k] for k in order.tolist())
        return rows, families, _moved(places[order], positions[rows, :2])

    def fine_table(self, target: Target, kinds: Sequence[Family], query: ReachQuery) -> FineReachTable:
        found = [self._rings(family, target.position[2:], query, None)[1] for family in kinds]
        shapes = np.concatenate([np.empty(0, dtype=object), *found])
        counts = map(len, found)
        families = tuple(one for one, count in zip(kinds, counts, strict=True) for _ in range(count))
        return families, _moved(shapes, np.tile(target.position[:2], (len(shapes), 1)))

    def _rings(
        self, family: Family, heights: Array, query: ReachQuery, criteria: Criteria | None
    ) -> tuple[Index, Geometries]:
        """Reach of targets above the floor's origin at heights (n,): height, ascending, and shape of rows.

        There is a row for each interval of distance and sector, or for each connected part where a family has
        several bands.
        """
        parts = [np.empty((0, 5))]
        for band in family.bands:
            owner, spans = self.intervals(
                criteria, heights, band.pitches, (family.facing,), inner=query.inner
            )
            rows = _ahead(owner, family.facing, spans, query)
            arcs = np.array(self._arcs(band, query)).reshape(-1, 2)
            both = np.repeat(rows, len(arcs), axis=0), np.tile(arcs, (len(rows), 1))
            parts.append(np.concatenate(both, axis=1))
        table = np.concatenate(parts)
        owner, behind = table[:, 0].astype(np.intp), np.pi if family.facing == FRONT else 0.0
        sectors = Sectors(
            np.zeros((len(table), 2)), table[:, 1], table[:, 2], table[:, 3] + behind, table[:, 4]
        )
        shapes = sector_polygons(sectors, query)
        return (owner, shapes) if len(family.bands) == 1 else _joined(owner, shapes, len(heights))

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

    def _arcs(self, band: Band, query: ReachQuery) -> list[Arc]:
        """Directions the plane may take: the band's own, cut to what base and pivot turn to."""
        own, span, (low, high) = (band.azimuth, band.half), query.span, self.pivot(query.rules)
        half = (span[1] - span[0] + high - low) / 2
        if not half < np.pi:
            return [own]
        # a plane that cannot turn has a sliver
        half = half - query.rounding_margin if query.inner else half + ROUNDING_MARGIN
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


def _ahead(owner: Index, facing: int, spans: Array, query: ReachQuery) -> Array:
    """Rows of owner, low and high of what is in reach, ahead or behind, of signed distances (m, 2)."""
    low, high = spans.T
    front = low >= 0
    a, b = np.where(front, low, -high), np.where(front, high, -low)
    return np.column_stack([owner, a, b])[((low + high) * facing > 0) & wide_enough(a, b, query)]


def _joined(owner: Index, shapes: Geometries, count: int) -> tuple[Index, Geometries]:
    """Connected parts of the union of shapes (m,) that have the same owner, and the owner of each."""
    order = np.argsort(owner, kind="stable")
    bounds = np.searchsorted(owner[order], np.arange(count + 1))
    real = np.flatnonzero(np.diff(bounds))
    unions = np.array([united(shapes[order[bounds[k] : bounds[k + 1]]]) for k in real], dtype=object)
    parts, row = shapely.get_parts(unions, return_index=True)
    some = shapely.area(parts) > 0
    return real[row[some]], parts[some]


def _spread(owner: Index, level: Index, count: int) -> tuple[Index, Index]:
    """Rows of each of several targets, and the target: rows are those whose owner is the target's level."""
    first = np.searchsorted(owner, np.arange(count + 1))
    times = np.diff(first)[level]
    member = np.repeat(np.arange(len(level)), times)
    return np.repeat(first[level] - np.cumsum(times) + times, times) + np.arange(len(member)), member


def _moved(shapes: Geometries, by: Array) -> Geometries:
    """Shapes (m,) moved over the floor, (m, 2) [m]."""
    steps = np.repeat(by, shapely.get_num_coordinates(shapes), axis=0)
    moved: Geometries = shapely.transform(shapes, lambda at: at + steps)
    return moved


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
