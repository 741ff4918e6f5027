"""Kernels called twice, compiled and as plain Python, with one answer; a plugin for `make coverage`.

What a plain kernel calls is called twice as well, so that kernels deep inside others are asked too, and their
lines counted. Plain Python is a hundred times slower: in every test a kernel is asked a few times and then
runs compiled alone.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pkgutil import walk_packages
from typing import Any

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

import regionik
from regionik.planners.kernels import compiled_at_once

TIMES = 3  # that a kernel is asked in a test
CLOSE = 1e-12  # answers differ by rounding, where the processor multiplies and adds in one
CALLERS = {"regionik", "tests"}


class Twice:
    """A kernel that is called twice the first times; numba takes it for the kernel itself."""

    def __init__(self, kernel: Any, times: int) -> None:
        self.kernel, self.left = kernel, times

    def __getattr__(self, name: str) -> Any:
        return getattr(self.kernel, name)

    def __call__(self, *given: Any) -> Any:
        if self.left <= 0:
            return self.kernel(*given)
        self.left -= 1
        mine = copied(given, {})
        with np.errstate(all="ignore"):  # what is compiled does not warn
            plain = self.kernel.py_func(*mine)
        answer = self.kernel(*given)
        assert alike((answer, given), (plain, mine)), f"{self.kernel.py_func}: {answer}, plainly {plain}"
        return answer


def copied(value: Any, known: dict[int, Any]) -> Any:
    """Arrays that a kernel may write to as others of the same kind, all else as it is."""
    if isinstance(value, tuple):
        parts = [copied(part, known) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    if not isinstance(value, np.ndarray) or not value.flags.writeable:
        return value
    if id(value) not in known:
        in_pieces = not value.flags.forc  # and stays so, as kernels are compiled for one or the other
        known[id(value)] = np.empty((*value.shape, 2), value.dtype)[..., 0] if in_pieces else value.copy("A")
        known[id(value)][...] = value
    return known[id(value)]


def alike(one: Any, other: Any) -> bool:
    """Whether two answers are the same but for rounding."""
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(alike, one, other))
    if one is other or one is None or other is None:
        return one is other
    if np.shape(one) != np.shape(other):
        return False
    return np.allclose(one, other, rtol=CLOSE, atol=CLOSE, equal_nan=True)


@contextmanager
def kernels_called_twice(times: int = TIMES) -> Iterator[None]:
    """Whoever calls a kernel by its name calls it twice, in the product, in a test or in another kernel."""
    for module in walk_packages(regionik.__path__, "regionik."):
        import_module(module.name)
    homes = [vars(module) for name, module in sys.modules.items() if name.split(".")[0] in CALLERS]
    kernels: dict[Any, Twice] = {}
    known = []
    for names in homes:
        for name, value in names.items():
            if isinstance(value, Dispatcher):
                kernels.setdefault(value, Twice(value, times))
                known.append((names, name, value))
    for names, name, kernel in known:
        names[name] = kernels[kernel]
    try:
        with compiled_at_once():
            yield
    finally:
        for names, name, kernel in known:
            names[name] = kernel


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol() -> Iterator[None]:
    """Every test, and what is made for it."""
    with kernels_called_twice():
        return (yield)
