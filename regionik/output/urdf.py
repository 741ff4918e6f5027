"""A robot as URDF, so that any other kinematics library can check a plan."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import asdict
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike
from shapely.geometry import Polygon

from regionik.view.picture import Color
from regionik.worlds.arrays import Array
from regionik.worlds.chain import translation
from regionik.worlds.errors import InputError
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox, LinkCapsule, LinkHull, LinkSolid
from regionik.worlds.robot import Robot
from regionik.worlds.urdf.bounding import cylinder_in, oriented_box

_UNLIMITED = 1e6  # URDF demands a number where a limit is infinite
_VIRTUAL_JOINTS = ("base_x", "base_y", "base_yaw", "mount", "tool_fixed")


def robot_to_urdf(robot: Robot, floor: Polygon) -> str:
    """URDF text of a robot on a floor.

    The base is three virtual joints: ``base_x``, ``base_y`` (prismatic, limited to the floor's extent)
    and ``base_yaw`` (continuous). The arm's joints keep their names, which must be others; the link that
    joint ``j`` moves is ``j_link``; the tool is the link ``tool``. A link's box stays a box, a capsule
    becomes a cylinder and two spheres, a hull the box around it, as URDF has no word for it, a footprint its
    bounding box up to ``body_height``; a point base has no solid. What collides is also what is seen.
    """
    taken = [joint.name for joint in robot.chain.joints if joint.name in _VIRTUAL_JOINTS]
    if taken:
        raise InputError(
            f"robot {robot.name}: joint {taken[0]} cannot be exported: "
            f"URDF needs {', '.join(_VIRTUAL_JOINTS)}"
        )
    root = ElementTree.Element("robot", name=robot.name)
    x_low, y_low, x_high, y_high = floor.bounds
    ElementTree.SubElement(root, "link", name="world")
    _joint(root, _prismatic("base_x", 0, x_low, x_high), "world", "base_x_link")
    _joint(root, _prismatic("base_y", 1, y_low, y_high), "base_x_link", "base_y_link")
    yaw = Joint("base_yaw", "revolute", -np.inf, np.inf, np.eye(4))
    return _with_links(root, robot, _joint(root, yaw, "base_y_link", "base"))


def robot_description(robot: Robot, base_link: str) -> str:
    """URDF text of a robot as ROS publishes it: the base is its root link, which something else moves."""
    others = {"arm_base", "tool", *(f"{joint.name}_link" for joint in robot.chain.joints)}
    if base_link in others:
        raise InputError(f"frames: base_link: {base_link} is a link of the arm, expected another name")
    root = ElementTree.Element("robot", name=robot.name)
    return _with_links(root, robot, ElementTree.SubElement(root, "link", name=base_link))


def _with_links(root: ElementTree.Element, robot: Robot, base: ElementTree.Element) -> str:
    """URDF text with what the base and the arm's links carry."""
    _add_footprint(base, robot)
    for solid in robot.base_solids:
        _add_solid(base, solid)
    _connect(root, "mount", "fixed", robot.T_base_arm, base.attrib["name"], "arm_base")
    parent = "arm_base"
    for k, joint in enumerate(robot.chain.joints):
        child = f"{joint.name}_link"
        link = _joint(root, joint, parent, child)
        for solid in robot.solids:
            if solid.link == k:
                _add_solid(link, solid)
        parent = child
    _connect(root, "tool_fixed", "fixed", robot.chain.T_last_tool, parent, "tool")
    for link in root.iter("link"):
        _add_visuals(link, Color.ROBOT if link is base else Color.ARM)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _prismatic(name: str, axis: int, lower: float, upper: float) -> Joint:
    return Joint(name, "prismatic", lower, upper, np.eye(4), np.eye(3)[axis])


def _connect(
    root: ElementTree.Element, name: str, kind: str, T: Array, parent: str, child: str
) -> tuple[ElementTree.Element, ElementTree.Element]:
    """Add a joint and the link behind it, and return both."""
    element = ElementTree.SubElement(root, "joint", name=name, type=kind)
    _origin(element, T[:3, 3], roll_pitch_yaw(T))
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=child)
    return element, ElementTree.SubElement(root, "link", name=child)


def _joint(root: ElementTree.Element, joint: Joint, parent: str, child: str) -> ElementTree.Element:
    """Add a joint that moves, and return the link behind it."""
    endless = joint.kind == "revolute" and np.isinf(joint.lower) and np.isinf(joint.upper)
    kind = "continuous" if endless else joint.kind
    element, link = _connect(root, joint.name, kind, joint.T_parent_joint, parent, child)
    ElementTree.SubElement(element, "axis", xyz=_numbers(joint.axis))
    limit = {"effort": repr(_UNLIMITED), "velocity": repr(_finite(joint.velocity))}
    if joint.acceleration != np.inf:
        limit["acceleration"] = repr(_finite(joint.acceleration))
    if not endless:
        limit = {"lower": repr(_finite(joint.lower)), "upper": repr(_finite(joint.upper)), **limit}
    ElementTree.SubElement(element, "limit", limit)
    if joint.mimic is not None:
        mimic = {key: str(value) for key, value in asdict(joint.mimic).items()}
        ElementTree.SubElement(element, "mimic", mimic)
    return link


def _add_footprint(link: ElementTree.Element, robot: Robot) -> None:
    if len(robot.footprint) == 1:
        return
    low, high = robot.footprint.min(axis=0), robot.footprint.max(axis=0)
    x, y = (low + high) / 2
    T = translation(x, y, robot.body_height / 2)
    _add_box(link, "footprint", T, np.append(high - low, robot.body_height))


def _add_box(link: ElementTree.Element, name: str, T: Array, size: Array) -> None:
    shape = _collision(link, name, T, roll_pitch_yaw(T))
    ElementTree.SubElement(shape, "box", size=_numbers(size))


def _add_solid(link: ElementTree.Element, solid: LinkSolid) -> None:
    match solid:
        case LinkCapsule():
            _add_capsule(link, solid)
        case LinkBox():
            _add_box(link, solid.name, solid.T_link_box, solid.size)
        case LinkHull():
            _add_hull(link, solid)


def _add_hull(link: ElementTree.Element, hull: LinkHull) -> None:
    """Add the cylinder that a hull stands for, else a box around it: URDF has no hulls."""
    found = cylinder_in(hull)
    if found is None:
        _add_box(link, hull.name, *oriented_box(hull.corners))
        return
    T, radius, length = found
    shape = _collision(link, hull.name, T, roll_pitch_yaw(T))
    ElementTree.SubElement(shape, "cylinder", radius=repr(radius), length=repr(length))


def _add_capsule(link: ElementTree.Element, capsule: LinkCapsule) -> None:
    radius = repr(float(capsule.radius))
    along = capsule.end - capsule.start
    length = float(np.linalg.norm(along))
    ends = {"start": capsule.start, "end": capsule.end} if length > 0 else {"start": capsule.start}
    for which, center in ends.items():
        shape = _collision(link, f"{capsule.name} {which}", translation(*center))
        ElementTree.SubElement(shape, "sphere", radius=radius)
    if length > 0:
        # Yaw and pitch that take z to the capsule's axis.
        yaw, pitch = np.arctan2(along[1], along[0]), np.arctan2(np.hypot(along[0], along[1]), along[2])
        middle = (capsule.start + capsule.end) / 2
        shape = _collision(link, f"{capsule.name} side", translation(*middle), (0.0, pitch, yaw))
        ElementTree.SubElement(shape, "cylinder", radius=radius, length=repr(length))


def _collision(
    link: ElementTree.Element, name: str, T: Array, rpy: ArrayLike = (0.0, 0.0, 0.0)
) -> ElementTree.Element:
    collision = ElementTree.SubElement(link, "collision", name=name)
    _origin(collision, T[:3, 3], np.asarray(rpy))
    return ElementTree.SubElement(collision, "geometry")


def _add_visuals(link: ElementTree.Element, color: int) -> None:
    """Make each collision element of a link a visual one too, with a colour 0xRRGGBB."""
    rgb = [(color >> shift & 255) / 255 for shift in (16, 8, 0)]
    for k, collision in enumerate(link.findall("collision")):
        visual = ElementTree.Element("visual", name=collision.get("name", ""))
        visual.extend(deepcopy(list(collision)))
        material = ElementTree.SubElement(visual, "material", name=f"{color:06x}")
        ElementTree.SubElement(material, "color", rgba=_numbers(np.array([*rgb, 1.0])))
        link.insert(k, visual)


def _origin(element: ElementTree.Element, xyz: Array, rpy: Array) -> None:
    ElementTree.SubElement(element, "origin", xyz=_numbers(xyz), rpy=_numbers(rpy))


def roll_pitch_yaw(T: Array) -> Array:
    """Angles (3,) about the fixed x, y and z axes, applied in this order, of a frame (4, 4) [rad]."""
    across = float(np.hypot(T[0, 0], T[1, 0]))
    pitch = np.arctan2(-T[2, 0], across)
    if across < 1e-12:  # x points up or down: roll and yaw turn about the same axis, yaw takes it all
        return np.array([0.0, pitch, np.arctan2(-T[0, 1], T[1, 1])])
    return np.array([np.arctan2(T[2, 1], T[2, 2]), pitch, np.arctan2(T[1, 0], T[0, 0])])


def _finite(value: float) -> float:
    return float(np.clip(value, -_UNLIMITED, _UNLIMITED))


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)
