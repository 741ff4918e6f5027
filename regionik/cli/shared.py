"""What commands share: the world they ask for, ``--json``, and a no that is explained."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

from regionik.cli.console import print_json, refusal, say
from regionik.worlds.errors import NoPlanFound

DONE, NO = 0, 1

WorldName = Annotated[str, typer.Argument(metavar="WORLD", help="A bundled world's name, or a world file.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document, and only it, on stdout.")]


@contextmanager
def explained(as_json: bool) -> Iterator[None]:
    """Turn a `NoPlanFound` into its paragraph, its document if asked for, and exit code 1."""
    try:
        yield
    except NoPlanFound as no:
        say(no.explanation.reason)
        if as_json:
            print_json(refusal(no.explanation))
        raise typer.Exit(NO) from None
