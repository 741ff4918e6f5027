"""Times that are worth comparing: medians over repeats, in the same run."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

REPEATS = 9


def seconds(call: Callable[[], Any]) -> float:
    """Median time of a call [s]; what the first one compiles does not count."""
    call()
    taken = []
    for _ in range(REPEATS):
        begun = time.perf_counter()
        call()
        taken.append(time.perf_counter() - begun)
    return float(np.median(taken))
