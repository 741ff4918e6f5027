"""Readers fed with broken files, in a process with bounded time and memory.

Run: python -m tests.fuzz [seconds [kind...]]. First files made to do harm, then random ones for so many
seconds a kind. Exits 1, and keeps the files, where a reader does anything but read or refuse in one line.
"""

from __future__ import annotations

import resource
import shutil
import sys
import sysconfig
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from os import sysconf
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from time import monotonic
from typing import Any

import numpy as np

from regionik.output.plan_file import load_plan
from regionik.output.urdf import robot_to_urdf
from regionik.storage.files import open_partial
from regionik.worlds.documents.world_file import load_world, world_to_document
from regionik.worlds.errors import InputError
from regionik.worlds.readers.csv_path import CsvFormat, index_csv, read_csv
from regionik.worlds.readers.gcode import read_gcode
from regionik.worlds.readers.occupancy_map import load_map
from regionik.worlds.urdf.loader import load_robot
from tests.hostile import KINDS, MANIFEST, READ, Files, bombs, mutated, samples, write

LONGEST = 10.0  # of the processor; a machine with more to do gives it less at a time [s]
PATIENCE = 6  # times as long on the clock
MEMORY = 2**30  # beyond what the program itself takes [bytes]
FORBIDDEN = (
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "subprocess.Popen",
    "socket.connect",
    "pickle.find_class",
)
ROOT = Path(__file__).resolve().parent.parent
OWN = (
    str(ROOT),
    sysconfig.get_path("purelib"),
    sysconfig.get_path("stdlib"),
    sys.prefix,
    sys.base_prefix,
    "/proc",
)


def read(kind: str, path: Path) -> None:
    """Read a file of a kind, and do what is done with everything read of that kind."""
    match kind:
        case "world" | "frames" | "execution" | "scan":
            world = load_world(path)
            world_to_document(world)
            robot_to_urdf(world.robot, world.floor.polygon)
        case "plan":
            load_plan(path)
        case "csv":
            read_csv(path)
            table = index_csv(path, 1000)
            for k in range(min(len(table), 3)):
                table.block(k).path()
        case "columns":
            titles = {"x": "X (mm)", "y": "Y (mm)", "z": "Z"} | {key: key for key in ("qx", "qy", "qz", "qw")}
            read_csv(path, CsvFormat(titles, "semicolon"))
        case "gcode":
            read_gcode(path, 1e-4)
        case "urdf":
            robot = load_robot(path, tip="tool")
            robot.tool(np.zeros(3), robot.carry)
        case "srdf":
            read("urdf", path.with_suffix(".urdf"))
        case "parts":
            with open_partial(path.parent.with_suffix(""), MANIFEST):
                pass
        case _:
            load_map(path, 1.0)


def judged(kind: str, folder: Path, opened: list[str]) -> str:
    """What a reader makes of a case: "read", "refused", or what is wrong."""
    opened.clear()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", UserWarning)  # what a reader has to say of a robot
            read(kind, folder / READ[kind])
        verdict = "read"
    except InputError as refused:
        text = str(refused)
        verdict = (
            "refused" if "\n" not in text and 0 < len(text) < 2000 else f"a message of {len(text)} characters"
        )
    except Exception as error:  # the very thing that is looked for
        last = traceback.extract_tb(error.__traceback__)[-1]
        ours = [
            step for step in traceback.extract_tb(error.__traceback__) if step.filename.startswith(str(ROOT))
        ]
        place = f"{Path(ours[-1].filename).name}:{ours[-1].lineno}" if ours else ""
        verdict = f"{type(error).__name__} in {place} {last.name}: {str(error)[:150]}"
    named = b"".join(file.read_bytes() for file in folder.glob("*.*") if file.is_file()).decode(
        "utf-8", "replace"
    )
    for name in opened:
        if name in FORBIDDEN:
            return f"does {name}"
        if not name.startswith((str(folder), *OWN)) and name not in named:
            return f"opens {name}"
    return verdict


def child(pipe: Connection) -> None:
    """Judge cases as they are named."""
    opened: list[str] = []

    def listen(event: str, given: tuple[Any, ...]) -> None:
        if event == "open" and isinstance(given[0], str):
            opened.append(given[0])
        elif event in FORBIDDEN:
            opened.append(event)

    for kind in KINDS:  # with all that is imported on demand
        with TemporaryDirectory() as folder:
            write(samples(kind)[-1], Path(folder))
            read(kind, Path(folder) / READ[kind])
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    sys.addaudithook(listen)
    pipe.send("ready")
    while True:
        kind, folder_name = pipe.recv()
        pipe.send(judged(kind, Path(folder_name), opened))


@dataclass
class Reader:
    """A process that reads, made anew when it died."""

    process: Any = None
    pipe: Any = None

    def ask(self, kind: str, folder: Path) -> str:
        if self.process is None:
            context = get_context("spawn")
            self.pipe, theirs = context.Pipe()
            self.process = context.Process(target=child, args=(theirs,), daemon=True)
            self.process.start()
            theirs.close()
            self.pipe.recv()
        self.pipe.send((kind, str(folder)))
        begun, ends = self.used(), monotonic() + PATIENCE * LONGEST
        try:
            while self.used() - begun < LONGEST and monotonic() < ends:
                if self.pipe.poll(1.0):
                    return str(self.pipe.recv())
            self.stop()
            return f"hangs for more than {LONGEST:g} s"
        except EOFError:
            code = self.process.exitcode
            self.stop()
            return f"dies with exit code {code}"

    def used(self) -> float:
        """Time of the processor that the process has had [s]."""
        words = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(words[11]) + int(words[12])) / sysconf("SC_CLK_TCK")

    def stop(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.join()
            self.process = None


def cases(kind: str, seconds: float, seed: int) -> Iterator[tuple[str, Files]]:
    """Names and files: those made to do harm, then random ones until the time is over."""
    yield from bombs(kind).items()
    good, ends, n = samples(kind), monotonic() + seconds, 0
    while monotonic() < ends:
        rng = np.random.default_rng([seed, n])
        files = dict(good[n % len(good)])
        for name in rng.permutation(sorted(files))[: rng.integers(1, len(files) + 1)]:
            files[name] = mutated(files[name], rng)
        yield f"random {seed} {n}", files
        n += 1


def main() -> int:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    reader, wrong = Reader(), 0
    for kind in sys.argv[2:] or KINDS:
        seen = Counter[str]()
        for name, files in cases(kind, seconds, KINDS.index(kind)):
            folder = Path(mkdtemp())
            write(files, folder)
            verdict = reader.ask(kind, folder)
            known = verdict in ("read", "refused") or verdict in seen
            seen[verdict] += 1
            if verdict not in ("read", "refused"):
                wrong += 1
            if known:
                shutil.rmtree(folder)
            else:
                print(f"{kind}: {name}: {verdict} ({folder})", flush=True)
        print(f"{kind}: {seen.total()} cases, {seen['read']} read, {seen['refused']} refused", flush=True)
    reader.stop()
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
