"""Checks of strokes: each worked with the tool down, and the tool told to be on there and nowhere else."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from regionik.values import Plan, Violation
from regionik.verification.motion import Mask
from regionik.verification.proofs import Finding, StateNames, finding
from regionik.worlds.scene import Target


def verify_strokes(plan: Plan, names: StateNames) -> Finding:
    """The tool is not lifted within a stroke, and what a file says of where it is on is so."""
    violations = [] if plan.world.rules.lift_within else list(_lifted(plan, names))
    return finding("strokes", np.inf, [*violations, *_wrongly_on(plan, names)])


def _lifted(plan: Plan, names: StateNames) -> Iterator[Violation]:
    for i, first, after in _ways(plan):
        lifted = np.flatnonzero(plan.motion.kind[first:after] == "transit")
        if len(lifted) and _in_one_stroke(plan.world.task[i - 1], plan.world.task[i]):
            text = f"the tool is lifted within stroke {plan.world.task[i].stroke}, before {names.setpoint(i)}"
            yield Violation("strokes", first + int(lifted[0]), i, 0.0, text)


def _wrongly_on(plan: Plan, names: StateNames) -> Iterator[Violation]:
    told = plan.motion.tool_on
    if told is None:
        return
    for k in np.flatnonzero(told != worked(plan)).tolist():
        said, is_so = ("on", "off") if told[k] else ("off", "on")
        text = f"the plan says that the tool is {said} {names.state(k)}, by its strokes it is {is_so}"
        yield Violation("strokes", k, names.owner(k), 0.0, text)


def worked(plan: Plan) -> Mask:
    """States from which the tool works its way to the next, (n,)."""
    on = np.zeros(len(plan.motion), dtype=bool)
    for i, first, after in _ways(plan):
        if _in_one_stroke(plan.world.task[i - 1], plan.world.task[i]):
            lifted = plan.motion.kind[first : after + 1] == "transit"
            on[first:after] = ~(lifted[:-1] | lifted[1:])
    return on


def _ways(plan: Plan) -> Iterator[tuple[int, int, int]]:
    """Each set-point that follows on the one before it, and the states from that one to it."""
    states = np.flatnonzero(plan.motion.kind == "setpoint").tolist()
    for first, after in zip(states, states[1:], strict=False):
        i = int(plan.motion.setpoint[after])
        if 0 < i == plan.motion.setpoint[first] + 1:
            yield i, first, after


def _in_one_stroke(one: Target, other: Target) -> bool:
    return bool(one.stroke) and one.stroke == other.stroke
