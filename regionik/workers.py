"""Worker processes of this machine: none outlives the process that started it."""

from __future__ import annotations

import os
import signal
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from threading import Thread


def processes(count: int) -> ProcessPoolExecutor:
    """Return a pool of ``count`` worker processes, each with an interpreter of its own."""
    # Forks would share what libraries have started, and unseeded ones would draw alike.
    return ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=_serve)


def _serve() -> None:
    """Leave Ctrl-C to the parent, and end with it: a killed parent cannot say that it is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(0)
