"""Targets reached with the base held at one pose: a clear posture, a proof that there is none, or neither.

The pose itself is judged first. Then comes the outer reach from it, which rules out most of what is too far;
then postures, of every family that the arm has there; then, for arms that are not too mobile, all postures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from regionik.explain.constraints import no_way_to, zone_words
from regionik.mfabrik import solver_for
from regionik.planners.collision.proximity import describe, nearest, room_of
from regionik.planners.collision.robot_bodies import bodies_from
from regionik.planners.geometry.angles import wrap
from regionik.planners.geometry.offsets import farthest_outside
from regionik.planners.search.box_search import Verdict
from regionik.planners.search.fixed_base import solid_at_target
from regionik.postures.collision_checker import MAX_SPARE
from regionik.postures.families import BACK, FRONT
from regionik.postures.poses import Pose, axis_of
from regionik.reach_table import reach_table
from regionik.reachability.any_base import can_search, rules_out_posture
from regionik.reachability.options import REACHABILITY
from regionik.reachability.target_search import TargetResult, TargetSearch
from regionik.scene import Scene
from regionik.worlds.arms import has_pivot, pivot_index, with_pivot_limits
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import ReasonCode
from regionik.worlds.scene import Target
from regionik.worlds.shadows import Shadow

OPTIONS = REACHABILITY.search
EXACT = 1e-9  # rounding of distances and headings [m], [rad]
EDGE_TOLERANCE = 1e-6  # depth up to which a footprint at the edge of a shadow counts as beside it [m]


def from_base(scene: Scene, targets: Sequence[Target], base: ArrayLike) -> list[TargetResult]:
    """The answers for targets from one pose of the base (3,): x, y [m], yaw [rad].

    Raises InputError for a pose that is not three finite numbers.
    """
    placed = scene.once(_placed_scene, *frozen(base, (3,), "base").tolist())
    if placed.blocked:
        return [_ruled_out(target, placed, *placed.blocked) for target in targets]
    in_reach = placed.may_reach(targets)
    too_far = f"no posture of {scene.robot.name} within its limits brings the tool there from this pose"
    return [
        _answer_from_base(placed, target) if near else _ruled_out(target, placed, "too-far", too_far)
        for target, near in zip(targets, in_reach.tolist(), strict=True)
    ]


@dataclass(frozen=True, eq=False)
class _PlacedScene:
    """A world whose base stands at one pose."""

    scene: Scene  # its pivot where a rule of facing targets holds it
    base: Array  # (3,)
    blocked: tuple[ReasonCode, str] | None  # why nothing can be reached from there; None where it can stand
    spare: float  # that postures keep beyond what the rules want [m]

    @property
    def span(self) -> tuple[float, float]:
        """The one heading."""
        return float(self.base[2]), float(self.base[2])

    @cached_property
    def axis(self) -> Array:
        """The arm axis on the floor (2,)."""
        return axis_of(self.scene.robot, self.base)

    def search(self, target: Target) -> TargetSearch:
        """A search for one target's postures there."""
        found = TargetSearch(self.scene, target, self.base)
        found.collision = replace(found.collision, spare=self.spare)
        return found

    def may_reach(self, targets: Sequence[Target]) -> NDArray[np.bool_]:
        """Mask of the targets whose outer reach holds the arm axis, whatever is in the way.

        A tool may miss its target by the tolerance, so as much is added on all sides.
        """
        by = self.scene.rules.tolerance
        every = np.zeros(len(targets), dtype=bool)
        for rise in (0.0, -by, by):
            rest = np.flatnonzero(~every)
            moved = [
                replace(targets[k], position=targets[k].position + (0.0, 0.0, rise)) for k in rest.tolist()
            ]
            which, _, shapes = reach_table(
                self.scene, moved, (FRONT, BACK), inner=False, span=self.span, coarse=True
            )
            near = shapely.dwithin(shapes, shapely.Point(self.axis), 2 * by + EXACT)
            every[rest[which[near]]] = True
        return every


def _placed_scene(scene: Scene, x: float, y: float, yaw: float) -> _PlacedScene:
    base = np.array([x, y, yaw])
    blocked, room = _blocked(scene, base), np.inf
    if not blocked and scene.rules.avoidance and scene.robot.base_solids:
        room, said = _body_room(scene, base)
        blocked = ("body-blocked", said) if room < -EXACT else None
    return _PlacedScene(scene.once(_facing_ahead), base, blocked, float(np.clip(room / 2, 0.0, MAX_SPARE)))


def _blocked(scene: Scene, base: Array) -> tuple[ReasonCode, str] | None:
    """Why the base cannot stand at a pose, as far as footprint and heading go; None where it can."""
    if scene.rules.heading == "fixed":
        fixed = scene.free_floor.headings[0]
        if abs(wrap(float(base[2]) - fixed)) > EXACT:
            return "wrong-heading", f"the rules fix the heading of the base at {fixed:z.4f} rad"
    ground, outline = scene.ground, scene.robot.outline(base)
    if not shapely.covers(shapely.buffer(ground.floor, EXACT), outline):
        for zone in scene.world.zones:
            if not zone.allows(outline, scene.world.base_allowance):
                side = "outside" if zone.keep == "in" else "in"
                return "zone-blocked", f"the base stands {side} {zone_words(zone.name)} there"
        off = farthest_outside(outline, ground.floor)
        return "off-floor", f"the base stands off the floor there, by {off:.4f} m"
    name, gap, clearance = ground.nearest(outline) or ("", np.inf, 0.0)
    named = zip(ground.names, ground.shadows, strict=True) if gap == 0.0 else ()
    inside = next((name for name, shadow in named if _holds_some(shadow, outline)), "")
    if inside:
        return "base-blocked", f"the base stands inside {inside} there"
    if gap >= clearance - EXACT:
        return None
    needed = f"and must keep {clearance:.4f} m"
    return "base-blocked", f"the base stands {gap:.4f} m from {name} there, {needed}"


def _holds_some(shadow: Shadow, outline: BaseGeometry) -> bool:
    """True where some of a footprint lies in a shadow, and not only at its edge."""
    if shadow.radius > 0.0:
        return bool(shadow.core.distance(outline) < shadow.radius - EXACT)
    return bool(shapely.intersects(shapely.buffer(shadow.core, -EDGE_TOLERANCE, join_style="mitre"), outline))


def _body_room(scene: Scene, base: Array) -> tuple[float, str]:
    """Least distance beyond the rules' of what is fixed to the base [m], and words on it."""
    robot, rules = replace(scene.robot, solids=()), scene.rules
    bodies = bodies_from(
        robot, scene.world.solids, scene.world.arm_clearance, rules.deepest_contact, scene.world.floor_slab
    )
    proximity = nearest(bodies, base, robot.carry)
    return room_of(bodies, proximity), f"{describe(bodies, proximity)} there, whatever the arm does"


def _facing_ahead(scene: Scene) -> Scene:
    """The world with a pivot that looks ahead where the rules want the base to face its targets."""
    chain = scene.robot.chain
    if scene.rules.heading != "face_target":
        return scene
    rules = replace(scene.rules, heading="free")
    if not has_pivot(chain):  # one that stands still
        return scene.changed(rules=rules)
    pivot = chain.active_joints[pivot_index(chain)]
    ahead = float(np.clip(0.0, pivot.lower, pivot.upper))
    robot = replace(scene.robot, chain=with_pivot_limits(chain, ahead, ahead))
    return scene.changed(robot=robot, rules=rules)


def _answer_from_base(placed: _PlacedScene, target: Target) -> TargetResult:
    """The answer for a target that may be in reach."""
    search = placed.search(target)
    if search.collision.enabled:
        bodies, contact = search.collision.bodies, search.collision.contact
        name = solid_at_target(bodies, target.position, placed.scene.rules.tolerance, 0.0, contact)
        if name:
            inside = f"in every posture the end of the arm is in or too near to {name}"
            return _ruled_out(target, placed, "in-obstacle", inside)
    pose = _continued_posture(placed, search)
    if pose is not None:
        return TargetResult("reachable", pose, 0.0, "")
    for family in placed.scene.model(target).families(target, (FRONT, BACK), inner=True):
        pose = search.at(solver_for(placed.scene, family, None, placed.span), placed.base)
        if pose is not None:
            return TargetResult("reachable", pose, 0.0, "")
    return _searched(placed, search)


def _continued_posture(placed: _PlacedScene, search: TargetSearch) -> Pose | None:
    """A clear posture led on from one of those that the arm knows; of arms to which a place gives none."""
    for joints in search.finder.led_on(placed.base, OPTIONS.max_known_postures):
        pose = Pose(placed.base, joints)
        if search.confirms(pose):
            return pose
    return None


def _searched(placed: _PlacedScene, search: TargetSearch) -> TargetResult:
    """The answer where no family shows a clear posture: from samples, then from all postures."""
    if not search.collision.enabled:
        return _undecided(search)
    shut = f"in no posture does the arm {_needed_clearance(search)}"
    if can_search(placed.scene) and rules_out_posture(
        placed.scene, search.target, placed.base, OPTIONS.max_held_cells
    ):
        return _ruled_out(search.target, placed, "arm-blocked", shut)
    pose = search.search()
    if pose is not None:
        return TargetResult("reachable", pose, 0.0, "")
    found = list[Pose]()

    def accept(joints: Array) -> bool:
        pose = Pose(placed.base, np.array(joints))
        if search.on_target([pose]) and search.collision.proves(pose):
            found.append(pose)
        return bool(found)

    verdict = search.finder.every(placed.base, accept, OPTIONS.max_held_boxes)
    if found:
        return TargetResult("reachable", found[0], 0.0, "")
    if verdict == Verdict.RULED_OUT:
        return _ruled_out(search.target, placed, "arm-blocked", shut)
    return _undecided(search)


def _needed_clearance(search: TargetSearch) -> str:
    """What the arm would have to do there, by the best of the postures looked at."""
    if search.proximity is None:
        return "bring the tool there and keep off its surroundings, itself and its base"
    best = search.collision.words(search.proximity)
    return f"keep off its surroundings, itself and its base; in the best of those looked at, {best}"


def _ruled_out(target: Target, placed: _PlacedScene, code: ReasonCode, why: str) -> TargetResult:
    who = TargetSearch(placed.scene, target).who
    told = f"{who} cannot be reached from {_place(placed.base)}: {why}"
    return TargetResult("unreachable", None, 0.0, told, code)


def _undecided(search: TargetSearch) -> TargetResult:
    """A target for which no posture was found, and none is ruled out."""
    assert search.fixed_base is not None
    lead, proximity = f"{no_way_to(search.who)} from {_place(search.fixed_base)}", search.proximity
    code: ReasonCode = "not-found"
    why = "no posture was found, and none is ruled out"
    if proximity is not None:
        code = "arm-blocked"
        why = f"each of {search.colliding} postures looked at touches something; in the best of them, "
        why += search.collision.words(proximity)
    return TargetResult("undecided", None, 0.0, f"{lead}: {why}", code)


def _place(base: Array) -> str:
    """A pose of the base in words."""
    x, y, yaw = base.tolist()
    return f"the base at ({x:z.3f}, {y:z.3f}, {yaw:z.3f})"
