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
from regionik.planners.collision.proximity import nearest
from regionik.postures.poses import pose_of
from regionik.regions import known_area, reach_of
from regionik.scene import scene_of
from regionik.view import triangle_meshes
from regionik.view.floor_view import ZONE_WORDS, rejected_words, shown_floor
from regionik.view.options import VIEW
from regionik.view.picture import (
    Camera,
    Color,
    Picture,
    SceneMesh,
    camera_for,
    count_noun,
    setpoint_names,
    tool_axes,
)
from regionik.view.timeline import bodies_around
from regionik.worlds.arrays import Array
from regionik.worlds.chain import planar_pose
from regionik.worlds.errors import Explanation
from regionik.worlds.links import BASE
from regionik.worlds.obstacles import Solid
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Target, World

OPTIONS = VIEW.scene

TOOL = "tool/tip"
AXES_WORDS = "axis of the tool"
TURNING_WORDS = "room at some headings only"
_CAUSE_WORDS = "in the way; the set-point"
GHOST_WORDS = "robot, where it may stand: the world gives no start"


def picture_of_world(world: World) -> Picture:
    """The picture of a world before anything is planned."""
    facts = tuple(line for line in (world.about, count_noun(len(world.task), "set-point")) if line)
    return picture_with_robot(world, facts, world_meshes(world))


def picture_with_robot(
    world: World, facts: tuple[str, ...], bodies: list[SceneMesh], area: BaseGeometry | None = None
) -> Picture:
    """A picture of bodies, and of the robot where `shown_start` has it."""
    pose = shown_start(world, area)
    robot, poses = ([], {}) if pose is None else robot_meshes(world, *pose, ghost=world.start is None)
    camera = camera_for(world, np.empty((0, 3)) if pose is None else robot_points(world.robot, *pose))
    radius, names = floor_radius(world, camera), setpoint_names(world)
    return Picture(world.name, facts, (*bodies, *robot), poses, camera, radius, setpoints=names)


def world_meshes(world: World, covered: BaseGeometry | None = None) -> list[SceneMesh]:
    """Floor, obstacles and tool path; floor areas are left out where ``covered`` by other areas."""
    covered = Polygon() if covered is None else covered
    floor = shown_floor(world)
    return [
        SceneMesh("floor/all", triangle_meshes.floor_mesh(world.floor.polygon), Color.FLOOR, 1.0, 0),
        floor_layer("floor/free", floor.free - covered, Color.NAVIGABLE, 1, "free floor"),
        floor_layer("floor/turning", floor.turning - covered, Color.TURNING, 1, TURNING_WORDS),
        floor_layer("floor/rejected", floor.rejected - covered, Color.REJECTION, 2, rejected_words(world)),
        *zone_meshes(world, covered),
        *(scene_obstacle(f"obstacles/{k}", solid) for k, solid in enumerate(world.obstacles)),
        *map_meshes(world.floor),
        *task_meshes(world),
    ]


def zone_meshes(world: World, covered: BaseGeometry | None = None) -> Iterator[SceneMesh]:
    """Yield where each zone lets no base stand, as a layer of the floor; all are of one swatch."""
    left = world.floor.polygon - (Polygon() if covered is None else covered)
    for k, zone in enumerate(world.zones):
        closed, side = left - zone.left_of(world.floor.polygon), "in it" if zone.keep == "in" else "out of it"
        mesh = triangle_meshes.floor_mesh(closed)
        name = f"zone {zone.name}: the base stays {side}"
        yield SceneMesh(f"zones/{k}", mesh, Color.ZONE, 1.0, 2, label=ZONE_WORDS, name=name)


def floor_layer(path: str, area: BaseGeometry, color: int, order: int, label: str) -> SceneMesh:
    """A floor area as a flat mesh, in the colour of its swatch but for shadows."""
    return SceneMesh(path, triangle_meshes.floor_mesh(area), color, 1.0, order, label=label)


def shown_start(world: World, area: BaseGeometry | None = None) -> tuple[Array, Array] | None:
    """Base (3,) and joints (dof,) at the start.

    Where the world gives none: at the edge of an ``area`` of the arm's axis, by default of the floor on
    which the base has room at every heading, a step from the first set-point; where the robot, as it is
    carried, is farthest from all solids. None where it touches one everywhere.
    """
    if world.start is not None:
        return world.start.base, world.start.joints
    robot = world.robot
    edge = _free_places(world) if area is None else shapely.get_coordinates(shapely.boundary(area))
    bases = [pose_of(robot, spot, 0.0) for spot in edge[:: 1 + len(edge) // OPTIONS.start_places]]
    if not bases:
        return None
    bodies = bodies_around(scene_of(world).within_reach(np.array(bases)).world)
    gaps = [nearest(bodies, base, robot.carry).distance for base in bases]
    best = int(np.argmax(gaps))
    return (bases[best], robot.carry) if gaps[best] > 0 else None


def _free_places(world: World) -> Array:
    """Free places (n, 2) round the first set-point, else anywhere at the edge of what is free."""
    free = scene_of(world).ground.inner.free
    if not world.task:
        middle: Array = shapely.get_coordinates(shapely.point_on_surface(free))
        return middle
    length = float(np.linalg.norm(world.robot.chain.link_vectors, axis=1).sum())
    step = max(OPTIONS.min_start_distance, 0.6 * length)
    angles = np.radians(np.arange(0.0, 360.0, 360.0 / OPTIONS.start_places))
    ring = world.task[0].position[:2] + step * np.column_stack([np.cos(angles), np.sin(angles)])
    places: Array = ring[shapely.contains_xy(free, *ring.T)]
    return places if len(places) else shapely.get_coordinates(free)


def robot_points(robot: Robot, base: Array, joints: Array) -> Array:
    """Points (..., 3) that show where a robot is, on the floor and along its arm, at poses (..., 3) [m]."""
    frames = robot.frames(base, joints)[..., :3, 3]
    floor = np.concatenate([np.asarray(base)[..., :2], np.zeros((*np.shape(base)[:-1], 1))], axis=-1)
    points: Array = np.concatenate([frames, floor[..., None, :]], axis=-2).reshape(-1, 3)
    return points


def robot_meshes(
    world: World, base: Array, joints: Array, ghost: bool = False
) -> tuple[list[SceneMesh], dict[str, Array]]:
    """Meshes of a robot and the poses of their nodes, each joint a node inside the one before."""
    robot = world.robot
    bodies = _base_meshes(robot, world.rules.clearance)
    poses = {"robot": planar_pose(*base), "robot/arm": robot.T_base_arm}
    values = robot.chain.joint_values(joints)
    for k, joint in enumerate(robot.chain.joints):
        node = joint_node(k)
        poses[node.rsplit("/", 1)[0]] = joint.T_parent_joint
        poses[node] = joint.transform(values[k])
        name = f"link that {joint.name} moves"
        bodies += _link_meshes(f"{node}/link", robot, k, Color.ARM, name)
    last = joint_node(len(robot.chain.joints) - 1)
    poses[f"{last}/tool"] = robot.chain.T_last_tool
    tip = triangle_meshes.capsule(np.zeros(3), np.zeros(3), tool_radius(robot))
    bodies.append(SceneMesh(f"{last}/{TOOL}", tip, Color.PASSED, name="tool point"))
    label, opacity = (GHOST_WORDS, OPTIONS.ghost_opacity) if ghost else ("robot", 1.0)
    return [replace(body, label=label, opacity=opacity) for body in bodies], poses


def _link_meshes(path: str, robot: Robot, link: int, color: int, name: str) -> Iterator[SceneMesh]:
    """Yield the visual surfaces of a link, and its solids that these do not stand for."""
    visuals = [one for one in robot.visuals if one.link == link]
    hidden = {name for one in visuals for name in one.stands_for}
    for k, one in enumerate(visuals):
        whole = triangle_meshes.TriangleMesh(one.vertices, one.faces.astype(np.uint32))
        mesh = triangle_meshes.split_vertices(whole)
        yield SceneMesh(f"{path}/visual {k}", mesh, one.color, name=name)
    solids = [solid for solid in robot.all_solids if solid.link == link and solid.name not in hidden]
    if solids:
        mesh = triangle_meshes.merge([triangle_meshes.link_mesh(solid) for solid in solids])
        yield SceneMesh(path, mesh, color, name=name)


def joint_node(k: int) -> str:
    """The node that joint k moves."""
    return "robot/arm" + "".join(f"/at_{i}/joint_{i}" for i in range(k + 1))


def tool_radius(robot: Robot) -> float:
    """Radius of the sphere that marks the tool, so that it shows outside the last link with a solid [m]."""
    last = max((solid.link for solid in robot.solids), default=0)
    solids = [solid for solid in robot.solids if solid.link == last]
    half = [s.radius or float(np.ptp(s.corners, axis=0).min()) / 2 for s in solids]
    return 1.25 * max([OPTIONS.mark_radius, *half])


def floor_radius(world: World, camera: Camera) -> float:
    """Radius about the centre of the picture that holds the floor [m]."""
    corners = shapely.get_coordinates(world.floor.polygon) - camera.center[:2]
    return float(np.hypot(*corners.T).max())


def _base_meshes(robot: Robot, room: float) -> list[SceneMesh]:
    """Body and wheels within the footprint, the front marked, and solids on it.

    A base that is a point in the model is drawn as wide as the ``room`` round it that plans keep free [m].
    Visual surfaces take the place of all that, where they are not of parts of the base only.
    """
    seen = list(_link_meshes("robot/seen", robot, BASE, Color.ROBOT, "base"))
    if _is_seen_whole(robot):
        return seen
    outline, top = shapely.convex_hull(shapely.MultiPoint(robot.footprint)), robot.body_height
    name = "base"
    if len(robot.footprint) == 1:
        outline, top = outline.buffer(float(np.clip(room, *OPTIONS.point_base_radii))), 0.7 * top
        name = "base, a point in the model"
    wheel = min(OPTIONS.max_wheel_radius, top / 3)
    x_low, y_low, x_high, y_high = outline.bounds
    front, size = x_high, 0.25 * min(x_high - x_low, y_high - y_low)
    middle = (y_low + y_high) / 2
    mark = Polygon(
        [(front, middle), (front - 1.5 * size, middle + size), (front - 1.5 * size, middle - size)]
    )
    parts = {
        "base": (triangle_meshes.extrude(outline, wheel, top), Color.ROBOT),
        "wheels": (triangle_meshes.merge(list(_wheels(outline, wheel))), Color.WHEEL),
        "front": (triangle_meshes.extrude(mark & outline, top, top + 0.004), Color.HEADING),
    }
    made = (SceneMesh(f"robot/{part}", mesh, color, name=name) for part, (mesh, color) in parts.items())
    return [*(one for one in made if len(one.mesh.faces)), *seen]


def _is_seen_whole(robot: Robot) -> bool:
    """True where visual surfaces of the base cover most of its footprint."""
    corners = [one.vertices[:, :2] for one in robot.visuals if one.link == BASE]
    if not corners:
        return False
    outline = shapely.convex_hull(shapely.MultiPoint(robot.footprint))
    seen = shapely.convex_hull(shapely.MultiPoint(np.concatenate(corners)))
    return bool((seen & outline).area >= OPTIONS.min_seen_share * outline.area)


def _wheels(outline: Polygon, radius: float) -> Iterator[triangle_meshes.TriangleMesh]:
    """Two wheels before the middle of an outline and two behind it, at its sides but within it."""
    x_low, y_low, x_high, y_high = outline.bounds
    for share in (0.25, 0.75):
        x = x_low + share * (x_high - x_low)
        across = outline & shapely.LineString([(x, y_low), (x, y_high)])
        width = 0.5 * radius
        for y in (across.bounds[1] + width, across.bounds[3] - width):
            yield triangle_meshes.wheel(np.array([x, y, radius]), radius, width)


def scene_obstacle(path: str, solid: Solid) -> SceneMesh:
    """An obstacle; a tall one is translucent, so that the robot behind it shows."""
    return _grey(path, triangle_meshes.obstacle_mesh(solid), solid.z_range[1], solid.name)


def map_meshes(floor: Floor) -> list[SceneMesh]:
    """Occupied and unknown cells, all of one height as one mesh, for maps have thousands."""
    meshes = []
    for k, (bottom, top) in enumerate(sorted({cell.z_range for cell in floor.cells})):
        area = shapely.union_all([c.polygon for c in floor.cells if c.z_range == (bottom, top)])
        meshes.append(_grey(f"map/{k}", triangle_meshes.extrude(area, bottom, top), top, "cells of the map"))
    return meshes


def _grey(path: str, mesh: triangle_meshes.TriangleMesh, top: float, name: str) -> SceneMesh:
    return SceneMesh(
        path,
        mesh,
        Color.SOLID,
        1.0 if top <= OPTIONS.max_opaque_height else 0.5,
        label="obstacles",
        name=name,
    )


def task_meshes(world: World, missing: NDArray[np.bool_] | None = None) -> list[SceneMesh]:
    """The tool path and its set-points; those that are ``missing`` (n,) a place for the base are marked."""
    points = np.array([target.position for target in world.task]).reshape(-1, 3)
    missing = np.zeros(len(points), dtype=bool) if missing is None else missing
    marks = (
        ("task/ahead", ~missing, Color.AHEAD, 1.0, "set-points"),
        ("task/missing", missing, Color.MISSING, 1.6, "set-points that fail"),
    )
    axes = [triangle_meshes.arrow(start, end, OPTIONS.shaft_radius / 3) for start, end in tool_axes(world)]
    axes_mesh = triangle_meshes.merge(axes)
    bodies = [
        *_path_meshes(world, points),
        SceneMesh("task/axes", axes_mesh, Color.TOOL_AXIS, lit=False, label=AXES_WORDS),
    ]
    for node, rows, color, size, label in marks:
        if rows.any():
            mesh = triangle_meshes.spheres(points[rows], size * OPTIONS.mark_radius)
            numbers = tuple(np.flatnonzero(rows).tolist())
            bodies.append(SceneMesh(node, mesh, color, label=label, name="set-point", numbers=numbers))
    return bodies


def _path_meshes(world: World, points: Array) -> Iterator[SceneMesh]:
    """The path that the tool works, and the travel of it."""
    path = triangle_meshes.tubes(points, 0.004) if len(points) > 1 else triangle_meshes.merge([])
    works = np.repeat(world.works[1:], 2 * OPTIONS.tube_sides)
    for node, rows, color, label in (
        ("task/path", works, Color.PATH, "tool path asked for"),
        ("task/travel", ~works, Color.TRAVEL, "travel asked for"),
    ):
        if rows.any() or node == "task/path":
            mesh = triangle_meshes.TriangleMesh(path.vertices, path.faces[rows])
            yield SceneMesh(node, mesh, color, lit=False, label=label)


def picture_of_explanation(world: World, explanation: Explanation, target: Target | None = None) -> Picture:
    """The picture of why a target, or the set-point that the explanation names, is out of reach."""
    i = 0 if target is not None or explanation.setpoint is None else explanation.setpoint
    scene = world if target is None else replace(world, task=(target,))
    before = picture_of_world(scene)
    names = {cause.name for cause in explanation.causes if cause.kind in ("obstacle", "zone")}
    causes = {f"obstacles/{k}" for k, solid in enumerate(scene.obstacles) if solid.name in names}
    causes |= {f"zones/{k}" for k, zone in enumerate(scene.zones) if zone.name in names}
    bodies = [
        replace(body, color=Color.CAUSE, opacity=max(0.75, body.opacity), label=_CAUSE_WORDS)
        if body.path in causes
        else body
        for body in before.bodies
    ]
    if explanation.setpoint is not None:
        bodies += [*_areas(scene, explanation, i), *_changes(scene, explanation, i)]
    blamed = ", ".join(cause.name for cause in explanation.causes)
    return replace(
        before,
        title=f"{world.name}: why not",
        facts=(explanation.reason, f"in the way: {blamed}", *(repair.text for repair in explanation.repairs)),
        bodies=tuple(bodies),
    )


def _areas(world: World, explanation: Explanation, i: int) -> Iterator[SceneMesh]:
    """Reach and area before, and the area after the smallest repair."""
    scene, target = scene_of(world), world.task[i]
    area = known_area(scene, target).simplify(VIEW.floor.detail)
    reach = reach_of(scene, target).simplify(VIEW.floor.detail)
    yield floor_layer("why/reach", reach, Color.PALE, 3, "reach, were nothing in the way")
    yield floor_layer("why/before", area, Color.STRONG, 4, "area as it is")
    if explanation.repairs:
        mended = repaired(scene, explanation.repairs[0], i)
        after = known_area(mended, mended.task[i])
        # The area after a smallest repair is next to nothing: a rim makes it visible.
        shown = after.buffer(0.01).simplify(VIEW.floor.detail)
        yield floor_layer("why/after", shown, Color.CURRENT, 5, "area after the first repair")


def _changes(world: World, explanation: Explanation, i: int) -> Iterator[SceneMesh]:
    """The set-point, and targets and obstacles where repairs move them, with arrows."""
    position = world.task[i].position
    mark = triangle_meshes.spheres(position[None], 1.8 * OPTIONS.mark_radius)
    yield SceneMesh("why/target", mark, Color.CAUSE, label=_CAUSE_WORDS, name=f"set-point {i + 1}")
    for k, repair in enumerate(explanation.repairs):
        if repair.kind == "move-target":
            start, move = position, np.array(repair.vector)
            mesh, opacity = triangle_meshes.spheres((start + move)[None], 1.5 * OPTIONS.mark_radius), 1.0
        elif repair.kind == "move-obstacle":
            before, after = (
                next(solid for solid in one.obstacles if solid.name == repair.name)
                for one in (world, repaired(scene_of(world), repair).world)
            )
            center = triangle_meshes.shadow_polygon(before).centroid
            above = before.z_range[1] + 3 * OPTIONS.shaft_radius
            start = np.array([center.x, center.y, above])
            move = np.array([*repair.vector, 0.0])
            mesh, opacity = triangle_meshes.obstacle_mesh(after), 0.35
        else:
            continue
        arrow = triangle_meshes.arrow(start, start + move, OPTIONS.shaft_radius)
        for path, part, seen in ((f"why/move {k}", arrow, 1.0), (f"why/moved {k}", mesh, opacity)):
            yield SceneMesh(path, part, Color.REPAIR, seen, label="what a repair moves", name=repair.text)
