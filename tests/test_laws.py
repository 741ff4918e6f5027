"""Laws that any planner of its kind would keep, whatever its method."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.affinity import affine_transform, scale

from regionik.pipeline import plan, search
from regionik.pruning import whole_path
from regionik.reachability.reach import reach
from regionik.regions import admissible_area, path_areas
from regionik.scene import scene_of
from regionik.values import Configuration, Plan
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.links import LinkCapsule
from regionik.worlds.obstacles import Box, Cylinder, Prism, Sphere
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests import examples
from tests.kinds import Solid
from tests.maths import Array
from tests.planned import planned
from tests.plans import plan_text, plan_to_document
from tests.test_random_worlds import random_world

FEW = settings(max_examples=examples(12))
SEEDS = st.integers(0, 400)
SOUND = [
    pytest.param(5, id="headings in a slab of no width are not that of the state before"),
    pytest.param(10, id="a wave"),
]


def sound_world(seed: int) -> World:
    """A random world whose tool may sink in where a set-point lies in a solid."""
    world = random_world(seed)
    return replace(world, rules=replace(world.rules, tool_contact=0.2, contact_depth=0.04))


@cache
def planned_sound(seed: int) -> Plan:
    return search(scene_of(sound_world(seed)))


def slim_world(seed: int) -> World:
    """A random world whose base is a point, so that areas cost milliseconds."""
    return replace(random_world(seed), robot=robot_named("youbot"))


def turned(shift: Array, yaw: float) -> Array:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, shift[0]], [s, c, shift[1]], [0, 0, 1.0]])


def moved(world: World, shift: Array, yaw: float) -> World:
    """The whole world turned about the origin, then shifted over the floor."""
    T = turned(shift, yaw)

    def at(point: Array) -> Array:
        return np.append(T[:2, :2] @ point[:2] + T[:2, 2], point[2:])

    def solid(one: Solid) -> Solid:
        if isinstance(one, Box):
            return replace(one, center=at(one.center), yaw=one.yaw + yaw)
        assert isinstance(one, Cylinder | Sphere)
        return replace(one, center=at(one.center))

    def target(one: Target) -> Target:
        way = None if one.direction is None else np.append(T[:2, :2] @ one.direction[:2], one.direction[2])
        return Target(at(one.position), way, one.cone)

    start = world.start
    assert start is not None
    return replace(
        world,
        floor=Floor(ground(world.floor.polygon, T)),
        obstacles=tuple(solid(one) for one in world.obstacles),
        task=tuple(target(one) for one in world.task),
        start=Start(np.array([*at(start.base[:2]), start.base[2] + yaw]), start.joints),
    )


def ground(shape: Any, T: Array) -> Any:
    return affine_transform(shape, [*T[0, :2], *T[1, :2], *T[:2, 2]])


@FEW
@given(SEEDS, st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_areas_move_with_the_world(seed: int, x: float, y: float, yaw: float) -> None:
    world, shift = slim_world(seed), np.array([x, y])
    other, T = moved(world, shift, yaw), turned(shift, yaw)
    one, two = admissible_area(world, world.task[0]), admissible_area(other, other.task[0])
    assert two.inner.difference(ground(one.outer, T).buffer(1e-6)).area < 1e-6
    assert ground(one.inner, T).difference(two.outer.buffer(1e-6)).area < 1e-6
    assert two.inner.area == pytest.approx(one.inner.area, rel=0.02, abs=0.005)
    assert two.outer.area == pytest.approx(one.outer.area, rel=0.02, abs=0.005)


@pytest.mark.parametrize(
    ("seed", "x", "y", "yaw"),
    [
        (5, 0.3, 4.0, 2.0),
        (10, 2.0, -1.0, 0.0),
        pytest.param(5, 2.0, -1.0, 0.0, marks=pytest.mark.slow),
        pytest.param(10, 0.3, 4.0, 2.0, marks=pytest.mark.slow),
    ],
)
def test_plans_move_with_the_world(seed: int, x: float, y: float, yaw: float) -> None:
    assert verify(search(scene_of(moved(sound_world(seed), np.array([x, y]), yaw)))).ok


def larger(robot: Robot, by: float) -> Robot:
    def frame(T: Array) -> Array:
        return np.block([[T[:3, :3], by * T[:3, 3:]], [T[3:]]])

    chain = robot.chain
    joints = tuple(replace(one, T_parent_joint=frame(one.T_parent_joint)) for one in chain.joints)
    solids = tuple(
        replace(one, start=by * one.start, end=by * one.end, radius=by * one.radius)
        for one in robot.solids
        if isinstance(one, LinkCapsule)
    )
    assert len(solids) == len(robot.solids)
    return replace(
        robot,
        footprint=by * robot.footprint,
        mount=np.append(by * robot.mount[:3], robot.mount[3]),
        chain=Chain(joints, frame(chain.T_last_tool)),
        solids=solids,
        body_height=by * robot.body_height,
    )


@FEW
@given(st.floats(0.2, 5), st.floats(0.0, 0.2), st.floats(0.1, 0.4), st.booleans())
def test_areas_grow_with_the_world(by: float, clearance: float, height: float, real: bool) -> None:
    robot = robot_named("youbot-real" if real else "youbot")
    post = np.array([0.45, 0.1, 0.2])

    def area(k: float) -> Any:
        obstacle = Cylinder("post", 0.05 * k, 0.4 * k, k * post)
        rules = Rules(clearance=clearance * k, reach_margin=0.005 * k)
        floor = Floor(shapely.box(-k, -0.5 * k, k, k))
        world = World("grown", larger(robot, k), floor, (obstacle,), (), rules)
        return admissible_area(world, [0.0, 0.0, height * k])

    one, two = area(1.0), area(by)
    for mine, other in ((one.inner, two.inner), (one.outer, two.outer)):
        grown = scale(mine, by, by, origin=(0, 0))
        assert grown.symmetric_difference(other).area <= (1e-3 * one.outer.area + 1e-6) * by**2


LENGTHS: tuple[str, ...] = (
    "clearance",
    "arm_clearance",
    "step",
    "tolerance",
    "path_tolerance",
    "tool_contact",
    "contact_depth",
)
LENGTHS += ("reach_margin", "stop_tolerance")


def in_units(world: World, by: float) -> World:
    """The same world measured in a unit of length that goes ``by`` times into a metre."""

    def solid(one: Solid) -> Solid:
        if isinstance(one, Box):
            return replace(one, center=by * one.center, size=by * one.size)
        if isinstance(one, Cylinder):
            return replace(one, center=by * one.center, radius=by * one.radius, height=by * one.height)
        assert isinstance(one, Sphere)
        return replace(one, center=by * one.center, radius=by * one.radius)

    start = world.start
    assert start is not None
    return replace(
        world,
        robot=larger(world.robot, by),
        floor=Floor(scale(world.floor.polygon, by, by, origin=(0, 0))),
        obstacles=tuple(solid(one) for one in world.obstacles),
        task=tuple(Target(by * one.position, one.direction, one.cone) for one in world.task),
        rules=replace(world.rules, **{key: by * getattr(world.rules, key) for key in LENGTHS}),
        start=Start(by ** np.array([1, 1, 0]) * start.base, start.joints),
    )


@pytest.mark.parametrize("seed", SOUND)
def test_a_plan_holds_in_any_unit(seed: int) -> None:
    """Lengths of world and plan in feet, centimetres or the like: the same verdict, margins in that unit."""
    made = planned_sound(seed)
    margins = verify(made).margins
    for by in (0.5, 3.280839895, 100.0):
        unit = by ** np.array([1, 1, 0])
        motion = replace(made.motion, base=unit * made.motion.base)
        done = tuple(
            Configuration(unit * one.base, one.joints, by * one.error, one.iterations, one.converged)
            for one in made.setpoints
        )
        world = in_units(made.world, by)
        report = verify(replace(made, world=world, motion=motion, setpoints=done, stats={}))
        assert report.ok, report.violations
        assert report.margins.keys() == margins.keys()
        for kind in margins.keys() & {"floor", "clearance", "setpoint", "path", "step"}:
            assert report.margins[kind] == pytest.approx(by * margins[kind], rel=0.02, abs=2e-4 * by), kind
        assert report.margins["joints"] == pytest.approx(margins["joints"])


@pytest.mark.parametrize(
    ("seed", "by"),
    [
        (5, 0.25),
        (10, 2.0),
        pytest.param(5, 2.0, marks=pytest.mark.slow),
        pytest.param(10, 0.25, marks=pytest.mark.slow),
    ],
)
def test_what_can_be_planned_can_be_planned_in_other_units(seed: int, by: float) -> None:
    other = search(scene_of(in_units(sound_world(seed), by)))
    assert other.lift_offs == planned_sound(seed).lift_offs
    assert verify(other).ok


@settings(max_examples=examples(6))
@given(SEEDS, st.integers(0, 2**31))
def test_an_obstacle_in_the_air_never_makes_a_target_reachable(seed: int, draw: int) -> None:
    """Whatever the arm has to go round besides, what was out of reach stays so."""
    world, rng = slim_world(seed), np.random.default_rng(draw)
    targets = rng.uniform([-0.5, -1.0, 0.1], [3.0, 1.0, 1.1], (4, 3))
    ball = Sphere("one more", 0.1, targets[0] + rng.normal(0.0, 0.15, 3))
    before, after = reach(world, targets), reach(replace(world, obstacles=(*world.obstacles, ball)), targets)
    assert not (after.reachable & (before.verdict == "unreachable")).any()


@FEW
@given(SEEDS, st.floats(-1, 3), st.floats(-1, 1), st.floats(0.05, 0.5))
def test_an_obstacle_never_adds_area(seed: int, x: float, y: float, radius: float) -> None:
    world = slim_world(seed)
    post = Cylinder("one more", radius, 1.0, np.array([x, y, 0.5]))
    fuller = replace(world, obstacles=(*world.obstacles, post))
    for target in (world.task[0], world.task[-1]):
        before, after = admissible_area(world, target), admissible_area(fuller, target)
        assert after.outer.difference(before.outer).area < 1e-6
        assert after.inner.difference(before.outer).area < 1e-6
        assert before.inner.is_empty <= (after.inner.area < 1e-4)
        assert not before.outer.is_empty or after.outer.is_empty


@FEW
@given(SEEDS, st.floats(0.0, 0.2))
def test_more_clearance_never_reaches_more(seed: int, more: float) -> None:
    world = slim_world(seed)
    tight = replace(world, rules=replace(world.rules, clearance=world.rules.clearance + more))
    before, after = admissible_area(world, world.task[0]), admissible_area(tight, world.task[0])
    assert after.outer.difference(before.outer).area < 1e-6
    assert not before.outer.is_empty or after.outer.is_empty


def shuffled(value: Any) -> Any:
    """A document with the keys of every mapping the other way round."""
    if isinstance(value, dict):
        return {key: shuffled(value[key]) for key in reversed(value)}
    return [shuffled(one) for one in value] if isinstance(value, list) else value


@pytest.mark.parametrize("name", ["pillar"])
def test_order_of_keys_gives_the_same_bytes(name: str) -> None:
    world = load_world(name)
    again = world_from_document(shuffled(world_to_document(world)))
    assert plan_text(plan(again)) == plan_text(planned(name))


@pytest.mark.parametrize("seed", SOUND)
def test_order_of_obstacles_and_corners_does_not_matter(seed: int) -> None:
    world = sound_world(seed)
    corners = list(world.floor.polygon.exterior.coords)[:-1]
    other = replace(
        world,
        floor=Floor(shapely.Polygon([*corners[2:], *corners[:2]][::-1])),
        obstacles=world.obstacles[::-1],
    )
    one, two = (plan_to_document(each) for each in (planned_sound(seed), search(scene_of(other))))
    assert [s["kind"] for s in one["states"]] == [s["kind"] for s in two["states"]]
    for mine, yours in zip(path_areas(scene_of(world)).inner, path_areas(scene_of(other)).inner, strict=True):
        assert mine.symmetric_difference(yours).area < 1e-9
    assert json.dumps(one["states"]) == json.dumps(two["states"])


def verdict_of(world: World) -> str:
    try:
        whole_path(scene_of(world))
    except NoPlanFound as failure:
        return failure.explanation.verdict
    return "whole"


@FEW
@given(SEEDS)
def test_the_way_back_has_the_same_areas(seed: int) -> None:
    """Admissible areas, and what pruning leaves of them, do not depend on the direction of travel."""
    world = replace(slim_world(seed), start=None)
    back = replace(world, task=world.task[::-1])
    verdicts = [verdict_of(each) for each in (world, back)]
    assert verdicts[0] == verdicts[1]
    if verdicts[0] != "whole":
        return
    _, _, there = whole_path(scene_of(world))
    _, _, home = whole_path(scene_of(back))
    count = len(world.task)
    assert len(there.breaks) == len(home.breaks)
    if there.breaks:
        return  # where the tool is lifted is a choice
    for i in range(count):
        mine, yours = there.area(i), home.area(count - 1 - i)
        assert mine.symmetric_difference(yours).area < 1e-9


def test_a_prism_is_the_box_of_its_corners() -> None:
    """Whichever way round its corners go."""
    world = load_world("pillar")
    box = world.obstacles[0]
    assert isinstance(box, Box)
    x, y = box.center[:2]
    dx, dy = box.size[:2] / 2
    corners = [(x - dx, y - dy), (x + dx, y - dy), (x + dx, y + dy), (x - dx, y + dy)]
    want = admissible_area(world, world.task[7]).inner
    for turn in range(4):
        for way in (1, -1):
            outline = shapely.Polygon([*corners[turn:], *corners[:turn]][::way])
            prism = Prism("pillar", outline, 0.0, float(box.size[2]))
            same = replace(world, obstacles=(prism,))
            assert admissible_area(same, world.task[7]).inner.symmetric_difference(want).area < 1e-9
