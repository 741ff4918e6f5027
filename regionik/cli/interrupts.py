"""Ctrl-C and termination signals: a command ends within a second, whatever it is doing.

Some libraries swallow a KeyboardInterrupt, at import or in a callback from a compiler, and none is raised
while compiled code runs. So a thread listens as well: it gives the command a moment to clean up, then ends
the process anyway. Compiled kernels allow it, as they release the GIL.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from contextlib import suppress
from threading import Lock, Thread
from typing import NoReturn

INTERRUPTED = 130  # exit code after Ctrl-C; after signal n it is 128 + n, as shells have it
GRACE = 0.6  # [s]
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_received: list[int] = []  # signals
_raising, _printing = Lock(), Lock()  # taken once, to raise and to print, and never released
_SHOW_CURSOR = "\x1b[?25h"  # progress bars hide it


def install_handlers() -> None:
    """Let Ctrl-C, SIGTERM and SIGHUP raise KeyboardInterrupt, and end the process if that has no effect."""
    listening, heard = os.pipe()
    os.set_blocking(heard, False)
    signal.set_wakeup_fd(heard, warn_on_full_buffer=False)
    Thread(target=_listen, args=(listening,), daemon=True).start()
    for number in _ENDING:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # nohup has it ignored
            signal.signal(number, _interrupt)
    sys.unraisablehook = _unraisable


def is_interrupted() -> bool:
    """Return whether a signal was received: errors after that are its consequence."""
    return bool(_received)


def exit_code() -> int:
    """Return the exit code of an interrupted command."""
    return 128 + _received[0] if _received else INTERRUPTED


def print_interrupted() -> None:
    """Print once that the command was interrupted."""
    if _printing.acquire(blocking=False):
        with suppress(OSError):
            os.write(2, b"regionik: interrupted\n")


def end_process(code: int) -> NoReturn:
    """End the process now, for an interrupted import may keep it from ending by itself.

    Exit handlers of libraries are skipped; our own files and processes are cleaned up by now.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def _listen(listening: int) -> None:
    """Wait for a signal, give the command a moment, and end it."""
    while (number := os.read(listening, 1)[0]) not in _ENDING:
        pass
    _received.append(number)
    time.sleep(GRACE)
    if sys.stderr.isatty():
        os.write(2, _SHOW_CURSOR.encode())
    print_interrupted()
    os._exit(exit_code())


def _interrupt(number: int, _: object) -> None:
    """Raise once: a second signal must not disturb the cleanup."""
    _received.append(number)
    if _raising.acquire(blocking=False):
        raise KeyboardInterrupt


def _unraisable(raised: sys.UnraisableHookArgs) -> None:
    """Keep silent about an interrupt that a callback could not pass on."""
    if not issubclass(raised.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(raised)
