"""Answers of `regionik.reach` checked again, each as a plan of one set-point, by `regionik.verify`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from regionik.values import Configuration, Motion, Plan, Report, Violation
from regionik.verification.findings import finding
from regionik.verification.verifier import verify
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.scene import Target, World

SLACK = 1e-9  # [rad]
_ARM = ("arm", "self")  # checks of what the arm touches


class Answered(Protocol):
    """What is read of the answers of `regionik.reach`."""

    @property
    def targets(self) -> Array: ...

    @property
    def reachable(self) -> NDArray[np.bool_]: ...

    @property
    def base(self) -> Array: ...

    @property
    def joints(self) -> Array: ...


def verify_answers(
    world: World,
    answer: Answered,
    targets: Sequence[Target] | None = None,
    which: Sequence[int] | None = None,
) -> Report:
    """Check base and arm of targets that are said to be reachable, by other code than made the answer.

    Joints are held against their limits, the tool against its target, the footprint against floor and
    clearance, and where the rules lead the arm round things, its links against solids and one another.

    Parameters
    ----------
    world : World
    answer : Answer
    targets : sequence of Target, optional
        What was asked, where it was more than points.
    which : sequence of int, optional
        Rows to look at; all that are reachable by default.

    Returns
    -------
    Report
        ``setpoint`` of a violation is the target's row. Margins are those of `regionik.verify`.

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
    margins: dict[str, float] = {}
    violations: list[Violation] = []
    for i in rows:
        target = Target(answer.targets[i]) if targets is None else targets[i]
        report = verify(_stand(world, target, answer.base[i], answer.joints[i]))
        kept = {kind: m for kind, m in report.margins.items() if world.rules.avoidance or kind not in _ARM}
        for kind, margin in kept.items():
            margins[kind] = min(margin, margins.get(kind, np.inf))
        told = [one for one in report.violations if world.rules.avoidance or one.kind not in _ARM]
        told += _heading(world, answer.base[i])
        violations += [
            replace(one, state=None, setpoint=i, text=f"target {i + 1}: {one.text}") for one in told
        ]
    kinds = dict.fromkeys(one.kind for one in violations)
    found = [finding(kind, np.inf, [one for one in violations if one.kind == kind]) for kind in kinds]
    return Report(not violations, margins, tuple(one for part in found for one in part.violations))


def _heading(world: World, base: Array) -> Iterator[Violation]:
    """A base whose heading the rules fix has it."""
    if world.rules.heading == "fixed":
        yaw = 0.0 if world.start is None else float(world.start.base[2])
        off = abs(float(np.remainder(base[2] - yaw + np.pi, 2 * np.pi) - np.pi))
        if off > SLACK:
            yield Violation(
                "heading", None, None, off, f"the heading is {off:.4f} rad off the one that is fixed"
            )


def _stand(world: World, target: Target, base: Array, joints: Array) -> Plan:
    """A plan that stands on one target, and stays."""
    error = float(np.linalg.norm(world.robot.tool(base, joints)[:3, 3] - target.position))
    motion = Motion(
        np.tile(base, (2, 1)),
        np.tile(joints, (2, 1)),
        np.array(["setpoint", "step"]),
        np.zeros(2, dtype=np.int64),
        np.full(2, np.nan),
    )
    alone = replace(world, task=(target,), start=None)
    return Plan(alone, 0, (Configuration(base, joints, error, 0, True),), motion, (), 0)
