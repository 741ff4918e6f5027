"""Long commands, ended at random moments: ``python -m tests.faults [TIMES] [--signal INT|TERM|KILL]``.

Each command runs undisturbed first. Then it is asked to end, again and again, and it is told how long that
took at most, and whatever is not as it should be: another exit code, more than one line, a file that is not
whole, a file or a process that stays. A command that is killed may leave what it was writing beside the file;
the next run has to remove it.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import secrets
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory
from typing import NamedTuple

MOST = 1.0  # from signal to end [s]
UP = 0.25  # an interpreter that is not up yet ends as all do: it is not asked before [s]
MARK = "REGIONIK_FAULTS"  # a variable by which all processes of a command are known
TABLE = "\n".join(["x,y,z", *(f"{0.01 * k - 3},{0.02 * k - 4},{0.1 + 0.001 * k}" for k in range(600))])

COMMANDS = {
    "plan": "plan depot -o out.json --html out.html",
    "plan on wheels": "plan circle -o out.json",
    "plan round a pipe": "plan pipe -o out.json",
    "plan between boards": "plan boards.world.yaml -o out.json",
    "plan of stops": "plan parked.world.yaml -o out.json",
    "verify": "verify made.json",
    "reach": "reach depot --csv targets.csv -o out.csv",
    "reach with workers": "reach depot --csv targets.csv -o out.csv --workers 2",
    "why": "why shelf --html out.html --target 2 0 3",
    "stops": "stops l_shape -o out.geojson --picture out.svg",
    "field": "field depot -o out.npz --cell 0.02",
    "compare": "compare l_shape -o out.json",
    "retime": "retime made.json -o out.json --base-speed 0.3 --joint-speed 0.5",
    "plot": "plot made.json -o out.svg",
    "export": "export made.json --format ros2 -o out.yaml",
    "show": "show made.json --no-browser",
}


class End(NamedTuple):
    """How a command ended."""

    code: int
    seconds: float
    err: str
    left: list[int]


def processes(mark: str) -> list[int]:
    """Processes that have the mark in what they were started with."""
    found = []
    for entry in Path("/proc").iterdir():
        with suppress(OSError, ValueError):
            if f"{MARK}={mark}".encode() in (entry / "environ").read_bytes().split(b"\0"):
                found.append(int(entry.name))
    return found


def ended(command: Sequence[str], folder: Path, after: float | None, number: int) -> End:
    """Run a command and send a signal after so many seconds, if any."""
    mark = secrets.token_hex(8)
    with subprocess.Popen(
        [sys.executable, "-m", "regionik", *command],
        cwd=folder,
        env={**os.environ, MARK: mark},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        began = time.monotonic()
        if after is not None:
            with suppress(subprocess.TimeoutExpired):
                process.wait(after)
            began = time.monotonic()
            process.send_signal(number)
        process.wait()
        seconds = time.monotonic() - began
        until = time.monotonic() + MOST
        while (left := processes(mark)) and time.monotonic() < until:
            time.sleep(0.01)
        for one in left:
            os.kill(one, signal.SIGKILL)
        assert process.stderr is not None
        return End(process.returncode, seconds, process.stderr.read(), left)


def faults(end: End, number: int, before: Mapping[str, bytes | None], folder: Path) -> Iterator[str]:
    """What is not as it should be after a command was asked to end; it may have been done by then."""
    killed = number == signal.SIGKILL
    if end.code not in (0, 1, -number if killed else 128 + number):
        yield f"exit code {end.code}: {end.err.strip()[-300:]}"
    if end.code == 128 + number and len(end.err.splitlines()) > 1:
        yield f"more than one line: {end.err[-600:]}"
    if end.seconds > MOST:
        yield f"it took {end.seconds:.2f} s"
    if end.left:
        yield f"{len(end.left)} processes stayed"
    for name, content in contents(folder).items():
        beside = name.endswith(".part") and killed
        if not (beside or name.endswith(".parts") or is_whole(name, content, before.get(name, content))):
            yield f"{name} is not whole"
        if name not in before and not beside and not name.endswith(".parts"):
            yield f"{name} stays"


def is_whole(name: str, content: bytes | None, expected: bytes | None) -> bool:
    """Whether a file is what it should be; one of speeds differs from run to run, and is a document still."""
    if content == expected or content is None or not name.endswith(".json"):
        return content == expected
    try:
        json.loads(content)
    except ValueError:
        return False
    return True


def contents(folder: Path) -> dict[str, bytes | None]:
    return {path.name: path.read_bytes() if path.is_file() else None for path in folder.iterdir()}


@contextmanager
def workplace() -> Iterator[Path]:
    """A folder with what the commands read."""
    from regionik.worlds.bundled import DATA

    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "targets.csv").write_text(TABLE)
        shelf, path = ((DATA / f"{name}.world.yaml").read_text("utf-8") for name in ("shelf", "l_shape"))
        (folder / "boards.world.yaml").write_text(shelf.replace("0.95, 0.37]", "0.95, 0.29]"), "utf-8")
        (folder / "parked.world.yaml").write_text(path.replace("rules: {", "rules: {mode: stops, "), "utf-8")
        run = [sys.executable, "-m", "regionik", "plan", "l_shape", "-o", "made.json"]
        subprocess.run(run, cwd=folder, check=True, capture_output=True)
        yield folder


def trial(name: str, times: int, number: int, folder: Path, moments: random.Random) -> bool:
    """Ask a command to end at random moments; whether all was as it should be."""
    command = COMMANDS[name].split()
    bare = set(contents(folder))
    began = time.monotonic()
    first = ended(command, folder, 6.0 if name == "show" else None, signal.SIGTERM)
    span = max(time.monotonic() - began, 2 * UP)
    whole = contents(folder)
    worst, sound = 0.0, first.code in (0, 1, 143)
    if not sound:
        print(f"{name}: undisturbed, exit code {first.code}: {first.err[-300:]}")
    for _ in range(times):
        for made in set(contents(folder)) - bare:
            if (folder / made).is_file() and not made.endswith(".part"):
                (folder / made).unlink()
        end = ended(command, folder, after := moments.uniform(UP, span), number)
        worst = max(worst, end.seconds)
        for fault in faults(end, number, whole, folder):
            sound = False
            print(f"{name}, asked after {after:.2f} s of {span:.2f} s: {fault}", flush=True)
    if number == signal.SIGKILL and name != "show":
        ended(command, folder, None, number)
        if contents(folder) != whole:
            sound = False
            print(f"{name}: a run after it was killed leaves {sorted(set(contents(folder)) ^ set(whole))}")
    for made in set(contents(folder)) - bare:
        rmtree(folder / made) if (folder / made).is_dir() else (folder / made).unlink()
    print(f"{name}: {times} times, {worst:.2f} s at most", flush=True)
    return sound


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("times", nargs="?", type=int, default=30)
    parser.add_argument("--signal", choices=("INT", "TERM", "KILL"), default="INT")
    parser.add_argument("--only", choices=tuple(COMMANDS))
    asked = parser.parse_args()
    number = signal.Signals[f"SIG{asked.signal}"]
    moments = random.Random(0)
    with workplace() as folder:
        names = COMMANDS if asked.only is None else [asked.only]
        sound = [trial(name, asked.times, number, folder, moments) for name in names]
        return int(not all(sound))


if __name__ == "__main__":
    sys.exit(main())
