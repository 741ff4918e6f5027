"""What the checks of `regionik.verify` hand in, and the words they use."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from regionik.values import Motion, Violation
from regionik.verification.motion import Indices, Journey

MOST = 20  # violations of a kind that are told one by one


class Finding(NamedTuple):
    """The result of one check; ``margin`` is infinite where there was nothing to measure."""

    kind: str
    margin: float  # [m] or [rad]
    violations: tuple[Violation, ...]


def finding(kind: str, margin: float, violations: Iterable[Violation]) -> Finding:
    """A finding with its violations in the order of the motion, the many counted in one."""
    found = sorted(violations, key=lambda v: -1 if v.state is None else v.state)
    least = min([margin, *(-v.amount for v in found)])
    rest = found[MOST:]
    if rest:
        worst = max(rest, key=lambda v: v.amount)
        text = f"{len(rest)} more violations of this kind ({kind}); the worst of them: {worst.text}"
        found = [*found[:MOST], Violation(kind, worst.state, worst.setpoint, worst.amount, text)]
    return Finding(kind, least, tuple(found))


class Words(NamedTuple):
    """Names of states and set-points for people, who count from 1."""

    motion: Motion
    total: int  # set-points of the task

    def setpoint(self, i: int) -> str:
        return f"set-point {i + 1} of {self.total}"

    def owner(self, state: int) -> int | None:
        """The set-point that a state belongs to, or else the next one."""
        i = int(self.motion.setpoint[state])
        if i < 0:
            later = self.motion.setpoint[state:][self.motion.setpoint[state:] >= 0]
            i = int(later[0]) if len(later) else -1
        return i if i >= 0 else None

    def state(self, state: int) -> str:
        where = f"at state {state + 1} of {len(self.motion)}"
        return self._with_owner(where, state)

    def hop(self, state: int) -> str:
        where = f"between states {state + 1} and {state + 2} of {len(self.motion)}"
        return self._with_owner(where, state)

    def _with_owner(self, where: str, state: int) -> str:
        i = self.owner(state)
        if i is None:
            return where
        if self.motion.kind[state] == "setpoint":
            return f"{where} ({self.setpoint(i)})"
        near = "before" if int(self.motion.setpoint[state]) < 0 else "near"
        return f"{where} ({near} {self.setpoint(i)})"


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
