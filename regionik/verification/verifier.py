"""A plan checked again from its world alone, by other code than made it.

The two share only how distances from solids are measured.

"Free" means proven: motion between states is bounded (see `regionik.verification.motion`), not sampled.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from regionik.values import Configuration, Plan, Report, Violation
from regionik.verification.arm_clearance import arm
from regionik.verification.base_clearance import clearance, floor
from regionik.verification.base_motion import heading, wheels
from regionik.verification.criteria import criteria
from regionik.verification.findings import Finding, Words, finding
from regionik.verification.motion import Indices, Journey, wrapped
from regionik.verification.self_collision import itself
from regionik.verification.stops import stops
from regionik.verification.tool_axis import direction, orientation
from regionik.verification.tool_path import path, setpoints
from regionik.worlds.arrays import Array

EXACT = 1e-9  # [m] or [rad]
KINDS = ("setpoint", "step", "transit")


def verify(plan: Plan) -> Report:
    """Check every promise of a plan.

    Parameters
    ----------
    plan : Plan

    Returns
    -------
    Report
        ``margins`` has the least margin of every check that measured something: ``joints`` [rad or m],
        ``step``, ``wheels``, ``setpoint``, ``path``, ``floor``, ``clearance``, ``arm``, ``contact``,
        ``self``, ``stops`` [m], ``direction``, ``orientation`` [rad], and of criteria that the rules ask
        ``manipulability`` [m3], ``joint_margin`` (a share of the range), ``effort`` [N m] or [N]. Those of
        ``arm``, ``contact`` and ``self`` are told up to 0.05; that of ``contact`` is how much deeper the tool
        might sink in. Of many violations of a kind the first 20 are told, and the rest in one.
    """
    flaws = tuple(_malformed(plan))
    if flaws:
        return _report([finding("structure", np.inf, flaws)])
    journey = Journey(plan.world.robot, plan.motion)
    words = Words(plan.motion, len(plan.world.task))
    return _report(
        [
            finding("structure", np.inf, _structure(plan, words)),
            _joints(journey, words),
            _step(journey, words, plan.world.rules.step),
            wheels(journey, words),
            heading(plan.world, journey, words),
            setpoints(plan.world, journey, words),
            path(plan.world, journey, words),
            direction(plan.world, journey, words),
            orientation(plan.world, journey, words),
            floor(plan.world, journey, words),
            clearance(plan.world, journey, words),
            *arm(plan.world, journey, words),
            itself(journey, words),
            stops(plan, words),
            *criteria(plan.world, journey, words),
        ]
    )


def _report(findings: list[Finding]) -> Report:
    violations = tuple(violation for found in findings for violation in found.violations)
    measured = [found for found in findings if found.kind != "structure" and np.isfinite(found.margin)]
    margins = {found.kind: float(found.margin) for found in measured}
    return Report(not violations, margins, violations)


def _malformed(plan: Plan) -> Iterator[Violation]:
    """Flaws that leave nothing to measure."""
    motion, dof = plan.motion, plan.world.robot.chain.dof
    if not len(motion):
        yield _flaw("the plan has no states")
        return
    if not plan.world.task:
        yield _flaw("the plan's world has no set-points")
    if motion.joints.shape[1:] != (dof,):
        yield _flaw(f"states have {motion.joints.shape[1]} joint values each, the robot has {dof} joints")
    finite = np.isfinite(motion.base).all(1) & np.isfinite(motion.joints).all(1) & ~np.isinf(motion.time)
    for k in np.flatnonzero(~finite)[:1].tolist():
        yield _flaw(f"state {k + 1} of {len(motion)} holds a number that is not finite", k)
    for i, configuration in enumerate(plan.setpoints):
        if not np.isfinite([*configuration.base, *configuration.joints, configuration.error]).all():
            yield _flaw(f"set-point {i + 1} of the plan holds a number that is not finite", None, i)
    for k in np.flatnonzero(~np.isin(motion.kind, KINDS))[:1].tolist():
        known = ", ".join(KINDS)
        yield _flaw(f"state {k + 1} is of kind {motion.kind[k]}; expected one of {known}", k)
    wrong = (motion.setpoint < -1) | (motion.setpoint >= len(plan.world.task))
    for k in np.flatnonzero(wrong)[:1].tolist():
        count = len(plan.world.task)
        yield _flaw(f"state {k + 1} belongs to set-point {motion.setpoint[k] + 1} of {count}", k)


def _flaw(text: str, state: int | None = None, setpoint: int | None = None) -> Violation:
    return Violation("structure", state, setpoint, 0.0, text)


def _structure(plan: Plan, words: Words) -> Iterator[Violation]:
    motion, world = plan.motion, plan.world
    reached = np.flatnonzero(motion.kind == "setpoint")
    yield from _order(plan, words)
    yield from _labels(plan, words)
    if len(plan.setpoints) != len(world.task):
        yield _flaw(f"the plan lists {len(plan.setpoints)} set-points, its world has {len(world.task)}")
    for k in reached.tolist():
        i = int(motion.setpoint[k])
        if 0 <= i < len(plan.setpoints) and not _agrees(plan.setpoints[i], motion.base[k], motion.joints[k]):
            yield _flaw(f"{words.setpoint(i)}: its configuration differs from state {k + 1}", k, i)
    start = world.start
    if start is not None:
        begin = Configuration(start.base, start.joints, 0.0, 0, True)
        if not _agrees(begin, motion.base[0], motion.joints[0]):
            yield _flaw("the first state is not the start that the world gives", 0)
    if (np.diff(motion.time[~np.isnan(motion.time)]) < 0).any():
        yield _flaw("the times of the states run backwards")
    yield from _lift_offs(plan, reached)


def _order(plan: Plan, words: Words) -> Iterator[Violation]:
    """Every set-point once, in the order of the task."""
    motion = plan.motion
    order = [int(i) for i in motion.setpoint[motion.kind == "setpoint"]]
    often = Counter(order)
    for i in range(len(plan.world.task)):
        times = often[i]
        if times != 1:
            many = "is missing" if times == 0 else f"appears {times} times"
            yield _flaw(f"{words.setpoint(i)} {many} among the states", None, i)
    states = np.flatnonzero(motion.kind == "setpoint").tolist()
    for k, before, after in zip(states[1:], order, order[1:], strict=False):
        if after < before:
            text = f"{words.setpoint(after)} comes after {words.setpoint(before)}: out of order"
            yield _flaw(text, k, after)
    for k, i in zip(states, order, strict=True):
        if i < 0:
            yield _flaw(f"state {k + 1} is a set-point but does not say which", k)


def _labels(plan: Plan, words: Words) -> Iterator[Violation]:
    """A step belongs to the set-point behind it or to the one ahead."""
    motion = plan.motion
    behind = -1
    for k, (kind, i) in enumerate(zip(motion.kind.tolist(), motion.setpoint.tolist(), strict=True)):
        if kind == "setpoint":
            behind = i
        elif kind == "step" and i >= 0 and i not in (behind, behind + 1):
            yield _flaw(
                f"state {k + 1} is a step that belongs to {words.setpoint(i)}, which is not next to it", k, i
            )


def _lift_offs(plan: Plan, reached: Indices) -> Iterator[Violation]:
    lifted = (plan.motion.kind == "transit")[reached[0] :] if len(reached) else np.zeros(0, dtype=bool)
    runs = int(np.count_nonzero(np.diff(lifted.astype(int)) == 1))
    if runs != plan.lift_offs:
        yield _flaw(f"the plan says {plan.lift_offs} lift-offs, its states have {runs}")
    most = plan.world.rules.max_lift_offs
    if most is not None and runs > most:
        yield _flaw(f"the tool is lifted {runs} times, the rules allow {most}")


def _agrees(configuration: Configuration, base: Array, joints: Array) -> bool:
    moved = np.append(configuration.base[:2] - base[:2], wrapped(configuration.base[2] - base[2]))
    same_arm = configuration.joints.shape == joints.shape
    return same_arm and bool(max(np.abs(moved).max(), np.abs(configuration.joints - joints).max()) <= EXACT)


def _joints(journey: Journey, words: Words) -> Finding:
    """Joint values inside their limits; they move linearly, so states tell all."""
    chain, joints = journey.robot.chain, journey.motion.joints
    lower, upper = chain.lower, chain.upper
    margin = np.minimum(joints - lower, upper - joints)
    violations = []
    for k, j in np.argwhere(margin < -EXACT).tolist():
        unit = "rad" if chain.joints[j].kind == "revolute" else "m"
        text = (
            f"{chain.names[j]} is at {joints[k, j]:z.4f} {unit} {words.state(k)}; "
            f"its limits are {lower[j]:z.4f} to {upper[j]:z.4f} {unit}"
        )
        violations.append(Violation("joints", k, words.owner(k), float(-margin[k, j]), text))
    return finding("joints", float(margin.min()), violations)


def _step(journey: Journey, words: Words, longest: float) -> Finding:
    length = journey.length
    violations = []
    for k in np.flatnonzero(length > longest + EXACT).tolist():
        text = f"the base moves {length[k]:.4f} m {words.hop(k)}; the rules allow {longest:g} m"
        violations.append(Violation("step", k, words.owner(k), float(length[k] - longest), text))
    return finding("step", float(longest - length.max(initial=0.0)), violations)
