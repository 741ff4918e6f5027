"""Checks of a plan's form: its states and set-points agree with its world and with one another."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from regionik.values import Configuration, Plan, Violation
from regionik.verification.motion import wrap_angle
from regionik.verification.proofs import StateNames
from regionik.verification.tolerances import EXACT
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Start

SKIPPED_FOR = ("unreachable", "undecided", "no-posture", "ladder-broken")  # verdicts on a set-point left out
KINDS = ("setpoint", "step", "transit")


def malformations(plan: Plan) -> Iterator[Violation]:
    """Faults of form that leave nothing to measure."""
    motion, dof = plan.motion, plan.world.robot.chain.dof
    if not len(motion):
        yield _fault("the plan has no states")
        return
    if not plan.world.task:
        yield _fault("the plan's world has no set-points")
    if motion.joints.shape[1:] != (dof,):
        yield _fault(f"states have {motion.joints.shape[1]} joint values each, the robot has {dof} joints")
    finite = np.isfinite(motion.base).all(1) & np.isfinite(motion.joints).all(1) & ~np.isinf(motion.time)
    for k in np.flatnonzero(~finite)[:1].tolist():
        yield _fault(f"state {k + 1} of {len(motion)} holds a number that is not finite", k)
    for i, configuration in enumerate(plan.setpoints):
        if not np.isfinite([*configuration.base, *configuration.joints, configuration.error]).all():
            yield _fault(f"set-point {i + 1} of the plan holds a number that is not finite", None, i)
    for k in np.flatnonzero(~np.isin(motion.kind, KINDS))[:1].tolist():
        yield _fault(f"state {k + 1} is of kind {motion.kind[k]}; expected one of {', '.join(KINDS)}", k)
    count = len(plan.world.task)
    for k in np.flatnonzero((motion.setpoint < -1) | (motion.setpoint >= count))[:1].tolist():
        yield _fault(f"state {k + 1} belongs to set-point {motion.setpoint[k] + 1} of {count}", k)


def inconsistencies(plan: Plan, names: StateNames) -> Iterator[Violation]:
    """Contradictions between states, set-points, start, times and lift-offs of a well-formed plan."""
    motion, world = plan.motion, plan.world
    reached = np.flatnonzero(motion.kind == "setpoint").tolist()
    yield from _out_of_order(plan, names)
    yield from _misplaced_states(plan, names)
    if len(plan.setpoints) != len(world.task):
        yield _fault(f"the plan lists {len(plan.setpoints)} set-points, its world has {len(world.task)}")
    for k in reached:
        i = int(motion.setpoint[k])
        if 0 <= i < len(plan.setpoints) and not _agrees(plan.setpoints[i], motion.base[k], motion.joints[k]):
            yield _fault(f"{names.setpoint(i)}: its configuration differs from state {k + 1}", k, i)
    if world.start is not None and not _agrees(world.start, motion.base[0], motion.joints[0]):
        yield _fault("the first state is not the start that the world gives", 0)
    if np.isnan(motion.time).any() and not np.isnan(motion.time).all():
        k = int(np.argmax(np.isnan(motion.time)))
        yield _fault(f"state {k + 1} of {len(motion)} has no time, others have", k)
    if (np.diff(motion.time[~np.isnan(motion.time)]) < 0).any():
        yield _fault("the times of the states run backwards")
    yield from _wrong_lift_offs(plan, reached)
    yield from _wrong_skipped(plan)


def _wrong_skipped(plan: Plan) -> Iterator[Violation]:
    """Set-points that are left out although the rules do not allow it, or twice, or that are done as well."""
    if not plan.skipped:
        return
    if not plan.world.rules.skip_unreachable:
        yield _fault(f"the plan leaves out {len(plan.skipped)} set-points, rules.skip_unreachable is not set")
    count, order = len(plan.world.task) + len(plan.skipped), plan.stats.get("order")
    numbers = [one.setpoint for one in plan.skipped]
    if isinstance(order, list) and all(isinstance(i, int) for i in order):
        if sorted([*order, *numbers]) != list(range(count)):
            yield _fault(f"set-points done and left out are not the {count} as given, each once")
    else:
        yield _fault("the plan leaves out set-points, and its stats.order does not say which it does")
    for one in plan.skipped:
        if one.verdict not in SKIPPED_FOR or not one.reason:
            yield _fault(f"set-point {one.setpoint + 1} of {count} as given is left out for no reason")


def _fault(text: str, state: int | None = None, setpoint: int | None = None) -> Violation:
    return Violation("structure", state, setpoint, 0.0, text)


def _out_of_order(plan: Plan, names: StateNames) -> Iterator[Violation]:
    motion = plan.motion
    states = np.flatnonzero(motion.kind == "setpoint").tolist()
    order = motion.setpoint[states].tolist()
    counts = Counter(order)
    for i in range(len(plan.world.task)):
        if counts[i] != 1:
            how = "is missing" if counts[i] == 0 else f"appears {counts[i]} times"
            yield _fault(f"{names.setpoint(i)} {how} among the states", None, i)
    for k, (before, after) in zip(states[1:], pairwise(order), strict=True):
        if after < before:
            text = f"{names.setpoint(after)} comes after {names.setpoint(before)}: out of order"
            yield _fault(text, k, after)
    for k, i in zip(states, order, strict=True):
        if i < 0:
            yield _fault(f"state {k + 1} is a set-point but does not say which", k)


def _misplaced_states(plan: Plan, names: StateNames) -> Iterator[Violation]:
    """States between set-points that belong to another one than the tool has left; they need not name it."""
    motion = plan.motion
    last = -1
    for k, (kind, i) in enumerate(zip(motion.kind.tolist(), motion.setpoint.tolist(), strict=True)):
        if kind == "setpoint":
            last = i
        elif i not in (-1, last):
            text = f"state {k + 1} is a {kind} that belongs to {names.setpoint(i)}, the tool has left "
            yield _fault(text + (names.setpoint(last) if last >= 0 else "none"), k, i)


def _wrong_lift_offs(plan: Plan, served: list[int]) -> Iterator[Violation]:
    lifted = (plan.motion.kind == "transit")[served[0] :] if served else np.zeros(0, dtype=bool)
    runs = int(np.count_nonzero(np.diff(lifted.astype(int)) == 1))
    if runs != plan.lift_offs:
        yield _fault(f"the plan says {plan.lift_offs} lift-offs, its states have {runs}")
    most = plan.world.rules.max_lift_offs
    if most is not None and runs > most:
        yield _fault(f"the tool is lifted {runs} times, the rules allow {most}")


def _agrees(one: Configuration | Start, base: Array, joints: Array) -> bool:
    """Return whether base and joints are the same as others, to a nanometre and nanoradian."""
    moved = np.append(one.base[:2] - base[:2], wrap_angle(one.base[2] - base[2]))
    same_arm = one.joints.shape == joints.shape
    return same_arm and bool(max(np.abs(moved).max(), np.abs(one.joints - joints).max()) <= EXACT)
