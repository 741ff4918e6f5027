"""The soak: witnesses are plans, a false no is contradicted, the report counts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from regionik.values import Plan
from regionik.verification.verifier import verify
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.errors import Explanation, InputError, NoPlanFound, Verdict
from regionik.worlds.obstacles import Mesh
from regionik.worlds.scene import World
from tests import soak
from tests.kinds import Solid
from tests.random_arms import ARMS, random_arm, random_robot
from tests.soak import WITNESSED, Judged, against, asked_worlds, judged, report
from tests.soaked import soaked_world
from tests.witnesses import random_solid, traits_of, witness


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=pytest.mark.slow) if kind == "urdf arms" else kind for kind in WITNESSED],
)
def test_every_witness_is_a_plan(kind: str) -> None:
    for seed in range(3):
        known = witness(kind, seed)
        assert verify(known).ok
        assert known.world.robot.chain.dof in (5, 6, 7)
        assert np.ptp(known.tools()[:, :3], axis=0).max() > 0.01
    assert against(known) == ()


@pytest.mark.slow
def test_the_same_seed_gives_the_same_world() -> None:
    one, other = (world_to_document(witness("urdf arms", 1).world) for _ in range(2))
    assert one == other


@pytest.mark.slow
def test_witnesses_are_of_all_sorts() -> None:
    worlds = [witness(kind, seed).world for kind in WITNESSED for seed in range(2)]
    traits = {trait for world in worlds for trait in traits_of(world)}
    assert {"5 joints", "6 joints", "7 joints", "base omni", "base differential", "base car"} <= traits
    assert {"points", "directions", "full poses", "stops", "a map", "meshes", "speeds"} <= traits
    assert {"round footprint", "polygonal footprint"} <= traits
    assert sum(bool(world.obstacles) for world in worlds) > len(worlds) / 2


def test_arms_are_what_they_are_called() -> None:
    rng = np.random.default_rng(0)
    for kind in ARMS:
        chain = random_arm(kind, rng)
        frames = chain.frames(np.zeros(chain.dof))
        if kind == "wrists":  # the last three axes meet
            assert np.allclose(frames[-4, :3, 3] + _along(frames[-4], frames[-3]), frames[-3, :3, 3])
            assert np.allclose(frames[-3, :3, 3], frames[-2, :3, 3])
        assert (kind == "slides") == any(joint.kind == "prismatic" for joint in chain.joints)
        assert (kind == "tilted") == (abs(frames[0, 2, 2]) < 0.99)


def _along(frame: Any, other: Any) -> Any:
    """The way along a frame's z axis to the foot of another's origin."""
    axis = frame[:3, 2]
    return axis * (axis @ (other[:3, 3] - frame[:3, 3]))


def test_robots_and_solids_of_all_kinds_come() -> None:
    rng = np.random.default_rng(1)
    assert {random_robot("offsets", rng).base for _ in range(30)} == {"omni", "differential", "car"}
    solids = [random_solid("one", np.zeros(2), rng) for _ in range(60)]
    assert {type(one) for one in solids} == set(Solid.__args__)
    assert all(one.is_closed for one in solids if isinstance(one, Mesh))


PROOF = "Set-point 1 of 3 cannot be reached. This is a proof: with these the outer area is empty."


@pytest.mark.parametrize(("verdict", "reason", "is_wrong"), [
    ("unreachable", "Set-point 1 of 3 cannot be reached.", True),
    ("start-blocked", "The start is blocked.", True),
    ("no-posture", PROOF, True),
    ("no-posture", "No posture was found.", False),
    ("undecided", "No way was found.", False),
])  # fmt: skip
def test_a_false_no_is_contradicted(
    verdict: Verdict, reason: str, is_wrong: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def search(_world: World) -> Plan:
        raise NoPlanFound(Explanation(verdict, 0, reason))

    monkeypatch.setattr(soak, "search", search)
    one = judged("slides", 1)
    assert one.verdict == verdict
    assert bool(one.wrong) == is_wrong


def test_a_refusal_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def search(_world: World) -> Plan:
        raise InputError("no")

    monkeypatch.setattr(soak, "search", search)
    assert judged("slides", 1).verdict == "refused: no"


def test_half_of_the_random_worlds_have_a_witness() -> None:
    kinds = [kind for kind, _ in asked_worlds(130) if kind != "bundled"]
    assert sum(kind in WITNESSED for kind in kinds) == 65
    assert set(kinds) == set(soak.KNOWN) - {"bundled"}


def test_the_report_counts_witnesses_planned() -> None:
    found = [
        Judged("wrists", 0, "planned", (), traits=("base omni",)),
        Judged("wrists", 1, "undecided", (), traits=("base omni", "stops")),
        Judged("slides", 2, "planned", ()),
        Judged("slides", 3, "refused: no", (), traits=("stops",)),
        Judged("slides", 4, "unreachable", ("said though there is a witness",)),
        Judged("slides", 5, soak.GIVEN_UP, ()),
    ]
    lines = report(found).splitlines()
    assert "| wrists | 2 | 1 | 0 | 1 | none | 0 | 0 | 50.0 % |" in lines
    assert "| slides | 4 | 1 | 1 | 0 | none | 1 | 1 | 25.0 % |" in lines
    assert "| all | 6 | 2 | 1 | 1 | none | 1 | 1 | 33.3 % |" in lines
    assert "| stops | 2 | 0 | 0 | 1 | none | 1 | 0 | 0.0 % |" in lines
    assert "- slides 4: said though there is a witness" in lines


def test_an_arm_searched_for_about_a_place_faces_its_target_where_the_rules_ask_for_it() -> None:
    world = soaked_world("overhead", 910248)
    assert world.rules.heading == "face_target"
    _, wrong = soak.against_reach(world, soak.hard_targets(world, np.random.default_rng([910248, 2])))
    assert not wrong
