"""Long jobs: a print in layers, a wall that bends, hundreds of holes in a wing."""

from __future__ import annotations

from collections.abc import Callable
from cProfile import Profile
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import shapely

import regionik as rik
from benchmarks.bench_holes import wing
from benchmarks.bench_paths import COLUMNS, RIDGEBACK, SPEEDS, curved_wall, lifts_in_rows
from regionik.timing.retime import retime
from regionik.worlds.bundled import robot_named
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Target, World
from tests import MINUTES
from tests.harness.rasters import carried
from tests.known_arms import known_robot

SIDES = 1.0, 0.5  # of a printed outline [m]


def layers(count: int) -> World:
    """Return an outline of `SIDES`, layer on layer of 1 cm, a set-point each centimetre."""
    (a, b), step = SIDES, 0.01
    corners = np.array([[0.0, 0.0], [a, 0.0], [a, b], [0.0, b]])
    sides = [
        np.linspace(one, other, round(float(np.linalg.norm(other - one)) / step), endpoint=False)
        for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True)
    ]
    outline = np.concatenate(sides)
    points = [np.column_stack([outline, np.full(len(outline), 0.2 + step * k)]) for k in range(count)]
    floor = Floor(shapely.box(-2.0, -2.0, a + 2.0, b + 2.0))
    return World("print", robot_named("youbot"), floor, task=tuple(map(Target, np.concatenate(points))))


def calls_of(work: Callable[[], object]) -> int:
    """Return how many functions a piece of work calls."""
    counting = Profile(builtins=False)
    counting.runcall(work)
    return sum(entry.callcount for entry in counting.getstats())


def test_a_print_in_layers_is_done_in_one_stroke() -> None:
    """With about one state a set-point."""
    found = rik.plan(layers(2))
    assert found.lift_offs == 0
    assert len(found.motion) <= 1.1 * len(found.setpoints)
    assert rik.verify(found).ok


@pytest.mark.slow
def test_a_print_costs_what_its_length_costs_and_keeps_its_speed() -> None:
    """6 and 18 m: work in proportion, and the speed asked for but at ends and corners."""
    short, long = (calls_of(partial(rik.plan, layers(count))) for count in (2, 6))
    assert long <= 4 * short
    found = retime(rik.plan(layers(6)), SPEEDS)
    assert found.lift_offs == 0
    assert rik.verify(found).ok
    tool = found.stats["timing"]["tool"]
    assert tool["held"] > 0.95
    assert tool["held_elsewhere"] > 0.99


def ur5_on_a_ridgeback() -> Robot:
    x, y, mount, height = RIDGEBACK
    outline = np.array([(x, y), (-x, y), (-x, -y), (x, -y)])
    place = np.array([mount, 0.0, height, 0.0])
    return replace(known_robot("UR5"), footprint=outline, mount=place, body_height=height)


@pytest.mark.parametrize("count", [COLUMNS + COLUMNS // 2, pytest.param(4 * COLUMNS, marks=pytest.mark.slow)])
def test_no_row_along_a_curved_wall_is_interrupted(count: int) -> None:
    """Full poses along rows of 12 m."""
    world = curved_wall(ur5_on_a_ridgeback())
    found = rik.plan(replace(world, task=world.task[:count]))
    assert lifts_in_rows(found) == 0
    assert found.lift_offs <= 1
    assert rik.verify(found).ok


@pytest.mark.parametrize(
    "count", [pytest.param(48, marks=pytest.mark.slow), pytest.param(336, marks=MINUTES)]
)
def test_holes_in_a_wing_are_drilled_from_few_stops(count: int) -> None:
    """From no more places than areas prove to be needed."""
    found = rik.plan(wing(carried("UR10e", "differential"), count))
    assert len(found.stops) == 2
    assert found.stats["stops"]["proven_fewest"]
    assert sorted(i for stop in found.stops for i in stop.setpoints) == list(range(count))
    assert rik.verify(found).ok
