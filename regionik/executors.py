"""Work on one world in chunks: in this process, in worker processes, or on a Dask cluster.

Chunks whose workers are lost are handed out again. The only file that imports distributed.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import contextmanager
from multiprocessing import connection, parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Lock, Thread
from typing import TYPE_CHECKING, Generic, ParamSpec, TypeVar

from regionik.worlds.errors import EngineError, InputError
from regionik.worlds.scene import World

if TYPE_CHECKING:
    from distributed import Client
    from distributed import Future as DaskFuture

CHUNKS_AHEAD = 32  # chunks handed out before the first of them is back
MAX_FRESH_POOLS = 3  # tried one after the other without a result
CHUNKS_PER_THREAD = 2  # of a cluster, handed out ahead
CONNECT_TIMEOUT = 10  # [s]
# When a run ends, the resource tracker frees what its pool leaves behind; it need not warn of that.
_TRACKER_WARNING = "ignore:resource_tracker:UserWarning"

Pool = Executor | Callable[[], Executor]
Item = TypeVar("Item")
Result = TypeVar("Result")
Call = ParamSpec("Call")


class _WorldNeeded:
    """Answer of a worker that has not seen the world yet."""


_worlds: dict[str, World] = {}  # the world that this worker works on, by its digest
_one_at_a_time = Lock()  # prepared geometry must not be shared by threads


def map_unordered(
    world: World,
    work: Callable[[World, Item], Result],
    items: Iterable[tuple[int, Item]],
    executor: Pool | None = None,
    ahead: int = CHUNKS_AHEAD,
) -> Iterator[tuple[int, Result]]:
    """Return numbers and results of ``work(world, item)``, each once, as they are done.

    The world is sent to each worker once; ``work`` is a function of a module, so that other processes find
    it. Numbered items are taken one by one, at most ``ahead`` of them before their results are back. Raises
    EngineError when workers are lost again and again.
    """
    if executor is None:
        return ((k, work(world, item)) for k, item in items)
    return _ChunkQueue(world, work, items, executor, ahead).results()


class _ChunkQueue(Generic[Item, Result]):
    """Chunks that are with workers, that wait to be handed out again, and that were never handed out."""

    def __init__(
        self,
        world: World,
        work: Callable[[World, Item], Result],
        items: Iterable[tuple[int, Item]],
        executor: Pool,
        ahead: int,
    ) -> None:
        self._world = pickle.dumps(world)
        self._digest = hashlib.sha256(self._world).hexdigest()
        self._work, self._supply, self._ahead = work, iter(items), ahead
        self._again: deque[tuple[int, Item]] = deque()
        self._running: dict[Future[Result | _WorldNeeded], tuple[int, Item]] = {}
        self._renew = None if isinstance(executor, Executor) else executor
        self._pool = executor if isinstance(executor, Executor) else executor()
        self._failures = 0

    def results(self) -> Iterator[tuple[int, Result]]:
        try:
            while self._hand_out():
                for future in wait(self._running, return_when=FIRST_COMPLETED).done:
                    task = self._running.pop(future)
                    try:
                        result = future.result()
                    except BrokenExecutor:
                        self._again.append(task)
                        continue
                    if isinstance(result, _WorldNeeded):
                        self._again.append(task)
                    else:
                        self._failures = 0
                        yield task[0], result
        finally:
            self._stop()

    def _hand_out(self) -> bool:
        """Keep workers busy; False when nothing is left to wait for."""
        while len(self._running) < self._ahead:
            # A task done again goes with the world: its worker asked for it, or was lost.
            world = self._world if self._again else None
            task = self._again.popleft() if self._again else next(self._supply, None)
            if task is None:
                break
            try:
                future = self._pool.submit(_work_on, self._work, self._digest, world, task[1])
            except BrokenExecutor as error:
                self._again.append(task)
                self._replace_pool(error)
            else:
                self._running[future] = task
        return bool(self._running)

    def _replace_pool(self, error: BrokenExecutor) -> None:
        if self._renew is None:
            advice = "give a function that makes executors, and the chunks are handed out again"
            raise EngineError(f"the executor lost its workers: {error} ({advice})") from error
        if self._failures == MAX_FRESH_POOLS:
            raise EngineError(f"workers were lost {MAX_FRESH_POOLS + 1} times in a row: {error}") from error
        self._failures += 1
        self._pool.shutdown(wait=False)
        self._pool = self._renew()

    def _stop(self) -> None:
        for future in self._running:
            future.cancel()
        if self._renew is not None:
            self._pool.shutdown(wait=not self._running, cancel_futures=True)


def _work_on(
    work: Callable[[World, Item], Result], digest: str, world: bytes | None, item: Item
) -> Result | _WorldNeeded:
    """Do the work of one chunk; a worker keeps one world, with all that is cached for it."""
    with _one_at_a_time:
        if digest not in _worlds:
            if world is None:
                return _WorldNeeded()
            _worlds.clear()
            _worlds[digest] = pickle.loads(world)
        return work(_worlds[digest], item)


# --- worker processes


class _ShieldedProcess(SpawnProcess):
    """A process that Ctrl-C on the terminal does not reach, not even while its imports run."""

    def start(self) -> None:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # the child inherits it
        try:
            super().start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _ShieldingContext(SpawnContext):
    Process = _ShieldedProcess


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def process_pool(count: int) -> ProcessPoolExecutor:
    """Return a pool of ``count`` worker processes, none of which outlives this process."""
    if _TRACKER_WARNING not in sys.warnoptions:
        sys.warnoptions.append(_TRACKER_WARNING)  # the tracker is started with these
    # Forks would share what libraries have started, and unseeded ones would draw alike.
    return ProcessPoolExecutor(count, mp_context=_ShieldingContext(), initializer=_follow_parent)


def _follow_parent() -> None:
    """End with the parent, which cannot say that it is gone when it is killed."""
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(0)


# --- a Dask cluster


class _DaskExecutor(Executor):
    """A Dask client as an executor.

    The client's own one takes a result for an error when its worker is lost just as it is fetched.
    """

    def __init__(self, client: Client) -> None:
        self._client = client

    def submit(
        self, fn: Callable[Call, Result], /, *args: Call.args, **kwargs: Call.kwargs
    ) -> Future[Result]:
        future: Future[Result] = Future()
        task = self._client.submit(fn, *args, **kwargs, pure=False)
        task.add_done_callback(lambda done: _pass_on(done, future))
        return future


def _pass_on(task: DaskFuture[Result], future: Future[Result]) -> None:
    """Give a future the result of a task; asking for it waits until a lost one is computed again."""
    if future.set_running_or_notify_cancel():
        try:
            future.set_result(task.result())
        except BaseException as error:
            future.set_exception(error)


@contextmanager
def dask_executor(address: str) -> Iterator[tuple[Executor, int]]:
    """Yield the workers of a Dask scheduler as an executor, and how many chunks to hand out ahead.

    The scheduler hands to others what a lost worker had not given back. Threads of one worker take turns:
    workers want one thread each (``dask worker ADDRESS --nworkers auto --nthreads 1``). Raises InputError
    when distributed is not installed or there is no scheduler at the address (as ``tcp://host:8786``), and
    EngineError when a chunk ended worker after worker or the scheduler is lost.
    """
    try:
        from distributed import Client, KilledWorker
        from distributed.comm import CommClosedError
    except ModuleNotFoundError as error:
        raise InputError(f"--dask needs regionik[distributed]: {error}") from None
    try:
        client = Client(address, set_as_default=False, timeout=CONNECT_TIMEOUT)
    except (OSError, ValueError, CommClosedError) as error:
        raise InputError(f"{address}: expected the address of a Dask scheduler: {error}") from None
    try:
        with client:
            threads = sum(client.nthreads().values())
            yield _DaskExecutor(client), max(CHUNKS_AHEAD, CHUNKS_PER_THREAD * threads)
    except KilledWorker as error:
        raise EngineError(f"{address}: a chunk ended worker after worker: {error}") from None
    except (CancelledError, CommClosedError) as error:
        raise EngineError(f"{address}: the scheduler was lost: {error}") from None
