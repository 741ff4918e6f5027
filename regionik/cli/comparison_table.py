"""A comparison as a table for people, as a document, and as files."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from regionik.cli.console import plain
from regionik.comparison import Comparison, Score
from regionik.storage.files import write_whole
from regionik.values import Configuration
from regionik.worlds.errors import InputError

FORMATS = (".csv", ".json")


def comparison_document(comparison: Comparison) -> dict[str, Any]:
    """Return the JSON document of a comparison, every answer of every method in it."""
    return {
        "ok": True,
        "world": comparison.world,
        "methods": [
            {**asdict(score), "answers": [_open(answer) for answer in comparison.answers[score.method]]}
            for score in comparison.scores
        ],
        "beaten": list(comparison.beaten),
    }


def _open(answer: Configuration) -> dict[str, Any]:
    return {one.name: getattr(answer, one.name) for one in fields(answer)}


def write_comparison(comparison: Comparison, path: Path) -> None:
    """Write scores to a ``.csv`` file, a row a method, or scores and answers to a ``.json`` file.

    Raises
    ------
    InputError
        When the suffix is another, or the file cannot be written.
    """
    match path.suffix.lower():
        case ".csv":
            text = _as_csv(comparison)
        case ".json":
            text = json.dumps(plain(comparison_document(comparison)), indent=2, allow_nan=False) + "\n"
        case _:
            raise InputError(f"{path}: expected a file name ending in {', '.join(FORMATS)}")
    write_whole(path, text)


def _as_csv(comparison: Comparison) -> str:
    out = io.StringIO(newline="")
    writer = csv.DictWriter(out, [field.name for field in fields(Score)], lineterminator="\n")
    writer.writeheader()
    for score in comparison.scores:
        writer.writerow({key: "" if value != value else value for key, value in asdict(score).items()})
    return out.getvalue()


def print_scores(comparison: Comparison) -> None:
    """Print scores as a table on stdout."""
    rows = [_HEAD, *(_cells(score) for score in comparison.scores)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(_HEAD))]
    for name, *figures in rows:
        cells = (f"{cell:>{width}}" for cell, width in zip(figures, widths[1:], strict=True))
        print("  ".join([f"{name:<{widths[0]}}", *cells]))
    print("time: of a call, ratio to mfabrik; limits, arm, base: set-points with a joint beyond its limits,")
    print("the arm too near to something, the base without room")


_HEAD = ("method", "success", "iterations", "time", "us", "median mm", "worst mm", "limits", "arm", "base")


def _cells(score: Score) -> tuple[str, ...]:
    return (
        score.method,
        f"{score.success}/{score.setpoints}",
        f"{score.iterations:.2f}",
        "" if math.isnan(score.ratio) else f"{score.ratio:.2f}",
        f"{score.microseconds:.0f}",
        f"{score.median_error * 1e3:.3f}",
        f"{score.worst_error * 1e3:.3f}",
        *(str(count) for count in (score.over_limits, score.collisions, score.off_floor)),
    )
