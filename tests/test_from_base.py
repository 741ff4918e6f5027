"""What is reached with the base standing at one pose: postures, proofs, and words where there is neither."""

from __future__ import annotations

import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

import regionik as rik
from regionik.cli.app import run
from regionik.postures.poses import Pose
from regionik.scene import scene_of
from regionik.values import Answer
from regionik.worlds.arms import with_pivot_limits
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError
from regionik.worlds.links import BASE, LinkBox
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.furnished import robot_with
from tests.maths import translation
from tests.test_random_worlds import random_world

HALL = Floor(shapely.box(-3, -3, 3, 3))
HERE = (0.3, -0.2, 0.7)
AHEAD = np.array([0.3 + 0.45 * np.cos(0.7), -0.2 + 0.45 * np.sin(0.7), 0.25])


def empty(name: str = "youbot-real", **rules: object) -> World:
    return World("empty", robot_named(name), HALL, rules=Rules(**rules))  # type: ignore[arg-type]


def stands_exactly(answer: Answer, base: tuple[float, ...]) -> bool:
    return bool((answer.base[answer.reachable] == base).all())


@pytest.mark.parametrize("name", ["youbot-real", "pioneer7"])
def test_the_base_stays_exactly_where_it_is_said_to_stand(name: str) -> None:
    world = empty(name)
    spots = np.array(HERE[:2] + (0.0,)) + np.random.default_rng(0).uniform([-0.4, -0.4, 0.1], 0.5, (25, 3))
    answer = rik.reach(world, spots, base=HERE)
    assert 3 < answer.reachable.sum() < 25
    assert stands_exactly(answer, HERE)
    assert rik.verify_answers(world, answer).ok
    assert all((reason == "") == yes for reason, yes in zip(answer.reason, answer.reachable, strict=True))


def test_a_heading_that_is_given_leaves_what_the_pivot_reaches() -> None:
    """A pivot of half a radian either way: the arm reaches ahead and, bent back, behind, but not aside."""
    world = empty()
    chain = with_pivot_limits(world.robot.chain, -0.5, 0.5)
    world = replace(world, robot=replace(world.robot, chain=chain))
    axis = np.array(world.robot.mount[:2])
    for bearing, verdict in (
        (0.0, "reachable"),
        (0.45, "reachable"),
        (1.2, "unreachable"),
        (-1.5, "unreachable"),
    ):
        spot = [*(axis + 0.42 * np.array([np.cos(bearing), np.sin(bearing)])), 0.35]
        answer = rik.reach(world, [spot], base=[0, 0, 0])
        assert answer.verdict[0] == verdict, (bearing, answer.reason)
        assert rik.reach(world, [spot], base=[0, 0, bearing]).reachable[0]
        assert rik.verify_answers(world, answer).ok


@pytest.mark.parametrize("seed", range(3))
def test_what_is_reached_from_anywhere_is_reached_from_where_its_answer_stands(seed: int) -> None:
    world = random_world(seed)
    free = rik.reach(world, world.task)
    for i in np.flatnonzero(free.reachable)[:3].tolist():
        there = rik.reach(world, [world.task[i]], base=free.base[i])
        assert there.verdict[0] == "reachable", there.reason
        assert rik.verify_answers(world, there, [world.task[i]]).ok


def test_a_base_off_the_floor_or_in_a_solid_is_the_reason() -> None:
    crate = Box("crate", np.array([0.4, 0.4, 0.5]), np.array([1.0, 0.0, 0.25]))
    world = replace(empty(clearance=0.1), obstacles=(crate,))
    for base, said in (
        ([9.0, 0.0, 0.0], "stands off the floor there, by"),
        ([1.0, 0.0, 0.3], "stands inside crate there"),
        ([0.45, 0.0, 0.0], "m from crate there, and must keep 0.1000 m"),
    ):
        answer = rik.reach(world, np.array([AHEAD, [5.0, 5.0, 5.0]]), base=base)
        assert answer.verdict.tolist() == ["unreachable"] * 2
        assert all(said in reason for reason in answer.reason), answer.reason


@pytest.mark.parametrize("clearance", [0.0, 0.1])
def test_a_base_exactly_at_its_clearance_stands(clearance: float) -> None:
    half = float(np.abs(robot_named("youbot-real").footprint[:, 0]).max())
    face = half + clearance
    crate = Box("crate", np.array([0.5, 2.0, 0.12]), np.array([face + 0.25, 0.0, 0.06]))
    world = replace(empty(clearance=clearance), obstacles=(crate,))
    spot = [[0.1, 0.4, 0.3]]
    answer = rik.reach(world, spot, base=[0, 0, 0])
    assert answer.reachable[0], answer.reason
    assert rik.verify_answers(world, answer).ok
    nearer = rik.reach(world, spot, base=[1e-4, 0, 0])
    assert nearer.verdict[0] == "unreachable"
    assert "crate" in nearer.reason[0]


def test_what_stands_on_the_base_is_looked_at() -> None:
    """A column of 0.2 to 0.9 m under a table whose top is at 0.7 m: the base alone would fit."""
    column = LinkBox(BASE, "column", translation(0.0, 0.0, 0.55), np.array([0.2, 0.2, 0.7]))
    robot = robot_named("youbot")
    robot = replace(robot, mount=np.array([0.0, 0.0, 0.9, 0.0]), base_solids=(column,))
    top = Box("table top", np.array([1.0, 1.0, 0.04]), np.array([1.0, 0.0, 0.7]))
    world = World("lab", robot, HALL, (top,), rules=Rules(clearance=0.02))
    over = [[1.0, 0.0, 1.1]]
    under, beside = rik.reach(world, over, base=[0.8, 0, 0]), rik.reach(world, over, base=[0.3, 0, 0])
    assert under.verdict[0] == "unreachable"
    assert "column overlaps table top" in under.reason[0]
    assert beside.verdict[0] == "unreachable"  # by its length alone
    nearer = rik.reach(world, [[0.62, 0.0, 1.1]], base=[0.3, 0, 0])
    assert nearer.reachable[0]
    assert rik.verify_answers(world, nearer).ok


def test_an_arm_shut_in_by_walls_is_proven_to_reach_nothing_outside() -> None:
    walls = [
        Box(
            f"wall {k}",
            np.array([0.2, 0.8, 2.0]),
            np.array([0.3 * np.cos(a), 0.3 * np.sin(a), 1.0]),
            float(a),
        )
        for k, a in enumerate(np.arange(4) * np.pi / 2)
    ]
    world = World("shut in", robot_named("youbot"), HALL, tuple(walls), rules=Rules(clearance=0.0))
    answer = rik.reach(world, [[0.5, 0.0, 0.25], [0.0, 0.05, 0.5]], base=[0, 0, 0])
    assert answer.verdict.tolist() == ["unreachable", "reachable"], answer.reason
    assert "in no posture does the arm keep off" in answer.reason[0]


@pytest.mark.parametrize("name", ["youbot", "pioneer7"])
def test_what_a_posture_does_is_found(name: str) -> None:
    """Points, directions and orientations of postures that are clear, with cones narrow and wide."""
    world, rng = empty(name, tool_contact=0.0), np.random.default_rng(4)
    chain = world.robot.chain
    low, high = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    asked = list[Target]()
    while len(asked) < 12:
        q = rng.uniform(low, high)
        tool = world.robot.tool(HERE, q)
        if tool[2, 3] > 0.1 and scene_of(world).collision.clear(Pose(np.array(HERE), q)):
            spot, axis = tool[:3, 3], tool[:3, 2]
            asked += [Target(spot, axis, 0.05), Target(spot, axis, 2.0)]
            asked += [Target(spot), Target(spot, orientation=tool[:3, :3], cone=0.1)]
    answer = rik.reach(world, asked, base=HERE)
    assert answer.reachable.all(), answer.reason
    assert stands_exactly(answer, HERE)
    assert rik.verify_answers(world, answer, asked).ok


def test_a_cone_is_used_in_every_plane_of_the_arm() -> None:
    """With the base held the arm's plane is given, and only a tilted last link gets near to what is asked."""
    world, spot = empty("youbot"), np.array([0.35, 0.0, 0.3])
    asked = [
        Target(spot, np.array([np.cos(a), np.sin(a), 0.0]), cone) for a, cone in ((0.5, 0.6), (0.5, 0.4))
    ]
    answer = rik.reach(world, asked, base=[0.0, 0.0, 0.0])
    assert answer.reachable.tolist() == [True, False]
    assert rik.verify_answers(world, answer, asked).ok


def test_rules_of_heading_hold_there() -> None:
    fixed = replace(
        empty(heading="fixed"), start=Start(np.array([0, 0, 0.7]), robot_named("youbot-real").carry)
    )
    assert rik.reach(fixed, [AHEAD], base=HERE).reachable[0]
    turned = rik.reach(fixed, [AHEAD], base=[*HERE[:2], 0.8])
    assert turned.verdict[0] == "unreachable"
    assert "the rules fix the heading of the base at 0.7000 rad" in turned.reason[0]
    facing = empty("youbot", heading="face_target")
    spots = np.array([[0.4, 0.0, 0.25], [0.35, 0.2, 0.25]])
    answer = rik.reach(facing, spots, base=[0, 0, 0])
    assert answer.verdict.tolist() == ["reachable", "unreachable"]
    assert rik.verify_answers(facing, answer).ok


@pytest.mark.parametrize("body", ["column", "mast", "torso"])
def test_robots_with_bodies_reach_from_where_they_stand(body: str) -> None:
    rng = np.random.default_rng(3)
    world = World("room", robot_with(body, rng), HALL, rules=Rules(clearance=0.02))
    shoulder = float(world.robot.mount[2])
    spots = np.array([0.0, 0.0, shoulder]) + rng.uniform(-0.5, 0.5, (12, 3))
    answer = rik.reach(world, spots, base=[0, 0, 0.4])
    assert answer.reachable.any(), answer.reason
    assert rik.verify_answers(world, answer).ok


def test_it_does_not_matter_what_else_is_asked_or_who_works() -> None:
    world = load_world("pillar")
    spots = np.random.default_rng(1).uniform([0, -0.5, 0.1], [0.9, 0.5, 0.6], (40, 3))
    whole = rik.reach(world, spots, base=[0.1, 0, 0.3])
    with ProcessPoolExecutor(1) as pool:
        parts = rik.reach(world, spots, base=[0.1, 0, 0.3], chunk=7, executor=pool)
    alone = [rik.reach(world, [spot], base=[0.1, 0, 0.3]) for spot in spots]
    for other in (parts, *alone[:5]):
        n = len(other.verdict)
        assert other.verdict.tolist() == whole.verdict.tolist()[:n] or n == 1
    np.testing.assert_array_equal(parts.joints, whole.joints)
    np.testing.assert_array_equal(np.concatenate([one.joints for one in alone]), whole.joints)


@pytest.mark.parametrize("base", [[0, 0], [0, 0, np.inf], "here", [[0, 0, 0]]])
def test_a_pose_that_is_none_is_refused(base: object) -> None:
    with pytest.raises(InputError, match="base"):
        rik.reach(load_world("free"), [AHEAD], base=base)  # type: ignore[arg-type]


# --- the command


def test_the_command_answers_from_a_pose_in_every_format(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "targets.csv"
    table.write_text("x,y,z\n0.5,0.0,0.3\n1.5,0.0,0.3\n")
    there = ["--base", "0.1", "0", "0.3"]
    assert run(["reach", "pillar", *there, "--csv", str(table), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert [one["verdict"] for one in told["answers"]] == ["reachable", "unreachable"]
    assert told["answers"][0]["base"] == [0.1, 0.0, 0.3]
    for ending in (".csv", ".json", ".geojson"):
        output = tmp_path / f"answers{ending}"
        assert run(["reach", "pillar", *there, "--csv", str(table), "-o", str(output)]) == 1
        assert "cannot be reached from the base at (0.100, 0.000, 0.300)" in output.read_text()
        assert (
            "1 of 2 targets are reachable from x 0.100 m, y 0.000 m, yaw 0.300 rad" in capsys.readouterr().err
        )
    assert run(["reach", "pillar", "--target", "0.5 0 0.3", *there]) == 0
    assert "0.100, 0.000, 0.300" in capsys.readouterr().out


def test_the_table_of_another_pose_is_another_run(tmp_path: Path) -> None:
    from regionik.output.answers import _manifest
    from regionik.worlds.readers.csv_path import index_csv

    table = tmp_path / "targets.csv"
    table.write_text("x,y,z\n0.5,0.0,0.3\n")
    world, blocks = load_world("pillar"), index_csv(table, 500)
    poses: list[tuple[float, float, float] | None] = [None, (0.0, 0.0, 0.0), (0.0, 0.0, 0.1)]
    made = [json.dumps(_manifest(world, blocks, pose)) for pose in poses]
    assert len(set(made)) == 3
