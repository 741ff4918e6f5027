"""Times that are worth comparing: medians over repeats, in the same run."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

REPEATS = 9


def seconds(call: Callable[[], Any]) -> float:
    """Median processor time of a call [s]; what the first one compiles does not count."""
    call()
    taken = []
    for _ in range(REPEATS):
        begun = time.process_time()
        call()
        taken.append(time.process_time() - begun)
    return float(np.median(taken))
