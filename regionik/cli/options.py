"""Numbers that tune what commands print, and when they wait, warm up or start workers."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CommandOptions:
    """All of them."""

    progress_delay: float = 1.0  # shorter work shows no progress bar [s]
    line_interval: float = 10.0  # between lines where there is no bar [s]
    # Expressions of kernels as plain Python, some five seconds, from which warm-up is named
    min_plain_work: float = 1.5e8
    max_listed: int = 20  # violations, or set-points left out
    min_told_size: float = 3.0  # of a page or a film [MB]
    max_slow_places: int = 3  # of a tool path, that are printed
    min_slow_time: float = 0.02  # of these [s]
    targets_per_worker: int = 1000  # for which one is worth its start


COMMANDS = CommandOptions()
