"""Speeds of pieces of a path: read with them, kept by timed plans, checked and told."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import regionik as rik
from regionik.cli.app import run
from regionik.worlds.documents.world_file import world_from_document, world_to_document
from regionik.worlds.errors import FileNote
from regionik.worlds.readers.gcode import read_gcode
from tests.maths import Array
from tests.plans import of_kind, plan_of, straight, world_of
from tests.timed import SLACK, check_limits

FLOOR = {"polygon": [[-3, -3], [5, -3], [5, 3], [-3, 3]]}
COUNT = 13  # set-points of the path by hand, 0.1 m apart: two strokes and travel between
STROKES = [1] * 5 + [0] * 3 + [2] * 5
FEEDS = [0.2] * 3 + [0.05] * 2 + [0.01] * 3 + [None, 0.1, 0.1, None, 0.1]
FASTER = {"base_velocity": 1.0, "base_acceleration": 4.0}


def feeds_of(text: str, folder: Path) -> list[float]:
    """Speeds of a program's moves [mm/s], infinite for none."""
    (folder / "p.nc").write_text(text)
    speeds = read_gcode(folder / "p.nc", 0.05).speeds
    assert speeds is not None
    return [round(1000 * one, 6) for one in speeds.tolist()]


NONE = float("inf")
PROGRAMS = [
    ("G0 X0 Y0 Z9 F6000\nG1 X1 F60\nX2\nF120\nX3\nG0 X4\nG1 X5", [NONE, 1, 1, 2, NONE, 2]),
    ("G0 X0 Y0 Z9\nG1 X1\nX2 F60", [NONE, NONE, 1]),
    ("G20 G0 X0 Y0 Z9\nG1 X1 F60", [NONE, 25.4]),
    ("G0 X0 Y0 Z9\nG1 X1 F60\nX2 F0\nG4 F300\nX3", [NONE, 1, 1, 1]),
    ("G0 X0 Y0 Z9\nG3 X200 I100 F60\nG1 X3 F120", [NONE, 1, 1, 2]),
    ("M83\nG0 X0 Y0 Z9 F9000\nG1 F2400 E1\nG1 F1800\nG1 X9 E1\nG1 X1 F3000\nX9 E1\nX1 E1 F60",
     [NONE, 30, NONE, 50, 1]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "speeds"), PROGRAMS)
def test_f_is_the_speed_of_moves_at_work(text: str, speeds: list[float], tmp_path: Path) -> None:
    """It stays until the next, wherever that stands; travel has none."""
    assert feeds_of(text, tmp_path) == speeds


def test_f_that_is_no_speed_is_told(tmp_path: Path) -> None:
    with pytest.warns(FileNote, match=r"M204 \(line 2\); F by G93 \(line 4\)"):
        found = feeds_of("G0 X0 Y0 Z9\nM204 F9\nG1 X1 F60\nG93 X2 F9\nX3\nG94 X4\nX5 F60", tmp_path)
    assert found == [NONE, 1, NONE, NONE, NONE, 1]
    (tmp_path / "p.nc").write_text("G0 X0 Y0 Z9\nG1 X1")
    assert read_gcode(tmp_path / "p.nc", 0.1).speeds is None


def world_with(*parts: dict[str, Any], folder: Path | None = None) -> rik.World:
    document = {"version": 1, "robot": "youbot", "floor": FLOOR, "task": list(parts)}
    return world_from_document(document, folder=folder) if folder else world_from_document(document)


def speeds_of(world: rik.World) -> list[float | None]:
    return [target.speed for target in world.task]


def test_parts_and_tables_tell_speeds(tmp_path: Path) -> None:
    """A move that is divided is as fast all along; what is read is written again."""
    (tmp_path / "two.csv").write_text("x,y,z,Speed\n0,0,0.3,\n0.1,0,0.3,0.02\n")
    (tmp_path / "two.nc").write_text("G0 X0 Y0 Z300\nG1 X100 F60\nX150 F120\n")
    line = {"line": {"from": [1, 0, 0.3], "to": [2, 0, 0.3], "count": 2}, "speed": 0.5}
    world = world_with(line, {"csv": "two.csv"}, {"gcode": "two.nc"}, folder=tmp_path)
    assert speeds_of(world) == [0.5, 0.5, None, 0.02, None, 0.001, 0.001, 0.002]
    assert speeds_of(world_from_document(world_to_document(world))) == speeds_of(world)


REFUSED = [
    ({"csv": "bad.csv"}, r"bad\.csv: line 3: speed: expected a speed above 0 m/s, or nothing, got '-1'"),
    ({"csv": "two.csv", "speed": 0.1}, "speed: the file has its own, leave this out"),
    ({"points": [[0, 0, 0.3]], "speed": 0}, "speed: "),
]


@pytest.mark.parametrize(("part", "words"), REFUSED)
def test_speeds_that_are_none_are_refused(part: dict[str, Any], words: str, tmp_path: Path) -> None:
    (tmp_path / "two.csv").write_text("x,y,z,speed\n0,0,0.3,1\n0.1,0,0.3,0.02\n")
    (tmp_path / "bad.csv").write_text("x,y,z,speed\n0,0,0.3,1\n0.1,0,0.3,-1\n")
    with pytest.raises(rik.InputError, match=words):
        world_with(part, folder=tmp_path)
    with pytest.raises(rik.InputError, match="speed must be above 0 and finite, got inf"):
        rik.Target(np.zeros(3), speed=NONE)


# Timed


def by_hand(**speeds: Any) -> rik.Plan:
    """A plan whose base carries the arm along x, over strokes with speeds of their own."""
    motion = straight(COUNT)
    world = world_of(motion)
    told = zip(world.task, STROKES, FEEDS, strict=True)
    task = tuple(replace(one, stroke=stroke, speed=speed) for one, stroke, speed in told)
    limits = rik.Speeds(**FASTER, **speeds)
    return plan_of(replace(world, task=task, speeds=limits), motion)


@cache
def timed(**speeds: Any) -> rik.Plan:
    return rik.retime(by_hand(**speeds))


def tool_speeds(found: rik.Plan) -> tuple[Array, Array, Array]:
    """Each millisecond the tool's speed, its x, and the greatest speed that its strokes ask for there."""
    moving = rik.trajectory(found)
    look = moving.sample(np.append(np.arange(0.0, moving.duration, 1e-3), moving.duration))
    world, x = found.world, found.world.robot.tool(look.base, look.joints)[:, 0, 3]
    assert world.speeds is not None
    check_limits(look, world.speeds, world.robot.chain)
    places = np.array([target.position[0] for target in world.task])
    ahead = np.clip(np.searchsorted(places, x - 1e-6), 1, COUNT - 1)
    worked = np.array([False, *(a == b > 0 for a, b in zip(STROKES, STROKES[1:], strict=False))])
    asked = np.where(worked, [one or np.inf for one in FEEDS], np.inf)[ahead]
    return np.abs(look.base_velocity[:, 0]), x, asked


JERKS = {"base_jerk": 20.0, "turn_jerk": 40.0, "joint_jerk": 40.0}


@pytest.mark.parametrize(("jerks", "least"), [({}, 0.97), (JERKS, 0.75)], ids=["accelerations", "jerks"])
def test_each_piece_is_worked_no_faster_than_it_says(jerks: dict[str, float], least: float) -> None:
    """And as fast for most of it; travel is as fast as the base, whatever its own speed."""
    found = timed(**jerks)
    speed, x, asked = tool_speeds(found)
    assert rik.verify(found).ok
    assert (speed <= asked * SLACK).all()
    assert speed[x > x[0] + 0.5].max() > 0.5
    told = found.stats["timing"]["tool"]
    assert told["asked"] == [0.05, 0.2]
    assert told["held"] > least
    own = np.isfinite(asked)
    assert told["held"] == pytest.approx(np.mean(speed[own] >= 0.99 * asked[own]), abs=0.01)
    assert told["capped"] == 0.0


def test_the_smaller_of_two_limits_holds() -> None:
    found = timed(tool_velocity=0.1)
    speed, _, asked = tool_speeds(found)
    assert (speed <= np.minimum(asked, 0.1) * SLACK).all()
    assert found.stats["timing"]["tool"]["asked"] == [0.05, 0.1]
    own = np.isfinite(asked)  # on travel the limit is the one of the command
    assert found.stats["timing"]["tool"]["capped"] == pytest.approx(np.mean(own & (asked > 0.1)), abs=0.01)
    again = rik.retime(found, rik.Speeds(**FASTER))
    assert again.motion.time[-1] == pytest.approx(timed().motion.time[-1], rel=2e-3)
    with pytest.raises(rik.InputError, match=r"0\.2 m/s cannot be held at t = .*: the base would go at 0\.2"):
        rik.retime(found, rik.Speeds(base_velocity=0.15), hold=True)


def test_an_optimised_motion_keeps_them() -> None:
    found = rik.retime(by_hand(), optimise=True)
    speed, _, asked = tool_speeds(found)
    assert rik.verify(found).ok
    assert (speed <= asked * SLACK).all()


def test_one_piece_that_is_too_fast_is_caught() -> None:
    found = timed()
    slower = [replace(one, speed=0.09 if k == 9 else one.speed) for k, one in enumerate(found.world.task)]
    planted = replace(found, world=replace(found.world, task=tuple(slower)))
    told = of_kind(rik.verify(planted), "speeds")
    assert {one.setpoint for one in told} <= {8, 9}
    assert all("the tool's mean speed reaches 1.1" in one.text for one in told[1:-1])
    on_travel = [replace(one, speed=1e-3 if k == 6 else one.speed) for k, one in enumerate(found.world.task)]
    assert rik.verify(replace(found, world=replace(found.world, task=tuple(on_travel)))).ok


def test_speeds_of_a_timed_plan_are_those_of_its_world() -> None:
    found = timed()
    other = tuple(replace(one, speed=0.3) if k == 2 else one for k, one in enumerate(found.world.task))
    asked = replace(found.world, task=other)
    (told,) = of_kind(rik.verify(found, asked), "world")
    assert told.text == "task: set-point 3: speed: 0.2 in the plan, 0.3 in the world"
    assert rik.verify(by_hand(), asked).ok


def test_a_task_without_strokes_is_worked_all_along() -> None:
    found = by_hand()
    task = tuple(replace(one, stroke=None, speed=0.1) for one in found.world.task)
    again = rik.retime(replace(found, world=replace(found.world, task=task)))
    told = again.stats["timing"]["tool"]
    assert told["asked"] == [0.1, 0.1]
    assert again.motion.time[-1] == pytest.approx(1.2 / 0.1, rel=0.02)
    assert rik.verify(again).ok


def test_commands_say_how_much_is_worked_at_its_speed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "p.nc").write_text("G0 X500 Y0 Z300\nG1 X800 F600\nG0 Y10\nG1 X500 F1200\n")
    asked = {
        "version": 1, "robot": "youbot", "floor": FLOOR, "task": [{"gcode": "p.nc"}],
        "speeds": {"base_velocity": 0.3},
    }  # fmt: skip
    (tmp_path / "w.yaml").write_text(yaml.safe_dump(asked))
    assert run(["plan", str(tmp_path / "w.yaml"), "-o", str(tmp_path / "p.json")]) == 0
    assert "the tool holds 0.01 to 0.02 m/s, as asked, for 9" in capsys.readouterr().err
    again = ["retime", str(tmp_path / "p.json"), "-o", str(tmp_path / "q.json")]
    assert run([*again, "--tool-speed", "0.01"]) == 0
    told = capsys.readouterr().err
    assert "the tool holds 0.01 m/s for 100% of its time on the path; for 49% the task asks for more" in told
