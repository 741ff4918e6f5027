"""Reach without obstacles: places of the arm axis, by the model that suits arm and goal."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from regionik.areas.ground import EVERY, GUARD
from regionik.areas.pivoted_reach import PivotedReach, PosedReach
from regionik.areas.planar_reach import PlanarReach
from regionik.areas.reach_model import FineRows, ReachModel, ReachQuery, Rows
from regionik.postures.arm import Goal, goal_of
from regionik.postures.families import Family
from regionik.worlds.criteria import with_joint_margin
from regionik.worlds.errors import InputError
from regionik.worlds.planar_arm import planar_arm
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
