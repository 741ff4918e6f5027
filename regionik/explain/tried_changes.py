"""Repairs of what only a search refuses, the start or the motion: few changes, each tried by asking again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from regionik.explain.changes import (
    Change,
    Move,
    lift_within,
    lower_clearance,
    lower_clearances,
    move_obstacle,
    move_start,
    move_target,
    one_lift_off,
    repaired,
    smaller_circle,
    smallest_first,
)
from regionik.explain.constraints import ARM_CLEARANCE, mended
from regionik.explain.failures import is_blocked, too_close
from regionik.explain.minimal_change import Holds, Scan, circle
from regionik.explain.options import EXPLAIN
from regionik.planners.tries import TooManyTriesError, at_most, counted
from regionik.scene import Scene
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Explanation, Repair
from regionik.worlds.scene import Start

OPTIONS = EXPLAIN.trials

Asked = Callable[[Scene], bool]

START_SCAN = Scan(40, 1e-3, 0.01)  # of lengths that a start is moved by
CLEARANCE_SCAN = replace(START_SCAN, steps=1)  # of what its clearance is lowered by


def mended_motion(scene: Scene, quick: Explanation, plans: Asked, made: int = 0) -> Explanation:
    """The explanation of a search that failed, with the changes with which the path is planned.

    Changes are tried at the set-point that failed and the one before it, then with the whole path: all of
    this makes hardly more tries than the search that failed has ``made``.
    """
    i = 0 if quick.setpoint is None else quick.setpoint
    first = max(0, i - 1)
    part, most = scene.changed(task=scene.task[first : i + 1]), made // 2 + OPTIONS.spare_tries
    helped, tried, small = list[Repair](), list[str](), list[Repair]()
    with suppress(TooManyTriesError), at_most(most):
        if plans(part):  # it is not these two alone
            if len(scene.task) > OPTIONS.max_whole_path:
                return quick
            part, first = scene, 0
        for group in map(list, _groups(scene, i, quick)):
            found = (one for one in group if plans(repaired(part, one, i - first)))
            helped += [one for one in [next(found, None)] if one is not None]
            tried += [group[-1].text] if group else []
    # A lift-off is asked about whatever its size, as the search itself says that one more would do: with it
    # the search is made once more, and goes on.
    lifts = [one for one in helped if one.kind in ("lift-off", "lift-within")]
    others = [one for one in smallest_first(scene, helped) if one not in lifts]
    smallest = others[: OPTIONS.max_planned_repairs - len(lifts)]
    for some, tries in ((lifts, 2 * made + OPTIONS.spare_tries), (smallest, most)):
        with suppress(TooManyTriesError), at_most(tries):
            for one in some:
                small += [one] if part is scene or plans(repaired(scene, one, i)) else []
    small = list(smallest_first(scene, small))
    return replace(quick, reason=f"{quick.reason} {mended(tuple(small), tried)}", repairs=tuple(small))


def _groups(scene: Scene, i: int, quick: Explanation) -> Iterator[Iterator[Repair]]:
    """Changes of one kind after the other, each from less to more."""
    if scene.rules.max_lift_offs is not None and i > 0:
        yield iter([one_lift_off(scene, i)])
    if scene.within_strokes[i] and not scene.rules.lift_within:
        yield iter([lift_within(scene, i)])
    wide = scene.rules.stop_tolerance
    if scene.rules.mode == "stops" and wide:
        yield (smaller_circle(scene, (1 - share) * wide) for share in OPTIONS.given_up_shares)
    named = list(dict.fromkeys(cause.name for cause in quick.causes if cause.kind == "obstacle"))
    arms = [lower_clearance(scene, ARM_CLEARANCE)] if scene.world.arm_solids else []
    for lower in (*lower_clearances(scene, named), *arms):
        if lower is not None:
            yield (lower.repair(share * lower.most) for share in OPTIONS.given_up_shares)
    for name in named:
        move = move_obstacle(scene, name)
        if move is not None:
            yield _moved(move, _away(scene, i, name)[None])
    if quick.verdict == "start-blocked" and scene.start is not None:
        yield _moved(move_start(scene), circle(4))
    elif quick.setpoint is not None:
        who = f"set-point {i + 1}" if len(scene.task) > 1 else "the target"
        yield _moved(move_target(scene, who), np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]))


def _moved(move: Move, ways: Array) -> Iterator[Repair]:
    return (move.repair(length * way) for length in OPTIONS.move_lengths for way in ways)


def _away(scene: Scene, i: int, name: str) -> Array:
    """Direction on the floor from a set-point to an obstacle, (2,)."""
    solid = next(one for one in scene.world.obstacles if one.name == name)
    low, high = solid.bounds
    way: Array = (low + high)[:2] / 2 - scene.task[i].position[:2]
    length = float(np.linalg.norm(way))
    return way / length if length > 1e-6 else np.array([1.0, 0.0])


def mended_start(scene: Scene, quick: Explanation, blocked: Asked, plans: Asked) -> Explanation:
    """The explanation of a base that cannot stand where it starts, with the changes that free it.

    A repair says so where the path is not planned with it, or was not with as many tries as are made at most.
    """
    found = list[Repair]()
    for lower in lower_clearances(scene, [cause.name for cause in quick.causes]):
        # No clearance helps a base that stands in a solid, or off the floor.
        if lower is not None and not blocked(lower.at(lower.most)):
            found += [_least_lowered(lower, blocked)]
    solids = (move_obstacle(scene, cause.name) for cause in quick.causes if cause.kind == "obstacle")
    moves = [move_start(scene), *(move for move in solids if move is not None)]
    found += [one for one in map(_shortest, moves) if one is not None and not blocked(repaired(scene, one))]
    repairs = list(_confirmed(scene, smallest_first(scene, found), plans))
    told = mended(repairs, [f"move {move.name} by up to {OPTIONS.max_start_move:g} m" for move in moves])
    return replace(quick, reason=f"{quick.reason} {told}", repairs=tuple(repairs))


def _least_lowered(lower: Change, blocked: Asked) -> Repair:
    """The least that a clearance must be lowered by for a start to be free, where all of it is enough."""
    amount = CLEARANCE_SCAN.first(lambda cut: not blocked(lower.at(cut)), lower.most)
    return lower.repair(lower.most if amount is None else min(amount + OPTIONS.start_spare, lower.most))


def tries_for(scene: Scene) -> int:
    """Tries that plans of a changed world may make where nothing has been searched before."""
    return OPTIONS.spare_tries + OPTIONS.tries_per_setpoint * len(scene.task)


def _confirmed(scene: Scene, repairs: Iterable[Repair], plans: Asked) -> Iterator[Repair]:
    """Yield repairs of a start that tell whether the path is planned with them, as far as tries go."""
    most = tries_for(scene)
    with counted() as tries:
        begun = tries.made
        for one in repairs:
            left = begun + most - tries.made
            words = f", which frees the start; {most} tries did not show whether the path is planned then"
            with suppress(TooManyTriesError), at_most(left):
                words = "" if plans(repaired(scene, one)) else ", which frees the start alone"
            yield replace(one, text=f"{one.text}{words}")


def _shortest(move: Move) -> Repair | None:
    """The shortest of some steps on the floor that free the start, if any does."""
    frees, best, found = _frees(move), OPTIONS.max_start_move, None
    for way in circle(16):
        length = START_SCAN.first(_along(frees, way), best)
        if length is not None and (found is None or length < best):
            best, found = length, move.repair((length + OPTIONS.start_spare) * way)
    return found


def _frees(move: Move) -> Callable[[Array], bool]:
    """Test whether a step (2,) of the start, or of the one obstacle in its way, frees the start.

    A step of an obstacle is one of the base the other way, with nothing else about.
    """
    scene = move.scene
    start = Start(np.zeros(3), scene.robot.carry) if scene.start is None else scene.start
    if move.kind == "move-start":
        return lambda step: not is_blocked(scene, start.base + [*step, 0.0])
    obstacles = tuple(one for one in scene.world.obstacles if one.name == move.name)
    alone = scene.changed(obstacles=obstacles, floor=replace(scene.floor, cells=()))
    return lambda step: too_close(alone, start.base - [*step, 0.0]) is None


def _along(frees: Callable[[Array], bool], way: Array) -> Holds:
    """Test whether steps of a length along a direction free the start."""
    return lambda length: frees(length * way)
