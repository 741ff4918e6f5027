"""The comparison: all asked alike, judged by one measure, and rivals praised where they are better."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import regionik as rik
from regionik.cli.app import run
from regionik.papers.comparison import DEFAULT, METHODS, Comparison, Score, compare, prepare_methods
from regionik.values import Configuration
from regionik.worlds.arms import sliding_chain
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError
from regionik.worlds.scene import Target
from tests.maths import Array

HINGES = """
version: 1
robot: hinge5
floor: {polygon: [[-1, -2], [4, -2], [4, 2], [-1, 2]]}
task:
  - {line: {from: [0.5, 0.0, 0.15], to: [1.5, 0.3, 0.15], count: 8}}
"""


@pytest.fixture(scope="module")
def pillar() -> Comparison:
    return compare(load_world("pillar"), (*DEFAULT, "mfabrik-areas"))


def test_answers_are_what_the_scores_say(pillar: Comparison) -> None:
    world = load_world("pillar")
    assert [score.method for score in pillar.scores] == [*DEFAULT, "mfabrik-areas"]
    for score in pillar.scores:
        answers = pillar.answers[score.method]
        off = [
            float(np.linalg.norm(world.robot.tool(one.base, one.joints)[:3, 3] - target.position))
            for one, target in zip(answers, world.task, strict=True)
        ]
        np.testing.assert_allclose(off, [one.error for one in answers], atol=1e-9)
        assert score.success == sum(error <= world.rules.tolerance for error in off)
        assert score.worst_error == pytest.approx(max(off), abs=1e-9)
        assert score.over_limits == 0
        assert score.microseconds > 0.0


def test_areas_keep_arm_and_base_off_things(pillar: Comparison) -> None:
    scores = {score.method: score for score in pillar.scores}
    inside, free = scores["mfabrik-areas"], scores["mfabrik"]
    assert inside.success == inside.setpoints
    assert inside.collisions == inside.off_floor == 0
    assert free.off_floor > 0
    assert scores["dls"].off_floor > 0


def test_a_better_rival_is_praised(pillar: Comparison) -> None:
    """Damped least squares needs fewer steps on a free floor, and the comparison says so."""
    assert any(line.startswith("dls beats mfabrik in iterations (") for line in pillar.beaten)


def _score(**other: float) -> Score:
    return replace(Score("mfabrik", 9, 8, 3.0, 50.0, 1.0, 1e-4, 2e-3, 0, 1, 1), **other)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"success": 9}, "success (9 against 8 of 9)"),
        ({"iterations": 2.0}, "iterations (2.00 against 3.00)"),
        ({"ratio": 0.5}, "time (0.50 of it)"),
        ({"worst_error": 1e-3}, "worst error (1 against 2 mm)"),
        ({"collisions": 0}, "collisions (0 against 1 set-points)"),
        ({}, ""),
        ({"success": 7, "ratio": 0.1}, ""),
    ],
)
def test_what_counts_as_better(other: dict[str, float], said: str) -> None:
    rival = replace(_score(**other), method="rival")
    wanted = (f"rival beats mfabrik in {said}",) if said else ()
    assert Comparison("w", (_score(), rival), {}).beaten == wanted
    assert Comparison("w", (rival,), {}).beaten == ()


def test_each_set_point_starts_from_the_last_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    world, seen = load_world("pillar"), []

    def method(target: Target, base: Array, joints: Array) -> Configuration:
        seen.append(base[0])
        return Configuration(base + [1.0, 0.0, 0.0], joints, 1.0, 1, False)

    monkeypatch.setitem(METHODS, "probe", lambda one: [method] * len(one.task))
    score = compare(world, ["probe"]).scores[0]
    assert np.isnan(score.ratio)
    assert score.success == 0
    assert seen[1 : 1 + len(world.task)] == [world.start.base[0] + k for k in range(len(world.task))]  # type: ignore[union-attr]


def test_a_robot_without_limits_and_a_world_without_a_start(tmp_path: Path) -> None:
    path = tmp_path / "hinges.world.yaml"
    path.write_text(HINGES)
    world = load_world(str(path))
    scores = {score.method: score for score in rik.compare(world, ["mfabrik", "dls", "ccd", "pinv"]).scores}
    assert {score.success for score in scores.values()} == {8}


def test_turned_mounts_and_headings_are_seen() -> None:
    """Base and arm answer in the world, whatever way the base looks."""
    world = load_world("pillar")
    turned = replace(world.robot, mount=np.array([0.1, -0.05, 0.2, 0.7]))
    scene = replace(world, robot=turned)
    for name, methods in prepare_methods(scene, ["dls", "ccd", "fabrik+dls"]).items():
        answer = methods[0](world.task[0], np.array([0.3, 0.4, 2.0]), world.robot.carry)
        assert answer.converged, name
        assert (
            np.linalg.norm(scene.robot.tool(answer.base, answer.joints)[:3, 3] - world.task[0].position)
            <= 1e-3
        )
        assert answer.base[2] == 2.0


def test_the_base_slides_along_two_joints() -> None:
    chain = robot_named("youbot").chain
    long = sliding_chain(chain)
    q = np.array([0.1, 0.5, -0.3, 0.2, 0.0])
    moved = long.forward(np.concatenate([[0.4, -0.2], q]))
    np.testing.assert_allclose(moved[:3, 3], chain.forward(q)[:3, 3] + [0.4, -0.2, 0.0], atol=1e-12)


@pytest.mark.parametrize("methods", [["mfabrik", "nonsense"], []])
def test_unknown_methods_are_refused(methods: list[str]) -> None:
    with pytest.raises(InputError, match="methods: expected some of mfabrik, mfabrik-areas, fabrik"):
        compare(load_world("pillar"), methods)


def test_a_network_takes_positions_alone() -> None:
    with pytest.raises(InputError, match="network: takes positions alone"):
        compare(load_world("wall"), ["network"])


@pytest.mark.slow
def test_a_network_drives_to_the_nearest_place_that_it_knows() -> None:
    world = load_world("pillar")
    world = replace(world, task=world.task[:3])
    found = compare(world, ["network"]).answers["network"]
    for one, target in zip(found, world.task, strict=True):
        off = np.linalg.norm(world.robot.tool(one.base, one.joints)[:3, 3] - target.position)
        assert off == pytest.approx(one.error, abs=1e-9)
        assert off < 0.05
        assert one.converged == (off <= world.rules.tolerance)


def test_no_task() -> None:
    with pytest.raises(InputError, match="task: expected at least one set-point"):
        compare(replace(load_world("pillar"), task=()))


def test_the_command(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    table, document = tmp_path / "scores.csv", tmp_path / "scores.json"
    assert run(["compare", "pillar", "--methods", "mfabrik,dls", "-o", str(table)]) == 0
    out, err = capfd.readouterr()
    assert out.splitlines()[1].startswith("mfabrik    15/15")
    assert "dls beats mfabrik" in err
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert [(row["method"], row["success"]) for row in rows] == [("mfabrik", "15"), ("dls", "15")]
    assert run(["compare", "pillar", "--methods", "dls", "--json", "-o", str(document)]) == 0
    out, _ = capfd.readouterr()
    for text in (out, document.read_text()):
        found = json.loads(text)
        assert found["ok"]
        assert found["methods"][0]["ratio"] is None
        assert len(found["methods"][0]["answers"]) == 15
        assert len(found["methods"][0]["answers"][0]["joints"]) == 5


@pytest.mark.parametrize(
    "arguments", [("pillar", "--methods", "newton"), ("pillar", "-o", "scores.txt"), ("nowhere",)]
)
def test_wrong_input_is_one_line_and_exit_code_2(
    arguments: tuple[str, ...], capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(["compare", *arguments]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
