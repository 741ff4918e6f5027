"""Solids that touch where what they stand for does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.errors import InputError
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import disabled_pairs, self_collision_pairs
from tests.maths import translation

THIN, WIDE = 0.04, 0.5  # [m]


def arm(width: float, limit: float = np.pi, gap: float = 0.3) -> Robot:
    """Three level hinges with a box of some width and height on each link."""
    joints = tuple(
        Joint(f"j{k}", "revolute", -limit, limit, translation(x, 0, 0), np.array([0, 1.0, 0]))
        for k, x in enumerate((0.0, 0.3, gap))
    )
    boxes = tuple(
        LinkBox(k, f"box {k}", translation(0.15, 0, 0), np.array([0.3, 0.1, width])) for k in range(3)
    )
    chain = Chain(joints, translation(0.3, 0, 0))
    return Robot("arm", "omni", np.zeros((1, 2)), np.zeros(4), chain, boxes, 0.2, np.zeros(3))


def bodies(robot: Robot) -> list[np.ndarray]:
    return [solid.corners for solid in robot.all_solids]


def test_boxes_that_are_the_bodies_are_asked() -> None:
    robot = arm(THIN)
    assert self_collision_pairs(robot) == ((0, 2),)
    assert disabled_pairs(robot, bodies(robot)) == ([], [])


def test_wide_boxes_round_bodies_that_stay_apart_are_not_asked() -> None:
    robot, real = arm(WIDE, limit=1.2), arm(THIN, limit=1.2)
    pairs, notes = disabled_pairs(robot, bodies(real))
    assert pairs == [("box 0", "box 2")]
    assert notes == []
    assert self_collision_pairs(replace(robot, unchecked=tuple(pairs))) == ()


def test_wide_boxes_round_bodies_that_may_touch_are_asked() -> None:
    robot = arm(WIDE, gap=0.5)
    pairs, notes = disabled_pairs(robot, bodies(arm(THIN, gap=0.5)))
    assert (pairs, notes) == ([], [])


def test_where_next_to_nothing_is_left_it_is_said() -> None:
    pairs, notes = disabled_pairs(arm(3.0, limit=2.2), bodies(arm(0.2, limit=2.2)))
    assert pairs == [("box 0", "box 2")]
    (note,) = notes
    assert note.startswith(
        "the bounds of box 0 and box 2 touch in 95% of postures, the links themselves in up to"
    )


@pytest.mark.parametrize(("height", "asked"), [(0.35, False), (0.4, True)])
def test_a_link_that_is_nearly_always_in_the_base_is_not_asked_and_said(height: float, asked: bool) -> None:
    """The base is half a metre high; the arm stands in it, and link 1 comes out of it now and then."""
    outline, mount = (
        np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]),
        np.array([0, 0, height, 0]),
    )
    robot = replace(arm(THIN, limit=1.2), footprint=outline, body_height=0.5, mount=mount)
    assert {(-1, 1), (-1, 2)} < set(self_collision_pairs(robot))
    pairs, notes = disabled_pairs(robot, bodies(robot))
    assert (("base of arm", "box 1") not in pairs) == asked
    assert len(pairs) == len(notes)
    assert all("base of arm" in note and note.endswith("this pair is not checked") for note in notes)


def telescope(*ways: tuple[float, float, float]) -> Robot:
    """Tubes of 0.3 m, each of which slides by 0.25 m at most out of the one before."""
    joints = tuple(
        Joint(f"j{k}", "prismatic", 0.0, 0.25, np.eye(4), np.array(way)) for k, way in enumerate(ways)
    )
    tubes = tuple(
        LinkBox(k, f"tube {k}", np.eye(4), np.array([0.3, 0.06 - 0.01 * k, 0.06 - 0.01 * k]))
        for k in range(len(ways))
    )
    chain = Chain(joints, np.eye(4))
    return Robot("telescope", "omni", np.zeros((1, 2)), np.zeros(4), chain, tubes, 0.2, np.zeros(len(ways)))


def test_tubes_of_a_telescope_are_not_asked() -> None:
    along = (1.0, 0.0, 0.0)
    robot = telescope(along, along, along, along)
    assert self_collision_pairs(robot) == ((0, 2), (0, 3), (1, 3))
    pairs, notes = disabled_pairs(robot, bodies(robot))
    assert pairs == [("tube 0", "tube 2"), ("tube 0", "tube 3"), ("tube 1", "tube 3")]
    assert notes == []


def test_slides_that_cross_are_asked() -> None:
    """The last tube goes aside, and may run into those before the one that carries it."""
    along, aside = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    robot = telescope(along, along, along, aside)
    pairs, notes = disabled_pairs(robot, bodies(robot))
    assert pairs == [("tube 0", "tube 2")]
    assert notes == []


def test_links_that_touch_mostly_are_not_asked_and_told() -> None:
    robot = arm(1.0, limit=2.2)
    pairs, (note,) = disabled_pairs(robot, bodies(robot))
    assert pairs == [("box 0", "box 2")]
    assert note.endswith("the links themselves in up to 83%: this pair is not checked")
    assert disabled_pairs(robot, bodies(arm(0.2, limit=2.2))) == ([], [])


def test_a_file_names_pairs() -> None:
    youbot = robot_named("youbot")
    names = [solid.name for solid in youbot.solids]
    robot = replace(youbot, unchecked=((names[2], names[0]),))
    document = world_to_document(replace(load_world("slab"), robot=robot))
    read = world_from_document(document)
    assert read.robot.unchecked == ((names[2], names[0]),)
    assert self_collision_pairs(read.robot) == ((0, 3), (1, 3))
    assert world_to_document(read) == document
    document["robot"]["unchecked"] = [[names[0], "elbow"]]
    with pytest.raises(
        InputError,
        match=r"robot.unchecked\[0\]: expected names of solids \(link 1.*\) or 'base of youbot', got 'elbow'",
    ):
        world_from_document(document)
