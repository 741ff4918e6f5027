"""Checks of strokes: each worked with the tool down, and the tool told to be on there and nowhere else."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from regionik.values import Motion, Plan, Violation
from regionik.verification.motion import Mask
from regionik.verification.proofs import Finding, StateNames, finding
from regionik.worlds.scene import Target


def verify_strokes(plan: Plan, names: StateNames) -> Finding:
    """The tool is not lifted within a stroke, and what a file says of where it is on is so."""
    violations = [] if plan.world.rules.lift_within else list(_lifted(plan, names))
    return finding("strokes", np.inf, [*violations, *_wrongly_on(plan, names)])


def _lifted(plan: Plan, names: StateNames) -> Iterator[Violation]:
    for i, first, after in ways(plan.motion):
        lifted = np.flatnonzero(plan.motion.kind[first:after] == "transit")
        if len(lifted) and in_one_stroke(plan.world.task[i - 1], plan.world.task[i]):
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
    for i, first, after in ways(plan.motion):
        one, other = plan.world.task[i - 1], plan.world.task[i]
        if in_one_stroke(one, other) and not (one.lead or other.lead):
            lifted = plan.motion.kind[first : after + 1] == "transit"
            on[first:after] = ~(lifted[:-1] | lifted[1:])
    return on


def ways(motion: Motion) -> Iterator[tuple[int, int, int]]:
    """Yield each set-point that follows on the one before it, and the states from that one to it."""
    states = np.flatnonzero(motion.kind == "setpoint").tolist()
    for first, after in zip(states, states[1:], strict=False):
        i = int(motion.setpoint[after])
        if 0 < i == motion.setpoint[first] + 1:
            yield i, first, after


def in_one_stroke(one: Target, other: Target) -> bool:
    """Return whether a set-point and the next are of one stroke."""
    return bool(one.stroke) and one.stroke == other.stroke
