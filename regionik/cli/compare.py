"""The command ``compare``, and a comparison as a table, a document and a file."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from regionik.cli.console import (
    AsJson,
    DelayedProgress,
    WorldName,
    check_output,
    explain_no_plan,
    print_json,
    print_message,
    read_world,
)
from regionik.storage.files import csv_text, json_text, json_values, write_atomic

if TYPE_CHECKING:
    from regionik.papers.comparison import Comparison, Score

_HEADER = ("method", "success", "iterations", "time", "us", "median mm", "worst mm", "limits", "arm", "base")


def compare_methods(
    world: WorldName,
    methods: Annotated[
        str | None,
        typer.Option("--methods", metavar="A,B,...", help="Methods to compare; mfabrik is the measure."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Scores to a .csv, all answers to a .json file.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Compare M-FABRIK with other methods on the set-points of WORLD.

    Where another method is better, the command says so. Every method starts each set-point from its own last
    answer, on a floor without limits; mfabrik-areas keeps to the areas of the whole path. genetic and network
    need regionik[compare].
    """
    check_output(output, (".csv", ".json"), [world])
    with DelayedProgress("compare", "nothing is written") as progress, explain_no_plan(as_json, progress):
        loaded = read_world(world, progress)
        from regionik.papers.comparison import DEFAULT, compare

        names = DEFAULT if methods is None else [name.strip() for name in methods.split(",") if name.strip()]
        comparison = compare(loaded, names)
        if output is not None:
            csv_wanted = output.suffix.lower() == ".csv"
            write_atomic(output, scores_csv(comparison) if csv_wanted else json_text(_document(comparison)))
    if as_json:
        print_json(_document(comparison))
    else:
        _print_scores(comparison)
    for line in comparison.beaten:
        print_message(line)
    if output is not None:
        print_message(f"wrote {output}")


def _document(comparison: Comparison) -> dict[str, Any]:
    """Return the JSON document of a comparison, with every answer of every method."""
    return {
        "ok": True,
        "world": comparison.world,
        "methods": [
            {**asdict(score), "answers": json_values(comparison.answers[score.method])}
            for score in comparison.scores
        ],
        "beaten": list(comparison.beaten),
    }


def scores_csv(comparison: Comparison) -> str:
    """Return scores as CSV, one row a method; cells are empty for NaN."""
    rows = [asdict(score) for score in comparison.scores]
    return csv_text([rows[0], *(["" if cell != cell else cell for cell in row.values()] for row in rows)])


def _print_scores(comparison: Comparison) -> None:
    """Print scores as a table on stdout."""
    rows = [_HEADER, *(_cells(score) for score in comparison.scores)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(_HEADER))]
    for name, *figures in rows:
        cells = (f"{cell:>{width}}" for cell, width in zip(figures, widths[1:], strict=True))
        print("  ".join([f"{name:<{widths[0]}}", *cells]))
    print("time: of a call, ratio to mfabrik; limits, arm, base: set-points with a joint beyond its limits,")
    print("the arm too near to something, the base without room")


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
