"""The commands that make files of a plan: export, plot, retime."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from regionik.cli.console import LateProgress, check_output, say
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
    check_output(output, reads=[path])
    from regionik.output.export import check_asked
    from regionik.output.export import export as write
    from regionik.output.plan_file import load_plan

    check_asked(kind, output, rate, frame)
    write(load_plan(path), kind, output, rate=rate, frame=frame)
    say(f"wrote {output}")


def plot(
    path: PlanPath,
    output: Annotated[Path, typer.Option("-o", "--output", help="The .svg or .png file to write.")],
) -> None:
    """Draw a plan: joints, speeds and clearance along the way, and the floor."""
    check_output(output, PICTURES, [path])
    with LateProgress() as progress:
        progress("load", 0, 1)
        from regionik.output.plan_file import load_plan
        from regionik.view.figures import plot as draw

        found = load_plan(path)
        progress("load", 1, 1)
        progress("draw", 0, 0)
        draw(found, output)
    say(f"wrote {output}")


def retime(
    path: PlanPath,
    output: Annotated[Path, typer.Option("-o", "--output", help="Write the timed plan here.")],
    base: Annotated[float | None, typer.Option("--base-speed", help="Of the base [m/s].")] = None,
    joints: Annotated[float | None, typer.Option("--joint-speed", help="Of each joint [rad/s].")] = None,
    wheels: Annotated[float | None, typer.Option("--wheel-speed", help="Of either wheel [m/s].")] = None,
    tool: Annotated[float | None, typer.Option("--tool-speed", help="Of the tool at work [m/s].")] = None,
    blend: Annotated[float | None, typer.Option("--blend", help="How far corners are cut [m].")] = None,
    hold: Annotated[bool, typer.Option("--hold", help="Refuse a tool speed that cannot be held.")] = False,
) -> None:
    """Time a plan anew, as fast as its speeds allow; what is not given is the world's, or the robot's."""
    check_output(output)
    with LateProgress() as progress:
        progress("load", 0, 1)
        from regionik.output.plan_file import load_plan
        from regionik.timing.retime import BLEND
        from regionik.timing.retime import retime as time_anew
        from regionik.worlds.speeds import Speeds

        found = load_plan(path)
        progress("load", 1, 1)
        asked = {
            "base_velocity": base, "joint_velocity": joints, "wheel_velocity": wheels, "tool_velocity": tool
        }  # fmt: skip
        given = {key: value for key, value in asked.items() if value is not None}
        speeds = replace(found.world.speeds or Speeds(), **given)
        progress("timing", 0, 0)
        timed = time_anew(found, speeds, blend=BLEND if blend is None else blend, hold=hold)
    timed.save(output)
    told = timed.stats["timing"]
    say(f"{timed.world.name}: {told['duration']:.2f} s, {len(timed.motion)} states")
    if "tool" in told:
        asked_for, held = told["tool"]["asked"], told["tool"]["held"]
        say(f"  the tool holds {asked_for:g} m/s for {held:.0%} of its time on the path")
    say(f"wrote {output}")
