"""The picture of a world, and of an explanation: why a target or the path of the world is out of reach."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.explain.changes import repaired
from regionik.regions import admissible_area, reach_of
from regionik.view import triangle_meshes
from regionik.view.picture import Camera, Color, Picture, SceneMesh, camera_for, count_noun
from regionik.worlds.arrays import Array
from regionik.worlds.chain import planar_pose
from regionik.worlds.errors import Explanation
from regionik.worlds.obstacles import Solid
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Target, World

MARK_RADIUS = 0.014  # of set-points [m]
TOOL = "tool/tip"
_TALL = 0.6  # obstacles above this height are drawn translucent [m]
# Floor areas are drawn to this [m], before one is cut from another, so that no gap shows between them.
DETAIL = 0.002
_SHAFT = 0.008  # radius of arrows [m]


def picture_of_world(world: World) -> Picture:
    """The picture of a world before anything is planned."""
    base, joints = start_state(world)
    robot, poses = robot_meshes(world.robot, base, joints)
    camera = camera_for(world, base[None, :2])
    return Picture(
        title=world.name,
        facts=tuple(line for line in (world.about, count_noun(len(world.task), "set-point")) if line),
        legend=(
            (Color.NAVIGABLE, "free floor"),
            (Color.REJECTION, "rejected: too close to a solid"),
            (Color.SOLID, "obstacles"),
            (Color.AHEAD, "set-points"),
        ),
        bodies=(*world_meshes(world), *robot),
        poses=poses,
        camera=camera,
        extent=floor_radius(world, camera),
    )


def world_meshes(world: World, covered: BaseGeometry | None = None) -> list[SceneMesh]:
    """Floor, obstacles and tool path; the free floor is left out where ``covered`` by other areas."""
    covered = Polygon() if covered is None else covered
    rejected = rejected_area(world).simplify(DETAIL)
    floor = world.floor.polygon
    return [
        SceneMesh("floor/all", triangle_meshes.floor_mesh(floor), Color.FLOOR, 1.0, 0),
        floor_layer("floor/free", floor - rejected - covered, Color.NAVIGABLE, 0.55, 1),
        floor_layer("floor/rejected", (rejected & floor) - covered, Color.REJECTION, 0.6, 2),
        *(scene_obstacle(f"obstacles/{k}", solid) for k, solid in enumerate(world.obstacles)),
        *map_meshes(world.floor),
        *task_meshes(world),
    ]


def floor_layer(path: str, area: BaseGeometry, color: int, opacity: float, order: int) -> SceneMesh:
    """A floor area as a flat mesh."""
    return SceneMesh(path, triangle_meshes.floor_mesh(area), color, opacity, order, lit=False)


def rejected_area(world: World) -> BaseGeometry:
    """The area where the base is too close to a solid at any heading: shadows grown by clearance and base.

    For display only; the areas of the planner are exact for every heading.
    """
    robot = world.robot
    distance = world.rules.clearance + float(np.hypot(*robot.footprint.T).max())
    shadows = [solid.shadow(robot.body_height) for solid in world.solids]
    grown = [shadow.grown(distance, 24) for shadow in shadows if shadow is not None]
    return shapely.union_all(grown) if grown else Polygon()


def start_state(world: World) -> tuple[Array, Array]:
    """Base (3,) and joints (dof,) at the start, or near the first set-point where no start is given."""
    if world.start is not None:
        return world.start.base, world.start.joints
    spot = world.task[0].position[:2] if world.task else np.array(world.floor.polygon.centroid.coords[0])
    return np.array([*spot, 0.0]), world.robot.carry


def robot_meshes(robot: Robot, base: Array, joints: Array) -> tuple[list[SceneMesh], dict[str, Array]]:
    """Meshes of a robot and the poses of their nodes, each joint a node inside the one before."""
    bodies = [*_base_meshes(robot)]
    poses = {"robot": planar_pose(*base), "robot/arm": robot.T_base_arm}
    for k, joint in enumerate(robot.chain.joints):
        node = joint_node(k)
        poses[node.rsplit("/", 1)[0]] = joint.T_parent_joint
        poses[node] = joint.transform(joints[k])
        links = [triangle_meshes.link_mesh(solid) for solid in robot.solids if solid.link == k]
        if links:
            bodies.append(SceneMesh(f"{node}/link", triangle_meshes.merge(links), Color.ARM))
    last = joint_node(robot.chain.dof - 1)
    poses[f"{last}/tool"] = robot.chain.T_last_tool
    tip = triangle_meshes.capsule(np.zeros(3), np.zeros(3), tool_radius(robot))
    bodies.append(SceneMesh(f"{last}/{TOOL}", tip, Color.PASSED))
    return bodies, poses


def joint_node(k: int) -> str:
    """The node that joint k moves."""
    return "robot/arm" + "".join(f"/at_{i}/joint_{i}" for i in range(k + 1))


def tool_radius(robot: Robot) -> float:
    """Radius of the sphere that marks the tool, so that it shows outside the last link with a solid [m]."""
    last = max((solid.link for solid in robot.solids), default=0)
    solids = [solid for solid in robot.solids if solid.link == last]
    half = [s.radius or float(np.ptp(s.corners, axis=0).min()) / 2 for s in solids]
    return 1.25 * max([MARK_RADIUS, *half])


def floor_radius(world: World, camera: Camera) -> float:
    """Radius about the centre of the picture that holds the floor [m]."""
    corners = shapely.get_coordinates(world.floor.polygon) - camera.center[:2]
    return float(np.hypot(*corners.T).max())


def _base_meshes(robot: Robot) -> list[SceneMesh]:
    """Footprint extruded to the body's height, or a disc for a point, its front marked; solids on it."""
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
    mast = [triangle_meshes.link_mesh(solid) for solid in robot.base_solids]
    return [
        SceneMesh("robot/base", triangle_meshes.extrude(outline, 0.005, top), Color.ROBOT),
        SceneMesh("robot/front", triangle_meshes.extrude(mark, top, top + 0.004), Color.HEADING),
        *([SceneMesh("robot/mast", triangle_meshes.merge(mast), Color.ROBOT)] if mast else []),
    ]


def scene_obstacle(path: str, solid: Solid) -> SceneMesh:
    """An obstacle; a tall one is translucent, so that the robot behind it shows."""
    return _grey(path, triangle_meshes.obstacle_mesh(solid), solid.z_range[1])


def map_meshes(floor: Floor) -> list[SceneMesh]:
    """Occupied and unknown cells, all of one height as one mesh, for maps have thousands."""
    meshes = []
    for k, (bottom, top) in enumerate(sorted({cell.z_range for cell in floor.cells})):
        area = shapely.union_all([c.polygon for c in floor.cells if c.z_range == (bottom, top)])
        meshes.append(_grey(f"map/{k}", triangle_meshes.extrude(area, bottom, top), top))
    return meshes


def _grey(path: str, mesh: triangle_meshes.TriangleMesh, top: float) -> SceneMesh:
    return SceneMesh(path, mesh, Color.SOLID, 1.0 if top <= _TALL else 0.5)


def task_meshes(world: World, missing: NDArray[np.bool_] | None = None) -> list[SceneMesh]:
    """The tool path and its set-points; those that are ``missing`` (n,) an area are marked."""
    points = np.array([target.position for target in world.task]).reshape(-1, 3)
    missing = np.zeros(len(points), dtype=bool) if missing is None else missing
    tubes = [triangle_meshes.tubes(points, 0.004)] if len(points) > 1 else []
    marks = (("task/ahead", ~missing, Color.AHEAD, 1.0), ("task/missing", missing, Color.MISSING, 1.6))
    return [
        *(SceneMesh("task/path", mesh, Color.PATH, lit=False) for mesh in tubes),
        *(
            SceneMesh(path, triangle_meshes.spheres(points[rows], size * MARK_RADIUS), color)
            for path, rows, color, size in marks
            if rows.any()
        ),
    ]


def picture_of_explanation(world: World, explanation: Explanation, target: Target | None = None) -> Picture:
    """The picture of why a target or a path is out of reach.

    Parameters
    ----------
    world : World
    explanation : Explanation
    target : Target, optional
        The one explained; by default the set-point that the explanation names.
    """
    i = 0 if target is not None or explanation.setpoint is None else explanation.setpoint
    scene = world if target is None else replace(world, task=(target,))
    before = picture_of_world(scene)
    names = {cause.name for cause in explanation.causes if cause.kind == "obstacle"}
    causes = {f"obstacles/{k}" for k, solid in enumerate(scene.obstacles) if solid.name in names}
    bodies = [
        replace(body, color=Color.CAUSE, opacity=max(0.75, body.opacity)) if body.path in causes else body
        for body in before.bodies
    ]
    if explanation.setpoint is not None:
        bodies += [*_areas(scene, explanation, i), *_changes(scene, explanation, i)]
    blamed = ", ".join(cause.name for cause in explanation.causes)
    return replace(
        before,
        title=f"{world.name}: why not",
        facts=(f"in the way: {blamed}", *(repair.text for repair in explanation.repairs)),
        legend=(
            (Color.CAUSE, "what stands in the way; the set-point"),
            (Color.REPAIR, "what a repair moves"),
            (Color.PALE, "reach, were nothing in the way"),
            (Color.STRONG, "area after the smallest repair"),
            (Color.NAVIGABLE, "free floor"),
            (Color.REJECTION, "rejected: too close to a solid"),
            (Color.SOLID, "other obstacles"),
            (Color.AHEAD, "set-points"),
        ),
        bodies=tuple(bodies),
    )


def _areas(world: World, explanation: Explanation, i: int) -> Iterator[SceneMesh]:
    """Reach and area before, and the area after the smallest repair."""
    target = world.task[i]
    area = admissible_area(world, target).inner
    yield floor_layer("why/reach", reach_of(world, target).simplify(DETAIL), Color.PALE, 0.5, 3)
    yield floor_layer("why/before", area.simplify(DETAIL), Color.STRONG, 0.4, 4)
    if explanation.repairs:
        mended = repaired(world, explanation.repairs[0], i)
        after = admissible_area(mended, mended.task[i]).inner
        # The area after a smallest repair is next to nothing: a rim makes it visible.
        yield floor_layer("why/after", after.buffer(0.01).simplify(DETAIL), Color.STRONG, 0.85, 5)


def _changes(world: World, explanation: Explanation, i: int) -> Iterator[SceneMesh]:
    """The set-point, and targets and obstacles where repairs move them, with arrows."""
    position = world.task[i].position
    yield SceneMesh("why/target", triangle_meshes.spheres(position[None], 1.8 * MARK_RADIUS), Color.CAUSE)
    for k, repair in enumerate(explanation.repairs):
        if repair.kind == "move-target":
            start, move = position, np.array(repair.vector)
            mesh, opacity = triangle_meshes.spheres((start + move)[None], 1.5 * MARK_RADIUS), 1.0
        elif repair.kind == "move-obstacle":
            before, after = (_obstacle(one, repair.name) for one in (world, repaired(world, repair)))
            center = triangle_meshes.shadow_polygon(before).centroid
            start = np.array([center.x, center.y, before.z_range[1] + 3 * _SHAFT])  # above the obstacle
            move = np.array([*repair.vector, 0.0])
            mesh, opacity = triangle_meshes.obstacle_mesh(after), 0.35
        else:
            continue
        arrow = triangle_meshes.arrow(start, start + move, _SHAFT)
        yield SceneMesh(f"why/move {k}", arrow, Color.REPAIR)
        yield SceneMesh(f"why/moved {k}", mesh, Color.REPAIR, opacity)


def _obstacle(world: World, name: str) -> Solid:
    return next(solid for solid in world.obstacles if solid.name == name)
