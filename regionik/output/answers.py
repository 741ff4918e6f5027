"""Targets as they are asked for, answers as documents, tables and files."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from shapely.geometry import Point, mapping

from regionik.reach import Answer
from regionik.storage.files import write_whole
from regionik.values import Stop
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.readers.csv_path import read_csv
from regionik.worlds.scene import Target, World
from regionik.worlds.toolpath import targets_along

FORMATS = (".csv", ".json", ".geojson")
MOST_AT_ONCE = 100_000  # targets whose answers are held in memory, as documents are
_AXES, _BASE = ("x", "y", "z"), ("base_x", "base_y", "base_yaw")


def targets_asked(world: World, spelled: Sequence[str], table: Path | None) -> list[Target]:
    """Targets spelled "X Y Z", then those of a CSV file; the world's own where neither is given.

    Raises
    ------
    InputError
        One line: place and what was expected.
    """
    targets = [Target(_position(text)) for text in spelled]
    if table is not None:
        path = read_csv(table)
        if len(path.points) > MOST_AT_ONCE:
            raise InputError(
                f"{table}: {len(path.points)} targets are more than the {MOST_AT_ONCE} that are answered at "
                "once; -o with a .csv file takes any number, without --target and --json"
            )
        targets += targets_along(path, Target.cone)
    return targets or list(world.task)


def _position(text: str) -> Array:
    try:
        position = np.array([float(word) for word in text.replace(",", " ").split()])
    except ValueError:
        position = np.empty(0)
    if position.shape != (3,) or not np.isfinite(position).all():
        raise InputError(f"--target: expected three finite numbers X Y Z, got {text!r}")
    return position


def answers_document(answer: Answer) -> dict[str, Any]:
    """Return the JSON document of answers: a yes only where every target is reachable."""
    if answer.reachable.all():
        return {"ok": True, "answers": records(answer)}
    first = int((~answer.reachable).argmax())
    return {
        "ok": False,
        "verdict": str(answer.verdict[first]),
        "setpoint": first,
        "reason": answer.reason[first],
        "causes": [],
        "repairs": [],
        "answers": records(answer),
    }


def records(answer: Answer) -> list[dict[str, Any]]:
    """Return one dict a target: position, verdict, base, joints, reason; None where there is none."""
    return [
        {
            **dict(zip(_AXES, target.tolist(), strict=True)),
            "verdict": str(answer.verdict[k]),
            "reachable": bool(answer.reachable[k]),
            "base": answer.base[k].tolist() if answer.reachable[k] else None,
            "joints": answer.joints[k].tolist() if answer.reachable[k] else None,
            "reason": answer.reason[k],
        }
        for k, target in enumerate(answer.targets)
    ]


def write_answers(answer: Answer, names: Sequence[str], path: Path) -> None:
    """Write answers to a ``.csv``, ``.json`` or ``.geojson`` file, by its suffix.

    ``names`` are the joints'. The columns of the table are x, y, z, verdict, base_x, base_y, base_yaw, one
    per joint name, reason; empty where a target has no base.

    Raises
    ------
    InputError
        When the suffix is another, or the file cannot be written.
    """
    match path.suffix.lower():
        case ".csv":
            text = csv_head(names) + csv_rows(answer, names)
        case ".json":
            document = {"joint_names": list(names), "answers": records(answer)}
            text = json.dumps(document, indent=2, allow_nan=False) + "\n"
        case ".geojson":
            text = json.dumps(_as_geojson(answer, names), indent=2, allow_nan=False) + "\n"
        case _:
            raise InputError(f"{path}: expected a file name ending in {', '.join(FORMATS)}")
    write_whole(path, text)


def csv_head(names: Sequence[str]) -> str:
    """The first line of a table of answers, the joints' names in it."""
    return _csv([(*_AXES, "verdict", *_BASE, *names, "reason")])


def csv_rows(answer: Answer, names: Sequence[str]) -> str:
    """Answers as lines of a table, without its head."""
    return _csv(zip(*_columns(answer, names).values(), strict=True))


def _csv(rows: Iterable[Iterable[object]]) -> str:
    out = io.StringIO(newline="")
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()


def _columns(answer: Answer, names: Sequence[str]) -> dict[str, list[Any]]:
    """Each column by its name, None where a target has no base."""
    found = np.column_stack([answer.base, answer.joints]).astype(object)
    found[~answer.reachable] = None
    return {
        **dict(zip(_AXES, answer.targets.T.tolist(), strict=True)),
        "verdict": answer.verdict.tolist(),
        **dict(zip((*_BASE, *names), found.T.tolist(), strict=True)),
        "reason": list(answer.reason),
    }


def _as_geojson(answer: Answer, names: Sequence[str]) -> dict[str, Any]:
    """One point a target, seen from above; the height stands among the properties."""
    columns = _columns(answer, names)
    features = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": list(cells[:2])},
            "properties": dict(zip(columns, cells, strict=True)),
        }
        for cells in zip(*columns.values(), strict=True)
    ]
    return {"type": "FeatureCollection", "features": features}


def stops_as_geojson(stops: Sequence[Stop]) -> dict[str, Any]:
    """Circles to park in as a FeatureCollection, one feature a stop, in metres of the floor."""
    features = [
        {
            "type": "Feature",
            "properties": {
                "base": stop.base.tolist(),
                "setpoints": list(stop.setpoints),
                "tolerance": stop.tolerance,
                "criterion": stop.criterion,
            },
            "geometry": mapping(Point(stop.base[:2]).buffer(stop.tolerance)),
        }
        for stop in stops
    ]
    return {"type": "FeatureCollection", "features": features}
