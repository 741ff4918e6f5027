"""The command ``stops``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast, get_args

import typer

from regionik.cli.console import LateProgress, check_output, print_json, say
from regionik.cli.shared import AsJson, WorldName, explained
from regionik.worlds.errors import InputError

if TYPE_CHECKING:
    from regionik.parking.fewest_stops import Parking
    from regionik.values import Stop
    from regionik.worlds.scene import StopCriterion, World

CRITERIA = "tolerance, clearance, manipulability, effort, distance"


def stops(
    world: WorldName,
    criterion: Annotated[
        str | None, typer.Option("--criterion", help=f"What makes a place best: {CRITERIA}.")
    ] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Stops to a .geojson file.")] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="The floor with stops to an .svg or .png file.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Say where to park: the fewest stops from which the base does all set-points of WORLD standing still.

    No motion is planned; rules.mode: stops in the world file plans it. rules.order: any frees the order.
    """
    check_output(output, (".geojson",), [world])
    check_output(picture, (".svg", ".png"))
    with LateProgress() as progress, explained(as_json):
        progress("load", 0, 1)
        from regionik.parking.stops import find
        from regionik.worlds.documents.world_file import load_world

        scene = load_world(world)
        if criterion is not None:
            scene = replace(scene, rules=replace(scene.rules, stop_criterion=_known(criterion)))
        progress("load", 1, 1)
        progress("stops", 0, 0)
        found, parking = find(scene)
        written = _write(scene, found, output, picture)
    document = _document(scene, found, parking)
    if as_json:
        print_json({"ok": True, **document, "files": [str(path) for path in written]})
    else:
        for line in _lines(found):
            print(line)
    say(
        f"{scene.name}: {len(found)} stops for {len(scene.task)} set-points; "
        f"no base does with fewer than {parking.lower}"
    )
    for path in written:
        say(f"wrote {path}")


def _known(criterion: str) -> StopCriterion:
    from regionik.worlds.scene import StopCriterion

    for known in get_args(StopCriterion):
        if criterion == known:
            return cast(StopCriterion, known)
    raise InputError(f"--criterion: expected one of {CRITERIA}, got {criterion}")


def _write(scene: World, found: tuple[Stop, ...], output: Path | None, picture: Path | None) -> list[Path]:
    from regionik.storage.files import write_whole

    if output is not None:
        import json

        from regionik.output.answers import stops_as_geojson

        write_whole(output, json.dumps(stops_as_geojson(found), indent=2, allow_nan=False) + "\n")
    if picture is not None:
        from regionik.view.figures import plot_stops

        plot_stops(scene, found, picture)
    return [path for path in (output, picture) if path is not None]


def _document(scene: World, found: tuple[Stop, ...], parking: Parking) -> dict[str, Any]:
    rows = [
        {
            "base": stop.base.tolist(),
            "setpoints": list(stop.setpoints),
            "tolerance": stop.tolerance,
            "criterion": stop.criterion,
        }
        for stop in found
    ]
    return {"world": scene.name, "stops": rows, "stats": parking.stats}


def _lines(found: tuple[Stop, ...]) -> list[str]:
    lines = ["stop  set-points      x [m]     y [m]  yaw [rad]  tolerance [m]"]
    for n, stop in enumerate(found, 1):
        x, y, yaw = stop.base.tolist()
        span = f"{stop.first + 1} to {stop.last + 1}"
        if sorted(stop.setpoints) != list(range(stop.first, stop.last + 1)):
            span = f"{len(stop.setpoints)} of them"
        lines.append(f"{n:4d}  {span:12s} {x:z9.3f} {y:z9.3f} {yaw:z10.3f} {stop.tolerance:14.4f}")
    return lines
