"""Frames of world files, columns of tables, and the names that exports use."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.output.ros2 import path_message
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.errors import InputError
from regionik.worlds.readers.csv_path import CsvFormat, Delimiter, read_csv
from regionik.worlds.scene import FrameNames, World
from tests import examples
from tests.maths import pose
from tests.plans import l_shape, synthetic_plan, timed

BASIC: dict[str, Any] = {
    "version": 1,
    "robot": "youbot",
    "floor": {"polygon": [[-3, -3], [3, -3], [3, 3], [-3, 3]]},
    "task": [{"points": [[0.5, 0, 0.3]]}],
}
TILTED = {"position": [0.3, 0.1, 0.2], "rpy": [0.1, 0.2, 0.3]}
TURNED = {"position": [0.3, 0.1, 0.2], "rpy": [0, 0, 0.7]}

places = st.lists(st.floats(-1, 1), min_size=3, max_size=3)
frames = st.fixed_dictionaries({"position": places, "rpy": places})


def world_of(**parts: Any) -> World:
    return world_from_document({**BASIC, **parts})


@given(table=frames, part=frames, point=places, direction=places.filter(lambda d: np.linalg.norm(d) > 0.1))
@settings(max_examples=examples(40))
def test_a_path_in_a_frame_is_the_path_moved(
    table: dict[str, Any], part: dict[str, Any], point: list[float], direction: list[float]
) -> None:
    """A frame in a frame moves points and directions as the product of both poses does."""
    task = [{"points": [point], "direction": direction, "frame": "part"}]
    found = world_of(frames={"part": {**part, "parent": "table"}, "table": table}, task=task).task[0]
    T = pose(table["position"], table["rpy"]) @ pose(part["position"], part["rpy"])
    assert np.allclose(found.position, T[:3, :3] @ point + T[:3, 3], atol=1e-9)
    assert found.direction is not None
    assert np.allclose(found.direction, T[:3, :3] @ direction / np.linalg.norm(direction), atol=1e-9)


def test_a_frame_is_given_by_name_or_where_it_is_used() -> None:
    piece = {"arc": {"center": [0.5, 0, 0.3], "radius": 0.1, "from": 0, "to": 1, "count": 4}}
    named = world_of(frames={"part": TILTED}, task=[{**piece, "frame": "part"}])
    inline = world_of(task=[{**piece, "frame": TILTED}])
    for one, other in zip(named.task, inline.task, strict=True):
        assert (one.position == other.position).all()
    assert not np.allclose(named.task[0].position, world_of(task=[piece]).task[0].position)


def test_obstacles_stand_in_frames() -> None:
    box = {"name": "a", "box": {"size": [1, 2, 1], "center": [1, 0, 0.5], "yaw": 0.2}}
    ball = {"name": "b", "sphere": {"radius": 0.1, "center": [1, 0, 0.5]}}
    obstacles = [{**box, "frame": "part"}, {**ball, "frame": "tilted"}]
    found = world_of(frames={"part": TURNED, "tilted": TILTED}, obstacles=obstacles).obstacles
    T = pose(TURNED["position"], TURNED["rpy"])
    assert np.allclose(found[0].center, T[:3, :3] @ [1, 0, 0.5] + T[:3, 3])  # type: ignore[union-attr]
    assert found[0].yaw == pytest.approx(0.9)  # type: ignore[union-attr]
    T = pose(TILTED["position"], TILTED["rpy"])
    assert np.allclose(found[1].center, T[:3, :3] @ [1, 0, 0.5] + T[:3, 3])  # type: ignore[union-attr]


BOX = {"name": "a", "box": {"size": [1, 1, 1], "center": [2, 2, 0.5]}, "frame": TILTED}
UNKNOWN = [{"points": [[0, 0, 0]], "frame": "prt"}]


@pytest.mark.parametrize(("parts", "told"), [
    ({"frames": {"part": TURNED}, "task": UNKNOWN}, "task[0].frame: unknown frame 'prt', valid names: map"),
    ({"frames": {"a": {"parent": "b"}, "b": {"parent": "a"}}}, "frames.a: parent: expected no circle"),
    ({"frames": {"a": {"parent": "c"}}}, "frames.a: parent: unknown frame 'c', valid names: map, a"),
    ({"frames": {"a": "b"}}, "frames.a: expected position and rpy; map, base_link, tool0 alone are texts"),
    ({"frames": {"map": TURNED}}, "frames.map: expected text, what exports call this frame"),
    ({"frames": {"map": "/map"}}, "frames.map: expected the name of a frame, as map or odom"),
    ({"frames": {"map": "tool0"}}, "frames.map, base_link, tool0: expected a name of its own"),
    ({"frames": {"a": {"rpy": [0, 0]}}}, "frames.a.rpy: expected 3 values or more, got 2"),
    ({"obstacles": [BOX]}, "obstacles[0].frame: a box stands upright, expected a frame that turns about z"),
])  # fmt: skip
def test_frames_that_make_no_sense_are_refused(parts: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError) as caught:
        world_of(**parts)
    assert told in str(caught.value)


def test_thousands_of_frames_in_a_row_add_up() -> None:
    frames: dict[str, Any] = {f"f{k}": {"parent": f"f{k + 1}", "position": [1, 0, 0]} for k in range(5000)}
    task = [{"points": [[0, 0, 0.3]], "frame": "f0"}]
    target = world_of(frames={**frames, "f5000": {}}, task=task).task[0]
    assert target.position.tolist() == [5000, 0, 0.3]
    with pytest.raises(InputError, match="map, f0, f1, "):
        world_of(frames={**frames, "f5000": {}}, task=[{**task[0], "frame": "f"}])


def test_names_of_frames_come_back_and_go_out() -> None:
    names = {"map": "hall", "base_link": "cart/base_link", "tool0": "cart/tool0"}
    world = world_of(frames={**names, "part": TURNED})
    assert world.frames == FrameNames(**names)
    assert world_from_document(json.loads(json.dumps(world_to_document(world)))).frames == world.frames
    assert "frames" not in world_to_document(world_of())


def test_exports_use_the_worlds_name_for_its_frame(tmp_path: Path) -> None:
    from dataclasses import replace

    from regionik.output.export import export

    plan = timed(synthetic_plan(l_shape()))
    called = replace(plan, world=replace(plan.world, frames=FrameNames(map="hall")))
    for frame, wanted in ((None, "hall"), ("odom", "odom")):
        out = tmp_path / f"{wanted}.yaml"
        export(called, out, "path", frame=frame)
        assert yaml.safe_load(out.read_text())["header"]["frame_id"] == wanted
    assert path_message(called)["header"]["frame_id"] == "map"


# --- columns

TABLE = """# measured on Monday
No;"X (mm)";"Y (mm)";Height;note
1;10;20;5;"first; of two"

2;30;40;5,0;second
"""
CHOSEN = {"x": "X (mm)", "y": "Y (mm)", "z": "Height"}


def columns_of(text: str, chosen: dict[str, str], folder: Path, delimiter: Delimiter = "semicolon") -> Any:
    path = folder / "t.csv"
    path.write_text(text)
    return read_csv(path, CsvFormat(chosen, delimiter))


def test_columns_are_chosen_by_their_titles(tmp_path: Path) -> None:
    text = TABLE.replace("5,0", "6")
    assert columns_of(text, CHOSEN, tmp_path).points.tolist() == [[10, 20, 5], [30, 40, 6]]
    swapped = columns_of(text, {"x": "Height", "y": "No", "z": "X (mm)"}, tmp_path)
    assert swapped.points.tolist() == [[5, 1, 10], [6, 2, 30]]
    turned = "x\ty\tz\tdx\tdy\tdz\n1\t2\t3\t0\t0\t-1\n"
    found = columns_of(turned, {key: key for key in ("x", "y", "z", "dx", "dy", "dz")}, tmp_path, "tab")
    assert found.directions.tolist() == [[0, 0, -1]]


def test_a_world_reads_columns_and_gcode(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(TABLE.replace("5,0", "6"))
    (tmp_path / "p.nc").write_text("G1 X100 Y0\nX200\n")
    csv = {"csv": "t.csv", "scale": 0.001, "columns": CHOSEN, "delimiter": "semicolon", "frame": "part"}
    nc = {"gcode": "p.nc", "frame": "part", "direction": [0, 0, -1], "cone": 0.2}
    document = {**BASIC, "frames": {"part": {"position": [0.5, 0, 0.3]}}, "task": [csv, nc]}
    path = tmp_path / "w.yaml"
    path.write_text(yaml.safe_dump(document))
    found = [target.position.round(9).tolist() for target in load_world(path).task]
    halves = [[0.6, 0, 0.3], [0.65, 0, 0.3], [0.7, 0, 0.3]]  # of the program's move at work
    assert found == [[0.51, 0.02, 0.305], [0.53, 0.04, 0.306], *halves]


@pytest.mark.parametrize(("text", "chosen", "told"), [
    (TABLE, CHOSEN, "line 5: Height: expected a finite number, got '5,0'"),
    ("a;a;a;a;x;y;z\n1;2\n", {key: key for key in "xyz"}, "line 2: x: expected a finite number, got ''"),
    (TABLE, {**CHOSEN, "z": "Z"}, "line 2: the title 'Z' is not there, titles: 'No, X (mm), Y (mm), Height"),
    (TABLE.replace("No", "Height"), CHOSEN, "line 2: the title 'Height' is twice there"),
    (TABLE, {**CHOSEN, "z": "No", "y": "No"}, "columns: expected a title of its own for each"),
    (TABLE, {"x": "No", "y": "Height"}, "columns: expected titles for x,y,z"),
    ("x;y;z\n1;2\n", {key: key for key in "xyz"}, "line 2: z: expected a finite number"),
    ("x;y;z\n1;2;\"3\n", {key: key for key in "xyz"}, "line 2: unexpected end of data"),
    ("x;y;z\n", {key: key for key in "xyz"}, "expected at least one line below the titles"),
    ("", {key: key for key in "xyz"}, "expected at least one line of x,y,z, or of titles"),
])  # fmt: skip
def test_tables_that_do_not_fit_are_told(
    text: str, chosen: dict[str, str], told: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        columns_of(text, chosen, tmp_path)
    assert told in str(caught.value)
