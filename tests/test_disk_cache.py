"""What is studied of a URDF file is kept on disk, and nothing that lies there can spoil what is read."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import pytest
import trimesh

import regionik as rik
from tests.urdfs import UPPER_SIZE, crane

LOAD = "import sys, regionik; print(regionik.load_robot(sys.argv[1], tip='tool').carry.tolist())"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("REGIONIK_CACHE_DIR", str(tmp_path / "kept"))
    return tmp_path / "kept"


def told(urdf: Path) -> tuple[object, ...]:
    """What is studied of a robot, to the bit."""
    robot = rik.load_robot(urdf, tip="tool")
    solids = [
        (solid.name, solid.link, solid.corners.tobytes(), solid.radius)
        for solid in (*robot.solids, *robot.base_solids)
    ]
    return robot.carry.tobytes(), robot.unchecked, robot.footprint.tobytes(), robot.body_height, solids


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_robot_is_the_same_from_disk(tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    urdf = crane(tmp_path)
    first, files = told(urdf), contents(folder)
    assert files
    assert told(urdf) == first
    assert contents(folder) == files
    monkeypatch.setenv("REGIONIK_CACHE_DIR", "")
    assert told(urdf) == first


def sealed(key: str, value: object) -> bytes:
    content = json.dumps([key, value]).encode()
    return sha256(content).hexdigest().encode() + b"\n" + content


def test_what_was_kept_is_not_made_again(tmp_path: Path, folder: Path) -> None:
    """A pair of names written into the file is the robot's."""
    urdf = crane(tmp_path)
    assert ("one", "other") not in rik.load_robot(urdf, tip="tool").unchecked
    name = min(contents(folder), key=lambda one: len(contents(folder)[one]))
    key, (rest, _, notes) = json.loads(contents(folder)[name].split(b"\n", 1)[1])
    (folder / name).write_bytes(sealed(key, [rest, [["one", "other"]], notes]))
    assert ("one", "other") in rik.load_robot(urdf, tip="tool").unchecked


def test_a_changed_mesh_or_file_is_studied_anew(tmp_path: Path, folder: Path) -> None:
    urdf = crane(tmp_path)
    before, names = told(urdf), set(contents(folder))
    trimesh.creation.box([size / 2 for size in UPPER_SIZE]).export(urdf.parent / "meshes" / "upper.stl")
    smaller = told(urdf)
    assert smaller != before
    assert set(contents(folder)) > names
    assert told(crane(tmp_path, ('upper="0.35"', 'upper="0.3"'))) != smaller
    assert told(crane(tmp_path)) == before


def another_number(data: bytes) -> bytes:
    """A file in which one number of an array is another."""
    at = data.index(b'"array": "') + 15
    return data[:at] + (b"A" if data[at : at + 1] != b"A" else b"B") + data[at + 1 :]


SPOILT: dict[str, Callable[[str, bytes], bytes]] = {
    "nothing": lambda key, data: b"",
    "half of it": lambda key, data: data[: len(data) // 2],
    "a byte changed": lambda key, data: data[:-20] + bytes([data[-20] ^ 1]) + data[-19:],
    "a number changed": lambda key, data: another_number(data),
    "not text": lambda key, data: b"\xff\xfe\x00" * 100,
    "deep lists": lambda key, data: sealed(key, json.loads("[" * 500 + "]" * 500)),
    "of another result": lambda key, data: sealed("0" * 64, [None, [], []]),
    "of a class that is not known": lambda key, data: sealed(key, {"Popen": [["touch", "here"]]}),
    "numbers of another kind": lambda key, data: sealed(
        key, [{"array": "AAAA", "dtype": "|O", "shape": [1]}, [], []]
    ),
    "another shape": lambda key, data: sealed(key, {"array": "AAAAAAAA8D8=", "dtype": "<f8", "shape": [7]}),
}


@pytest.mark.parametrize("how", SPOILT)
def test_a_spoilt_file_is_passed_over_and_replaced(tmp_path: Path, folder: Path, how: str) -> None:
    urdf = crane(tmp_path)
    first, files = told(urdf), contents(folder)
    for name, data in files.items():
        (folder / name).write_bytes(SPOILT[how](name.split(".")[0], data))
    assert told(urdf) == first
    assert contents(folder) == files


@pytest.mark.parametrize("what", ["a file", "below a file", "no device"])
def test_where_nothing_can_be_written_nothing_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    urdf, there = crane(tmp_path), tmp_path / "there"
    there.write_text("mine")
    place = {"a file": there, "below a file": there / "kept", "no device": Path(os.devnull, "kept")}[what]
    monkeypatch.setenv("REGIONIK_CACHE_DIR", "")
    first = told(urdf)
    monkeypatch.setenv("REGIONIK_CACHE_DIR", str(place))
    assert told(urdf) == first
    assert there.read_text() == "mine"


def test_the_folder_is_the_users_cache_unless_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    urdf = crane(tmp_path)
    monkeypatch.delenv("REGIONIK_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    told(urdf)
    assert contents(tmp_path / "xdg" / "regionik")
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    told(urdf)
    assert any("regionik" in path.parts for path in (tmp_path / "home").rglob("*.json"))


def test_what_was_used_last_is_kept(tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The oldest files go beyond the bounds, those of others never."""
    monkeypatch.setattr("regionik.worlds.disk_cache.MAX_FILES", 3)
    urdf = crane(tmp_path)
    told(urdf)
    own = set(contents(folder))
    assert 0 < len(own) < 3
    (folder / "notes.txt").write_text("mine")
    for k in range(4):
        for path in folder.iterdir():
            os.utime(path, (1e9, 1e9))  # as if used long ago
        told(urdf)
        told(crane(tmp_path, ('upper="0.35"', f'upper="0.3{k}"')))
        crane(tmp_path)
        found = set(contents(folder))
        assert len(found - {"notes.txt"}) == 3
        assert found > own | {"notes.txt"}


def test_two_processes_at_once_agree(tmp_path: Path, folder: Path) -> None:
    urdf = crane(tmp_path)
    runs = [
        subprocess.Popen([sys.executable, "-W", "ignore", "-c", LOAD, str(urdf)], stdout=subprocess.PIPE)
        for _ in range(2)
    ]
    said = {run.communicate()[0] for run in runs}
    assert [run.returncode for run in runs] == [0, 0]
    assert said == {f"{rik.load_robot(urdf, tip='tool').carry.tolist()}\n".encode()}
    assert not list(folder.glob("*.part"))
