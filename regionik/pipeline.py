"""`plan(world)`, one line a stage, and `why(world)` where there is no plan."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

from numpy.typing import ArrayLike

from regionik.explain import arm_failures, failures
from regionik.explain.changes import repaired
from regionik.explain.questions import ArmQuestion, Oracles, PathQuestion
from regionik.explain.several import failures_of, in_order, naming_all, naming_as_given, numbered
from regionik.explain.skipping import Explained, leaving_out, naming_each, with_skipped
from regionik.explain.steps import scene_of_setpoint
from regionik.explain.tried_changes import mended_motion, mended_start, tries_for
from regionik.explain.why import Say, explained, explained_target, target_name, unsaid
from regionik.motion import connect_setpoints
from regionik.moving.path_search import JoinedMotion
from regionik.moving.whole_turns import brought_to_the_middle
from regionik.papers.tracker import can_track, plan_tracked
from regionik.parking.fewest_stops import park
from regionik.parking.stop_motion import connect_stops
from regionik.parking.stops import check as check_stops
from regionik.parking.stops import in_sequence
from regionik.planners.progress import Progress, listening
from regionik.planners.tries import TooManyTriesError, at_most, count_tries, counted
from regionik.postures.poses import lift_offs, motion_stats
from regionik.pruning import spans, whole_path
from regionik.reachability.any_base import can_search, search_any_base
from regionik.reachability.reach import answers_for
from regionik.reachability.target_search import TargetSearch
from regionik.reachability.unreached import first_unreached
from regionik.regions import has_no_known_place, planned_areas
from regionik.scene import Scene, WorldSource, scene_of, world_of
from regionik.smoothing.smooth_motion import smooth_motion
from regionik.values import Plan, PlannedArea, Stop
from regionik.verification.stops import within_reachable_circles
from regionik.verification.verifier import verify
from regionik.worlds.arms import reach_bound
from regionik.worlds.arrays import frozen
from regionik.worlds.errors import (
    Cause,
    Explanation,
    InputError,
    NoPlanFound,
    Repair,
)
from regionik.worlds.scene import Target

ORACLES = Oracles(
    reach=lambda scene: answers_for(scene, scene.task),
    seen=lambda scene: TargetSearch(scene, scene.task[0]).in_areas() is not None,
    look=lambda scene, cells: search_any_base(scene, scene.task[0], cells).verdict,
)


def plan(
    world: WorldSource, *, seed: int = 0, say: Say | None = None, progress: Progress | None = None
) -> Plan:
    """Plan the whole tool path of a world.

    Parameters
    ----------
    world : World, or the name or file of one
    seed : int
        Same world, same seed, same bytes.
    say : callable, optional
        Called with each sentence of an explanation as soon as it is known, as in `why`.
    progress : callable, optional
        Called with stage, done, total.

    Returns
    -------
    Plan
        Verified; timed where the world has speeds or the robot's joints have velocity limits.

    Raises
    ------
    NoPlanFound
        With ``explanation``: which set-point, which obstacle, what is missing.
    InputError
        For a world without a task, or a robot that cannot be planned for.

    Examples
    --------
    >>> plan("free").lift_offs
    0
    """
    with listening(progress), counted():
        return _planned(
            scene_of(world_of(world)), seed, lambda left, quick: _explained(left, quick, seed, say or unsaid)
        )


def _planned(scene: Scene, seed: int, explained: Explained) -> Plan:
    """Return a plan of all set-points, or of those that can be done where the rules leave others out."""

    def attempt(left: Scene) -> Plan:
        return _verified(_timed_if_limited(_staged(left, seed)))

    if scene.rules.skip_unreachable:
        found, skipped = leaving_out(scene, attempt, explained)
        return with_skipped(found, skipped)
    try:
        return attempt(scene)
    except NoPlanFound as no:
        raise NoPlanFound(explained(scene, _naming_all(scene, no.explanation))) from None


def _naming_all(scene: Scene, first: Explanation) -> Explanation:
    """The first refusal with all set-points named that cannot be done, by areas and by `reach`."""
    every = naming_each(scene, first, _check_areas)
    if any(one.verdict == "no-posture" for one in failures_of(first)):
        return _naming_unreached(scene, every)
    return naming_all(every, len(scene.task))


def _naming_unreached(scene: Scene, explanation: Explanation) -> Explanation:
    """A refusal that also names set-points that `reach` does not reach, of those the plan did not get to.

    It says which were not looked at.
    """
    known, buried = {one.setpoint for one in failures_of(explanation)}, arm_failures.target_in_solid(scene)
    if buried is None and scene.rules.order == "given":
        known |= set(range(explanation.setpoint or 0))
    rest = [i for i in range(len(scene.task)) if i not in known]
    failures, left = first_unreached(scene, rest)
    every = replace(explanation, failures=in_order([*failures_of(explanation), *failures]))
    told, count = naming_all(every, len(scene.task)), len(scene.task)
    if not left:
        return told
    words = f"{numbered(left, count)} {'was' if len(left) == 1 else 'were'} not looked at."
    return replace(told, reason=f"{told.reason} {words}")


def _check_areas(scene: Scene) -> None:
    """Raise `NoPlanFound` where solids bury set-points, or areas leave no place for the base."""
    _refuse(arm_failures.target_in_solid(scene))
    if scene.rules.mode == "stops":
        park(scene)
    elif not can_track(scene):
        whole_path(scene)


def _timed_if_limited(planned: Plan) -> Plan:
    """Return the plan, timed where its world has speeds or its robot limits of them."""
    world = planned.world
    if world.speeds is None and not world.robot.chain.has_speed_limits:
        return planned
    from regionik.timing.retime import retime  # takes long to load

    try:
        return retime(planned)
    except InputError:
        _verified(planned)  # of a plan that does not hold its violations are told
        raise


def why(
    world: WorldSource,
    target: Target | ArrayLike | None = None,
    *,
    say: Say | None = None,
    progress: Progress | None = None,
) -> Explanation | None:
    """Explain why a target or a whole path is out of reach, and which smallest changes would mend it.

    Causes are irreducible: together they rule it out, and without any one of them the rest does not. For a
    target they rest on its outer area, which is a proof, or on the inner one where the outer is not empty;
    for a path on the ladder of inner areas. Each repair is checked in the changed world, by `reach` or by a
    plan. The smallest comes first, lengths counted as parts of the arm's length, a cone's opening as a part
    of a half turn and a lift-off as one.

    Parameters
    ----------
    world : World, or the name or file of one
    target : Target or (3,) array_like, optional
        A bare point leaves the tool direction free [m]. By default the world's whole path is explained, as
        `plan` explains what it refuses: nothing stands in the way only of what it plans. What the rules let
        plans leave out is explained too.
    say : callable, optional
        Called with each sentence as soon as it is known: what failed, its causes, every repair.
    progress : callable, optional
        Called with stage, done, total.

    Returns
    -------
    Explanation or None
        None where nothing stands in the way.

    Raises
    ------
    InputError
        For a target that is not three finite numbers, or a world that cannot be planned for.

    Examples
    --------
    >>> found = why("pillar", [0.5, 0.0, 0.7])
    >>> [(cause.kind, repair.kind) for cause, repair in zip(found.causes, found.repairs)]
    [('reach', 'move-target')]
    """
    with listening(progress), counted():
        scene = scene_of(world_of(world))
        if target is None:
            return _why_path(scene, 0, say or unsaid)
        return _why_target(scene, target, say or unsaid)


def _why_target(scene: Scene, target: Target | ArrayLike, say: Say) -> Explanation | None:
    if not isinstance(target, Target):
        target = Target(frozen(target, (3,), "target"))
    asked = scene_of_setpoint(scene.changed(task=(target,)), 0)
    buried = arm_failures.target_in_solid(asked)
    if buried is None and (answer := answers_for(asked, asked.task)).reachable[0]:
        return None
    if has_no_known_place(asked):
        return explained_target(asked, 0, failures.no_place(asked, 0), ORACLES, say)
    if buried is not None:
        return _explained_arm(asked, 0, replace(buried, verdict="unreachable"), say)
    reason, causes = f"{answer.reason[0].rstrip('.')}.", (Cause("limits", scene.robot.name),)
    if answer.verdict[0] == "undecided":
        return Explanation("undecided", 0, reason, causes)
    return _explained_arm(asked, 0, Explanation("unreachable", 0, reason, causes), say)


def _why_path(scene: Scene, seed: int, say: Say) -> Explanation | None:
    """The explanation of `plan`, or of what it leaves out."""
    try:
        found = _planned(scene, seed, lambda left, quick: _explained(left, quick, seed, say))
    except NoPlanFound as no:
        return no.explanation
    if not found.skipped:
        return None
    return _why_path(scene.changed(rules=replace(scene.rules, skip_unreachable=False)), seed, say)


def _explained(scene: Scene, quick: Explanation, seed: int, say: Say) -> Explanation:
    """Return an explanation with causes and repairs, by areas where they allow no plan, else by plans."""

    def plans(changed: Scene) -> bool:
        return _can_be_planned(changed, seed)

    i = quick.setpoint
    if can_track(scene):
        return quick
    if quick.verdict == "start-blocked" and failures.blocked_start(scene) is not None:
        return _reported(
            mended_start(scene, quick, lambda left: failures.blocked_start(left) is not None, plans), say
        )
    if quick.verdict == "ladder-broken" and i is not None and not spans(scene):
        return explained(PathQuestion(scene, i, spans, partial(_soon_planned, seed=seed)), quick, say)
    if quick.verdict in ("unreachable", "undecided") and i is not None:
        if has_no_known_place(scene_of_setpoint(scene, i)):
            return explained_target(scene, i, quick, ORACLES, say)
        return _reported(_with_what_helps(scene, quick, i), say)  # there is no room to park
    if quick.verdict == "no-posture" and i is not None:
        found = _explained_arm(scene, i, quick, say)
        if found is not quick:
            return found
    with counted() as tries:
        return _reported(mended_motion(scene, quick, plans, tries.made), say)


def _reported(explanation: Explanation, say: Say) -> Explanation:
    """Say an explanation, and return it."""
    say(explanation.reason)
    return explanation


def _with_what_helps(scene: Scene, quick: Explanation, i: int) -> Explanation:
    """The explanation with those of its repairs after which areas leave set-point i a place."""

    def helps(repair: Repair) -> bool:
        try:
            _check_areas(repaired(scene, repair, i))
        except NoPlanFound as no:
            return all(one.setpoint != i for one in failures_of(no.explanation))
        return True

    return replace(quick, repairs=tuple(repair for repair in quick.repairs if helps(repair)))


def _explained_arm(scene: Scene, i: int, quick: Explanation, say: Say) -> Explanation:
    """Return an explanation with causes and repairs, where no posture from any place is proven clear."""
    asked = scene_of_setpoint(scene, i)
    question = ArmQuestion(asked, target_name(scene, i), ORACLES, (scene.about_path(), i))
    if not (can_search(scene) and question.closed(asked)):
        return quick
    return explained(question, quick, say)


def _can_be_planned(scene: Scene, seed: int) -> bool:
    try:
        search(scene, seed)
    except NoPlanFound:
        return False
    return True


def _soon_planned(scene: Scene, seed: int) -> bool:
    """True where a scene is planned with few tries: there may be many changes to ask about."""
    with suppress(TooManyTriesError), at_most(tries_for(scene)):
        return _can_be_planned(scene, seed)
    return False


def search(scene: Scene, seed: int = 0) -> Plan:
    """Return a verified plan, not timed; raise `NoPlanFound` with a quick explanation where there is none."""
    return _verified(_staged(scene, seed))


def _staged(scene: Scene, seed: int) -> Plan:
    """Return what the stages make of a world, which the last of them may have verified.

    Of a map with thousands of blobs what is about the path comes first; the plan is verified in the whole.
    """
    check_world(scene)
    near = scene.about_path()
    if near is scene:
        return _staged_within(scene, seed)
    try:
        found = _staged_within(near, seed)
        stats = {key: value for key, value in found.stats.items() if key != "margins"}
        return _verified(
            replace(
                found,
                world=replace(found.world, floor=scene.floor, obstacles=scene.world.obstacles),
                stats=stats,
            )
        )
    except NoPlanFound:
        return _staged_within(scene, seed)


def _staged_within(scene: Scene, seed: int) -> Plan:
    """Return what the stages make of a world that may be planned for."""
    count_tries()
    _refuse(arm_failures.target_in_solid(scene))
    if scene.rules.mode == "stops":
        return _plan_stops(scene, seed)
    return plan_tracked(scene, seed) if can_track(scene) else _plan_path(scene, seed)


def _plan_path(scene: Scene, seed: int) -> Plan:
    """A plan with the tool on its path wherever the base can move with it."""
    free_space, areas, pruned = whole_path(scene)
    joined = connect_setpoints(scene, pruned, free_space, seed)
    shown = planned_areas(scene, areas, free_space, pruned.left)
    found = _finished(scene, seed, joined, shown)
    return _verified(smooth_motion(scene, found, free_space) if scene.rules.smooth else found)


def _plan_stops(scene: Scene, seed: int) -> Plan:
    """A plan with the base standing still at the fewest stops."""
    parking = park(scene)
    work = in_sequence(scene, parking)
    with naming_as_given(work.order):
        done = connect_stops(work, seed)
    _refuse(failures.stroke_between_stops(work.scene, done.stops))
    parked = work.parking_areas
    shown = planned_areas(work.scene, parked.areas, parked.free_space, lambda i: done.places[i])
    stops = {**parking.stats(len(done.stops)), "split_before": list(done.split)}
    stats: dict[str, Any] = {"stops": stops}
    if scene.rules.order == "any":
        stats |= {"order": list(work.order), "tour": dict(work.tours)}
    return within_reachable_circles(_finished(work.scene, seed, done.joined, shown, done.stops, stats))


def _verified(planned: Plan) -> Plan:
    """Return the plan with its margins, if it holds."""
    if "margins" in planned.stats:  # the stage that made it has verified it
        return planned
    report = verify(planned)
    if not report.ok:
        raise NoPlanFound(failures.invalid_plan(planned.world, report.violations))
    return replace(planned, stats={**planned.stats, "margins": report.margins})


def _refuse(failure: Explanation | None) -> None:
    if failure is not None:
        raise NoPlanFound(failure)


def check_world(scene: Scene) -> None:
    """Refuse worlds that cannot be planned at all."""
    if not scene.task:
        raise InputError(f"{scene.world.name}: task: expected at least one set-point")
    if scene.rules.heading not in scene.robot.drive.headings:
        raise InputError(
            f"{scene.world.name}: rules.heading: a base on wheels turns as it drives, expected free, "
            f"got {scene.rules.heading}"
        )
    if scene.rules.mode == "stops":
        check_stops(scene)
    if scene.rules.mode == "stops" or not can_track(scene):
        reach_bound(scene.robot.chain)  # refuses robots that areas do not cover
    _refuse(failures.blocked_start(scene))


def areas_follow_motion(scene: Scene) -> bool:
    """Return True where areas depend on the search for motion: those of stops and of Xu's tracker."""
    return scene.rules.mode == "stops" or can_track(scene)


def _finished(
    scene: Scene,
    seed: int,
    joined: JoinedMotion,
    areas: tuple[PlannedArea, ...],
    stops: tuple[Stop, ...] = (),
    more: Mapping[str, Any] | None = None,
) -> Plan:
    """Assemble the results of the stages, joints in the middle of their turns."""
    joined = brought_to_the_middle(scene, joined)
    known = motion_stats(scene.robot.drive, joined.setpoints, joined.motion, joined.methods)
    stats = {**known, **(more or {})}
    return Plan(
        scene.world, seed, joined.setpoints, joined.motion, areas, lift_offs(joined.motion), stops, stats
    )
