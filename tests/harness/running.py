"""Worlds of the table run on a tree of the repository, in a process that has that tree on its path."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from regionik.worlds.errors import InputError
from tests.harness.worlds import WORLDS, document_of

LONGEST = 120.0  # of a world: its plan, verification and timing [processor s]
MEASURE = Path(__file__).parent / "measure.py"
DIGITS = 6  # after the point, by which world files are compared
GIVEN_UP, CRASHED = "given up", "crashed"
Row = dict[str, Any]


def run(tree: Path, names: Sequence[str], longest: float = LONGEST) -> Iterator[tuple[str, Row]]:
    """Yield name and figures of each world as soon as they are known.

    The figure ``world`` is a digest of the world file: rows of other files are not to be compared.
    """
    if not (tree / "regionik" / "__init__.py").is_file():
        raise InputError(f"{tree}: expected a checkout of the repository")
    with TemporaryDirectory() as folder:
        files = {name: _written(name, Path(folder)) for name in names}
        left = list(names)
        while left:
            for name, row in _measured(tree.resolve(), Path(folder), tuple(left), longest):
                left.remove(name)
                yield name, row | {"world": files[name]}


def _written(name: str, folder: Path) -> str:
    """Write the file of a world; return its digest, which leaves out what another processor may round."""
    text = json.dumps(document_of(WORLDS[name]()))
    (folder / f"{name}.json").write_text(text, "utf-8")
    rounded = json.loads(text, parse_float=lambda number: round(float(number), DIGITS) + 0.0)
    return hashlib.sha256(json.dumps(rounded).encode()).hexdigest()[:16]


def _measured(tree: Path, folder: Path, names: tuple[str, ...], longest: float) -> Iterator[tuple[str, Row]]:
    """Yield rows until the process ends; the world at which it ended too early is given up."""
    command = [sys.executable, "-P", "-X", "faulthandler", str(MEASURE), str(folder), str(longest), *names]
    environment = {**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"}
    left = list(names)
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment, cwd=tree) as child:
        assert child.stdout is not None
        used = Path(json.loads(child.stdout.readline() or '{"tree": "none"}')["tree"])
        if used != tree:
            raise InputError(f"{tree}: expected its own regionik to be imported, not that of {used}")
        for line in child.stdout:
            row = json.loads(line)
            left.remove(row["name"])
            yield row.pop("name"), row
    if child.returncode in (-signal.SIGINT, -signal.SIGTERM):
        raise InputError(f"{tree}: the run was ended by a signal")
    if left:
        overtime = child.returncode == -signal.SIGPROF
        yield left[0], {"verdict": GIVEN_UP if overtime else CRASHED, "exit_code": child.returncode}
