"""The picture of a world: floor, solids, rejection, tool path, and the robot where it starts."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.view import triangle_meshes
from regionik.view.camera import camera_for
from regionik.view.picture import (
    AHEAD,
    ARM,
    FLOOR,
    HEADING,
    NAVIGABLE,
    PASSED,
    PATH,
    REJECTION,
    ROBOT,
    SOLID,
    Body,
    Camera,
    Picture,
)
from regionik.worlds.arrays import Array
from regionik.worlds.chain import planar_pose
from regionik.worlds.robot import LinkBox, Robot
from regionik.worlds.scene import Floor, World

BALL = 0.014  # set-points [m]
TOOL = "tool/tip"
_TALL = 0.6  # [m]
# Floor areas are drawn to this [m], before one is cut from another, so that no gap shows between them.
DETAIL = 0.002


def picture_of_world(world: World) -> Picture:
    """What there is before anything is planned."""
    base, joints = first_posture(world)
    bodies, poses = robot_bodies(world.robot, base, joints)
    camera = camera_for(world, base[None, :2])
    return Picture(
        title=world.name,
        facts=tuple(line for line in (world.about, counted(len(world.task), "set-point")) if line),
        legend=(
            (NAVIGABLE, "free floor"),
            (REJECTION, "rejected: too close to a solid"),
            (SOLID, "obstacles"),
            (AHEAD, "set-points"),
        ),
        bodies=(*world_bodies(world), *bodies),
        poses=poses,
        camera=camera,
        extent=extent(world, camera),
    )


def world_bodies(world: World, covered: BaseGeometry | None = None) -> list[Body]:
    """Floor, solids and tool path; the free floor is left out where other areas cover it."""
    covered = Polygon() if covered is None else covered
    rejection = rejection_shown(world).simplify(DETAIL)
    floor = world.floor.polygon
    return [
        Body("floor/all", triangle_meshes.flat(floor), FLOOR, 1.0, 0),
        layer("floor/free", floor - rejection - covered, NAVIGABLE, 0.55, 1),
        layer("floor/rejected", (rejection & floor) - covered, REJECTION, 0.6, 2),
        *_solids(world),
        *_task(world),
    ]


def layer(path: str, area: BaseGeometry, color: int, opacity: float, order: int) -> Body:
    """A floor area as a flat body."""
    return Body(path, triangle_meshes.flat(area), color, opacity, order, lit=False)


def rejection_shown(world: World) -> BaseGeometry:
    """Where the base is too close to a solid, whatever its heading: shadows grown by clearance and base.

    For the eye only. The planner's own areas are exact for every heading.
    """
    robot = world.robot
    grow = world.rules.clearance + float(np.hypot(*robot.footprint.T).max())
    shadows = [solid.shadow(robot.body_height) for solid in world.solids]
    grown = [s.core.buffer(s.radius + grow, 24) for s in shadows if s is not None]
    return shapely.union_all(grown) if grown else Polygon()


def first_posture(world: World) -> tuple[Array, Array]:
    """Base (3,) and joints (dof,) at the start, or near the first set-point where no start is given."""
    if world.start is not None:
        return world.start.base, world.start.joints
    spot = world.task[0].position[:2] if world.task else np.array(world.floor.polygon.centroid.coords[0])
    return np.array([*spot, 0.0]), world.robot.carry


def robot_bodies(robot: Robot, base: Array, joints: Array) -> tuple[list[Body], dict[str, Array]]:
    """Bodies of a robot and the poses of their nodes, each joint a node inside the one before."""
    bodies = [*_base(robot)]
    poses = {"robot": planar_pose(*base), "robot/arm": robot.T_base_arm}
    for k, joint in enumerate(robot.chain.joints):
        moving = joint_path(k)
        poses[moving.rsplit("/", 1)[0]] = joint.T_parent_joint
        poses[moving] = joint.transform(joints[k])
        links = [triangle_meshes.link_solid(solid) for solid in robot.solids if solid.link == k]
        if links:
            bodies.append(Body(f"{moving}/link", triangle_meshes.merged(links), ARM))
    last = joint_path(robot.chain.dof - 1)
    poses[f"{last}/tool"] = robot.chain.T_last_tool
    tip = triangle_meshes.capsule(np.zeros(3), np.zeros(3), tip_radius(robot))
    bodies.append(Body(f"{last}/{TOOL}", tip, PASSED))
    return bodies, poses


def joint_path(k: int) -> str:
    """Node that joint k turns."""
    return "robot/arm" + "".join(f"/at_{i}/joint_{i}" for i in range(k + 1))


def tip_radius(robot: Robot) -> float:
    """The tool's ball shows outside the last link that has a solid [m]."""
    last = max((solid.link for solid in robot.solids), default=0)
    solids = [solid for solid in robot.solids if solid.link == last]
    half = [float(s.size.min()) / 2 if isinstance(s, LinkBox) else s.radius for s in solids]
    return 1.25 * max([BALL, *half])


def extent(world: World, camera: Camera) -> float:
    """Radius about the middle of the picture that holds the floor [m]."""
    corners = shapely.get_coordinates(world.floor.polygon) - camera.center[:2]
    return float(np.hypot(*corners.T).max())


def counted(count: int, noun: str) -> str:
    """A number and its noun."""
    return f"{count} {noun}" + ("" if count == 1 else "s")


def _base(robot: Robot) -> list[Body]:
    """Footprint raised to the body's height, or a disc for a point, its front marked; what stands on it."""
    if len(robot.footprint) == 1:
        outline, top = shapely.Point(robot.footprint[0]).buffer(0.06), 0.02
    else:
        outline, top = shapely.convex_hull(shapely.MultiPoint(robot.footprint)), robot.body_height
    x_low, y_low, x_high, y_high = outline.bounds
    front, size = x_high, 0.25 * min(x_high - x_low, y_high - y_low)
    middle = (y_low + y_high) / 2
    mark = Polygon(
        [(front, middle), (front - 1.5 * size, middle + size), (front - 1.5 * size, middle - size)]
    )
    mast = [triangle_meshes.link_solid(solid) for solid in robot.base_solids]
    return [
        Body("robot/base", triangle_meshes.extruded(outline, 0.005, top), ROBOT),
        Body("robot/front", triangle_meshes.extruded(mark, top, top + 0.004), HEADING),
        *([Body("robot/mast", triangle_meshes.merged(mast), ROBOT)] if mast else []),
    ]


def _solids(world: World) -> list[Body]:
    """Every obstacle as a body; all cells of one height as one, for maps have thousands."""
    bodies = [
        grey(f"obstacles/{k}", triangle_meshes.solid(s), s.z_range[1]) for k, s in enumerate(world.obstacles)
    ]
    return [*bodies, *map_bodies(world.floor)]


def map_bodies(floor: Floor) -> list[Body]:
    """Occupied and unknown cells, those of one height as one body."""
    bodies = []
    for k, (bottom, top) in enumerate(sorted({cell.z_range for cell in floor.cells})):
        area = shapely.union_all([c.polygon for c in floor.cells if c.z_range == (bottom, top)])
        bodies.append(grey(f"map/{k}", triangle_meshes.extruded(area, bottom, top), top))
    return bodies


def grey(path: str, mesh: triangle_meshes.Triangles, top: float) -> Body:
    """A solid's body; a tall one lets the robot behind it be seen."""
    return Body(path, mesh, SOLID, 1.0 if top <= _TALL else 0.5)


def _task(world: World) -> list[Body]:
    if not world.task:
        return []
    points = np.array([target.position for target in world.task])
    line = Body("task/path", triangle_meshes.tubes(points, 0.004), PATH, lit=False)
    marks = Body("task/ahead", triangle_meshes.balls(points, BALL), AHEAD)
    return [line, marks] if len(points) > 1 else [marks]
