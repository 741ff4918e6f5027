"""What is fed along a path: read from programs, tables and keys, and told by exports."""

from __future__ import annotations

import csv
import math
import types
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import regionik as rik
from regionik.values import Motion
from regionik.worlds.documents.world_file import world_from_document, world_to_document
from regionik.worlds.readers.gcode import read_gcode
from tests.maths import Array
from tests.plans import of_kind, plan_of, straight, world_of

FLOOR = {"polygon": [[-3, -3], [5, -3], [5, 3], [-3, 3]]}
STROKES = [1] * 4 + [0] * 2 + [2] * 4
FLOWS = [9.0, 10.0, 20.0, 20.0, 30.0, 30.0, 40.0, 5.0, None, 10.0]
FED = (0.1 * (10 + 20 + 20), 0.1 * (5 + 0 + 10))  # by each stroke: its set-points are 0.1 m apart


PROGRAMS = [
    ("M83\nG0 X0 Y0 Z9\nG1 X10 E5\nX20 E-1\nG1 E1\nX30 Y10 E5\n", [0, 500, 0, 5000 / math.hypot(10, 10)]),
    ("M82\nG0 X0 Y0 Z9\nG92 E0\nG1 X10 E5\nG92 E1\nX20 E3\nE9\nX30 E10\n", [0, 500, 200, 100]),
    ("G20 M83\nG0 X0 Y0 Z9\nG1 X1 E1\n", [0, 1000]),
    ("M83\nG0 X0 Y0 Z9\nG3 X20 I10 E7\n", [0, *[7000 / (20 * math.sqrt(2))] * 2]),
]  # fmt: skip


@pytest.mark.filterwarnings("ignore::regionik.worlds.errors.FileNote")  # names G92
@pytest.mark.parametrize(("text", "flows"), PROGRAMS)
def test_filament_of_a_move_is_laid_along_it(text: str, flows: list[float], tmp_path: Path) -> None:
    """In millimetres a metre; what is drawn back, pushed again and fed on the spot is not."""
    (tmp_path / "p.gcode").write_text(text)
    found = read_gcode(tmp_path / "p.gcode", 0.003)
    assert found.flows is not None
    assert found.flows == pytest.approx(flows)


def test_a_program_without_filament_has_no_flow(tmp_path: Path) -> None:
    (tmp_path / "p.nc").write_text("G0 X0 Y0 Z9\nG1 X10\n")
    assert read_gcode(tmp_path / "p.nc", 0.1).flows is None


def world_with(folder: Path, *parts: dict[str, Any]) -> rik.World:
    document = {"version": 1, "robot": "youbot", "floor": FLOOR, "task": list(parts)}
    return world_from_document(document, folder=folder)


def test_parts_and_tables_tell_flows(tmp_path: Path) -> None:
    """A move that is divided feeds as much; what is read is written again."""
    (tmp_path / "two.csv").write_text("x,y,z,FLOW\n0,0,0.3,\n0.1,0,0.3,12.5\n")
    (tmp_path / "two.gcode").write_text("M83\nG0 X0 Y0 Z300\nG1 X100 E6\nX150 E1.5\n")
    line = {"line": {"from": [1, 0, 0.3], "to": [2, 0, 0.3], "count": 2}, "flow": 0}
    world = world_with(tmp_path, line, {"csv": "two.csv"}, {"gcode": "two.gcode"})
    flows = [target.flow for target in world.task]
    assert flows == pytest.approx([0.0, 0.0, 0.0, 12.5, 0.0, 60.0, 60.0, 30.0])
    assert [target.flow for target in world_from_document(world_to_document(world)).task] == flows


REFUSED = [
    ({"csv": "bad.csv"}, r"bad\.csv: line 2: flow: expected at least 0 a metre, or nothing, got '-1'"),
    ({"csv": "two.csv", "flow": 1}, "flow: the file has its own, leave this out"),
    ({"points": [[0, 0, 0.3]], "flow": -1}, "flow: "),
]


@pytest.mark.parametrize(("part", "words"), REFUSED)
def test_flows_that_are_none_are_refused(part: dict[str, Any], words: str, tmp_path: Path) -> None:
    (tmp_path / "two.csv").write_text("x,y,z,flow\n0,0,0.3,1\n")
    (tmp_path / "bad.csv").write_text("x,y,z,flow\n0,0,0.3,-1\n")
    with pytest.raises(rik.InputError, match=words):
        world_with(tmp_path, part)
    with pytest.raises(rik.InputError, match="flow must be at least 0 and finite, got nan"):
        rik.Target(np.zeros(3), flow=math.nan)


def by_hand(motion: Motion | None = None, **rules: Any) -> rik.Plan:
    """A plan whose base carries the arm along x, over strokes with flows of their own."""
    motion = straight(len(STROKES)) if motion is None else motion
    world = world_of(straight(len(STROKES)))
    told = zip(world.task, STROKES, FLOWS, strict=True)
    task = tuple(replace(one, stroke=stroke, flow=flow) for one, stroke, flow in told)
    asked = replace(
        world, task=task, rules=replace(world.rules, **rules), speeds=rik.Speeds(base_velocity=0.2)
    )
    return plan_of(asked, motion)


@cache
def timed() -> rik.Plan:
    return rik.retime(by_hand())


def rows_of(found: rik.Plan, folder: Path, **options: Any) -> list[dict[str, str]]:
    rik.export(found, folder / "rows.csv", **options)
    return list(csv.DictReader((folder / "rows.csv").read_text().splitlines()))


def columns(rows: list[dict[str, str]], *names: str) -> Array:
    return np.array([[float(row[name]) for row in rows] for name in names])


@pytest.mark.parametrize("options", [{}, {"rate": 200.0}], ids=["states", "rate"])
def test_exports_tell_what_is_fed(options: dict[str, float], tmp_path: Path) -> None:
    """As much as the strokes ask, where the tool is on alone; and the rate is its slope."""
    rows = rows_of(timed(), tmp_path, **options)
    time, x, fed, rate, on = columns(rows, "time", "tool_x", "extrusion", "extrusion_rate", "tool_on")
    assert (fed[0], fed[-1]) == (0.0, pytest.approx(sum(FED)))
    travel = (x > x[0] + 0.3 + 1e-6) & (x < x[0] + 0.6 - 1e-6)
    assert fed[travel] == pytest.approx(FED[0])
    assert (rate[on == 0] == 0).all()
    if options:
        summed = np.concatenate([[0.0], np.cumsum(np.diff(time) * (rate[1:] + rate[:-1]) / 2)])
        assert np.abs(summed - fed).max() < 0.02
        steady = (x > x[0] + 0.13) & (x < x[0] + 0.27)
        assert rate[steady] == pytest.approx(20 * 0.2, rel=1e-3)


def test_a_plan_without_times_or_flow_tells_less(tmp_path: Path) -> None:
    rows = rows_of(by_hand(), tmp_path)
    assert "extrusion_rate" not in rows[0]
    assert float(rows[-1]["extrusion"]) == pytest.approx(sum(FED))
    world = timed().world
    bare = replace(world, task=tuple(replace(one, flow=None) for one in world.task))
    assert "extrusion" not in rows_of(replace(timed(), world=bare), tmp_path)[0]


def test_what_is_not_worked_is_not_fed(tmp_path: Path) -> None:
    """With the tool lifted halfway to the third set-point, where the rules let it be."""
    motion = straight(len(STROKES), between=3)
    kind, owner = motion.kind.copy(), motion.setpoint.copy()
    kind[6:8], owner[6:8] = "transit", -1  # on the way to set-point 3 of a quarter each
    lifted = by_hand(replace(motion, kind=kind, setpoint=owner), lift_within=True)
    worked = 0.1 * (10 + 20 / 4 + 20)
    assert float(rows_of(lifted, tmp_path)[-1]["extrusion"]) == pytest.approx(worked + FED[1])


def test_flows_of_a_plan_are_those_of_its_world() -> None:
    other = tuple(replace(one, flow=7.0) if k == 2 else one for k, one in enumerate(timed().world.task))
    (told,) = of_kind(rik.verify(timed(), replace(timed().world, task=other)), "world")
    assert told.text == "task: set-point 3: flow: 20.0 in the plan, 7.0 in the world"


def test_the_folder_for_ros_tells_what_is_fed(tmp_path: Path) -> None:
    rik.export(timed(), tmp_path / "cell", "ros2-folder", rate=50.0)
    points = yaml.safe_load((tmp_path / "cell" / "extrusion.yaml").read_text())["points"]
    assert points[-1]["extrusion"] == pytest.approx(sum(FED))
    assert "on /extrusion how much" in (tmp_path / "cell" / "README.txt").read_text()
    module = types.ModuleType("execute_plan")
    module.__file__ = str(tmp_path / "cell" / "execute_plan.py")
    exec(compile((tmp_path / "cell" / "execute_plan.py").read_text(), "x", "exec"), module.__dict__)
    times, fed = (np.array([point[key] for point in points]) for key in ("time", "extrusion"))
    for time in (-1.0, 0.0, 0.777, 99.0):
        asked = float(np.interp(time, times, fed))
        assert module.fed_at(points, time)[0] == pytest.approx(asked)
    bare = replace(timed().world, task=tuple(replace(one, flow=None) for one in timed().world.task))
    rik.export(replace(timed(), world=bare), tmp_path / "bare", "ros2-folder", rate=5.0)
    assert not (tmp_path / "bare" / "extrusion.yaml").exists()
    assert "extrusion" not in (tmp_path / "bare" / "README.txt").read_text()
