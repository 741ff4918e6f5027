"""Commands that ask for areas and plan no motion: reach, field, stops, why."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast, get_args

import typer

from regionik.cli.console import (
    PAGES,
    AsJson,
    DelayedProgress,
    Skip,
    WorldName,
    check_output,
    explain_no_plan,
    explanation_document,
    file_names,
    print_explanation,
    print_json,
    print_message,
    read_world,
    skipped_lines,
    skipping,
)
from regionik.cli.exit_codes import ExitCode
from regionik.cli.options import COMMANDS
from regionik.cli.tables import (
    AngleUnitName,
    Columns,
    NormalsWay,
    Unit,
    as_counted,
    csv_format,
    print_answers,
    print_stops,
    unconfirmed,
)
from regionik.worlds.errors import InputError

if TYPE_CHECKING:
    from regionik.executors import Pool
    from regionik.reachability.field import Field
    from regionik.values import Stop
    from regionik.worlds.scene import StopCriterion, Target, World

TARGET = "X Y Z [DX DY DZ]"
FIELD_SUFFIXES = (".npz", ".tif", ".tiff", ".png", ".svg")
STOP_CRITERIA = "tolerance, clearance, manipulability, effort, distance, probability"


def reach_targets(
    world: WorldName,
    target: Annotated[
        list[str] | None, typer.Option("--target", metavar=TARGET, help="A target [m]; may be repeated.")
    ] = None,
    table: Annotated[
        Path | None, typer.Option("--csv", help="Targets from a CSV file: x, y, z, and name if you like.")
    ] = None,
    columns: Columns = None,
    unit: Unit = None,
    angle_unit: AngleUnitName = None,
    normals: NormalsWay = None,
    base: Annotated[
        tuple[float, float, float] | None,
        typer.Option("--base", metavar="X Y YAW", help="Where the base stands, exactly [m], [rad]."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Answers to a .csv, .json or .geojson file.")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            metavar="N",
            min=1,
            max=1024,
            help="Number of worker processes; by default one a core, each for 1000 targets or more.",
        ),
    ] = None,
    dask: Annotated[
        str | None, typer.Option("--dask", metavar="ADDRESS", help="Work on the Dask cluster at tcp://...")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Tell which targets the tool reaches, and from which base pose: any on the floor, or that of --base.

    Without --target and --csv the targets are the set-points of WORLD. From one CSV file to another there may
    be any number of targets; a run that was interrupted resumes when it is called again. The exit code is 1
    if any target is not reachable.
    """
    check_output(output, (".csv", ".json", ".geojson"), [world, table])
    form = csv_format(table, "--csv", columns, unit, angle_unit, normals)
    if dask is not None and workers is not None and workers > 1:
        raise InputError("--workers and --dask: expected one of them")
    streams = not target and not as_json and _can_stream(table, output)
    kept = f"the same command goes on from what is in {output}.parts" if streams else "nothing is written"
    with DelayedProgress("reach", kept) as progress:
        from regionik.output.answers import parse_targets, stream_answers

        loaded = read_world(world, progress)
        if streams and table is not None and output is not None:
            with _executor(workers or workers_for(_lines(table)), dask) as (pool, ahead):
                count, total = stream_answers(loaded, table, output, pool, ahead, base, form)
        else:
            asked = parse_targets(loaded, target or [], table, form)
            with _executor(workers or workers_for(len(asked)), dask) as (pool, _):
                count, total = _reach_at_once(loaded, asked, base, output, as_json, pool)
    there = "" if base is None else f" from {_pose_text(base)}"
    print_message(f"{loaded.name}: {count} of {total} targets are reachable{there}")
    if count < total:
        raise typer.Exit(ExitCode.NO)


def workers_for(targets: int) -> int:
    """Number of workers that so many targets are worth."""
    from regionik.executors import cores

    return max(1, min(cores(), targets // COMMANDS.targets_per_worker))


def _lines(table: Path) -> int:
    with table.open("rb") as lines:
        return sum(1 for _ in lines)


def _pose_text(base: tuple[float, float, float]) -> str:
    x, y, yaw = base
    return f"x {x:z.3f} m, y {y:z.3f} m, yaw {yaw:z.3f} rad"


def _reach_at_once(
    world: World,
    targets: list[Target],
    base: tuple[float, float, float] | None,
    output: Path | None,
    as_json: bool,
    pool: Pool | None,
) -> tuple[int, int]:
    """Answer targets that are all held in memory; return how many are reachable, and all."""
    from regionik.output.answers import answers_document, write_answers
    from regionik.reachability.reach import reach

    answer = reach(world, targets, base=base, executor=pool)
    if output is not None:
        write_answers(answer, world.robot.chain.names, output)
    if as_json:
        print_json(answers_document(answer))
    elif output is None:
        print_answers(answer)
    return int(answer.reachable.sum()), len(answer.verdict)


def _can_stream(table: Path | None, output: Path | None) -> bool:
    """Return whether answers can go from file to file: pipes and devices cannot be rewound or replaced."""
    if table is None or output is None or output.suffix.lower() != ".csv":
        return False
    return table.is_file() and (output.is_file() or not output.exists())


@contextmanager
def _executor(workers: int, dask: str | None) -> Iterator[tuple[Pool | None, int]]:
    """Yield the executor to work on, if any, and how many chunks to hand out ahead."""
    from regionik.executors import CHUNKS_AHEAD, dask_executor, process_pool

    if dask is not None:
        with dask_executor(dask) as found:
            yield found
    elif workers > 1:
        yield partial(process_pool, workers), max(CHUNKS_AHEAD, 2 * workers)
    else:
        yield None, CHUNKS_AHEAD


def map_reach(
    world: WorldName,
    output: Annotated[Path, typer.Option("-o", "--output", help="An .npz, .tif, .png or .svg file.")],
    targets: Annotated[
        Path | None, typer.Option("--targets", help="Targets from a CSV file, instead of WORLD's own.")
    ] = None,
    columns: Columns = None,
    unit: Unit = None,
    angle_unit: AngleUnitName = None,
    normals: NormalsWay = None,
    cell: Annotated[float, typer.Option("--cell", metavar="M", help="Side of a cell [m].")] = 0.05,
    height: Annotated[
        float | None, typer.Option("--height", metavar="Z", help="A slice of tool positions at this height.")
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Look for clear postures from the best place, too.")
    ] = False,
) -> None:
    """Map how many targets the arm reaches from each base position, by areas alone.

    What the arm would touch is looked at with --check, from the best place, and by `regionik reach`.
    With --height it maps where the tool can be at that height. A .tif needs regionik[geotiff].
    """
    check_output(output, FIELD_SUFFIXES, [world, targets])
    form = csv_format(targets, "--targets", columns, unit, angle_unit, normals)
    if targets is not None and height is not None:
        raise InputError("--targets and --height: expected one of them, a slice has no targets")
    if check and height is not None:
        raise InputError("--check and --height: expected one of them, a slice has no best place")
    with DelayedProgress("field") as progress:
        loaded = read_world(world, progress)
        from regionik.output.export import write_field
        from regionik.reachability.field import reach_field, reach_slice
        from regionik.worlds.readers.csv_path import read_csv
        from regionik.worlds.scene import Target
        from regionik.worlds.toolpath import targets_along

        if check and loaded.rules.heading == "face_target":
            raise InputError("--check: rules.heading: face_target turns the base at every target")
        if height is not None:
            chosen: tuple[Target, ...] = ()
            found = reach_slice(loaded, height, cell)
        else:
            chosen = loaded.task if targets is None else targets_along(read_csv(targets, form), Target.cone)
            found = reach_field(loaded, chosen, cell)
        write_field(found, output)
        checked = _checked_text(loaded, found, chosen) if check else ""
    print_message(f"{loaded.name}: {found.summary}{checked}")
    print_message(f"wrote {output}")


def _checked_text(world: World, field: Field, targets: Sequence[Target]) -> str:
    """Say how many targets have a clear posture from the best place of a field."""
    from regionik.reachability.reach import reach

    answers = [(int(reach(world, targets, base=pose).reachable.sum()), pose) for pose in field.best]
    if not answers:
        return ""
    count, (x, y, yaw) = max(answers, key=lambda one: one[0])
    return f"; from the base at {_pose_text((x, y, yaw))}, {count} have a posture that is clear"


def find_stops(
    world: WorldName,
    criterion: Annotated[
        str | None, typer.Option("--criterion", help=f"Best place of a stop by: {STOP_CRITERIA}.")
    ] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Stops to a .geojson file.")] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="Floor and stops to an .svg or .png file.")
    ] = None,
    skip: Skip = False,
    as_json: AsJson = False,
) -> None:
    """Find the fewest stops of the base that serve all set-points.

    No motion is planned; rules.mode: stops in the world file plans it. rules.order: any frees the order.
    """
    check_output(output, (".geojson",), [world])
    check_output(picture, (".svg", ".png"))
    with DelayedProgress("stops", "nothing is written") as progress, explain_no_plan(as_json, progress):
        loaded = skipping(read_world(world, progress), skip)
        if criterion is not None:
            loaded = replace(loaded, rules=replace(loaded.rules, stop_criterion=_stop_criterion(criterion)))
        from regionik.parking.stops import find_served
        from regionik.scene import scene_of

        found, parking, skipped = find_served(scene_of(loaded))
        _write_stops(loaded, found, output, picture)
    written = [path for path in (output, picture) if path is not None]
    if as_json:
        from regionik.output.answers import stops_document
        from regionik.storage.plan_document import skipped_document

        document = {
            "ok": True,
            "world": loaded.name,
            "stops": stops_document(loaded, found),
            "unconfirmed": unconfirmed(found),
            "stats": parking.stats(len(found)),
            "skipped": skipped_document(skipped),
        }
        print_json({**document, "files": file_names(written)})
    else:
        print_stops(loaded, found)
    count = len(loaded.task)
    served = f"{count - len(skipped)} of {count}" if skipped else f"{count}"
    print_message(
        f"{loaded.name}: {len(found)} stops for {served} set-points; "
        f"fewer than {parking.lower} are not possible"
    )
    print_message(_confirmed_text(found))
    for line in skipped_lines(skipped, count):
        print_message(line)
    for path in written:
        print_message(f"wrote {path}")


def _stop_criterion(criterion: str) -> StopCriterion:
    from regionik.worlds.scene import StopCriterion

    if criterion not in get_args(StopCriterion):
        raise InputError(f"--criterion: expected one of {STOP_CRITERIA}, got {criterion}")
    return cast(StopCriterion, criterion)


def _write_stops(world: World, some: tuple[Stop, ...], output: Path | None, picture: Path | None) -> None:
    if output is not None:
        from regionik.output.answers import stops_geojson
        from regionik.storage.files import json_text, write_atomic

        write_atomic(output, json_text(stops_geojson(world, some)))
    if picture is not None:
        from regionik.view.figures import plot_stops

        plot_stops(world, some, picture)


def _confirmed_text(some: tuple[Stop, ...]) -> str:
    """Say for how many set-points a clear posture is known, which areas do not look at."""
    every, doubts = sum(len(stop.setpoints) for stop in some), unconfirmed(some)
    if not doubts:
        return f"  confirmed: from its stop each of the {every} set-points has a posture that is clear"
    return (
        f"  confirmed: {every - len(doubts)} set-points have a posture that is clear; unconfirmed, by areas "
        f"alone: {as_counted(doubts)} (regionik reach WORLD --base X Y YAW says why)"
    )


def explain_world(
    world: WorldName,
    target: Annotated[
        list[str] | None, typer.Option("--target", metavar=TARGET, help="A target [m]; else the whole path.")
    ] = None,
    html: Annotated[
        Path | None, typer.Option("--html", help="File for an offline page of what stands in the way.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Explain why a target or the path of WORLD is out of reach.

    The smallest changes that mend it are named; each was applied and checked. The exit code is 1 if
    something stands in the way.
    """
    check_output(html, PAGES, [world])
    with DelayedProgress("why") as progress:
        if len(target or []) > 1:
            raise InputError(f"--target: expected one target, got {len(target or [])}")
        loaded = read_world(world, progress)
        from regionik.output.answers import parse_targets
        from regionik.pipeline import why

        chosen = parse_targets(loaded, target, None)[0] if target else None
        found = why(loaded, chosen, say=None if as_json else progress.say)
    if html is not None:
        from regionik.view.page import to_html
        from regionik.view.world_picture import picture_of_explanation

        to_html(loaded if found is None else picture_of_explanation(loaded, found, chosen), html)
        print_message(f"wrote {html}")
    if as_json:
        print_json({"ok": True} if found is None else explanation_document(found))
    if found is None:
        print_message(f"{loaded.name}: nothing stands in the way")
        return
    print_explanation(found, progress)
    raise typer.Exit(ExitCode.NO)
