"""Why a target is out of reach: an irreducible set of causes, and the smallest repairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from regionik.areas.relaxations import (
    ARM_CLEARANCE,
    CELLS,
    CLEARANCE,
    FOOTPRINT,
    HEADING,
    OWN_BODY,
    Constraint,
    constraints_of,
)
from regionik.reach import Answer, places_open, reach
from regionik.reasons import explain
from regionik.reasons.causes import irreducible, no_inner, no_outer
from regionik.repairs.smallest import repairs_of_target
from regionik.worlds.errors import Cause, Explanation, Repair
from regionik.worlds.scene import World


def why_target(world: World, i: int, quick: Explanation) -> Explanation:
    """Causes and repairs of a set-point whose inner area is empty.

    Parameters
    ----------
    world : World
    i : int
        Counts from 0.
    quick : Explanation
        What is known of it already; its margins stay. What is undecided is looked at closely by itself.
    """
    asked = replace(world, task=(world.task[i],))
    if quick.verdict == "undecided":
        quick = by_itself(quick, reach(asked, asked.task), explain.setpoint(i, len(world.task)))
    proven = no_outer(asked)
    kept = irreducible(asked, constraints_of(asked), no_outer if proven else no_inner)
    who = f"set-point {i + 1}" if len(world.task) > 1 else "the target"
    repairs = repairs_of_target(asked, kept, who)
    causes = tuple(cause_of(one, quick) for one in kept) or (arm_too_short(world, quick),)
    proof = "This is a proof: with these the outer area is empty." if proven else ""
    parts = [quick.reason, together(world, kept, proven=proven), proof, mended(repairs)]
    return replace(quick, reason=" ".join(part for part in parts if part), causes=causes, repairs=repairs)


def by_itself(quick: Explanation, answer: Answer, who: str) -> Explanation:
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


def cause_of(one: Constraint, quick: Explanation) -> Cause:
    """A constraint as a cause, with what is known to be missing [m]."""
    margins = {cause.name: cause.margin for cause in quick.causes}
    kinds = {cause.kind: cause.margin for cause in quick.causes if cause.kind in ("floor", "obstacle")}
    if one.kind == "clearance":
        return Cause(one.kind, one.name, kinds.get("obstacle"))
    return Cause(one.kind, one.name, kinds.get("floor") if one.kind == "floor" else margins.get(one.name))


def arm_too_short(world: World, quick: Explanation) -> Cause:
    """The cause where nothing that can be taken away is one."""
    margin = next((cause.margin for cause in quick.causes if cause.kind == "reach"), None)
    return Cause("reach", world.robot.name, margin)


def together(world: World, kept: Sequence[Constraint], *, proven: bool) -> str:
    """A sentence on what belongs together; where it rests on inner areas alone it says so first."""
    if not kept and proven:
        return f"The arm of {world.robot.name} on its mount is too short, whatever else is taken away."
    what = (
        "What rules it out" if proven else "By inner areas alone, which prove nothing, what stands in the way"
    )
    if not kept:
        return f"{what} is the arm of {world.robot.name} on its mount, whatever else is taken away."
    names = [_name(world, one) for one in kept]
    if len(names) == 1:
        return f"{what} is {names[0]}, by itself."
    return f"{what} is {explain.join(names)} together; without any one of them the rest does not."


def _name(world: World, one: Constraint) -> str:
    match one.name:
        case name if name == CLEARANCE:
            return f"the clearance of {world.rules.clearance:g} m"
        case name if name == ARM_CLEARANCE:
            return f"the arm's clearance of {world.rules.arm_clearance:g} m"
        case name if name == OWN_BODY:
            return f"that the {name} keep apart"
        case name if name == HEADING:
            return f"the heading policy '{world.rules.heading}'"
        case name if name in (FOOTPRINT, CELLS) or one.kind in ("floor", "direction"):
            return f"the {name}"
        case name if one.kind == "limits":
            return f"the {name} of {world.robot.name}"
        case name:
            return name


def mended(repairs: Sequence[Repair]) -> str:
    """A sentence on the smallest repair; empty where there is none."""
    if not repairs:
        return ""
    more = f" ({len(repairs) - 1} more {'way' if len(repairs) == 2 else 'ways'} found)"
    return f"What would mend it: {repairs[0].text}{more if len(repairs) > 1 else ''}."
