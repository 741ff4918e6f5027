"""Reach without obstacles: places of the arm axis, by the model that suits arm and goal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from regionik.areas.ground import EVERY, GUARD
from regionik.areas.planar_reach import PlanarReach
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
from regionik.postures.arm import Arm, Goal, aim_of, goal_of
from regionik.postures.families import FRONT, Family
from regionik.postures.serial_solver import serial_solver
from regionik.worlds.arms import planar_arm
from regionik.worlds.arrays import Array
from regionik.worlds.criteria import Criteria, with_joint_margin
from regionik.worlds.errors import InputError
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Target, World


def reach_model(robot: Robot, goal: Goal) -> ReachModel:
    """Return the model of an arm's reach that suits a kind of goal.

    Parameters
    ----------
    robot : Robot
        With the limits that postures must keep.
    goal : {"point", "direction", "orientation"}

    Returns
    -------
    PlanarReach
        Of an arm in one vertical plane, its tool along the last link where more than a point is asked. One
        model for all its goals.
    PivotedReach
        Of any other arm, for points.
    PosedReach
        Of any other arm, for directions and orientations.

    Examples
    --------
    >>> from regionik.worlds.bundled import robot_named
    >>> reach_model(robot_named("youbot"), "direction").exact
    True
    """
    point, pose = _models(robot)
    return point if goal == "point" else pose


@lru_cache(maxsize=256)
def _models(robot: Robot) -> tuple[ReachModel, ReachModel]:
    """The models for points and for poses."""
    try:
        planar = planar_reach(robot)
    except InputError:
        return PivotedReach(robot), PosedReach(robot)
    return planar, planar if planar.arm.tool_along_link else PosedReach(robot, planar=True)


@lru_cache(maxsize=256)
def planar_reach(robot: Robot) -> PlanarReach:
    """Return the reach of an arm in one vertical plane.

    Raises
    ------
    InputError
        When the arm does not work in one.
    """
    return PlanarReach(robot, planar_arm(robot.chain))


def model_of(world: World, target: Target) -> ReachModel:
    """Return the model of reach for a target, with the limits that the world's criteria leave."""
    return reach_model(with_joint_margin(world.robot, world.rules.criteria), goal_of(target))


def heeds_headings(world: World) -> bool:
    """True where areas of the world's task hold for a base that keeps to some headings."""
    robot = with_joint_margin(world.robot, world.rules.criteria)
    goals: set[Goal] = {"point", *map(goal_of, world.task)}
    return all(reach_model(robot, goal).heeds_headings for goal in goals)


def reach_rows(
    world: World,
    targets: Sequence[Target],
    facings: Sequence[int],
    *,
    inner: bool,
    span: tuple[float, float] = EVERY,
) -> Rows:
    """Reach of targets as rings and ring sectors, before rejection, the base's heading within a span.

    Returns
    -------
    target : (m,) array of int
        Ascending.
    family : tuple of Family
        One for each row.
    shape : (m,) array of geometry
    """
    query = ReachQuery(world.rules, world.rules.reach_margin if inner else None, span, tuple(facings))
    alike: dict[ReachModel, list[int]] = {}
    for i, target in enumerate(targets):
        alike.setdefault(model_of(world, target), []).append(i)
    which, shapes = np.empty(0, dtype=np.intp), np.empty(0, dtype=object)
    kinds: tuple[Family, ...] = ()
    for model, members in alike.items():
        rows = model.rows([targets[i] for i in members], query)
        which = np.concatenate([which, np.array(members, dtype=np.intp)[rows[0]]])
        kinds, shapes = kinds + rows[1], np.concatenate([shapes, rows[2]])
    order = np.argsort(which, kind="stable")
    return which[order], tuple(kinds[k] for k in order), shapes[order]


def fine_reach(
    world: World,
    target: Target,
    kinds: Sequence[Family],
    span: tuple[float, float],
    arcs: int,
    *,
    inner: bool,
) -> FineRows:
    """Reach of one target without the rules' margin, with finer circles: families and shapes.

    Parameters
    ----------
    world : World
    target : Target
    kinds : sequence of Family
    span : (low, high)
        Headings of the base [rad].
    arcs : int
        Vertices of a full circle.
    inner : bool
        True for shapes within the true reach, False for shapes around it.
    """
    query = ReachQuery(world.rules, GUARD if inner else None, span, arcs=arcs)
    return reach_model(world.robot, goal_of(target)).fine_rows(target, kinds, query)


@dataclass(frozen=True, eq=False)
class PivotedReach(ReachModel):
    """Reach of the tool's point of any arm.

    R(z) is bounded from within by the distances that walks at the height z pass (`meridian_plane`), and from
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
