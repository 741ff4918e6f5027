"""Robot and world as MJCF, the model format of MuJoCo.

The base is three planar joints whose velocities are servoed, links are bodies on their joints with position
servos, and drives bear the links' weight. Solids of the robot touch those of the world, and of its own those
that must keep apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from regionik.planners.collision.convex_bodies import solid_pieces
from regionik.simulation.options import SIMULATION
from regionik.worlds.arrays import Array
from regionik.worlds.chain import planar_pose
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox, LinkHull, LinkMass, LinkSolid
from regionik.worlds.obstacles import Box, Mesh, Solid
from regionik.worlds.robot import GRAVITY, Robot
from regionik.worlds.scene import World
from regionik.worlds.self_collision import BODY, base_body, self_collision_pairs

OPTIONS = SIMULATION.robot

ROOT = "mujoco"  # element of every model
BASE_JOINTS = ("base x", "base y", "base yaw")
ARMATURE = {"revolute": 0.01, "prismatic": 1.0}  # of a joint's drive, seen from the joint [kg m2], [kg]
_MAX_UNFELT_DEPTH = 1.0  # depth up to which contacts of the last link exert no force [m]


def model_text(world: World, timestep: float) -> str:
    """MJCF text of a world and its robot, solved in steps of ``timestep`` [s].

    Geoms of the robot are called ``robot K``, K the index in ``robot.all_solids`` or -1 for the base's body;
    of the world ``solid K.J``, piece J of solid K. The tool is the site ``tool``.
    """
    root, robot = Element(ROOT, model=world.name), world.robot
    SubElement(root, "compiler", angle="radian", autolimits="true")
    SubElement(root, "size", memory="64M")
    option = {"timestep": repr(timestep), "gravity": f"0 0 {-GRAVITY}", "integrator": "implicitfast"}
    SubElement(SubElement(root, "option", option), "flag", autoreset="disable")
    assets, scene = SubElement(root, "asset"), SubElement(root, "worldbody")
    for k, solid in enumerate(world.solids):
        for j, shape in enumerate(_shapes(solid)):
            _geom(assets, scene, f"solid {k}.{j}", shape, contype="0", conaffinity="1")
    _add_robot(assets, scene, robot)
    contact, drives = SubElement(root, "contact"), SubElement(root, "actuator")
    for i, k in self_collision_pairs(robot):
        SubElement(contact, "pair", geom1=f"robot {i}", geom2=f"robot {k}")
    for name in BASE_JOINTS:
        SubElement(drives, "velocity", joint=name, kv="1")
    for joint in robot.chain.joints:
        SubElement(drives, "position", joint=f"arm {joint.name}", kp="1", kv="1")
    indent(root)
    return tostring(root, encoding="unicode")


def _add_robot(assets: Element, scene: Element, robot: Robot) -> None:
    base = SubElement(scene, "body", name="base")
    for name, kind, axis in zip(BASE_JOINTS, ("slide", "slide", "hinge"), np.eye(3), strict=True):
        SubElement(base, "joint", name=name, type=kind, axis=_numbers(axis))
    _inertial(base, OPTIONS.base_mass, np.zeros(3), np.full(3, OPTIONS.base_inertia))
    if base_body(robot) is not None:
        outline = robot.footprint
        corners = [np.column_stack([outline, np.full(len(outline), z)]) for z in (0.0, robot.body_height)]
        _geom(assets, base, f"robot {BODY}", _hull(np.concatenate(corners)))
    first = len(robot.solids)
    for k, solid in enumerate(robot.base_solids, first):
        _geom(assets, base, f"robot {k}", _link_shape(solid))
    parent = SubElement(base, "body", {"name": "arm", **_frame(robot.T_base_arm)})
    for k, joint in enumerate(robot.chain.joints):
        parent = _add_link(assets, parent, robot, k, joint)
    SubElement(parent, "site", {"name": "tool", **_frame(robot.chain.T_last_tool)})
    if robot.payload:
        load = SubElement(
            parent, "body", {"name": "payload", "gravcomp": "1", **_frame(robot.chain.T_last_tool)}
        )
        _inertial(load, robot.payload, np.zeros(3), np.full(3, OPTIONS.bare_inertia))


def _add_link(assets: Element, parent: Element, robot: Robot, k: int, joint: Joint) -> Element:
    """Body of the link that a joint moves."""
    link = SubElement(parent, "body", {"name": f"link {k}", "gravcomp": "1", **_frame(joint.T_parent_joint)})
    moving = SubElement(
        link,
        "joint",
        name=f"arm {joint.name}",
        type="hinge" if joint.kind == "revolute" else "slide",
        axis=_numbers(joint.axis),
        armature=repr(ARMATURE[joint.kind]),
    )
    if np.isfinite([joint.lower, joint.upper]).all() and joint.lower < joint.upper:
        moving.set("range", _numbers(np.array([joint.lower, joint.upper])))
    solids = [(i, solid) for i, solid in enumerate(robot.solids) if solid.link == k]
    masses = [mass for mass in robot.masses if mass.link == k]
    if masses or not solids:
        _inertial(link, *_link_inertia(masses, [solid for _, solid in solids]))
    # Plans let the last link sink into what the tool works on: how deep is looked at, and nothing pushes.
    felt = (
        {"margin": repr(-_MAX_UNFELT_DEPTH), "gap": repr(_MAX_UNFELT_DEPTH)}
        if k == len(robot.chain.joints) - 1
        else {}
    )
    for i, solid in solids:
        _geom(assets, link, f"robot {i}", _link_shape(solid), density=repr(OPTIONS.density), **felt)
    return link


def _link_inertia(masses: list[LinkMass], solids: list[LinkSolid]) -> tuple[float, Array, Array]:
    """Mass [kg], its centre [m] and, of a box around the solids, moments of inertia [kg m2] of a link."""
    if not masses:
        return OPTIONS.bare_mass, np.zeros(3), np.full(3, OPTIONS.bare_inertia)
    mass = sum(one.mass for one in masses)
    center = sum((one.mass * one.center for one in masses), np.zeros(3)) / mass
    if not solids:
        return mass, center, np.full(3, OPTIONS.bare_inertia)
    corners = [solid.corners + side for solid in solids for side in (-solid.radius, solid.radius)]
    square = np.ptp(np.concatenate(corners), axis=0) ** 2
    return mass, center, np.maximum(mass / 12 * (square.sum() - square), OPTIONS.bare_inertia)


# --- shapes, as attributes of a geom; corners of hulls under "vertex"

Shape = dict[str, str]


def _shapes(solid: Solid) -> Iterator[Shape]:
    if isinstance(solid, Box):
        x, y, z = solid.center.tolist()
        T = planar_pose(x, y, solid.yaw, z)
        yield {"type": "box", "size": _numbers(solid.size / 2), **_frame(T)}
        return
    for piece in solid_pieces(solid):
        middle = _numbers(piece.corners.mean(0))
        if isinstance(solid, Mesh):
            yield from (_shell(triangle) for triangle in solid.vertices[solid.faces])
        elif piece.disc:
            half = (piece.corners[1, 2] - piece.corners[0, 2]) / 2
            yield {"type": "cylinder", "pos": middle, "size": _numbers(np.array([piece.disc, half]))}
        elif piece.ball:
            yield {"type": "sphere", "pos": middle, "size": repr(float(piece.ball))}
        else:
            yield _hull(piece.corners)


def _hull(corners: Array) -> Shape:
    return {"type": "mesh", "vertex": _numbers(corners.ravel())}


def _shell(triangle: Array) -> Shape:
    """A triangle (3, 3) of a closed mesh, thickened inwards."""
    normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
    inner = triangle.mean(0) - OPTIONS.shell * normal / max(float(np.linalg.norm(normal)), 1e-300)
    return _hull(np.vstack([triangle, inner]))


def _link_shape(solid: LinkSolid) -> Shape:
    if isinstance(solid, LinkBox):
        return {"type": "box", "size": _numbers(solid.size / 2), **_frame(solid.T_link_box)}
    if isinstance(solid, LinkHull):
        return _hull(solid.corners)
    if np.linalg.norm(solid.end - solid.start) < 1e-9:
        return {"type": "sphere", "pos": _numbers(solid.start), "size": repr(float(solid.radius))}
    ends = np.concatenate([solid.start, solid.end])
    return {"type": "capsule", "fromto": _numbers(ends), "size": repr(float(solid.radius))}


def _geom(assets: Element, body: Element, name: str, shape: Shape, **attributes: str) -> None:
    geom = {"name": name, "contype": "1", "conaffinity": "0", **shape, **attributes}
    if "vertex" in geom:
        SubElement(assets, "mesh", name=name, vertex=geom.pop("vertex"), inertia="convex")
        geom["mesh"] = name
    SubElement(body, "geom", geom)


def _inertial(body: Element, mass: float, center: Array, moments: Array) -> None:
    SubElement(body, "inertial", pos=_numbers(center), mass=repr(mass), diaginertia=_numbers(moments))


def _frame(T: Array) -> dict[str, str]:
    return {"pos": _numbers(T[:3, 3]), "xyaxes": _numbers(T[:3, :2].T.ravel())}


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
