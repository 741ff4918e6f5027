"""A checked document -> a World; what only the whole can tell is checked here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from shapely.geometry import Polygon

from regionik.worlds.arrays import Array
from regionik.worlds.chain import pose
from regionik.worlds.criteria import Criteria
from regionik.worlds.documents import world_schema
from regionik.worlds.documents.robot_reader import build_robot
from regionik.worlds.documents.task_reader import build_task
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Solid, Sphere
from regionik.worlds.readers.meshes import is_closed, read_mesh
from regionik.worlds.readers.occupancy_map import load_map
from regionik.worlds.readers.robot_checks import check_limits
from regionik.worlds.readers.validation import at, wrong
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from regionik.worlds.speeds import Speeds

_DEEP = 1e-6  # a target this far inside a solid is taken for a mistake [m]


def build_world(document: world_schema.WorldDocument, where: str, folder: Path) -> World:
    """World of a document that fits the grammar.

    Parameters
    ----------
    document : WorldDocument
    where : str
        How messages call the document.
    folder : Path
        What relative file names are relative to.

    Raises
    ------
    InputError
        One line: where, the place in the document, what was expected.
    """
    robot = build_robot(document.robot, where, folder)
    floor = _floor(document.floor, where, folder)
    obstacles = _obstacles(document.obstacles, where, folder)
    _check_names(obstacles, floor, where)
    task, pieces = build_task(document.task, where, folder)
    rules = _rules(document.rules, robot, where)
    if rules.order == "any" and rules.mode != "stops":
        raise wrong(where, "rules.order", "any goes with rules.mode: stops, expected given")
    if rules.mode == "stops" and rules.heading == "face_target":
        text = (
            "face_target turns the base at every set-point, with rules.mode: stops valid choices: free, fixed"
        )
        raise wrong(where, "rules.heading", text)
    start = None if document.start is None else _start(document.start, robot, where)
    _check_targets_free(task, pieces, (*obstacles, *floor.cells), where)
    name = document.name or Path(where).name.partition(".")[0] or "world"
    speeds = None if document.speeds is None else _speeds(document.speeds, robot, where)
    return World(name, robot, floor, obstacles, task, rules, start, document.about or "", speeds)


def _rules(part: world_schema.RulesPart, robot: Robot, where: str) -> Rules:
    criteria = None
    if part.criteria is not None:
        with at(where, "rules"):
            criteria = Criteria(**part.criteria.model_dump())
            criteria.check(robot)
    return Rules(**{**part.model_dump(), "criteria": criteria})


def _speeds(part: world_schema.SpeedsPart, robot: Robot, where: str) -> Speeds:
    with at(where, "speeds"):
        speeds = Speeds(**part.model_dump())
        speeds.of_joints(robot.chain)
    return speeds


def _floor(part: world_schema.PolygonFloor | world_schema.MapFloor, where: str, folder: Path) -> Floor:
    if isinstance(part, world_schema.MapFloor):
        with at(where, "floor.map"):
            return load_map(folder / part.map, part.height, part.free_thresh)
    polygon = _outline(part.polygon, part.holes, where, "floor.polygon")
    return Floor(
        polygon,
        tuple(_prism(cell, cell.name, where, f"floor.cells[{k}]") for k, cell in enumerate(part.cells)),
    )


def _outline(ring: list[list[float]], holes: list[list[list[float]]], where: str, place: str) -> Polygon:
    polygon = Polygon(ring, holes)
    if not polygon.is_valid or polygon.area <= 0:
        why = shapely.is_valid_reason(polygon) if not polygon.is_valid else "its area is zero"
        raise wrong(where, place, f"expected an outline that does not cross or touch itself: {why}")
    return polygon


def _prism(shape: world_schema.PrismShape, name: str, where: str, place: str) -> Prism:
    bottom, top = shape.z
    if not bottom < top:
        raise wrong(where, f"{place}.z", f"expected bottom below top, got [{bottom:g}, {top:g}]")
    return Prism(name, _outline(shape.polygon, shape.holes, where, f"{place}.polygon"), bottom, top)


def _obstacles(parts: list[world_schema.Obstacle], where: str, folder: Path) -> tuple[Solid, ...]:
    return tuple(_solid(part, where, f"obstacles[{k}]", folder) for k, part in enumerate(parts))


def _solid(part: world_schema.Obstacle, where: str, place: str, folder: Path) -> Solid:
    match part:
        case world_schema.BoxObstacle(box=shape):
            return Box(part.name, np.array(shape.size), np.array(shape.center), shape.yaw)
        case world_schema.CylinderObstacle(cylinder=shape):
            return Cylinder(part.name, shape.radius, shape.height, np.array(shape.center))
        case world_schema.SphereObstacle(sphere=shape):
            return Sphere(part.name, shape.radius, np.array(shape.center))
        case world_schema.PrismObstacle(prism=shape):
            return _prism(shape, part.name, where, f"{place}.prism")
        case _:
            with at(where, f"{place}.mesh"):
                mesh = _mesh(part.mesh, part.name, folder)
            if not is_closed(mesh.vertices, mesh.faces):
                raise wrong(where, f"{place}.mesh", "expected a closed surface, every edge in two triangles")
            return mesh


def _mesh(shape: world_schema.MeshFile | world_schema.MeshInline, name: str, folder: Path) -> Mesh:
    if isinstance(shape, world_schema.MeshInline):
        return Mesh(name, np.array(shape.vertices), np.array(shape.faces))
    vertices, faces = read_mesh(folder / shape.file)
    T_world_mesh = pose(shape.position, shape.rpy)
    return Mesh(name, vertices * shape.scale @ T_world_mesh[:3, :3].T + T_world_mesh[:3, 3], faces)


def _start(part: world_schema.StartPart, robot: Robot, where: str) -> Start:
    chain = robot.chain
    if len(part.joints) != chain.dof:
        raise wrong(
            where,
            "start.joints",
            f"expected {chain.dof} values ({', '.join(chain.names)}), got {len(part.joints)}",
        )
    check_limits(chain, part.joints, where, "start.joints")
    return Start(np.array(part.base), np.array(part.joints))


def _check_names(obstacles: tuple[Solid, ...], floor: Floor, where: str) -> None:
    places: dict[str, str] = {}
    groups = (("floor.cells", floor.cells), ("obstacles", obstacles))
    for group, solids in groups:
        for k, solid in enumerate(solids):
            place = f"{group}[{k}]"
            if solid.name in places:
                raise wrong(
                    where,
                    f"{place}.name",
                    f"expected a name of its own, {solid.name!r} is {places[solid.name]}",
                )
            places[solid.name] = place


def _check_targets_free(
    task: tuple[Target, ...], pieces: list[str], solids: tuple[Solid, ...], where: str
) -> None:
    points = np.array([target.position for target in task])
    for solid in solids:
        low, high = _bounds(solid)
        for i in np.flatnonzero(((points > low) & (points < high)).all(axis=1)):
            depth = -solid.distance(points[i])
            if depth > _DEEP:
                raise wrong(
                    where,
                    pieces[i],
                    f"set-point {i + 1} of {len(task)} lies {depth:.6g} m inside {solid.name!r}, "
                    "expected it on the surface or outside",
                )


def _bounds(solid: Solid) -> tuple[Array, Array]:
    """Corners of an upright box around a solid."""
    match solid:
        case Prism(polygon=polygon):
            x0, y0, x1, y1 = polygon.bounds
            return np.array([x0, y0, solid.bottom]), np.array([x1, y1, solid.top])
        case Mesh(vertices=vertices):
            return vertices.min(axis=0), vertices.max(axis=0)
        case Box(size=size):
            around = np.array([np.hypot(size[0], size[1]), np.hypot(size[0], size[1]), size[2]]) / 2
        case Cylinder(radius=radius):
            around = np.array([radius, radius, solid.height / 2])
        case _:
            around = np.full(3, solid.radius)
    return solid.center - around, solid.center + around
