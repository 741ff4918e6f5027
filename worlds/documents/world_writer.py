"""A World -> a document that holds all of it, exactly."""

from __future__ import annotations

from dataclasses import asdict
from itertools import groupby
from math import inf, isfinite
from typing import Any

import numpy as np
from shapely.geometry import Polygon

from regionik.worlds.arrays import Array
from regionik.worlds.bundled import robot_named, robot_names, without_limits
from regionik.worlds.chain import Chain, Joint, chain_from_dh
from regionik.worlds.criteria import Criteria
from regionik.worlds.obstacles import Box, Cylinder, Prism, Solid, Sphere
from regionik.worlds.robot import LinkCapsule, LinkSolid, Robot, capsules_along
from regionik.worlds.scene import Floor, Target, World
from regionik.worlds.speeds import Speeds

Document = dict[str, Any]


def document_of(world: World) -> Document:
    """Plain values from which `world_from_document` makes an equal world."""
    document: Document = {"version": 1, "name": world.name}
    if world.about:
        document["about"] = world.about
    document["robot"] = _robot(world.robot)
    document["floor"] = _floor(world.floor)
    document["obstacles"] = [{"name": solid.name, **_solid(solid)} for solid in world.obstacles]
    if world.start is not None:
        document["start"] = {"base": world.start.base.tolist(), "joints": world.start.joints.tolist()}
    document["task"] = _task(world.task)
    criteria = world.rules.criteria
    document["rules"] = {**asdict(world.rules), "criteria": None if criteria is None else _listed(criteria)}
    if world.speeds is not None:
        document["speeds"] = _listed(world.speeds)
    return document


def _listed(values: Speeds | Criteria) -> Document:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(values).items()}


# --- robot


def _robot(robot: Robot) -> str | Document:
    """A bundled robot by its name, any other in full."""
    full = _full_robot(robot)
    for name in robot_names():
        bundled = robot_named(name)
        if full == _full_robot(bundled):
            return name
        if full == _full_robot(without_limits(bundled)):
            return {"name": name, "limits": "ignore"}
    return full


def _full_robot(robot: Robot) -> Document:
    document: Document = {"name": robot.name}
    rows = dh_rows(robot.chain)
    if rows is None:
        joints = [_joint(joint) for joint in robot.chain.joints]
        document["chain"] = {"joints": joints, "tool": robot.chain.T_last_tool.tolist()}
    else:
        document["dh"] = [[None if abs(value) == inf else value for value in row] for row in rows]
        document["names"] = list(robot.chain.names)
    document["base"] = robot.base
    document["footprint"] = robot.footprint.tolist()
    document["mount"] = robot.mount.tolist()
    document["body_height"] = float(robot.body_height)
    document["turning_radius"] = float(robot.turning_radius)
    document["gauge"] = float(robot.gauge)
    document |= _link_solids(robot)
    if robot.unchecked:
        document["unchecked"] = [list(names) for names in robot.unchecked]
    if robot.masses:
        document["masses"] = [
            {"link": one.link, "mass": float(one.mass), "center": one.center.tolist()} for one in robot.masses
        ]
    if robot.payload:
        document["payload"] = float(robot.payload)
    document["carry"] = robot.carry.tolist()
    return document


def dh_rows(chain: Chain) -> list[list[float]] | None:
    """Denavit-Hartenberg rows that give exactly this chain again; None where there are none."""
    plain = all(
        joint.kind == "revolute" and joint.velocity == inf and joint.axis.tolist() == [0.0, 0.0, 1.0]
        for joint in chain.joints
    )
    if not plain:
        return None
    frames = [joint.T_parent_joint for joint in chain.joints]
    theta = [_angle(-T[0, 1], T[0, 0]) for T in frames]
    rows = []
    for k, (joint, T_next) in enumerate(zip(chain.joints, [*frames[1:], chain.T_last_tool], strict=True)):
        alpha = _angle(-T_next[1, 2], T_next[2, 2])
        d, a = float(T_next[2, 3]), float(T_next[0, 3])
        rows.append([theta[k], d, a, alpha, float(joint.lower), float(joint.upper)])
    again = chain_from_dh(rows, chain.names)
    made = [*(joint.T_parent_joint for joint in again.joints), again.T_last_tool]
    exact = all(np.array_equal(T, M) for T, M in zip([*frames, chain.T_last_tool], made, strict=True))
    return rows if exact else None


def _angle(sine: float, cosine: float) -> float:
    """The angle whose sine and cosine are exactly these, if one is near; else the nearest."""
    nearest = float(np.arctan2(sine, cosine)) + 0.0
    candidate = float(np.nextafter(np.nextafter(nearest, -inf), -inf))
    for _ in range(5):
        if np.sin(candidate) == sine and np.cos(candidate) == cosine:
            return candidate
        candidate = float(np.nextafter(candidate, inf))
    return nearest


def _joint(joint: Joint) -> Document:
    document: Document = {
        "name": joint.name,
        "kind": joint.kind,
        "lower": float(joint.lower) if isfinite(joint.lower) else None,
        "upper": float(joint.upper) if isfinite(joint.upper) else None,
        "frame": joint.T_parent_joint.tolist(),
        "axis": joint.axis.tolist(),
    }
    if joint.velocity != inf:
        document["velocity"] = float(joint.velocity)
    return document


def _link_solids(robot: Robot) -> Document:
    """One radius where it says it all, else every solid."""
    solids = [_link_solid(solid) for solid in robot.all_solids]
    radius = robot.solids[0].radius if robot.solids else 0.0
    if radius > 0 and solids == [_link_solid(solid) for solid in capsules_along(robot.chain, radius)]:
        return {"link_radius": float(radius)}
    return {"solids": solids}


def _link_solid(solid: LinkSolid) -> Document:
    document: Document = {"link": solid.link, "name": solid.name}
    if isinstance(solid, LinkCapsule):
        ends = {"start": solid.start.tolist(), "end": solid.end.tolist()}
        return {**document, **ends, "radius": float(solid.radius)}
    return {**document, "size": solid.size.tolist(), "frame": solid.T_link_box.tolist()}


# --- floor, solids, task


def _floor(floor: Floor) -> Document:
    document = _rings(floor.polygon)
    if floor.cells:
        document["cells"] = [{"name": cell.name, **_prism(cell)} for cell in floor.cells]
    return document


def _rings(polygon: Polygon) -> Document:
    document: Document = {"polygon": _corners(polygon.exterior.coords)}
    if polygon.interiors:
        document["holes"] = [_corners(ring.coords) for ring in polygon.interiors]
    return document


def _corners(coordinates: Any) -> list[list[float]]:
    return [[x, y] for x, y, *_ in list(coordinates)[:-1]]


def _prism(solid: Prism) -> Document:
    return {**_rings(solid.polygon), "z": [float(solid.bottom), float(solid.top)]}


def _solid(solid: Solid) -> Document:
    match solid:
        case Box(size=size, center=center):
            return {"box": {"size": size.tolist(), "center": center.tolist(), "yaw": float(solid.yaw)}}
        case Cylinder(radius=radius, center=center):
            height = float(solid.height)
            return {"cylinder": {"radius": float(radius), "height": height, "center": center.tolist()}}
        case Sphere(radius=radius, center=center):
            return {"sphere": {"radius": float(radius), "center": center.tolist()}}
        case Prism():
            return {"prism": _prism(solid)}
        case _:
            return {"mesh": {"vertices": solid.vertices.tolist(), "faces": solid.faces.tolist()}}


def _task(task: tuple[Target, ...]) -> list[Document]:
    """Neighbours that aim alike share one list of points."""
    pieces: list[Document] = []
    for _, group in groupby(task, key=lambda target: repr(_aim(target))):
        targets = list(group)
        pieces.append({"points": [target.position.tolist() for target in targets], **_aim(targets[0])})
    return pieces


def _aim(target: Target) -> Document:
    if target.orientation is not None:
        return {"orientation": _rows(target.orientation), "cone": float(target.cone)}
    if target.direction is not None:
        return {"direction": target.direction.tolist(), "cone": float(target.cone)}
    return {}


def _rows(matrix: Array) -> list[list[float]]:
    rows: list[list[float]] = matrix.tolist()
    return rows
