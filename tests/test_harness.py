"""The harness that holds a change of the planner against the tree before it: what is planted is reported."""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from regionik.worlds.bundled import world_names
from regionik.worlds.documents.world_file import load_world, world_from_document
from regionik.worlds.errors import InputError
from tests.harness.__main__ import chosen, main
from tests.harness.comparison import compare
from tests.harness.running import GIVEN_UP, run
from tests.harness.worlds import SHORT, WORLDS, document_of

ROOT = Path(__file__).parents[1]
ROW: Mapping[str, Any] = {
    "world": "w", "verdict": "planned", "verified": True, "digest": "d", "motion": "m",
    "skipped": 0, "lift_offs": 1, "stops": 3, "stops_bound": 2, "states": 40,
    "duration": 10.0, "at_speed": 0.5, "base_way": 2.0, "turning": 1.0, "arm_travel": 4.0,
    "margins": {"clearance": 0.004, "joints": 0.3, "self": 0.01}, "tries": 7, "cpu": 2.0,
}  # fmt: skip
OTHER = {"digest": "e", "motion": "n"}


def margins(**changed: float) -> dict[str, Any]:
    return {"margins": {**ROW["margins"], **changed}}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"lift_offs": 2}, "lift offs 1 -> 2"),
        ({"stops": 4}, "stops 3 -> 4"),
        ({"skipped": 1}, "skipped 0 -> 1"),
        ({"duration": 10.3}, "duration 10 -> 10.3 s (+3.0 %), at most 10.2"),
        ({"duration": None, "not_timed": "no"}, "cannot be timed: no"),
        ({"base_way": 2.2}, "base way 2 -> 2.2 m"),
        ({"arm_travel": 4.5}, "arm travel 4 -> 4.5 rad"),
        ({"verdict": "no-posture"}, "verdict planned -> no-posture"),
        ({"verdict": GIVEN_UP}, "verdict planned -> given up"),
        ({"verified": False}, "verify does not accept the plan"),
        (margins(clearance=-0.001), "margin clearance 0.0040 -> -0.0010"),
        (margins(joints=0.001), "margin joints 0.3000 -> 0.0010, at least 0.0200"),
    ],
)
def test_what_is_worse_is_said(changed: dict[str, Any], said: str) -> None:
    found = compare("w", ROW, {**ROW, **OTHER, **changed})
    assert found.state == "fell"
    assert found.fell[0].startswith(said)


@pytest.mark.parametrize(
    ("changed", "state"),
    [
        ({}, "same"),
        ({"cpu": 90.0, "tries": 900}, "same"),
        ({"digest": "e"}, "same motion"),
        (OTHER, "as good"),
        ({**OTHER, "duration": 10.19, "base_way": 2.09, "states": 80}, "as good"),
        ({**OTHER, **margins(clearance=0.0, joints=0.1)}, "as good"),
        ({**OTHER, "lift_offs": 0}, "better"),
        ({**OTHER, "duration": 9.0}, "better"),
        ({"world": "another"}, "other world"),
    ],
)
def test_what_is_not_worse_is_no_fault(changed: dict[str, Any], state: str) -> None:
    assert compare("w", ROW, {**ROW, **changed}).state == state


def test_refusals_may_say_more_and_not_less() -> None:
    no = {key: ROW[key] for key in ("world", "digest", "cpu")}
    doubt, proof = {**no, "verdict": "no-posture"}, {**no, "verdict": "unreachable"}
    assert compare("w", doubt, {**proof, "digest": "e"}).state == "better"
    assert compare("w", doubt, {**ROW, **OTHER}).state == "better"
    assert compare("w", proof, {**doubt, "digest": "e"}).fell == ("verdict unreachable -> no-posture",)
    assert compare("w", proof, dict(ROW)).state == "fell"  # a plan of what was proven to have none


def test_a_world_that_one_run_lacks_is_missing() -> None:
    assert compare("w", ROW, None).state == "missing"
    assert compare("w", None, ROW).state == "new"


def test_the_command_tells_what_fell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before, after = tmp_path / "a.json", tmp_path / "b.json"
    before.write_text(json.dumps({"free": ROW, "pillar": ROW}))
    after.write_text(json.dumps({"free": ROW, "pillar": {**ROW, **OTHER, "lift_offs": 2, "cpu": 3.0}}))
    assert main(["compare", str(before), str(before), "free", "pil*"]) == 0
    assert main(["compare", str(before), str(after), "free"]) == 0
    assert main(["compare", str(before), str(after), "free", "pillar"]) == 1
    said = capsys.readouterr().out
    assert re.search(r"pillar +fell +1.50 .* lift offs 1 -> 2", said)
    assert "cpu: 4 -> 5, 1.250 times" in said
    after.write_text(json.dumps({"free": ROW}))
    assert main(["compare", str(before), str(after)]) == 1
    assert re.search("pillar +missing", capsys.readouterr().out)


def test_the_table_has_worlds_of_every_kind() -> None:
    assert len(WORLDS) >= 60
    assert {name for name in world_names() if name != "depot"} <= WORLDS.keys()
    assert 10 <= len(SHORT) == len(set(SHORT))
    assert set(SHORT) <= WORLDS.keys()
    with pytest.raises(InputError, match="valid names: free"):
        chosen(["castle"], short=True)


@pytest.mark.parametrize("name", SHORT)
def test_worlds_are_written_the_same_each_time(name: str) -> None:
    document = document_of(WORLDS[name]())
    assert document == document_of(WORLDS[name]())
    assert world_from_document(document).task


def test_usual_rules_are_left_to_the_tree_that_reads() -> None:
    assert document_of(load_world("pillar"))["rules"].keys() <= {"clearance", "arm_clearance", "step"}


def test_a_tree_is_run_on_the_same_files_each_time() -> None:
    once, again = (dict(run(ROOT, names)) for names in (["free", "unreachable"], ["free"]))
    assert compare("free", once["free"], again["free"]).state == "same"
    assert once["free"]["verified"]
    assert once["unreachable"]["verdict"] == "unreachable"


def test_worlds_that_take_too_long_are_given_up_one_by_one() -> None:
    rows = dict(run(ROOT, ["free", "unreachable"], longest=0.001))
    assert [row["verdict"] for row in rows.values()] == [GIVEN_UP, GIVEN_UP]


def test_what_is_no_checkout_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a checkout"):
        list(run(tmp_path, ["free"]))
