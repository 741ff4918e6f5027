"""Floor that is cut off: the obstacles that together do it, by name, and turns that lead there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik import plan, verify
from regionik.explain.cut_off import barrier
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.errors import Explanation, NoPlanFound
from regionik.worlds.joints import Joint
from regionik.worlds.links import capsules_along
from regionik.worlds.obstacles import Box
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests import MINUTES
from tests.kinds import Mode, Solid
from tests.maths import translation

POINTED, LONG = robot_named("youbot"), robot_named("youbot-real")
TURNS = np.arange(12) * np.pi / 6
ROUND = replace(POINTED, footprint=0.2 * np.column_stack([np.cos(TURNS), np.sin(TURNS)]))
HALL = shapely.box(-2, -2.5, 5, 2.5)
CRATE = Box("crate", np.array([0.3, 0.3, 0.3]), np.array([0.5, 1.5, 0.15]))
BOARDS = {"north", "south", "east", "west"}


def cupboard(size: float) -> tuple[Solid, ...]:
    """Five boards about a place of the floor, closed, and a crate outside."""
    half, thick = size / 2 + 0.02, 0.04
    along, across = np.array([size + 2 * thick, thick, 1.0]), np.array([thick, size, 1.0])
    roof = Box("roof", np.array([size + 2 * thick, size + 2 * thick, thick]), np.array([2.0, 0.0, 1.02]))
    return (
        CRATE,
        roof,
        Box("north", along, np.array([2.0, half, 0.5])),
        Box("south", along, np.array([2.0, -half, 0.5])),
        Box("east", across, np.array([2.0 + half, 0.0, 0.5])),
        Box("west", across, np.array([2.0 - half, 0.0, 0.5])),
    )


def world(
    robot: Robot,
    solids: tuple[Solid, ...],
    floor: shapely.Geometry = HALL,
    at: float = 2.0,
    mode: Mode = "continuous",
) -> World:
    start, rules = Start(np.zeros(3), robot.carry), Rules(clearance=0.05, mode=mode)
    task = (Target(np.array([at, 0.0, 0.3])),)
    return World("cut off", robot, Floor(floor), solids, task, rules, start)


def refused(asked: World) -> Explanation:
    with pytest.raises(NoPlanFound) as no:
        plan(asked)
    return no.value.explanation


def named(found: Explanation) -> set[str]:
    return {cause.name for cause in found.causes if cause.kind == "obstacle"}


@pytest.mark.parametrize(
    ("robot", "size"),
    [
        (POINTED, 1.2),
        pytest.param(POINTED, 0.6, marks=MINUTES),
        pytest.param(ROUND, 1.2, marks=MINUTES),
    ],
)
def test_the_boards_of_a_closed_cupboard_are_named_and_nothing_else(robot: Robot, size: float) -> None:
    found = refused(world(robot, cupboard(size)))
    assert found.verdict == "ladder-broken"
    assert named(found) == BOARDS
    assert "north, south, east and west cut it off" in found.reason
    assert "0.000 m wide" not in found.reason


def test_a_cupboard_that_the_arm_reaches_into_but_for_its_boards_is_told_so_with_stops_too() -> None:
    found = refused(world(POINTED, cupboard(0.6), mode="stops"))
    assert named(found) == BOARDS
    assert "where the base gets to, the arm was clear in none" in found.reason


@pytest.mark.parametrize("robot", [POINTED, ROUND, LONG])
def test_what_cuts_a_place_off_is_found_by_name(robot: Robot) -> None:
    inside, outside = np.array([[2.0, 0.0, 0.0]]), np.zeros(3)
    boards = cupboard(1.6)
    found = barrier(scene_of(world(robot, boards)), outside, inside)
    assert found is not None
    assert found.proven
    assert set(found.names) == BOARDS
    for board in BOARDS:
        opened = tuple(one for one in boards if one.name != board)
        assert barrier(scene_of(world(robot, opened)), outside, inside) is None


@pytest.mark.parametrize("robot", [POINTED, ROUND, LONG])
def test_a_wall_all_across_the_floor_is_named_and_floors_apart_are_the_floor(robot: Robot) -> None:
    there = np.array([[3.5, 0.0, 0.0]])
    wall = Box("wall", np.array([0.2, 5.0, 1.0]), np.array([1.5, 0.0, 0.5]))
    across = barrier(scene_of(world(robot, (CRATE, wall))), np.zeros(3), there)
    assert across is not None
    assert across.names == ("wall",)
    apart = shapely.MultiPolygon([shapely.box(-2, -1, 1, 1), shapely.box(2.5, -1, 5, 1)])
    parted = barrier(scene_of(world(robot, (CRATE,), apart)), np.zeros(3), there)
    assert parted is not None
    assert parted.names == ()
    assert parted.words == "the floor cuts it off"


def test_a_target_on_the_other_one_of_two_floors_is_refused_by_the_floor() -> None:
    apart = shapely.MultiPolygon([shapely.box(-2, -1, 1, 1), shapely.box(2.5, -1, 5, 1)])
    found = refused(world(POINTED, (CRATE,), apart, at=3.5))
    assert "the floor cuts it off" in found.reason
    assert "floor" in {cause.kind for cause in found.causes}


def unpivoted() -> Robot:
    """A long base whose arm has no pivot: within a slab of headings it reaches next to nothing."""
    joints = (
        Joint("lift", "prismatic", 0.0, 0.3, np.eye(4)),
        Joint("shoulder", "revolute", -2.0, 2.0, translation(0.0, 0.0, 0.3), np.array([0.0, 1.0, 0.0])),
        Joint("elbow", "revolute", -2.4, 2.4, translation(0.3, 0.0, 0.0), np.array([0.3, 0.9, -0.3])),
    )
    chain = Chain(joints, translation(0.3, 0.0, 0.0))
    solids, carry = capsules_along(chain, 0.02), np.array([0.2, -0.6, 0.9])
    return replace(LONG, name="unpivoted", chain=chain, solids=solids, base_solids=(), carry=carry)


def two_rooms(mode: Mode) -> World:
    """Set-points in two rooms, and a corridor that the circle round the base does not pass."""
    floor = shapely.box(0, 0, 2, 2) | shapely.box(1.9, 0.7, 4, 1.2) | shapely.box(3.9, 0, 6, 2)
    task = tuple(Target(np.array([x, 1.0, 0.6])) for x in (1.0, 5.0))
    return World("rooms", unpivoted(), Floor(floor), (), task, Rules(clearance=0.0, mode=mode))


def test_places_at_every_heading_are_joined_by_turning_between_them() -> None:
    asked = two_rooms("stops")
    circle, turned = scene_of(asked).free_floor.anywhere, scene_of(asked).free_floor.turning
    left, right = np.array([1.0, 1.0]), np.array([5.0, 1.0])
    assert circle.piece_at(left, 0.0) != circle.piece_at(right, 0.0)
    assert turned.piece_at(left, 0.0) == turned.piece_at(right, 2.0)
    assert turned.sides[0].free.equals(circle.sides[0].free)


@pytest.mark.parametrize("mode", ["stops", "continuous"])
def test_a_long_base_whose_arm_has_no_pivot_works_in_both_of_two_rooms(mode: Mode) -> None:
    made = plan(two_rooms(mode))
    assert made.lift_offs == 1
    assert verify(made).ok
