"""Clear postures or why there is none: every answer against other code, every proof against a sweep."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from shapely.geometry import Point

from benchmarks.clutter import CERTAIN, ROBOTS, Scene, faults, free_posture, scene
from benchmarks.sweeps import SWEEPS
from regionik.planners.avoidance.clear_posture import ClearPosture, clear_posture
from regionik.planners.collision.proximity import nearest, room_of
from regionik.planners.collision.robot_bodies import ContactTargets, bodies_from
from regionik.planners.search.box_search import Verdict
from regionik.planners.search.fixed_base import PostureTask
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from regionik.worlds.links import capsules_along
from regionik.worlds.obstacles import Box, Cylinder, Prism, Sphere
from regionik.worlds.robot import Robot
from tests.maths import Array, planar_pose

SCENES = 150
PROOFS = 4  # swept
TOLERANCE = 1e-3
BUDGET = 3_000  # boxes, so that hard scenes stay undecided soon
PLANAR = ("youbot", "youbot-real")
HERE = np.zeros(3)
YOUBOT = robot_named("youbot")


def solved(one: Scene, seed: int = 0) -> ClearPosture:
    task = PostureTask(bodies_from(one.robot, one.solids), one.base, one.target, tolerance=TOLERANCE)
    return clear_posture(task, one.joints, seed=seed, most_boxes=BUDGET)


@cache
def answer_to(number: int) -> ClearPosture:
    return solved(scene(number), number)


def answers(count: int = SCENES) -> Iterator[tuple[Scene, ClearPosture]]:
    """The first scenes and their answers."""
    return ((scene(number), answer_to(number)) for number in range(count))


def flat_robot(links: int = 4, radius: float = 1e-6) -> Robot:
    chain = Chain.from_dh([(0, 0, 1, 0, -np.inf, np.inf)] * links)
    point, mount = np.zeros((1, 2)), np.zeros(4)
    return Robot("flat", "omni", point, mount, chain, capsules_along(chain, radius), 0.1, np.zeros(links))


@pytest.mark.slow
def test_no_answer_collides() -> None:
    found = [(one, answer) for one, answer in answers() if answer.joints is not None]
    assert len(found) > 100
    for one, answer in found:
        assert answer.verdict == Verdict.PROVEN
        assert answer.joints is not None
        assert not faults(one, answer.joints, TOLERANCE)
        error = float(np.linalg.norm(one.robot.tool(one.base, answer.joints)[:3, 3] - one.target))
        assert answer.error == pytest.approx(error, abs=1e-12)
        assert nearest(bodies_from(one.robot, one.solids), one.base, answer.joints).distance >= 0.0


@pytest.mark.slow
def test_no_sweep_finds_what_is_said_not_to_be() -> None:
    none = [one for one, answer in answers() if answer.verdict == Verdict.RULED_OUT and one.arm in PLANAR]
    assert len(none) >= PROOFS
    for one in none[:PROOFS]:
        assert free_posture(one, TOLERANCE, SWEEPS[one.arm]) is None


@pytest.mark.slow
def test_sweeps_find_what_is_there() -> None:
    free = [one for one, answer in answers() if answer.verdict == Verdict.PROVEN and one.arm in PLANAR]
    assert sum(free_posture(one, TOLERANCE, SWEEPS[one.arm]) is not None for one in free[:5]) >= 4


@pytest.mark.parametrize("arm", ["youbot", "hinge5"])
def test_sweeps_put_the_tool_on_the_target(arm: str) -> None:
    robot = ROBOTS[arm]
    target = robot.chain.forward(np.array([0.3, 0.9, -0.8, 1.1, 0.4]))[:3, 3]
    q = SWEEPS[arm](target)
    assert len(q) > 500
    np.testing.assert_allclose(
        robot.chain.forward(q)[:, :3, 3], np.broadcast_to(target, (len(q), 3)), atol=1e-12
    )


def test_same_seed_same_bits() -> None:
    for number in (0, 5, 20):
        one, first = scene(number), answer_to(number)
        again = solved(one, number)
        assert (again.verdict, again.steps) == (first.verdict, first.steps)
        assert (again.joints is None) == (first.joints is None)
        if again.joints is not None and first.joints is not None:
            assert again.joints.tobytes() == first.joints.tobytes()


def test_a_target_inside_an_obstacle_is_none_for_any_arm() -> None:
    for arm in ("youbot", "dof10", "pioneer7"):
        robot = ROBOTS[arm]
        target = robot.chain.forward(np.full(robot.chain.dof, 0.7))[:3, 3]
        bodies = bodies_from(robot, [Sphere("ball", 0.05, target)])
        answer = clear_posture(PostureTask(bodies, HERE, target), robot.carry)
        assert (answer.verdict, answer.steps) == (Verdict.RULED_OUT, ("passes",))


def test_a_target_out_of_reach_is_none() -> None:
    task = PostureTask(bodies_from(YOUBOT, []), HERE, np.array([1.5, 0, 0.3]))
    answer = clear_posture(task, YOUBOT.carry)
    assert (answer.verdict, answer.joints, answer.error) == (Verdict.RULED_OUT, None, np.inf)


def test_contact_lets_the_tool_in() -> None:
    ball = Sphere("ball", 0.05, np.array([0.45, 0.0, 0.2]))
    bodies = bodies_from(YOUBOT, [ball], 0.0, 0.1)
    contact = ContactTargets(ball.center[None], np.array([0]), 0.1)
    touching, shy = PostureTask(bodies, HERE, ball.center, contact), PostureTask(bodies, HERE, ball.center)
    assert clear_posture(shy, YOUBOT.carry).verdict == Verdict.RULED_OUT
    assert clear_posture(touching, YOUBOT.carry).verdict == Verdict.PROVEN
    shallow = PostureTask(bodies_from(YOUBOT, [ball], 0.0, 0.03), HERE, ball.center, contact)
    assert clear_posture(shallow, YOUBOT.carry).verdict == Verdict.RULED_OUT


def test_margin_is_kept() -> None:
    wall = Box("wall", np.array([0.05, 2.0, 2.0]), np.array([0.545, 0.0, 0.0]))
    bodies = bodies_from(YOUBOT, [wall], 0.01)
    off, beside = (PostureTask(bodies, HERE, np.array([x, 0, 0.3]), margin=0.005) for x in (0.46, 0.48))
    answer = clear_posture(off, YOUBOT.carry)
    assert answer.verdict == Verdict.PROVEN
    assert answer.joints is not None
    assert room_of(bodies, nearest(bodies, HERE, answer.joints)) >= 0.005
    assert clear_posture(beside, YOUBOT.carry).verdict == Verdict.RULED_OUT


def test_an_arm_that_must_run_into_its_base_is_told() -> None:
    robot = robot_named("youbot-real")
    task = PostureTask(bodies_from(robot, []), HERE, np.array([-0.05, 0.0, 0.1]))
    assert clear_posture(task, robot.carry).verdict == Verdict.RULED_OUT


def test_wherever_the_robot_stands_the_answer_is_the_same() -> None:
    for number in (4, 6, 13, 24):
        one, T = scene(number), planar_pose(0.7, -1.3, 2.0)
        solids = [solid.transformed(T) for solid in one.solids]
        base = np.array([*(T @ [*one.base[:2], 0, 1])[:2], one.base[2] + 2.0])
        moved = replace_scene(one, solids, base, (T @ [*one.target, 1])[:3])
        assert solved(moved, number).verdict == answer_to(number).verdict


def replace_scene(one: Scene, solids: list, base: Array, target: Array) -> Scene:  # type: ignore[type-arg]
    return one._replace(solids=solids, base=base, target=target)


@pytest.mark.slow
def test_a_slide_without_limits_is_undecided() -> None:
    robot = flat_robot()
    slide = Joint("rail", "prismatic", -np.inf, np.inf, np.eye(4))
    chain = Chain((slide, *robot.chain.joints[1:]), robot.chain.T_last_tool)
    robot = replace(robot, chain=chain)
    assert chain.unbounded
    ring = Point(1.0, 0.0).buffer(0.4) - Point(1.0, 0.0).buffer(0.2)
    bodies = bodies_from(robot, [Prism("ring", ring, -9.0, 9.0)])
    task = PostureTask(bodies, HERE, np.array([1.0, 0.0, 0.2]))
    assert clear_posture(task, robot.carry).verdict == Verdict.OPEN


def test_faults_are_seen() -> None:
    one, answer = next((s, a) for s, a in answers() if a.joints is not None and len(s.solids) > 3)
    assert answer.joints is not None
    tip = one.robot.tool(one.base, answer.joints)[:3, 3]
    post = Cylinder("post", 0.01, 0.02, tip)
    assert faults(one._replace(solids=[post]), answer.joints, TOLERANCE)
    assert faults(one._replace(target=one.target + 1.0), answer.joints, TOLERANCE)
    assert CERTAIN < 1e-5
