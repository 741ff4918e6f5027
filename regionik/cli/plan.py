"""The commands that make, check and convert plans: worlds, plan, verify, retime, export, plot."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from regionik.cli.console import (
    NO,
    AsJson,
    DelayedProgress,
    PlanPath,
    WorldName,
    check_output,
    explain_no_plan,
    plan_summary,
    print_json,
    print_message,
    read_plan,
    read_world,
    report_document,
    report_summary,
)
from regionik.worlds.errors import InputError

if TYPE_CHECKING:
    from regionik.values import Plan

EXPORT_FORMATS = ("csv", "ros2", "joint-trajectory", "path", "geojson", "urdf")
PICTURES = (".svg", ".png")


def worlds(as_json: AsJson = False) -> None:
    """List the bundled worlds."""
    from regionik.worlds.bundled import world_names
    from regionik.worlds.documents.world_file import load_world

    rows = [(name, load_world(name).about) for name in world_names()]
    if as_json:
        print_json({"ok": True, "worlds": [{"name": name, "about": about} for name, about in rows]})
    else:
        width = max(len(name) for name, _ in rows)
        for name, about in rows:
            print(f"{name:<{width}}  {about}")


def plan(
    world: WorldName,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Write the plan here.")] = None,
    html: Annotated[Path | None, typer.Option("--html", help="Write an offline page of it here.")] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, max=2**31 - 1, help="Same seed, same plan.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Plan the whole tool path of WORLD and verify the plan."""
    for path in (output, html):
        check_output(path, reads=[world])
    if output is not None and html is not None and output.resolve() == html.resolve():
        raise InputError(f"{html}: the plan and the page need two different files")
    began = time.monotonic()
    with DelayedProgress() as progress, explain_no_plan(as_json):
        scene = read_world(world, progress)
        from regionik.pipeline import plan as plan_world

        found = plan_world(scene, seed=seed, progress=progress)
        seconds = time.monotonic() - began
        written = _write_plan(found, output, html, progress)
    print_message(plan_summary(found, seconds, written))
    if as_json:
        figures = {
            "world": found.world.name,
            "seed": found.seed,
            "setpoints": len(found.setpoints),
            "states": len(found.motion),
            "lift_offs": found.lift_offs,
        }
        print_json({"ok": True, **figures, "stats": found.stats, "files": [str(path) for path in written]})


def _write_plan(found: Plan, output: Path | None, html: Path | None, progress: DelayedProgress) -> list[Path]:
    """Make the contents of all files before any is written: an interrupt before that leaves none."""
    from regionik.storage.files import write_atomic

    contents: dict[Path, str] = {}
    if output is not None:
        progress("write", 0, 2)
        from regionik.storage.plan_document import plan_to_text

        contents[output] = plan_to_text(found)
    if html is not None:
        progress("write", 1, 2)
        from regionik.view.html_page import html_page

        contents[html] = html_page(found)
    progress("write", 2, 2)
    for path, content in contents.items():
        write_atomic(path, content)
    return list(contents)


def verify(path: PlanPath, as_json: AsJson = False) -> None:
    """Check a plan again from its world alone; exit code 1 and the violations if it does not hold."""
    with DelayedProgress() as progress:
        found = read_plan(path, progress)
        progress("verify", 0, 0)
        from regionik.area_verification import verify_areas
        from regionik.verification.verifier import verify as check

        checked = check(found)
        progress("areas", 0, 0)
        areas = verify_areas(found)
        ok, violations = checked.ok and areas.ok, checked.violations + areas.violations
        report = replace(checked, ok=ok, violations=violations)
    print_message(report_summary(str(path), report))
    if as_json:
        print_json(report_document(report))
    if not report.ok:
        raise typer.Exit(NO)


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
    """Time a plan, as fast as its speeds allow; those not given are the world's, or the robot's."""
    check_output(output)
    with DelayedProgress() as progress:
        found = read_plan(path, progress)
        progress("timing", 0, 0)
        from regionik.timing.retime import BLEND
        from regionik.timing.retime import retime as retime_plan
        from regionik.worlds.speeds import Speeds

        options = {
            "base_velocity": base, "joint_velocity": joints, "wheel_velocity": wheels, "tool_velocity": tool
        }  # fmt: skip
        given = {key: value for key, value in options.items() if value is not None}
        speeds = replace(found.world.speeds or Speeds(), **given)
        timed = retime_plan(found, speeds, blend=BLEND if blend is None else blend, hold=hold)
    timed.save(output)
    timing = timed.stats["timing"]
    print_message(f"{timed.world.name}: {timing['duration']:.2f} s, {len(timed.motion)} states")
    if "tool" in timing:
        speed, share = timing["tool"]["asked"], timing["tool"]["held"]
        print_message(f"  the tool holds {speed:g} m/s for {share:.0%} of its time on the path")
    print_message(f"wrote {output}")


def export(
    path: PlanPath,
    kind: Annotated[str, typer.Option("--format", metavar="|".join(EXPORT_FORMATS), help="What to write.")],
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
    if kind not in EXPORT_FORMATS:
        raise InputError(f"--format: expected one of {', '.join(EXPORT_FORMATS)}, got {kind!r}")
    check_output(output, reads=[path])
    from regionik.output.export import check_options
    from regionik.output.export import export as export_plan
    from regionik.output.plan_file import load_plan

    check_options(kind, output, rate, frame)
    export_plan(load_plan(path), output, kind, rate=rate, frame=frame)
    print_message(f"wrote {output}")


def plot(
    path: PlanPath,
    output: Annotated[Path, typer.Option("-o", "--output", help="The .svg or .png file to write.")],
) -> None:
    """Draw a plan: joints, speeds and clearance along the way, and the floor."""
    check_output(output, PICTURES, [path])
    with DelayedProgress() as progress:
        found = read_plan(path, progress)
        progress("draw", 0, 0)
        from regionik.view.figures import plot as draw

        draw(found, output)
    print_message(f"wrote {output}")
