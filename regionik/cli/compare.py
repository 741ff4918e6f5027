"""The command ``compare``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from regionik.cli.console import LateProgress, check_output, print_json, say
from regionik.cli.shared import AsJson, WorldName, explained


def compare(
    world: WorldName,
    methods: Annotated[
        str | None,
        typer.Option("--methods", metavar="A,B,...", help="Which methods; mfabrik is the measure."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Scores to a .csv, all answers to a .json file.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Solve the set-points of WORLD by M-FABRIK and by its rivals, and say where these are better.

    Every method goes from set-point to set-point from its own last answer, on a floor without limits;
    mfabrik-areas keeps to the areas of the whole path. genetic and network need regionik[compare].
    """
    check_output(output, (".csv", ".json"), [world])
    with LateProgress() as progress, explained(as_json):
        progress("load", 0, 1)
        from regionik.cli.comparison_table import comparison_document, print_scores, write_comparison
        from regionik.comparison import DEFAULT
        from regionik.comparison import compare as run
        from regionik.worlds.documents.world_file import load_world

        scene = load_world(world)
        progress("load", 1, 1)
        asked = DEFAULT if methods is None else [name.strip() for name in methods.split(",") if name.strip()]
        comparison = run(scene, asked, progress=progress)
        if output is not None:
            write_comparison(comparison, output)
    if as_json:
        print_json(comparison_document(comparison))
    else:
        print_scores(comparison)
    for line in comparison.beaten:
        say(line)
    if output is not None:
        say(f"wrote {output}")
