"""Work on one world in chunks, handed out to an executor and handed out again where workers are lost."""

from __future__ import annotations

import hashlib
import pickle
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from threading import Lock
from typing import Generic, TypeVar

from regionik.worlds.errors import EngineError
from regionik.worlds.scene import World

AHEAD = 32  # chunks handed out before the first of them is back
FRESH_POOLS = 3  # tried one after the other without an answer

Pool = Executor | Callable[[], Executor]
Item = TypeVar("Item")
Result = TypeVar("Result")


class _WorldWanted:
    """Answer of a worker that has not seen the world yet."""


_seen: dict[str, World] = {}  # the world that this worker works on
_one_at_a_time = Lock()  # prepared geometry must not be shared by threads


def handed_out(
    world: World,
    work: Callable[[World, Item], Result],
    items: Iterable[tuple[int, Item]],
    executor: Pool | None = None,
    ahead: int = AHEAD,
) -> Iterator[tuple[int, Result]]:
    """Results of ``work(world, item)``, each once, as they come.

    Parameters
    ----------
    world : World
        Sent to each worker once.
    work : callable
        A function of a module, so that other processes find it.
    items : iterable of (number, item)
        Taken one by one, at most ``ahead`` of them before their results are back.
    executor : Executor or function that makes one, optional

    Returns
    -------
    iterator of (number, result)

    Raises
    ------
    EngineError
        When workers are lost again and again.
    """
    if executor is None:
        return ((k, work(world, item)) for k, item in items)
    return _Errands(world, work, items, executor, ahead).results()


class _Errands(Generic[Item, Result]):
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
        self._running: dict[Future[Result | _WorldWanted], tuple[int, Item]] = {}
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
                    if isinstance(result, _WorldWanted):
                        self._again.append(task)
                    else:
                        self._failures = 0
                        yield task[0], result
        finally:
            self._stop()

    def _hand_out(self) -> bool:
        """Keep workers busy; False when nothing is left to wait for."""
        while len(self._running) < self._ahead:
            # Who asked for the world gets it; who was lost with its worker comes to one that may need it.
            world = self._world if self._again else None
            task = self._again.popleft() if self._again else next(self._supply, None)
            if task is None:
                break
            try:
                future = self._pool.submit(_job, self._work, self._digest, world, task[1])
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
        if self._failures == FRESH_POOLS:
            raise EngineError(f"workers were lost {FRESH_POOLS + 1} times in a row: {error}") from error
        self._failures += 1
        self._pool.shutdown(wait=False)
        self._pool = self._renew()

    def _stop(self) -> None:
        for future in self._running:
            future.cancel()
        if self._renew is not None:
            self._pool.shutdown(wait=not self._running, cancel_futures=True)


def _job(
    work: Callable[[World, Item], Result], digest: str, world: bytes | None, item: Item
) -> Result | _WorldWanted:
    """Work done by a worker; it keeps one world, with all that is cached for it."""
    with _one_at_a_time:
        if digest not in _seen:
            if world is None:
                return _WorldWanted()
            _seen.clear()
            _seen[digest] = pickle.loads(world)
        return work(_seen[digest], item)
