"""Stops say at which of their set-points a posture that is clear is known, and fields what they rest on."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

import regionik as rik
from regionik.cli.app import run
from regionik.worlds.documents.world_file import world_from_document
from regionik.worlds.scene import World
from tests.plans import plan_to_document

WORLD_FILE = """
version: 1
robot: youbot-real
floor: {polygon: [[-1, -1], [4, -1], [4, 1], [-1, 1]]}
obstacles:
  - {name: lid, box: {center: [0.5, 0, 0.44], size: [0.24, 0.24, 0.02]}}
  - {name: bottom, box: {center: [0.5, 0, 0.24], size: [0.24, 0.24, 0.02]}}
  - {name: front, box: {center: [0.5, 0.11, 0.34], size: [0.24, 0.02, 0.2]}}
  - {name: rear, box: {center: [0.5, -0.11, 0.34], size: [0.24, 0.02, 0.2]}}
  - {name: left, box: {center: [0.39, 0, 0.34], size: [0.02, 0.24, 0.2]}}
  - {name: right, box: {center: [0.61, 0, 0.34], size: [0.02, 0.24, 0.2]}}
task:
  - points: [[0.5, 0.4, 0.3], [0.5, 0, 0.34], [2, 0, 0.3]]
rules: {clearance: 0.02, mode: stops, order: any, tool_contact: 0.01}
"""


def cupboard() -> World:
    """A target in a closed cupboard over the floor, between two that are free."""
    return world_from_document(yaml.safe_load(WORLD_FILE), where="cupboard")


def test_what_no_posture_is_known_for_is_told_apart() -> None:
    world = cupboard()
    found = rik.stops(world)
    assert sorted(i for stop in found for i in stop.unconfirmed) == [1]
    for stop in found:
        answer = rik.reach(world, [world.task[i] for i in stop.setpoints], base=stop.base)
        assert [i not in stop.unconfirmed for i in stop.setpoints] == answer.reachable.tolist()
        assert rik.verify_answers(world, answer).ok
    assert any("1 of them unconfirmed" in repr(stop) for stop in found)
    free = replace(world, obstacles=())
    assert all(stop.unconfirmed == () for stop in rik.stops(free))


def test_the_command_counts_them_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, output = tmp_path / "cupboard.world.yaml", tmp_path / "stops.geojson"
    path.write_text(WORLD_FILE)
    assert run(["stops", str(path), "-o", str(output)]) == 0
    told = capsys.readouterr()
    lines = told.out.splitlines()
    assert lines[0].endswith("tolerance [m]  unconfirmed")
    assert [line for line in lines[1:] if line.endswith("  2")]
    assert "confirmed: 2 set-points have a posture that is clear; unconfirmed, by areas alone: 2 " in told.err
    made = json.loads(output.read_text())["features"]
    assert sorted(i for one in made for i in one["properties"]["unconfirmed"]) == [1]
    assert run(["stops", str(path), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["unconfirmed"] == [1]
    assert sorted(i for stop in document["stops"] for i in stop["unconfirmed"]) == [1]
    assert run(["stops", "pillar"]) == 0
    told = capsys.readouterr()
    assert "unconfirmed" not in told.out + told.err
    assert "confirmed: from its stop each of the 15 set-points has a posture that is clear" in told.err


def test_a_plan_names_no_doubts() -> None:
    world = cupboard()
    found = rik.plan(replace(world, task=world.task[::2]))
    assert all(stop.unconfirmed == () for stop in found.stops)
    assert all("unconfirmed" not in stop for stop in plan_to_document(found)["stops"])


def test_a_field_says_that_areas_alone_count() -> None:
    """Areas do not see the cupboard, and `reach` from the best place does."""
    world = cupboard()
    field = rik.reach_field(world, world.task[1:2], cell=0.1)
    assert field.summary == "the best place reaches 1 of 1 targets, by areas alone"
    assert "by areas alone" in field.meaning
    assert len(field.best)
    assert not any(rik.reach(world, world.task[1:2], base=pose).reachable.any() for pose in field.best)
    level = rik.reach_slice(world, 0.3, cell=0.2)
    assert len(level.best) == 0
    assert level.summary.endswith("by areas alone")
    assert "by areas alone" in level.meaning
