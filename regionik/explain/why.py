"""Quick words on a no, with irreducible causes and the smallest repairs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from regionik.explain.causes import arm_too_short, cause_of, irreducible
from regionik.explain.changes import Move, smallest_first
from regionik.explain.questions import Oracles, Question, TargetQuestion
from regionik.explain.sentences import mended, places_open, setpoint, together
from regionik.worlds.errors import Explanation
from regionik.worlds.scene import World

if TYPE_CHECKING:
    from regionik.reachability.reach import Answer


def explained(question: Question, quick: Explanation) -> Explanation:
    """Return the quick words on a no with its causes and repairs.

    Parameters
    ----------
    question : Question
        Its world's answer is no.
    quick : Explanation
        What is known of it already; its verdict and margins stay.
    """
    world = question.world
    kept = irreducible(world, question.constraints, question.closed)
    tried = (
        question.shortest(change) if isinstance(change, Move) else question.least(change)
        for change in question.changes(kept)
        if change is not None
    )
    repairs = smallest_first(world, [repair for repair in tried if repair is not None])
    causes = tuple(cause_of(one, quick) for one in kept) or (arm_too_short(world, quick),)
    parts = [
        quick.reason,
        together(world, kept, proven=bool(question.proof)),
        question.proof,
        mended(repairs),
    ]
    return replace(quick, reason=" ".join(part for part in parts if part), causes=causes, repairs=repairs)


def explained_target(world: World, i: int, quick: Explanation, oracles: Oracles) -> Explanation:
    """`explained` for a set-point whose inner area is empty; what is undecided is asked by itself."""
    asked = replace(world, task=(world.task[i],))
    if quick.verdict == "undecided":
        quick = _by_itself(quick, oracles.reach(asked), setpoint(i, len(world.task)))
    return explained(TargetQuestion(asked, target_name(world, i), oracles), quick)


def target_name(world: World, i: int) -> str:
    """A set-point as the one that a change is about."""
    return f"set-point {i + 1}" if len(world.task) > 1 else "the target"


def _by_itself(quick: Explanation, answer: Answer, who: str) -> Explanation:
    """The quick words on a set-point that no place is known for, with what `reach` says of it alone."""
    if answer.verdict[0] == "unreachable":
        told = f"{who}{answer.reason[0].removeprefix('The target').rstrip('.')}."
        return replace(quick, verdict="unreachable", reason=told)
    if answer.reachable[0]:
        x, y, yaw = answer.base[0]
        told = (
            f"By itself it can be reached, with the base at ({x:z.3f}, {y:z.3f}, {yaw:z.3f} rad): a plan by "
            "way of such places, which inner areas leave out, would decide it."
        )
    else:
        told = f"{places_open(answer.gap[0])}: a posture from one of them would decide it."
    return replace(quick, reason=f"{quick.reason} {told}")
