"""No inner area and no field holds a place where base and body cannot stand, by the second opinion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

import regionik as rik
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import translation
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.links import BASE, LinkBox
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.doors import Doors
from tests.furnished import furnished_world
from tests.opinion.body import Body
from tests.retold import machine_of

DAILY = range(4)
ALL = 16  # `make soak` goes through more of them


def under_a_table() -> World:
    """A column of 0.29 to 0.84 m on a low base, under a table whose top is at 0.71 m."""
    column = LinkBox(BASE, "column", translation(0.0, 0.0, 0.565), np.array([0.23, 0.23, 0.55]))
    robot = robot_named("youbot-real")
    robot = replace(robot, body_height=0.29, mount=np.array([0.0, 0.0, 0.86, 0.0]), base_solids=(column,))
    top = Box("table top", np.array([1.6, 0.8, 0.04]), np.array([1.5, 0.0, 0.69]))
    task = tuple(Target(np.array([1.5, y, 0.95])) for y in (0.2, -0.2))
    return World("lab", robot, Floor(shapely.box(-1, -2, 4, 2)), (top,), task, Rules(clearance=0.02))


def test_no_place_is_under_the_table() -> None:
    world = under_a_table()
    body, top = Body(world_to_document(world), machine_of(world)), shapely.box(0.7, -0.4, 2.3, 0.4)
    assert not body.stands_over(np.array([1.5, 0.0]))
    assert body.stands_over(np.array([1.5, 0.9]))
    for target in world.task:
        assert rik.admissible_area(world, target).inner.intersection(top).area == 0.0
    field = rik.reach_field(world, world.task, cell=0.1)
    x, y = np.meshgrid(field.x, field.y)
    assert field.values[(np.abs(x - 1.5) < 0.8) & (np.abs(y) < 0.4)].max() == 0


@pytest.mark.parametrize(
    "seed",
    [pytest.param(seed, marks=() if seed in DAILY else pytest.mark.slow) for seed in range(ALL)],
)
def test_areas_and_fields_hold_no_place_where_the_body_cannot_stand(seed: int) -> None:
    doors = Doors(furnished_world(seed))
    doors.areas()
    doors.field()
    assert not doors.wrong


@pytest.mark.slow
@pytest.mark.parametrize("seed", [580, 688])
def test_where_every_stop_is_confirmed_there_is_a_plan(seed: int) -> None:
    """The base alone would pass under a table; from between two tables the arm is hardly led out."""
    doors = Doors(furnished_world(seed))
    doors.stops()
    assert doors.seen["plans"]
    assert not doors.wrong
