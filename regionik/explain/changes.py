"""Table of the changes that may mend a failure: the changed world, the size of a change, and its words."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from regionik.areas.reachable import model_of
from regionik.explain.constraints import ARM_CLEARANCE, CLEARANCE, with_rules
from regionik.explain.minimal_change import FINE, grid_above
from regionik.worlds.arms import reach_bound
from regionik.worlds.arrays import Array
from regionik.worlds.chain import translation
from regionik.worlds.errors import Repair, RepairKind, Unit
from regionik.worlds.scene import Target, World


@dataclass(frozen=True)
class ChangeKind:
    """One row of the table."""

    made: Callable[[World, Repair, int], World]  # the world with it made, to set-point i
    share: Callable[[World, Repair], float]  # relative size of a repair
    text: Callable[[World, Repair], str]  # words for a repair
    unit: Unit = "m"


def repaired(world: World, repair: Repair, i: int = 0) -> World:
    """Return the world with a repair made, and what it has besides; a moved target is set-point i."""
    made = _TABLE[repair.kind].made(world, repair, i)
    for other in repair.also:
        made = repaired(made, other, i)
    return made


def share(world: World, repair: Repair) -> float:
    """Relative size of a repair, with what it has besides.

    Lengths, and the loss of a clearance, count as parts of the arm's length, the gain of a cone as a part of
    a half turn, a lift-off as one.
    """
    return _TABLE[repair.kind].share(world, repair) + sum(share(world, other) for other in repair.also)


def both(one: Repair, other: Repair) -> Repair:
    """One repair and then another, as one."""
    return replace(one, text=f"{one.text}, and {other.text}", also=(*one.also, other))


def smallest_first(world: World, repairs: Iterable[Repair]) -> tuple[Repair, ...]:
    """Return repairs in the order of `share`."""
    return tuple(sorted(repairs, key=lambda repair: (share(world, repair), repair.kind, repair.name)))


def _repair(world: World, kind: RepairKind, name: str, amount: float, by: Iterable[float] = ()) -> Repair:
    row = _TABLE[kind]
    silent = Repair(kind, name, amount, "", row.unit, tuple(by))
    return replace(silent, text=row.text(world, silent))


# Changes of a world ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Change:
    """A change of one world by any amount."""

    world: World
    most: float  # largest amount that is tried
    repair: Callable[[float], Repair]  # the repair of an amount, rounded to the grid of `FINE`
    # The target that in the unchanged world has the areas of the world changed by an amount
    as_target: Callable[[float], Target] | None = None
    # True where more of it never takes room away, so that bisection alone finds the least
    monotone: bool = False
    counted: bool = False  # true where amounts are whole numbers

    def at(self, amount: float) -> World:
        """Return the world changed by an amount."""
        return repaired(self.world, self.repair(amount))


@dataclass(frozen=True, eq=False)
class Move:
    """A change of one world by a step of (2,) or (3,) in some direction [m]."""

    world: World
    kind: RepairKind
    name: str

    def repair(self, step: Array) -> Repair:
        """Return the repair of a step, rounded to the grid."""
        by = on_grid(step)
        return _repair(self.world, self.kind, self.name, float(np.linalg.norm(by)), by.tolist())

    def at(self, step: Array) -> World:
        """Return the world with the step made."""
        return repaired(self.world, self.repair(step))

    def along(self, way: Array, most: float) -> Change:
        """Return steps along one unit direction."""
        return Change(self.world, most, lambda amount: self.repair(amount * way))


def on_grid(step: Array) -> Array:
    """A step on the grid of `FINE`; adding zero makes no zero negative."""
    return np.round(np.round(step / FINE) * FINE, 6) + 0.0


def lower_clearance(world: World, name: str = CLEARANCE) -> Change | None:
    """Less clearance of the base, or of the arm."""
    most = _clearance(world, name)
    if most == 0:
        return None

    def repair(cut: float) -> Repair:
        left = float(np.floor((most - cut) / FINE + 1e-6)) * FINE
        return _repair(world, "clearance", name, max(0.0, round(left, 6)))

    return Change(world, most, repair, monotone=name == CLEARANCE)


def open_cone(world: World, who: str) -> Change | None:
    """A wider cone about the direction of a world's one target, where areas are exact."""
    target = world.task[0]
    if target.direction is None or target.cone >= np.pi or not model_of(world, target).exact:
        return None

    def cone(more: float) -> float:
        return min(np.pi, grid_above(target.cone + more))

    return Change(
        world,
        np.pi - target.cone,
        lambda more: _repair(world, "cone", who, cone(more)),
        lambda more: replace(target, cone=cone(more)),
    )


def raise_arm(world: World, most: float) -> Change:
    """A higher mount: the arm sees it as a lower target, and the base sees neither."""
    target = world.task[0]
    return Change(
        world,
        most,
        lambda rise: _repair(world, "raise", world.robot.name, float(on_grid(np.array(rise)))),
        lambda rise: replace(target, position=target.position - [0.0, 0.0, rise]),
    )


def allow_lift_offs(world: World, i: int) -> Change | None:
    """More lift-offs, the first before set-point i."""
    allowed, name = world.rules.max_lift_offs, f"set-point {i + 1}"
    most = 0 if allowed is None else len(world.task) - 1 - allowed
    if most < 1:
        return None
    return Change(
        world, most, lambda more: _repair(world, "lift-off", name, float(round(more))), counted=True
    )


def one_lift_off(world: World, i: int) -> Repair:
    """One more lift-off, before set-point i."""
    return _repair(world, "lift-off", f"set-point {i + 1}", 1.0)


def move_target(world: World, who: str) -> Move:
    """The world's one target elsewhere in space."""
    return Move(world, "move-target", who)


def move_start(world: World) -> Move:
    """The start of the base elsewhere on the floor."""
    return Move(world, "move-start", "the start")


def smaller_circle(world: World, radius: float) -> Repair:
    """A smaller circle to park in at stops."""
    return _repair(world, "stop-tolerance", "rules.stop_tolerance", radius)


def move_obstacle(world: World, name: str) -> Move | None:
    """An obstacle elsewhere on the floor; None for the cells of a map, which cannot be moved."""
    known = any(solid.name == name for solid in world.obstacles)
    return Move(world, "move-obstacle", name) if known else None


# The table ---------------------------------------------------------------------------------------------


def _rule(name: str) -> str:
    return "arm_clearance" if name == ARM_CLEARANCE else "clearance"


def _clearance(world: World, name: str) -> float:
    return getattr(world.rules, _rule(name))


def _arm_length(world: World) -> float:
    span = reach_bound(world.robot.chain)
    return span.radius + span.length


def _raised(world: World, repair: Repair, _: int) -> World:
    """The arm and all that is fixed to its links mounted higher."""
    mount = world.robot.mount + np.array([0.0, 0.0, repair.amount, 0.0])
    return replace(world, robot=replace(world.robot, mount=mount))


def _with_cone(world: World, repair: Repair, _: int) -> World:
    return replace(world, task=tuple(replace(target, cone=repair.amount) for target in world.task))


def _with_target_moved(world: World, repair: Repair, i: int) -> World:
    moved = replace(world.task[i], position=world.task[i].position + np.array(repair.vector))
    return replace(world, task=(*world.task[:i], moved, *world.task[i + 1 :]))


def _with_obstacle_moved(world: World, repair: Repair, _: int) -> World:
    x, y = repair.vector
    T = translation(x, y, 0.0)
    moved = tuple(one.transformed(T) if one.name == repair.name else one for one in world.obstacles)
    return replace(world, obstacles=moved)


def _with_start_moved(world: World, repair: Repair, _: int) -> World:
    if world.start is None:
        return world
    return replace(world, start=replace(world.start, base=world.start.base + np.array([*repair.vector, 0.0])))


def _with_lift_offs(world: World, repair: Repair, _: int) -> World:
    return with_rules(world, max_lift_offs=(world.rules.max_lift_offs or 0) + round(repair.amount))


def _part_of_arm(world: World, repair: Repair) -> float:
    return repair.amount / _arm_length(world)


def _clearance_text(world: World, repair: Repair) -> str:
    whose = "arm's clearance" if repair.name == ARM_CLEARANCE else "clearance"
    return f"lower the {whose} of {_clearance(world, repair.name):.4f} m to {repair.amount:.4f} m"


def _move_text(_: World, repair: Repair) -> str:
    by = ", ".join(f"{part:z.4f}" for part in repair.vector)
    return f"move {repair.name} by ({by}) m, {repair.amount:z.4f} m in all"


def _lift_off_text(_: World, repair: Repair) -> str:
    if repair.amount == 1:
        return f"allow a lift-off before {repair.name}"
    return f"allow {round(repair.amount)} more, the first before {repair.name}"


_TABLE: dict[RepairKind, ChangeKind] = {
    "clearance": ChangeKind(
        lambda world, repair, _: with_rules(world, **{_rule(repair.name): repair.amount}),
        lambda world, repair: (_clearance(world, repair.name) - repair.amount) / _arm_length(world),
        _clearance_text,
    ),
    "cone": ChangeKind(
        _with_cone,
        lambda world, repair: (repair.amount - min(target.cone for target in world.task)) / np.pi,
        lambda world, repair: (
            f"open the cone of {world.task[0].cone:.4f} rad about the direction of {repair.name} to "
            f"{repair.amount:.4f} rad"
        ),
        "rad",
    ),
    "raise": ChangeKind(
        _raised,
        _part_of_arm,
        lambda _, repair: f"mount the arm of {repair.name} {repair.amount:.4f} m higher",
    ),
    "move-target": ChangeKind(_with_target_moved, _part_of_arm, _move_text),
    "move-obstacle": ChangeKind(_with_obstacle_moved, _part_of_arm, _move_text),
    "move-start": ChangeKind(_with_start_moved, _part_of_arm, _move_text),
    "stop-tolerance": ChangeKind(
        lambda world, repair, _: with_rules(world, stop_tolerance=repair.amount),
        lambda world, repair: (world.rules.stop_tolerance - repair.amount) / _arm_length(world),
        lambda world, repair: (
            f"lower the stop_tolerance of {world.rules.stop_tolerance:.4f} m to {repair.amount:.4f} m"
        ),
    ),
    "lift-off": ChangeKind(_with_lift_offs, lambda _, repair: repair.amount, _lift_off_text, "1"),
}
