from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik.planners.reach.rings import reach_intervals
from regionik.reachability.reach import reach
from regionik.regions import admissible_area
from regionik.verification.verifier import verify_answers
from regionik.worlds.arms import planar_arm
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError
from regionik.worlds.obstacles import Box, Sphere
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.test_random_worlds import random_world

SIDEWAYS = np.array([0.0, 0.0, np.pi / 2])


def test_every_yes_is_confirmed_and_every_no_is_empty() -> None:
    world = load_world("l_shape")
    world = replace(world, rules=replace(world.rules, contact_depth=0.3, tool_contact=0.3))
    rng = np.random.default_rng(0)
    targets = rng.uniform([-1, -1.5, 0], [4.5, 2.5, 0.9], (100, 3))
    answer = reach(world, targets)
    limits = world.robot.chain
    for k, target in enumerate(targets):
        area = admissible_area(world, target)
        if answer.reachable[k]:
            tool = world.robot.tool(answer.base[k], answer.joints[k])[:3, 3]
            assert np.linalg.norm(tool - target) <= 1e-3
            assert area.inner.distance(shapely.Point(answer.base[k, :2])) < 1e-9
            assert (answer.joints[k] >= limits.lower - 1e-9).all()
            assert (answer.joints[k] <= limits.upper + 1e-9).all()
            assert answer.reason[k] == ""
        else:
            assert answer.reason[k]
            assert np.isnan(answer.base[k]).all()
            assert (answer.verdict[k] == "unreachable") == area.outer.is_empty
    assert 15 < answer.reachable.sum() < 100
    assert (answer.verdict == "undecided").sum() == 0


@pytest.mark.parametrize("seed", range(4))
def test_random_worlds_are_decided(seed: int) -> None:
    world, rng = random_world(seed), np.random.default_rng(seed)
    spots = rng.uniform([-1.5, -2.5, 0], [5, 2.5, 0.9], (8, 3))
    targets = [Target(spot, world.task[0].direction, world.task[0].cone) for spot in spots]
    answer = reach(world, targets)
    report = verify_answers(world, answer, targets)
    assert report.ok, report.violations
    assert ((answer.gap > 0) <= (answer.verdict == "undecided")).all()
    for target, verdict, reason in zip(targets, answer.verdict, answer.reason, strict=True):
        assert (verdict == "reachable") == (reason == "")
        if verdict == "undecided":
            assert "touches" in reason or "not ruled out" in reason, (target, reason)


def test_the_very_end_of_the_reach_is_decided() -> None:
    world = load_world("free")
    arm = planar_arm(world.robot.chain)
    height = float(arm.shoulder[1] + world.robot.mount[2])
    top = reach_intervals(arm, height, np.array([0.6]))[0][-1, 1]
    floor = Floor(shapely.Point(0, 0).buffer(1e-3))
    small = replace(world, floor=floor, obstacles=(), rules=replace(world.rules, avoidance=False))
    targets = np.array([[top - 1e-4, 0, 0.6], [top + 0.9e-3, 0, 0.6], [top + 1.2e-3, 0, 0.6]])
    answer = reach(small, targets)
    assert answer.verdict.tolist() == ["reachable", "reachable", "unreachable"]
    assert verify_answers(small, answer).ok


def test_a_long_base_is_turned_into_a_narrow_passage() -> None:
    robot = robot_named("youbot-real")
    corridor = Floor(shapely.box(-0.4, -0.195, 3, 0.195))
    world = World("corridor", robot, corridor, rules=Rules(clearance=0.0))
    across = replace(world, rules=Rules(clearance=0.0, heading="fixed"), start=Start(SIDEWAYS, robot.carry))
    assert reach(world, [1.0, 0.0, 0.3]).verdict.tolist() == ["reachable"]
    assert reach(across, [1.0, 0.0, 0.3]).verdict.tolist() == ["unreachable"]


@pytest.mark.parametrize(("off", "verdict"), [(-0.01, "reachable"), (0.01, "unreachable")])
def test_the_edge_of_the_cone_is_decided(off: float, verdict: str) -> None:
    world = load_world("free")
    arm, z = planar_arm(world.robot.chain), 0.35
    height = float(arm.shoulder[1] + world.robot.mount[2])
    pitches = np.linspace(-np.pi / 2, 0, 600)
    reached = [len(reach_intervals(arm, height, np.array([z]), (p, p))[0]) > 0 for p in pitches]
    least = float(pitches[int(np.argmax(reached))])  # steepest pitch that any place allows
    assert 0 < np.argmax(reached) < len(pitches)
    steep = least - 0.3
    direction = np.array([np.cos(steep), 0.0, np.sin(steep)])
    answer = reach(world, [Target(np.array([1.0, 0.0, z]), direction, 0.3 - off)])
    assert answer.verdict.tolist() == [verdict]


def test_a_target_in_two_solids_is_told_apart() -> None:
    solids = (Sphere("ball", 0.2, np.array([1.0, 0, 0.4])), Sphere("bell", 0.2, np.array([1.0, 0.05, 0.4])))
    world = World("balls", robot_named("youbot"), Floor(shapely.box(-1, -1, 3, 1)), solids)
    answer = reach(world, [1.0, 0.02, 0.4])
    assert answer.verdict.tolist() == ["unreachable"]
    assert "ball" in answer.reason[0] or "bell" in answer.reason[0]
    ghost = replace(world, rules=Rules(avoidance=False))
    assert reach(ghost, [1.0, 0.02, 0.4]).verdict.tolist() == ["reachable"]


def test_a_target_that_takes_its_link_below_a_surface_is_ruled_out() -> None:
    """However deep the tool may touch, a point that is deeper than its link is thick is out of reach."""
    block = Box("block", np.array([2.0, 2.0, 0.6]), np.array([2.0, 0.0, 0.3]))
    robot = robot_named("pioneer7")
    world = World("block", robot, Floor(shapely.box(-2, -2, 3, 2)), (block,), rules=Rules(clearance=0.0))
    answer = reach(world, [[1.25, 0.0, 0.3]])
    assert answer.verdict.tolist() == ["unreachable"]
    assert "block" in answer.reason[0]


def test_one_bare_point_is_enough() -> None:
    assert reach(load_world("pillar"), [0.5, 0, 0.25]).verdict.tolist() == ["reachable"]


def test_bad_targets_are_refused() -> None:
    with pytest.raises(InputError, match="targets"):
        reach(load_world("pillar"), [[0, 0]])
