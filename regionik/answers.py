"""Targets as they are asked for, answers as documents, tables and files."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from shapely.geometry import Point, mapping

from regionik.files import write_whole
from regionik.plan import Stop
from regionik.reach import Answer
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.scene import Target, World
from regionik.worlds.toolpath import read_csv, targets_along

FORMATS = (".csv", ".json", ".geojson")
_AXES = ("x", "y", "z")


def targets_asked(world: World, spelled: Sequence[str], table: Path | None) -> list[Target]:
    """Targets spelled "X Y Z", then those of a CSV file; the world's own where neither is given.

    Raises
    ------
    InputError
        One line: place and what was expected.
    """
    targets = [Target(_position(text)) for text in spelled]
    if table is not None:
        targets += targets_along(read_csv(table), Target.cone)
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
    proven = answer.verdict[first] == "unreachable"
    return {
        "ok": False,
        "verdict": "unreachable" if proven else "no-posture",
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
    rows = records(answer)
    match path.suffix.lower():
        case ".csv":
            text = _as_csv(rows, names)
        case ".json":
            text = json.dumps({"joint_names": list(names), "answers": rows}, indent=2, allow_nan=False) + "\n"
        case ".geojson":
            text = json.dumps(_as_geojson(rows, names), indent=2, allow_nan=False) + "\n"
        case _:
            raise InputError(f"{path}: expected a file name ending in {', '.join(FORMATS)}")
    write_whole(path, text)


def _cells(row: dict[str, Any], names: Sequence[str]) -> dict[str, Any]:
    base = row["base"] or [None] * 3
    joints = row["joints"] or [None] * len(names)
    return {
        **{axis: row[axis] for axis in _AXES},
        "verdict": row["verdict"],
        **dict(zip(("base_x", "base_y", "base_yaw"), base, strict=True)),
        **dict(zip(names, joints, strict=True)),
        "reason": row["reason"],
    }


def _as_csv(rows: Sequence[dict[str, Any]], names: Sequence[str]) -> str:
    out = io.StringIO(newline="")
    cells = [_cells(row, names) for row in rows]
    writer = csv.DictWriter(out, fieldnames=list(cells[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(cells)
    return out.getvalue()


def _as_geojson(rows: Sequence[dict[str, Any]], names: Sequence[str]) -> dict[str, Any]:
    """One point a target, seen from above; the height stands among the properties."""
    features = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": [row["x"], row["y"]]},
            "properties": _cells(row, names),
        }
        for row in rows
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
