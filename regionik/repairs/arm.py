"""Why a target is out of reach of an arm that would touch something from everywhere; what would mend it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from regionik.areas.reachable import model_of
from regionik.areas.relaxations import (
    ARM_CLEARANCE,
    Constraint,
    arm_constraints_of,
    with_arm_clearance,
    with_cone,
    with_mast,
    with_obstacle_moved,
    with_target_moved,
)
from regionik.planners.search.box_search import Verdict
from regionik.reasons.causes import irreducible, no_outer
from regionik.repairs.least import FINE, circle, confirmed, first_that, sphere
from regionik.repairs.moves import obstacle_repair, on_grid, target_repair
from regionik.repairs.smallest import cone_repair, raise_repair, smallest_first
from regionik.repairs.target import arm_too_short, cause_of, mended, together
from regionik.repairs.trials import Change, enters, holds
from regionik.seeking.any_base import search_any_base
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Explanation, Repair
from regionik.worlds.pivoted_arm import reach_bound
from regionik.worlds.scene import World

PROOF, SEARCH = 30_000, 1_500  # cells of postures looked at for a cause, and for an amount of a repair
LENGTHS = 0.01 * 3.0 ** np.arange(5)  # of moves that are tried [m]
DIRECTIONS = 12  # of moves: in space, and on the floor


def no_clear_posture(world: World) -> bool:
    """Whether the first set-point is proven to have no clear posture from any place."""
    return no_outer(world) or search_any_base(world, world.task[0], PROOF).verdict == Verdict.RULED_OUT


def why_arm(world: World, i: int, quick: Explanation) -> Explanation:
    """Causes and repairs of a set-point that has places for the base, but from none of them a clear posture.

    Parameters
    ----------
    world : World
        One that `any_base.can_search`.
    i : int
        Counts from 0; `no_clear_posture` holds for it.
    quick : Explanation
        What is known of it already; its verdict and reason stay.
    """
    asked = replace(world, task=(world.task[i],))
    kept = irreducible(asked, arm_constraints_of(asked), no_clear_posture)
    who = f"set-point {i + 1}" if len(world.task) > 1 else "the target"
    repairs = _repairs(asked, kept, who)
    causes = tuple(cause_of(one, quick) for one in kept) or (arm_too_short(world, quick),)
    proof = "This is a proof: with these no posture from any place is clear."
    words = " ".join([quick.reason, together(asked, kept, proven=True), proof, mended(repairs)]).strip()
    return replace(quick, reason=words, causes=causes, repairs=repairs)


def _repairs(world: World, causes: Sequence[Constraint], who: str) -> tuple[Repair, ...]:
    found = [_lower(world), _cone(world, who), _raise(world), _target(world, who)]
    found += [_obstacle(world, one.name) for one in causes if one.kind == "obstacle"]
    return smallest_first(world, [repair for repair in found if repair is not None])


def _lower(world: World) -> Repair | None:
    most = world.rules.arm_clearance
    cut = _least(world, lambda cut: with_arm_clearance(world, max(0.0, most - cut)), most)
    if cut is None:
        return None
    left = max(0.0, round(most - cut, 6))
    text = f"lower the arm's clearance of {most:.4f} m to {left:.4f} m"
    return Repair("clearance", ARM_CLEARANCE, left, text)


def _cone(world: World, who: str) -> Repair | None:
    target = world.task[0]
    if target.direction is None or not model_of(world, target).exact:
        return None
    most = np.pi - target.cone
    more = _least(world, lambda more: with_cone(world, min(np.pi, target.cone + more)), most)
    return None if more is None else cone_repair(world, who, min(np.pi, round(target.cone + more, 6)))


def _raise(world: World) -> Repair | None:
    rise = _least(world, lambda rise: with_mast(world, rise), reach_bound(world.robot.chain).length)
    return None if rise is None else raise_repair(world, rise)


def _target(world: World, who: str) -> Repair | None:
    by = _step(world, lambda by: with_target_moved(world, 0, by), sphere(DIRECTIONS))
    return None if by is None else target_repair(who, by)


def _obstacle(world: World, name: str) -> Repair | None:
    if not any(solid.name == name for solid in world.obstacles):  # cells of a map are nobody's to move
        return None
    by = _step(world, lambda by: with_obstacle_moved(world, name, by), circle(DIRECTIONS))
    return None if by is None else obstacle_repair(name, by)


def _seen(world: World, changed: World) -> bool:
    """Whether a clear posture is found in a changed world, and the target is not newly in a solid."""
    if changed.task[0].position[2] < 0 or enters(world, changed):
        return False
    return search_any_base(changed, changed.task[0], SEARCH).verdict == Verdict.PROVEN


def _least(world: World, change: Change, most: float) -> float | None:
    """The least amount of a change that helps, confirmed."""
    if most < FINE:
        return None
    amount = first_that(lambda one: _seen(world, change(one)), most)
    return None if amount is None else confirmed(lambda one: holds(world, change(one)), amount, most)


def _step(world: World, change: Callable[[Array], World], directions: Array) -> Array | None:
    """A short step that helps: of a few lengths the first at which some direction does, then less of it."""

    def along(way: Array) -> Change:
        return lambda amount: change(on_grid(amount * way))

    for length in LENGTHS.tolist():
        for way in directions:
            if _seen(world, along(way)(length)):
                amount = _least(world, along(way), length)
                if amount is not None:
                    return on_grid(amount * way)
    return None
