"""What goes wrong around a command: signals, full disks, closed streams, libraries that fail."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from numba.core.caching import FunctionCache

import regionik
from regionik.cli.app import run
from regionik.planners import kernels
from regionik.storage.files import write_atomic
from regionik.view import viewer
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import EngineError, InputError
from tests.faulty import CASES, LONGEST

FREE = Path(__file__).parent.parent / "worlds" / "data" / "free.world.yaml"
ENDS = {"interrupted": 130, "terminated": 143, "killed": -9, "cramped": 2}


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """What came of each command that was asked to end."""
    folder = tmp_path_factory.mktemp("faulty")
    run = [sys.executable, "-W", "error", "-m", "tests.faulty", str(folder)]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    outcomes: dict[str, dict[str, Any]] = json.loads((folder / "found.json").read_text())
    return outcomes


@pytest.mark.parametrize("name", CASES)
def test_a_command_that_is_asked_to_end_ends_and_leaves_nothing(
    name: str, found: Mapping[str, dict[str, Any]]
) -> None:
    end, instead = found[name], CASES[name].instead
    assert end["code"] == ENDS.get(instead, 130), end["err"]
    if instead == "killed":
        assert end["err"] == ""
        assert [file.startswith(".plan.json.") for file in end["files"]] == [True]
        return
    assert len(end["err"].splitlines()) == 1
    assert "interrupted" in end["err"] or "cannot be written" in end["err"]
    # A long table goes on where it was broken off.
    assert end["files"] == (["answers.csv.parts"] if name == "reach" else [])


@pytest.mark.parametrize("name", ["x" * 255, "é" * 120, "[a-z]*?.json", "new\nline.json", "-o"])
def test_any_name_that_a_file_can_have_is_written(tmp_path: Path, name: str) -> None:
    for content in ("old", "new"):
        write_atomic(tmp_path / name, content)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {name: "new"}


def test_two_writers_of_one_file_leave_one_whole_file_at_any_time(tmp_path: Path) -> None:
    target, size = tmp_path / "plan.json", 200_000
    write_atomic(target, "a" * size)

    def write(letter: str) -> None:
        for _ in range(30):
            write_atomic(target, letter * size)

    writers = [threading.Thread(target=write, args=[letter]) for letter in "ab"]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        text = target.read_text()
        assert (len(text), len(set(text))) == (size, 1)
    assert os.listdir(tmp_path) == ["plan.json"]


def test_a_disk_that_fills_up_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "plan.json"
    write_atomic(target, "old")

    def full(fd: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="No space left"):
        write_atomic(target, "new")
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["plan.json"]


@pytest.mark.parametrize(
    "error",
    [
        RuntimeError("goal\nstate"),
        ValueError("fcl"),
        MemoryError(),
        np.linalg.LinAlgError("Singular matrix"),
        shapely.GEOSException("TopologyException"),
        EngineError("ompl: it broke"),
        KeyError("x"),
        BrokenPipeError(32, "Broken pipe"),
        BlockingIOError(11, "Resource temporarily unavailable"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_a_library_that_fails_is_one_line(
    error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def stage(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("regionik.pipeline.whole_path", stage)
    assert run(["plan", "free", "-o", str(tmp_path / "plan.json")]) == 3
    out, err = capfd.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert "Traceback" not in err
    assert "test_faults.py line" in err or isinstance(error, EngineError | MemoryError)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_goes_meanwhile_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    from regionik import pipeline

    folder = tmp_path / "gone"
    folder.mkdir()
    plan = pipeline.plan

    def stage(*arguments: Any, **options: Any) -> Any:
        folder.rmdir()
        return plan(*arguments, **options)

    monkeypatch.setattr(pipeline, "plan", stage)
    assert run(["plan", "free", "-o", str(folder / "plan.json")]) == 2
    assert "expected an existing folder" in capfd.readouterr().err


def test_a_folder_that_is_read_only_is_told_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # of root nothing is kept by modes
    monkeypatch.delattr("regionik.pipeline.plan")
    assert run(["plan", "free", "-o", str(tmp_path / "plan.json")]) == 2
    assert "nothing can be written in that folder" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("command", "told"),
    [
        ("plan {0} -o {0}", "expected a file name ending in .json"),
        ("plan {0} --html {0}", "expected a file name ending in .html"),
        ("why {0} --html {0}", "expected a file name ending in .html"),
        ("reach {0} --csv {1} -o {1}", "is the file to read"),
        ("reach free --csv {1} -o {1}", "is the file to read"),
        ("field free --targets {2} -o {2}", "is the file to read"),
    ],
)
def test_what_is_read_is_not_written_over(
    command: str, told: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    texts = {
        "a.world.yaml": FREE.read_text("utf-8"), "a.csv": "x,y,z\n1,0,0.3\n", "a.npz": "x,y,z\n"
    }  # fmt: skip
    for name, text in texts.items():
        (tmp_path / name).write_text(text, "utf-8")
    assert run(command.format(*(tmp_path / name for name in texts)).split()) == 2
    assert told in capfd.readouterr().err
    assert {path.name: path.read_text("utf-8") for path in tmp_path.iterdir()} == texts


@pytest.mark.parametrize(
    ("end", "code", "words"),
    [
        (">/dev/full", 2, "No space left"),
        (">&-", 0, ""),
        ("2>/dev/full", 0, ""),
        ("<&- >&- 2>&-", 0, ""),
    ],
)
def test_streams_that_are_full_or_closed(end: str, code: int, words: str) -> None:
    command = f'"{sys.executable}" -m regionik worlds {end}'
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert (done.returncode, len(done.stderr.splitlines())) == (code, bool(words))
    assert words in done.stderr


def test_letters_that_the_terminal_does_not_know(tmp_path: Path) -> None:
    world = tmp_path / "frée.world.yaml"
    world.write_text(FREE.read_text("utf-8"), "utf-8")
    run = [sys.executable, "-m", "regionik", "reach", str(world), "--target", "9", "0", "0.3"]
    settings = {"PYTHONIOENCODING": "ascii", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = subprocess.run(run, capture_output=True, text=True, env={**os.environ, **settings}, check=False)
    assert done.returncode == 1, done.stderr
    assert "Traceback" not in done.stderr


@contextmanager
def shown() -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A live view in a process of its own, and its server's number."""
    run = [sys.executable, "-m", "regionik", "show", "--live", str(FREE), "--no-browser"]
    pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    with subprocess.Popen(run, text=True, **pipes) as process:  # type: ignore[call-overload]
        try:
            assert process.stderr is not None
            assert "set-points can be reached" in process.stderr.readline()
            children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
            yield process, int(children[0])
        finally:
            process.kill()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_the_viewers_server_ends_with_it(number: int, code: int) -> None:
    with shown() as (process, child_process):
        process.send_signal(number)
        assert process.wait(LONGEST) == code
        until = time.monotonic() + LONGEST
        while (
            Path(f"/proc/{child_process}/cmdline").exists()
            and Path(f"/proc/{child_process}/cmdline").read_bytes()
        ):
            assert time.monotonic() < until, "the server stayed"
            time.sleep(0.01)


def test_a_server_that_does_not_start_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer, "_EXIT_WITH_PARENT", "raise SystemExit(7)")
    with pytest.raises(EngineError, match="did not start"):
        viewer.start_server()


def _double(x: float) -> float:
    return 2.0 * x


def test_kernels_work_where_no_folder_can_be_written(monkeypatch: pytest.MonkeyPatch) -> None:
    def nowhere(self: object, function: object) -> None:
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.setattr(kernels._KernelCache, "__init__", nowhere)
    monkeypatch.setattr(kernels, "_at_once", False)
    kernels._warn_uncached.cache_clear()
    doubles = [kernels.compiled(_double) for _ in range(2)]
    assert [double(2.0) for double in doubles] == [4.0, 4.0]  # as plain Python, without a word
    with (
        pytest.warns(UserWarning, match="set NUMBA_CACHE_DIR") as warned,
        kernels.compiled_at_once(),
    ):
        assert [double(2.0) for double in doubles] == [4.0, 4.0]
    assert len(warned) == 1


def test_an_installation_that_is_read_only_works_without_a_home(tmp_path: Path) -> None:
    """All modules load and a world is planned where machine code can be kept nowhere.

    Of root nothing is kept by modes: a file stands where a folder for machine code would be made.
    """
    package = Path(regionik.__file__).parent
    copy = shutil.copytree(package, tmp_path / "regionik", ignore=shutil.ignore_patterns("__pycache__"))
    for folder in [copy, *(path for path in copy.rglob("*") if path.is_dir())]:
        (folder / "__pycache__").touch()
    code = (
        "import importlib, pkgutil, regionik\n"
        "for module in pkgutil.walk_packages(regionik.__path__, 'regionik.'):\n"
        "    importlib.import_module(module.name)\n"
        "found = regionik.plan(regionik.load_world('pillar'))\n"
        "print(regionik.__file__, regionik.verify(found).ok)\n"
    )
    outside = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    nowhere = {"HOME": os.devnull, "XDG_CACHE_HOME": os.devnull, "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=tmp_path,
        env={**outside, **nowhere, "PYTHONPATH": str(tmp_path), "NUMBA_DISABLE_JIT": "0"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [str(copy / "__init__.py"), "True"]
    assert "Warning" not in done.stderr, done.stderr


def test_kernels_work_where_the_disk_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(FunctionCache, "save_overload", full)
    monkeypatch.setattr(FunctionCache, "load_overload", full)
    with kernels.compiled_at_once():
        assert kernels.compiled(_double)(2.0) == 4.0


def test_margins_are_never_less_than_nothing_by_rounding() -> None:
    from regionik.cli.console import spare_text

    assert spare_text({"joints": -1e-17, "floor": -0.00004, "step": -0.5}, load_world("pillar")) == (
        "joints 0.0000 rad, floor 0.0000 m, step -0.5000 m of 0.25 m"
    )


def test_what_is_spare_stands_beside_what_was_asked_for_and_beyond_the_range_is_at_least_that() -> None:
    from regionik.cli.console import spare_text

    found = spare_text({"clearance": 0.3, "arm": 0.05, "self": 0.049}, load_world("pipe"))
    assert found == "clearance 0.3000 m over 0.1 m, arm at least 0.0500 m over 0.01 m, self 0.0490 m"


def test_a_run_that_ends_with_workers_at_work_says_nothing_of_what_is_freed_then() -> None:
    code = (
        "import os, time\n"
        "from regionik.executors import process_pool\n"
        "pool = process_pool(2)\n"
        "pool.submit(os.getpid).result()\n"
        "pool.submit(time.sleep, 60)\n"
        "os._exit(130)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "")
