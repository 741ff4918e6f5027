"""A laboratory asked through every door: no robot with a column, torso or mast stands under a top."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely import affinity
from shapely.geometry.base import BaseGeometry

import regionik as rik
from regionik.cli.app import run
from regionik.view.floor_view import shown_floor
from regionik.view.world_picture import picture_of_world
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.maths import Array
from tests.test_colors import drawn

DATA = Path(__file__).parent / "data" / "lab"
# What stands on the base at the height of the tops, seen from above, in the base's frame [m].
STANDING = {
    "fetch_form": shapely.box(-0.22, -0.15, -0.02, 0.15),
    "tiago_form": shapely.box(-0.175, -0.115, 0.055, 0.115),
    "stretch_form": shapely.Point(-0.07, 0.13).buffer(0.035),
}
TOPS = shapely.box(0.9, 0.7, 2.1, 1.3) | shapely.box(2.7, -1.9, 5.3, 0.7)  # a bench, and a table too wide
SPOTS = ((1.2, 0.8, 0.9), (1.8, 1.2, 0.9), (2.85, -0.6, 0.9), (4.0, -0.6, 0.9))
MIDDLES = shapely.box(1.45, 0.95, 1.55, 1.05) | shapely.box(3.5, -1.1, 4.5, -0.1)
IN_THE_MIDDLE = 3  # of the wide table
UNDER = ((1.5, 1.0, 0.0), (1.3, 0.85, 2.0), (3.4, -0.6, -1.0))  # base poses
TURNS = 2 * np.pi * np.arange(72) / 72
KEPT = 0.01  # by what stands on the base [m]

robots = pytest.mark.parametrize("name", sorted(STANDING))
SLOW = {"fetch_form": pytest.mark.slow, "stretch_form": pytest.mark.slow}
few_robots = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=SLOW.get(name, ())) for name in sorted(STANDING)]
)


@cache
def laboratory(name: str) -> World:
    """Four objects on two tables under which each base fits, and nothing that stands on it."""
    robot = rik.load_robot(DATA / f"{name}.urdf", base="differential")
    solids = [
        Box(f"top {k}", np.array([x1 - x0, y1 - y0, 0.04]), np.array([(x0 + x1) / 2, (y0 + y1) / 2, 0.73]))
        for k, (x0, y0, x1, y1) in enumerate(shapely.bounds(shapely.get_parts(TOPS)).tolist())
    ]
    rules = Rules(
        clearance=0.05,
        arm_clearance=KEPT,
        mode="stops",
        order="any",
        stop_tolerance=0.02,
        skip_unreachable=True,
    )
    task = tuple(Target(np.array(spot)) for spot in SPOTS)
    return World(name, robot, Floor(shapely.box(-0.5, -3, 6.5, 3)), tuple(solids), task, rules)


def standing(name: str, base: Array) -> BaseGeometry:
    """What stands on the base where that is at a pose (3,)."""
    turned = affinity.rotate(STANDING[name], base[2], origin=(0, 0), use_radians=True)
    return affinity.translate(turned, *base[:2])


def room(name: str, base: Array) -> float:
    """Distance from what stands on the base to the nearest top, less than zero under one [m]."""
    shape = standing(name, base)
    return -1.0 if shape.intersects(TOPS) else float(shape.distance(TOPS))


def poses_over(name: str, axis: Array) -> Array:
    """Base poses (n, 3) all round with the arm's axis over a place (2,)."""
    x, y = laboratory(name).robot.mount[:2]
    c, s = np.cos(TURNS), np.sin(TURNS)
    return np.column_stack([axis[0] - c * x + s * y, axis[1] - s * x - c * y, TURNS])


def all_stand(name: str, places: Array) -> bool:
    """True if at some heading no body is under a top with the arm's axis over each place (n, 2)."""
    return all(any(room(name, pose) >= 0 for pose in poses_over(name, place)) for place in places)


def within(area: BaseGeometry, step: float) -> Array:
    """Places (n, 2) of an area that lie over the tops, so far apart [m]."""
    over = area & TOPS.buffer(0.3)
    x0, y0, x1, y1 = over.bounds if not over.is_empty else (0, 0, 0, 0)
    grid = np.stack(np.meshgrid(np.arange(x0, x1, step), np.arange(y0, y1, step)), axis=-1).reshape(-1, 2)
    found: Array = grid[shapely.contains_xy(over, grid)]
    return found


@robots
def test_each_base_alone_fits_under_the_tops(name: str) -> None:
    """So that what follows asks for what stands on it."""
    world = laboratory(name)
    assert world.robot.body_height + world.rules.clearance < min(top.z_range[0] for top in world.obstacles)


@pytest.mark.parametrize(
    "name", [pytest.param("fetch_form", marks=pytest.mark.slow), "stretch_form", "tiago_form"]
)
def test_inner_areas_hold_no_place_under_a_top(name: str) -> None:
    world = laboratory(name)
    areas = [rik.admissible_area(world, target).inner for target in world.task]
    assert [area.area > 0 for area in areas] == [True, True, True, False]
    for area in areas:
        assert all_stand(name, within(area, 0.04))


@robots
def test_fields_count_nothing_under_a_top(name: str) -> None:
    world = laboratory(name)
    field = rik.reach_field(world, world.task, cell=0.1)
    x, y = np.meshgrid(field.x, field.y)
    counted = np.column_stack([x[field.values > 0], y[field.values > 0]])
    assert len(counted) > 20
    assert all_stand(name, counted)
    assert all(room(name, pose) > 0 for pose in field.best)


@few_robots
def test_stops_park_beside_the_tables_with_their_circles(name: str) -> None:
    found = rik.stops(laboratory(name))
    assert sorted(i for stop in found for i in stop.setpoints) == [0, 1, 2]
    assert not any(stop.unconfirmed for stop in found)
    for stop in found:
        assert room(name, stop.base) >= stop.tolerance + KEPT - 1e-6


@pytest.mark.parametrize(
    "name", [pytest.param("fetch_form", marks=pytest.mark.slow), "stretch_form", "tiago_form"]
)
def test_reach_stands_beside_the_tables_and_from_under_them_says_why_not(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    world = laboratory(name)
    answer = rik.reach(world, world.task)
    assert answer.reachable.tolist() == [True, True, True, False]
    assert all(room(name, pose) >= KEPT - 1e-6 for pose in answer.base[answer.reachable])
    for pose in UNDER:
        assert room(name, np.array(pose)) < 0
        there = rik.reach(world, world.task, base=pose)
        assert set(there.verdict.tolist()) == {"unreachable"}
        assert all("overlaps top" in reason for reason in there.reason), there.reason
    path = tmp_path / "lab.world.yaml"
    path.write_text(json.dumps(world_to_document(world)))
    assert run(["reach", str(path), "--json", "--base", *map(str, UNDER[0])]) == 1
    assert "overlaps top" in capsys.readouterr().out


@few_robots
def test_plans_drive_round_the_tables(name: str) -> None:
    plan = rik.plan(laboratory(name))
    assert rik.verify(plan).ok
    assert [one.setpoint for one in plan.skipped] == [IN_THE_MIDDLE]
    assert all(room(name, pose) >= KEPT - 1e-6 for pose in plan.motion.base)


@robots
def test_pictures_show_no_free_floor_under_a_top(name: str) -> None:
    world = laboratory(name)
    floor = shown_floor(world)
    for place in within(floor.free, 0.1):
        assert all(room(name, pose) >= 0 for pose in poses_over(name, place)[::6]), place
    assert drawn(picture_of_world(world), "floor/rejected").buffer(0.01).covers(MIDDLES)
