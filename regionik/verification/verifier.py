"""Plans and answers checked again from their world alone, by other code than made them.

The two share only how distances from solids are measured. "Free" means proven: motion between states is
bounded (`regionik.verification.motion`), not sampled.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from regionik.planners.progress import tell
from regionik.values import Answer, Configuration, Motion, Plan, Report, Violation
from regionik.verification.arm_clearance import verify_arm_clearance
from regionik.verification.base_clearance import verify_base_clearance, verify_floor
from regionik.verification.derived_fields import verify_derived_fields
from regionik.verification.limits import (
    verify_base_steps,
    verify_criteria,
    verify_heading,
    verify_joint_limits,
    verify_wheels,
)
from regionik.verification.motion import MotionSegments, wrap_angle
from regionik.verification.proofs import Finding, StateNames, finding
from regionik.verification.self_collision import verify_self_collision
from regionik.verification.speeds import verify_speeds
from regionik.verification.stops import verify_execution, verify_stops
from regionik.verification.strokes import verify_strokes
from regionik.verification.structure import inconsistencies, malformations
from regionik.verification.tolerances import EXACT
from regionik.verification.tool_path import (
    verify_direction,
    verify_orientation,
    verify_path,
    verify_setpoints,
)
from regionik.verification.world_agreement import verify_world
from regionik.verification.zones import verify_zones
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.scene import Target, World

ARM_KINDS = ("arm", "self")  # checks that hold for answers only where the rules ask for avoidance
PATH_KINDS = ("path",)  # checks that do not: their tools are held to ``tolerance``, on no path


def verify(plan: Plan, world: World | None = None) -> Report:
    """Check every promise of a plan.

    Parameters
    ----------
    plan : Plan
    world : World, optional
        One that the plan's own world has to agree with, in all that matters to a plan; each difference is a
        violation of kind ``world``.

    Returns
    -------
    Report
        ``margins`` has the least margin of every check that measured something: ``joints`` [rad or m],
        ``step``, ``wheels``, ``setpoint``, ``path``, ``floor``, ``zone``, ``clearance``, ``arm``,
        ``contact``, ``self``, ``stops`` [m], ``direction``, ``orientation`` [rad], and of criteria that the
        rules ask for ``manipulability`` [m3], ``joint_margin`` (a share of the range), ``effort`` [N m] or
        [N]; of a timed plan ``timing`` (distance from the proven motion) [m], ``speeds`` (a share of the
        limit of speed or acceleration that is used most), and ``jerk`` where that is limited. Those of
        ``arm``, ``contact`` and ``self`` go up to 0.05; that of ``contact`` is how much deeper the tool might
        sink in. Violations of kind ``structure`` or ``derived`` are of the plan's form, or of fields that its
        states contradict; of kind ``strokes``, lift-offs within one; those of kind ``execution`` tell where
        the arm does not take up the errors that the rules allow for, which limits of other kinds hold too. Of
        many violations of a kind the first 20 are listed, and the rest in one.
    """
    malformed = tuple(malformations(plan))
    if malformed:
        return _report([finding("structure", np.inf, malformed)])
    segments = MotionSegments(plan.world.robot, plan.motion)
    names = StateNames(plan.motion, len(plan.world.task))
    findings: list[Finding] = []
    for found in _findings(plan, segments, names):
        findings.append(found)
        tell("verify", len(findings), 0)
    tell("verify", len(findings), len(findings))
    findings.append(verify_derived_fields(plan, segments, names, findings))
    return _report(findings if world is None else [verify_world(plan, world), *findings])


def _findings(plan: Plan, segments: MotionSegments, names: StateNames) -> Iterator[Finding]:
    world = plan.world
    yield finding("structure", np.inf, inconsistencies(plan, names))
    yield verify_joint_limits(segments, names)
    yield verify_base_steps(segments, names, world.rules.step)
    yield verify_wheels(segments, names)
    yield verify_heading(world, segments, names)
    yield verify_setpoints(world, segments, names)
    yield verify_path(world, segments, names)
    yield verify_direction(world, segments, names)
    yield verify_orientation(world, segments, names)
    yield verify_floor(world, segments, names)
    yield from verify_zones(world, segments, names)
    yield verify_base_clearance(world, segments, names)
    yield from verify_arm_clearance(world, segments, names)
    yield verify_self_collision(segments, names)
    yield verify_strokes(plan, names)
    yield verify_stops(plan, names)
    yield verify_execution(plan, names)
    yield from verify_criteria(world, segments, names)
    yield from verify_speeds(world, segments, names)


def _report(findings: Sequence[Finding]) -> Report:
    violations = tuple(violation for found in findings for violation in found.violations)
    measured = [found for found in findings if found.kind != "structure" and np.isfinite(found.margin)]
    margins = {found.kind: float(found.margin) for found in measured}
    return Report(not violations, margins, violations)


def verify_answers(
    world: World, answer: Answer, targets: Sequence[Target] | None = None, which: Sequence[int] | None = None
) -> Report:
    """Check base and arm of targets said to be reachable, each as a plan of one set-point.

    Joints are held against their limits, the tool against its target, the footprint against floor and
    clearance, and where the rules ask for avoidance, the links against solids and one another.

    Parameters
    ----------
    world : World
    answer : Answer
    targets : sequence of Target, optional
        What was asked, where it was more than points.
    which : sequence of int, optional
        Rows to check; all that are reachable by default.

    Returns
    -------
    Report
        ``setpoint`` of a violation is the target's row. Margins are those of `regionik.verify`, but for
        ``path``: an answer is on no path.

    Raises
    ------
    InputError
        When there is not one target an answer, or a row is not one of a reachable target.
    """
    if targets is not None and len(targets) != len(answer.targets):
        raise InputError(f"targets: expected {len(answer.targets)}, one for each answer, got {len(targets)}")
    rows = np.flatnonzero(answer.reachable).tolist() if which is None else list(which)
    wrong = [i for i in rows if not 0 <= i < len(answer.targets) or not answer.reachable[i]]
    if wrong:
        raise InputError(f"which: expected rows of reachable targets, got {wrong[0]}")
    ignored = PATH_KINDS if world.rules.avoidance else PATH_KINDS + ARM_KINDS
    margins: dict[str, float] = {}
    violations: list[Violation] = []
    for i in rows:
        target = Target(answer.targets[i]) if targets is None else targets[i]
        report = verify(_stationary_plan(world, target, answer.base[i], answer.joints[i]))
        for kind, margin in report.margins.items():
            if kind not in ignored:
                margins[kind] = min(margin, margins.get(kind, np.inf))
        found = [violation for violation in report.violations if violation.kind not in ignored]
        found += _wrong_heading(world, answer.base[i])
        violations += [replace(v, state=None, setpoint=i, text=f"target {i + 1}: {v.text}") for v in found]
    kinds = dict.fromkeys(violation.kind for violation in violations)
    findings = [finding(kind, np.inf, [v for v in violations if v.kind == kind]) for kind in kinds]
    return Report(not violations, margins, tuple(v for found in findings for v in found.violations))


def _wrong_heading(world: World, base: Array) -> Iterator[Violation]:
    if world.rules.heading == "fixed":
        yaw = 0.0 if world.start is None else float(world.start.base[2])
        off = abs(float(wrap_angle(base[2] - yaw)))
        if off > EXACT:
            yield Violation("heading", None, None, off, f"the heading is {off:.4f} rad off the fixed one")


def _stationary_plan(world: World, target: Target, base: Array, joints: Array) -> Plan:
    error = float(np.linalg.norm(world.robot.tool(base, joints)[:3, 3] - target.position))
    motion = Motion(
        np.tile(base, (2, 1)),
        np.tile(joints, (2, 1)),
        np.array(["setpoint", "step"]),
        np.zeros(2, dtype=np.int64),
        np.full(2, np.nan),
    )
    rules = replace(world.rules, mode="continuous", order="given", parking=None, stop_criterion="tolerance")
    alone = replace(world, task=(target,), start=None, rules=rules)
    return Plan(alone, 0, (Configuration(base, joints, error, 0, True),), motion, (), 0)
