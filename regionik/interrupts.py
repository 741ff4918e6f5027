"""Ctrl-C that ends a command, whatever it is in the middle of.

Some libraries swallow a KeyboardInterrupt: at import, or in a callback from a compiler. So the command gets
a second to clean up after itself, and then it ends all the same.
"""

from __future__ import annotations

import os
import signal
import sys
from threading import Event, Timer
from typing import NoReturn

INTERRUPTED = 130
GRACE = 1.0  # [s]
_ASKED = Event()
_SHOW_CURSOR = "\x1b[?25h"  # progress bars hide it


def end_on_interrupt() -> None:
    """From now on Ctrl-C raises KeyboardInterrupt, and ends the process if nobody acts on it."""
    signal.signal(signal.SIGINT, _interrupt)
    sys.unraisablehook = _unraisable


def end_at_leisure() -> None:
    """From now on Ctrl-C raises KeyboardInterrupt, no more."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def leave() -> NoReturn:
    """End the process now, its work undone: an import that Ctrl-C cut short may not let it end by itself."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(INTERRUPTED)


def asked_to_end() -> bool:
    """Whether Ctrl-C was pressed: what fails after that fails because of it."""
    return _ASKED.is_set()


def _interrupt(*_: object) -> None:
    _ASKED.set()
    watchdog = Timer(GRACE, _leave)
    watchdog.daemon = True
    watchdog.start()
    raise KeyboardInterrupt


def _leave() -> None:
    if sys.stderr.isatty():
        sys.stderr.write(_SHOW_CURSOR)
    print("regionik: interrupted", file=sys.stderr, flush=True)
    os._exit(INTERRUPTED)


def _unraisable(what: sys.UnraisableHookArgs) -> None:
    """Say nothing about an interrupt that a callback could not pass on."""
    if not issubclass(what.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(what)
