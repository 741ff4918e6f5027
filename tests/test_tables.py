"""Tables as people have them: titles, names, units and normals, and names and codes in what comes out."""

from __future__ import annotations

import csv
import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import regionik as rik
from regionik.cli.app import run
from regionik.view.floor_view import floor_view
from regionik.view.world_picture import picture_of_world
from regionik.worlds.documents.world_file import world_from_document, world_to_document
from regionik.worlds.errors import FileNote
from tests import examples

FLOOR = {"polygon": [[-1, -1], [3, -1], [3, 1], [-1, 1]]}
NAMED = """Name;X;Y;Z
cup_7;500;0;300
far "one";9000;0;300
shelf, top;1300;100;900
;700;0;300
"""


def world_of(folder: Path, text: str, **piece: Any) -> rik.World:
    """A world whose task is a table."""
    (folder / "t.csv").write_text(text, encoding="utf-8")
    document = {"version": 1, "robot": "youbot", "floor": FLOOR, "task": [{"csv": "t.csv", **piece}]}
    path = folder / "w.world.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return rik.load_world(path)


def refusal(folder: Path, text: str, **piece: Any) -> str:
    with pytest.raises(rik.InputError) as caught:
        world_of(folder, text, **piece)
    return str(caught.value)


def at(x: float, y: float, z: float) -> rik.Target:
    return rik.Target(np.array([x, y, z]))


# --- titles


@settings(max_examples=examples(40))
@given(st.permutations(["x", "y", "z", "dx", "dy", "dz", "name"]), st.sampled_from(",;\t"), st.randoms())
def test_columns_are_found_by_their_titles_in_any_order_and_case(
    tmp_path_factory: pytest.TempPathFactory, titles: list[str], sign: str, random: Any
) -> None:
    cells = {"x": "0.5", "y": "-0.25", "z": "0.3", "dx": "0", "dy": "0", "dz": "-2", "name": "a cup"}
    shown = [random.choice((title, title.upper(), title.title())) for title in titles]
    text = f"# a note\n\n{sign.join(shown)}\n{sign.join(cells[title] for title in titles)}\n"
    (target,) = world_of(tmp_path_factory.mktemp("t"), text).task
    assert target.position.tolist() == [0.5, -0.25, 0.3]
    assert target.direction is not None
    assert target.direction.tolist() == [0, 0, -1]
    assert target.name == "a cup"


def test_titles_that_are_not_known_are_named_once(tmp_path: Path) -> None:
    with pytest.warns(FileNote) as told:
        world_of(tmp_path, "colour,x,y,z,mass\nred,0.5,0,0.3,1\nblue,0.7,0,0.3,many\n")
    assert len(told) == 1
    assert "t.csv: line 1: titles passed over: 'colour, mass'; known are name, stroke, speed, flow, x" in str(
        told[0].message
    )


@pytest.mark.parametrize(
    ("text", "piece", "told"),
    [
        ("name,x,y\na,1,2\n", {}, "line 1: expected titles for x,y,z, at most one of .*: z missing, titles"),
        ("x,y,z,nx,ny\n1,2,3,0,0\n", {}, "line 1: .* nz missing"),
        ("x,y,z,dx,dy,dz,roll,pitch,yaw\n" + "1," * 8 + "1\n", {}, "line 1: .* got x,y,z,dx,"),
        ("x,X,y,z\n1,2,3,4\n", {}, "line 1: the title 'x' is twice there"),
        ("X [mm],y,z\n1,2,3\n", {}, r"line 1: the title 'X \[mm\]' says mm, expected unit: mm"),
        (
            "x,y,z,roll (deg),pitch,yaw\n1,2,3,0,0,0\n",
            {"angle_unit": "rad"},
            "says deg, expected angle_unit: deg",
        ),
        ("name,x,y,z\na,1,2,3,4\n", {}, "line 2: expected 4 columns as in line 1, got 5"),
        (
            "name,x,y,z\n" + "a" * 81 + ",1,2,3\n",
            {},
            "line 2: name: expected at most 80 printable characters",
        ),
        ("x,y,z\n1,2,3\n", {"unit": "mm", "scale": 0.1}, "unit: expected one of unit, scale"),
        ("x,y,z\n1,2,3\n", {"unit": "feet"}, "unit: expected 'm', 'cm', 'mm' or 'in'"),
        ("x,y,z,nx,ny,nz\n1,2,3,0,0,1\n", {}, "line 1: nx,ny,nz need direction: outward, out"),
        (
            "x,y,z,dx,dy,dz\n1,2,3,0,0,1\n",
            {"direction": "outward"},
            "line 1: direction: outward goes with",
        ),
        ("x,y,z,nx,ny,nz\n1,2,3,0,0,0\n", {"direction": "inward"}, "line 2: nx,ny,nz must not be zero"),
        ("x,y,z\n1,2,3\n", {"angle_unit": "deg"}, "line 1: angle_unit: deg goes with columns roll,pitch,yaw"),
        (
            "x,y,z,roll,pitch,yaw\n1,2,3,0,0,90\n",
            {},
            "line 1: roll,pitch,yaw need angle_unit: deg or rad",
        ),
        ("x,y,z\n1,2,3\n2,2,3\n", {"x_axis": "along_path"}, "x_axis: along_path needs the tool's axis"),
        (
            "x,y,z,dx,dy,dz\n0,0,0,0,0,1\n0,0,1,0,0,1\n0,0,2,0,0,1\n",
            {"x_axis": "along_path"},
            "x_axis: along_path: point 1 of 3: the path stands still or goes along the tool's axis",
        ),
    ],
)
def test_what_is_ambiguous_or_missing_is_refused_with_its_line(
    text: str, piece: dict[str, Any], told: str, tmp_path: Path
) -> None:
    message = refusal(tmp_path, text, **piece)
    assert "\n" not in message
    assert re.search(told, message), message


# --- units and normals


@pytest.mark.parametrize(("unit", "metres"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("in", 0.0254)])
def test_units_are_metres(unit: str, metres: float, tmp_path: Path) -> None:
    (target,) = world_of(tmp_path, "x,y,z\n20,-10,30\n", unit=unit).task
    np.testing.assert_allclose(target.position, np.array([20, -10, 30]) * metres, rtol=1e-15)


def test_titles_may_have_their_unit_in_brackets(tmp_path: Path) -> None:
    (target,) = world_of(tmp_path, "Name,X [mm],Y (mm),z[mm]\ncup,500,0,300\n", unit="mm").task
    assert (target.name, target.position.tolist()) == ("cup", [0.5, 0.0, 0.3])
    (target,) = world_of(tmp_path, "x [m],y,z (m)\n0.5,0,0.3\n").task
    assert target.position.tolist() == [0.5, 0.0, 0.3]


def test_normals_point_the_tool_into_the_part(tmp_path: Path) -> None:
    text = "x,y,z,nx,ny,nz\n0.5,0,0.3,0,-2,0\n"
    for word, axis in (("outward", [0, 1, 0]), ("inward", [0, -1, 0])):
        (target,) = world_of(tmp_path, text, direction=word).task
        assert target.direction is not None
        assert (target.direction + 0.0).tolist() == axis


@pytest.mark.parametrize(("said", "turns"), [("rad", 1.0), ("deg", 180.0 / np.pi)])
def test_roll_pitch_and_yaw_turn_about_fixed_axes(said: str, turns: float, tmp_path: Path) -> None:
    angles = np.array([0.3, -0.4, 2.5])
    cells = ",".join(repr(value) for value in (angles * turns).tolist())
    (target,) = world_of(tmp_path, f"x,y,z,roll,pitch,yaw\n0.5,0,0.3,{cells}\n", angle_unit=said).task
    wanted = Rotation.from_euler("xyz", angles).as_matrix()
    assert target.orientation is not None
    np.testing.assert_allclose(target.orientation, wanted, atol=1e-12)


def test_tool_axes_are_drawn_on_the_side_of_the_tool(tmp_path: Path) -> None:
    for word, side in (("outward", 1), ("inward", -1)):  # above the set-point, or below it
        world = world_of(tmp_path, "x,y,z,nx,ny,nz\n0.5,0,0.3,0,0,1\n", direction=word)
        (axes,) = (one for one in picture_of_world(world).bodies if one.path == "task/axes")
        above = side * (axes.mesh.vertices[:, 2] - 0.3)
        assert 0 < above.min() < 0.03
        assert 0.09 < above.max() < 0.11
    level = world_of(tmp_path, "x,y,z,nx,ny,nz\n0.5,0,0.3,0,-1,0\n", direction="outward")
    ((start, end),) = floor_view(level).tool_axes
    np.testing.assert_allclose(start, [0.5, -0.1], atol=1e-12)
    assert -0.1 < end[1] < 0


@settings(max_examples=examples(30))
@given(st.integers(0, 10_000))
def test_the_x_axis_goes_along_the_path(tmp_path_factory: pytest.TempPathFactory, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.uniform(0.05, 0.1, (5, 3)) * [1, 0.2, 0.2], axis=0)
    axes = rng.normal(size=(5, 3)) * [0.1, 1, 1] + [0, 0, -3]
    rows = "".join(",".join(map(repr, row)) + "\n" for row in np.hstack([points, axes]).tolist())
    folder = tmp_path_factory.mktemp("t")
    task = world_of(folder, f"x,y,z,dx,dy,dz\n{rows}", x_axis="along_path").task
    for k, target in enumerate(task):
        assert target.orientation is not None
        x, _, z = target.orientation.T
        np.testing.assert_allclose(target.orientation @ target.orientation.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(z, axes[k] / np.linalg.norm(axes[k]), atol=1e-12)
        way = points[min(k + 1, 4)] - points[max(k - 1, 0)]
        assert x @ way > 0
        assert abs(np.linalg.det(np.array([x, z, way / np.linalg.norm(way)]))) < 1e-9  # in one plane


# --- names and codes


def test_names_come_back_from_documents(tmp_path: Path) -> None:
    world = world_of(tmp_path, NAMED, unit="mm")
    names = ["cup_7", 'far "one"', "shelf, top", ""]
    assert [target.name for target in world.task] == names
    again = world_from_document(json.loads(json.dumps(world_to_document(world))))
    assert [target.name for target in again.task] == names
    unnamed = world_of(tmp_path, "0.5,0,0.3\n0.7,0,0.3\n")
    assert "names" not in json.dumps(world_to_document(unnamed)["task"])


def test_only_a_repeat_with_a_name_of_its_own_is_kept(tmp_path: Path) -> None:
    rows = "name,x,y,z\ncup,0.5,0,0.3\nlid,0.5,0,0.3\n,0.5,0,0.3\njar,0.7,0,0.3\njar,0.7,0,0.3\n"
    with pytest.warns(FileNote, match="set-point"):
        world = world_of(tmp_path, rows)
    assert [target.name for target in world.task] == ["cup", "lid", "jar"]


def test_answers_carry_names_and_codes(tmp_path: Path) -> None:
    answer = rik.reach(world := world_of(tmp_path, NAMED, unit="mm"), world.task)
    assert answer.name == ["cup_7", 'far "one"', "shelf, top", ""]
    assert answer.code == ["", "too-far", "too-high", ""]
    assert answer.reason[1].startswith(
        "The target 'far \"one\"' at (9.000, 0.000, 0.300) cannot be reached: "
    )


def test_every_file_of_answers_has_names_and_codes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "t.csv"
    table.write_text(NAMED, encoding="utf-8")
    asked = ["reach", "pillar", "--csv", str(table), "--unit", "mm"]
    for ending in (".csv", ".json", ".geojson"):
        output = tmp_path / f"answers{ending}"
        assert run([*asked, "-o", str(output)]) == 1
        text = output.read_text()
        assert all(word in text for word in ("cup_7", "shelf, top", "too-far", "too-high"))
    header, first = (tmp_path / "answers.csv").read_text().splitlines()[:2]
    assert header.startswith("name,x,y,z,verdict,code,base_x,")
    assert first.startswith("cup_7,0.5,0.0,0.3,reachable,,")
    capsys.readouterr()
    assert run([*asked, "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["code"] == "too-far"
    assert [one["name"] for one in told["answers"]] == ["cup_7", 'far "one"', "shelf, top", ""]
    assert run(asked) == 1
    assert "shelf, top" in capsys.readouterr().out


def test_columns_of_a_table_are_chosen_at_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "t.csv"
    table.write_text("East,Up,North,Label\n0.5,0.3,0,cup\n", encoding="utf-8")
    asked = ["reach", "pillar", "--csv", str(table), "--json", "--columns"]
    assert run([*asked, "x=east,y=North,z=Up,name=label"]) == 0
    (answer,) = json.loads(capsys.readouterr().out)["answers"]
    assert [answer[key] for key in ("name", "x", "y", "z")] == ["cup", 0.5, 0.0, 0.3]
    for columns, told in (
        ("x=East,y=North", "--csv: columns: expected titles for x,y,z"),
        ("x=East,x=North,z=Up", "--csv: columns: expected each once, as in x=East,y=North,z=Up"),
        ("x=East,y=North,z=Height", "the title 'Height' is not there"),
    ):
        assert run([*asked, columns]) == 2
        assert told in capsys.readouterr().err
    assert run(["reach", "pillar", "--unit", "mm"]) == 2
    assert "--unit: goes with --csv TABLE" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("target", "base", "changes", "code"),
    [
        (at(0.5, 0, 2), None, {}, "too-high"),
        (at(0.5, 0, -2), None, {}, "too-low"),
        (at(0.5, 0, 0.3), [3.5, 0, 0], {}, "off-floor"),
        (at(0.5, 0, 0.3), [0, 0, 0], {"heading": "fixed"}, "wrong-heading"),
        (at(2.5, 0, 0.3), [0, 0, 0], {}, "too-far"),
        (at(0.5, 0, 0.3), [0, 0, 0], {}, ""),
    ],
)
def test_reasons_have_a_code(
    target: rik.Target, base: list[float] | None, changes: dict[str, Any], code: str, tmp_path: Path
) -> None:
    world = world_of(tmp_path, "0.5,0,0.3\n")
    world = replace(
        world, rules=replace(world.rules, **changes), start=rik.Start(np.array([0, 0, 1.0]), np.zeros(5))
    )
    answer = rik.reach(world, [target], base=base)
    assert answer.code == [code]
    assert (answer.code == [""]) == (answer.reason == [""])


def test_a_base_in_an_obstacle_and_a_target_in_one_have_codes(tmp_path: Path) -> None:
    world = world_of(tmp_path, "0.5,0,0.3\n")
    block = rik.Box("block", np.ones(3), np.array([1.5, 0, 0.5]))
    crowded = replace(world, obstacles=(block,), rules=replace(world.rules, tool_contact=0.0))
    assert rik.reach(crowded, [[1.0, 0, 0.3]], base=[1.5, 0, 0]).code == ["base-blocked"]
    post = rik.Box("post", np.array([0.2, 0.2, 1.0]), np.array([1.5, 0, 0.5]))
    thin = replace(world, obstacles=(post,), rules=replace(crowded.rules, clearance=0.05))
    assert rik.reach(thin, [[1.5, 0, 0.4]]).code == ["in-obstacle"]


def test_what_plans_leave_out_is_told_by_name_and_code(tmp_path: Path) -> None:
    world = world_of(tmp_path, NAMED, unit="mm")
    found = rik.plan(replace(world, rules=replace(world.rules, skip_unreachable=True)))
    assert [(one.target.name, one.code) for one in found.skipped] == [
        ('far "one"', "too-far"),
        ("shelf, top", "too-high"),
    ]
    assert found.skipped[1].reason.startswith("Set-point 3 of 4 'shelf, top' at (1.300, 0.100, 0.900)")
    found.save(tmp_path / "plan.json")
    again = rik.load_plan(tmp_path / "plan.json")
    assert [(one.target.name, one.code) for one in again.skipped] == [
        (one.target.name, one.code) for one in found.skipped
    ]
    assert [target.name for target in again.world.task] == ["cup_7", ""]
    assert rik.verify(again).ok
    rik.export(again, tmp_path / "states.csv")
    rows = csv.DictReader((tmp_path / "states.csv").read_text("utf-8").splitlines())
    assert [row["name"] for row in rows if row["kind"] == "setpoint"] == ["cup_7", ""]
    page = tmp_path / "plan.html"
    rik.to_html(again, page)
    assert '"setpoints":["cup_7",""]' in page.read_text("utf-8")


def test_stops_name_their_set_points(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    world_of(tmp_path, NAMED, unit="mm")
    path, output = str(tmp_path / "w.world.yaml"), tmp_path / "stops.geojson"
    assert run(["stops", path, "--skip", "--json", "-o", str(output)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [stop["names"] for stop in told["stops"]] == [["cup_7", ""]]
    assert json.loads(output.read_text())["features"][0]["properties"]["names"] == ["cup_7", ""]
    assert [(one["name"], one["code"]) for one in told["skipped"]] == [
        ('far "one"', "too-far"),
        ("shelf, top", "too-high"),
    ]
    assert run(["stops", path, "--skip"]) == 0
    assert "cup_7" in capsys.readouterr().out


def test_answers_as_a_data_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer = rik.reach(world := world_of(tmp_path, NAMED, unit="mm"), world.task)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(rik.InputError, match="to_pandas needs pandas"):
        answer.to_pandas()
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=dict))
    table = answer.to_pandas(["a", "b", "c", "d", "e"])
    assert list(table)[:6] == ["name", "x", "y", "z", "verdict", "code"]
    assert list(table)[9:] == ["a", "b", "c", "d", "e", "reason"]
    assert table["a"][0] == answer.joints[0, 0]
    assert table["base_x"][1] is None
    assert {len(column) for column in table.values()} == {4}
