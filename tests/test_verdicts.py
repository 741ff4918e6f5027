"""Verdicts say what is known: `unreachable` is a proof, and `reach`, `why` and `plan` agree on it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.cli.app import run
from regionik.pipeline import plan, why
from regionik.reachability.reach import reach
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.errors import Explanation, NoPlanFound
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Target, World
from tests import examples

PIONEER7 = robot_named("pioneer7")


def turned() -> World:
    """A tool direction that no posture is known for, its wrist within reach: inner areas are sampled."""
    target = Target(np.array([0.3, 0.4, 0.5]), np.array([0.0, 0.0, -1.0]), 0.1)
    return World("turned", PIONEER7, Floor(shapely.box(-2, -2, 2, 2)), (), (target,))


def lane() -> World:
    """A lane too narrow for the circle round the base, under an arm whose first joint has limits."""
    first, *rest = PIONEER7.chain.joints
    chain = Chain((replace(first, lower=-2.9, upper=2.9), *rest), PIONEER7.chain.T_last_tool)
    corners = np.array([[0.4, 0.15], [-0.4, 0.15], [-0.4, -0.15], [0.4, -0.15]])
    robot = replace(PIONEER7, chain=chain, footprint=corners)
    target = Target(np.array([0.3, 0.3, 0.3]))
    return World("lane", robot, Floor(shapely.box(-2, -0.2, 2, 0.2)), (), (target,), Rules(avoidance=False))


def refused(world: World) -> Explanation:
    with pytest.raises(NoPlanFound) as caught:
        plan(world)
    return caught.value.explanation


def check_undecided(found: Explanation | None) -> None:
    assert found is not None
    assert found.verdict == "undecided"
    assert found.reason.startswith("No way was found to reach the target at ")
    assert "cannot" not in found.reason
    assert "would decide it" in found.reason
    assert "What rules it out" not in found.reason
    assert "By inner areas alone, which prove nothing, what stands in the way is" in found.reason


def test_an_empty_inner_area_is_no_proof() -> None:
    world = turned()
    assert reach(world, world.task).verdict.tolist() == ["undecided"]
    check_undecided(why(world, world.task[0]))
    check_undecided(why(world))
    check_undecided(refused(world))


def test_a_plan_turns_the_base_as_reach_does() -> None:
    world = lane()
    assert reach(world, world.task).reachable.all()
    assert why(world, world.task[0]) is None
    assert why(world) is None
    assert verify(plan(world)).ok


def small_world(seed: int) -> World:
    """A target in a room just wide enough, or not, for an arm in one plane or not, with a post or without."""
    rng = np.random.default_rng(seed)
    arm = robot_named(str(rng.choice(["pioneer7", "youbot-real"])))
    first, *rest = arm.chain.joints
    half = float(rng.uniform(0.5, 3.1))
    chain = Chain((replace(first, lower=-half, upper=half), *rest), arm.chain.T_last_tool)
    long, wide = rng.uniform([0.2, 0.1], [0.45, 0.2])
    corners = np.array([[long, wide], [-long, wide], [-long, -wide], [long, -wide]])
    room = Floor(shapely.box(-1.5, 0, 1.5, float(rng.uniform(1.8, 3.0)) * wide))
    post = Box("post", np.array([0.1, 0.1, 0.5]), np.append(rng.uniform([-1, 0], [1, 0.6]), 0.25))
    swing = rng.uniform(-np.pi, np.pi)
    direction = np.array([np.cos(swing), np.sin(swing), -0.5]) if rng.random() < 0.3 else None
    target = Target(rng.uniform([-1.5, -0.6, 0.1], [1.5, 0.6, 0.9]), direction, 0.3)
    solids, rules = ((post,) if rng.random() < 0.5 else ()), Rules(avoidance=bool(rng.random() < 0.5))
    return World("small", replace(arm, chain=chain, footprint=corners), room, solids, (target,), rules)


@settings(max_examples=examples(6), deadline=None)
@given(st.integers(0, 10_000))
def test_no_answer_contradicts_another(seed: int) -> None:
    """What `reach` finds nobody rules out, and what a plan rules out `reach` does not find."""
    world = small_world(seed)
    answer, cause = reach(world, world.task).verdict[0], why(world, world.task[0])
    told = "reachable" if cause is None else cause.verdict
    try:
        planned = "reachable" if verify(plan(world)).ok else "wrong"
    except NoPlanFound as no:
        planned = no.explanation.verdict
    assert planned != "wrong"
    assert not {"reachable", "unreachable"} <= {answer, told, planned}


def test_a_proof_is_the_same_everywhere() -> None:
    world = lane()
    world = replace(world, task=(Target(np.array([0.3, 0.4, 0.5])),))
    answer = reach(world, world.task)
    assert answer.verdict.tolist() == ["unreachable"]
    for found in (why(world, world.task[0]), why(world), refused(world)):
        assert found is not None
        assert found.verdict == "unreachable"
        assert found.reason.startswith(answer.reason[0])
        assert "0.350 m beyond the places where the base may stand" in found.reason


@pytest.mark.parametrize("command", ["plan", "why", "reach"])
def test_commands_tell_what_is_undecided(
    command: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "turned.json"
    path.write_text(json.dumps(world_to_document(turned())))
    assert run([command, str(path), "--json"]) == 1
    document = json.loads(capfd.readouterr().out)
    assert (document["ok"], document["verdict"], document["setpoint"]) == (False, "undecided", 0)
    assert document["reason"].startswith("No way was found to reach ")
