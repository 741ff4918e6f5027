"""A clear posture of an arm in one plane for a target, from any place of the floor: found, or proven none."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Point, Polygon

from regionik.areas.ground import EVERY, GUARD, ground_of
from regionik.areas.reachable import model_of, planar_reach, reach_model
from regionik.areas.standing import room_for
from regionik.planners.clearance.any_base import AnyBase, BaseFloor, ToolDemand, near_solids, search_cells
from regionik.planners.clearance.arm_clearance import MOST_RINGS
from regionik.planners.clearance.planar_capsules import NearObstacles, PlaneCapsules, plane_capsules
from regionik.planners.clearance.planar_cells import ArmMount, cell_for
from regionik.planners.clearance.posture_proof import solid_at_target
from regionik.planners.geometry.distances import obstacles_from
from regionik.planners.geometry.polygons import Index
from regionik.planners.geometry.upright_bodies import Uprights, depths, uprights_from
from regionik.planners.search.box_search import Verdict
from regionik.planners.solvers.planar_arm import reach_intervals
from regionik.postures.arm_guard import contact_for, guard_of
from regionik.postures.poses import Pose
from regionik.reachability.planar_world import floor_of, keep_of, own, reach_of, stance_of
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target, World

FEWEST = 64  # cells that a search has at least: those that it may begin with


class AnyBaseResult(NamedTuple):
    """Outcome of a search of all postures from all places.

    Attributes
    ----------
    verdict : Verdict
        PROVEN by a posture.
    pose : Pose or None
        The posture found; it is clear, the base is on the floor.
    gap : float
        Diagonal of a box round the places of the arm axis that are left open, 0 where none are [m].
    around : tuple of str
        Names of the obstacles that an arm at the target might touch.
    """

    verdict: Verdict
    pose: Pose | None
    gap: float
    around: tuple[str, ...]


def can_search(world: World) -> bool:
    """Tell whether `search_any_base` can be asked: of an arm in one plane that is led round things."""
    return world.rules.avoidance and reach_model(world.robot, "point").exhaustible


def search_any_base(world: World, target: Target, most: int) -> AnyBaseResult:
    """Search for a clear posture of an arm in one plane, from every place of the floor at every heading.

    Parameters
    ----------
    world : World
        One of which `can_search` holds.
    target : Target
    most : int
        Budget of cells of postures.
    """
    bodies, contact = guard_of(world).bodies, contact_for(world, [target])
    if name := solid_at_target(bodies, target.position, world.rules.tolerance, 0.0, contact):
        return AnyBaseResult(Verdict.RULED_OUT, None, 0.0, (name,))
    task = any_base_of(world, target)
    reach, plane = reach_of(world), task.mount.plane
    rings = np.empty((MOST_RINGS, 2))
    found = reach_intervals(
        plane, -np.inf, np.inf, reach.centers, reach.radii, target.position[2], True, True, rings
    )
    verdict, gap = search_cells(task, rings[:found], max(most, FEWEST))
    if verdict == Verdict.PROVEN:
        return AnyBaseResult(verdict, Pose(task.base, task.joints), 0.0, ())
    near = np.unique(task.around.owner[task.around.near]).tolist()
    return AnyBaseResult(verdict, None, gap, tuple(world.solids[k].name for k in near))


def any_base_of(world: World, target: Target) -> AnyBase:
    """A target in a world as the search takes it."""
    arm, stance, capsules = prepared(world), stance_of(world, EVERY), prepared(world).capsules
    return AnyBase(
        capsules, arm.mount, stance.sign, stance.offset, arm.floor, _around(world, target),
        _demand(world, target), keep_of(world), cell_for(len(capsules.rank)),
        np.empty(3), own(world.robot.carry), np.zeros(2, dtype=np.int64),
    )  # fmt: skip


class PreparedWorld(NamedTuple):
    """Parts of a search that are the same for all targets of a world."""

    capsules: PlaneCapsules
    mount: ArmMount
    floor: BaseFloor
    solids: Uprights
    deep: Array
    owner: Index
    far: float  # from a target, beyond which a solid touches no link [m]


@lru_cache(maxsize=8)
def prepared(world: World) -> PreparedWorld:
    """Parts of a search that are the same for all targets of a world."""
    stance, capsules = stance_of(world, EVERY), plane_capsules(world.robot, planar_reach(world.robot).arm)
    fixed = world.rules.heading == "fixed"
    mount = ArmMount(
        stance.plane, stance.mount, stance.zero, stance.low, stance.high, stance.yaw if fixed else np.nan
    )
    obstacles = obstacles_from(world.solids)
    whole = [k for k, piece in enumerate(obstacles.pieces) if piece.mesh is None]
    solids = uprights_from([obstacles.pieces[k] for k in whole])
    levers = np.linalg.norm(capsules.ends, axis=2).max(initial=0.0) + capsules.radius.max(initial=0.0)
    far = stance.plane.lengths.sum() + abs(stance.plane.shoulder_r) + levers + world.rules.arm_clearance
    return PreparedWorld(
        capsules,
        mount,
        _floor(world),
        solids,
        depths(solids),
        np.array(obstacles.owner, dtype=np.int64)[whole],
        float(far + world.rules.tolerance),
    )


def _around(world: World, target: Target) -> NearObstacles:
    """The obstacles that an arm at a target might touch."""
    arm, contact, rules = prepared(world), contact_for(world, [target]), world.rules
    near = np.empty(len(arm.owner), dtype=np.int64)
    near = near[: near_solids(arm.solids, own(target.position), arm.far, near)]
    tool_on = int(contact.owner[0]) if len(contact.owner) else -1
    return NearObstacles(arm.solids, arm.deep, near, arm.owner, tool_on, rules.arm_clearance, rules.tolerance)


def _floor(world: World) -> BaseFloor:
    ground, room = ground_of(world), room_for(world)
    heart, radius = np.zeros(2), 0.0
    if len(room.corners) > 2:
        outline = Polygon(room.corners)
        middle = shapely.maximum_inscribed_circle(outline).coords[0]
        heart, radius = own(np.array(middle)), outline.exterior.distance(Point(middle))
    inner, outer = floor_of(ground.inner), floor_of(ground.outer)
    return BaseFloor(inner, outer, room, heart, radius, ground.far, GUARD)


def _demand(world: World, target: Target) -> ToolDemand:
    position, free = own(target.position), np.array([0.0, 0.0, 1.0])
    seek = world.rules.criteria is None and target.orientation is None
    if target.direction is None:
        return ToolDemand(position, free, np.pi, seek)
    if not model_of(world, target).exact:
        return ToolDemand(position, free, np.pi, False)
    return ToolDemand(position, own(target.direction), float(target.cone), seek)
