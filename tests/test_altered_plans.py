"""What a plan file says is computed again, or not in it: whatever is altered in one, it is refused."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from regionik.area_verification import verify_areas
from regionik.cli.app import run
from regionik.output.plan_file import load_plan
from regionik.pipeline import search
from regionik.scene import scene_of
from regionik.storage.plan_document import FIGURES
from regionik.timing.retime import retime
from regionik.values import Plan
from regionik.verification.verifier import verify
from regionik.worlds.documents.world_file import load_world, world_to_document
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Speeds
from regionik.worlds.scene import World
from tests.plans import plan_to_document

Place = tuple[str | int, ...]

OTHERS = {"step": "transit", "transit": "step", "setpoint": "step", "tolerance": "clearance"}
UNSAID = {"seed"}  # says how a plan is made again, and nothing of the plan


@cache
def world() -> World:
    pillar = load_world("pillar")
    return replace(pillar, task=pillar.task[:4], start=None)


@cache
def planned(how: str) -> Plan:
    if how == "timed":
        return retime(planned("free"), Speeds(tool_velocity=0.1))
    asked = replace(world().rules, mode="stops", order="any") if how == "stops" else world().rules
    return search(scene_of(replace(world(), rules=asked)))


def document(how: str) -> dict[str, Any]:
    said: dict[str, Any] = plan_to_document(planned(how))
    return said


def at(place: str) -> Place:
    return tuple(int(part) if part.isdigit() else part for part in place.split("."))


def refusal(said: dict[str, Any], folder: Path) -> str | None:
    """Why a plan's document is refused, as it is read or as it is verified."""
    path = folder / "plan.json"
    path.write_text(json.dumps(said))
    try:
        plan = load_plan(path)
    except InputError as error:
        return str(error)
    for report in (verify(plan), verify_areas(plan)):
        if not report.ok:
            return report.violations[0].text
    return None


def with_value(said: dict[str, Any], place: Place, value: Any) -> dict[str, Any]:
    changed = copy.deepcopy(said)
    inner: Any = changed
    for part in place[:-1]:
        inner = inner[part]
    inner[place[-1]] = value
    return changed


def altered(value: Any) -> Any:
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return value + (1 if isinstance(value, int) else 0.01)
    return OTHERS.get(value, f"{value}x") if isinstance(value, str) else 0


@pytest.mark.parametrize(
    ("how", "place"),
    [
        ("free", "setpoints.2.converged"),
        ("free", "setpoints.2.iterations"),
        ("timed", "setpoints.2.converged"),
        ("timed", "stats.states"),
        ("timed", "stats.base_travel"),
        ("timed", "stats.timing.duration"),
        ("timed", "stats.timing.blend"),
        ("timed", "states.5.time"),
        ("timed", "states.5.setpoint"),
        ("stops", "stats.stops.count"),
        ("stops", "stats.order.1"),
        ("stops", "stops.0.criterion"),
        ("stops", "stops.0.tolerance"),
    ],
)
def test_what_is_altered_is_refused(how: str, place: str, tmp_path: Path) -> None:
    said, where = document(how), at(place)
    value: Any = said
    for part in where:
        value = value[part]
    assert refusal(with_value(said, where, altered(value)), tmp_path) is not None


@pytest.mark.parametrize("how", ["free", "timed", "stops"])
def test_no_figure_is_kept_that_is_not_checked(how: str, tmp_path: Path) -> None:
    said = document(how)
    assert refusal(said, tmp_path) is None
    assert set(said["stats"]) <= set(FIGURES)
    assert set(said["stats"].get("stops", {})) <= {"count"}
    assert set(said["stats"].get("timing", {})) <= {"duration", "blend"}
    more = {**said["stats"], "base_moves": {"ompl": 99}, "timing": {"used": {"base_velocity": 9.0}}}
    (tmp_path / "plan.json").write_text(json.dumps({**said, "stats": more}))
    assert "base_moves" not in load_plan(tmp_path / "plan.json").stats


def test_a_time_that_is_missing_among_others_is_told(tmp_path: Path) -> None:
    said = with_value(document("timed"), ("states", 5, "time"), None)
    assert "state 6 of" in (refusal(said, tmp_path) or "")


def leaves(value: Any, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield from leaves(item, (*place, key))
    if not isinstance(value, dict | list):
        yield place, value


@pytest.mark.slow
@pytest.mark.parametrize("how", ["free", "timed", "stops"])
def test_whatever_is_altered_in_a_plan_file_is_refused(how: str, tmp_path: Path) -> None:
    """One of every kind of value; of areas of stops, which hang on the search, it is told in the docs."""
    said, kinds = document(how), dict[object, Place]()
    for place, value in leaves({key: value for key, value in said.items() if key != "world"}):
        if place[0] not in UNSAID and not (how == "stops" and place[0] == "areas"):
            words = tuple("" if isinstance(part, int) else part for part in place)
            kinds.setdefault((words, value if isinstance(value, str) else value is None), place)
    passed = [
        place
        for place in kinds.values()
        for value in [next(value for one, value in leaves(said) if one == place)]
        if refusal(with_value(said, place, altered(value)), tmp_path) is None
    ]
    assert not passed


# Worlds from outside ---------------------------------------------------------------------------------------


def changed_world(place: str, value: Any) -> dict[str, Any]:
    return with_value(world_to_document(world()), at(place), value)


@pytest.mark.parametrize(
    ("place", "value", "told"),
    [
        ("obstacles.0.box.size.0", 0.7, "obstacles.pillar.box.size[0]: 0.6 in the plan, 0.7 in the world"),
        ("obstacles.0.name", "post", "obstacles.post: only in the world"),
        ("obstacles", [], "obstacles.pillar: only in the plan"),
        ("floor.polygon.0.0", -9.0, "floor.polygon[0][0]: "),
        ("rules.clearance", 0.07, "rules.clearance: "),
        ("rules.tolerance", 0.002, "rules.tolerance: 0.001 in the plan, 0.002 in the world"),
        ("robot", "youbot-real", "robot"),
        (
            "start",
            {"base": [0.0, 0.0, 0.0], "joints": [0.0, 1.0, -1.0, 0.5, 0.0]},
            "start: only in the world",
        ),
        ("task", [{"points": [[0.5, 0.5, 0.3]]}], "task: 4 set-points in the plan, 1 in the world"),
    ],
)
def test_a_plan_is_held_against_a_world_from_outside(
    place: str, value: Any, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, outside = tmp_path / "plan.json", tmp_path / "outside.json"
    planned("free").save(path)
    outside.write_text(json.dumps(changed_world(place, value)))
    assert run(["verify", str(path), "--world", str(outside)]) == 1
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    ("place", "value"),
    [("name", "another"), ("about", "other words"), ("rules.tolerance", 0.001 + 1e-12), ("rules.step", 0.25)],
)
def test_what_does_not_matter_may_differ(place: str, value: Any, tmp_path: Path) -> None:
    path, outside = tmp_path / "plan.json", tmp_path / "outside.json"
    planned("timed").save(path)
    outside.write_text(json.dumps(changed_world(place, value)))
    assert run(["verify", str(path), "--world", str(outside)]) == 0


def test_set_points_in_any_order_are_found_in_the_world() -> None:
    plan = planned("stops")
    asked = replace(world(), rules=plan.world.rules)
    shuffled = replace(plan, world=replace(plan.world, task=plan.world.task), stats={})
    assert verify(plan, asked).ok
    assert verify(shuffled, replace(asked, task=tuple(reversed(asked.task)))).ok
    moved = replace(asked.task[1], position=asked.task[1].position + [0, 0, 0.01])
    other = replace(asked, task=(asked.task[0], moved, *asked.task[2:]))
    assert [v.kind for v in verify(plan, other).violations] == ["world"]


def test_speeds_that_the_world_gives_are_compared_where_a_plan_is_timed() -> None:
    slow = replace(world(), speeds=Speeds(base_velocity=0.1))
    assert verify(planned("free"), slow).ok
    (found,) = verify(planned("timed"), replace(slow, speeds=Speeds(tool_velocity=0.2))).violations
    assert found.text == "speeds.tool_velocity: 0.1 in the plan, 0.2 in the world"
