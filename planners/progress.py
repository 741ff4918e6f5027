"""Progress of long work: stages tell it, and do not know who listens."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

Progress = Callable[[str, int, int], None]  # stage, done, total; a total of 0 is not known
Item = TypeVar("Item")

_listener: ContextVar[Progress | None] = ContextVar("listener", default=None)


@contextmanager
def listening(listener: Progress | None) -> Iterator[None]:
    """Tell a listener the progress of the block; without one, whoever listens already."""
    if listener is None:
        yield
        return
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)


def tell(stage: str, done: int, total: int) -> None:
    """Tell how much of a stage is done."""
    listener = _listener.get()
    if listener is not None:
        listener(stage, done, total)


def track(stage: str, items: Sequence[Item]) -> Iterator[Item]:
    """Yield items one by one, and tell how many are done: all of them, where the loop ends early.

    Examples
    --------
    >>> with listening(print):
    ...     print(sum(track("sum", [3, 4])))
    sum 0 2
    sum 1 2
    sum 2 2
    7
    """
    try:
        for k, item in enumerate(items):
            tell(stage, k, len(items))
            yield item
    finally:
        tell(stage, len(items), len(items))
