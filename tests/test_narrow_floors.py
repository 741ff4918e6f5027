"""Floors hardly wider than the base, and bases that start at their bounds: planned, or told why not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik import plan, verify
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.limits import Execution
from regionik.worlds.obstacles import Box, Cylinder
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.kinds import BaseKind, Heading, Solid

REAL, POINTED = robot_named("youbot-real"), robot_named("youbot")  # 0.58 x 0.38 m, and a point
LENGTH = 4.6  # of the strips [m]


def of_kind(robot: Robot, base: BaseKind) -> Robot:
    return replace(robot, base=base, turning_radius=0.6 if base == "car" else 0.0)


def strip(width: float, base: BaseKind = "omni", *, yaw: float | None = 0.0, walls: bool = False) -> World:
    """A strip of floor, or of floor between walls, with a line along it; started at a heading, if at any."""
    floor, solids = shapely.box(0, 0, LENGTH, width), tuple[Box, ...]()
    if walls:
        floor = shapely.box(0, -0.5, LENGTH, width + 0.5)
        sides = {"left": width + 0.1, "right": -0.1}
        size = np.array([LENGTH, 0.2, 1.0])
        solids = tuple(Box(name, size, np.array([LENGTH / 2, y, 0.5])) for name, y in sides.items())
    task = tuple(Target(np.array([x, width / 2, 0.25])) for x in np.linspace(1.0, 3.6, 9))
    start = None if yaw is None else Start(np.array([0.5, width / 2, yaw]), REAL.carry)
    return World("strip", of_kind(REAL, base), Floor(floor), solids, task, Rules(clearance=0.0), start)


def refusal(world: World) -> str:
    with pytest.raises(NoPlanFound) as no:
        plan(world)
    return no.value.explanation.reason


@pytest.mark.parametrize(
    "width", [0.3801, *(pytest.param(width, marks=pytest.mark.slow) for width in (0.6, 0.45))]
)
def test_a_line_along_a_strip_of_floor_is_planned_at_every_width_above_the_footprints(width: float) -> None:
    made = plan(strip(width))
    assert made.lift_offs == 0
    assert verify(made).ok


@pytest.mark.parametrize(
    "world",
    [
        strip(0.5, yaw=None),
        pytest.param(
            strip(0.6, yaw=np.pi / 2), marks=pytest.mark.slow, id="no room to turn"
        ),  # it stands across
        strip(0.5, walls=True),
        strip(0.5, "differential"),
        strip(0.3801, "car"),
    ],
)
def test_a_strip_is_planned_for_every_start_and_drive_and_between_walls(world: World) -> None:
    assert verify(plan(world)).ok


@pytest.mark.parametrize("base", ["omni", "car"])
def test_stops_are_found_along_a_strip(base: BaseKind) -> None:
    world = strip(0.5, base)
    made = plan(replace(world, task=world.task[::4], rules=replace(world.rules, mode="stops")))
    assert len(made.stops) > 1
    assert verify(made).ok


def test_a_strip_narrower_than_the_footprint_is_refused_with_both_widths() -> None:
    for world in (strip(0.36), strip(0.36, yaw=None)):
        reason = refusal(world)
        assert "0.360 m" in reason
        assert "0.380 m" in reason


def test_a_side_without_floor_has_no_piece_to_start_on() -> None:
    free_space = scene_of(strip(0.5)).free_floor.by_heading
    assert any(side.free.is_empty for side in free_space.sides)
    assert all(piece.area > 0 for piece in free_space.pieces.polygon)
    label = free_space.piece_at(np.array([0.6, 0.25]), 0.0)
    assert label is not None
    assert shapely.union_all(free_space.whole(label)).area > 0


def started(
    robot: Robot,
    base: np.ndarray,
    solids: tuple[Solid, ...],
    heading: Heading = "free",
    clearance: float = 0.1,
) -> World:
    floor = Floor(shapely.box(-0.5, -1.5, 3.0, 1.5))
    task = tuple(Target(spot) for spot in np.linspace([0.7, 0.0, 0.25], [1.8, 0.1, 0.25], 5))
    rules = Rules(clearance=clearance, heading=heading)
    return World(
        "touching", robot, floor, solids, task, rules, Start(base, np.radians([0.0, 90, -60, 30, 0]))
    )


def block(x: float, y: float = 0.0, length: float = 0.2) -> Box:
    return Box("block", np.array([length, 0.2, 0.1]), np.array([x, y, 0.05]))


AT = np.zeros(3)
EDGE = np.array([-0.21000000000000002, 0.0, 0.0])  # 0.29 m off the floor's edge, with rounding
POST = Cylinder("post", 0.1, 0.1, np.array([-0.49, 0.0, 0.05]))


@pytest.mark.parametrize(
    "world",
    [
        started(POINTED, AT, (block(-0.2),)),
        started(POINTED, AT, (replace(POST, center=np.array([-0.2, 0.0, 0.05])),), "fixed"),
        started(POINTED, np.array([-0.5, 0.0, 0.0]), ()),
        started(REAL, EDGE, (), "fixed"),
        started(REAL, AT, (POST,)),
        started(of_kind(REAL, "car"), AT, (POST,)),
        started(
            of_kind(REAL, "differential"), AT, (block(0.0, 0.39, 2.0),)
        ),  # along it, where it cannot turn
    ],
)
def test_a_base_that_starts_exactly_at_its_bounds_leaves_from_there(world: World) -> None:
    assert world.start is not None
    made = plan(world)
    np.testing.assert_array_equal(made.motion.base[0], world.start.base)
    assert verify(made).ok


def test_a_start_that_an_execution_may_take_off_the_floor_touches_what_is_left_of_it() -> None:
    world = started(POINTED, AT, (block(-0.2),), clearance=0.05)
    rules = replace(world.rules, execution=Execution(base_error=0.05))
    assert verify(plan(replace(world, rules=rules))).ok


@pytest.mark.parametrize("off", [2e-9, 1e-6])
def test_a_start_nearer_than_its_clearance_is_blocked(off: float) -> None:
    assert "the base stands 0.100 m from block" in refusal(started(REAL, AT, (block(-0.49 + off),)))
