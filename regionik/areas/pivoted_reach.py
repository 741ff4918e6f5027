"""Reach of any arm on a vertical pivot: rings for the tool's point, sampled areas for directions and frames.

The pivot turns without end, as the base turns where it cannot, so that the reach of a point is a matter of
distance: a place c of the axis works for a point at p and a height z where |p - c| lies in the reach R(z).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from regionik.areas.reach_model import (
    FineRows,
    ReachModel,
    ReachQuery,
    Rows,
    Sectors,
    sector_polygons,
    wide_enough,
)
from regionik.planners.reach.level_reach import inner_reach, outer_reach
from regionik.planners.reach.pose_reach import pose_reach
from regionik.planners.solvers.posture_criteria import Thresholds
from regionik.postures.arm import Arm, aim_of
from regionik.postures.families import FRONT, Family
from regionik.postures.serial_solver import serial_solver
from regionik.worlds.arrays import Array
from regionik.worlds.criteria import Criteria
from regionik.worlds.errors import InputError
from regionik.worlds.scene import Target


@dataclass(frozen=True, eq=False)
class PivotedReach(ReachModel):
    """Reach of the tool's point of any arm.

    R(z) is bounded from within by the distances that walks at the height z pass (`level_walk`), and from
    outside by those that boxes of joint values do not rule out (`outer_bounds`).
    """

    @property
    def exhaustible(self) -> bool:
        return False

    def rows(self, targets: Sequence[Target], query: ReachQuery) -> Rows:
        """Whole rings; see `ReachModel`. Facings and headings do not matter."""
        self.thresholds(query.rules.criteria)
        return self._rings(targets, query)

    def fine_rows(self, target: Target, kinds: Sequence[Family], query: ReachQuery) -> FineRows:
        """See `ReachModel`; of one family only."""
        return self._rings([target], query)[1:]

    def _rings(self, targets: Sequence[Target], query: ReachQuery) -> Rows:
        positions = np.array([target.position for target in targets]).reshape(-1, 3)
        spans = self.distances(None, positions[:, 2], inner=query.inner)
        which = np.repeat(np.arange(len(spans)), [len(some) for some in spans])
        low, high = np.concatenate([np.empty((0, 2)), *spans]).T
        real = wide_enough(low, high, query)
        which, low, high = which[real], low[real], high[real]
        rings = Sectors(positions[which, :2], low, high, np.zeros(len(which)), np.full(len(which), np.pi))
        return which, (Family(FRONT),) * len(which), sector_polygons(rings, query)

    def distances(self, criteria: Criteria | None, heights: Array, *, inner: bool) -> list[Array]:
        """R(z) at each height; see `ReachModel`."""
        self.thresholds(criteria)
        reach, chain, base = inner_reach if inner else outer_reach, self.chain, self.height
        return [np.array(reach(chain, z - base)).reshape(-1, 2) for z in heights.tolist()]

    def families(self, target: Target, facings: tuple[int, ...], *, inner: bool) -> tuple[Family, ...]:
        """The one family there is; see `ReachModel`."""
        return (Family(FRONT),)

    def solver(
        self, family: Family, tolerance: float, *, turns: bool = True, criteria: Criteria | None = None
    ) -> Arm:
        """FABRIK-R; see `ReachModel`."""
        self.thresholds(criteria)
        return serial_solver(self.robot.chain, self.height, tolerance, turns=turns)

    def thresholds(self, criteria: Criteria | None) -> tuple[Thresholds, Thresholds] | None:
        """None, as nothing but limits can be asked; see `ReachModel`."""
        if criteria is not None and criteria.beyond_limits:
            criteria.check(self.robot)
            raise InputError(f"criteria: {self._refusal}, valid choices: joint_margin")
        return None

    @property
    def _refusal(self) -> str:
        return (
            f"{self.robot.name} does not work in one vertical plane: manipulability and effort are known for "
            "such arms only"
        )


@dataclass(frozen=True, eq=False)
class PosedReach(PivotedReach):
    """Reach for a tool direction or orientation of an arm that does not meet it in one plane.

    Inner areas are sampled on a grid of places (`pose_reach`), not proven. Outer ones bound the tool's point,
    which bounds its poses.

    Attributes
    ----------
    planar : bool
        Whether the arm works in one plane and its tool points across the last link.
    """

    planar: bool = False

    proven: ClassVar[bool] = False

    @property
    def exhaustible(self) -> bool:
        return self.planar  # a proof for the tool's point is one for its poses

    def rows(self, targets: Sequence[Target], query: ReachQuery) -> Rows:
        """Cells of the grid, or rings around them; see `ReachModel`."""
        if not query.inner:
            return super().rows(targets, query)
        self.thresholds(query.rules.criteria)
        return self._sampled(targets, query)

    def _sampled(self, targets: Sequence[Target], query: ReachQuery) -> Rows:
        shapes = [pose_reach(self.chain, self.height, aim_of(target)).area for target in targets]
        shapes = [shape.buffer(-query.rules.reach_margin, join_style="mitre") for shape in shapes]
        real = [i for i, shape in enumerate(shapes) if not shape.is_empty]
        rows = np.empty(len(real), dtype=object)
        rows[:] = [shapes[i] for i in real]
        return np.array(real, dtype=np.intp), (Family(FRONT),) * len(real), rows

    def fine_rows(self, target: Target, kinds: Sequence[Family], query: ReachQuery) -> FineRows:
        """Inner areas are those of `rows`; see `ReachModel`."""
        return self._sampled([target], query)[1:] if query.inner else super().fine_rows(target, kinds, query)

    @property
    def _refusal(self) -> str:
        if self.planar:
            return "a target with a direction needs a tool along the last link for manipulability and effort"
        return super()._refusal
