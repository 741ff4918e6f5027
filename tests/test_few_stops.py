"""Objects on tables and a shelf are picked from few stops, by an arm whose posture no place gives."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely

import regionik as rik
from regionik.parking.stops import find_served
from regionik.scene import scene_of
from regionik.values import Stop
from regionik.worlds.links import capsules_along
from regionik.worlds.obstacles import Box
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, StopCriterion, Target, World
from tests.test_closed_form import ARMS

TABLES = np.array([[1.0, 2.0], [3.2, 2.0]])
MOST = 5  # stops; a person does each of the tables from its long sides


@cache
def laboratory(each: int) -> World:
    """So many objects on each of two tables that the base does not get under."""
    chain = ARMS["ur"]
    outline, mount = 0.28 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), np.array([0.1, 0, 0.5, 0])
    robot = Robot("picker", "differential", outline, mount, chain, capsules_along(chain, 0.05), 0.4)
    tables = tuple(
        Box(f"table {k}", np.array([1.4, 0.8, 0.7]), np.array([*at, 0.35])) for k, at in enumerate(TABLES)
    )
    rng = np.random.default_rng(0)
    spots = [[*(at + rng.uniform([-0.6, -0.3], [0.6, 0.3])), 0.8] for at in TABLES for _ in range(each)]
    floor = Floor(shapely.box(-1.0, 0.0, 5.2, 4.0))
    rules = Rules(clearance=0.05, arm_clearance=0.01, mode="stops", order="any", stop_tolerance=0.03)
    return World("laboratory", robot, floor, tables, tuple(Target(np.array(one)) for one in spots), rules)


@cache
def found_by(criterion: StopCriterion, each: int) -> tuple[tuple[Stop, ...], int]:
    world = laboratory(each)
    found, parking, _ = find_served(
        scene_of(replace(world, rules=replace(world.rules, stop_criterion=criterion)))
    )
    return found, parking.lower


def test_tables_are_done_from_few_stops_and_the_bound_is_told() -> None:
    world = laboratory(12)
    found, lower = found_by("tolerance", 12)
    assert sorted(i for stop in found for i in stop.setpoints) == list(range(len(world.task)))
    assert 1 <= lower <= len(found) <= MOST


@pytest.mark.parametrize("each", [5, pytest.param(12, marks=pytest.mark.slow)])
@pytest.mark.parametrize("criterion", ["tolerance", "clearance", "manipulability", "distance"])
def test_every_criterion_takes_as_many_stops_that_all_serve_what_they_say(
    criterion: StopCriterion, each: int
) -> None:
    world = laboratory(each)
    found, _ = found_by(criterion, each)
    assert [stop.setpoints for stop in found] == [stop.setpoints for stop in found_by("tolerance", each)[0]]
    for stop in found:
        answer = rik.reach(world, [world.task[i] for i in stop.setpoints], base=stop.base)
        assert stop.unconfirmed == ()
        assert answer.reachable.all()
        assert stop.tolerance >= world.rules.stop_tolerance


def test_each_object_keeps_its_posture_all_round_the_circle_to_park_in() -> None:
    world = laboratory(5)
    for stop in found_by("tolerance", 5)[0]:
        for angle in np.arange(4) * np.pi / 2:
            rim = stop.base + world.rules.stop_tolerance * np.array([np.cos(angle), np.sin(angle), 0.0])
            assert rik.reach(world, [world.task[i] for i in stop.setpoints], base=rim).reachable.all()
