"""Sentences of explanations: names of set-points and constraints, causes together, what would mend it."""

from __future__ import annotations

from collections.abc import Sequence

from regionik.explain.relaxations import (
    ARM_CLEARANCE,
    CELLS,
    CLEARANCE,
    FOOTPRINT,
    HEADING,
    JOINT_LIMITS,
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
    unproven = "By inner areas alone, which prove nothing, what stands in the way"
    what = "What rules it out" if proven else unproven
    if not kept:
        return f"{what} is the arm of {world.robot.name} on its mount, whatever else is taken away."
    names = [_name(world, one) for one in kept]
    if len(names) == 1:
        return f"{what} is {names[0]}, by itself."
    return f"{what} is {join(names)} together; without any one of them the rest does not."


def _name(world: World, one: Constraint) -> str:
    """A constraint as it stands in a sentence."""
    words = {
        CLEARANCE: f"the clearance of {world.rules.clearance:g} m",
        ARM_CLEARANCE: f"the arm's clearance of {world.rules.arm_clearance:g} m",
        OWN_BODY: f"that the {OWN_BODY} keep apart",
        HEADING: f"the heading policy '{world.rules.heading}'",
        FOOTPRINT: f"the {FOOTPRINT}",
        CELLS: f"the {CELLS}",
        JOINT_LIMITS: f"the {JOINT_LIMITS} of {world.robot.name}",
    }
    plain = f"the {one.name}" if one.kind in ("floor", "direction") else one.name
    return words.get(one.name, plain)


def mended(repairs: Sequence[Repair]) -> str:
    """A sentence on the smallest repair; empty where there is none."""
    if not repairs:
        return ""
    more = f" ({len(repairs) - 1} more {'way' if len(repairs) == 2 else 'ways'} found)"
    return f"What would mend it: {repairs[0].text}{more if len(repairs) > 1 else ''}."
