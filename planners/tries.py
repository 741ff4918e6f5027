"""Tries of searches, counted where somebody asks for it, and bounded: a measure of work without a clock."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass


class TooManyTriesError(Exception):
    """A search has made more tries than it was allowed."""


@dataclass
class Tries:
    """Tries made so far, and how many are allowed."""

    made: int = 0
    most: float = float("inf")


_counted: ContextVar[Tries | None] = ContextVar("tries", default=None)


@contextmanager
def counted() -> Iterator[Tries]:
    """Count the tries of the block; where a block round it counts already, they are added to its own.

    Examples
    --------
    >>> with counted() as tries:
    ...     count_tries(3)
    >>> tries.made
    3
    """
    tries = _counted.get() or Tries()
    before = _counted.set(tries)
    try:
        yield tries
    finally:
        _counted.reset(before)


@contextmanager
def at_most(number: int) -> Iterator[None]:
    """Allow so many tries in the block, which raises `TooManyTriesError` where more are made."""
    with counted() as tries:
        before, tries.most = tries.most, min(tries.most, tries.made + number)
        try:
            yield
        finally:
            tries.most = before


def count_tries(number: int = 1) -> None:
    """Count tries that are about to be made; raises `TooManyTriesError` where they are too many."""
    tries = _counted.get()
    if tries is not None:
        tries.made += number
        if tries.made > tries.most:
            raise TooManyTriesError
