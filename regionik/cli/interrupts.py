"""Ctrl-C and the other ways to be asked to end: a command ends within a second, whatever it is doing.

Some libraries swallow a KeyboardInterrupt, at import or in a callback from a compiler, and none comes while
compiled code is at work. So a thread listens as well: it gives the command a moment to clean up after
itself, and then it ends the process all the same. Compiled kernels let it, as they hold no lock.
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
_asked: list[int] = []  # signals that asked for the end
_raising, _telling = Lock(), Lock()  # who gets them interrupts, and says so; they are never given back
_SHOW_CURSOR = "\x1b[?25h"  # progress bars hide it


def end_on_signals() -> None:
    """From now on Ctrl-C, SIGTERM and SIGHUP raise KeyboardInterrupt, and end the process if nobody acts."""
    listening, heard = os.pipe()
    os.set_blocking(heard, False)
    signal.set_wakeup_fd(heard, warn_on_full_buffer=False)
    Thread(target=_watch, args=(listening,), daemon=True).start()
    for number in _ENDING:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # nohup has it ignored
            signal.signal(number, _interrupt)
    sys.unraisablehook = _unraisable


def asked_to_end() -> bool:
    """Whether the end was asked for: what fails after that fails because of it."""
    return bool(_asked)


def exit_code() -> int:
    """What a command ends with that was asked to end."""
    return 128 + _asked[0] if _asked else INTERRUPTED


def tell() -> None:
    """Say that the command was interrupted, once."""
    if _telling.acquire(blocking=False):
        with suppress(OSError):
            os.write(2, b"regionik: interrupted\n")


def leave(code: int) -> NoReturn:
    """End the process now: an import that was cut short may not let it end by itself.

    What the libraries would do at the end is not waited for; whatever is ours is cleaned up by now.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def _watch(listening: int) -> None:
    """Wait to be asked for the end, give the command a moment, and end it."""
    while (number := os.read(listening, 1)[0]) not in _ENDING:
        pass
    _asked.append(number)
    time.sleep(GRACE)
    if sys.stderr.isatty():
        os.write(2, _SHOW_CURSOR.encode())
    tell()
    os._exit(exit_code())


def _interrupt(number: int, _: object) -> None:
    """Raise once: who asks again is not to disturb the cleaning up."""
    _asked.append(number)
    if _raising.acquire(blocking=False):
        raise KeyboardInterrupt


def _unraisable(what: sys.UnraisableHookArgs) -> None:
    """Say nothing about an interrupt that a callback could not pass on."""
    if not issubclass(what.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(what)
