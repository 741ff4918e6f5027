"""A clear posture of an arm in one plane for a target, from any place of the floor: found, or proven none."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Point, Polygon

from regionik.areas.ground import Side
from regionik.areas.layers import ROUNDING_MARGIN
from regionik.areas.reachable import planar_reach, reach_model
from regionik.planners.collision.distances import obstacles_from
from regionik.planners.collision.robot_bodies import RobotScene
from regionik.planners.collision.upright_solids import Uprights, inradii, uprights_from
from regionik.planners.geometry.polygons import FlatPolygon
from regionik.planners.reach.any_base import (
    AnyBase,
    BaseFloor,
    FloorPart,
    ToolDemand,
    near_solids,
    search_cells,
)
from regionik.planners.reach.planar_capsules import NearObstacles, PlaneCapsules, plane_capsules
from regionik.planners.reach.planar_cells import ArmMount, cell_for
from regionik.planners.reach.rings import reach_intervals
from regionik.planners.search.box_search import Verdict
from regionik.planners.search.fixed_base import solid_at_target
from regionik.postures.collision_checker import MAX_SPARE, contact_for
from regionik.postures.poses import Pose, axis_of
from regionik.reachability.options import REACHABILITY
from regionik.scene import Scene
from regionik.worlds.arrays import Array, Index
from regionik.worlds.scene import Target

OPTIONS = REACHABILITY.search


class AnyBaseResult(NamedTuple):
    """Outcome of a search of all postures from all places."""

    verdict: Verdict  # PROVEN by a posture
    pose: Pose | None  # the posture found; it is clear, the base is on the floor
    gap: float  # diagonal of a box round the places of the arm axis that are left open, 0 where none are [m]
    around: tuple[str, ...]  # names of the obstacles that an arm at the target might touch


def can_search(scene: Scene) -> bool:
    """Return True where `search_any_base` applies: to an arm in one plane that avoids obstacles.

    Only such an arm's reach of points is exact; a proof for these is one for poses.
    """
    return scene.rules.avoidance and reach_model(scene.robot, "point").exact


def search_any_base(scene: Scene, target: Target, most: int) -> AnyBaseResult:
    """Search for a clear posture of an arm in one plane, from every place of the floor at every heading.

    Only where `can_search` holds; ``most`` is the budget of cells of postures.
    """
    bodies, contact = scene.collision.bodies, contact_for(scene.world, [target])
    if name := solid_at_target(bodies, target.position, scene.rules.tolerance, 0.0, contact):
        return AnyBaseResult(Verdict.RULED_OUT, None, 0.0, (name,))
    task, model = any_base_of(scene, target), planar_reach(scene.robot)
    (rings,) = reach_intervals(model.arm, model.plane.shoulder_z, target.position[2:])
    verdict, gap = search_cells(task, rings, max(most, OPTIONS.min_cells))
    if verdict == Verdict.PROVEN:
        return AnyBaseResult(verdict, Pose(task.base, task.joints), 0.0, ())
    near = np.unique(task.around.owner[task.around.near]).tolist()
    return AnyBaseResult(verdict, None, gap, tuple(scene.world.arm_solids[k].name for k in near))


def rules_out_posture(scene: Scene, target: Target, base: Array, most: int) -> bool:
    """True where each posture from one pose of the base (3,) is proven to touch something.

    Only where `can_search` holds. The place is left open by what the tool may miss its target by; the base
    itself is not looked at.
    """
    task, by = any_base_of(scene, target), 2 * scene.rules.tolerance + ROUNDING_MARGIN
    axis = axis_of(scene.robot, base)
    square = np.array([[-by, -by], [by, -by], [by, by], [-by, by]]) + axis
    room = task.floor.room._replace(corners=np.empty((0, 2)))
    floor = task.floor._replace(
        inner=floor_of(Side(Polygon(), np.empty(0, dtype=object))),
        outer=FloorPart(square, np.array([0, 4], dtype=np.int64)),
        room=room,
    )
    held = task._replace(
        mount=task.mount._replace(yaw=float(base[2])), floor=floor, demand=task.demand._replace(seek=False)
    )
    far = float(np.hypot(*(target.position[:2] - axis)))
    rings = np.array([[far - 2 * by, far + 2 * by], [-far - 2 * by, -far + 2 * by]])
    return search_cells(held, rings, max(most, OPTIONS.min_cells))[0] == Verdict.RULED_OUT


def any_base_of(scene: Scene, target: Target) -> AnyBase:
    """Return a target in a world as the search takes it."""
    arm = scene.once(prepared)
    return AnyBase(
        arm.capsules, arm.mount, arm.floor, _around(scene, target), _demand(scene, target), arm.scene,
        MAX_SPARE,
        cell_for(len(arm.capsules.rank)), np.empty(3), writable(scene.robot.carry),
        np.zeros(2, dtype=np.int64),
    )  # fmt: skip


class PreparedWorld(NamedTuple):
    """Robot, floor and solids of a world for the search: the same for all targets."""

    capsules: PlaneCapsules
    mount: ArmMount
    floor: BaseFloor
    solids: Uprights
    deep: Array
    owner: Index
    far: float  # from a target, beyond which a solid touches no link [m]
    scene: RobotScene  # the robot among the solids that it keeps away from


def prepared(scene: Scene) -> PreparedWorld:
    """Return what is the same for all targets of a world."""
    model, collision = planar_reach(scene.robot), scene.collision
    capsules = plane_capsules(scene.robot, model.arm)
    obstacles = obstacles_from(scene.world.arm_solids)
    whole = [k for k, piece in enumerate(obstacles.pieces) if piece.mesh is None]
    solids = uprights_from([obstacles.pieces[k] for k in whole])
    levers = np.linalg.norm(capsules.ends, axis=2).max(initial=0.0) + capsules.radius.max(initial=0.0)
    far = model.plane.lengths.sum() + abs(model.plane.shoulder_r) + levers + scene.world.arm_clearance
    return PreparedWorld(
        capsules,
        _mount(scene),
        _floor(scene),
        solids,
        inradii(solids),
        np.array(obstacles.owner, dtype=np.int64)[whole],
        float(far + scene.rules.tolerance),
        collision.bodies.scene(collision.contact),
    )


def _around(scene: Scene, target: Target) -> NearObstacles:
    """Return the obstacles that an arm at a target might touch."""
    arm, contact, rules = scene.once(prepared), contact_for(scene.world, [target]), scene.rules
    near = np.empty(len(arm.owner), dtype=np.int64)
    near = near[: near_solids(arm.solids, writable(target.position), arm.far, near)]
    tool_on = int(contact.owner[0]) if len(contact.owner) else -1
    floor = -1 if scene.world.floor_slab is None else len(scene.world.solids)
    far = scene.world.arm_clearance, rules.tolerance
    return NearObstacles(arm.solids, arm.deep, near, arm.owner, floor, tool_on, *far)


def _floor(scene: Scene) -> BaseFloor:
    ground, room = scene.ground, scene.footprint
    heart, radius = np.zeros(2), 0.0
    if len(room.corners) > 2:
        outline = Polygon(room.corners)
        middle = shapely.maximum_inscribed_circle(outline).coords[0]
        heart, radius = writable(np.array(middle)), outline.exterior.distance(Point(middle))
    inner, outer = floor_of(ground.inner), floor_of(ground.outer)
    return BaseFloor(inner, outer, room, heart, radius, ground.far, ROUNDING_MARGIN)


def _demand(scene: Scene, target: Target) -> ToolDemand:
    position, free = writable(target.position), np.array([0.0, 0.0, 1.0])
    seek = scene.rules.criteria is None and target.orientation is None
    if target.direction is None:
        return ToolDemand(position, free, np.pi, seek)
    if not scene.model(target).exact:
        return ToolDemand(position, free, np.pi, False)
    return ToolDemand(position, writable(target.direction), float(target.cone), seek)


def _mount(scene: Scene) -> ArmMount:
    """The arm on its base, at the heading of the world's start where the rules keep that."""
    robot, model = scene.robot, planar_reach(scene.robot)
    arm, (low, high) = model.arm, model.pivot(scene.rules)
    zero = float(arm.pivot_zero + robot.mount[3])
    start = 0.0 if scene.start is None else float(scene.start.base[2])
    yaw = start if scene.rules.heading == "fixed" else np.nan
    sign, offset, mount = map(writable, (arm.sign, arm.offset, robot.mount[:2]))
    return ArmMount(model.plane, sign, offset, mount, zero, low, high, yaw)


@lru_cache(maxsize=256)
def floor_of(side: Side) -> FloorPart:
    """The free floor of a side."""
    parts = [part for part in shapely.get_parts(side.free) if isinstance(part, Polygon) and part.area > 0]
    if not parts:
        return FloorPart(np.zeros((0, 2)), np.zeros(1, dtype=np.int64))
    flat = FlatPolygon.from_shapely(MultiPolygon(parts))
    return FloorPart(np.array(flat.vertices), np.array(flat.starts))  # kernels take writable ones


def writable(values: Array) -> Array:
    """Return a writable C-ordered copy: of such arrays kernels are compiled once."""
    return np.array(values, dtype=np.float64, order="C")
