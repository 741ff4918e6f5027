"""Plans that hold wherever their execution strays within the errors that the rules allow for."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import box

from regionik.output.urdf import robot_to_urdf
from regionik.pipeline import search, why
from regionik.regions import admissible_area
from regionik.scene import scene_of
from regionik.simulation.noise import typical_noise
from regionik.simulation.simulate import simulate
from regionik.timing.retime import retime
from regionik.values import Plan
from regionik.verification.verifier import verify
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Execution, Speeds
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Target, World
from tests import examples
from tests.opinion.judge import objections
from tests.planned import planned
from tests.plans import FOOTPRINT, plan_to_document, youbot
from tests.retold import facts_of
from tests.soak import against

ERRORS = Execution(base_error=0.02, heading_error=0.03, tool_error=0.004, arm_error=0.03)


def strict(world: World, errors: Execution = ERRORS) -> World:
    return replace(world, rules=replace(world.rules, execution=errors))


@cache
def strict_plan() -> Plan:
    """Past a block, with a footprint that is not round."""
    robot = replace(youbot(), footprint=np.array(FOOTPRINT))
    block = Box("block", np.array([0.6, 0.1, 0.6]), np.array([0.9, 0.35, 0.3]))
    task = tuple(Target(np.array([0.4 + 0.15 * k, 0.2, 0.3])) for k in range(8))
    rules = Rules(clearance=0.05, arm_clearance=0.01)
    return search(scene_of(strict(World("past", robot, Floor(box(-1, -1, 3, 2)), (block,), task, rules))))


def test_a_plan_holds_wherever_the_base_strays() -> None:
    """Each state's footprint, moved and turned by as much as the rules say, keeps floor and clearance."""
    plan, rng = strict_plan(), np.random.default_rng(0)
    world = plan.world
    shadows = [solid.shadow(below=world.robot.body_height) for solid in world.solids]
    for base in plan.motion.base:
        angle, size = rng.uniform(-np.pi, np.pi, 8), ERRORS.base_error * np.sqrt(rng.uniform(size=8))
        turn = ERRORS.heading_error * rng.choice([-1.0, 1.0], 8)
        off = np.column_stack([size * np.cos(angle), size * np.sin(angle), turn])
        for x, y, yaw in base + off:
            c, s = np.cos(yaw), np.sin(yaw)
            outline = shapely.MultiPoint(world.robot.footprint @ [[c, s], [-s, c]] + (x, y)).convex_hull
            assert world.floor.polygon.covers(outline)
            for shadow in shadows:
                assert shadow is None or shadow.distance(outline) >= world.rules.clearance


def test_the_second_opinion_knows_the_errors() -> None:
    assert against(strict_plan()) == ()
    plan = strict_plan()
    document = plan_to_document(plan)
    robot, floor = plan.world.robot, plan.world.floor.polygon
    for errors, kind in (({"base_error": 0.5}, "clearance"), ({"arm_error": 0.9}, "arm")):
        document["world"]["rules"]["execution"] = errors
        told = objections(document, robot_to_urdf(robot, floor), facts_of(robot))
        assert any(text.startswith(kind) for text in told), told


def standing(errors: Execution, *solids: Box, floor: float = 1.0, reach: float = 0.5) -> Plan:
    """A plan of one set-point ahead, made without errors and then asked to hold with them."""
    rules = Rules(clearance=0.05, reach_margin=0.0, avoidance=False)
    robot = replace(youbot(), footprint=np.array(FOOTPRINT))
    world = World("one", robot, Floor(box(-floor, -floor, floor, floor)), solids, (), rules)
    made = search(scene_of(replace(world, task=(Target(np.array([reach, 0.0, 0.2])),))))
    return replace(made, world=strict(made.world, errors), stats={})


@pytest.mark.parametrize(("errors", "kind"), [
    (Execution(), ""),
    (Execution(base_error=0.01), ""),
    (Execution(base_error=0.9), "floor"),
    (Execution(heading_error=2.5), "floor"),
    (Execution(arm_error=2.0), "arm"),
    (Execution(tool_error=0.00999), ""),
])  # fmt: skip
def test_a_plan_is_refused_where_errors_take_what_it_keeps(errors: Execution, kind: str) -> None:
    kinds = {violation.kind for violation in verify(standing(errors)).violations}
    assert (kind in kinds) if kind else not kinds


def test_an_arm_at_its_limits_cannot_take_up_what_the_base_is_off() -> None:
    plan = standing(Execution(base_error=0.01))
    robot, joints = plan.world.robot, plan.motion.joints[0]
    held = [
        replace(joint, lower=q - 1e-3, upper=q + 1e-3)
        for joint, q in zip(robot.chain.joints, joints, strict=True)
    ]
    stiff = replace(robot, chain=replace(robot.chain, joints=tuple(held)))
    found = verify(replace(plan, world=replace(plan.world, robot=stiff))).violations
    assert [violation.kind for violation in found] == ["execution"]
    assert "with the base 0.0100 m and 0.0000 rad off its place, no posture" in found[0].text


@pytest.mark.parametrize("name", ["pillar", "wall"])
@given(error=st.floats(0.001, 0.05), angle=st.floats(-np.pi, np.pi))
@settings(max_examples=examples(20))
def test_areas_are_eroded_by_the_base_error(name: str, error: float, angle: float) -> None:
    """Every place of the area, moved by the error, is one of the area without it."""
    world = load_world(name)
    target = world.task[4]
    plain = admissible_area(world, target).outer
    eroded = admissible_area(strict(world, Execution(error)), target).inner
    assert not eroded.is_empty
    moved = shapely.affinity.translate(eroded, error * np.cos(angle), error * np.sin(angle))
    assert plain.buffer(1e-9).covers(moved)


def test_errors_that_leave_nothing_are_the_cause() -> None:
    world = planned("pillar").world
    narrow = replace(world, task=world.task[4:5], start=None)
    explanation = why(strict(narrow, Execution(base_error=3.0)), narrow.task[0])
    assert explanation is not None
    assert "rules.execution" in [cause.name for cause in explanation.causes]


@pytest.mark.parametrize(("rules", "told"), [
    ({"execution": {"base_error": -1}}, "rules.execution.base_error: "),
    ({"execution": {"tool": 0.1}}, "'tool'"),
    ({"execution": {"heading_error": 4}}, "heading_error: must be below pi"),
    ({"execution": {"tool_error": 0.01}}, "tool_error: must be below path_tolerance, 0.01 m, got 0.01"),
])  # fmt: skip
def test_errors_that_make_no_sense_are_refused(rules: dict[str, object], told: str) -> None:
    document = {**world_to_document(planned("free").world), "rules": rules}
    with pytest.raises(InputError) as caught:
        world_from_document(document)
    assert told in str(caught.value)


def test_errors_come_back_from_a_file() -> None:
    world = strict(planned("free").world)
    assert world_from_document(world_to_document(world)).rules == world.rules


def test_a_run_tells_the_errors_that_it_needed() -> None:
    """The errors that a noisy run suggests hold all it did, and a plan made with them verifies."""
    world = planned("free").world
    task = tuple(Target(np.array([0.4 + 0.1 * k, 0.05 * k, 0.25])) for k in range(4))
    world = replace(world, task=task, start=None)
    speeds = Speeds(base_velocity=0.3, tool_velocity=0.1)
    run = simulate(retime(search(scene_of(world)), speeds), typical_noise(), seed=1)
    errors = run.execution
    off = np.hypot(*(run.base - run.reference.base)[:, :2].T)
    assert off.max() <= errors.base_error < off.max() + 2e-4
    assert run.figures["tool_error"]["worst"] <= errors.tool_error <= (errors.arm_error or 0.0)
    again = retime(search(scene_of(strict(world, errors))), speeds)
    assert verify(again).ok
