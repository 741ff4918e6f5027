"""Commands on worlds and plans: worlds, plan, verify, retime, export, plot, show, warm-up."""

from __future__ import annotations

import json
import time
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated, Any

import typer

from regionik.cli.console import (
    PAGES,
    AsJson,
    DelayedProgress,
    PlanPath,
    Skip,
    WorldName,
    check_output,
    explain_no_plan,
    file_names,
    held_line,
    plan_summary,
    print_json,
    print_message,
    read_plan,
    read_world,
    read_world_to_plan,
    report_document,
    report_summary,
    skipping,
)
from regionik.cli.exit_codes import ExitCode
from regionik.cli.interrupts import exit_code
from regionik.cli.options import COMMANDS
from regionik.worlds.errors import InputError

if TYPE_CHECKING:
    from regionik.values import Plan
    from regionik.worlds.scene import World


EXPORT_FORMATS = ("csv", "ros2", "joint-trajectory", "path", "ros2-folder", "geojson", "urdf")
PICTURES = (".svg", ".png")
PLANS = (".json",)
VIEWS = (".html", ".gif", ".mp4")
_NOTHING = "nothing is written"


def list_worlds(as_json: AsJson = False) -> None:
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


def plan_world(
    world: WorldName,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="File for the plan.")] = None,
    html: Annotated[Path | None, typer.Option("--html", help="File for an offline page of it.")] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, max=2**31 - 1, help="Same seed, same plan.")] = 0,
    skip: Skip = False,
    no_smooth: Annotated[
        bool,
        typer.Option(
            "--no-smooth", help="Keep M-FABRIK's configurations as found, and the base's way to them."
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Plan the whole tool path of WORLD and verify the plan."""
    check_output(output, PLANS, [world])
    check_output(html, PAGES, [world])
    if output is not None and html is not None and output.resolve() == html.resolve():
        raise InputError(f"{html}: the plan and the page need two different files")
    began = time.monotonic()
    with DelayedProgress("plan", _NOTHING) as progress, explain_no_plan(as_json, progress):
        loaded = skipping(read_world_to_plan(world, progress), skip)
        if no_smooth:
            loaded = replace(loaded, rules=replace(loaded.rules, smooth=False))
        from regionik.pipeline import plan

        found = plan(loaded, seed=seed, say=progress.say if progress.shown and not as_json else None)
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
        from regionik.storage.plan_document import skipped_document

        out = {"stats": found.stats, "skipped": skipped_document(found.skipped)}
        print_json({"ok": True, **figures, **out, "files": file_names(written)})


def _write_plan(
    planned: Plan, output: Path | None, html: Path | None, progress: DelayedProgress
) -> list[Path]:
    """Make the contents of all files before any is written: an interrupt before that leaves none."""
    from regionik.storage.files import write_atomic

    contents: dict[Path, str] = {}
    if output is not None:
        progress("write", 0, 2)
        from regionik.storage.plan_document import plan_to_text

        contents[output] = plan_to_text(planned)
    if html is not None:
        progress("write", 1, 2)
        from regionik.view.page import html_page

        contents[html] = html_page(planned)
    progress("write", 2, 2)
    for path, content in contents.items():
        write_atomic(path, content)
    return list(contents)


def verify_plan(
    path: PlanPath,
    world: Annotated[
        str | None,
        typer.Option("--world", metavar="WORLD", help="A world that the plan's own must agree with."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Check a plan again, from its world alone.

    The exit code is 1 if the plan does not hold, and its violations are listed. With --world it is also
    listed in what the plan's world differs from that one.
    """
    with DelayedProgress("verify") as progress:
        found = read_plan(path, progress)
        outside = None if world is None else read_world(world, progress)
        from regionik.area_verification import verify_areas
        from regionik.verification.verifier import verify

        checked = verify(found, outside)
        areas = verify_areas(found)
        ok, violations = checked.ok and areas.ok, checked.violations + areas.violations
        report = replace(checked, ok=ok, violations=violations)
    print_message(report_summary(str(path), report, found))
    if as_json:
        print_json(report_document(report, found))
    if not report.ok:
        raise typer.Exit(ExitCode.NO)


def retime_plan(
    path: PlanPath,
    output: Annotated[Path, typer.Option("-o", "--output", help="File for the timed plan.")],
    base: Annotated[float | None, typer.Option("--base-speed", help="Of the base [m/s].")] = None,
    joints: Annotated[float | None, typer.Option("--joint-speed", help="Of each joint [rad/s].")] = None,
    wheels: Annotated[float | None, typer.Option("--wheel-speed", help="Of either wheel [m/s].")] = None,
    tool: Annotated[float | None, typer.Option("--tool-speed", help="Of the tool at work [m/s].")] = None,
    base_jerk: Annotated[float | None, typer.Option("--base-jerk", help="Of the base [m/s3].")] = None,
    turn_jerk: Annotated[float | None, typer.Option("--turn-jerk", help="Of its heading [rad/s3].")] = None,
    joint_jerk: Annotated[float | None, typer.Option("--joint-jerk", help="Of each joint [rad/s3].")] = None,
    blend: Annotated[float | None, typer.Option("--blend", help="How far corners are cut [m].")] = None,
    hold: Annotated[bool, typer.Option("--hold", help="Refuse a tool speed that cannot be held.")] = False,
    optimise: Annotated[bool, typer.Option("--optimise", help="Optimise the motion for time.")] = False,
) -> None:
    """Time a plan, as fast as its speeds allow.

    Speeds that are not given are the world's, or the robot's. With --optimise the motion itself is changed,
    base and arm together, over the same set-points and lift-offs: it takes longer to find, and less to drive.
    """
    check_output(output, PLANS)
    with DelayedProgress("retime") as progress:
        found = read_plan(path, progress)
        from regionik.timing.retime import retime
        from regionik.worlds.limits import Speeds

        options = {
            "base_velocity": base, "joint_velocity": joints, "wheel_velocity": wheels, "tool_velocity": tool,
            "base_jerk": base_jerk, "turn_jerk": turn_jerk, "joint_jerk": joint_jerk,
            "blend": blend,
        }  # fmt: skip
        given = {key: value for key, value in options.items() if value is not None}
        speeds = replace(found.world.speeds or Speeds(), **given)
        timed = retime(found, speeds, hold=hold, optimise=optimise)
    timed.save(output)
    print_message(f"{timed.world.name}: {timed.motion.time[-1]:.2f} s, {len(timed.motion)} states")
    if "tool" in timed.stats["timing"]:
        _print_constant_speed(timed.stats["timing"]["tool"])
    print_message(f"wrote {output}")


def _print_constant_speed(tool: dict[str, Any]) -> None:
    """Print for what share of its time the tool holds its speed, and what keeps it from it where."""
    print_message(held_line(tool))
    corners = len(tool["corners"])
    beside = f"its ends and {corners} sharp corner{'s'[: corners != 1]}" if corners else "its ends"
    print_message(f"  and for {tool['held_elsewhere']:.0%} away from {beside}")
    on_path = (one for one in tool["places"] if one["at"] == "path")
    long = [one for one in on_path if one["to"] - one["from"] > COMMANDS.min_slow_time]
    for place in long[: COMMANDS.max_slow_places]:
        limit = place["by"].replace("_", " ", 1)
        print_message(
            f"  down to {place['least']:.3g} m/s from {place['from']:.2f} to {place['to']:.2f} s, "
            f"at set-point {place['setpoint'] + 1}: {limit}"
        )


def export_plan(
    path: PlanPath,
    kind: Annotated[str, typer.Option("--format", metavar="|".join(EXPORT_FORMATS), help="The format.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write.")],
    rate: Annotated[
        float | None, typer.Option("--rate", metavar="HZ", help="Rows per second, instead of one per state.")
    ] = None,
    frame: Annotated[
        str | None, typer.Option("--frame", metavar="ID", help="Frame of ROS 2 messages, by default map.")
    ] = None,
) -> None:
    """Write a plan in a format of other programs.

    csv has a row per state, geojson the areas, urdf the robot. joint-trajectory and path are one message
    each, in YAML or JSON by the ending of the file, as ros2 topic pub reads it; ros2 is both in one file, and
    ros2-folder a new folder with all that a ROS 2 user needs, a script that executes the plan among it.
    """
    if kind not in EXPORT_FORMATS:
        raise InputError(f"--format: expected one of {', '.join(EXPORT_FORMATS)}, got {kind!r}")
    if kind != "ros2-folder":
        check_output(output, reads=[path])
    from regionik.output.export import check_options, export
    from regionik.output.plan_file import load_plan

    frame = frame and file_names([frame])[0]
    check_options(kind, output, rate, frame)
    export(load_plan(path), output, kind, rate=rate, frame=frame)
    print_message(f"wrote {output}")


def plot_plan(
    path: PlanPath, output: Annotated[Path, typer.Option("-o", "--output", help="An .svg or .png file.")]
) -> None:
    """Draw joints, speeds, clearance and floor of a plan."""
    check_output(output, PICTURES, [path])
    with DelayedProgress("plot") as progress:
        found = read_plan(path, progress)
        from regionik.view.figures import plot

        plot(found, output)
    print_message(f"wrote {output}")


def show_scene(
    what: Annotated[str, typer.Argument(metavar="PLAN|WORLD", help="A plan.json, a world's name or file.")],
    browser: Annotated[bool, typer.Option(help="Open a browser at the address.")] = True,
    live: Annotated[bool, typer.Option("--live", help="Watch a world file; redraw changes.")] = False,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write an offline .html page, or a .gif or .mp4 film, instead."),
    ] = None,
) -> None:
    """Show a plan or a world in the browser until Ctrl-C, or write a page or a film of it."""
    if output is not None:
        _write_view(what, output, live)
        return
    if live:
        _watch(what, browser)
        return
    with DelayedProgress("show") as progress:
        loaded = _plan_or_world(what, progress)
        from regionik.view.page import html_page, served

        page = html_page(loaded)
    with _until_interrupted(), served(page) as address:
        print(f"You can open the page by visiting the following URL:\n{address}", flush=True)
        if browser:
            webbrowser.open(address)
        print_message("Ctrl-C ends it")
        Event().wait()


def _write_view(what: str, output: Path, live: bool) -> None:
    """Write the page of a plan or a world, or a film of a plan."""
    if live:
        raise InputError("--live watches a world file and writes none, expected it without --output")
    check_output(output, VIEWS, [what])
    with DelayedProgress("show") as progress:
        loaded = _plan_or_world(what, progress)
        from regionik.view.page import html_page, to_html

        if output.suffix.lower() == ".html":
            to_html(loaded, output)
        else:
            from regionik.values import Plan
            from regionik.view.film import film

            if not isinstance(loaded, Plan):
                raise InputError(f"{what}: expected a plan to film, this is a world; an .html page shows it")
            film(html_page(loaded), output)
    size = output.stat().st_size / 1e6
    print_message(f"wrote {output}" + (f", {size:.1f} MB" if size > COMMANDS.min_told_size else ""))


def _watch(what: str, browser: bool) -> None:
    """Show what a world file says now, until Ctrl-C."""
    from regionik.view.live import watch
    from regionik.view.viewer import start_server, stop

    path = Path(what)
    if not path.is_file():
        raise InputError(f"{what}: --live watches a world file, and there is no such file")
    visualizer = start_server()
    try:
        with _until_interrupted():
            if browser:
                visualizer.open()
            watch(path, visualizer, print_message)
    finally:
        stop(visualizer)


@contextmanager
def _until_interrupted() -> Iterator[None]:
    """End with the block; Ctrl-C is the regular end, other signals are not."""
    try:
        yield
    except KeyboardInterrupt:
        if exit_code() != ExitCode.INTERRUPTED:
            raise


def _plan_or_world(what: str, progress: DelayedProgress) -> Plan | World:
    """Load a plan or a world: a plan has states, a world has none."""
    if what.endswith(".json") and Path(what).is_file():
        try:
            document = json.loads(Path(what).read_bytes())
        except (ValueError, RecursionError):
            document = None  # the loader below says what is wrong with it
        if isinstance(document, dict) and "states" in document:
            return read_plan(Path(what), progress)
    return read_world(what, progress)


def warm_up() -> None:
    """Compile the kernels for this machine, so that no later command has to.

    It plans the bundled worlds and asks for their set-points. Without it a kernel is compiled once plain
    Python has worked on it for long. What is done is kept when Ctrl-C ends it.
    """
    from regionik.pipeline import plan
    from regionik.planners.kernels import cache_folder, compiled_at_once
    from regionik.reachability.reach import reach
    from regionik.worlds.bundled import world_names
    from regionik.worlds.documents.world_file import load_world

    if cache_folder() is None:
        raise InputError("compiled kernels can be kept nowhere: set NUMBA_CACHE_DIR to a folder to write")
    names, heard, began = world_names(), list[str](), time.monotonic()
    with DelayedProgress("warm-up", "what is compiled is kept") as progress, compiled_at_once(heard.append):
        for k, name in enumerate(names):
            progress("worlds", k, len(names))
            world = load_world(name)
            plan(world)
            reach(world, world.task)
            seconds = time.monotonic() - began
            print_message(f"{k + 1} of {len(names)}: {name}, {len(heard)} kernels in {seconds:.0f} s")
    print_message(f"kept in {cache_folder()}")
