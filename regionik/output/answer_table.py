"""Answers to the targets of a long CSV file, as another: block by block, and on again after a kill."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path

from regionik.bulk import AHEAD, Pool, handed_out
from regionik.output.answers import csv_head, csv_rows
from regionik.reach import CHUNK, reach
from regionik.storage.partial_file import parts_of
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.readers.csv_path import CsvBlock, CsvTable, index_csv
from regionik.worlds.scene import Target, World
from regionik.worlds.toolpath import targets_along

_MAKERS = ("regionik", "numpy", "scipy", "shapely", "numba", "llvmlite")  # whose versions may show in answers


def answer_table(
    world: World,
    table: Path,
    output: Path,
    executor: Pool | None = None,
    ahead: int = AHEAD,
    progress: Callable[[str, int, int], None] | None = None,
) -> tuple[int, int]:
    """Write the answers to all targets of a CSV file.

    No more than ``ahead`` blocks of `CHUNK` lines are in memory. Answers are kept in the folder
    ``output.parts`` until all are there; the same call goes on with them, and gives the bytes that one call
    without a break gives.

    Parameters
    ----------
    world : World
    table, output : Path
    executor : Executor or function that makes one, optional
        As for `regionik.reach.reach`.
    progress : callable, optional
        Called with a stage, blocks done, blocks in all.

    Returns
    -------
    reachable, total : int

    Raises
    ------
    InputError
        For a file that cannot be read, a line that is no target, or parts of another run.
    EngineError
        When workers are lost again and again.
    """
    tell = progress or (lambda stage, done, total: None)
    blocks = index_csv(table, CHUNK)
    with parts_of(output, _manifest(world, blocks)) as parts:
        found = parts.found()
        if not found:
            _check(blocks, tell)
        missing = [k for k in range(len(blocks)) if k not in found]
        tell("reach", len(found), len(blocks))
        for k, (data, yes, total) in handed_out(world, _answered, _read(blocks, missing), executor, ahead):
            parts.put(k, data, yes, total)
            found[k] = yes, total
            tell("reach", len(found), len(blocks))
        parts.join(csv_head(world.robot.chain.names).encode())
    return sum(yes for yes, _ in found.values()), sum(total for _, total in found.values())


def _read(blocks: CsvTable, numbers: list[int]) -> Iterator[tuple[int, CsvBlock]]:
    return ((k, blocks.block(k)) for k in numbers)


def _check(blocks: CsvTable, tell: Callable[[str, int, int], None]) -> None:
    """Read every line once: what is wrong in the last is said before the first is answered."""
    for k in range(len(blocks)):
        blocks.block(k).path()
        tell("read", k + 1, len(blocks))


def _answered(world: World, block: CsvBlock) -> tuple[bytes, int, int]:
    """Rows of the answers to a block, how many of them are yes, and how many there are."""
    path = block.path()
    if not len(path.points):
        return b"", 0, 0
    bare = path.directions is None and path.orientations is None
    answer = reach(world, path.points if bare else targets_along(path, Target.cone))
    rows = csv_rows(answer, world.robot.chain.names)
    return rows.encode(), int(answer.reachable.sum()), len(answer.reachable)


def _manifest(world: World, blocks: CsvTable) -> dict[str, object]:
    document = json.dumps(world_to_document(world), sort_keys=True)
    return {
        "world": hashlib.sha256(document.encode()).hexdigest(),
        "table of targets": blocks.digest,
        "size of blocks": blocks.size,
        "version of regionik or of what it stands on": {
            "python": platform.python_version(),
            "machine": platform.machine(),
            **{name: version(name) for name in _MAKERS},
        },
    }
