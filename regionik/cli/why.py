"""The command ``why``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from regionik.cli.console import LateProgress, check_output, print_json, refusal, say
from regionik.cli.shared import NO, AsJson, WorldName
from regionik.worlds.errors import Explanation, InputError

if TYPE_CHECKING:
    from regionik.worlds.scene import Target, World


def why(
    world: WorldName,
    target: Annotated[
        list[str] | None, typer.Option("--target", metavar="X Y Z", help="A target [m]; else the whole path.")
    ] = None,
    html: Annotated[
        Path | None, typer.Option("--html", help="Write an offline page of what stands in the way.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Say why a target or the path of WORLD is out of reach, and the smallest changes that would mend it.

    Each change was made and asked for again. The exit code is 1 where something stands in the way.
    """
    check_output(html, reads=[world])
    with LateProgress() as progress:
        if len(target or []) > 1:
            raise InputError(f"--target: expected one target, got {len(target or [])}")
        progress("load", 0, 1)
        from regionik.output.answers import targets_asked
        from regionik.pipeline import why as ask
        from regionik.worlds.library import load_world

        scene = load_world(world)
        progress("load", 1, 1)
        progress("why", 0, 0)
        asked = targets_asked(scene, target, None)[0] if target else None
        found = ask(scene, asked)
    if html is not None:
        _draw(scene, asked, found, html)
    if as_json:
        print_json({"ok": True} if found is None else refusal(found))
    if found is None:
        say(f"{scene.name}: nothing stands in the way")
        return
    say(found.reason)
    for repair in found.repairs[1:]:
        say(f"  or: {repair.text}")
    raise typer.Exit(NO)


def _draw(world: World, target: Target | None, found: Explanation | None, path: Path) -> None:
    """Write the page."""
    from regionik.view.explanation_picture import picture_of_why
    from regionik.view.viewer import to_html

    to_html(world if found is None else picture_of_why(world, found, target), path)
    say(f"wrote {path}")
