"""Sentences of explanations: names of set-points and constraints, causes together, what would mend it."""

from __future__ import annotations

from collections.abc import Sequence

from regionik.explain.relaxations import (
    ARM_CLEARANCE,
    CELLS,
    CLEARANCE,
    FOOTPRINT,
    HEADING,
    OWN_BODY,
    Constraint,
)
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Repair
from regionik.worlds.scene import Target, World


def setpoint(i: int, count: int) -> str:
    """A set-point as people count."""
    return f"Set-point {i + 1} of {count}"


def setpoint_at(task: Sequence[Target], i: int) -> str:
    """A set-point as people count, and where it is."""
    return f"{setpoint(i, len(task))} at {spot(task[i].position)}"


def spot(position: Array) -> str:
    """A position in words."""
    return f"({', '.join(f'{value:z.3f}' for value in position)})"


def join(names: Sequence[str]) -> str:
    """Names in one line."""
    if not names:
        return "nothing"
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def no_way_to(who: str) -> str:
    """The start of a sentence on what is neither shown to be in reach nor ruled out."""
    return f"No way was found to reach {who[0].lower()}{who[1:]}"


def places_open(gap: float) -> str:
    """The start of a sentence on what is left undecided, up to so wide [m]."""
    return f"Places for the base up to {gap:.4f} m across are not ruled out"


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
    return f"{what} is {join(names)} together; without any one of them the rest does not."


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
