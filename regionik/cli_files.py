"""The commands that make files of a plan: export, plot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from regionik.console import LateProgress, check_output, say
from regionik.worlds.errors import InputError

EXPORTS = ("csv", "ros2", "joint-trajectory", "path", "geojson", "urdf")
PICTURES = (".svg", ".png")

PlanPath = Annotated[Path, typer.Argument(metavar="PLAN", help="A plan.json.")]


def export(
    path: PlanPath,
    kind: Annotated[str, typer.Option("--format", metavar="|".join(EXPORTS), help="What to write.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The file to write.")],
    rate: Annotated[
        float | None, typer.Option("--rate", metavar="HZ", help="Rows a second, instead of one a state.")
    ] = None,
    frame: Annotated[
        str | None, typer.Option("--frame", metavar="ID", help="Frame of ROS 2 messages, else map.")
    ] = None,
) -> None:
    """Write a plan for other programs: its states, ROS 2 messages, its areas, or its robot.

    joint-trajectory and path are one message each, in YAML or JSON by the ending of the file, as ros2 topic
    pub reads it; ros2 is both in one file.
    """
    if kind not in EXPORTS:
        raise InputError(f"--format: expected one of {', '.join(EXPORTS)}, got {kind!r}")
    check_output(output)
    from regionik.export import check_asked
    from regionik.export import export as write
    from regionik.planfile import load_plan

    check_asked(kind, output, rate, frame)
    write(load_plan(path), kind, output, rate=rate, frame=frame)
    say(f"wrote {output}")


def plot(
    path: PlanPath,
    output: Annotated[Path, typer.Option("-o", "--output", help="The .svg or .png file to write.")],
) -> None:
    """Draw a plan: joints, speeds and clearance along the way, and the floor."""
    check_output(output, PICTURES)
    with LateProgress() as progress:
        progress("load", 0, 1)
        from regionik.planfile import load_plan
        from regionik.plot import plot as draw

        found = load_plan(path)
        progress("load", 1, 1)
        progress("draw", 0, 0)
        draw(found, output)
    say(f"wrote {output}")
