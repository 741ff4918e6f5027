"""Constraints that a world may be relaxed by, and sentences about them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
import shapely
from shapely.geometry import Point
from shapely.ops import nearest_points

from regionik.scene import Scene
from regionik.worlds.arms import reach_bound
from regionik.worlds.arrays import Array
from regionik.worlds.body import without_body
from regionik.worlds.chain import Chain
from regionik.worlds.errors import CauseKind, Repair
from regionik.worlds.obstacles import Solid
from regionik.worlds.prepared import made_once
from regionik.worlds.scene import Target
from regionik.worlds.self_collision import base_body

JOINT_LIMITS = "joint limits"
CLEARANCE = "rules.clearance"
EXECUTION = "rules.execution"
ARM_CLEARANCE = "rules.arm_clearance"
OWN_BODY = "links and base of the robot"
HEADING = "rules.heading"
FOOTPRINT = "footprint of the base"
BODY = "what stands on the base"
EDGE = "edge of the floor"
SOLID_FLOOR = "floor under the arm"
CELLS = "cells of the map"
CRITERIA = "rules.criteria"
START = "start of the base"
LIFT_OFFS = "rules.max_lift_offs"
LIFT_WITHIN = "rules.lift_within"


@dataclass(frozen=True)
class Constraint:
    """One constraint of a world, and its relaxation, which makes nothing impossible."""

    kind: CauseKind  # as in `Cause`
    name: str  # an obstacle's own name, or one of the constants of this module
    relax: Callable[[Scene], Scene]  # world to world without it


def constraints_of(scene: Scene) -> tuple[Constraint, ...]:
    """Constraints on a world's task, the least expected as a cause first.

    The length of the arm and the height of its mount are none, nor is the kind of the base: areas and ladder
    are those of an omnidirectional one.
    """
    far = sorted(scene.world.obstacles, key=lambda solid: -_gap(solid, scene))
    found = [Constraint("obstacle", solid.name, partial(without_obstacle, name=solid.name)) for solid in far]
    if scene.floor.cells:
        found.append(Constraint("obstacle", CELLS, without_cells))
    found += [
        Constraint("zone", zone.name, partial(without_zone, name=zone.name)) for zone in scene.world.zones
    ]
    found.append(Constraint("floor", EDGE, without_edge))
    if scene.rules.clearance > 0 and scene.world.solids:
        found.append(Constraint("clearance", CLEARANCE, partial(with_rules, clearance=0.0)))
    found += [
        Constraint(
            "clearance", own_clearance(solid.name), partial(with_own_clearance, name=solid.name, to=0.0)
        )
        for solid in far
        if solid.clearance
    ]
    if scene.rules.execution is not None:
        found.append(Constraint("execution", EXECUTION, partial(with_rules, execution=None)))
    if len(scene.robot.footprint) > 1:
        found.append(Constraint("base", FOOTPRINT, without_footprint))
    if scene.ground.around or scene.lifted.matters:
        found.append(Constraint("base", BODY, without_upper_body))
    if scene.rules.heading != "free":
        found.append(Constraint("base", HEADING, partial(with_rules, heading="free")))
    if any(target.direction is not None for target in scene.task):
        found.append(Constraint("direction", direction_name(scene), without_direction))
    if scene.rules.criteria is not None:
        found.append(Constraint("criteria", CRITERIA, partial(with_rules, criteria=None)))
    found.append(Constraint("limits", JOINT_LIMITS, without_joint_limits))
    return tuple(found)


def arm_constraints_of(scene: Scene) -> tuple[Constraint, ...]:
    """`constraints_of` with the arm's clearance and self-collision."""
    found = [Constraint("self", OWN_BODY, without_own_body)]
    if scene.rules.solid_floor:
        found.append(Constraint("floor", SOLID_FLOOR, partial(with_rules, solid_floor=False)))
    if scene.rules.arm_clearance > 0 and scene.world.arm_solids:
        found.append(Constraint("clearance", ARM_CLEARANCE, partial(with_rules, arm_clearance=0.0)))
    return (*constraints_of(scene)[:-1], *found, *constraints_of(scene)[-1:])


def path_constraints_of(scene: Scene) -> tuple[Constraint, ...]:
    """`constraints_of` a whole path, after the lift-offs that are allowed and the start of the base.

    The start is kept where it fixes the heading.
    """
    found = []
    if scene.rules.max_lift_offs is not None:
        found.append(Constraint("path", LIFT_OFFS, partial(with_rules, max_lift_offs=None)))
    if scene.within_strokes.any() and not scene.rules.lift_within:
        found.append(Constraint("path", LIFT_WITHIN, partial(with_rules, lift_within=True)))
    if scene.start is not None and scene.rules.heading != "fixed":
        found.append(Constraint("floor", START, without_start))
    return (*found, *constraints_of(scene))


def direction_name(scene: Scene) -> str:
    """Name of the demand on the tool beyond its position."""
    turned = any(target.orientation is not None for target in scene.task)
    return "tool orientation" if turned else "tool direction"


def _gap(solid: Solid, scene: Scene) -> float:
    """Least distance between a solid and the set-points [m]."""
    return min(float(solid.distance(target.position)) for target in scene.task)


def with_rules(scene: Scene, **changes: object) -> Scene:
    """A world of other rules."""
    return scene.changed(rules=replace(scene.rules, **changes))  # type: ignore[arg-type]


def without_start(scene: Scene) -> Scene:
    """The scene of a robot that may begin anywhere."""
    return scene.changed(start=None)


def without_obstacle(scene: Scene, name: str) -> Scene:
    """No obstacle of that name."""
    return scene.changed(obstacles=tuple(solid for solid in scene.world.obstacles if solid.name != name))


def own_clearance(name: str) -> str:
    """What an obstacle's own clearance is called."""
    return f"clearance from {name}"


def with_own_clearance(scene: Scene, name: str, to: float) -> Scene:
    """Another clearance of its own for the obstacle of that name."""
    return scene.changed(
        obstacles=tuple(
            replace(solid, clearance=to) if solid.name == name else solid for solid in scene.world.obstacles
        )
    )


def without_zone(scene: Scene, name: str) -> Scene:
    """No zone of that name."""
    return scene.changed(zones=tuple(zone for zone in scene.world.zones if zone.name != name))


def without_cells(scene: Scene) -> Scene:
    """A map with no occupied or unknown cells."""
    return scene.changed(floor=replace(scene.floor, cells=()))


def without_edge(scene: Scene) -> Scene:
    """A floor that ends nowhere near the task."""
    span = reach_bound(scene.robot.chain)
    away = float(np.hypot(*(scene.robot.footprint - scene.robot.mount[:2]).T).max())
    spots = shapely.MultiPoint([target.position[:2] for target in scene.task])
    margin = 2 * (span.radius + span.length + away) + scene.world.base_clearance + 1.0
    wide = shapely.box(*(scene.floor.polygon.union(spots.envelope).bounds)).buffer(margin, join_style="mitre")
    return scene.changed(floor=replace(scene.floor, polygon=wide))


def without_own_body(scene: Scene) -> Scene:
    """Links that may pass through one another and through the base."""
    robot = scene.robot
    body = base_body(robot)
    names = [solid.name for solid in robot.all_solids] + ([body.name] if body else [])
    return scene.changed(robot=replace(robot, unchecked=tuple(combinations(names, 2))))


def without_footprint(scene: Scene) -> Scene:
    """A base shrunk to its point nearest to the arm axis."""
    axis = Point(scene.robot.mount[:2])
    outline = shapely.MultiPoint(scene.robot.footprint).convex_hull
    point = np.array(nearest_points(outline, axis)[0].coords)
    return scene.changed(robot=replace(scene.robot, footprint=point))


def without_upper_body(scene: Scene) -> Scene:
    """A base with nothing on it but the arm."""
    return scene.changed(robot=without_body(scene.robot))


def without_direction(scene: Scene) -> Scene:
    """Set-points that ask for positions only."""
    bare = tuple(replace(target, direction=None, orientation=None) for target in scene.task)
    return scene.changed(task=bare)


def without_joint_limits(scene: Scene) -> Scene:
    """Revolute joints without limits; prismatic ones, and those that others mimic, keep theirs."""
    return scene.changed(robot=replace(scene.robot, chain=_endless(scene.robot.chain)))


@made_once
def _endless(chain: Chain) -> Chain:
    """Cached, as the reach of a chain is cached by chain."""
    turning = {name for name, turns in zip(chain.names, chain.turning, strict=True) if turns}
    joints = tuple(
        replace(joint, lower=-np.inf, upper=np.inf) if joint.name in turning else joint
        for joint in chain.joints
    )
    return replace(chain, joints=joints)


def setpoint(i: int, count: int) -> str:
    """A set-point as people count, and an only one as the target."""
    return "The target" if count == 1 else f"Set-point {i + 1} of {count}"


def setpoint_at(task: Sequence[Target], i: int) -> str:
    """A set-point as people count and call it, and where it is."""
    name = f" '{task[i].name}'" if task[i].name else ""
    return f"{setpoint(i, len(task))}{name} at {spot(task[i].position)}"


def within_stroke(task: Sequence[Target], i: int) -> str:
    """End of a sentence on a lift-off before set-point i that is within a stroke."""
    number = task[i].stroke
    own = [k + 1 for k, target in enumerate(task) if target.stroke == number]
    return f"within stroke {number}, which goes from set-point {own[0]} to {own[-1]}."


def spot(position: Array) -> str:
    """A position in words."""
    return f"({', '.join(f'{value:z.3f}' for value in position)})"


def rounded_down(value: float, digits: int) -> float:
    """A length with so many digits, no more than it is but by rounding."""
    return math.floor(value * 10**digits + 1e-6) / 10**digits


def join(names: Sequence[str]) -> str:
    """Names in one line."""
    if not names:
        return "nothing"
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def zone_words(name: str) -> str:
    """A zone as it stands in a sentence."""
    return f"the zone {name}"


def no_way_to(who: str) -> str:
    """Beginning of a sentence on a target that is neither shown to be in reach nor ruled out."""
    return f"No way was found to reach {who[0].lower()}{who[1:]}"


def places_open(gap: float) -> str:
    """Beginning of a sentence on the undecided places, the widest ``gap`` across [m]."""
    return f"Places for the base up to {gap:.4f} m across are not ruled out"


def joint_causes(scene: Scene, remaining: Sequence[Constraint], *, proven: bool) -> str:
    """A sentence on irreducible causes; where it rests on inner areas alone it says so first."""
    if not remaining and proven:
        return f"The arm of {scene.robot.name} on its mount is too short, whatever else is taken away."
    unproven = "By inner areas alone, which prove nothing, what stands in the way"
    what = "What rules it out" if proven else unproven
    if not remaining:
        return f"{what} is the arm of {scene.robot.name} on its mount, whatever else is taken away."
    names = [_name(scene, one) for one in remaining]
    if len(names) == 1:
        return f"{what} is {names[0]}, by itself."
    return f"{what} is {join(names)} together; without any one of them the rest does not."


def _name(scene: Scene, one: Constraint) -> str:
    """A constraint as it stands in a sentence."""
    words = {
        CLEARANCE: f"the clearance of {scene.rules.clearance:g} m",
        ARM_CLEARANCE: f"the arm's clearance of {scene.rules.arm_clearance:g} m",
        EXECUTION: f"the errors that {EXECUTION} allows for",
        OWN_BODY: f"that the {OWN_BODY} keep apart",
        HEADING: f"the heading policy '{scene.rules.heading}'",
        FOOTPRINT: f"the {FOOTPRINT}",
        BODY: f"{BODY} of {scene.robot.name}",
        CELLS: f"the {CELLS}",
        JOINT_LIMITS: f"the {JOINT_LIMITS} of {scene.robot.name}",
    }
    words |= {
        own_clearance(solid.name): f"the {own_clearance(solid.name)}, {solid.clearance:g} m"
        for solid in scene.world.obstacles
        if solid.clearance is not None
    }
    if one.kind == "zone":
        return zone_words(one.name)
    plain = f"the {one.name}" if one.kind in ("floor", "direction") else one.name
    return words.get(one.name, plain)


def mended(repairs: Sequence[Repair], tried: Sequence[str] = ()) -> str:
    """A sentence on the smallest repair; on what was ``tried`` where there is none."""
    if not repairs:
        what = f" Tried were, at most: {'; '.join(tried)}." if tried else ""
        return f"No single change that was tried mends it.{what}"
    more = f" ({len(repairs) - 1} more {'way' if len(repairs) == 2 else 'ways'} found)"
    return f"What would mend it: {repairs[0].text}{more if len(repairs) > 1 else ''}."
