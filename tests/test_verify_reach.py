from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely

from regionik.reachability.reach import reach
from regionik.values import Answer
from regionik.verification.verifier import verify_answers
from regionik.worlds.arrays import MAX_COORDINATE
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Execution
from regionik.worlds.obstacles import Box, Sphere
from regionik.worlds.scene import Floor, Target, World

WORLD = load_world("l_shape")
POINTS = np.array([[0.3, 0.65, 0.25], [0.5, 0.2, 0.3], [1.2, 0.3, 0.2], [0.0, 0.0, 3.0]])


@pytest.fixture(scope="module")
def answer() -> Answer:
    return reach(WORLD, POINTS)


def kinds(world: World, answer: Answer) -> set[str]:
    return {one.kind for one in verify_answers(world, answer).violations}


def test_what_is_found_holds(answer: Answer) -> None:
    report = verify_answers(WORLD, answer)
    assert answer.reachable.tolist() == [True, True, True, False]
    assert report.ok
    assert min(report.margins.values()) >= 0
    assert verify_answers(WORLD, answer, which=[1]).ok


@pytest.mark.parametrize(
    ("kind", "base", "joints"),
    [
        pytest.param("setpoint", (0.01, 0, 0), (0, 0, 0, 0, 0), id="base moved"),
        pytest.param("setpoint", (0, 0, 0), (0, 0.05, 0, 0, 0), id="joint moved"),
        pytest.param("joints", (0, 0, 0), (0, 0, 0, 0, 9.0), id="joint beyond its limit"),
        pytest.param("floor", (50.0, 0, 0), (0, 0, 0, 0, 0), id="base off the floor"),
    ],
)
def test_what_is_wrong_is_told(
    answer: Answer, kind: str, base: tuple[float, ...], joints: tuple[float, ...]
) -> None:
    moved = replace(answer, base=answer.base + base, joints=answer.joints + joints)
    report = verify_answers(WORLD, moved, which=[2])
    assert kind in {one.kind for one in report.violations}
    assert {one.setpoint for one in report.violations} == {2}
    assert all("target 3" in one.text for one in report.violations)


def test_a_solid_in_the_arm_is_told_where_the_rules_avoid(answer: Answer) -> None:
    elbow = WORLD.robot.frames(answer.base[0], answer.joints[0])[2, :3, 3]
    world = replace(
        WORLD, obstacles=(Sphere("ball", 0.05, elbow),), rules=replace(WORLD.rules, clearance=0.0)
    )
    assert "arm" in kinds(world, answer)
    assert "arm" not in kinds(replace(world, rules=replace(world.rules, avoidance=False)), answer)


def test_a_heading_that_was_fixed_is_kept(answer: Answer) -> None:
    fixed = replace(WORLD, rules=replace(WORLD.rules, heading="fixed"))
    found = reach(fixed, POINTS)
    assert verify_answers(fixed, found).ok
    assert kinds(fixed, replace(found, base=found.base + [0, 0, 0.1])) >= {"heading"}


def test_a_direction_is_held() -> None:
    ahead, across = ([Target(POINTS[0], np.array(way), 0.1)] for way in ([1.0, 0, 0], [0, 1.0, 0]))
    found = reach(WORLD, ahead)
    assert found.reachable.all()
    assert verify_answers(WORLD, found, ahead).ok
    assert "direction" in {one.kind for one in verify_answers(WORLD, found, across).violations}


@pytest.mark.parametrize(
    "rules",
    [
        {"path_tolerance": 1e-5},
        {"tolerance": 0.05},
        {"path_tolerance": 0.002, "execution": Execution(tool_error=0.0015)},
        {"mode": "stops", "stop_tolerance": 0.05},
        {"heading": "face_target"},
    ],
    ids=str,
)
def test_an_answer_is_held_to_the_tolerance_of_targets_not_to_that_of_paths(rules: dict[str, Any]) -> None:
    asked = replace(WORLD, rules=replace(WORLD.rules, **rules))
    found = reach(asked, POINTS[:2])
    report = verify_answers(asked, found)
    assert found.reachable.any()
    assert report.ok, report
    assert "path" not in report.margins
    off = replace(found, base=found.base + [2 * asked.rules.tolerance, 0, 0])
    assert "setpoint" in kinds(asked, off)


def test_answers_hold_as_far_from_the_origin_as_worlds_may_lie() -> None:
    away = MAX_COORDINATE - 10.0
    world = World(
        "far",
        WORLD.robot,
        Floor(shapely.box(away, -away, away + 3, -away + 3)),
        (Box("crate", np.array([0.2, 0.2, 0.6]), np.array([away + 1.2, -away + 1.8, 0.3])),),
        tuple(Target(np.array([away + 1 + 0.2 * k, -away + 1.5, 0.3])) for k in range(3)),
    )
    found = reach(world, world.task)
    assert found.reachable.all()
    assert verify_answers(world, found).ok


def test_bad_questions_are_refused(answer: Answer) -> None:
    with pytest.raises(InputError, match="expected 4"):
        verify_answers(WORLD, answer, [Target(POINTS[0])])
    with pytest.raises(InputError, match="rows of reachable targets, got 3"):
        verify_answers(WORLD, answer, which=[3])
