"""Calls in processes of their own, each ended when it has taken too much of the processor."""

from __future__ import annotations

import signal
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

TRIES = 2  # of a call that was ended: the first may have compiled kernels, which are kept


@dataclass(frozen=True)
class Ended:
    """What comes of a call whose process ended."""

    overtime: bool
    exit_code: int | None


@dataclass(frozen=True, eq=False)
class _Worker:
    process: BaseProcess
    pipe: Connection


def bounded_calls(
    call: Callable[..., Any], given: Sequence[tuple[Any, ...]], workers: int, longest: float
) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Yield arguments and answer of every call as they come in; an `Ended` where its process ended twice.

    Parameters
    ----------
    call : callable
        A function of a module.
    given : sequence of tuple
        Arguments of each call, hashable.
    workers : int
        Processes at a time.
    longest : float
        Processor time of a call [s].
    """
    left, tries = deque(given), Counter[tuple[Any, ...]]()
    idle: list[_Worker] = []
    busy: dict[Connection, tuple[_Worker, tuple[Any, ...]]] = {}
    try:
        while left or busy:
            while left and len(busy) < workers:
                worker, one = idle.pop() if idle else _started(call, longest), left.popleft()
                worker.pipe.send(one)
                busy[worker.pipe] = worker, one
            for pipe in wait(list(busy)):
                assert isinstance(pipe, Connection)
                worker, one = busy.pop(pipe)
                answer = _answer(worker)
                tries[one] += 1
                if not isinstance(answer, Ended):
                    idle.append(worker)
                elif tries[one] < TRIES:
                    left.append(one)
                    continue
                yield one, answer
    finally:
        for worker in (*idle, *(worker for worker, _ in busy.values())):
            worker.process.terminate()
            worker.process.join()


def _started(call: Callable[..., Any], longest: float) -> _Worker:
    context = get_context("spawn")
    mine, other = context.Pipe()
    process = context.Process(target=_serve, args=(call, other, longest), daemon=True)
    process.start()
    other.close()
    return _Worker(process, mine)


def _serve(call: Callable[..., Any], pipe: Connection, longest: float) -> None:
    """Answer until the pipe is closed; a timer's signal ends the process even in a kernel."""
    while True:
        try:
            given = pipe.recv()
        except EOFError:
            return
        signal.setitimer(signal.ITIMER_PROF, longest)
        answer = call(*given)
        signal.setitimer(signal.ITIMER_PROF, 0)
        pipe.send(answer)


def _answer(worker: _Worker) -> Any:
    try:
        return worker.pipe.recv()
    except (EOFError, ConnectionError):
        worker.process.join()
        code = worker.process.exitcode
        return Ended(code == -signal.SIGPROF, code)
