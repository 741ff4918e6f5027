"""The marked blocks of the pages, run from top to bottom: `python -m tests.pages` writes anew what they say.

A comment before a block says what it is: `<!-- file NAME -->` a file to be written, `<!-- run -->` commands
or Python to be run, `<!-- run, exit 1 -->` the same with that exit code, `<!-- output -->` what the block
before said.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from regionik.cli.app import run

DOCS = Path(__file__).parent.parent / "docs"
PLAYED = ("tutorial.md", *sorted(f"howto/{path.name}" for path in (DOCS / "howto").glob("*.md")))
_BLOCK = re.compile(r"<!-- (file [\w.-]+|run|run, exit \d|output) -->\n```(\w+)\n(.*?)```", re.DOTALL)


class Block(NamedTuple):
    """A marked block, and where its text stands in its page."""

    mark: str
    language: str
    text: str
    span: tuple[int, int]


def blocks(page: str) -> list[Block]:
    """The marked blocks of a page's text."""
    return [Block(found[1], found[2], found[3], found.span(3)) for found in _BLOCK.finditer(page)]


def play(page: str, folder: Path) -> Iterator[tuple[Block, str]]:
    """Run a page in a folder; each output block, and what really was said."""
    for path in (DOCS / "files").iterdir():
        shutil.copy(path, folder)
    names: dict[str, Any] = {"__name__": "page"}
    said = ""
    with contextlib.chdir(folder):
        for block in blocks(page):
            if block.mark.startswith("file "):
                Path(block.mark.removeprefix("file ")).write_text(block.text)
            elif block.mark == "output":
                yield block, said
            else:
                said = _said(block, names)


def _said(block: Block, names: dict[str, Any]) -> str:
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        codes = [0]
        if block.language == "python":
            exec(compile(block.text, "page", "exec"), names)
        else:
            codes = [_run(line) for line in block.text.splitlines()]
    expected = int(block.mark.partition("exit ")[2] or 0)
    if codes != [0] * (len(codes) - 1) + [expected]:
        raise AssertionError(f"expected exit code {expected}, got {codes}:\n{block.text}{out.getvalue()}")
    return "".join(line.rstrip() + "\n" for line in out.getvalue().splitlines())


def _run(line: str) -> int:
    program, *arguments = shlex.split(line)
    if program != "regionik":
        raise AssertionError(f"expected a command of regionik, got {line}")
    return run(arguments)


def rewrite(path: Path) -> None:
    """Put what the blocks of a page say into it."""
    page = path.read_text("utf-8")
    with tempfile.TemporaryDirectory() as folder:
        for block, said in reversed(list(play(page, Path(folder)))):
            start, end = block.span
            page = page[:start] + said + page[end:]
    path.write_text(page, "utf-8")


if __name__ == "__main__":
    os.environ["REGIONIK_QUIET"] = "1"  # lines of progress come by the clock
    for name in PLAYED:
        rewrite(DOCS / name)
