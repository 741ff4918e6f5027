"""Strokes: what is told of them, and plans that keep the tool down on each."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from regionik.cli.app import run
from regionik.output.plan_file import load_plan, save_plan
from regionik.pipeline import plan, search
from regionik.scene import scene_of
from regionik.values import Plan, Report, Violation
from regionik.verification.strokes import worked
from regionik.verification.verifier import verify
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.errors import FileNote, InputError, NoPlanFound
from regionik.worlds.scene import World
from regionik.worlds.strokes import numbered_strokes, split_strokes, within_strokes
from tests.planned import planned
from tests.plans import plan_of, straight, world_of
from tests.test_motion import past_a_board

FLOOR = {"polygon": [[-3, -3], [5, -3], [5, 3], [-3, 3]]}


def document(*parts: dict[str, Any], **rules: Any) -> dict[str, Any]:
    return {
        "version": 1, "robot": "youbot", "floor": FLOOR, "task": list(parts),
        "rules": {"clearance": 0.05, **rules},
    }  # fmt: skip


def line(x: float, more: float, count: int = 3, **keys: Any) -> dict[str, Any]:
    return {"line": {"from": [x, 0, 0.3], "to": [x + more, 0, 0.3], "count": count}, **keys}


def strokes_of(world: World) -> list[int | None]:
    return [target.stroke for target in world.task]


def with_strokes(world: World, *strokes: int | None, **rules: Any) -> World:
    task = tuple(replace(one, stroke=number) for one, number in zip(world.task, strokes, strict=True))
    return replace(world, task=task, rules=replace(world.rules, **rules))


def test_parts_of_a_task_tell_their_strokes(tmp_path: Path) -> None:
    """Numbers that are given stay; those of files come after them; a part that tells none is a stroke."""
    (tmp_path / "two.nc").write_text("G0 X0 Y0 Z300\nG1 X10\nG0 X20\nX30\nG1 X40\n")
    parts = line(1, 0.1, stroke=7), {"gcode": "two.nc"}, line(2, 0.1), line(3, 0.1, 2, stroke=0)
    world = world_from_document(document(*parts), folder=tmp_path)
    assert strokes_of(world) == [7, 7, 7, 8, 8, 0, 9, 9, 10, 10, 10, 0, 0]
    assert strokes_of(world_from_document(document(line(0, 1), line(2, 1)))) == [None] * 6


def test_a_table_tells_strokes(tmp_path: Path) -> None:
    (tmp_path / "two.csv").write_text("x,y,z,Stroke\n0,0,0.3,4\n0.1,0,0.3,4\n0.2,0,0.3,0\n0.3,0,0.3,5\n")
    parts = line(-1, 0.1, 2, stroke=2), {"csv": "two.csv"}
    assert strokes_of(world_from_document(document(*parts), folder=tmp_path)) == [2, 2, 6, 6, 0, 7]
    (tmp_path / "two.csv").write_text("a,b,c,pass\n0,0,0.3,1\n0.1,0,0.3,-1\n")
    chosen = {"csv": "two.csv", "columns": {"x": "a", "y": "b", "z": "c", "stroke": "pass"}}
    with pytest.raises(InputError, match=r"two\.csv: line 3: pass: expected a whole number, 0 on travel"):
        world_from_document(document(chosen), folder=tmp_path)


def test_neighbouring_parts_of_one_number_are_one_stroke(tmp_path: Path) -> None:
    world = tmp_path / "seam.yaml"
    world.write_text(yaml.safe_dump(document(line(0, 0.2, stroke=1), line(0.2, 0.2, stroke=1))))
    with pytest.warns(FileNote, match="set-point 4 is the one before it"):
        assert within_strokes(strokes_of(load_world(world))).tolist() == [False, True, True, True, True]


@pytest.mark.parametrize(("first", "second", "left"), [
    (1, 2, [1, 1, 2, 2]), (0, 2, [0, 2, 2]), (1, 0, [1, 1, 0]), (0, 0, [0, 0, 0]), (None, None, [None] * 3),
])  # fmt: skip
def test_where_strokes_meet_both_are_worked_whole(
    first: int | None, second: int | None, left: list[int | None], tmp_path: Path
) -> None:
    """Of a point that is given twice in a row one is left out, but none that a stroke begins or ends at."""
    parts = [line(0, 0.2, 2, stroke=first), line(0.2, 0.2, 2, stroke=second)]
    world = tmp_path / "seam.json"
    world.write_text(json.dumps(document(*parts)))
    if len(left) == 4:
        assert strokes_of(load_world(world)) == left
    else:
        with pytest.warns(FileNote, match="taken once"):
            assert strokes_of(load_world(world)) == left


def test_long_moves_at_work_are_divided(tmp_path: Path) -> None:
    """So that the base may go on along them; travel is not: the tool may be lifted there."""
    (tmp_path / "two.nc").write_text("G0 X0 Y0 Z300\nG1 X1000\nG0 Y2000\nX500\nG1 X400 Y1999.99\n")
    world = world_from_document(document({"gcode": "two.nc", "spacing": 0.3}), folder=tmp_path)
    x = [round(float(one.position[0]), 9) for one in world.task]
    assert x == [0.0, 0.25, 0.5, 0.75, 1.0, 1.0, 0.5, 0.4]
    assert strokes_of(world) == [1, 1, 1, 1, 1, 0, 2, 2]
    with pytest.raises(InputError, match=r"task\[0\]\.gcode: spacing: expected at least 1\.8e-05 m"):
        world_from_document(document({"gcode": "two.nc", "spacing": 1e-6}), folder=tmp_path)


REFUSED = [
    ((1, 1, None), {}, "set-point 3: stroke: expected one, as others have"),
    ((1, 2, 1), {}, "set-point 3: stroke: expected neighbours of stroke 1 alone"),
    ((1, -1, 2), {}, "expected whole numbers of at least 0, got -1"),
    ((1, True, 2), {}, "expected whole numbers of at least 0, got True"),
    ((1, 1, 2), {"mode": "stops", "order": "any"}, "order: any would take stroke 1 apart"),
]  # fmt: skip


@pytest.mark.parametrize(("strokes", "rules", "told"), REFUSED)
def test_strokes_that_are_refused(strokes: tuple[Any, ...], rules: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        with_strokes(world_of(straight(3)), *strokes, **rules)


def test_a_file_has_strokes_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "two.nc").write_text("G0 X0 Y0 Z300\nG1 X10\n")
    with pytest.raises(InputError, match=r"task\[0\]\.stroke: the file has its own"):
        world_from_document(document({"gcode": "two.nc", "stroke": 1}), folder=tmp_path)


def test_a_world_with_strokes_comes_back() -> None:
    world = with_strokes(world_of(straight(6), axes=True), 3, 3, 0, 0, 4, 5)
    assert strokes_of(world_from_document(world_to_document(world))) == [3, 3, 0, 0, 4, 5]
    assert "stroke" not in json.dumps(world_to_document(world_of(straight(6)))["task"])


@given(st.lists(st.booleans(), min_size=1, max_size=12), st.data())
def test_what_is_left_out_splits_its_stroke(works: list[bool], data: st.DataObject) -> None:
    """Of set-points that are left those are of one stroke that were neighbours in one."""
    strokes = numbered_strokes(np.array(works)).tolist()
    kept = sorted(data.draw(st.sets(st.integers(0, len(works)), min_size=1)))
    left = list(split_strokes(strokes, kept))
    within = within_strokes(strokes)
    expected = [k > 0 and kept[k - 1] == i - 1 and bool(within[i]) for k, i in enumerate(kept)]
    assert within_strokes(left).tolist() == expected
    assert [number == 0 for number in left] == [strokes[i] == 0 for i in kept]


# What verify says


def of_kind(report: Report, kind: str) -> list[Violation]:
    return [one for one in report.violations if one.kind == kind]


def lifted(*before: int, count: int = 5) -> Plan:
    """Set-points in a line, with the tool lifted before some of them; its states are where they were."""
    motion = straight(count)
    kind = motion.kind.copy()
    for i in before:
        kind[2 * i - 1] = "transit"
    return plan_of(world_of(motion), replace(motion, kind=kind.astype("<U8")), len(before))


@pytest.mark.parametrize(("strokes", "wrong"), [
    ((1, 1, 1, 1, 1), [2]), ((1, 1, 2, 2, 2), []), ((0, 0, 0, 0, 0), []), ((0, 1, 1, 0, 0), [2]),
    ((1, 2, 2, 3, 3), [2]), ((None,) * 5, []),
])  # fmt: skip
def test_a_lift_off_within_a_stroke_is_caught(strokes: tuple[int | None, ...], wrong: list[int]) -> None:
    found = lifted(2)
    worse = replace(found, world=with_strokes(found.world, *strokes))
    assert [one.setpoint for one in of_kind(verify(worse), "strokes")] == wrong
    assert worse.lifts_within() == wrong
    allowed = replace(found, world=with_strokes(found.world, *strokes, lift_within=True))
    assert not of_kind(verify(allowed), "strokes")


def test_it_is_told_within_which_stroke_the_tool_is_lifted() -> None:
    found = lifted(2)
    (told,) = of_kind(verify(replace(found, world=with_strokes(found.world, 4, 4, 4, 4, 0))), "strokes")
    assert told.text == "the tool is lifted within stroke 4, before set-point 3 of 5"


def test_the_tool_is_on_from_state_to_state_of_a_stroke() -> None:
    found = lifted(1, 3, count=6)
    split = replace(found, world=with_strokes(found.world, 1, 1, 2, 2, 2, 0))
    on = [0, 0, 0, 0, 0, 0, 1, 1, 0, 0, 0]  # two states a set-point
    assert found.tool_on().astype(int).tolist() == [0, 0, 1, 1, 0, 0, 1, 1, 1, 1, 0]
    assert split.tool_on().astype(int).tolist() == on
    assert worked(split).astype(int).tolist() == on


def test_a_file_says_where_the_tool_is_on(tmp_path: Path) -> None:
    found = lifted(2)
    kept = replace(found, world=with_strokes(found.world, 1, 1, 2, 2, 2))
    save_plan(kept, tmp_path / "plan.json")
    back = load_plan(tmp_path / "plan.json")
    assert back.motion.tool_on is not None
    assert back.motion.tool_on.tolist() == kept.tool_on().tolist()
    assert not of_kind(verify(back), "strokes")
    file = json.loads((tmp_path / "plan.json").read_text())
    assert [state["tool_on"] for state in file["states"]] == [True, True, False, False] + 4 * [True] + [False]
    file["states"][3]["tool_on"] = True
    (tmp_path / "plan.json").write_text(json.dumps(file))
    (told,) = of_kind(verify(load_plan(tmp_path / "plan.json")), "strokes")
    assert told.text.startswith("the plan says that the tool is on ")
    save_plan(found, tmp_path / "plan.json")
    assert "tool_on" not in (tmp_path / "plan.json").read_text()
    assert load_plan(tmp_path / "plan.json").motion.tool_on is None


@pytest.mark.parametrize(("strokes", "differing"), [
    ((7, 7, 0, 9, 9), []), ((1, 1, 0, 2, 3), [5]), ((1, 1, 1, 2, 2), [3]), ((1, 2, 0, 3, 3), [2]),
    ((None,) * 5, [1, 2, 3, 4, 5]),
])  # fmt: skip
def test_strokes_of_a_plan_are_those_of_its_world(strokes: tuple[Any, ...], differing: list[int]) -> None:
    """Numbers may be others."""
    asked = with_strokes(world_of(straight()), 1, 1, 0, 2, 2)
    found = plan_of(with_strokes(asked, *strokes), straight())
    told = [one.text for one in of_kind(verify(found, asked), "world")]
    assert [text.partition(": stroke")[0] for text in told] == [f"task: set-point {k}" for k in differing]


# Plans


def pillar(*strokes: int, **rules: Any) -> World:
    """The bundled world whose areas break before set-point 11 of 15."""
    return with_strokes(load_world("pillar"), *strokes, **rules)


def lifted_before(found: Plan) -> list[int]:
    came = (found.motion.kind[1:] == "setpoint") & (found.motion.kind[:-1] == "transit")
    return [i for i in found.motion.setpoint[1:][came].tolist() if i]


@pytest.mark.parametrize(("strokes", "before"), [
    ([1] * 10 + [2] * 5, [10]), ([1] * 8 + [0] * 3 + [2] * 4, [10]), ([0] * 15, [10]),
])  # fmt: skip
def test_the_tool_is_lifted_between_strokes(strokes: list[int], before: list[int]) -> None:
    found = plan(pillar(*strokes))
    assert verify(found).ok
    assert lifted_before(found) == before


def test_a_stroke_that_areas_take_apart_is_refused_with_its_place() -> None:
    with pytest.raises(NoPlanFound) as no:
        plan(pillar(*[1] * 8, *[2] * 7))
    found = no.value.explanation
    assert (found.verdict, found.setpoint) == ("ladder-broken", 10)
    assert "within stroke 2, which goes from set-point 9 to 15" in found.reason
    assert "lift-within" in [one.kind for one in found.repairs]


def test_a_lift_off_within_a_stroke_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    world = pillar(*[1] * 8, *[2] * 7, lift_within=True)
    (tmp_path / "w.yaml").write_text(yaml.safe_dump(world_to_document(world)))
    assert run(["plan", str(tmp_path / "w.yaml"), "-o", str(tmp_path / "p.json")]) == 0
    step = float(np.linalg.norm(world.task[10].position - world.task[9].position))
    told = f"the tool is lifted within stroke 2, from set-point 10 to 11: {step:.3f} m are not worked"
    assert told in capsys.readouterr().err
    assert run(["verify", str(tmp_path / "p.json")]) == 0
    assert told in capsys.readouterr().err
    assert lifted_before(load_plan(tmp_path / "p.json")) == [8, 10]


@pytest.mark.parametrize("mode", ["stops", pytest.param("continuous", marks=pytest.mark.slow)])
def test_a_run_that_gets_stuck_in_a_stroke_ends_before_it(mode: str) -> None:
    """Where a board is in the arm's way, not in the base's; stops are found without regard to strokes."""
    world = past_a_board()
    count = len(world.task)
    whole = with_strokes(world, *[1] * count, mode=mode)
    with pytest.raises(NoPlanFound, match=f"within stroke 1, which goes from set-point 1 to {count}"):
        search(scene_of(whole))
    if mode == "continuous":
        where = lifted_before(planned("past a board", past_a_board))[0]
        parted = with_strokes(world, *[1] * (where - 1), *[2] * (count - where + 1))
        found = search(scene_of(parted))
        assert lifted_before(found) == [where - 1]
        assert verify(found).ok


def test_a_set_point_that_is_left_out_splits_its_stroke() -> None:
    world = pillar(*[1] * 8, *[2] * 7, skip_unreachable=True)
    high = replace(world.task[4], position=world.task[4].position + [0.0, 0.0, 2.0])
    asked = replace(world, task=(*world.task[:4], high, *world.task[5:10]))
    found = plan(asked)
    assert strokes_of(found.world) == [1, 1, 1, 1, 3, 3, 3, 2, 2]
    assert found.skipped[0].reason.endswith("Stroke 1 is not worked to and from it.")
    assert verify(found, asked).ok
    joined = with_strokes(found.world, *[1] * 7, 2, 2)
    told = of_kind(verify(replace(found, world=joined), asked), "world")
    assert [one.text for one in told] == ["task: set-point 5: stroke: 1 in the plan, 1 in the world"]
