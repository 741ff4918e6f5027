"""Explanations with irreducible causes and the smallest repairs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from regionik.explain.causes import irreducible
from regionik.explain.changes import Move, smallest_first
from regionik.explain.constraints import Constraint, joint_causes, mended, places_open, setpoint
from regionik.explain.pairs import pair
from regionik.explain.questions import Oracles, Question, TargetQuestion
from regionik.explain.several import failures_of, in_order, naming_all
from regionik.explain.steps import scene_of_setpoint
from regionik.planners.progress import track
from regionik.scene import Scene
from regionik.worlds.errors import Cause, Explanation, Repair, SetpointFailure

Say = Callable[[str], None]

if TYPE_CHECKING:
    from regionik.values import Answer


def unsaid(sentence: str) -> None:
    """Say nothing."""


def explained(question: Question, quick: Explanation, say: Say = unsaid) -> Explanation:
    """Return an explanation with its causes and repairs, for a question whose answer is no.

    Verdict and margins of the ``quick`` explanation, by the stage that failed, are kept. ``say`` is called
    with what failed, then its causes, then each repair as it is found, in no order.
    """
    scene = question.scene
    say(quick.reason)
    remaining = irreducible(scene, question.constraints, question.closed)
    why = f"{joint_causes(scene, remaining, proven=bool(question.proof))} {question.proof}".strip()
    say(why)
    repairs = _repairs(question, remaining, say)
    causes = tuple(cause_of(one, quick) for one in remaining) or (arm_too_short(scene, quick),)
    told = mended(repairs, () if repairs else tried(question, remaining))
    reason = " ".join(part for part in (quick.reason, why, told) if part)
    return replace(quick, reason=reason, causes=causes, repairs=repairs)


def _repairs(question: Question, causes: Sequence[Constraint], say: Say) -> tuple[Repair, ...]:
    """Repairs of a question, those first that leave no other set-point out of reach, then the smallest."""
    changes = [change for change in question.changes(causes) if change is not None]
    whole, partial = list[Repair](), list[Repair]()
    for change in track("repairs", changes):
        found = question.shortest(change) if isinstance(change, Move) else question.least(change)
        if found is not None:
            left = question.leaves(found)
            found = replace(found, text=found.text + left)
            (partial if left else whole).append(found)
            say(f"This would mend it: {found.text}.")
    if not whole and not partial and isinstance(question, TargetQuestion):
        found = pair(question, causes)
        if found is not None:
            found = replace(found, text=found.text + question.leaves(found))
            say(f"This would mend it: {found.text}.")
            return (found,)
    if not whole and not partial:
        say(mended((), tried(question, causes)))
    return smallest_first(question.scene, whole) + smallest_first(question.scene, partial)


def tried(question: Question, causes: Sequence[Constraint]) -> tuple[str, ...]:
    """Words on the changes that a question tries, each with the most of it."""
    return tuple(
        f"move {change.name} by up to {question.farthest(change):.4g} m"
        if isinstance(change, Move)
        else change.repair(change.most).text
        for change in question.changes(causes)
        if change is not None
    )


def explained_target(
    scene: Scene, i: int, quick: Explanation, oracles: Oracles, say: Say = unsaid
) -> Explanation:
    """Return `explained` for a set-point whose inner area is empty; if undecided, `reach` is asked first."""
    asked = scene_of_setpoint(scene, i)
    if quick.verdict == "undecided":
        quick = _by_itself(quick, oracles.reach(asked), i, len(scene.task))
    return explained(
        TargetQuestion(asked, target_name(scene, i), oracles, (scene.about_path(), i)), quick, say
    )


def target_name(scene: Scene, i: int) -> str:
    """Name of the set-point that a change is about."""
    return f"set-point {i + 1}" if len(scene.task) > 1 else "the target"


def _by_itself(quick: Explanation, answer: Answer, i: int, count: int) -> Explanation:
    """The explanation of set-point i of several without a known place, with what `reach` says of it alone."""
    if answer.verdict[0] == "unreachable":
        told = f"{setpoint(i, count)}{answer.reason[0].removeprefix('The target').rstrip('.')}."
        others = [one for one in failures_of(quick) if one.setpoint != i]
        failures = in_order([*others, SetpointFailure(i, "unreachable", told)])
        return naming_all(replace(quick, verdict="unreachable", reason=told, failures=failures), count)
    if answer.reachable[0]:
        x, y, yaw = answer.base[0]
        told = (
            f"By itself it can be reached, with the base at ({x:z.3f}, {y:z.3f}, {yaw:z.3f} rad): a plan by "
            "way of such places, which inner areas leave out, would decide it."
        )
    else:
        told = f"{places_open(answer.gap[0])}: a posture from one of them would decide it."
    return replace(quick, reason=f"{quick.reason} {told}")


def cause_of(one: Constraint, quick: Explanation) -> Cause:
    """A constraint as a cause, with the margin that is known to be missing [m]."""
    margins = {cause.name: cause.margin for cause in quick.causes}
    kinds = {cause.kind: cause.margin for cause in quick.causes if cause.kind in ("floor", "obstacle")}
    if one.kind == "clearance":
        return Cause(one.kind, one.name, kinds.get("obstacle"))
    return Cause(one.kind, one.name, kinds.get("floor") if one.kind == "floor" else margins.get(one.name))


def arm_too_short(scene: Scene, quick: Explanation) -> Cause:
    """The cause where no constraint that can be dropped is one."""
    margin = next((cause.margin for cause in quick.causes if cause.kind == "reach"), None)
    return Cause("reach", scene.robot.name, margin)
