"""The command ``reach``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from regionik.cli.console import LateProgress, check_output, print_answers, print_json, say
from regionik.cli.shared import NO, AsJson, WorldName
from regionik.worlds.errors import InputError

if TYPE_CHECKING:
    from regionik.bulk import Pool
    from regionik.worlds.scene import World


def reach(
    world: WorldName,
    target: Annotated[
        list[str] | None, typer.Option("--target", metavar="X Y Z", help="A target [m]; may be repeated.")
    ] = None,
    table: Annotated[Path | None, typer.Option("--csv", help="Targets from a CSV file: x, y, z.")] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Answers to a .csv, .json or .geojson file.")
    ] = None,
    workers: Annotated[
        int, typer.Option("--workers", metavar="N", min=1, max=1024, help="Processes to work in.")
    ] = 1,
    dask: Annotated[
        str | None, typer.Option("--dask", metavar="ADDRESS", help="Work on the Dask cluster at tcp://...")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Say for each target whether the tool reaches it, and where the base then stands.

    Without --target and --csv the set-points of WORLD are asked for. From one CSV file to another there may
    be any number of targets; a run that was broken off goes on when it is called again. The exit code is 1
    when any target is not reachable.
    """
    check_output(output, (".csv", ".json", ".geojson"), [world, table])
    if dask is not None and workers > 1:
        raise InputError("--workers and --dask: expected one of them")
    with LateProgress() as progress:
        progress("load", 0, 1)
        from regionik.worlds.documents.world_file import load_world

        scene = load_world(world)
        progress("load", 1, 1)
        with _pool(workers, dask) as (pool, ahead):
            if (
                output is not None
                and table is not None
                and not target
                and not as_json
                and _long(table, output)
            ):
                from regionik.output.answer_table import answer_table

                count, total = answer_table(scene, table, output, pool, ahead, progress)
            else:
                count, total = _at_once(scene, target or [], table, output, as_json, pool, progress)
    say(f"{scene.name}: {count} of {total} targets are reachable")
    if count < total:
        raise typer.Exit(NO)


def _at_once(
    scene: World,
    target: list[str],
    table: Path | None,
    output: Path | None,
    as_json: bool,
    pool: Pool | None,
    progress: LateProgress,
) -> tuple[int, int]:
    """Answer targets that are all held in memory; return how many are reachable, and all."""
    from regionik.output.answers import answers_document, targets_asked, write_answers
    from regionik.reach import reach as answers_for

    progress("reach", 0, 0)
    answer = answers_for(scene, targets_asked(scene, target, table), executor=pool, progress=progress)
    if output is not None:
        write_answers(answer, scene.robot.chain.names, output)
    if as_json:
        print_json(answers_document(answer))
    elif output is None:
        print_answers(answer)
    return int(answer.reachable.sum()), len(answer.verdict)


def _long(table: Path, output: Path) -> bool:
    """Whether answers can go from file to file: pipes and devices are neither sought in nor replaced."""
    plain = table.is_file() and (output.is_file() or not output.exists())
    return plain and output.suffix.lower() == ".csv"


@contextmanager
def _pool(workers: int, dask: str | None) -> Iterator[tuple[Pool | None, int]]:
    """What to work on, and how many chunks to hand out ahead."""
    from regionik.bulk import AHEAD

    if dask is not None:
        from regionik.cluster import cluster

        with cluster(dask) as found:
            yield found
    elif workers > 1:
        from regionik.workers import processes

        yield partial(processes, workers), max(AHEAD, 2 * workers)
    else:
        yield None, AHEAD
