"""Whole plans of bases with a shape and of bases on wheels, judged by code of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from regionik import plan, verify
from regionik.pipeline import search
from regionik.planners.tries import at_most, counted
from regionik.scene import scene_of
from regionik.values import Plan
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError, NoPlanFound
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests import MINUTES
from tests.kinds import BaseKind
from tests.maths import Array
from tests.random_arms import random_robot

RADIUS = 0.6  # of the car's turns [m]


def corridor(width: float, base: BaseKind = "omni") -> World:
    """Two rooms and a corridor between them, 2 m long; the tool goes through it."""
    shape = shapely.box(0, 0, 2, 2) | shapely.box(1.9, 0.7, 4, 0.7 + width) | shapely.box(3.9, 0, 6, 2)
    robot = replace(robot_named("youbot-real"), base=base, turning_radius=RADIUS if base == "car" else 0.0)
    path = [Target(np.array([x, 0.7 + width / 2, 0.25])) for x in np.linspace(1.0, 5, 41)]
    start = Start(np.array([0.7, 1.0, 1.57]), robot.carry)
    return World("corridor", robot, Floor(shape), (), tuple(path), Rules(clearance=0.0), start)


def wall(base: BaseKind) -> World:
    """Up and down along a wall, 3 m of it."""
    robot = replace(robot_named("youbot-real"), base=base, turning_radius=RADIUS if base == "car" else 0.0)
    path = [(x, 0.6, z) for x in np.linspace(0, 3, 9) for z in (0.2, 0.4)]
    brick = Box("wall", np.array([6.0, 0.1, 1.0]), np.array([2.0, 0.7, 0.5]))
    task = tuple(Target(np.array(spot)) for spot in path)
    start = Start(np.array([-1.0, -1.0, 0.5]), robot.carry)
    rules = Rules(clearance=0.05, arm_clearance=0.005)
    return World("wall", robot, Floor(shapely.box(-2, -2, 6, 1)), (brick,), task, rules, start)


def rolled(a: Array, b: Array, share: float) -> Array:
    """Pose on the circle that leaves a along its heading and comes to b, by its centre."""
    turn = (b[2] - a[2] + np.pi) % (2 * np.pi) - np.pi
    if abs(turn) < 1e-9:
        return np.array([*(a[:2] + share * (b - a)[:2]), a[2]])
    left = np.array([-np.sin(a[2]), np.cos(a[2])])
    last = np.array([-np.sin(a[2] + turn), np.cos(a[2] + turn)])
    radius = float((b - a)[:2] @ (left - last)) / float((left - last) @ (left - last))
    now = a[2] + share * turn
    spot = a[:2] + radius * left - radius * np.array([-np.sin(now), np.cos(now)])
    return np.array([*spot, now])


def footprints(made: Plan, shares: int) -> list[shapely.Polygon]:
    outline, found = made.world.robot.footprint, []
    base = made.motion.base
    for a, b in zip(base[:-1], base[1:], strict=True):
        for share in np.arange(shares) / shares:
            turn = (b[2] - a[2] + np.pi) % (2 * np.pi) - np.pi
            slid = a + share * np.array([*(b - a)[:2], turn])
            x, y, yaw = slid if made.world.robot.base == "omni" else rolled(a, b, float(share))
            c, s = np.cos(yaw), np.sin(yaw)
            found.append(shapely.Polygon(outline @ np.array([[c, s], [-s, c]]) + (x, y)))
    return found


@pytest.mark.parametrize(
    ("width", "base"),
    [
        pytest.param(0.5, "omni", marks=MINUTES),
        pytest.param(0.3801, "omni", marks=pytest.mark.slow),
        pytest.param(0.6, "differential", marks=pytest.mark.slow),
    ],
)
def test_a_long_base_passes_a_corridor_lengthwise(width: float, base: BaseKind) -> None:
    world = corridor(width, base)
    made = plan(world)
    assert made.lift_offs == 0
    assert verify(made).ok
    far = max(np.hypot(*corner) for corner in world.robot.footprint)
    assert 2 * far > width  # its circle would not pass
    floor = world.floor.polygon.buffer(1e-6)
    assert all(floor.covers(shape) for shape in footprints(made, 4))


def test_a_corridor_too_narrow_is_told_with_both_widths() -> None:
    with pytest.raises(NoPlanFound) as caught:
        search(scene_of(corridor(0.36)))  # `plan` looks for repairs too
    assert "0.360 m wide at its narrowest" in caught.value.explanation.reason
    assert "nowhere less than 0.380 m" in caught.value.explanation.reason
    beyond = corridor(0.36)
    with pytest.raises(
        NoPlanFound, match="has known places only on floor that the base cannot get to"
    ) as cut:
        search(scene_of(replace(beyond, task=beyond.task[:3] + beyond.task[-4:])))
    assert "0.360 m wide at its narrowest" in cut.value.explanation.reason


@pytest.mark.parametrize("base", ["differential", pytest.param("car", marks=pytest.mark.slow)])
def test_a_base_on_wheels_rolls_along_a_wall(base: BaseKind) -> None:
    world = wall(base)
    made = plan(world)
    report = verify(made)
    assert report.ok
    assert made.lift_offs == 0
    assert report.margins["wheels"] >= 0.0
    brick, floor = shapely.box(-1, 0.65, 5, 0.75), world.floor.polygon
    for shape in footprints(made, 4):
        assert floor.covers(shape)
        assert shape.distance(brick) >= world.rules.clearance - 1e-6
    motion = made.motion.base
    for a, b in zip(motion[:-1], motion[1:], strict=True):
        turn = (b[2] - a[2] + np.pi) % (2 * np.pi) - np.pi
        middle, chord = a[2] + turn / 2, (b - a)[:2]
        assert abs(chord[1] * np.cos(middle) - chord[0] * np.sin(middle)) <= 1e-9
        if base == "car" and abs(turn) > 1e-9:
            arc = np.hypot(*chord) / np.sinc(turn / (2 * np.pi))
            assert arc / abs(turn) >= RADIUS * (1 - 1e-9)


def test_a_circle_is_done_in_one_run_that_begins_far_from_joint_limits() -> None:
    robot = replace(random_robot("offsets", np.random.default_rng(1)), base="differential")
    turns = np.linspace(0, 2 * np.pi, 40)
    around = np.column_stack([np.zeros(40), 0.3 * np.cos(turns), 0.8 + 0.3 * np.sin(turns)])
    task = tuple(Target(spot, direction=np.array([1.0, 0.0, 0.0]), cone=0.05) for spot in around)
    made = plan(World("circle", robot, Floor(shapely.box(-4, -4, 4, 4)), task=task))
    assert made.lift_offs == 0
    assert verify(made).ok


@pytest.mark.parametrize(
    ("side", "behind", "lift_offs"),
    [
        pytest.param(2.6, False, 0, marks=pytest.mark.slow),
        pytest.param(6.0, True, 1, marks=MINUTES),
    ],
)
def test_a_car_is_told_where_it_does_not_get_through(side: float, behind: bool, lift_offs: int) -> None:
    """A bend of corridors with a set-point after it, and with one before it too."""
    bend = shapely.box(0, 0, 0.62, side) | shapely.box(0, side - 0.62, side, side)
    robot = replace(robot_named("youbot-real"), base="car", turning_radius=3.0)
    spots = [*([(0.31, 1.2)] if behind else []), (side - 0.8, side - 0.31)]
    task = tuple(Target(np.array([x, y, 0.25])) for x, y in spots)
    start = Start(np.array([0.31, 0.6, np.pi / 2]), robot.carry)
    world = World("bend", robot, Floor(bend), (), task, Rules(clearance=0.0), start)
    with pytest.raises(NoPlanFound) as caught:
        plan(world)
    assert "turning radius of 3 m" in caught.value.explanation.reason
    assert caught.value.explanation.causes[0].kind == "base"
    assert plan(replace(world, robot=replace(robot, base="omni"))).lift_offs == lift_offs


@pytest.mark.parametrize("heading", ["face_target", "fixed"])
def test_wheels_do_not_take_every_heading(heading: str) -> None:
    world = wall("car")
    with pytest.raises(InputError, match="a base on wheels turns as it drives, expected free"):
        plan(replace(world, rules=replace(world.rules, heading=heading)))  # type: ignore[arg-type]


TIGHT = Path(__file__).parent / "data" / "tight_car"  # a world of our own: random solids round a known motion


@pytest.mark.slow
def test_a_car_among_solids_is_planned_with_a_number_of_tries_that_goes_with_its_path() -> None:
    """About 320 in all; it once took two minutes of search to be refused."""
    world = load_world(TIGHT / "world.yaml")
    with counted() as tries, at_most(300 * len(world.task)):
        found = plan(world)
    assert verify(found).ok
    assert tries.made > len(world.task)
