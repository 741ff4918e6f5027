"""Rasters of many poses: what areas of them cost, by counts, and how much of a file they take."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
import pytest
import shapely

from regionik.area_verification import verify_areas
from regionik.areas.reachable import PosedReach
from regionik.output.plan_file import load_plan
from regionik.pruning import prune_path, whole_path
from regionik.reach_table import inner_reach_tables, reach_table
from regionik.regions import path_areas, planned_areas
from regionik.scene import scene_of
from regionik.storage.plan_document import PARTS, plan_to_text, stored_areas
from regionik.values import Configuration, Motion, Plan
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.obstacles import Box, Cylinder
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.known_arms import known_robot
from tests.maths import rot_x

PLATFORM = np.array([[0.45, 0.3], [-0.45, 0.3], [-0.45, -0.3], [0.45, -0.3]])
WALL = Box("wall", np.array([6.0, 0.1, 2.0]), np.array([2.0, 1.05, 1.0]))
CRATE = Box("crate", np.array([0.5, 0.4, 0.3]), np.array([1.2, 0.4, 0.15]))
POST = Cylinder("post", 0.05, 2.0, np.array([2.4, 0.1, 1.0]))
AT_WALL = rot_x(-np.pi / 2)[:3, :3]  # the tool's axis into the wall


@cache
def arm_on_platform() -> Robot:
    arm = known_robot("UR5")
    chain = Chain(arm.chain.joints, arm.chain.T_last_tool)
    return Robot("UR5", "omni", PLATFORM, np.array([0.2, 0.0, 0.45, 0.0]), chain, (), 0.45)


def raster(count: int) -> World:
    """A row of poses on a wall, a crate and a post before it."""
    spots = [np.array([0.8 + 1.6 * k / (count - 1), 0.95, 0.9]) for k in range(count)]
    task = tuple(Target(spot, cone=0.01, orientation=AT_WALL) for spot in spots)
    floor = Floor(shapely.box(-1.0, -1.5, 5.0, 1.0))
    rules = Rules(clearance=0.05, avoidance=False)
    return World("raster", arm_on_platform(), floor, (WALL, CRATE, POST), task, rules)


def points(count: int) -> World:
    """Points for an arm in one plane, on a base that is longer than wide."""
    world = raster(count)
    task = tuple(Target(np.array([one.position[0], 0.75, 0.3])) for one in world.task)
    return replace(world, robot=robot_named("youbot-real"), task=task)


def pivoted_points(count: int) -> World:
    world = raster(count)
    return replace(world, task=tuple(Target(one.position) for one in world.task))


def with_areas(world: World) -> Plan:
    """A plan of the areas of a world, its base at rest."""
    free_space, areas, pruned = whole_path(scene_of(world))
    still = np.zeros(world.robot.chain.dof)
    one = Configuration(np.zeros(3), still, 0.0, 0, True)
    motion = Motion(np.zeros((1, 3)), still[None], np.array(["step"]), np.array([-1]), np.array([np.nan]))
    shown = planned_areas(scene_of(world), areas, free_space, pruned.left)
    return Plan(world, 0, (one,) * len(world.task), motion, shown, 0)


def calls(monkeypatch: pytest.MonkeyPatch, owner: Any, name: str, work: Callable[[], object]) -> int:
    """How often a function of an owner is called."""
    count, function = [0], getattr(owner, name)

    def counted(*args: Any, **kwargs: Any) -> Any:
        count[0] += 1
        return function(*args, **kwargs)

    with monkeypatch.context() as patched:
        patched.setattr(owner, name, counted)
        work()
    return count[0]


def test_areas_are_verified_without_unions_for_each_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    """There were one or two for each, over the slabs of heading: most of what verification cost."""
    made = []
    for count in (6, 18):
        plan = with_areas(raster(count))
        assert verify_areas(plan).ok
        made.append(calls(monkeypatch, shapely, "union_all", partial(verify_areas, plan)))
    few, many = made
    assert many <= few + 12


def test_reach_is_asked_once_where_headings_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    world = raster(4)
    spans = [side.span for side in scene_of(world).free_floor.turning.sides]
    assert len(spans) > 24
    work = partial(inner_reach_tables, scene_of(world), world.task, (1,), spans)
    assert calls(monkeypatch, PosedReach, "table", work) == 1


@pytest.mark.parametrize("make", [raster, points, pytest.param(pivoted_points, marks=pytest.mark.slow)])
def test_reach_is_that_of_each_span(make: Callable[[int], World]) -> None:
    world = make(3)
    for bounded in (False, True):
        chain = world.robot.chain
        if bounded:  # the pivot does not make up for the heading
            first, *others = chain.joints
            chain = Chain((replace(first, lower=-1.0, upper=1.0), *others), chain.T_last_tool)
        one = replace(world, robot=replace(world.robot, chain=chain))
        spans = [side.span for side in scene_of(one).free_floor.by_heading.sides][:6]
        for span, found in zip(
            spans, inner_reach_tables(scene_of(one), one.task, (1, -1), spans), strict=True
        ):
            alone = reach_table(scene_of(one), one.task, (1, -1), inner=True, span=span)
            assert found[0].tolist() == alone[0].tolist()
            assert found[1] == alone[1]
            assert shapely.equals_exact(found[2], alone[2]).all()


@pytest.mark.parametrize("make", [raster, points])
def test_admissible_areas_are_those_of_all_headings(make: Callable[[int], World]) -> None:
    world = make(5)
    free_space = scene_of(world).free_floor.turning
    areas, pruned = prune_path(scene_of(world), free_space, (1,))
    assert not callable(pruned)
    for i, shown in enumerate(planned_areas(scene_of(world), areas, free_space, pruned.left)):
        whole = shapely.union_all(
            path_areas(scene_of(world), facings=(1,), free_space=free_space).inner[areas.target == i]
        )
        assert shapely.symmetric_difference(shown.admissible, whole, grid_size=1e-9).area < 1e-7
        assert shapely.symmetric_difference(shown.pruned, pruned.area(i), grid_size=1e-9).area < 1e-7
        assert whole.area > 0.01


def test_areas_of_a_pose_take_few_bytes() -> None:
    """They took some 18,000, nine tenths of a file."""
    plan = with_areas(raster(6))
    said = plan_to_text(plan)
    features = said[said.index('"areas"') : said.index('"lift_offs"')]
    assert len(features) <= 4500 * len(plan.areas)
    assert all(one["geometry"]["geometries"] for one in json.loads(said)["areas"]["features"])


def test_areas_come_back_from_a_file_as_they_are_kept(tmp_path: Any) -> None:
    plan = with_areas(raster(6))
    plan.save(tmp_path / "plan.json")
    back = load_plan(tmp_path / "plan.json")
    assert verify_areas(back).ok
    for part in PARTS:
        kept = stored_areas(getattr(area, part) for area in plan.areas)
        read = np.array([getattr(area, part) for area in back.areas], dtype=object)
        assert shapely.equals_exact(shapely.normalize(kept), shapely.normalize(read)).all()
        assert shapely.equals_exact(stored_areas(read), read).all()
    back.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "plan.json").read_bytes()


NEARLY_TOUCHING = shapely.Polygon(
    [(0, 0), (1, 0), (1, 1), (0.5, 2e-9), (0, 1)]
)  # its waist is thinner than digits
OUTLINES = [
    NEARLY_TOUCHING,
    shapely.box(0, 0, 1, 1) - shapely.box(0.2, 0.2, 1.0 - 1e-9, 0.8),
    shapely.Point(0.1, 0.2).buffer(1 / 3, 64),
    shapely.box(0, 0, 1e-9, 1) | shapely.box(2, 0, 3, 1 / 3),
    shapely.Polygon(),
    shapely.GeometryCollection([shapely.box(0, 0, 1, 1), shapely.LineString([(2, 2), (3, 3)])]),
]


@pytest.mark.parametrize("shape", OUTLINES)
def test_outlines_are_kept_to_a_tenth_of_a_micrometre(shape: shapely.Geometry) -> None:
    (kept,) = stored_areas([shape])
    assert kept.is_valid
    corners = shapely.get_coordinates(kept)
    assert (np.round(corners, 7) == corners).all()
    off = shapely.symmetric_difference(shape.buffer(0), kept, grid_size=1e-10).area
    assert off <= 1e-7 * (1 + shape.length)
    assert shapely.equals_exact(stored_areas([kept]), kept).all()
