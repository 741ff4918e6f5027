"""The command ``show``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated, Any

import typer

from regionik.cli.console import DelayedProgress, print_message
from regionik.cli.interrupts import INTERRUPTED, exit_code
from regionik.worlds.errors import InputError

if TYPE_CHECKING:
    from regionik.values import Plan
    from regionik.worlds.scene import World


def show(
    what: Annotated[str, typer.Argument(metavar="PLAN|WORLD", help="A plan.json, a world's name or file.")],
    browser: Annotated[bool, typer.Option(help="Open a browser at the address.")] = True,
    live: Annotated[bool, typer.Option("--live", help="Watch a world file; redraw what changes.")] = False,
) -> None:
    """Show a plan or a world in the browser until Ctrl-C."""
    from regionik.view.viewer import show as show_picture

    if live:
        _watch(what, browser)
        return
    with DelayedProgress() as progress:
        progress("load", 0, 1)
        loaded = _plan_or_world(what)
    with _until_interrupted(show_picture(loaded, open_browser=browser)):
        print_message("Ctrl-C ends")
        Event().wait()


def _watch(what: str, browser: bool) -> None:
    """Show what a world file says now, until Ctrl-C."""
    from regionik.view.live import watch
    from regionik.view.viewer import start_server

    path = Path(what)
    if not path.is_file():
        raise InputError(f"{what}: --live watches a world file, and there is no such file")
    visualizer = start_server()
    with _until_interrupted(visualizer):
        if browser:
            visualizer.open()
        watch(path, visualizer, print_message)


@contextmanager
def _until_interrupted(visualizer: Any) -> Iterator[None]:
    """Stop the server at the end; Ctrl-C is the regular end, other signals are not."""
    from regionik.view.viewer import stop

    try:
        yield
    except KeyboardInterrupt:
        if exit_code() != INTERRUPTED:
            raise
    finally:
        stop(visualizer)


def _plan_or_world(what: str) -> Plan | World:
    """Load a plan or a world: a plan has states, a world has none."""
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
