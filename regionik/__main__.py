"""``python -m regionik`` is the command ``regionik``; it can be interrupted before the rest is imported."""

from __future__ import annotations

import os
import sys
from io import TextIOWrapper
from typing import NoReturn

from regionik.cli.interrupts import end_process, exit_code, install_handlers, print_interrupted


def main() -> NoReturn:
    """Run the command ``regionik`` and leave with its exit code."""
    _open_streams()
    try:
        install_handlers()
        from regionik.cli.app import run_process

        run_process()
    except KeyboardInterrupt:
        print_interrupted()
        end_process(exit_code())


def _open_streams() -> None:
    """Open streams that the caller has closed: no file of ours may become stdout, and no message may fail."""
    while (lowest := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(lowest)
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8")
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8")
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # names that the terminal cannot encode


if __name__ == "__main__":
    main()
