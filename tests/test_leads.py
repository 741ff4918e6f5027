"""Approach and departure: the tool comes to a stroke and leaves it along its axis, and is off there."""

from __future__ import annotations

import csv
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import regionik as rik
from regionik.values import Motion
from regionik.worlds.documents.world_file import world_from_document, world_to_document
from tests.plans import of_kind

FLOOR = {"polygon": [[-3, -3], [5, -3], [5, 3], [-3, 3]]}
DOWN = {"direction": [0, 0, -1], "cone": 0.1}
WAYS = {"approach": {"height": 0.05, "speed": 0.02}, "departure": {"height": 0.07}}


def world_with(*parts: dict[str, Any], folder: Path | None = None, **rules: Any) -> rik.World:
    document = {
        "version": 1, "robot": "youbot", "floor": FLOOR, "task": list(parts),
        "rules": {"clearance": 0.05, **rules}, "speeds": {"base_velocity": 0.3},
    }  # fmt: skip
    return world_from_document(document) if folder is None else world_from_document(document, folder=folder)


def line(y: float, **keys: Any) -> dict[str, Any]:
    return {"line": {"from": [0.5, y, 0.05], "to": [0.8, y, 0.05], "count": 4}, **DOWN, **keys}


def heights(world: rik.World) -> list[float]:
    return [round(float(target.position[2]), 9) for target in world.task]


def test_each_stroke_has_a_way_to_it_and_from_it() -> None:
    world = world_with(line(0.0, speed=0.1, flow=5.0, **WAYS), line(0.2, approach={"height": 0.03}))
    assert heights(world) == [0.1, *[0.05] * 4, 0.12, 0.08, *[0.05] * 4]
    assert [one.stroke for one in world.task] == [1] * 6 + [2] * 5
    assert [one.lead for one in world.task] == [True, *[False] * 4, True, True, *[False] * 4]
    assert world.works.tolist() == [k in (2, 3, 4, 8, 9, 10) for k in range(11)]
    assert [one.speed for one in world.task] == [None, 0.02, 0.1, 0.1, 0.1, None, *[None] * 5]
    again = world_from_document(world_to_document(world))
    assert [(one.lead, one.stroke, one.speed) for one in again.task] == [
        (one.lead, one.stroke, one.speed) for one in world.task
    ]


def test_strokes_of_files_have_ways_of_their_own(tmp_path: Path) -> None:
    """Of strokes that follow one another the one is left before the next is come to; travel stays."""
    (tmp_path / "t.csv").write_text(
        "x,y,z,stroke,name,qx,qy,qz,qw\n"
        "0,0,0.3,1,a,1,0,0,0\n0.1,0,0.3,1,b,1,0,0,0\n0.2,0,0.3,0,c,1,0,0,0\n0.3,0,0.3,2,d,0,1,0,0\n"
        "0.4,0,0.3,3,e,0,0.70710678118,0,0.70710678118\n"
    )
    world = world_with({"csv": "t.csv", **WAYS}, folder=tmp_path)
    assert [one.name for one in world.task] == ["", "a", "b", "", "c", "", "d", "", "", "e", ""]
    assert heights(world) == [0.35, 0.3, 0.3, 0.37, 0.3, 0.35, 0.3, 0.37, 0.3, 0.3, 0.3]
    assert world.task[-1].position == pytest.approx([0.4 - 0.07, 0, 0.3])
    assert [one.stroke for one in world.task] == [1, 1, 1, 1, 0, 2, 2, 2, 3, 3, 3]


REFUSED = [
    ({"points": [[1, 0, 0.3]], **WAYS}, "approach, departure: need the tool's axis"),
    (line(0.0, approach={"height": 0}), "approach"),
    (line(0.0, lead=True, stroke=0), "lead: expected a stroke from 1 on"),
]


@pytest.mark.parametrize(("part", "words"), REFUSED)
def test_ways_that_are_none_are_refused(part: dict[str, Any], words: str) -> None:
    with pytest.raises(rik.InputError, match=words):
        world_with(part)


@cache
def planned() -> rik.Plan:
    return rik.plan(world_with(line(0.0, speed=0.1, flow=5.0, **WAYS), line(0.2, flow=5.0, **WAYS)))


def test_the_tool_comes_and_goes_along_its_axis(tmp_path: Path) -> None:
    """Straight down to each stroke and up from it, no faster than told, and off."""
    found = planned()
    assert rik.verify(found).ok
    rik.export(found, tmp_path / "rows.csv", rate=100.0)
    rows = list(csv.DictReader((tmp_path / "rows.csv").read_text().splitlines()))
    assert float(rows[-1]["extrusion"]) == pytest.approx(5.0 * 0.3 * 2)
    for row in rows:
        x, z, speed = (float(row[key]) for key in ("tool_x", "tool_z", "tool_speed"))
        if row["tool_on"] == "1":
            assert z == pytest.approx(0.05, abs=0.002)
        elif row["setpoint"] == "0" and row["kind"] == "step":
            assert x == pytest.approx(0.5, abs=found.world.rules.path_tolerance)
            assert speed <= 0.02 * (1 + 1e-6)
    heights = found.tools()[found.motion.kind == "setpoint", 2]
    assert heights[[0, 5, 6, 11]] == pytest.approx([0.1, 0.12, 0.1, 0.12], abs=0.002)


def with_kind(motion: Motion, rows: slice, kind: str) -> Motion:
    kinds, owners = motion.kind.copy(), motion.setpoint.copy()
    kinds[rows], owners[rows] = kind, -1
    return replace(motion, kind=kinds, setpoint=owners)


def test_a_plan_that_breaks_them_is_caught() -> None:
    """The tool lifted on its way down, on while it comes, too fast there, or in a world without the way."""
    found = planned()
    at = np.flatnonzero(found.motion.kind == "setpoint")
    lifted = replace(found, motion=with_kind(found.motion, slice(at[0] + 1, at[1]), "transit"))
    assert any("lifted within stroke 1" in one.text for one in of_kind(rik.verify(lifted), "strokes"))
    on = found.tool_on().copy()
    on[at[0]] = True
    told = replace(found, motion=replace(found.motion, tool_on=on))
    (wrong,) = of_kind(rik.verify(told), "strokes")
    assert "the plan says that the tool is on" in wrong.text
    slow = tuple(replace(one, speed=0.01) if k == 1 else one for k, one in enumerate(found.world.task))
    fast = of_kind(rik.verify(replace(found, world=replace(found.world, task=slow))), "speeds")
    assert {one.setpoint for one in fast} <= {0, 1}
    bare = tuple(replace(one, lead=False) for one in found.world.task)
    differ = of_kind(rik.verify(found, replace(found.world, task=bare)), "world")
    assert [one.text.partition(": lead")[0] for one in differ] == [
        f"task: set-point {k}" for k in (1, 6, 7, 12)
    ]
