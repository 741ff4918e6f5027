"""`plan(world)`: one line a stage."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.demand import in_plane
from regionik.areas.ground import united
from regionik.areas.standing import Standing
from regionik.mfabrik import axis_of, configurations
from regionik.motion import connect
from regionik.moving.path_search import JoinedMotion
from regionik.parking.fewest_stops import park
from regionik.parking.stop_motion import connect_stops
from regionik.parking.stops import check as check_stops
from regionik.parking.stops import in_sequence
from regionik.postures.poses import figures, lift_offs
from regionik.pruning import Ladder, Pruned, build_ladder, choose_chain, prune
from regionik.reasons import explain, explain_arm
from regionik.reasons.causes import no_inner
from regionik.regions import PathAreas, path_areas, ways_to_stand
from regionik.repairs.arm import no_clear_posture, why_arm
from regionik.repairs.path import why_path
from regionik.repairs.target import why_target
from regionik.seeking.wherever import can_look
from regionik.timing.retime import retime
from regionik.tracker import plans
from regionik.values import Plan, PlannedArea
from regionik.verification.verifier import verify
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Explanation, InputError, NoPlanFound
from regionik.worlds.pivoted_arm import reach_bound, with_pivot
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
        Verified before it is returned; timed where the world has speeds or the robot's joints have limits of
        velocity.

    Raises
    ------
    NoPlanFound
        With ``explanation``: which set-point, which obstacle, what is missing.
    InputError
        For a world without a task, or a robot that cannot be planned for.

    Examples
    --------
    >>> from regionik.worlds.documents.world_file import load_world
    >>> plan(load_world("free")).lift_offs
    0
    """
    tell = progress or _untold
    try:
        found = search(world, seed, tell)
    except NoPlanFound as no:
        tell("why", 0, 1)
        raise NoPlanFound(explained(world, no.explanation, seed)) from None
    if world.speeds is None and not world.robot.chain.has_velocity_limits:
        return found
    tell("timing", 0, 1)
    return retime(found)


def explained(world: World, quick: Explanation, seed: int = 0) -> Explanation:
    """The quick words on why areas allow no plan, with irreducible causes and repairs; others as they are."""
    if plans.follows(world):
        return quick
    if quick.verdict == "ladder-broken" and not spans(world):
        return why_path(world, quick, spans, lambda changed: _can_be_planned(changed, seed))
    if quick.setpoint is None:
        return quick
    asked = replace(world, task=(world.task[quick.setpoint],))
    if quick.verdict in ("unreachable", "undecided") and no_inner(asked):  # else there is no room to park
        return why_target(world, quick.setpoint, quick)
    if quick.verdict == "no-posture" and can_look(world) and no_clear_posture(asked):
        return why_arm(world, quick.setpoint, quick)
    return quick


def _can_be_planned(world: World, seed: int) -> bool:
    try:
        search(world, seed)
    except NoPlanFound:
        return False
    return True


def _untold(stage: str, done: int, total: int) -> None:
    """Progress that nobody looks at."""


def search(world: World, seed: int = 0, tell: Progress = _untold) -> Plan:
    """A plan that is verified, not timed; where there is none, `NoPlanFound` with the quick words on why."""
    check(world)
    sunk = explain_arm.buried(world)
    if sunk is not None:
        raise NoPlanFound(sunk)
    if world.rules.mode == "stops":
        return _verified(_stopping(world, seed, tell), tell)
    if plans.follows(world):
        return plans.follow(world, seed, tell)
    tell("areas", 0, len(world.task))
    standing, areas, pruned = whole_path(world)
    chain = choose_chain(pruned, standing, start_place(world))
    tell("configurations", 0, len(world.task))
    start = start_pose(world, pruned, chain)
    goals = configurations(world, pruned.ladder, standing, chain, start)
    for i, goal in enumerate(goals):
        if not goal.converged and not world.rules.avoidance:
            raise NoPlanFound(explain.no_posture(world, i))
    joined = connect(world, pruned, chain, goals, standing, seed, tell)
    return _verified(finish(world, seed, areas, pruned, joined), tell)


def _verified(found: Plan, tell: Progress) -> Plan:
    """The plan with its margins, if it holds."""
    tell("verify", 0, 1)
    report = verify(found)
    if not report.ok:
        raise NoPlanFound(explain.invalid_plan(found.world, report.violations))
    return replace(found, stats={**found.stats, "margins": report.margins})


def _stopping(world: World, seed: int, tell: Progress) -> Plan:
    """A plan whose base stands still at the fewest stops, not yet verified."""
    tell("areas", 0, len(world.task))
    parking = park(world)
    tell("stops", 0, len(parking.groups))
    work = in_sequence(world, parking)
    done = connect_stops(work, seed, tell)
    joined = done.joined
    stats = figures(world.robot.drive, joined.setpoints, joined.motion, joined.methods)
    stats["stops"] = {**parking.stats, "count": len(done.stops), "split_before": list(done.split)}
    if world.rules.order == "any":
        stats["order"] = list(work.order)
    shown = _planned_areas(work.world, work.parking_areas.areas, lambda i: done.places[i])
    lifts = lift_offs(joined.motion)
    return Plan(work.world, seed, joined.setpoints, joined.motion, shown, lifts, done.stops, stats)


def check(world: World) -> None:
    """Refuse what cannot be planned at all."""
    if not world.task:
        raise InputError(f"{world.name}: task: expected at least one set-point")
    if world.rules.heading not in world.robot.drive.headings:
        raise InputError(
            f"{world.name}: rules.heading: a base on wheels turns as it drives, expected free, "
            f"got {world.rules.heading}"
        )
    if world.rules.order == "any" and world.rules.mode != "stops":
        raise InputError(f"{world.name}: rules.order: any goes with rules.mode: stops, expected given")
    if world.rules.mode == "stops":
        check_stops(world)
    if world.rules.mode == "stops" or not plans.follows(world):
        _check_areas(world)
    blocked = explain.blocked_start(world)
    if blocked is not None:
        raise NoPlanFound(blocked)


def _check_areas(world: World) -> None:
    """Refuse what areas and M-FABRIK cannot be asked about."""
    chain = with_pivot(world.robot.chain)
    reach_bound(chain)
    planar = all(in_plane(chain, target) for target in world.task)
    if not planar and world.rules.heading == "fixed" and np.isfinite(chain.upper[0] - chain.lower[0]):
        raise InputError(
            f"{world.name}: rules.heading: fixed can be planned only for an arm in one vertical plane, "
            "its tool along the last link where a direction is asked, or with an endless first joint, "
            "valid choices: free, face_target"
        )


def whole_path(world: World) -> tuple[Standing, PathAreas, Pruned]:
    """Where the base may stand, the areas of the whole path, and their pruned ladder.

    The arm faces its targets and the base turns freely, where that does; postures over the arm's back, and
    places where the base must keep to some headings, come in where they save a lift-off or a target.
    """
    found: list[tuple[Standing, PathAreas, Pruned]] = []
    refused = None
    for standing, facings in ways_to_stand(world):
        try:
            found.append((standing(world), *prune_path(world, standing(world), facings)))
        except NoPlanFound as failure:
            refused = failure
        else:
            if not found[-1][2].breaks:
                break
    if not found and refused is not None:
        raise refused
    return min(found, key=lambda one: len(one[2].breaks))


def prune_path(world: World, standing: Standing, facings: tuple[int, ...]) -> tuple[PathAreas, Pruned]:
    """Areas with some facings, cut to whole traversals from the floor the base stands on."""
    areas = path_areas(world, facings=facings, standing=standing)
    return areas, cut_path(world, standing, areas)


def cut_path(world: World, standing: Standing, areas: PathAreas) -> Pruned:
    """Areas of all set-points, cut to whole traversals from the floor the base stands on.

    Raises
    ------
    NoPlanFound
        When a set-point has no area, or none that the base can get to.
    """
    ladder = build_ladder(areas, len(world.task), standing)
    rungs = ladder.rungs
    empty = np.flatnonzero(np.diff(rungs) == 0)
    if len(empty):
        raise NoPlanFound(explain.no_place(world, int(empty[0]), others=len(empty) - 1))
    pruned = _best_pruned(world, standing, ladder)
    gap = _first_gap(pruned)
    if gap is not None:
        pieces = ladder.floor[pruned.keep] if pruned.keep.any() else _start_pieces(world, standing, ladder)
        piece = pieces[0]
        here = shapely.union_all(standing.whole(int(piece)))
        there = shapely.union_all(ladder.component[rungs[gap] : rungs[gap + 1]])
        raise NoPlanFound(explain.cut_off(world, gap, here, there))
    allowed = world.rules.max_lift_offs
    if allowed is not None and len(pruned.breaks) > allowed:
        bridges = [shapely.shortest_line(pruned.area(i - 1), pruned.area(i)) for i in pruned.breaks]
        raise NoPlanFound(explain.too_many_lifts(world, pruned.breaks, bridges))
    return pruned


def spans(world: World) -> bool:
    """Whether `whole_path` finds areas for the whole path, without a word on why not."""
    return any(_spanned(world, standing(world), facings) for standing, facings in ways_to_stand(world))


def _spanned(world: World, standing: Standing, facings: tuple[int, ...]) -> bool:
    ladder = build_ladder(path_areas(world, facings=facings, standing=standing), len(world.task), standing)
    if (np.diff(ladder.rungs) == 0).any():
        return False
    pruned, allowed = _best_pruned(world, standing, ladder), world.rules.max_lift_offs
    return _first_gap(pruned) is None and (allowed is None or len(pruned.breaks) <= allowed)


def _best_pruned(world: World, standing: Standing, ladder: Ladder) -> Pruned:
    """The ladder cut to the piece of floor on which most can be done."""
    return min(
        (prune(ladder, ladder.floor == piece) for piece in _start_pieces(world, standing, ladder)),
        key=lambda found: (_first_gap(found) is not None, len(found.breaks)),
    )


def _start_pieces(world: World, standing: Standing, ladder: Ladder) -> list[int]:
    """Pieces of free floor on which the base may work: the one it starts on, or any of the first rung."""
    start = start_place(world)
    if start is None:
        rungs = ladder.rungs
        return sorted({int(piece) for piece in ladder.floor[rungs[0] : rungs[1]]})
    piece = standing.piece_at(start[:2], float(start[2]))
    return [] if piece is None else [piece]


def _first_gap(pruned: Pruned) -> int | None:
    """First set-point of which nothing is left."""
    rungs = pruned.ladder.rungs
    left = [bool(pruned.keep[a:b].any()) for a, b in zip(rungs[:-1], rungs[1:], strict=True)]
    return None if all(left) else left.index(False)


def start_place(world: World) -> Array | None:
    """Where the arm axis stands at first, and the base's heading, (3,)."""
    if world.start is None:
        return None
    return np.array([*axis_of(world.robot, world.start.base), world.start.base[2]])


def start_pose(world: World, pruned: Pruned, chain: list[int]) -> tuple[Array, Array]:
    """Base and joints that M-FABRIK starts from: the world's start, or the middle of the first area."""
    if world.start is not None:
        return world.start.base, world.start.joints
    spot = pruned.ladder.component[chain[0]].representative_point()
    return np.array([spot.x, spot.y, 0.0]), world.robot.carry


def finish(world: World, seed: int, areas: PathAreas, pruned: Pruned, joined: JoinedMotion) -> Plan:
    """Put the results of the stages together."""
    stats = figures(world.robot.drive, joined.setpoints, joined.motion, joined.methods)
    shown = _planned_areas(world, areas, pruned.area)
    return Plan(world, seed, joined.setpoints, joined.motion, shown, lift_offs(joined.motion), (), stats)


def _planned_areas(
    world: World, areas: PathAreas, left: Callable[[int], BaseGeometry]
) -> tuple[PlannedArea, ...]:
    """Admissible, pruned and rejected parts of every set-point."""
    shown = []
    bounds = np.searchsorted(areas.target, np.arange(len(world.task) + 1))
    for i, (a, b) in enumerate(zip(bounds[:-1], bounds[1:], strict=True)):
        reach, admissible = united(areas.reach[a:b]), united(areas.inner[a:b])
        rejected = Polygon() if admissible is reach else reach - admissible
        shown.append(PlannedArea(admissible, left(i), rejected))
    return tuple(shown)
