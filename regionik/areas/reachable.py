"""Reach without obstacles: places of the arm axis, by the model that suits arm and goal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import EVERY, united
from regionik.areas.planar_reach import PlanarReach
from regionik.areas.reach_model import (
    FineReachTable,
    ReachModel,
    ReachQuery,
    ReachTable,
    Sectors,
    sector_polygons,
    wide_enough,
)
from regionik.planners.progress import track
from regionik.planners.reach.level_reach import (
    Intervals,
    fixed_point_reach,
    inner_reach,
    inner_sectors,
    likely_reach,
    outer_layer,
    outer_reach,
)
from regionik.planners.reach.pose_reach import pose_reach
from regionik.planners.reach.proven_poses import likely_distances, proven_distances, proven_pose_area
from regionik.planners.reach.serial_criteria import PostureDemand, demand_of
from regionik.postures.arm import Arm, Goal, aim_of
from regionik.postures.families import FRONT, Family
from regionik.postures.serial_solver import serial_solver
from regionik.worlds.arms import pivot_joints, planar_arm, with_pivot_limits
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Criteria
from regionik.worlds.prepared import made_once
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Rules, Target

Bound = Callable[[Chain, float], Intervals]  # of R(z) [m]


def reach_model(robot: Robot, goal: Goal) -> ReachModel:
    """Return the model of an arm's reach, within the robot's limits, that suits a kind of goal.

    It is one `PlanarReach` for all goals of an arm in one vertical plane, its tool along the last link where
    more than a point is asked. Of any other arm it is `PivotedReach` for points, and `PosedReach` for
    directions and orientations.

    Examples
    --------
    >>> from regionik.worlds.bundled import robot_named
    >>> reach_model(robot_named("youbot"), "direction").exact
    True
    """
    point, pose = _models(robot)
    return point if goal == "point" else pose


@made_once
def _models(robot: Robot) -> tuple[ReachModel, ReachModel]:
    """The models for points and for poses."""
    try:
        planar = planar_reach(robot)
    except InputError:
        return PivotedReach(robot), PosedReach(robot)
    return planar, planar if planar.arm.tool_along_link else PosedReach(robot)


@made_once
def planar_reach(robot: Robot) -> PlanarReach:
    """Return the reach of an arm in one vertical plane; raises InputError when it does not work in one."""
    return PlanarReach(robot, planar_arm(robot.chain))


@dataclass(frozen=True, eq=False)
class PivotedReach(ReachModel):
    """Reach of the tool's point of any arm.

    R(z) is bounded from within by the distances that walks at the height z pass (`meridian`), and from
    outside by those that boxes of joint values do not rule out (`outer_bounds`). At a heading that the rules
    fix, inner areas are sampled on a grid of places (`pose_reach`) where the pivot does not turn all round.
    Under criteria besides limits they are places from which postures that meet them were found, or are proven
    where a query asks for that; outer ones leave these criteria aside.
    """

    def table(self, targets: Sequence[Target], query: ReachQuery) -> ReachTable:
        """Whole rings, or sectors of headings that the pivot cannot make up for; see `ReachModel`.

        Facings do not matter.
        """
        return self._sampled(targets, query) if self._is_sampled(query) else self._rings(targets, query)

    def fine_table(self, target: Target, kinds: Sequence[Family], query: ReachQuery) -> FineReachTable:
        return self.table([target], query)[1:]  # of the one family

    def is_proven(self, rules: Rules) -> bool:
        """True where base or pivot turn all round, see below, and limits are all that postures keep."""
        return self._turns_all_round(rules) and demand_of(self.robot, rules.criteria) is None

    def _turns_all_round(self, rules: Rules) -> bool:
        """True where the base, or the pivot at a heading that the rules fix, turns all round."""
        return self.turns_freely(rules, EVERY if rules.heading != "fixed" else (0.0, 0.0))

    def heeds_headings(self, query: ReachQuery) -> bool:
        if self._is_sampled(query) != self._is_sampled(query._replace(span=EVERY)):
            return True
        if self._is_sampled(query):
            return query.proven or not self._turns_all_round(query.rules)
        return query.inner and not self.turns_freely(query.rules, query.span)

    def _is_sampled(self, query: ReachQuery) -> bool:
        """True where a query is answered by cells of a grid."""
        if not query.inner:
            return False
        if demand_of(self.robot, query.rules.criteria) is None:
            return not self._turns_all_round(query.rules)
        return not self.turns_freely(query.rules, query.span)

    def _sampled(self, targets: Sequence[Target], query: ReachQuery) -> ReachTable:
        shapes = [self._sampled_area(target, query) for target in track("areas", targets)]
        rows = np.array(shapes, dtype=object)
        real = np.flatnonzero(~shapely.is_empty(rows))
        return real, (Family(FRONT),) * len(real), rows[real]

    def _sampled_area(self, target: Target, query: ReachQuery) -> BaseGeometry:
        bound, demand = not self._turns_all_round(query.rules), demand_of(self.robot, query.rules.criteria)
        heading = query.span[0] + float(self.robot.mount[3]) if bound else None
        area = _pose_area(self.chain, self.height, target, heading, demand, query.rules.reach_margin)
        if query.proven and not area.is_empty:
            low, high = (angle + float(self.robot.mount[3]) for angle in query.span)
            chain = with_pivot_limits(self.chain, *self.pivot(query.rules))
            aim = aim_of(target)
            area &= proven_pose_area(
                chain, self.height, aim, heading, (low, high), query.rounding_margin, demand, query.window
            )
        return area

    def _rings(self, targets: Sequence[Target], query: ReachQuery) -> ReachTable:
        positions = np.array([target.position for target in targets]).reshape(-1, 3)
        if query.inner and not self.turns_freely(query.rules, query.span):
            return self._sectors(positions, query)
        spans = self._distances(self._bound(query), positions[:, 2])
        which = np.repeat(np.arange(len(spans)), [len(some) for some in spans])
        low, high = np.concatenate([np.empty((0, 2)), *spans]).T
        real = wide_enough(low, high, query)
        which, low, high = which[real], low[real], high[real]
        rings = Sectors(positions[which, :2], low, high, np.zeros(len(which)), np.full(len(which), np.pi))
        return which, (Family(FRONT),) * len(which), sector_polygons(rings, query)

    def _sectors(self, positions: Array, query: ReachQuery) -> ReachTable:
        """Rings cut to the azimuths that pivot and base turn the tool to, united; see `inner_sectors`."""
        heights, level = np.unique(positions[:, 2], return_inverse=True)
        found = np.array([self._sectors_at(z, query) for z in heights.tolist()], dtype=object)[level]
        real = np.flatnonzero(~shapely.is_empty(found))
        by = np.repeat(positions[real, :2], shapely.get_num_coordinates(found[real]), axis=0)
        return real, (Family(FRONT),) * len(real), shapely.transform(found[real], lambda at: at + by)

    def _sectors_at(self, z: float, query: ReachQuery) -> BaseGeometry:
        """Sectors of a target at a height, above the floor's origin."""
        rows = np.reshape(inner_sectors(self.chain, z - self.height), (-1, 4))
        low, high, right, left = rows.T
        pivot, span = self.pivot(query.rules), query.span
        half = (pivot[1] - pivot[0] + span[1] - span[0] - (left - right)) / 2 - query.rounding_margin
        middle = float(self.robot.mount[3]) + (sum(pivot) + sum(span) + right + left) / 2
        real = wide_enough(low, high, query) & (half > 0)
        rings = Sectors(np.zeros((len(rows), 2)), low, high, middle + np.pi, half)
        return united(sector_polygons(Sectors(*(part[real] for part in rings)), query))

    def distances(self, criteria: Criteria | None, heights: Array, *, inner: bool) -> list[Array]:
        demand = demand_of(self.robot, criteria)
        if inner and demand is not None:
            return self._distances(partial(proven_distances, demand=demand), heights)
        return self._distances(inner_reach if inner else outer_reach, heights)

    def _distances(self, bound: Bound, heights: Array) -> list[Array]:
        chain, base = self.chain, self.height
        return [np.array(bound(chain, z - base)).reshape(-1, 2) for z in track("areas", heights.tolist())]

    def _bound(self, query: ReachQuery) -> Bound:
        demand = demand_of(self.robot, query.rules.criteria)
        if query.inner and demand is not None:
            return partial(proven_distances if query.proven else likely_distances, demand=demand)
        if query.coarse:
            return likely_reach if query.inner else outer_layer
        return inner_reach if query.inner else outer_reach

    def families(self, target: Target, facings: tuple[int, ...], *, inner: bool) -> tuple[Family, ...]:
        """The one family there is; see `ReachModel`."""
        return (Family(FRONT),)

    def solver(
        self, family: Family, tolerance: float, *, turns: bool = True, criteria: Criteria | None = None
    ) -> Arm:
        """FABRIK-R; see `ReachModel`."""
        demand = demand_of(self.robot, criteria)
        return serial_solver(self.robot.chain, self.height, tolerance, turns=turns, demand=demand)

    def meets(self, criteria: Criteria | None, joints: Array) -> bool:
        if not super().meets(criteria, joints):
            return False
        demand = demand_of(self.robot, criteria)
        return demand is None or demand.is_met_by(pivot_joints(self.robot.chain, joints))


@dataclass(frozen=True, eq=False)
class PosedReach(PivotedReach):
    """Reach for a tool direction or orientation of an arm that does not meet it in one plane.

    Inner areas are sampled on a grid of places (`pose_reach`), and cut to the squares in which each place is
    proven to have a posture (`proven_poses`) where a query asks for that. Outer ones bound the tool's point
    and other points of the tool that the pose fixes (`fixed_point_reach`).
    """

    def is_proven(self, rules: Rules) -> bool:
        return False

    def _is_sampled(self, query: ReachQuery) -> bool:
        return query.inner

    def _rings(self, targets: Sequence[Target], query: ReachQuery) -> ReachTable:
        which, kinds, shapes = super()._rings(targets, query)
        for i in np.unique(which).tolist():
            aim = aim_of(targets[i])._replace(cone=targets[i].cone)
            for center, rings in fixed_point_reach(self.chain, self.height, aim, coarse=query.coarse):
                shapes[which == i] &= _union(center, rings, query)
                if shapely.is_empty(shapes[which == i]).all():
                    break
        return which, kinds, shapes


@lru_cache(maxsize=1024)  # slabs of headings ask for the same one where the base turns for the pivot
def _pose_area(
    chain: Chain,
    height: float,
    target: Target,
    heading: float | None,
    demand: PostureDemand | None,
    margin: float,
) -> BaseGeometry:
    """Area of `pose_reach`, drawn in by a margin [m]; one that is too small for that is left whole."""
    found = pose_reach(chain, height, aim_of(target), heading, demand).area
    area: BaseGeometry = found.buffer(-margin, join_style="mitre")
    return found if area.is_empty else area


def _union(center: Array, rings: Array, query: ReachQuery) -> BaseGeometry:
    """Rings (k, 2) about one center as one area."""
    centers, azimuth = np.tile(center, (len(rings), 1)), np.zeros(len(rings))
    whole = Sectors(centers, rings[:, 0], rings[:, 1], azimuth, azimuth + np.pi)
    union: BaseGeometry = shapely.union_all(sector_polygons(whole, query))
    return union
