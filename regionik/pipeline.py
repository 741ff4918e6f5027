"""`plan(world)`: one line a stage."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from regionik import explain, explain_arm
from regionik.ground import ground_of
from regionik.mfabrik import axis_of, configurations
from regionik.motion import Course, connect
from regionik.plan import Plan, PlannedArea
from regionik.pruning import Ladder, Pruned, build_ladder, choose_chain, prune
from regionik.reachable import BACK, FRONT
from regionik.regions import PathAreas, path_areas
from regionik.verify import verify
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError, NoPlanFound
from regionik.worlds.pivot import is_planar, pivot_of, span_of
from regionik.worlds.planar import planar_arm
from regionik.worlds.scene import World

Progress = Callable[[str, int, int], None]


def plan(world: World, *, seed: int = 0, progress: Progress | None = None) -> Plan:
    """Plan the whole tool path of a world.

    Parameters
    ----------
    world : World
    seed : int
        Same world, same seed, same bytes.
    progress : callable, optional
        Called with stage, done, total.

    Returns
    -------
    Plan
        Verified before it is returned.

    Raises
    ------
    NoPlanFound
        With ``explanation``: which set-point, which obstacle, what is missing.
    InputError
        For a world without a task, or a robot that cannot be planned for.

    Examples
    --------
    >>> from regionik.worlds.format import load_world
    >>> plan(load_world("free")).lift_offs
    0
    """
    tell = progress or (lambda stage, done, total: None)
    check(world)
    sunk = explain_arm.buried(world)
    if sunk is not None:
        raise NoPlanFound(sunk)
    tell("areas", 0, len(world.task))
    areas, pruned = whole_path(world)
    ladder = pruned.ladder
    chain = choose_chain(pruned, start_axis(world))
    tell("configurations", 0, len(world.task))
    goals = configurations(world, ladder, chain, start_pose(world, pruned, chain))
    for i, goal in enumerate(goals):
        if not goal.converged and not world.rules.avoidance:
            raise NoPlanFound(explain.no_posture(world, i))
    course = connect(world, pruned, chain, goals, ground_of(world).inner, seed, progress)
    tell("verify", 0, 1)
    found = finish(world, seed, areas, pruned, course)
    report = verify(found)
    if not report.ok:
        raise NoPlanFound(explain.invalid_plan(world, report.violations))
    return replace(found, stats={**found.stats, "margins": report.margins})


def check(world: World) -> None:
    """Refuse what cannot be planned at all."""
    if not world.task:
        raise InputError(f"{world.name}: task: expected at least one set-point")
    if world.robot.base != "omni":
        raise InputError(f"{world.name}: robot.base: only omni can be planned for, got {world.robot.base}")
    if world.rules.mode != "continuous":
        raise InputError(f"{world.name}: rules.mode: expected continuous, got {world.rules.mode}")
    if any(target.orientation is not None for target in world.task):
        what = "full orientations cannot be planned yet; give a direction"
        raise InputError(f"{world.name}: task: {what}")
    chain = world.robot.chain
    span_of(chain)
    planar, pivot = is_planar(chain), chain.joints[pivot_of(chain)]
    if not planar and world.rules.heading == "fixed" and np.isfinite(pivot.upper - pivot.lower):
        raise InputError(
            f"{world.name}: rules.heading: fixed can be planned only for an arm in one vertical plane or "
            "with an endless pivot, valid choices: free, face_target"
        )
    directed = any(target.direction is not None for target in world.task)
    if directed and not (planar and planar_arm(chain).tool_along_link):
        raise InputError(
            f"{world.name}: task: a tool direction can be planned only for an arm in one vertical plane, "
            "with the tool's z axis along the arm's last link"
        )
    blocked = explain.blocked_start(world)
    if blocked is not None:
        raise NoPlanFound(blocked)


def whole_path(world: World) -> tuple[PathAreas, Pruned]:
    """Areas of the whole path and their pruned ladder.

    The arm faces its targets where that does; postures over its back come in where they save a lift-off or a
    target.
    """
    try:
        front = prune_path(world, (FRONT,))
    except NoPlanFound:
        return prune_path(world, (FRONT, BACK))
    if not front[1].breaks:
        return front
    both = prune_path(world, (FRONT, BACK))
    return both if len(both[1].breaks) < len(front[1].breaks) else front


def prune_path(world: World, facings: tuple[int, ...]) -> tuple[PathAreas, Pruned]:
    """Areas with some facings, cut to whole traversals from the floor the base stands on."""
    side = ground_of(world).inner
    areas = path_areas(world, facings=facings)
    ladder = build_ladder(areas, len(world.task), side)
    rungs = ladder.rungs()
    empty = np.flatnonzero(np.diff(rungs) == 0)
    if len(empty):
        raise NoPlanFound(explain.unreachable(world, int(empty[0]), others=len(empty) - 1))
    pieces = _start_pieces(world, ladder)
    pruned = min(
        (prune(ladder, ladder.floor == piece) for piece in pieces),
        key=lambda found: (_first_gap(found) is not None, len(found.breaks)),
    )
    gap = _first_gap(pruned)
    if gap is not None:
        piece = ladder.floor[np.flatnonzero(pruned.keep)[0]] if pruned.keep.any() else None
        here = side.pieces[pieces[0] if piece is None else piece]
        there = shapely.union_all(ladder.component[rungs[gap] : rungs[gap + 1]])
        raise NoPlanFound(explain.cut_off(world, gap, here, there))
    allowed = world.rules.max_lift_offs
    if allowed is not None and len(pruned.breaks) > allowed:
        bridges = [shapely.shortest_line(pruned.area(i - 1), pruned.area(i)) for i in pruned.breaks]
        raise NoPlanFound(explain.too_many_lifts(world, pruned.breaks, bridges))
    return areas, pruned


def _start_pieces(world: World, ladder: Ladder) -> list[int]:
    """Pieces of free floor on which the base may work: the one it starts on, or any of the first rung."""
    start = start_axis(world)
    if start is None:
        rungs = ladder.rungs()
        return sorted({int(piece) for piece in ladder.floor[rungs[0] : rungs[1]]})
    pieces = ground_of(world).inner.pieces
    return [int(np.argmin(shapely.distance(pieces, Point(start))))] if len(pieces) else []


def _first_gap(pruned: Pruned) -> int | None:
    """First set-point of which nothing is left."""
    rungs = pruned.ladder.rungs()
    left = [bool(pruned.keep[a:b].any()) for a, b in zip(rungs[:-1], rungs[1:], strict=True)]
    return None if all(left) else left.index(False)


def start_axis(world: World) -> Array | None:
    """Where the arm axis stands at first."""
    return None if world.start is None else axis_of(world.robot, world.start.base)


def start_pose(world: World, pruned: Pruned, chain: list[int]) -> tuple[Array, Array]:
    """Base and joints that M-FABRIK starts from: the world's start, or the middle of the first area."""
    if world.start is not None:
        return world.start.base, world.start.joints
    spot = pruned.ladder.component[chain[0]].representative_point()
    return np.array([spot.x, spot.y, 0.0]), world.robot.carry


def finish(world: World, seed: int, areas: PathAreas, pruned: Pruned, course: Course) -> Plan:
    """Put the results of the stages together."""
    motion = course.motion
    moved = np.hypot(*np.diff(motion.base[:, :2], axis=0).T)
    lifted = np.concatenate([[False], motion.kind == "transit", [False]]).astype(int)
    after_first = int(np.argmax(motion.kind == "setpoint"))
    lift_offs = int(np.count_nonzero(np.diff(lifted[after_first + 1 :]) == 1))
    stats = {
        "setpoints": len(course.setpoints),
        "iterations": int(sum(found.iterations for found in course.setpoints)),
        "states": len(motion),
        "base_travel": float(moved.sum()),
        "base_moves": course.methods,
        "largest_error": float(max(found.error for found in course.setpoints)),
    }
    shown = _planned_areas(world, areas, pruned)
    return Plan(world, seed, course.setpoints, motion, shown, lift_offs, (), stats)


def _planned_areas(world: World, areas: PathAreas, pruned: Pruned) -> tuple[PlannedArea, ...]:
    """Admissible, pruned and rejected parts of every set-point."""
    shown = []
    bounds = np.searchsorted(areas.target, np.arange(len(world.task) + 1))
    for i, (a, b) in enumerate(zip(bounds[:-1], bounds[1:], strict=True)):
        reach: BaseGeometry = shapely.union_all(areas.reach[a:b])
        admissible = shapely.union_all(areas.inner[a:b])
        shown.append(PlannedArea(admissible, pruned.area(i), reach - admissible))
    return tuple(shown)
