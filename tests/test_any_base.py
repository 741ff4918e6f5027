"""All postures from all places: what is ruled out holds nothing, what is found holds."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik.planners.collision.proximity import nearest
from regionik.planners.driving.footprint import fits
from regionik.planners.reach.any_base import bound_cell
from regionik.planners.reach.planar_cells import AWAY, PITCH, TURN, YAW
from regionik.planners.search.box_search import Verdict
from regionik.planners.solvers.planar_kinematics import two_link_angles
from regionik.postures.collision_checker import contact_for
from regionik.reachability.any_base import any_base_of, prepared, search_any_base
from regionik.reachability.reach import reach
from regionik.scene import scene_of
from regionik.verification.verifier import verify_answers
from regionik.worlds.arms import planar_arm
from regionik.worlds.bundled import robot_named
from regionik.worlds.obstacles import Sphere
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.maths import Array
from tests.test_random_worlds import random_world

HALL = Floor(shapely.box(-3, -3, 3, 3))


def posture(world: World, target: Target, mid: Array, elbow: float) -> tuple[Array, Array] | None:
    """Base and joints of a point of a cell by plain trigonometry; None where the arm cannot."""
    robot, arm = world.robot, planar_arm(world.robot.chain)
    a, b, c = arm.lengths
    x = mid[AWAY] - arm.shoulder[0] - c * np.cos(mid[PITCH])
    z = target.position[2] - arm.shoulder[1] - robot.mount[2] - c * np.sin(mid[PITCH])
    lead, root, tip, ok = two_link_angles(a, b, x, z)
    if not ok:
        return None
    first, second = lead + elbow * root, lead - elbow * tip
    q = robot.carry.copy()
    q[1:4] = arm.hinge_joints(np.array([first, second - first, mid[PITCH] - second]), q)
    zero = arm.pivot_zero + robot.mount[3]
    if world.rules.heading == "fixed":
        yaw = 0.0 if world.start is None else world.start.base[2]
        q[0] = np.remainder(mid[YAW] - yaw - zero + np.pi, 2 * np.pi) - np.pi
    else:
        q[0], yaw = mid[TURN], mid[YAW] - zero - mid[TURN]
    if (q < robot.chain.lower).any() or (q > robot.chain.upper).any():
        return None
    axis = target.position[:2] - mid[AWAY] * np.array([np.cos(mid[YAW]), np.sin(mid[YAW])])
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    return np.array([*(axis - turn @ robot.mount[:2]), yaw]), q


def is_answer(world: World, target: Target, base: Array, q: Array) -> bool:
    """Judged by code that the search does not use."""
    tool = world.robot.tool(base, q)
    assert np.linalg.norm(tool[:3, 3] - target.position) < 1e-9
    if target.direction is not None and tool[:3, 2] @ target.direction < np.cos(target.cone):
        return False
    proximity = nearest(
        scene_of(world).collision.bodies, base, q, contact=contact_for(world, [target]), within=0.0
    )
    return proximity.kind == "none" and bool(fits(scene_of(world).footprint, *base.tolist()))


@pytest.mark.parametrize("robot", ["youbot", pytest.param("youbot-real", marks=pytest.mark.slow)])
def test_a_cell_that_is_ruled_out_holds_no_answer(robot: str) -> None:
    rng, seen = np.random.default_rng(len(robot)), Counter[str]()
    for seed in range(10):
        world = replace(random_world(seed), robot=robot_named(robot))
        mount = prepared(scene_of(world)).mount
        for _ in range(60):
            spot = rng.uniform([-0.5, -1.5, 0.02], [4, 1.5, 0.6])
            target = Target(spot, world.task[0].direction, world.task[0].cone)
            mid = rng.uniform([-np.pi, -np.pi, -0.5, mount.low], [np.pi, np.pi, 0.6, mount.high])
            half = 10 ** rng.uniform(-3, -0.3) * rng.uniform([0.2, 0.2, 0.05, 0.2], [1, 1, 0.5, 1])
            half[TURN] = min(half[TURN], mount.high - mid[TURN], mid[TURN] - mount.low)
            elbow = float(rng.choice([-1.0, 1.0]))
            low, high = np.append(mid - half, elbow), np.append(mid + half, elbow)
            verdict = bound_cell(any_base_of(scene_of(world), target), low, high)
            for share in rng.uniform(-1, 1, (20, 4)):
                found = posture(world, target, mid + share * half, elbow)
                if found is not None and is_answer(world, target, *found):
                    assert verdict != Verdict.RULED_OUT, (seed, spot, mid, half, elbow)
                    seen["answers"] += 1
            seen["ruled out"] += verdict == Verdict.RULED_OUT
    assert seen["ruled out"] > 150
    assert seen["answers"] > 15


def test_what_is_found_passes_and_what_is_none_withstands_random_postures() -> None:
    rng, told = np.random.default_rng(3), Counter[Verdict]()
    for seed in range(6):
        world = random_world(seed)
        for spot in rng.uniform([0, -1, 0.02], [3, 1, 0.4], (6, 3)):
            target = Target(spot, world.task[0].direction, world.task[0].cone)
            looked = search_any_base(scene_of(world), target, 4000)
            told[looked.verdict] += 1
            if looked.pose is not None:
                assert is_answer(world, target, looked.pose.base, looked.pose.joints)
            if looked.verdict == Verdict.RULED_OUT:
                mount = prepared(scene_of(world)).mount
                for mid in rng.uniform(
                    [-np.pi, -np.pi, -0.6, mount.low], [np.pi, np.pi, 0.6, mount.high], (60, 4)
                ):
                    for elbow in (-1.0, 1.0):
                        found = posture(world, target, mid, elbow)
                        assert found is None or not is_answer(world, target, *found)
    assert told[Verdict.PROVEN] > 8
    assert told[Verdict.RULED_OUT] > 2


@pytest.mark.parametrize(("radius", "verdict"), [(0.245, "unreachable"), (0.155, "reachable")])
def test_a_ball_round_the_target_swallows_the_wrist_or_not(radius: float, verdict: str) -> None:
    """The last link may touch what the tool works on; the one before it begins 0.2175 m from the tool."""
    ball = Sphere("ball", radius, np.array([0.0, 0.0, 0.3]))
    rules = Rules(clearance=0.05, tool_contact=0.3, contact_depth=0.3)
    world = World("ball", robot_named("youbot"), HALL, (ball,), rules=rules)
    answer = reach(world, [[0.0, 0.0, 0.3]])
    assert answer.verdict.tolist() == [verdict]
    if verdict == "unreachable":
        assert "ball" in answer.reason[0]
    else:
        assert verify_answers(world, answer).ok


@pytest.mark.parametrize(("height", "angle", "verdict"), [
    (0.05, 0.0, "reachable"), (0.05, 0.7, "unreachable"), (0.05, np.pi, "unreachable"),
    (0.2, 0.0, "reachable"), (0.2, 0.7, "reachable"), (0.2, np.pi, "reachable"),
])  # fmt: skip
def test_an_arm_that_looks_back_has_its_base_in_the_way(height: float, angle: float, verdict: str) -> None:
    """The base is 0.14 m high and keeps its heading; the tool is to point level, that much off it."""
    low = level(height, angle)
    answer = reach(kept_heading(), [low])
    assert answer.verdict.tolist() == [verdict]
    if verdict == "unreachable":
        assert "itself and its base" in answer.reason[0]
    else:
        assert verify_answers(kept_heading(), answer, [low]).ok


def test_a_budget_that_is_spent_leaves_places_open() -> None:
    looked = search_any_base(scene_of(kept_heading()), level(0.05, 0.7), 50)
    assert looked.verdict == Verdict.OPEN
    assert 0 < looked.gap < 4


def kept_heading() -> World:
    robot = robot_named("youbot-real")
    return World("own", robot, HALL, rules=Rules(heading="fixed"), start=Start(np.zeros(3), robot.carry))


def level(height: float, angle: float) -> Target:
    return Target(np.array([0.5, 0.2, height]), np.array([np.cos(angle), np.sin(angle), 0.0]), 0.05)


def test_a_base_keeps_the_heading_that_its_rules_fix_alone() -> None:
    world = World("own", robot_named("youbot-real"), HALL)
    mount = prepared(scene_of(world)).mount
    assert mount.mount.tolist() == world.robot.mount[:2].tolist()
    assert np.isnan(mount.yaw)
    assert prepared(scene_of(replace(world, rules=replace(world.rules, heading="fixed")))).mount.yaw == 0.0
