"""Targets as users give them; answers and stops as documents, tables and files.

`stream_answers` goes from one CSV file to another of any length, block by block, and resumes after a kill.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from shapely.geometry import Point, mapping

from regionik.executors import CHUNKS_AHEAD, Pool, map_unordered
from regionik.planners.progress import tell, track
from regionik.reachability.options import REACHABILITY
from regionik.reachability.reach import reach
from regionik.storage.files import csv_text, json_text, json_values, open_partial, write_atomic
from regionik.storage.plan_document import feature, feature_collection
from regionik.values import Answer, Stop, answer_titles
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.errors import InputError, located
from regionik.worlds.readers.csv_path import CsvBlock, CsvFormat, CsvTable, index_csv, read_csv
from regionik.worlds.scene import Target, World
from regionik.worlds.toolpath import rotation_from_quaternion, targets_along

FORMATS = (".csv", ".json", ".geojson")
MAX_IN_MEMORY = 100_000  # targets whose answers are held in memory, as documents are
BasePose = tuple[float, float, float]  # x, y [m], yaw [rad]
_AXES = ("x", "y", "z")
_DEPENDENCIES = ("regionik", "numpy", "scipy", "shapely", "numba", "llvmlite")  # answers may vary with them


def parse_targets(
    world: World, positions: Sequence[str], table: Path | None, form: CsvFormat | None = None
) -> list[Target]:
    """Return targets written as numbers, then those of a CSV file; without either, the world's own.

    Numbers are x, y, z, or with a tool axis dx, dy, dz behind them, or with an orientation qx, qy, qz, qw.
    """
    targets = [_target(text) for text in positions]
    if table is not None:
        path = read_csv(table, form)
        if len(path.points) > MAX_IN_MEMORY:
            raise InputError(
                f"{table}: {len(path.points)} targets are more than the {MAX_IN_MEMORY} that are answered at "
                "once; -o with a .csv file takes any number, without --target and --json"
            )
        targets += targets_along(path, Target.cone)
    return targets or list(world.task)


def _target(text: str) -> Target:
    try:
        numbers = np.array([float(word) for word in text.replace(",", " ").split()])
    except ValueError:
        numbers = np.empty(0)
    if len(numbers) not in (3, 6, 7) or not np.isfinite(numbers).all():
        raise InputError(
            f"--target: expected three finite numbers X Y Z, six with a tool axis DX DY DZ, or seven with an "
            f"orientation QX QY QZ QW, got {text!r}"
        )
    position, rest = numbers[:3], numbers[3:]
    with located("--target", ""):
        if len(rest) == 4:
            turn = rotation_from_quaternion(rest)
            return Target(position, turn[:, 2], orientation=turn)
        return Target(position, rest if len(rest) else None)


def answers_document(answer: Answer) -> dict[str, Any]:
    """Return the JSON document of answers; ``ok`` is true only if every target is reachable."""
    if answer.reachable.all():
        return {"ok": True, "answers": _answer_records(answer)}
    first = int((~answer.reachable).argmax())
    return {
        "ok": False,
        "verdict": str(answer.verdict[first]),
        "setpoint": first,
        "reason": answer.reason[first],
        "code": answer.code[first],
        "causes": [],
        "repairs": [],
        "answers": _answer_records(answer),
    }


def _answer_records(answer: Answer) -> list[dict[str, Any]]:
    """Return a dict for each target; base and joints are None where it is unreachable."""
    return [
        {
            "name": answer.name[k],
            **dict(zip(_AXES, target.tolist(), strict=True)),
            "verdict": str(answer.verdict[k]),
            "reachable": bool(answer.reachable[k]),
            "base": answer.base[k].tolist() if answer.reachable[k] else None,
            "joints": answer.joints[k].tolist() if answer.reachable[k] else None,
            "code": answer.code[k],
            "reason": answer.reason[k],
        }
        for k, target in enumerate(answer.targets)
    ]


def write_answers(answer: Answer, names: Sequence[str], path: Path) -> None:
    """Write answers to a ``.csv``, ``.json`` or ``.geojson`` file; ``names`` are those of the joints.

    Columns of the table are those of `regionik.values.Answer.columns`. A GeoJSON point lies on the
    floor, its height among the properties.
    """
    match path.suffix.lower():
        case ".csv":
            text = csv_header(names) + csv_rows(answer, names)
        case ".json":
            text = json_text({"joint_names": names, "answers": _answer_records(answer)})
        case ".geojson":
            columns = answer.columns(names)
            rows = [dict(zip(columns, cells, strict=True)) for cells in zip(*columns.values(), strict=True)]
            places = ({"type": "Point", "coordinates": [row["x"], row["y"]]} for row in rows)
            text = json_text(feature_collection(map(feature, places, rows)))
        case _:
            raise InputError(f"{path}: expected a file name ending in {', '.join(FORMATS)}")
    write_atomic(path, text)


def csv_header(names: Sequence[str]) -> str:
    """Return the first line of a table of answers."""
    return csv_text([answer_titles(names)])


def csv_rows(answer: Answer, names: Sequence[str]) -> str:
    """Return answers as lines of a table, without its header."""
    return csv_text(zip(*answer.columns(names).values(), strict=True))


def stops_document(world: World, stops: Sequence[Stop]) -> list[dict[str, Any]]:
    """Return stops as JSON documents, the names of their set-points among them."""
    names = ([world.task[i].name for i in stop.setpoints] for stop in stops)
    return [{**json_values(stop), "names": called} for stop, called in zip(stops, names, strict=True)]


def stops_geojson(world: World, stops: Sequence[Stop]) -> dict[str, Any]:
    """Return the circles to park in as GeoJSON, one feature for each stop."""
    circles = (mapping(Point(stop.base[:2]).buffer(stop.tolerance)) for stop in stops)
    return feature_collection(map(feature, circles, stops_document(world, stops)))


def stream_answers(
    world: World,
    table: Path,
    output: Path,
    executor: Pool | None = None,
    ahead: int = CHUNKS_AHEAD,
    base: BasePose | None = None,
    form: CsvFormat | None = None,
) -> tuple[int, int]:
    """Write the answers to all targets of a CSV file to another; return how many are reachable, and all.

    They are from anywhere, or from one pose of the base.

    At most ``ahead`` blocks of `targets_at_once` lines are in memory and handed to the executor, which is as
    for `regionik.reachability.reach.reach`. Answers are kept in the folder ``output.parts`` until all are
    there; the same call resumes with them, and gives the bytes of one uninterrupted call. Parts of another
    run are an `InputError`; workers that are lost again and again are an `EngineError`.
    """
    blocks = index_csv(table, REACHABILITY.search.targets_at_once, form)
    with open_partial(output, _manifest(world, blocks, base)) as parts:
        counts = parts.counts()
        for k in track("read", range(0 if counts else len(blocks))):
            blocks.block(k).path()  # a mistake in the last line is reported before the first is answered
        missing = ((k, blocks.block(k)) for k in range(len(blocks)) if k not in counts)
        tell("blocks", len(counts), len(blocks))
        done, work = dict(counts), _answer_block if base is None else partial(_answer_block, base=base)
        for k, (data, yes, total) in map_unordered(world, work, missing, executor, ahead):
            parts.write_part(k, data, yes, total)
            done[k] = yes, total
            tell("blocks", len(done), len(blocks))
        parts.join(csv_header(world.robot.chain.names).encode())
    return sum(yes for yes, _ in done.values()), sum(total for _, total in done.values())


def _answer_block(world: World, block: CsvBlock, base: BasePose | None = None) -> tuple[bytes, int, int]:
    """Rows of the answers to a block, how many targets are reachable, and how many there are."""
    path = block.path()
    if not len(path.points):
        return b"", 0, 0
    answer = reach(world, targets_along(path, Target.cone), base=base)
    rows = csv_rows(answer, world.robot.chain.names)
    return rows.encode(), int(answer.reachable.sum()), len(answer.reachable)


def _manifest(world: World, blocks: CsvTable, base: BasePose | None) -> dict[str, object]:
    document = json.dumps(world_to_document(world), sort_keys=True)
    return {
        "world": hashlib.sha256(document.encode()).hexdigest(),
        "table of targets": blocks.digest,
        "table of answers": csv_header(world.robot.chain.names),
        "how it is read": asdict(blocks.layout.form),
        **({} if base is None else {"pose of the base": list(base)}),
        "size of blocks": blocks.size,
        "version of regionik or of what it stands on": {
            "python": platform.python_version(),
            "machine": platform.machine(),
            **{name: version(name) for name in _DEPENDENCIES},
        },
    }
