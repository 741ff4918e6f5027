"""Table of the changes that may mend a failure: the changed world, the size of a change, and its words."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from regionik.explain.constraints import (
    ARM_CLEARANCE,
    CLEARANCE,
    own_clearance,
    with_own_clearance,
    with_rules,
)
from regionik.explain.minimal_change import grid_above
from regionik.explain.options import EXPLAIN
from regionik.scene import Scene
from regionik.worlds.arms import reach_bound
from regionik.worlds.arrays import Array
from regionik.worlds.chain import translation
from regionik.worlds.errors import Repair, RepairKind, Unit
from regionik.worlds.obstacles import Solid
from regionik.worlds.scene import Target


@dataclass(frozen=True)
class ChangeKind:
    """One row of the table."""

    made: Callable[[Scene, Repair, int], Scene]  # the world with it made, to set-point i
    share: Callable[[Scene, Repair], float]  # relative size of a repair
    text: Callable[[Scene, Repair], str]  # words for a repair
    unit: Unit = "m"


def repaired(scene: Scene, repair: Repair, i: int = 0) -> Scene:
    """Return the world with a repair made, and what it has besides; a moved target is set-point i."""
    made = _TABLE[repair.kind].made(scene, repair, i)
    for other in repair.also:
        made = repaired(made, other, i)
    return made


def share(scene: Scene, repair: Repair) -> float:
    """Relative size of a repair, with what it has besides.

    Lengths, and the loss of a clearance, count as parts of the arm's length, the gain of a cone as a part of
    a half turn, a lift-off as one.
    """
    return _TABLE[repair.kind].share(scene, repair) + sum(share(scene, other) for other in repair.also)


def both(one: Repair, other: Repair) -> Repair:
    """One repair and then another, as one."""
    return replace(one, text=f"{one.text}, and {other.text}", also=(*one.also, other))


def smallest_first(scene: Scene, repairs: Iterable[Repair]) -> tuple[Repair, ...]:
    """Return repairs in the order of `share`."""
    return tuple(sorted(repairs, key=lambda repair: (share(scene, repair), repair.kind, repair.name)))


def _repair(scene: Scene, kind: RepairKind, name: str, amount: float, by: Iterable[float] = ()) -> Repair:
    row = _TABLE[kind]
    silent = Repair(kind, name, amount, "", row.unit, tuple(by))
    return replace(silent, text=row.text(scene, silent))


# Changes of a world ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Change:
    """A change of one world by any amount."""

    scene: Scene
    most: float  # largest amount that is tried
    repair: Callable[[float], Repair]  # the repair of an amount, rounded to the grid
    # The target that in the unchanged world has the areas of the world changed by an amount
    as_target: Callable[[float], Target] | None = None
    # True where more of it never takes room away, so that bisection alone finds the least
    monotone: bool = False
    counted: bool = False  # true where amounts are whole numbers

    def at(self, amount: float) -> Scene:
        """Return the world changed by an amount."""
        return repaired(self.scene, self.repair(amount))


@dataclass(frozen=True, eq=False)
class Move:
    """A change of one world by a step of (2,) or (3,) in some direction [m]."""

    scene: Scene
    kind: RepairKind
    name: str

    def repair(self, step: Array) -> Repair:
        """Return the repair of a step, rounded to the grid."""
        by = on_grid(step)
        return _repair(self.scene, self.kind, self.name, float(np.linalg.norm(by)), by.tolist())

    def at(self, step: Array) -> Scene:
        """Return the world with the step made."""
        return repaired(self.scene, self.repair(step))

    def along(self, way: Array, most: float) -> Change:
        """Return steps along one unit direction."""
        return Change(self.scene, most, lambda amount: self.repair(amount * way))


def on_grid(step: Array) -> Array:
    """A step on the grid of amounts; adding zero makes no zero negative."""
    return np.round(np.round(step / EXPLAIN.grid) * EXPLAIN.grid, 6) + 0.0


def lower_clearances(scene: Scene, names: Iterable[str]) -> Iterator[Change | None]:
    """Less clearance of the base: by the rules, and from each of some obstacles that asks for its own."""
    if scene.world.solids:
        yield lower_clearance(scene)
    for name in names:
        if any(solid.name == name and solid.clearance for solid in scene.world.obstacles):
            yield lower_clearance(scene, own_clearance(name))


def lower_clearance(scene: Scene, name: str = CLEARANCE) -> Change | None:
    """Less clearance of the base by the rules or from one obstacle, or of the arm."""
    most = _clearance(scene, name)
    if most == 0:
        return None

    def repair(cut: float) -> Repair:
        left = float(np.floor((most - cut) / EXPLAIN.grid + 1e-6)) * EXPLAIN.grid
        return _repair(scene, "clearance", name, max(0.0, round(left, 6)))

    return Change(scene, most, repair, monotone=name != ARM_CLEARANCE)


def open_cone(scene: Scene, who: str) -> Change | None:
    """A wider cone about the direction of a world's one target, where areas are exact."""
    target = scene.task[0]
    if target.direction is None or target.cone >= np.pi or not scene.model(target).exact:
        return None

    def cone(more: float) -> float:
        return min(np.pi, grid_above(target.cone + more))

    return Change(
        scene,
        np.pi - target.cone,
        lambda more: _repair(scene, "cone", who, cone(more)),
        lambda more: replace(target, cone=cone(more)),
    )


def raise_arm(scene: Scene, most: float) -> Change:
    """A higher mount: the arm sees it as a lower target, and the base sees neither."""
    target = scene.task[0]
    return Change(
        scene,
        most,
        lambda rise: _repair(scene, "raise", scene.robot.name, float(on_grid(np.array(rise)))),
        lambda rise: replace(target, position=target.position - [0.0, 0.0, rise]),
    )


def allow_lift_offs(scene: Scene, i: int) -> Change | None:
    """More lift-offs, the first before set-point i."""
    allowed, name = scene.rules.max_lift_offs, f"set-point {i + 1}"
    most = 0 if allowed is None else len(scene.task) - 1 - allowed
    if most < 1:
        return None
    return Change(
        scene, most, lambda more: _repair(scene, "lift-off", name, float(round(more))), counted=True
    )


def one_lift_off(scene: Scene, i: int) -> Repair:
    """One more lift-off, before set-point i."""
    return _repair(scene, "lift-off", f"set-point {i + 1}", 1.0)


def lift_within(scene: Scene, i: int) -> Repair:
    """A lift-off within a stroke, before set-point i."""
    return _repair(scene, "lift-within", f"set-point {i + 1}", 1.0)


def move_target(scene: Scene, who: str) -> Move:
    """The world's one target elsewhere in space."""
    return Move(scene, "move-target", who)


def move_start(scene: Scene) -> Move:
    """The start of the base elsewhere on the floor."""
    return Move(scene, "move-start", "the start")


def smaller_circle(scene: Scene, radius: float) -> Repair:
    """A smaller circle to park in at stops."""
    return _repair(scene, "stop-tolerance", "rules.stop_tolerance", radius)


def move_obstacle(scene: Scene, name: str) -> Move | None:
    """An obstacle elsewhere on the floor; None for the cells of a map, which cannot be moved."""
    known = any(solid.name == name for solid in scene.world.obstacles)
    return Move(scene, "move-obstacle", name) if known else None


# The table ---------------------------------------------------------------------------------------------


_CLEARANCES = {CLEARANCE: "clearance", ARM_CLEARANCE: "arm_clearance"}  # of the rules


def _obstacle_asking(scene: Scene, name: str) -> Solid:
    """The obstacle whose own clearance has that name."""
    return next(solid for solid in scene.world.obstacles if own_clearance(solid.name) == name)


def _clearance(scene: Scene, name: str) -> float:
    if name in _CLEARANCES:
        return getattr(scene.rules, _CLEARANCES[name])
    return _obstacle_asking(scene, name).clearance or 0.0


def _with_clearance(scene: Scene, repair: Repair, _: int) -> Scene:
    if repair.name in _CLEARANCES:
        return with_rules(scene, **{_CLEARANCES[repair.name]: repair.amount})
    return with_own_clearance(scene, _obstacle_asking(scene, repair.name).name, repair.amount)


def _arm_length(scene: Scene) -> float:
    span = reach_bound(scene.robot.chain)
    return span.radius + span.length


def _raised(scene: Scene, repair: Repair, _: int) -> Scene:
    """The arm and all that is fixed to its links mounted higher."""
    mount = scene.robot.mount + np.array([0.0, 0.0, repair.amount, 0.0])
    return scene.changed(robot=replace(scene.robot, mount=mount))


def _with_cone(scene: Scene, repair: Repair, _: int) -> Scene:
    return scene.changed(task=tuple(replace(target, cone=repair.amount) for target in scene.task))


def _with_target_moved(scene: Scene, repair: Repair, i: int) -> Scene:
    moved = replace(scene.task[i], position=scene.task[i].position + np.array(repair.vector))
    return scene.changed(task=(*scene.task[:i], moved, *scene.task[i + 1 :]))


def _with_obstacle_moved(scene: Scene, repair: Repair, _: int) -> Scene:
    x, y = repair.vector
    T = translation(x, y, 0.0)
    moved = tuple(one.transformed(T) if one.name == repair.name else one for one in scene.world.obstacles)
    return scene.changed(obstacles=moved)


def _with_start_moved(scene: Scene, repair: Repair, _: int) -> Scene:
    if scene.start is None:
        return scene
    return scene.changed(start=replace(scene.start, base=scene.start.base + np.array([*repair.vector, 0.0])))


def _with_lift_offs(scene: Scene, repair: Repair, _: int) -> Scene:
    return with_rules(scene, max_lift_offs=(scene.rules.max_lift_offs or 0) + round(repair.amount))


def _part_of_arm(scene: Scene, repair: Repair) -> float:
    return repair.amount / _arm_length(scene)


def _clearance_text(scene: Scene, repair: Repair) -> str:
    whose = {CLEARANCE: "clearance", ARM_CLEARANCE: "arm's clearance"}.get(repair.name, repair.name)
    return f"lower the {whose} of {_clearance(scene, repair.name):.4f} m to {repair.amount:.4f} m"


def _move_text(_: Scene, repair: Repair) -> str:
    by = ", ".join(f"{part:z.4f}" for part in repair.vector)
    return f"move {repair.name} by ({by}) m, {repair.amount:z.4f} m in all"


def _lift_off_text(_: Scene, repair: Repair) -> str:
    if repair.amount == 1:
        return f"allow a lift-off before {repair.name}"
    return f"allow {round(repair.amount)} more, the first before {repair.name}"


_TABLE: dict[RepairKind, ChangeKind] = {
    "clearance": ChangeKind(
        _with_clearance,
        lambda scene, repair: (_clearance(scene, repair.name) - repair.amount) / _arm_length(scene),
        _clearance_text,
    ),
    "cone": ChangeKind(
        _with_cone,
        lambda scene, repair: (repair.amount - min(target.cone for target in scene.task)) / np.pi,
        lambda scene, repair: (
            f"open the cone of {scene.task[0].cone:.4f} rad about the direction of {repair.name} to "
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
        lambda scene, repair, _: with_rules(scene, stop_tolerance=repair.amount),
        lambda scene, repair: (scene.rules.stop_tolerance - repair.amount) / _arm_length(scene),
        lambda scene, repair: (
            f"lower the stop_tolerance of {scene.rules.stop_tolerance:.4f} m to {repair.amount:.4f} m"
        ),
    ),
    "lift-off": ChangeKind(_with_lift_offs, lambda _, repair: repair.amount, _lift_off_text, "1"),
    "lift-within": ChangeKind(
        lambda scene, _, __: with_rules(scene, lift_within=True),
        lambda _, repair: repair.amount,
        lambda _, repair: (
            f"set rules.lift_within: true, by which the way to {repair.name} is left without work"
        ),
        "1",
    ),
}
