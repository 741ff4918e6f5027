"""What the checks of `regionik.verify` hand in, and the words they use."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from regionik.plan import Motion, Violation

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
