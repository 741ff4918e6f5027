"""The commands: exit codes, what stands on stdout, what is left on disk."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from regionik import __version__
from regionik.cli import console
from regionik.cli.app import run as run_command
from regionik.cli.options import COMMANDS
from regionik.storage.plan_document import stored_figures
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.errors import EngineError
from tests.nasty import NASTY, Nasty

HEAVY = (
    "fcl",
    "matplotlib",
    "meshcat",
    "numba",
    "numpy",
    "ompl",
    "pydantic_core",
    "rich",
    "scipy",
    "shapely",
    "yaml",
)
HANGS = 300.0  # a command that has not ended by then is taken for one that hangs [s]
LIGHT = ("pydantic_core", "rich")  # typer itself may bring these


class Outcome(NamedTuple):
    """What a command left behind."""

    code: int
    out: str
    err: str


Run = Callable[..., Outcome]


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str]) -> Run:
    """Run a command in this process."""

    def run(*arguments: object) -> Outcome:
        capfd.readouterr()
        code = run_command([str(argument) for argument in arguments])
        return Outcome(code, *capfd.readouterr())

    return run


@contextmanager
def spawned(*arguments: object, **options: Any) -> Iterator[subprocess.Popen[str]]:
    """Run a command in a process of its own, which does not outlive the test."""
    command = [sys.executable, "-m", "regionik", *map(str, arguments)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options}
    with subprocess.Popen(command, **pipes) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plan of ``pillar``, made once."""
    path = tmp_path_factory.mktemp("planned") / "plan.json"
    assert run_command(["plan", "pillar", "-o", str(path)]) == 0
    return path


# Worlds to which the answer is no -----------------------------------------------------------------------

SLAB = "  - {name: divider, box: {size: [0.1, 4.0, 1.0], center: [1.5, 0, 0.5]}}"
WORLD = """
version: 1
robot: youbot
floor: {{polygon: [[-1, -2], [4, -2], [4, 2], [-1, 2]]}}
obstacles:
{obstacles}
start: {{base: {start}, joints: [0, 1.5708, 0, 1.5708, 0]}}
task:
  - {{points: {points}}}
rules: {{clearance: 0.2}}
"""


class No(NamedTuple):
    """A world, and what the paragraph about it must name."""

    verdict: str
    setpoint: int | None
    words: Sequence[str]
    points: object
    start: object = (0.0, 0.0, 0.0)


NOES = [
    No("unreachable", 1, ["set-point 2 of 3", " m"], [[0.5, 0, 0.3], [0.6, 0, 2.0], [0.7, 0, 0.3]]),
    No(
        "ladder-broken",
        2,
        ["3 of 3", "divider", " m"],
        [[0.5, 0, 0.3], [0.6, 0, 0.3], [2.6, 0, 0.3]],
    ),
    No("start-blocked", None, ["divider", " m"], [[0.5, 0, 0.3], [0.6, 0, 0.3]], (1.5, 0.0, 0.0)),
]


@pytest.fixture(params=NOES, ids=lambda no: no.verdict)
def no(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[No, Path]:
    what: No = request.param
    path = tmp_path / "no.yaml"
    text = WORLD.format(obstacles=SLAB, start=list(map(float, what.start)), points=what.points)  # type: ignore[call-overload]
    path.write_text(text)
    return what, path


def test_no_is_one_paragraph_on_stderr_and_json(run: Run, no: tuple[No, Path], tmp_path: Path) -> None:
    what, world = no
    done = run("plan", world, "-o", tmp_path / "plan.json", "--html", tmp_path / "plan.html", "--json")
    assert done.code == 1
    assert len(done.err.strip().splitlines()) == 1
    assert all(word in done.err.replace("Set-point", "set-point") for word in what.words), done.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["no.yaml"]
    document = json.loads(done.out)
    told = {"ok", "verdict", "setpoint", "code", "reason", "causes", "repairs", "failures"}
    assert set(document) == told
    assert document["ok"] is False
    assert (document["verdict"], document["setpoint"]) == (what.verdict, what.setpoint)
    assert document["reason"] in done.err
    assert all(set(cause) == {"kind", "name", "margin"} for cause in document["causes"])
    fields = {"kind", "name", "amount", "unit", "vector", "text", "also"}
    assert all(set(repair) == fields for repair in document["repairs"])
    assert document["causes"]


# What a user did wrong ----------------------------------------------------------------------------------

WRONG: list[tuple[Sequence[str], str]] = [
    (["plam"], "plan"),
    (["plan"], "WORLD"),
    (["plan", "pillar", "--speed", "9"], "--speed"),
    (["plan", "pillar", "--seed", "red"], "--seed"),
    (["plan", "pillar", "--seed", "-1"], "--seed"),
    (["plan", "pilar"], "did you mean 'pillar'?"),
    (["plan", "pillar", "--sed", "1"], "regionik plan --help"),
    (["plan", "pillar", "-o", "plan.txt"], "ending in .json"),
    (["plan", "pillar", "--html", "pillar"], "ending in .html"),
    (["why", "pillar", "--html", "pillar"], "ending in .html"),
    (["retime", "plan.json", "-o", "timed"], "ending in .json"),
    (["reach", "pillar", "--target", "1", "2", "3", "4"], "six with a tool axis"),
    (["reach", "pillar", "--target", "1", "2", "3", "0", "0", "0"], "direction"),
    (["plan", "nowhere.yaml"], "nowhere.yaml"),
    (["plan", "pillar", "-o", "no/such/folder/plan.json"], "no/such/folder"),
    (["plan", "pillar", "-o", "."], "folder"),
    (["plan", "pillar", "-o", "a.json", "--html", "./a.json"], "ending in .html"),
    (["reach", "pillar", "--target", "1", "2"], "three finite numbers"),
    (["reach", "pillar", "--target", "1", "2", "nan"], "three finite numbers"),
    (["reach", "pillar", "--target", "1", "2", "--json"], "three finite numbers"),
    (["reach", "pillar", "--csv", "nowhere.csv"], "nowhere.csv"),
    (["reach", "pillar", "-o", "answers.txt"], ".geojson"),
    (["verify", "nowhere.json"], "nowhere.json"),
    (["show", "nowhere.json"], "nowhere.json"),
    (["export", "nowhere.json", "--format", "csv", "-o", "x.csv"], "nowhere.json"),
    (["export", "nowhere.json", "--format", "ros1", "-o", "x.yaml"], "csv, ros2, joint-trajectory, path"),
    (["export", "nowhere.json", "--format", "csv"], "--output"),
    (["export", "nowhere.json", "--format", "ros2", "-o", "x.bag"], "ending in .yaml, .yml, .json"),
    (["export", "nowhere.json", "--format", "csv", "-o", "x.csv", "--rate", "0"], "rate: expected a number"),
    (["export", "nowhere.json", "--format", "urdf", "-o", "x", "--rate", "9"], "urdf is not sampled"),
    (["export", "nowhere.json", "--format", "csv", "-o", "x.csv", "--frame", "map"], "csv has none"),
    (["plot", "nowhere.json", "-o", "x.pdf"], "ending in .svg, .png"),
    (["plot", "nowhere.json", "-o", "x.svg"], "nowhere.json"),
]


@pytest.mark.parametrize(("arguments", "word"), WRONG, ids=lambda value: str(value)[:40])
def test_wrong_input_is_one_line(
    run: Run, arguments: Sequence[str], word: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = run(*arguments)
    assert done.code == 2
    assert done.out == ""
    assert len(done.err.splitlines()) == 1
    assert word in done.err
    assert not list(tmp_path.iterdir())


def test_plan_and_page_are_two_files(run: Run, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.symlink_to(tmp_path / "plan.json")
    done = run("plan", "pillar", "-o", tmp_path / "plan.json", "--html", page)
    assert done.code == 2
    assert "two different files" in done.err


def test_a_plan_is_told_from_a_world(run: Run, planned: Path, tmp_path: Path) -> None:
    done = run("plan", planned)
    assert (done.code, done.out) == (2, "")
    assert f"this is a plan: regionik show {planned} shows it" in done.err
    world = tmp_path / "world.json"
    world.write_text('{"version": 1, "robot": "youbot"}')
    assert "this is a world: regionik plan" in run("verify", world).err


def test_a_target_has_a_direction_or_an_orientation(run: Run) -> None:
    asked = ["reach", "free", "--json"]
    free = run(*asked, "--target", 0.5, 0, 0.3)
    down = run(*asked, "--target", 0.5, 0, 0.3, 1, 0, 0, "--target", 0.5, 0, 0.3)
    assert (free.code, down.code) == (0, 0), down.err
    first, second = json.loads(down.out)["answers"]
    assert second == json.loads(free.out)["answers"][0]
    assert first["joints"] != second["joints"]
    assert run(*asked, "--target", 0.5, 0, 0.3, 0, 0, 0, 2).code == 2


def test_warm_up_says_what_it_does(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("regionik.worlds.bundled.world_names", lambda: ("free",))
    done = run("warm-up")
    assert (done.code, done.out) == (0, "")
    first, last = done.err.splitlines()
    assert first.startswith("1 of 1: free, ")
    assert last.startswith("kept in ")
    monkeypatch.setattr("regionik.planners.kernels.cache_folder", lambda: None)
    done = run("warm-up")
    assert done.code == 2
    assert "NUMBA_CACHE_DIR" in done.err


def test_shells_complete_words() -> None:
    words = {"_REGIONIK_COMPLETE": "complete_bash", "COMP_WORDS": "regionik plan pil", "COMP_CWORD": "2"}
    command = [sys.executable, "-c", "from regionik.cli.app import run_process; run_process()"]
    done = subprocess.run(command, env={**os.environ, **words}, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["pillar"]


@pytest.mark.parametrize("nasty", NASTY, ids=lambda nasty: nasty.name)
def test_broken_world_file_is_one_line(run: Run, nasty: Nasty, tmp_path: Path) -> None:
    world = tmp_path / f"world{nasty.suffix}"
    world.write_text(nasty.text)
    for command in (
        ["plan", world, "-o", tmp_path / "plan.json", "--json"],
        ["reach", world],
        ["show", world],
    ):
        done = run(*command)
        assert (done.code, done.out, len(done.err.splitlines())) == (2, "", 1), done.err
        assert all(words in done.err for words in nasty.expected), done.err
    assert list(tmp_path.iterdir()) == [world]


@pytest.mark.parametrize("content", ["", "{", "[]", "{}", '{"version": 1}', "[" * 5000, "\x00", "nan"])
def test_wrong_plan_file_is_one_line(run: Run, content: str, tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text(content)
    for arguments in (["verify", path], ["show", path], ["export", path, "--format", "csv", "-o", "x.csv"]):
        done = run(*arguments)
        assert (done.code, done.out, len(done.err.splitlines())) == (2, "", 1), done.err
        assert "plan.json" in done.err


def test_wrong_csv_names_the_line(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "targets.csv"
    path.write_text("x,y,z\n1,2,0.3\n1,high,0.3\n")
    done = run("reach", "free", "--csv", path)
    assert done.code == 2
    assert f"{path}: line 3: y" in done.err


# Plan, verify, export -----------------------------------------------------------------------------------


def test_plan_as_json_and_files(run: Run, tmp_path: Path) -> None:
    path, page = tmp_path / "plan.json", tmp_path / "plan.html"
    done = run("plan", "free", "-o", path, "--html", page, "--json")
    assert done.code == 0, done.err
    document = json.loads(done.out)
    plan = json.loads(path.read_bytes())
    assert document["ok"] is True
    assert stored_figures(document["stats"]) == plan["stats"]
    assert document["setpoints"] == len(plan["setpoints"]) == 21
    assert document["files"] == [str(path), str(page)]
    assert page.read_text().lstrip().lower().startswith("<!doctype html>")
    for word in (
        "21 set-points",
        "M-FABRIK met them to 1 mm in 70 iterations",
        "lift-offs",
        "base travel",
        "verified in",
    ):
        assert word in done.err
    assert sorted(file.name for file in tmp_path.iterdir()) == ["plan.html", "plan.json"]


def test_a_plan_without_smoothing_is_told_by_its_own_figures(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    done = run("plan", "pillar", "--no-smooth", "-o", path, "--json")
    assert done.code == 0, done.err
    stats = json.loads(done.out)["stats"]
    assert f"15 set-points within {1000 * stats['largest_error']:.3f} mm\n" in done.err
    assert f"M-FABRIK met them to 1 mm in {stats['iterations']} iterations" in done.err
    assert json.loads(path.read_bytes())["world"]["rules"]["smooth"] is False
    assert run("verify", path, "--world", "pillar").code == 0


def test_plan_without_files_writes_none(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = run("plan", "free")
    assert (done.code, done.out) == (0, "")
    assert not list(tmp_path.iterdir())


def test_verify_yes(run: Run, planned: Path) -> None:
    assert run("verify", planned).code == 0
    document = json.loads(run("verify", planned, "--json").out)
    assert document["ok"] is True
    assert document["violations"] == []
    assert all(margin is None or margin >= 0 for margin in document["margins"].values())


def test_verify_no(run: Run, planned: Path, tmp_path: Path) -> None:
    document = json.loads(planned.read_bytes())
    middle = document["states"][len(document["states"]) // 2]
    middle["base"][0] += 5.0
    path = tmp_path / "moved.json"
    path.write_text(json.dumps(document))
    done = run("verify", path)
    assert (done.code, done.out) == (1, "")
    assert "does not hold" in done.err
    done = run("verify", path, "--json")
    assert done.code == 1
    answer = json.loads(done.out)
    assert (answer["ok"], answer["verdict"]) == (False, "plan-invalid")
    assert answer["violations"]
    assert answer["violations"][0]["text"] in answer["reason"]


@pytest.mark.parametrize(
    ("kind", "name", "start"),
    [
        ("csv", "plan.csv", "index,"),
        ("path", "path.yaml", "header:"),
        ("path", "path.json", "{"),
        ("geojson", "plan.geojson", "{"),
        ("urdf", "exported", "<?xml"),
    ],
)
def test_export(run: Run, kind: str, name: str, start: str, planned: Path, tmp_path: Path) -> None:
    done = run("export", planned, "--format", kind, "-o", tmp_path / name)
    assert (done.code, done.out) == (0, "")
    assert (tmp_path / name).read_text().startswith(start)


@pytest.mark.parametrize("name", ["plan.svg", "PLAN.PNG"])
def test_plot(run: Run, name: str, planned: Path, tmp_path: Path) -> None:
    done = run("plot", planned, "-o", tmp_path / name)
    assert (done.code, done.out) == (0, "")
    starts = {".svg": b"<?xml", ".png": b"\x89PNG"}
    assert (tmp_path / name).read_bytes().startswith(starts[Path(name).suffix.lower()])


def test_same_seed_same_bytes_in_two_processes(planned: Path, tmp_path: Path) -> None:
    """Sets of names have another order in each: the hashes that order them are salted."""
    salt = "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"
    environment = {**os.environ, "PYTHONHASHSEED": salt}
    with spawned("plan", "pillar", "-o", tmp_path / "plan.json", env=environment) as process:
        _, err = process.communicate(timeout=HANGS)
        assert process.returncode == 0, err
    assert (tmp_path / "plan.json").read_bytes() == planned.read_bytes()


# Reach --------------------------------------------------------------------------------------------------


def test_reach_mixes_yes_and_no(run: Run, tmp_path: Path) -> None:
    table, path = tmp_path / "targets.csv", tmp_path / "answers.csv"
    table.write_text("x,y,z\n0.6,-0.2,0.3\n")
    done = run("reach", "free", "--target", 0.5, "-0.1", 0.3, "--target", 0, 0, 3, "--csv", table, "-o", path)
    assert (done.code, done.out) == (1, "")
    assert "2 of 3 targets" in done.err
    rows = list(csv.DictReader(io.StringIO(path.read_text())))
    joints = [name for name in rows[0] if name not in ("name", "x", "y", "z", "verdict", "code", "reason")]
    assert [row["verdict"] for row in rows] == ["reachable", "unreachable", "reachable"]
    assert list(rows[0]) == ["name", "x", "y", "z", "verdict", "code", *joints, "reason"]
    assert joints[:3] == ["base_x", "base_y", "base_yaw"]
    assert len(joints) == 8
    assert [float(row["x"]) for row in rows] == [0.5, 0.0, 0.6]
    assert [bool(row["reason"]) for row in rows] == [False, True, False]
    assert [bool(row["base_x"]) for row in rows] == [True, False, True]


def test_reach_as_json(run: Run) -> None:
    done = run("reach", "free", "--target", 0, 0, 3, "--json")
    assert done.code == 1
    document = json.loads(done.out)
    told = {"ok", "verdict", "setpoint", "code", "reason", "causes", "repairs", "answers"}
    assert set(document) == told
    assert (document["ok"], document["verdict"], document["setpoint"]) == (False, "unreachable", 0)
    assert document["answers"][0]["base"] is None


def test_reach_asks_for_the_worlds_own_task(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "answers.geojson"
    done = run("reach", "free", "--json", "-o", path)
    assert done.code == 0, done.err
    document = json.loads(done.out)
    assert document["ok"] is True
    features = json.loads(path.read_bytes())["features"]
    assert len(features) == len(document["answers"]) == 21
    for feature, answer in zip(features, document["answers"], strict=True):
        assert feature["geometry"]["coordinates"] == [answer["x"], answer["y"]]
        assert feature["properties"]["base_x"] == answer["base"][0]


def test_reach_prints_a_table(run: Run) -> None:
    done = run("reach", "free", "--target", 0.5, 0, 0.3)
    assert done.code == 0
    assert "verdict" in done.out
    assert "reachable" in done.out


# The frame around the commands --------------------------------------------------------------------------


def test_worlds_are_one_line_each(run: Run) -> None:
    done = run("worlds")
    assert done.code == 0
    names = [line.split()[0] for line in done.out.splitlines()]
    assert {"depot", "free", "l_shape", "pillar", "slab", "wall"} <= set(names)
    assert all(len(line.split()) > 2 for line in done.out.splitlines())
    assert [world["name"] for world in json.loads(run("worlds", "--json").out)["worlds"]] == names


def test_version_and_help(run: Run) -> None:
    for option in ("--version", "-V"):
        assert run(option).out == f"regionik {__version__}\n"
    for arguments in ([], ["--help"], ["-h"]):
        done = run(*arguments)
        assert done.code == 0
        assert all(
            name in done.out for name in ("worlds", "plan", "reach", "verify", "show", "export", "plot")
        )


def test_help_imports_nothing_heavy() -> None:
    code = "import sys, regionik, regionik.cli.app; print(*{name.partition('.')[0] for name in sys.modules})"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert not set(loaded.split()) & (set(HEAVY) - set(LIGHT))


def test_functions_win_over_modules_of_the_same_name() -> None:
    code = (
        "import regionik.reachability.reach, regionik.values, regionik as rik\n"
        "from regionik.values import Plan\n"
        "assert rik.Plan is Plan\n"
        "assert all(map(callable, (rik.plan, rik.plot, rik.reach, rik.verify)))\n"
        "assert all(getattr(rik, name) is not None for name in rik.__all__)\n"
        "assert set(rik.__all__) <= set(dir(rik))\n"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("error", "code"), [(KeyboardInterrupt(), 130), (EngineError("engine: it broke"), 3)]
)
def test_what_stops_a_plan(
    run: Run, error: BaseException, code: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("regionik.pipeline.plan", stop)
    done = run("plan", "free", "-o", tmp_path / "plan.json")
    assert (done.code, done.out) == (code, "")
    assert len(done.err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_ctrl_c_leaves_nothing(tmp_path: Path) -> None:
    with spawned("plan", "depot", "-o", "plan.json", "--html", "plan.html", cwd=tmp_path) as process:
        while "libgeos" not in Path(f"/proc/{process.pid}/maps").read_text():  # it is at work then
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=HANGS)
        assert process.returncode == 130
    assert out == ""
    assert "Traceback" not in err
    assert len(err.splitlines()) == 1
    # Imports come before there is anything to say of.
    assert re.fullmatch(r"regionik: interrupted(( at [^:]+)?: nothing is written)?\n", err)
    assert not list(tmp_path.iterdir())


def test_ctrl_c_says_where_it_was_and_what_holds(capfd: pytest.CaptureFixture[str]) -> None:
    said = """
import os, signal, time
from regionik.cli import console, interrupts
from regionik.planners.progress import track
interrupts.install_handlers()
with console.DelayedProgress() as progress:
    for k in track("areas", range(7)): pass
    for k in track("repairs", range(5)):
        if k == 1: progress.say("It is too far.")
        if k == 2: os.kill(os.getpid(), signal.SIGINT); time.sleep(5)
"""
    subprocess.run([sys.executable, "-c", said], check=False, timeout=30)
    first, second = capfd.readouterr().err.splitlines()[:2]
    assert first == "It is too far."
    assert second == "regionik: interrupted at repairs 2 of 5: what is said above holds"


def test_show_ends_with_ctrl_c(planned: Path) -> None:
    with spawned("show", "--no-browser", planned) as process:
        assert process.stderr is not None
        first = process.stderr.readline()
        assert "Ctrl-C" in first
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=HANGS)
        assert process.returncode == 0
    assert "http://" in out
    assert err == ""


def test_a_watched_file_is_shown_until_ctrl_c(tmp_path: Path) -> None:
    document = Path(__file__).parent.parent / "worlds" / "data" / "l_shape.world.yaml"
    (tmp_path / "hall.yaml").write_text(document.read_text())
    with spawned("show", "--live", "--no-browser", tmp_path / "hall.yaml") as process:
        assert process.stderr is not None
        assert "All 40 set-points can be reached" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=HANGS)
        assert process.returncode == 0
    assert err == ""


def test_other_signals_and_errors_that_nobody_catches_end_nothing() -> None:
    said = """
import os, signal, time
from regionik.cli.interrupts import CLEANUP_TIME, install_handlers
class Faulty:
    def __del__(self): raise ValueError("told")
class Interrupted:
    def __del__(self): raise KeyboardInterrupt
install_handlers()
signal.signal(signal.SIGUSR1, lambda *_: None)
os.kill(os.getpid(), signal.SIGUSR1)
Faulty(), Interrupted()
time.sleep(CLEANUP_TIME + 0.2)
print("still at work")
"""
    done = subprocess.run(
        [sys.executable, "-c", said], capture_output=True, text=True, timeout=30, check=True
    )
    assert done.stdout == "still at work\n"
    assert "ValueError: told" in done.stderr
    assert "KeyboardInterrupt" not in done.stderr


def test_a_reader_that_leaves_is_no_error() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with spawned("worlds", stdout=writing) as process:
        os.close(writing)
        _, err = process.communicate(timeout=HANGS)
        assert process.returncode == 0
    assert err == ""


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("patience", "terminal", "shows"), [(0.0, True, True), (60.0, True, False), (0.0, False, False)]
)
def test_progress_shows_late_and_only_on_a_terminal(
    patience: float, terminal: bool, shows: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = _Terminal() if terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(console, "COMMANDS", replace(COMMANDS, progress_delay=patience))
    monkeypatch.setenv("TERM", "xterm")
    with console.DelayedProgress() as progress:
        if progress._timer is not None and shows:
            progress._timer.join()
        for k in range(4):
            progress("areas", k, 3)
    assert ("areas" in screen.getvalue()) is shows


@pytest.mark.parametrize("quiet", ["", "1"])
def test_logs_have_a_line_now_and_then(quiet: str, monkeypatch: pytest.MonkeyPatch) -> None:
    lines, told = list[str](), threading.Event()

    def write(text: str) -> None:
        lines.append(text)
        if text.endswith(" s: plan, areas 1 of 3"):
            told.set()

    monkeypatch.setattr(sys, "stderr", io.StringIO())
    monkeypatch.setenv("REGIONIK_QUIET", quiet)
    monkeypatch.setattr(console, "COMMANDS", replace(COMMANDS, line_interval=1e-3))
    monkeypatch.setattr(console, "print_message", write)
    with console.DelayedProgress("plan") as progress:
        progress("areas", 1, 3)
        assert quiet or told.wait(HANGS)
    assert bool(lines) is not bool(quiet)


LINE = "version: 1\nrobot: youbot\nfloor: {polygon: [[-1, -1], [2, -1], [2, 1], [-1, 1]]}\n"


def test_names_that_the_locale_does_not_know_reach_files_as_text(tmp_path: Path) -> None:
    """The locale C reads names as ASCII: those of files are its own, what is written is UTF-8."""
    corners, faces = ("1.5 0 0", "1.6 0 0", "1.5 0.1 0", "1.5 0 0.1"), ("1 3 2", "1 2 4", "1 4 3", "2 3 4")
    solid = [*(f"v {corner}" for corner in corners), *(f"f {face}" for face in faces)]
    (tmp_path / "tïsch.obj").write_text("\n".join(solid))
    (tmp_path / "weg ä.csv").write_text("0.3,0,0.3\n0.5,0,0.3\n")
    document = LINE + "about: Prüfung 日本\nobstacles: [{name: tïsch, mesh: {file: tïsch.obj}}]\n"
    (tmp_path / "wörld 1.yaml").write_text(f"{document}task: [{{csv: weg ä.csv}}]\n", encoding="utf-8")
    there = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONPATH": str(Path(__file__).parents[1])}

    def done(*arguments: str) -> subprocess.CompletedProcess[bytes]:
        command = [sys.executable, "-m", "regionik", *arguments]
        return subprocess.run(command, cwd=tmp_path, env=there, capture_output=True, check=False)

    made = done("plan", "wörld 1.yaml", "-o", "plän.json", "--html", "p.html", "--json")
    assert made.returncode == 0, made.stderr
    assert json.loads(made.stdout)["files"] == ["plän.json", "p.html"]
    assert json.loads((tmp_path / "plän.json").read_text(encoding="utf-8"))["world"]["name"] == "wörld 1"
    assert "<title>wörld 1" in (tmp_path / "p.html").read_text(encoding="utf-8")
    assert (
        done("export", "plän.json", "--format", "path", "--frame", "kärte", "-o", "path.yaml").returncode == 0
    )
    assert "kärte" in (tmp_path / "path.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", [b"w\xf6rld", b"two\nlines", b"a" * 240], ids=["latin", "lines", "long"])
def test_a_world_is_named_by_one_line_whatever_its_file_is_called(name: bytes, tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(name + b".yaml")
    path.write_text(f"{LINE}task: [{{points: [[0.3, 0, 0.3]]}}]\n", encoding="utf-8")
    document = world_to_document(load_world(path))
    assert world_from_document(json.loads(json.dumps(document))).name == document["name"]
    assert document["name"].isprintable()
