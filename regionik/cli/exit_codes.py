"""What commands end with."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit code of a command."""

    DONE = 0
    NO = 1  # to what was asked, with an explanation
    WRONG_INPUT = 2
    ENGINE_FAILED = 3  # a library
    INTERRUPTED = 130  # by Ctrl-C; after signal n it is 128 + n, as shells have it
