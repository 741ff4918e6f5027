"""Explanations of failures by stage: which set-point and obstacle, and what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import shapely
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import Nearest
from regionik.areas.touching import BOUND_ROUNDING
from regionik.explain.causes import deletion_filter
from regionik.explain.changes import lift_within, one_lift_off
from regionik.explain.constraints import (
    join,
    no_way_to,
    rounded_down,
    setpoint_at,
    with_rules,
    within_stroke,
    zone_words,
)
from regionik.explain.cut_off import crossed, crossed_zones, narrow_floor, narrow_passage
from regionik.planners.driving.footprint_planner import NarrowPassageError
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.geometry.offsets import deepest_inside, farthest_outside
from regionik.regions import (
    RejectedPart,
    largest_clearance,
    outer_areas,
    reach_of,
    rejected_by_obstacles,
    round_outer_areas,
)
from regionik.scene import Scene
from regionik.values import Stop, Violation
from regionik.worlds.arms import reach_bound
from regionik.worlds.arrays import Array
from regionik.worlds.body import without_body
from regionik.worlds.errors import Cause, CauseKind, Explanation, ReasonCode, Repair, SetpointFailure
from regionik.worlds.scene import Target, World
from regionik.worlds.self_collision import base_name
from regionik.worlds.shadows import Shadow
from regionik.worlds.zones import Zone

_Told = tuple[ReasonCode, str, tuple[Cause, ...], tuple[Repair, ...]]  # the reason in a word and in words


def no_place(scene: Scene, i: int, targets: Sequence[Target] | None = None) -> Explanation:
    """Explain why set-point i has no known place for the base: "unreachable" where its outer area is empty.

    Else the verdict is "undecided": an empty inner area is no proof. Of other ``targets`` than the world's
    task it is not said how wide the ways to them are.
    """
    every = scene.task if targets is None else targets
    target = every[i]
    who = setpoint_at(every, i)
    # The layer of a height rules out most of what can be ruled out, and serves many targets.
    coarse = round_outer_areas(scene, [target], coarse=True)[0].is_empty
    proven = coarse or outer_areas(scene, [target])[0].is_empty
    reach = reach_of(scene, target, coarse=coarse)
    lead = f"{who} cannot be reached" if proven else no_way_to(who)
    open_clearance = largest_clearance(scene, target)
    above = _blocked_above(scene, target) if open_clearance is None else []
    if above:
        code, reason, causes, repairs = _under(scene, above, lead, proven=proven)
    elif open_clearance is None and _has_room_without_own(scene, target):
        code, reason, causes, repairs = _crowded_out(scene, lead, reach, None, proven=proven)
    elif open_clearance is None and (zones := _zones_in_the_way(scene, target)):
        code, reason, causes, repairs = _zoned_out(zones, lead, proven=proven)
    elif open_clearance is None:
        code, reason, causes, repairs = _out_of_reach(scene, target, lead, reach, proven=proven)
        if targets is None and causes[0].kind == "floor" and causes[0].margin is not None:
            places = _places(scene, reach, proven=proven)
            reason += narrow_passage(scene, places, Point(target.position[:2]))
    else:
        code, reason, causes, repairs = _crowded_out(scene, lead, reach, open_clearance, proven=proven)
    if scene.rules.criteria is not None:
        bare = largest_clearance(with_rules(scene, criteria=None), target)
        if bare is not None and bare >= scene.world.base_clearance:
            reason += " Without the criteria of the rules it could be reached."
            code, causes = "criteria", (Cause("criteria", "rules.criteria"), *causes)
    if not proven:
        reason += f" It is not ruled out either: {_left_open(scene, target)}."
    return Explanation("unreachable" if proven else "undecided", i, reason, causes, repairs, code=code)


def _has_room_without_own(scene: Scene, target: Target) -> bool:
    """True where obstacles that ask for a clearance of their own leave a target no place, and less would."""
    if not scene.ground.base.own:
        return False
    bare = tuple(
        one if one.clearance is None else replace(one, clearance=0.0) for one in scene.world.obstacles
    )
    return largest_clearance(scene.changed(obstacles=bare), target) is not None


def _zones_in_the_way(scene: Scene, target: Target) -> list[Zone]:
    """Zones that leave a target no place, where it would have one without them; few of them that do."""
    zones = scene.world.zones

    def shut(some: Sequence[Zone]) -> bool:
        return largest_clearance(scene.changed(zones=tuple(some)), target) is None

    return [] if not zones or shut(()) else list(deletion_filter(zones, shut))


def _zoned_out(zones: Sequence[Zone], lead: str, *, proven: bool) -> _Told:
    """Reason where zones leave the base no place from which the arm reaches."""
    reach, would = ("could reach", "would be") if proven else ("is known to reach", "would or might be")
    sides = ("in" if zone.keep == "out" else "outside" for zone in zones)
    named = [f"{side} {zone_words(zone.name)}" for side, zone in zip(sides, zones, strict=True)]
    reason = f"{lead}: wherever the arm {reach} it from, the base {would} {' or '.join(named)}."
    return "zone-blocked", reason, tuple(Cause("zone", zone.name) for zone in zones), ()


def _left_open(scene: Scene, target: Target) -> str:
    """Reasons why inner areas are smaller than outer ones."""
    ground = scene.ground
    why = [f"inner areas keep {scene.rules.reach_margin:g} m off the edge of reach"]
    if not scene.model(target).is_proven(scene.rules):
        why.append("places are sampled, pose by pose")
    if scene.rules.heading != "fixed" and not scene.free_floor.turns_matter and ground.far > ground.near:
        why.append(f"the base is taken as the circle of {ground.far:.3f} m about the arm's axis")
    return join(why)


def _blocked_above(scene: Scene, target: Target) -> list[RejectedPart]:
    """Places from which what stands on the base would touch something, if there were others without it."""
    if not (scene.ground.around or scene.lifted.matters):
        return []
    bare = scene.changed(robot=without_body(scene.robot))
    if largest_clearance(bare, target) is None:
        return []
    footprint = base_name(scene.robot)
    found = rejected_by_obstacles(scene, reach_of(bare, target), target)
    return [part for part in found if part.part != footprint and part.polygon.area > 1e-12]


def _under(scene: Scene, blocked: Sequence[RejectedPart], lead: str, *, proven: bool) -> _Told:
    """Reason where columns, torsos and the like find no room, by the obstacles that take most of it."""
    by_size = sorted(blocked, key=lambda part: -part.polygon.area)
    parts, names = (list(dict.fromkeys(getattr(one, key) for one in by_size)) for key in ("part", "name"))
    reach, would = ("could reach", "would") if proven else ("is known to reach", "would or might")
    near = f"come within {scene.world.arm_clearance:.3f} m of" if scene.world.arm_clearance else "touch"
    reason = (
        f"{lead}: wherever the arm {reach} it from, {join(parts[:3])} of {scene.robot.name}, which the base "
        f"carries, {would} {near} {join(names[:4])}."
    )
    return "body-blocked", reason, tuple(Cause("obstacle", name) for name in names), ()


def _out_of_reach(scene: Scene, target: Target, lead: str, reach: BaseGeometry, *, proven: bool) -> _Told:
    span = reach_bound(scene.robot.chain)
    shoulder, length = span.height + float(scene.robot.mount[2]), span.length
    over = abs(float(target.position[2]) - shoulder) - length
    if over > 0:
        way = "above" if target.position[2] > shoulder else "below"
        reason = (
            f"{lead} from anywhere: it lies {over:.3f} m {way} all that "
            f"{scene.robot.name} reaches (heights from {shoulder - length:.3f} to {shoulder + length:.3f} m)."
        )
        text = f"{'raise the arm or lower' if way == 'above' else 'raise'} the target by {over:.3f} m"
        repair = Repair("move-target", "target", over, text)
        code: ReasonCode = "too-high" if way == "above" else "too-low"
        return code, reason, (Cause("reach", scene.robot.name, over),), (repair,)
    ground, places = scene.ground, _places(scene, reach, proven=proven)
    if places.is_empty:
        room = "room" if proven else "known room"
        reason = (
            f"{lead}: nowhere on the floor is {room} for the base of {scene.robot.name}, whose footprint "
            f"reaches {ground.far:.3f} m from the arm's axis.{narrow_floor(scene)}"
        )
        return "no-room", reason, (Cause("floor", "edge of the floor", None),), ()
    off = places.distance(Point(target.position[:2]))
    if off > 0 and reach.disjoint(places):
        beyond = "where the base may stand" if proven else "known for the base"
        reason = (
            f"{lead}: it lies {off:.3f} m beyond the places {beyond}, and the arm of {scene.robot.name} does "
            "not reach that far."
        )
        return "too-far", reason, (Cause("floor", "edge of the floor", off),), ()
    kind: CauseKind = "limits" if target.direction is None else "direction"
    anywhere, known = (" from anywhere", "") if reach.is_empty else ("", " is known that")
    code, missing = _missing_postures(scene, target)
    reason = f"{lead}{anywhere}: no posture {missing}{known} brings the tool of {scene.robot.name} there."
    return code, reason, (Cause(kind, scene.robot.name),), ()


def _places(scene: Scene, reach: BaseGeometry, *, proven: bool) -> BaseGeometry:
    """Places where the base may stand, those for some headings only where these matter, or is known to."""
    room, free = scene.ground.outer.free, scene.free_floor
    if proven and reach.disjoint(room):
        return room
    sides = (free.outer if proven else free.by_heading).sides
    return shapely.union_all([side.free for side in sides])


def _missing_postures(scene: Scene, target: Target) -> tuple[ReasonCode, str]:
    """Words for the postures that are missing for a target within the arm's height and length."""
    if target.direction is None:
        return "no-posture", "within limits"
    bare, pointed = Target(target.position), Target(target.position, target.direction, target.cone)
    if largest_clearance(scene, bare) is None:
        return "no-posture", "within limits, whichever way the tool points,"
    if target.orientation is None:
        return "tool-direction", "with the wanted tool direction"
    if largest_clearance(scene, pointed) is None:
        return "tool-direction", "with the tool's axis as its orientation asks"
    turned = "with the tool turned about its axis as asked, as its direction alone would let it be,"
    return "tool-direction", turned


def _crowded_out(
    scene: Scene, lead: str, outer: BaseGeometry, open_clearance: float | None, *, proven: bool
) -> _Told:
    """Reason where the base finds no room for its clearances; ``open_clearance`` is one that leaves some."""
    blockers = sorted(rejected_by_obstacles(scene, outer), key=lambda part: -part.polygon.area)
    names = list(dict.fromkeys(part.name for part in blockers if part.polygon.area > 1e-12))
    reach, is_near = ("could reach", "is") if proven else ("is known to reach", "is or may be")
    near = _nearer_than_allowed(scene, names[:4])
    reason = f"{lead}: wherever the arm {reach} it from, the base {is_near} {near}."
    if open_clearance is None:
        return "base-blocked", reason, tuple(Cause("obstacle", name) for name in names), ()
    missing = scene.world.base_clearance - open_clearance
    reason += (
        f" The most clearance that is known to leave a place is {rounded_down(open_clearance, 3):.3f} m, "
        f"{missing:.3f} m less."
    )
    causes = tuple(Cause("obstacle", name, missing) for name in names)
    left = rounded_down(
        open_clearance - scene.world.base_allowance, 3
    )  # for the rule: executions take their part
    text = f"a clearance of {left:.3f} m lets it be reached"
    repairs = (Repair("clearance", "rules.clearance", left, text),) if left >= 0 else ()
    return "base-blocked", reason, causes, repairs


def _nearer_than_allowed(scene: Scene, names: Sequence[str]) -> str:
    """Words on a base that is too near to obstacles, with the clearances that these ask for."""
    world = scene.world
    asked = {one.name: world.base_clearance_from(one) for one in world.solids if one.clearance is not None}
    if asked.keys().isdisjoint(names):
        return f"nearer than its clearance of {world.base_clearance:.3f} m to {join(names)}"
    named = [f"{name} ({asked.get(name, world.base_clearance):.3f} m)" for name in names]
    return f"nearer than its clearance to {join(named)}"


def too_many_lifts(scene: Scene, i: int, bridge: BaseGeometry, number: int, count: int) -> Explanation:
    """Explain why the path cannot be done with as few lift-offs as the rules allow."""
    told = f"lift-off {number} of {count} in all, and the rules allow {number - 1}."
    return _broken(scene, i, bridge, told, one_lift_off(scene, i))


def split_stroke(scene: Scene, i: int, bridge: BaseGeometry) -> Explanation:
    """Explain why a stroke cannot be worked without a lift-off before set-point i."""
    return _broken(scene, i, bridge, within_stroke(scene.task, i), lift_within(scene, i))


def stroke_between_stops(scene: Scene, stops: Sequence[Stop]) -> Explanation | None:
    """Explain which stroke no one of some stops does; None where each is done from one, or need not be."""
    i = next((stop.first for stop in stops[1:] if scene.within_strokes[stop.first]), None)
    if i is None or scene.rules.lift_within:
        return None
    reason = (
        f"No one stop was found for a whole stroke: between set-points {i} and {i + 1} of {len(scene.task)} "
        f"the base drives on, {within_stroke(scene.task, i)} In mode continuous it drives at work."
    )
    causes, repairs = (Cause("reach", "room to park", None),), (lift_within(scene, i),)
    return Explanation("ladder-broken", i, reason, causes, repairs)


def _broken(scene: Scene, i: int, bridge: BaseGeometry, told: str, repair: Repair) -> Explanation:
    """A refusal of a lift-off; ``bridge`` is the shortest way between places of the base."""
    blockers, zones = crossed(scene, bridge), crossed_zones(scene, bridge)
    names = join([*blockers, *map(zone_words, zones)] or ["the arm's reach"])
    reason = (
        f"The path breaks between set-points {i} and {i + 1} of {len(scene.task)}: no known place of the "
        f"base serves both, {bridge.length:.3f} m apart at the nearest, because of {names}; the tool would "
        f"have to be lifted here, {told}"
    )
    causes = tuple(Cause("obstacle", name, float(bridge.length)) for name in blockers)
    causes += tuple(Cause("zone", name, float(bridge.length)) for name in zones)
    causes = causes or (Cause("reach", names, None),)
    return Explanation("ladder-broken", i, reason, causes, (repair,))


def blocked_start(scene: Scene) -> Explanation | None:
    """Explain why the base cannot stand where it starts; None where it can."""
    if scene.start is None:
        return None
    ground = scene.ground
    x, y, _ = scene.start.base
    outline = scene.robot.outline(scene.start.base)
    where = f"The start at ({x:z.3f}, {y:z.3f})"
    zone = next(
        (one for one in scene.world.zones if not one.allows(outline, scene.world.base_allowance)), None
    )
    if zone is not None and _is_off_floor(scene.world, outline):
        side = "outside" if zone.keep == "in" else "in"
        reason = f"{where} is {side} {zone_words(zone.name)}; the base must start {_where_allowed(zone)}."
        return Explanation("start-blocked", None, reason, (Cause("zone", zone.name),))
    if _is_off_floor(scene.world, outline):
        off = farthest_outside(outline, scene.world.drivable_floor)
        reason = f"{where} is off the floor by {off:.3f} m; the base must start on it."
        reason += narrow_floor(scene)
        return Explanation("start-blocked", None, reason, (Cause("floor", "edge of the floor", off),))
    found = too_close(scene, scene.start.base)
    if found is None:
        return None
    name, gap, clearance = found
    shadows = [shadow for n, shadow in zip(ground.names, ground.shadows, strict=True) if n == name]
    depth = max(_depth(shadow, outline) for shadow in shadows)
    place = f"inside {name}, {depth:.3f} m deep" if gap == 0.0 else f"{gap:.3f} m from {name}"
    missing = clearance - gap + (depth if gap == 0.0 else 0.0)
    reason = (
        f"{where} is blocked: the base stands {place}, and must keep a clearance of "
        f"{clearance:.3f} m. It would have to start at least {missing:.3f} m farther away."
    )
    return Explanation("start-blocked", None, reason, (Cause("obstacle", name, missing),))


def _where_allowed(zone: Zone) -> str:
    """Words on where the base is to be."""
    return "inside it" if zone.keep == "in" else "outside it, all of its footprint"


def is_blocked(scene: Scene, base: Array) -> bool:
    """True where a base (3,) cannot start, as `blocked_start` has it."""
    return _is_off_floor(scene.world, scene.robot.outline(base)) or too_close(scene, base) is not None


def too_close(scene: Scene, base: Array) -> Nearest | None:
    """The obstacle that a base (3,) stands too close to, by most."""
    ground, outline = scene.ground, scene.robot.outline(base)
    found = ground.nearest(outline)
    if found is None or found.gap < found.clearance - BOUND_ROUNDING:
        return found
    if found.gap > 0.0:
        return None
    for name, shadow, keep in zip(ground.names, ground.shadows, ground.base.keeps, strict=True):
        if _depth(shadow, outline) > BOUND_ROUNDING:  # in what asks for no clearance
            return Nearest(name, 0.0, keep)
    return None


def _is_off_floor(world: World, outline: BaseGeometry) -> bool:
    """True where an outline lies off the floor by more than what counts as touching its edge."""
    floor = world.drivable_floor
    return not (
        floor.covers(outline) or shapely.buffer(floor, BOUND_ROUNDING, join_style="mitre").covers(outline)
    )


def invalid_plan(world: World, violations: Sequence[Violation]) -> Explanation:
    """Explain for which violation first verification rejected a finished plan."""
    first = violations[0]
    more = f" ({len(violations) - 1} more of this and other kinds.)" if len(violations) > 1 else ""
    reason = f"A plan was found but does not hold: {first.text}{more}"
    names = [solid.name for solid in world.solids if solid.name in first.text]
    cause = Cause("path", first.kind, first.amount)
    if names:
        cause = Cause("obstacle", max(names, key=len), first.amount)
    return Explanation("plan-invalid", first.setpoint, reason, (cause,))


def _depth(shadow: Shadow, outline: BaseGeometry) -> float:
    """Depth of a base's deepest point inside a shadow [m]."""
    if shadow.core.area and shadow.core.intersects(outline):
        return shadow.radius + deepest_inside(outline, shadow.core)
    return shadow.radius - float(shadow.core.distance(outline))


def no_drive(scene: Scene, i: int, refusal: NoPathError) -> Explanation:
    """Explain why the base does not get to any place that was looked at for set-point i."""
    kind = scene.robot.drive.words
    reason = (
        f"{setpoint_at(scene.task, i)} has admissible places for the base, but {kind} was not found a way to "
        f"the places that were looked at: {refusal}."
    )
    missing = refusal.across - refusal.passage if isinstance(refusal, NarrowPassageError) else None
    cause, alone = Cause("base", scene.robot.name, missing), SetpointFailure(i, "ladder-broken", reason)
    return Explanation("ladder-broken", i, reason, (cause,), failures=(alone,))
