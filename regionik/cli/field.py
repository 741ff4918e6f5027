"""The command ``field``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from regionik.cli.console import LateProgress, check_output, say
from regionik.cli.shared import WorldName
from regionik.worlds.errors import InputError

SUFFIXES = (".npz", ".tif", ".tiff", ".png", ".svg")


def field(
    world: WorldName,
    output: Annotated[Path, typer.Option("-o", "--output", help="An .npz, .tif, .png or .svg file.")],
    targets: Annotated[
        Path | None, typer.Option("--targets", help="Targets from a CSV file, instead of WORLD's own.")
    ] = None,
    cell: Annotated[float, typer.Option("--cell", metavar="M", help="Side of a cell [m].")] = 0.05,
    height: Annotated[
        float | None, typer.Option("--height", metavar="Z", help="A slice of tool positions at this height.")
    ] = None,
) -> None:
    """Map how many targets the arm reaches from each place, or with --height where the tool can be.

    A .tif needs regionik[geotiff].
    """
    check_output(output, SUFFIXES, [world, targets])
    if targets is not None and height is not None:
        raise InputError("--targets and --height: expected one of them, a slice has no targets")
    with LateProgress() as progress:
        progress("load", 0, 1)
        from regionik.field import reach_field, reach_slice
        from regionik.output.field_file import write_field
        from regionik.worlds.documents.world_file import load_world
        from regionik.worlds.readers.csv_path import read_csv
        from regionik.worlds.scene import Target
        from regionik.worlds.toolpath import targets_along

        scene = load_world(world)
        progress("load", 1, 1)
        progress("field", 0, 0)
        if height is not None:
            found = reach_slice(scene, height, cell)
        else:
            asked = scene.task if targets is None else targets_along(read_csv(targets), Target.cone)
            found = reach_field(scene, asked, cell)
        write_field(found, output)
    say(f"{scene.name}: {found.summary}")
    say(f"wrote {output}")
