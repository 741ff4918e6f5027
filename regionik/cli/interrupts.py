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
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Lock, Thread
from typing import NoReturn

from regionik.cli.exit_codes import ExitCode

CLEANUP_TIME = 0.6  # [s]
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_received: list[int] = []  # signals
_raising, _printing = Lock(), Lock()  # taken once, to raise and to print, and never released
_descriptions: list[Callable[[], str]] = []  # of what an interrupt stops
_stopped: list[str] = []  # what it stopped, as that was when it came
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
    return 128 + _received[0] if _received else ExitCode.INTERRUPTED


@contextmanager
def described(describe: Callable[[], str]) -> Iterator[None]:
    """Have an interrupt of the block described by a function, called when it happens."""
    _descriptions.append(describe)
    try:
        yield
    except KeyboardInterrupt:
        print_interrupted()
        raise
    finally:
        _descriptions.remove(describe)


def print_interrupted() -> None:
    """Print once that the command was interrupted, and where."""
    if _printing.acquire(blocking=False):
        _describe()
        with suppress(OSError):
            os.write(2, f"regionik: interrupted{_stopped[0]}\n".encode())


def _describe() -> None:
    """Note what the work is at, before an exception ends its stages."""
    _stopped.append("".join(describe() for describe in _descriptions[-1:]))


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
    _describe()
    _received.append(number)
    time.sleep(CLEANUP_TIME)
    if sys.stderr.isatty():
        os.write(2, _SHOW_CURSOR.encode())
    print_interrupted()
    os._exit(exit_code())


def _interrupt(number: int, _: object) -> None:
    """Raise once: a second signal must not disturb the cleanup."""
    _describe()
    _received.append(number)
    if _raising.acquire(blocking=False):
        raise KeyboardInterrupt


def _unraisable(raised: sys.UnraisableHookArgs) -> None:
    """Keep silent about an interrupt that a callback could not pass on."""
    if not issubclass(raised.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(raised)
