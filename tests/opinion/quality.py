"""What single postures lack of what a plan's rules ask of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from tests.opinion.machine import Array, Machine, jacobian

EVEN = 1e-8  # of what is asked, for rounding


def shortfalls(machine: Machine, rules: dict[str, Any], base: Array, joints: Array) -> Iterator[str]:
    """Objections to a posture by the criteria of some rules."""
    asked = rules.get("criteria") or {}
    least, share, most = (asked.get(key) for key in ("manipulability", "joint_margin", "effort"))
    q = machine.configuration(base, joints)
    if least is not None:
        volume = manipulability(machine, q)
        if volume < least - EVEN:
            yield f"manipulability {volume:.3e}"
    limited = np.isfinite(machine.upper - machine.lower)
    if share is not None and limited.any():
        room = np.minimum(joints - machine.lower, machine.upper - joints)[limited]
        part = float((room / (machine.upper - machine.lower)[limited]).min())
        if part < share - EVEN:
            yield f"joint margin {part:.3e}"
    if most is not None:
        over = np.abs(machine.efforts(q)) - np.asarray(most, dtype=float)
        for j in np.flatnonzero(over > EVEN):
            yield f"joint {j} bears {over[j]:.3e} too much"


def manipulability(machine: Machine, q: Array) -> float:
    """Yoshikawa's measure of the arm's joints for the tool's place."""
    J = jacobian(machine, q)[:3][:, machine.columns]
    return float(np.sqrt(max(np.linalg.det(J @ J.T), 0.0)))
