"""OMPL's planner of base moves, by its name in the rules."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import get_args

import numpy as np
import pytest
import shapely

import regionik as rik
from regionik.worlds.drives import BasePlanner
from regionik.worlds.scene import World
from tests.plans import plan_to_document

PLANNERS = get_args(BasePlanner)


@cache
def yard() -> World:
    """Two set-points at the ends of a yard with two walls to drive round, by a base on two wheels."""
    robot = rik.load_robot("pioneer-parm")
    places = {"near wall": (1.5, 1.3), "far wall": (3.5, 2.7)}
    size = np.array([0.2, 2.6, 0.8])
    walls = tuple(rik.Box(name, size, np.array([x, y, 0.4])) for name, (x, y) in places.items())
    task = tuple(rik.Target(np.array(spot)) for spot in ([0.3, 1.0, 0.5], [4.8, 3.0, 0.5]))
    rules = rik.Rules(clearance=0.05, mode="stops")
    return World("yard", robot, rik.Floor(shapely.box(-0.5, 0.0, 5.5, 4.0)), walls, task, rules)


@cache
def driven(planner: BasePlanner) -> rik.Plan:
    world = yard()
    return rik.plan(replace(world, rules=replace(world.rules, base_planner=planner)))


def length(plan: rik.Plan) -> float:
    """Way of the base [m]."""
    return float(np.hypot(*np.diff(plan.motion.base[:, :2], axis=0).T).sum())


@pytest.mark.parametrize("planner", PLANNERS)
def test_every_planner_drives_round_the_walls_and_its_plan_holds(planner: BasePlanner) -> None:
    found = driven(planner)
    assert found.stats["base_moves"]["ompl"] >= 1
    assert rik.verify(found).ok
    assert length(found) < 1.2 * min(length(driven(one)) for one in PLANNERS)


@pytest.mark.parametrize("planner", ["BKPIECE1", "BITstar"])
def test_the_same_seed_gives_the_same_plan(planner: BasePlanner) -> None:
    world = yard()
    again = rik.plan(replace(world, rules=replace(world.rules, base_planner=planner)))
    assert plan_to_document(again) == plan_to_document(driven(planner))


def test_a_planner_that_is_not_known_is_refused_with_the_valid_ones() -> None:
    with pytest.raises(rik.InputError, match=r"base_planner: expected one of RRT.*, AORRTC, got 'PRM'"):
        rik.Rules(base_planner="PRM")  # type: ignore[arg-type]
