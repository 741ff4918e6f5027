"""``python -m regionik`` is the command ``regionik``; it can be interrupted before the rest is imported."""

from __future__ import annotations

import os
import sys
from io import TextIOWrapper
from typing import NoReturn

from regionik.cli.interrupts import end_on_signals, exit_code, leave, tell


def main() -> NoReturn:
    """Run the command ``regionik`` and leave with its exit code."""
    _open_streams()
    try:
        end_on_signals()
        from regionik.cli.app import main as command

        command()
    except KeyboardInterrupt:
        tell()
        leave(exit_code())


def _open_streams() -> None:
    """Open what the caller has closed: a file of ours must not become stdout, nor a word fail to be said."""
    while (lowest := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(lowest)
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8")
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8")
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # names that the terminal has no letters for


if __name__ == "__main__":
    main()
