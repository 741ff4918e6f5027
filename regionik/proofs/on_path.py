"""Which states and hops bind the tool to the path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regionik.proofs.journey import Indices, Journey


@dataclass(frozen=True, eq=False)
class OnPath:
    """States and hops on which the tool must be on the path, and the two set-points it is between."""

    state: Indices
    state_ends: Indices  # (n, 2) set-points
    hop: Indices
    hop_ends: Indices  # (m, 2)


def on_path(setpoints: int, journey: Journey) -> OnPath:
    """What binds the tool: all but transits. Before the first set-point and past the last it holds one."""
    motion = journey.motion
    n, last = len(motion), setpoints - 1
    is_setpoint = motion.kind == "setpoint"
    behind = np.maximum.accumulate(np.where(is_setpoint, np.arange(n), -1))
    i = np.where(behind >= 0, motion.setpoint[behind], -1)
    ends = np.column_stack([np.maximum(i, 0), np.minimum(i + 1, last)])
    step = np.flatnonzero(motion.kind == "step")
    on = motion.kind != "transit"
    hop = np.flatnonzero(on[:-1] & on[1:])
    # A hop between set-points that are not neighbours is out of order already: nothing to measure it by.
    arrives = np.where(is_setpoint[hop + 1], motion.setpoint[hop + 1], ends[hop, 1])
    follows = (arrives == ends[hop, 1]) & (i[hop] >= np.where(is_setpoint[hop], 0, -1))
    return OnPath(step, ends[step], hop[follows], ends[hop[follows]])
