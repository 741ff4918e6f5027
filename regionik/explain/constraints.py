"""Constraints that a world may be relaxed by, and sentences about them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import combinations

import numpy as np
import shapely
from shapely.geometry import Point
from shapely.ops import nearest_points

from regionik.worlds.arms import reach_bound
from regionik.worlds.arrays import Array
from regionik.worlds.body import has_body, without_body
from regionik.worlds.chain import Chain
from regionik.worlds.errors import CauseKind, Repair
from regionik.worlds.obstacles import Solid
from regionik.worlds.scene import Target, World
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


@dataclass(frozen=True)
class Constraint:
    """One constraint of a world, and its relaxation, which makes nothing impossible."""

    kind: CauseKind  # as in `Cause`
    name: str  # an obstacle's own name, or one of the constants of this module
    relax: Callable[[World], World]  # world to world without it


def constraints_of(world: World) -> tuple[Constraint, ...]:
    """Constraints on a world's task, the least expected as a cause first.

    The length of the arm and the height of its mount are none, nor is the kind of the base: areas and ladder
    are those of an omnidirectional one.
    """
    far = sorted(world.obstacles, key=lambda solid: -_gap(solid, world))
    found = [Constraint("obstacle", solid.name, partial(without_obstacle, name=solid.name)) for solid in far]
    if world.floor.cells:
        found.append(Constraint("obstacle", CELLS, without_cells))
    found.append(Constraint("floor", EDGE, without_edge))
    if world.rules.clearance > 0 and world.solids:
        found.append(Constraint("clearance", CLEARANCE, partial(with_rules, clearance=0.0)))
    if world.rules.execution is not None:
        found.append(Constraint("execution", EXECUTION, partial(with_rules, execution=None)))
    if len(world.robot.footprint) > 1:
        found.append(Constraint("base", FOOTPRINT, without_footprint))
    if has_body(world.robot) and world.solids:
        found.append(Constraint("base", BODY, without_upper_body))
    if world.rules.heading != "free":
        found.append(Constraint("base", HEADING, partial(with_rules, heading="free")))
    if any(target.direction is not None for target in world.task):
        found.append(Constraint("direction", direction_name(world), without_direction))
    if world.rules.criteria is not None:
        found.append(Constraint("criteria", CRITERIA, partial(with_rules, criteria=None)))
    found.append(Constraint("limits", JOINT_LIMITS, without_joint_limits))
    return tuple(found)


def arm_constraints_of(world: World) -> tuple[Constraint, ...]:
    """`constraints_of` with the arm's clearance and self-collision."""
    found = [Constraint("self", OWN_BODY, without_own_body)]
    if world.rules.solid_floor:
        found.append(Constraint("floor", SOLID_FLOOR, partial(with_rules, solid_floor=False)))
    if world.rules.arm_clearance > 0 and world.arm_solids:
        found.append(Constraint("clearance", ARM_CLEARANCE, partial(with_rules, arm_clearance=0.0)))
    return (*constraints_of(world)[:-1], *found, *constraints_of(world)[-1:])


def path_constraints_of(world: World) -> tuple[Constraint, ...]:
    """`constraints_of` a whole path, after the lift-offs that are allowed and the start of the base.

    The start is kept where it fixes the heading.
    """
    found = []
    if world.rules.max_lift_offs is not None:
        found.append(Constraint("path", LIFT_OFFS, partial(with_rules, max_lift_offs=None)))
    if world.start is not None and world.rules.heading != "fixed":
        found.append(Constraint("floor", START, partial(replace, start=None)))
    return (*found, *constraints_of(world))


def direction_name(world: World) -> str:
    """Name of the demand on the tool beyond its position."""
    turned = any(target.orientation is not None for target in world.task)
    return "tool orientation" if turned else "tool direction"


def _gap(solid: Solid, world: World) -> float:
    """Least distance between a solid and the set-points [m]."""
    return min(float(solid.distance(target.position)) for target in world.task)


def with_rules(world: World, **changes: object) -> World:
    """A world of other rules."""
    return replace(world, rules=replace(world.rules, **changes))  # type: ignore[arg-type]


def without_obstacle(world: World, name: str) -> World:
    """No obstacle of that name."""
    return replace(world, obstacles=tuple(solid for solid in world.obstacles if solid.name != name))


def without_cells(world: World) -> World:
    """A map with no occupied or unknown cells."""
    return replace(world, floor=replace(world.floor, cells=()))


def without_edge(world: World) -> World:
    """A floor that ends nowhere near the task."""
    span = reach_bound(world.robot.chain)
    away = float(np.hypot(*(world.robot.footprint - world.robot.mount[:2]).T).max())
    spots = shapely.MultiPoint([target.position[:2] for target in world.task])
    margin = 2 * (span.radius + span.length + away) + world.base_clearance + 1.0
    wide = shapely.box(*(world.floor.polygon.union(spots.envelope).bounds)).buffer(margin, join_style="mitre")
    return replace(world, floor=replace(world.floor, polygon=wide))


def without_own_body(world: World) -> World:
    """Links that may pass through one another and through the base."""
    robot = world.robot
    body = base_body(robot)
    names = [solid.name for solid in robot.all_solids] + ([body.name] if body else [])
    return replace(world, robot=replace(robot, unchecked=tuple(combinations(names, 2))))


def without_footprint(world: World) -> World:
    """A base shrunk to its point nearest to the arm axis."""
    axis = Point(world.robot.mount[:2])
    outline = shapely.MultiPoint(world.robot.footprint).convex_hull
    point = np.array(nearest_points(outline, axis)[0].coords)
    return replace(world, robot=replace(world.robot, footprint=point))


def without_upper_body(world: World) -> World:
    """A base with nothing on it but the arm."""
    return replace(world, robot=without_body(world.robot))


def without_direction(world: World) -> World:
    """Set-points that ask for positions only."""
    bare = tuple(replace(target, direction=None, orientation=None) for target in world.task)
    return replace(world, task=bare)


def without_joint_limits(world: World) -> World:
    """Revolute joints without limits; prismatic ones, and those that others mimic, keep theirs."""
    return replace(world, robot=replace(world.robot, chain=_endless(world.robot.chain)))


@lru_cache(maxsize=16)
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
    """A set-point as people count, and where it is."""
    return f"{setpoint(i, len(task))} at {spot(task[i].position)}"


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


def no_way_to(who: str) -> str:
    """Beginning of a sentence on a target that is neither shown to be in reach nor ruled out."""
    return f"No way was found to reach {who[0].lower()}{who[1:]}"


def places_open(gap: float) -> str:
    """Beginning of a sentence on the undecided places, the widest ``gap`` across [m]."""
    return f"Places for the base up to {gap:.4f} m across are not ruled out"


def joint_causes(world: World, kept: Sequence[Constraint], *, proven: bool) -> str:
    """A sentence on irreducible causes; where it rests on inner areas alone it says so first."""
    if not kept and proven:
        return f"The arm of {world.robot.name} on its mount is too short, whatever else is taken away."
    unproven = "By inner areas alone, which prove nothing, what stands in the way"
    what = "What rules it out" if proven else unproven
    if not kept:
        return f"{what} is the arm of {world.robot.name} on its mount, whatever else is taken away."
    names = [_name(world, one) for one in kept]
    if len(names) == 1:
        return f"{what} is {names[0]}, by itself."
    return f"{what} is {join(names)} together; without any one of them the rest does not."


def _name(world: World, one: Constraint) -> str:
    """A constraint as it stands in a sentence."""
    words = {
        CLEARANCE: f"the clearance of {world.rules.clearance:g} m",
        ARM_CLEARANCE: f"the arm's clearance of {world.rules.arm_clearance:g} m",
        EXECUTION: f"the errors that {EXECUTION} allows for",
        OWN_BODY: f"that the {OWN_BODY} keep apart",
        HEADING: f"the heading policy '{world.rules.heading}'",
        FOOTPRINT: f"the {FOOTPRINT}",
        BODY: f"{BODY} of {world.robot.name}",
        CELLS: f"the {CELLS}",
        JOINT_LIMITS: f"the {JOINT_LIMITS} of {world.robot.name}",
    }
    plain = f"the {one.name}" if one.kind in ("floor", "direction") else one.name
    return words.get(one.name, plain)


def mended(repairs: Sequence[Repair], tried: Sequence[str] = ()) -> str:
    """A sentence on the smallest repair; on what was ``tried`` where there is none."""
    if not repairs:
        what = f" Tried were, at most: {'; '.join(tried)}." if tried else ""
        return f"No single change that was tried mends it.{what}"
    more = f" ({len(repairs) - 1} more {'way' if len(repairs) == 2 else 'ways'} found)"
    return f"What would mend it: {repairs[0].text}{more if len(repairs) > 1 else ''}."
