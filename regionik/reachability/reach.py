"""Reachability of targets, with base and arm where they can be reached: arrays in, arrays out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry import Point

from regionik.areas.free_space import MIN_AREA, PathAreas
from regionik.executors import Pool, map_unordered
from regionik.explain.constraints import no_way_to, places_open
from regionik.explain.failures import no_place
from regionik.mfabrik import Solver, solver_for
from regionik.planners.progress import Progress, listening, tell, track
from regionik.planners.search.box_search import Verdict
from regionik.planners.search.fixed_base import solid_at_target
from regionik.postures.families import Family
from regionik.postures.poses import Pose, axis_of, pose_of
from regionik.reachability.any_base import can_search, search_any_base
from regionik.reachability.from_base import from_base
from regionik.reachability.known_postures import among_known
from regionik.reachability.options import REACHABILITY
from regionik.reachability.refinement import KnownArea, diameter, refine
from regionik.reachability.target_search import TargetResult, TargetSearch
from regionik.regions import checked_targets, path_areas, round_outer_areas
from regionik.scene import Scene, WorldSource, scene_of, world_of
from regionik.values import Answer, Configuration
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError, ReasonCode
from regionik.worlds.scene import Target, World

OPTIONS = REACHABILITY.search

_NO_WAY = "from no place of the floor and in no posture does the arm keep off {}"
_CLOSELY = "heading by heading and pitch by pitch, each place for the base is ruled out"
_IN = "whatever the posture, the end of the arm is in {} there, or nearer to it than the rules allow"


def reach(
    world: WorldSource,
    targets: ArrayLike | Sequence[Target],
    *,
    base: ArrayLike | None = None,
    executor: Pool | None = None,
    chunk: int = OPTIONS.targets_at_once,
    progress: Progress | None = None,
) -> Answer:
    """Reachability of targets, with base and joints for those that are reachable.

    Coarse areas of all targets come first. Where they leave a doubt, or the arm touches something, the target
    is looked at closely: without the rules' margin of reach, with finer circles, heading by heading and pitch
    by pitch, and with other postures at other places. What is undecided then says why.

    The answer for a target does not depend on the others, on the chunks or on the executor.

    Parameters
    ----------
    world : World, or the name or file of one
    targets : (n, 3) array_like or sequence of Target
        Bare points leave the tool direction free [m].
    base : (3,) array_like, optional
        Where the base stands, exactly: x, y [m], yaw [rad]. By default it may be anywhere on the floor.
    executor : Executor or function that makes one, optional
        For chunks: processes of this machine or of others; threads of one process take turns. By default
        this process. Chunks of lost workers are handed out again; a process pool breaks with its workers, and
        only a function can make another one.
    chunk : int
        Targets that are worked on at once.
    progress : callable, optional
        Called with a stage, what is done of it, and its total.

    Raises
    ------
    InputError
        For targets that are not n rows of three finite numbers, a base that is not three of them, or a chunk
        below 1.
    EngineError
        When workers are lost again and again.

    Examples
    --------
    >>> reach("pillar", [[0.5, 0, 0.25], [0.5, 0, 2.0]]).verdict.tolist()
    ['reachable', 'unreachable']
    >>> reach("pillar", [[0.5, 0, 0.25], [1.5, 0, 0.25]], base=[0.1, 0, 0]).verdict.tolist()
    ['reachable', 'unreachable']
    """
    if chunk < 1:
        raise InputError(f"chunk: must be at least 1, got {chunk}")
    asked = checked_targets(targets)
    chunks = [asked[k : k + chunk] for k in range(0, max(1, len(asked)), chunk)]
    world = world_of(world)
    place = None if base is None else tuple(frozen(base, (3,), "base").tolist())
    parts: dict[int, Answer] = {}
    done = 0
    with listening(progress):
        for k, answer in map_unordered(world, partial(_answered, base=place), enumerate(chunks), executor):
            parts[k] = answer
            done += len(answer.reachable)
            tell("reach", done, len(asked))
    return _joined([parts[k] for k in range(len(chunks))])


def _joined(parts: Sequence[Answer]) -> Answer:
    columns: dict[str, Any] = {}
    for column in fields(Answer):
        values = [getattr(part, column.name) for part in parts]
        columns[column.name] = list(chain(*values)) if isinstance(values[0], list) else np.concatenate(values)
    return Answer(**columns)


def _answered(world: World, targets: Array | list[Target], base: tuple[float, float, float] | None) -> Answer:
    """The answers for the targets of one chunk."""
    asked = targets if isinstance(targets, list) else [Target(row) for row in targets]
    return answers_for(scene_of(world), asked, base)


def answers_for(
    scene: Scene, targets: Sequence[Target], base: tuple[float, float, float] | None = None
) -> Answer:
    """The answers for targets in a scene, from anywhere or from one pose of the base."""
    positions = np.array([target.position for target in targets]).reshape(-1, 3)
    places = positions if base is None else np.vstack([positions, [*base[:2], 0.0]])
    near = scene.within_reach(places)
    results = _decided(near, targets) if base is None else from_base(near, targets, base)
    verdict = np.array([one.verdict for one in results], dtype="<U11")
    bases, joints = np.full((len(targets), 3), np.nan), np.full((len(targets), scene.robot.chain.dof), np.nan)
    for i, result in enumerate(results):
        if result.pose is not None:
            bases[i], joints[i] = result.pose.base, result.pose.joints
    reasons, gap = [one.reason for one in results], np.array([one.gap for one in results], dtype=float)
    names, codes = [target.name for target in targets], [one.code for one in results]
    return Answer(positions, verdict == "reachable", verdict, bases, joints, reasons, gap, names, codes)


def _decided(scene: Scene, targets: Sequence[Target]) -> list[TargetResult]:
    """Decide by coarse areas of all targets at once, then closely for each target in doubt."""
    areas = path_areas(scene, targets, coarse=True)
    found = _at_hand(scene, targets, areas)
    rest = [i for i in range(len(targets)) if i not in found]
    outer = round_outer_areas(scene, [targets[i] for i in rest], coarse=True)
    results = {i: TargetResult("reachable", pose, 0.0, "") for i, pose in found.items()}
    ruled_out = {i: area.is_empty for i, area in zip(rest, outer, strict=True)}
    for i in track("targets in doubt", rest):
        if ruled_out[i]:
            told = no_place(scene, 0, [targets[i]])
            results[i] = TargetResult("unreachable", None, 0.0, told.reason, told.code)
        else:
            results[i] = _closely(scene, targets[i], _largest_first(areas, i))
    return [results[i] for i in range(len(targets))]


def _at_hand(scene: Scene, targets: Sequence[Target], areas: PathAreas) -> dict[int, Pose]:
    """Configurations that M-FABRIK finds in coarse inner areas, at places nearest to the start."""
    found: dict[int, Pose] = {}
    for i, row in _nearest_rows(scene, areas).items():
        span = scene.free_floor.anywhere.sides[int(areas.side[row])].span
        base, joints = _start(scene)
        spot = shapely.shortest_line(areas.inner[row], Point(axis_of(scene.robot, base))).coords[0]
        place = pose_of(scene.robot, np.array(spot), base[2])
        solver = solver_for(scene, areas.family[row], None, span)
        answers_for = (
            None if solver.compiled else _carried(scene, targets[i], solver, place, areas.family[row])
        )
        if answers_for is None:
            answers_for = solver.inside(areas.inner[row])(targets[i], place, joints)
        pose = Pose(answers_for.base, answers_for.joints)
        if answers_for.converged and TargetSearch(scene, targets[i]).confirms(pose):
            found[i] = pose
    return found


def _carried(
    scene: Scene, target: Target, solver: Solver, place: Array, family: Family
) -> Configuration | None:
    """The posture that a known one for about the same distance and height is led on to."""
    if target.direction is not None:
        return None
    away = target.position[:2] - axis_of(scene.robot, place)
    cells = int(np.hypot(*away) / OPTIONS.known_cell), round(float(target.position[2]) / OPTIONS.known_cell)
    known = scene.once(_known_posture, family, *cells)
    if known is None:
        return None
    if scene.rules.heading != "fixed":
        place = pose_of(scene.robot, axis_of(scene.robot, place), float(np.arctan2(away[1], away[0])))
    return solver.least_change(target, place, known)


def _known_posture(scene: Scene, family: Family, out: int, up: int) -> Array | None:
    """A posture with the tool so many cells out and up, whichever target asks; None where none is known."""
    base = pose_of(scene.robot, np.zeros(2), 0.0)
    spot = OPTIONS.known_cell * np.array([out, 0.0, up])
    answers_for = solver_for(scene, family).hold(spot, base, scene.robot.carry)
    return answers_for.joints if answers_for.converged else None


def _closely(scene: Scene, target: Target, likely: Sequence[KnownArea]) -> TargetResult:
    """Result for a target that coarse areas do not decide."""
    search = TargetSearch(scene, target)
    if search.collision.enabled:
        bodies, contact = search.collision.bodies, search.collision.contact
        name = solid_at_target(bodies, target.position, scene.rules.tolerance, 0.0, contact)
        if name:
            inside = f"{search.who} cannot be reached: {_IN.format(name)}"
            return TargetResult("unreachable", None, 0.0, inside, "in-obstacle")
    seen = _everywhere(search)
    if seen.verdict != "undecided":
        return seen
    pose, left, tried = refine(search, likely)
    pose = pose or search.search() or among_known(search)
    if pose is not None:
        return TargetResult("reachable", pose, 0.0, "")
    if left.is_empty:
        closely = f"{search.who} cannot be reached: {_CLOSELY}"
        return TargetResult("unreachable", None, 0.0, closely, "no-place")
    gap = min(diameter(left), seen.gap)
    code: ReasonCode = "not-found" if search.proximity is None else "arm-blocked"
    return TargetResult("undecided", None, gap, _doubt(search, gap, tried), code)


def _everywhere(search: TargetSearch) -> TargetResult:
    """Result of a search of all postures from all places, for arms that avoid obstacles."""
    scene, target = search.scene, search.target
    if not can_search(scene):
        return TargetResult("undecided", None, np.inf, "")
    seen = search_any_base(scene, target, OPTIONS.max_cells)
    if seen.verdict == Verdict.RULED_OUT:
        way = _NO_WAY.format(", ".join([*seen.around, "itself and its base"]))
        told = f"{search.who} cannot be reached: {way}"
        return TargetResult("unreachable", None, 0.0, told, "arm-blocked")
    if seen.pose is not None and search.confirms(seen.pose):
        return TargetResult("reachable", seen.pose, 0.0, "")
    gap = np.inf if seen.pose is not None else seen.gap  # an unconfirmed pose bounds nothing
    return TargetResult("undecided", None, gap, "")


def _doubt(search: TargetSearch, gap: float, tried: int) -> str:
    """Sentence on why a target stays undecided."""
    lead, proximity = no_way_to(search.who), search.proximity
    left = places_open(gap)
    if proximity is not None:
        return (
            f"{lead}: each of {search.colliding} postures looked at touches something; in the best of them, "
            f"{search.collision.words(proximity)}. {left}: a clear posture from one of them would decide it."
        )
    looked = "no posture was found in the areas looked at" if tried else "no place for the base is known"
    return f"{lead}: {looked}. {left}: a posture from one of them would decide it."


def _largest_first(areas: PathAreas, i: int) -> list[KnownArea]:
    """Areas of one target that are worth a search."""
    rows = np.flatnonzero((areas.target == i) & (shapely.area(areas.inner) > MIN_AREA))
    rows = rows[np.argsort(-shapely.area(areas.inner[rows]), kind="stable")]
    return [(areas.family[row], areas.inner[row]) for row in rows.tolist()]


def _nearest_rows(scene: Scene, areas: PathAreas) -> dict[int, int]:
    """For each target with an area, its row nearest to where the robot starts."""
    gaps = shapely.distance(areas.inner, Point(axis_of(scene.robot, _start(scene)[0])))  # NaN of empty ones
    rows = np.lexsort([gaps, areas.target])
    rows = rows[np.isfinite(gaps[rows])]
    targets, first = np.unique(areas.target[rows], return_index=True)
    return dict(zip(targets.tolist(), rows[first].tolist(), strict=True))


def _start(scene: Scene) -> tuple[Array, Array]:
    if scene.start is not None:
        return scene.start.base, scene.start.joints
    return np.zeros(3), scene.robot.carry
