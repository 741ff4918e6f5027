"""Kernels compiled by numba, their machine code kept on disk."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from multiprocessing import parent_process
from typing import Any, Literal, TypeVar, cast

from numba import njit
from numba.core.caching import FunctionCache

Kernel = TypeVar("Kernel", bound=Callable[..., Any])


class _Kept(FunctionCache):
    """Machine code on disk; where it cannot be written or read, each process compiles for itself."""

    def save_overload(self, sig: object, data: object) -> None:
        with suppress(OSError):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]

    def load_overload(self, sig: object, target_context: object) -> object:
        with suppress(OSError):
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        return None


def compiled(function: Kernel, error_model: Literal["python", "numpy"] = "python") -> Kernel:
    """Compile with numba and keep the machine code on disk; type checkers still see the function.

    While it runs others may: the thread that ends the process after Ctrl-C, for one. All that decides on
    rounding is said, as a kernel else takes it from the one that calls it first, and keeps it.
    """
    kernel: Any = njit(nogil=True, error_model=error_model, fastmath=False)(function)
    try:
        kernel._cache = _Kept(function)  # type: ignore[no-untyped-call]
    except RuntimeError:  # there is no folder that can be written
        _warn_uncached()
    return cast(Kernel, kernel)


@cache
def _warn_uncached() -> None:
    """Warn once, and not again in worker processes, that every run compiles its kernels anew."""
    if parent_process() is None:
        warnings.warn(
            "compiled kernels cannot be kept on disk, so every run compiles them anew: "
            "set NUMBA_CACHE_DIR to a folder that can be written",
            stacklevel=3,
        )
