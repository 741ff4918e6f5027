"""Long tables of targets: blocks, parts, and runs that go on after a kill with the same bytes."""

from __future__ import annotations

import fcntl
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.cli.app import run
from regionik.output import answers as module
from regionik.output.answers import csv_header, csv_rows, parse_targets, stream_answers, write_answers
from regionik.planners.progress import listening
from regionik.reachability.options import REACHABILITY
from regionik.reachability.reach import reach
from regionik.storage.files import open_partial
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError
from regionik.worlds.readers.csv_path import CsvBlock, index_csv, read_csv
from regionik.worlds.scene import World
from tests import examples


def table_of(folder: Path, count: int) -> Path:
    points = np.random.default_rng(0).uniform([-1, -1.5, 0], [4.5, 2.5, 0.9], (count, 3))
    path = folder / "targets.csv"
    path.write_text("# drawn\nx,y,z\n" + "".join(f"{x!r},{y!r},{z!r}\n" for x, y, z in points.tolist()))
    return path


def at_once(world: World, table: Path) -> bytes:
    answer = reach(world, parse_targets(world, [], table))
    names = world.robot.chain.names
    return (csv_header(names) + csv_rows(answer, names)).encode()


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    few = replace(REACHABILITY.search, targets_at_once=25)
    monkeypatch.setattr(module, "REACHABILITY", replace(REACHABILITY, search=few))


# Reading ------------------------------------------------------------------------------------------------


@settings(max_examples=examples(60))
@given(
    st.lists(st.sampled_from(["1,2,0.3", " 4 , 5e-1,6", "", "# a, b", "  ", "-0.5,.25,1_0"]), max_size=30),
    st.integers(1, 12),
    st.booleans(),
    st.sampled_from(["\n", "\r\n"]),
    st.booleans(),
)
def test_blocks_are_the_file(
    tmp_path_factory: pytest.TempPathFactory, lines: list[str], size: int, named: bool, end: str, closed: bool
) -> None:
    path = tmp_path_factory.mktemp("table") / "t.csv"
    lines = [*(["x,y,z"] if named else []), "7,8,9", *lines]
    path.write_bytes((end.join(lines) + (end if closed else "")).encode())
    blocks = index_csv(path, size)
    assert b"".join(blocks.block(k).data for k in range(len(blocks))) == path.read_bytes()
    points = np.concatenate([blocks.block(k).path().points for k in range(len(blocks))])
    assert np.array_equal(points, read_csv(path).points)
    assert max(blocks.block(k).data.count(b"\n") for k in range(len(blocks))) <= size


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("1,2", "line 90: z: expected a finite number, got ''"),
        ("1,2,3,0,0,1", "line 90: expected 3 columns as in line 2, got 6"),
        ("1,2,high", "line 90: z: expected a finite number"),
        ("1,2,nan", "line 90: z: expected a finite number"),
        ("x,y,z", "line 90: x: expected a finite number"),
    ],
)
def test_a_wrong_line_is_named_before_any_work(
    tmp_path: Path, line: str, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = table_of(tmp_path, 100)
    lines = table.read_text().splitlines()
    lines[89] = line
    table.write_text("\n".join(lines))
    monkeypatch.setattr(module, "_answer_block", lambda *_: pytest.fail("worked"))
    with pytest.raises(InputError, match=expected):
        stream_answers(load_world("free"), table, tmp_path / "answers.csv")


@pytest.mark.parametrize("text", [b"", b"x,y,z\n", b"# 1,2,3\n", b"\xff\xfe1,2,3\n"])
def test_tables_without_points(tmp_path: Path, text: bytes) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(text)
    with pytest.raises(InputError, match=r"t.csv: expected"):
        index_csv(path, 10)


def test_a_table_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        index_csv(tmp_path / "t.csv", 10)


# Answers ------------------------------------------------------------------------------------------------


def test_the_table_is_that_of_a_small_run(tmp_path: Path) -> None:
    world, table, output = load_world("l_shape"), table_of(tmp_path, 110), tmp_path / "answers.csv"
    told: list[tuple[str, int, int]] = []
    with listening(lambda *row: told.append(row)):
        yes, total = stream_answers(world, table, output)
    assert output.read_bytes() == at_once(world, table)
    assert (yes, total) == (output.read_text().count(",reachable,"), 110)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["answers.csv", "targets.csv"]
    assert [row for row in told if row[0] == "blocks"] == [("blocks", k, 5) for k in range(6)]
    whole = tmp_path / "again.csv"
    write_answers(reach(world, parse_targets(world, [], table)), world.robot.chain.names, whole)
    assert whole.read_bytes() == output.read_bytes()


def test_directions_and_blocks_of_nothing(tmp_path: Path) -> None:
    world, table, output = load_world("free"), tmp_path / "t.csv", tmp_path / "answers.csv"
    row = "0.5,-0.1,0.3,1,0,0\n"
    table.write_text("x,y,z,dx,dy,dz\n" + row * 3 + "# nothing\n" * 60 + row + "0,0,3,1,0,0\n")
    assert stream_answers(world, table, output) == (4, 5)
    assert output.read_bytes() == at_once(world, table)


class Cut(Exception):
    """The end of a run, as a kill would be."""


@pytest.fixture
def cut_after(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], list[int]]:
    """Let the answering of blocks end after so many of them; returns what was answered."""
    real = module._answer_block

    def arm(most: int) -> list[int]:
        numbers: list[int] = []

        def answered(world: World, block: CsvBlock) -> tuple[bytes, int, int]:
            if len(numbers) == most:
                raise Cut
            numbers.append(block.number)
            return real(world, block)

        monkeypatch.setattr(module, "_answer_block", answered)
        return numbers

    return arm


def test_a_run_goes_on_where_it_ended(tmp_path: Path, cut_after: Callable[[int], list[int]]) -> None:
    world, table, output = load_world("l_shape"), table_of(tmp_path, 110), tmp_path / "answers.csv"
    parts = tmp_path / "answers.csv.parts"
    done = []
    for most in (0, 2, 1):
        numbers = cut_after(most)
        with pytest.raises(Cut):
            stream_answers(world, table, output)
        done += numbers
        assert not output.exists()
        assert len(list(parts.iterdir())) == 1 + len(done)
    (parts / ".0123456789abcdef.part").write_text("what a kill left")
    done += (numbers := cut_after(99))
    yes, total = stream_answers(world, table, output)
    assert sorted(done + numbers) == [1, 26, 51, 76, 101]
    assert output.read_bytes() == at_once(world, table)
    assert (yes, total) == (output.read_text().count(",reachable,"), 110)
    assert not parts.exists()


@pytest.fixture
def cut_run(tmp_path: Path, cut_after: Callable[[int], list[int]]) -> tuple[World, Path, Path]:
    """A run that was broken off after two blocks."""
    world, table, output = load_world("free"), table_of(tmp_path, 110), tmp_path / "answers.csv"
    cut_after(2)
    with pytest.raises(Cut):
        stream_answers(world, table, output)
    cut_after(99)
    return world, table, output


def test_another_world_or_table_is_refused(cut_run: tuple[World, Path, Path]) -> None:
    world, table, output = cut_run
    slack = replace(world, rules=replace(world.rules, clearance=0.1))
    with pytest.raises(InputError, match=r"answers.csv.parts: .* another world; .* remove the folder"):
        stream_answers(slack, table, output)
    table.write_text(table.read_text() + "1,1,0.5\n")
    with pytest.raises(InputError, match="another table of targets; "):
        stream_answers(world, table, output)


def test_other_versions_are_refused(cut_run: tuple[World, Path, Path]) -> None:
    world, table, output = cut_run
    path = output.with_name("answers.csv.parts") / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["version of regionik or of what it stands on"]["shapely"] = "1.0"
    path.write_text(json.dumps(manifest))
    with pytest.raises(InputError, match="another version of regionik"):
        stream_answers(world, table, output)
    path.write_text("{")
    with pytest.raises(InputError, match=r"not the manifest of parts; remove the folder"):
        stream_answers(world, table, output)


def test_two_runs_at_once_are_refused(cut_run: tuple[World, Path, Path]) -> None:
    world, table, output = cut_run
    lock = os.open(output.with_name("answers.csv.parts"), os.O_RDONLY)
    fcntl.flock(lock, fcntl.LOCK_EX)
    with pytest.raises(InputError, match="another run is writing there"):
        stream_answers(world, table, output)
    os.close(lock)
    assert stream_answers(world, table, output)[1] == 110


def test_a_folder_of_other_things_is_left_alone(tmp_path: Path) -> None:
    folder = tmp_path / "answers.csv.parts"
    folder.mkdir()
    (folder / "letters.txt").write_text("dear")
    with (
        pytest.raises(InputError, match="other things than parts"),
        open_partial(tmp_path / "answers.csv", {"world": "a"}),
    ):
        pytest.fail("began")
    assert (folder / "letters.txt").read_text() == "dear"


# The command --------------------------------------------------------------------------------------------


def test_too_many_for_memory_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("regionik.output.answers.MAX_IN_MEMORY", 100)
    table = table_of(tmp_path, 110)
    for more in (["-o", str(tmp_path / "answers.json")], ["--json"], []):
        assert run(["reach", "free", "--csv", str(table), *more]) == 2
        out, err = capfd.readouterr()
        assert out == ""
        assert f"{table}: 110 targets are more than the 100 that are answered at once" in err
        assert len(err.splitlines()) == 1


def test_workers_or_dask(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["reach", "free", "--workers", "2", "--dask", "tcp://localhost:1"]) == 2
    assert "--workers and --dask" in capfd.readouterr().err


KILLED = """
import os, signal, sys
from regionik.cli import app
from regionik.reachability.options import REACHABILITY
from regionik.storage.files import PartialFile

object.__setattr__(REACHABILITY.search, "targets_at_once", 25)
left, write = [int(sys.argv.pop(1))], PartialFile.write_part


def write_part(*args):
    write(*args)
    left[0] -= 1
    if left[0] == 0:
        os.kill(os.getpid(), signal.SIGKILL)


PartialFile.write_part = write_part
app.run_process()
"""


@pytest.mark.slow
def test_killed_runs_give_the_bytes_of_an_unbroken_one(tmp_path: Path) -> None:
    """Killed after one part, and when it was resumed after two more; none of what was written is lost."""
    table = table_of(tmp_path, 300)
    output = tmp_path / "answers.csv"
    parts = tmp_path / "answers.csv.parts"
    asked = ["reach", "free", "--csv", str(table), "-o", str(output)]
    for more, done in ((1, 1), (2, 3)):
        command = [sys.executable, "-c", KILLED, str(more), *asked]
        killed = subprocess.run(command, capture_output=True, text=True, check=False)
        assert killed.returncode == -signal.SIGKILL, killed.stderr
        assert sum("of" in path.name for path in parts.iterdir()) == done
        assert not output.exists()
    command = [sys.executable, "-c", KILLED, "0", *asked]
    last = subprocess.run([*command, "--workers", "2"], capture_output=True, text=True, check=False)
    assert last.returncode == 1, last.stderr
    unbroken = tmp_path / "unbroken.csv"
    assert run(["reach", "free", "--csv", str(table), "-o", str(unbroken)]) == 1
    assert output.read_bytes() == unbroken.read_bytes()
    assert not parts.exists()
