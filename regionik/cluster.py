"""Workers of a Dask cluster; the only file that imports distributed."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import CancelledError, Executor
from contextlib import contextmanager

from regionik.worlds.errors import EngineError, InputError

AT_LEAST, A_THREAD = 32, 2  # chunks that are handed out ahead
CONNECT = 10  # [s]


@contextmanager
def cluster(address: str) -> Iterator[tuple[Executor, int]]:
    """Workers of the Dask scheduler at an address, as an executor.

    What a worker had not given back when it was lost, the scheduler hands to others. Threads of one worker
    take turns: workers want one thread each (``dask worker ADDRESS --nworkers auto --nthreads 1``).

    Parameters
    ----------
    address : str
        As ``tcp://host:8786``.

    Yields
    ------
    executor : Executor
    ahead : int
        Chunks to hand out before the first of them is back.

    Raises
    ------
    InputError
        When distributed is not installed, or there is no scheduler at the address.
    EngineError
        When a chunk ended worker after worker, or the scheduler is lost.
    """
    try:
        from distributed import Client, KilledWorker
        from distributed.comm import CommClosedError
    except ModuleNotFoundError as error:
        raise InputError(f"--dask needs regionik[distributed]: {error}") from None
    try:
        client = Client(address, set_as_default=False, timeout=CONNECT)
    except (OSError, ValueError, CommClosedError) as error:
        raise InputError(f"{address}: expected the address of a Dask scheduler: {error}") from None
    try:
        with client, client.get_executor(pure=False) as executor:
            threads = sum(client.nthreads().values())
            yield executor, max(AT_LEAST, A_THREAD * threads)
    except KilledWorker as error:
        raise EngineError(f"{address}: a chunk ended worker after worker: {error}") from None
    except (CancelledError, CommClosedError) as error:
        raise EngineError(f"{address}: the scheduler was lost: {error}") from None
