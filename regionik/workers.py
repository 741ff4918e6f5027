"""Worker processes of this machine: none outlives the process that started it."""

from __future__ import annotations

import os
import signal
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import connection, parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Thread

# What a run that was ended leaves of its pool is freed by the tracker that comes with it; it need not say so.
_HUSHED = "ignore:resource_tracker:UserWarning"


class _Sheltered(SpawnProcess):
    """A process that Ctrl-C on the terminal does not reach, not even while its imports run."""

    def start(self) -> None:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # the child inherits it
        try:
            super().start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Sheltering(SpawnContext):
    Process = _Sheltered


def processes(count: int) -> ProcessPoolExecutor:
    """Return a pool of ``count`` worker processes, each with an interpreter of its own."""
    if _HUSHED not in sys.warnoptions:
        sys.warnoptions.append(_HUSHED)  # the tracker is started with these
    # Forks would share what libraries have started, and unseeded ones would draw alike.
    return ProcessPoolExecutor(count, mp_context=_Sheltering(), initializer=_serve)


def _serve() -> None:
    """End with the parent: when it is killed it cannot say that it is gone."""
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(0)
