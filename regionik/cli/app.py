"""The command line: parse, call, print.

Exit codes: 0 done; 1 the answer is no, explained; 2 the input is wrong, one line; 3 an engine failed, one
line; 130 interrupted (143 by SIGTERM). Whatever is heavy is imported inside the command that needs it, so
that help comes at once.
"""

from __future__ import annotations

import errno
import os
import select
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from regionik import __version__
from regionik.cli.compare import compare
from regionik.cli.console import (
    LateProgress,
    check_output,
    complain,
    failure,
    plan_summary,
    print_json,
    print_worlds,
    report_document,
    report_summary,
    say,
)
from regionik.cli.field import field
from regionik.cli.files import PlanPath, export, plot, retime
from regionik.cli.interrupts import INTERRUPTED, asked_to_end, exit_code, leave, tell
from regionik.cli.reach import reach
from regionik.cli.shared import DONE, NO, AsJson, WorldName, explained
from regionik.cli.stops import stops
from regionik.cli.why import why
from regionik.worlds.errors import InputError, RegionikError

if TYPE_CHECKING:
    from regionik.values import Plan
    from regionik.worlds.scene import World

WRONG_INPUT, ENGINE_FAILED = 2, 3
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # on stdout: files say so themselves

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Exact base areas and whole-path planning for mobile manipulators.",
    epilog="Exit codes: 0 done; 1 the answer is no, explained; 2 the input is wrong; 3 a library failed; "
    "130 interrupted.",
)


def main() -> NoReturn:
    """Run the command of this process and leave with its exit code."""
    warnings.showwarning = lambda message, *_: complain(f"note: {message}")
    leave(run(sys.argv[1:]))


def run(arguments: Sequence[str]) -> int:
    """Run one command and return its exit code; whatever goes wrong becomes words, never a traceback."""
    try:
        code = app(args=_fold_targets(arguments), prog_name="regionik", standalone_mode=False)
        sys.stdout.flush()
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED
    except typer.TyperException as error:
        complain(f"{error.format_message()} (regionik --help lists what there is)")
        return WRONG_INPUT
    except InputError as error:
        complain(str(error))
        return WRONG_INPUT
    except (SystemExit, OSError) as error:
        return _without_output(error)
    except Exception as error:
        if not asked_to_end():
            complain(str(error) if isinstance(error, RegionikError) else failure(error))
            return ENGINE_FAILED
        code = INTERRUPTED  # an import that was cut short fails when it is tried again
    if code != INTERRUPTED:
        return int(code or DONE)
    tell()
    return exit_code()


def _without_output(error: BaseException) -> int:
    """End a command that could not write on stdout: its reader has left, as in ``| head -1``, or no room is.

    Typer makes a broken pipe a SystemExit. What failed elsewhere is a failure as any other.
    """
    cause = error.__context__ if isinstance(error, SystemExit) else error
    left = isinstance(cause, BrokenPipeError) and _reader_left()
    if not left and getattr(cause, "errno", None) not in NO_ROOM:
        complain(failure(cause))
        return ENGINE_FAILED
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    if left:
        return DONE
    complain(f"stdout: cannot be written: {cause}")
    return WRONG_INPUT


def _reader_left() -> bool:
    stdout = select.poll()
    stdout.register(1, 0)
    return bool(stdout.poll(0))


def _fold_targets(arguments: Sequence[str]) -> list[str]:
    """Join the three numbers after each ``--target`` to one value: typer has no repeated options of three."""
    folded: list[str] = []
    rest = list(arguments)
    while rest:
        word = rest.pop(0)
        folded.append(word)
        if word == "--target":
            folded.append(" ".join(rest[:3]))
            del rest[:3]
    return folded


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and leave.")] = False,
) -> None:
    if version:
        print(f"regionik {__version__}")
        raise typer.Exit(DONE)
    if context.invoked_subcommand is None:
        print(context.get_help())


@app.command()
def worlds(as_json: AsJson = False) -> None:
    """List the bundled worlds."""
    from regionik.worlds.bundled import world_names
    from regionik.worlds.documents.world_file import load_world

    rows = [(name, load_world(name).about) for name in world_names()]
    if as_json:
        print_json({"ok": True, "worlds": [{"name": name, "about": about} for name, about in rows]})
    else:
        print_worlds(rows)


@app.command()
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
    with LateProgress() as progress, explained(as_json):
        found = _planned(world, seed, progress)
        seconds = time.monotonic() - began
        written = _write_plan(found, output, html, progress)
    say(plan_summary(found, seconds, written))
    if as_json:
        files = [str(path) for path in written]
        print_json({"ok": True, **_key_figures(found), "stats": found.stats, "files": files})


def _planned(world: str, seed: int, progress: LateProgress) -> Plan:
    progress("load", 0, 1)
    from regionik.pipeline import plan as plan_world
    from regionik.worlds.documents.world_file import load_world

    scene = load_world(world)
    progress("load", 1, 1)
    return plan_world(scene, seed=seed, progress=progress)


def _write_plan(found: Plan, output: Path | None, html: Path | None, progress: LateProgress) -> list[Path]:
    """Make all that is to be written, then write it: who interrupts before finds no file at all."""
    from regionik.storage.files import write_whole

    contents: dict[Path, str] = {}
    if output is not None:
        progress("write", 0, 2)
        from regionik.storage.plan_document import plan_to_text

        contents[output] = plan_to_text(found)
    if html is not None:
        progress("write", 1, 2)
        from regionik.view.viewer import page_of

        contents[html] = page_of(found)
    progress("write", 2, 2)
    for path, content in contents.items():
        write_whole(path, content)
    return list(contents)


def _key_figures(found: Plan) -> dict[str, Any]:
    return {
        "world": found.world.name,
        "seed": found.seed,
        "setpoints": len(found.setpoints),
        "states": len(found.motion),
        "lift_offs": found.lift_offs,
    }


app.command()(reach)
app.command()(compare)
app.command()(stops)
app.command()(field)


@app.command()
def verify(path: PlanPath, as_json: AsJson = False) -> None:
    """Check a plan again from its world alone; exit code 1 and the violations if it does not hold."""
    with LateProgress() as progress:
        progress("load", 0, 1)
        from regionik.output.plan_file import load_plan
        from regionik.verification.verifier import verify as check

        found = load_plan(path)
        progress("load", 1, 1)
        progress("verify", 0, 0)
        report = check(found)
    say(report_summary(str(path), report))
    if as_json:
        print_json(report_document(report))
    if not report.ok:
        raise typer.Exit(NO)


@app.command()
def show(
    what: Annotated[str, typer.Argument(metavar="PLAN|WORLD", help="A plan.json, a world's name or file.")],
    browser: Annotated[bool, typer.Option(help="Open a browser at the address.")] = True,
    live: Annotated[bool, typer.Option("--live", help="Watch a world file; draw anew what changes.")] = False,
) -> None:
    """Show a plan or a world in the browser until Ctrl-C."""
    from regionik.view.viewer import show as open_view
    from regionik.view.viewer import stop

    if live:
        _follow(what, browser)
        return
    with LateProgress() as progress:
        progress("load", 0, 1)
        seen = _plan_or_world(what)
    visualizer = open_view(seen, open_browser=browser)
    try:
        say("Ctrl-C ends")
        Event().wait()
    except KeyboardInterrupt:
        if exit_code() != INTERRUPTED:  # Ctrl-C is how it is meant to end
            raise
    finally:
        stop(visualizer)


def _follow(what: str, browser: bool) -> None:
    """Show what a world file says now, until Ctrl-C."""
    from regionik.view.live import follow
    from regionik.view.viewer import blank, stop

    path = Path(what)
    if not path.is_file():
        raise InputError(f"{what}: --live watches a world file, and there is no such file")
    visualizer = blank()
    try:
        if browser:
            visualizer.open()
        follow(path, visualizer, say)
    except KeyboardInterrupt:
        if exit_code() != INTERRUPTED:  # Ctrl-C is how it is meant to end
            raise
    finally:
        stop(visualizer)


def _plan_or_world(what: str) -> Plan | World:
    """Load what a file holds: a plan has states, a world has none."""
    import json

    from regionik.output.plan_file import load_plan
    from regionik.worlds.documents.world_file import load_world

    if what.endswith(".json") and Path(what).is_file():
        try:
            document = json.loads(Path(what).read_bytes())
        except (ValueError, RecursionError):
            document = None  # the loader below says what is wrong with it
        if isinstance(document, dict) and "states" in document:
            return load_plan(what)
    return load_world(what)


app.command()(export)
app.command()(plot)
app.command()(retime)
app.command()(why)
