"""Files made to do harm, and files broken at random: read, or refused in one line. More by tests.fuzz."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from regionik.output.plan_file import load_plan
from regionik.storage.files import open_partial
from regionik.worlds.documents.world_file import load_world, world_to_document
from regionik.worlds.errors import InputError
from regionik.worlds.readers.csv_path import index_csv, read_csv
from regionik.worlds.readers.meshes import read_mesh
from regionik.worlds.readers.occupancy_map import MAX_RUNS, load_map
from regionik.worlds.urdf.loader import load_robot
from tests.fuzz import judged
from tests.hostile import KINDS, MAP, READ, mutated, samples, write
from tests.nasty import TASK, broken
from tests.plans import every_solid

READERS: dict[str, Callable[[Path], Any]] = {
    "w.json": load_world, "w.yaml": load_world, "p.json": load_plan, "p.csv": read_csv,
    "long.csv": lambda path: index_csv(path, 10), "m.obj": read_mesh, "m.ply": read_mesh, "m.off": read_mesh,
    "r.urdf": load_robot, "m.yaml": lambda path: load_map(path, 1.0),
}  # fmt: skip

FLAT = (
    b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nelement face 1\n"
    b"property list uchar int vertex_indices\nend_header\n0 0\n1 0\n0 1\n3 0 1 2\n"
)
FACET = (
    b"solid one\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    b"endloop\nendfacet\nendsolid one\n"
)
PROPERTY_FIRST = (
    b"ply\nformat binary_little_endian 1\nelement vertex 8\nproperty vertex_indices\nend_header\n"
)


@pytest.mark.parametrize("kind", KINDS)
def test_good_cases_are_read_and_broken_ones_read_or_refused(kind: str, tmp_path: Path) -> None:
    for n, files in enumerate(samples(kind)):
        write(files, tmp_path / f"good {n}")
        assert judged(kind, tmp_path / f"good {n}", []) == "read"
        for seed in range(4):
            rng = np.random.default_rng(seed)
            write({name: mutated(data, rng) for name, data in files.items()}, tmp_path / f"{n} {seed}")
            assert judged(kind, tmp_path / f"{n} {seed}", []) in ("read", "refused")


def test_a_name_of_thousands_of_characters_makes_no_message_of_thousands(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(MAP.replace("m.pgm", "9" * 5000 + ".pgm"))
    with pytest.raises(InputError, match=r"/9+ ... 9+\.pgm: ") as refused:
        load_map(tmp_path / "m.yaml", 1.0)
    assert len(str(refused.value)) < 1100


def test_what_the_mesh_engine_thinks_on_its_way_is_not_said(tmp_path: Path) -> None:
    mesh = tmp_path / "m.stl"
    mesh.write_bytes(FACET.replace(b"normal 0 0 1", b"normal 0 0 z"))
    program = f"import pathlib, regionik.worlds.readers.meshes as m; m.read_mesh(pathlib.Path({str(mesh)!r}))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert "face_normals" not in done.stderr


@pytest.mark.parametrize("name", READERS)
def test_a_pipe_is_not_waited_for(name: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match=r"expected a file|no such file"):
        READERS[name](tmp_path / name)


def test_a_pipe_named_by_a_map_is_not_waited_for(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(MAP)
    os.mkfifo(tmp_path / "m.pgm")
    with pytest.raises(InputError, match="expected a file"):
        load_map(tmp_path / "m.yaml", 1.0)


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("w.yaml", broken(TASK, TASK.replace("5}", "1000001}")).encode(), "must be at most 1e"),
        ("p.csv", b"1,2,3,1e200,0,0\n", "line 1: dx: expected a number of at most 1e"),
        ("m.obj", b"v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "expected a mesh with x, y, z"),
        ("m.ply", FLAT.replace(b"0 1 2", b"0 1 99999999999999999999"), "can be read whole"),
        ("m.ply", PROPERTY_FIRST, "expected a mesh in PLY format that can be read whole"),
    ],
)  # fmt: skip
def test_numbers_and_meshes_that_cannot_be_used_are_refused(
    name: str, data: bytes, words: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=words):
        READERS[name](tmp_path / name)


def test_set_points_are_counted_over_all_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("regionik.worlds.documents.tasks.MAX_SETPOINTS", 7)
    (tmp_path / "w.yaml").write_text(broken(TASK, f"{TASK}\n  - {TASK}"))
    with pytest.raises(InputError, match=r"task\[1\]: expected at most 7 set-points"):
        load_world(tmp_path / "w.yaml")


def test_only_the_first_of_very_many_errors_is_made(tmp_path: Path) -> None:
    document = {**world_to_document(every_solid()), "obstacles": [{}] * 500_000}
    (tmp_path / "w.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"obstacles\[0\]: expected exactly one of"):
        load_world(tmp_path / "w.json")


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (b"P5 2000 1000 255\n" + bytes([0, 255] * 1_000_000), f"expected at most {MAX_RUNS} runs"),
    ],
)
def test_maps_that_take_too_long_are_refused(image: bytes, words: str, tmp_path: Path) -> None:
    write({READ["map"]: MAP.encode(), "m.pgm": image}, tmp_path)
    with pytest.raises(InputError, match=words):
        load_map(tmp_path / READ["map"], 1.0)


def test_an_image_that_claims_gigabytes_gets_no_room_for_them(tmp_path: Path) -> None:
    files = next(files for files in samples("map") if "m.png" in files)
    claims = files["m.png"].replace(b"\0\0\0 IDAT", b"\x80\0\0 IDAT")
    assert claims != files["m.png"]
    write({**files, "m.png": claims}, tmp_path)
    tracemalloc.start()
    try:
        load_map(tmp_path / READ["map"], 1.0)
        assert tracemalloc.get_traced_memory()[1] < 2**26
    finally:
        tracemalloc.stop()


def test_numbers_of_a_map_are_bounded(tmp_path: Path) -> None:
    text = MAP.replace("resolution: 0.1", "resolution: 1e300")
    write({**samples("map")[0], READ["map"]: text.encode()}, tmp_path)
    with pytest.raises(InputError, match="resolution: expected a finite number of at most"):
        load_map(tmp_path / READ["map"], 1.0)


def test_a_manifest_nested_without_end_is_refused(tmp_path: Path) -> None:
    write({READ["parts"]: b"[" * 100_000}, tmp_path)
    with (
        pytest.raises(InputError, match="is not the manifest of parts"),
        open_partial(tmp_path / "t.csv", {}),
    ):
        pass
