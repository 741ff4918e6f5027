"""The smallest single changes that bring a target within reach, each checked by asking again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from regionik.areas.reachable import model_of
from regionik.areas.relaxations import (
    ARM_CLEARANCE,
    CLEARANCE,
    Constraint,
    with_clearance,
    with_cone,
    with_mast,
)
from regionik.repairs.least import FINE, least_open
from regionik.repairs.moves import obstacle_moved, target_moved
from regionik.repairs.trials import checked, opened
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Repair
from regionik.worlds.pivoted_arm import reach_bound
from regionik.worlds.scene import Target, World


def repairs_of_target(world: World, causes: Iterable[Constraint], who: str) -> tuple[Repair, ...]:
    """All single changes that were found to help, the smallest first.

    Parameters
    ----------
    world : World
        Its task is the one target.
    causes : iterable of Constraint
        An irreducible set: an obstacle that is not in it does not help by moving.
    who : str
        The target's name.
    """
    found = [_clearance(world), _cone(world, who), _raise(world), target_moved(world, who)]
    found += [obstacle_moved(world, one.name) for one in causes if one.kind == "obstacle"]
    return smallest_first(world, [repair for repair in found if repair is not None])


def smallest_first(world: World, repairs: Sequence[Repair]) -> tuple[Repair, ...]:
    """Repairs in the order of `share`."""
    return tuple(sorted(repairs, key=lambda repair: (share(world, repair), repair.kind, repair.name)))


def share(world: World, repair: Repair) -> float:
    """How small a repair is in its own terms.

    A length counts as a part of the arm's length, a clearance by what it loses, a cone by what it gains as a
    part of a half turn, a lift-off as one.
    """
    span = reach_bound(world.robot.chain)
    length = span.radius + span.length
    if repair.kind == "clearance":
        now = world.rules.arm_clearance if repair.name == ARM_CLEARANCE else world.rules.clearance
        return (now - repair.amount) / length
    if repair.kind == "cone":
        return (repair.amount - min(target.cone for target in world.task)) / np.pi
    return repair.amount / (1.0 if repair.kind == "lift-off" else length)


def _clearance(world: World) -> Repair | None:
    most = world.rules.clearance

    def change(cut: float) -> World:
        return with_clearance(world, left(most, cut))

    if most == 0 or not world.solids:
        return None
    low, high = 0.0, most
    while high - low > 1e-5 and opened(change(high), world.task)[0]:  # the less, the more room
        middle = (low + high) / 2
        low, high = (low, middle) if opened(change(middle), world.task)[0] else (middle, high)
    cut = checked(world, change, high, most)
    if cut is None:
        return None
    return clearance_repair(world, left(most, cut))


def left(clearance: float, cut: float) -> float:
    """What is left of a clearance, rounded to what is told [m]."""
    return max(0.0, round(float(np.floor((clearance - cut) / FINE + 1e-6)) * FINE, 6))


def clearance_repair(world: World, amount: float) -> Repair:
    """Another clearance, as a repair [m]."""
    text = f"lower the clearance of {world.rules.clearance:.4f} m to {amount:.4f} m"
    return Repair("clearance", CLEARANCE, amount, text)


def _cone(world: World, who: str) -> Repair | None:
    target = world.task[0]
    most = np.pi - target.cone
    if target.direction is None or most <= 0 or not model_of(world, target).exact:
        return None

    def wider(more: float) -> float:
        return min(np.pi, round(float(np.ceil((target.cone + more) / FINE - 1e-6)) * FINE, 6))

    def change(more: float) -> World:
        return with_cone(world, wider(more))

    def opens(amounts: Array) -> NDArray[np.bool_]:
        return opened(world, [change(float(more)).task[0] for more in amounts])

    more = checked(world, change, least_open(opens, most), most)
    if more is None:
        return None
    return cone_repair(world, who, wider(more))


def cone_repair(world: World, who: str, cone: float) -> Repair:
    """A wider cone, as a repair [rad]."""
    now = world.task[0].cone
    text = f"open the cone of {now:.4f} rad about the direction of {who} to {cone:.4f} rad"
    return Repair("cone", who, cone, text, "rad")


def _raise(world: World) -> Repair | None:
    span = reach_bound(world.robot.chain)
    height = float(world.task[0].position[2] - world.robot.mount[2]) - span.height
    most = max(0.0, height) + span.length

    def opens(amounts: Array) -> NDArray[np.bool_]:
        # To the arm a higher mount is a lower target, and the base does not see either.
        return opened(world, [_lowered(world.task[0], float(rise)) for rise in amounts])

    if not model_of(world, world.task[0]).exact:  # each height of another arm is looked at by itself
        return None
    rise = checked(world, lambda rise: with_mast(world, rise), least_open(opens, most), most)
    if rise is None:
        return None
    return raise_repair(world, rise)


def raise_repair(world: World, rise: float) -> Repair:
    """A higher mount, as a repair [m]."""
    return Repair("raise", world.robot.name, rise, f"mount the arm of {world.robot.name} {rise:.4f} m higher")


def _lowered(target: Target, rise: float) -> Target:
    return replace(target, position=target.position - [0.0, 0.0, rise])
