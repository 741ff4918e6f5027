"""The robot of a world file: its grammar, reading and writing."""

from __future__ import annotations

from dataclasses import asdict, replace
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag

from regionik.worlds.bundled import robot_named, robot_names
from regionik.worlds.chain import Chain, pose
from regionik.worlds.documents.robot_solids import (
    LinkSolidPart,
    ToolSolidPart,
    VisualPart,
    matrix,
    solid_document,
    visual_document,
)
from regionik.worlds.drives import BaseKind
from regionik.worlds.errors import InputError, located, read_each
from regionik.worlds.joints import Joint, Mimic
from regionik.worlds.links import BASE, LINK_RADIUS, LinkMass, LinkSolid, capsules_along
from regionik.worlds.readers.text import (
    FileName,
    Matrix4,
    NotNegative,
    OneLine,
    Positive,
    Strict,
    Vec2,
    Vec3,
    Vec4,
    file_in,
    join_names,
)
from regionik.worlds.robot import BODY_HEIGHT, Robot, Tool, check_turning_radius, with_tool, without_limits
from regionik.worlds.self_collision import base_name, rest_posture
from regionik.worlds.urdf.installed import installed_urdf, urdf_file
from regionik.worlds.urdf.loader import load_robot

DhRow = Annotated[
    list[float | None],
    Field(min_length=6, max_length=6, description="theta, d, a, alpha, lower, upper; null for no limit"),
]
Names = Annotated[
    list[OneLine],
    Field(
        min_length=2,
        max_length=2,
        description="names of two solids, or links of a URDF file, that need not keep apart",
    ),
]


class ToolPart(Strict):
    """A tool on the robot's flange, which is the tool frame that it has without one."""

    position: Vec3 = Field(default=[0.0, 0.0, 0.0], description="of the tool point in the flange [m]")
    rpy: Vec3 = Field(default=[0.0, 0.0, 0.0], description="roll, pitch, yaw of the tool frame [rad]")
    solids: list[ToolSolidPart] = Field(default=[], description="what the tool consists of")

    def tool(self) -> Tool:
        solids = read_each("", "solids", self.solids, lambda part: part.on(0))
        return Tool(pose(self.position, self.rpy), solids)


class MassPart(Strict):
    """The mass of an arm link, its centre in the frame of the joint that moves the link."""

    link: Annotated[int, Field(ge=0)] = Field(description="the number of a joint, from 0")
    mass: Positive = Field(description="a mass [kg]")
    center: Vec3 = Field(default=[0.0, 0.0, 0.0], description="centre of mass x, y, z [m]")


class _WithMasses(Strict):
    """Masses, which `rules.criteria.effort` needs, and a tool."""

    masses: list[MassPart] = Field(default=[], description="masses of the arm's links")
    payload: NotNegative = Field(default=0.0, description="mass held by the tool [kg]")
    tool: ToolPart | None = None


class NamedRobot(_WithMasses):
    name: OneLine
    limits: Literal["ignore"] | None = None


class _OwnRobot(_WithMasses):
    name: OneLine = "robot"
    base: BaseKind = "omni"
    footprint: Annotated[list[Vec2], Field(min_length=1)] = Field(default=[[0.0, 0.0]])
    mount: Vec4 = Field(default=[0.0, 0.0, 0.0, 0.0])
    body_height: Positive = BODY_HEIGHT
    turning_radius: NotNegative = 0.0
    gauge: NotNegative = 0.0
    link_radius: Positive = LINK_RADIUS
    solids: list[LinkSolidPart] | None = None
    unchecked: list[Names] = Field(default=[])
    visuals: list[VisualPart] = Field(
        default=[], description="what pictures show of links, else their solids"
    )
    carry: list[float] | None = None
    limits: Literal["ignore"] | None = None


class DhRobot(_OwnRobot):
    dh: Annotated[list[DhRow], Field(min_length=1)]
    names: list[OneLine] | None = None

    def arm(self) -> Chain:
        rows = []
        for k, (theta, d, a, alpha, lower, upper) in enumerate(self.dh):
            if theta is None or d is None or a is None or alpha is None:
                raise InputError(f"dh[{k}]: theta, d, a, alpha: expected numbers, got null")
            rows.append((theta, d, a, alpha, *_limits(lower, upper)))
        return Chain.from_dh(rows, self.names)


class MimicPart(Strict):
    joint: OneLine
    multiplier: float = 1.0
    offset: float = 0.0


class JointPart(Strict):
    name: OneLine
    kind: Literal["revolute", "prismatic"]
    lower: float | None
    upper: float | None
    frame: Matrix4 = Field(description="the joint's frame in its parent link, as a 4 x 4 matrix")
    axis: Vec3
    velocity: Positive | None = None
    acceleration: Positive | None = None
    mimic: MimicPart | None = Field(
        default=None, description="the joint that it follows, and has its limits from: its own do not count"
    )


class ChainPart(Strict):
    joints: Annotated[list[JointPart], Field(min_length=1)]
    tool: Matrix4 = Field(description="the tool's frame in the last link, as a 4 x 4 matrix")


class ChainRobot(_OwnRobot):
    """Joint by joint, for arms whose frames no Denavit-Hartenberg row gives exactly."""

    chain: ChainPart

    def arm(self) -> Chain:
        joints = []
        for k, part in enumerate(self.chain.joints):
            with located("", f"chain.joints[{k}]."):
                T = matrix(part.frame, "frame")
            with located("", f"chain.joints[{k}]"):
                limits, axis = _limits(part.lower, part.upper), np.array(part.axis)
                mimic = None if part.mimic is None else Mimic(**part.mimic.model_dump())
                rates = part.velocity or inf, part.acceleration or inf
                joints.append(Joint(part.name, part.kind, *limits, T, axis, *rates, mimic))
        return Chain(tuple(joints), matrix(self.chain.tool, "chain.tool"))


class UrdfRobot(Strict):
    urdf: FileName
    tip: OneLine | None = None
    root: OneLine | None = None
    base: BaseKind = "omni"
    footprint: Annotated[list[Vec2], Field(min_length=1)] | None = None
    mount: Vec4 | None = None
    turning_radius: NotNegative = 0.0
    body_height: Positive | None = None
    payload: NotNegative = Field(default=0.0, description="mass held by the tool [kg]")
    tool: ToolPart | None = None
    carry: list[float] | OneLine | None = Field(
        default=None, description="a posture, by joint values or by its name in the SRDF file"
    )
    srdf: FileName | None = None
    unchecked: list[Names] = Field(default=[])
    ignore: list[OneLine] = Field(default=[])
    limits: Literal["ignore"] | None = None


def _robot_kind(value: Any) -> str | None:
    if isinstance(value, str):
        return "<bundled>"
    if not isinstance(value, dict):
        return None
    own = [kind for kind in ("dh", "urdf", "chain") if kind in value]
    if len(own) == 1:
        return f"<{own[0]}>"
    return "<name>" if not own and "name" in value else None


RobotPart = Annotated[
    Annotated[OneLine, Tag("<bundled>")]
    | Annotated[NamedRobot, Tag("<name>")]
    | Annotated[DhRobot, Tag("<dh>")]
    | Annotated[ChainRobot, Tag("<chain>")]
    | Annotated[UrdfRobot, Tag("<urdf>")],
    Discriminator(
        _robot_kind,
        custom_error_type="kind",
        custom_error_message="expected a bundled name, or a mapping with one of name, dh, urdf, chain",
    ),
]


# --- reading


def read_robot(part: str | NamedRobot | DhRobot | ChainRobot | UrdfRobot, where: str, folder: Path) -> Robot:
    """Return the robot of a document that messages call ``where``; a URDF file is relative to ``folder``."""
    if isinstance(part, str):
        with located(where, "robot"):
            return robot_named(part) if part in robot_names() else load_robot(installed_urdf(part))
    if isinstance(part, UrdfRobot):
        options = part.model_dump(exclude={"urdf", "turning_radius", "tool", "srdf"})
        with located(where, "robot.tool."):
            options["tool"] = None if part.tool is None else part.tool.tool()
        with located(where, "robot"):
            options["srdf"] = None if part.srdf is None else file_in(folder, part.srdf)
            path = file_in(folder, str(urdf_file(part.urdf)))
            return load_robot(path, **options, turning_radius=part.turning_radius or None)
    if isinstance(part, NamedRobot):
        with located(where, "robot.name"):
            robot = robot_named(part.name)
    else:
        with located(where, "robot."):
            robot = _own_robot(part)
    with located(where, "robot."):
        masses = tuple(LinkMass(mass.link, mass.mass, np.array(mass.center)) for mass in part.masses)
        robot = replace(robot, masses=masses, payload=part.payload)
        if part.tool is not None:
            with located("", "tool."):
                robot = with_tool(robot, part.tool.tool())
        if isinstance(part, DhRobot | ChainRobot):
            robot = _carried(_unchecked(robot, part.unchecked), part.carry)
    return without_limits(robot) if part.limits == "ignore" else robot


def _own_robot(part: DhRobot | ChainRobot) -> Robot:
    check_turning_radius(part.base, part.turning_radius)
    chain = part.arm()
    solids = _solids(part, chain)
    return Robot(
        name=part.name,
        base=part.base,
        footprint=np.array(part.footprint),
        mount=np.array(part.mount),
        chain=chain,
        solids=tuple(solid for solid in solids if solid.link != BASE),
        body_height=part.body_height,
        turning_radius=part.turning_radius,
        gauge=part.gauge,
        base_solids=tuple(solid for solid in solids if solid.link == BASE),
        visuals=read_each("", "visuals", part.visuals, VisualPart.surface),
    )


def _unchecked(robot: Robot, pairs: list[list[str]]) -> Robot:
    names = {solid.name for solid in robot.all_solids} | {base_name(robot)}
    for k, pair in enumerate(pairs):
        unknown = next((name for name in pair if name not in names), None)
        if unknown is not None:
            known = join_names(sorted(names - {base_name(robot)}), 8)
            text = f"expected names of solids ({known}) or {base_name(robot)!r}, got {unknown!r}"
            raise InputError(f"unchecked[{k}]: {text}")
    return replace(robot, unchecked=tuple((one, other) for one, other in pairs))


def _carried(robot: Robot, carry: list[float] | None) -> Robot:
    """Return a robot with the carry posture of its document, else with one that is clear."""
    if carry is not None:
        robot.chain.check_limits(carry, "carry")
        return replace(robot, carry=np.array(carry))
    rest = rest_posture(robot)
    return robot if rest is None else replace(robot, carry=rest)


def _solids(part: DhRobot | ChainRobot, chain: Chain) -> tuple[LinkSolid, ...]:
    if part.solids is None:
        return capsules_along(chain, part.link_radius)

    def solid(part: LinkSolidPart) -> LinkSolid:
        if part.link >= len(chain.joints):
            expected = f"a link from {BASE} (the base) to {len(chain.joints) - 1}"
            raise InputError(f"link: expected {expected}, got {part.link}")
        return part.solid()

    return read_each("", "solids", part.solids, solid)


def _limits(lower: float | None, upper: float | None) -> tuple[float, float]:
    return -inf if lower is None else lower, inf if upper is None else upper


# --- writing


def robot_to_document(robot: Robot) -> str | dict[str, Any]:
    """Return plain values from which an equal robot is read: a bundled one by its name, others in full."""
    full = _full_robot(robot)
    for name in robot_names():
        bundled = robot_named(name)
        if full == _full_robot(bundled):
            return name
        if full == _full_robot(without_limits(bundled)):
            return {"name": name, "limits": "ignore"}
    return full


def _full_robot(robot: Robot) -> dict[str, Any]:
    document: dict[str, Any] = {"name": robot.name}
    rows = robot.chain.dh_rows()
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
    if robot.visuals:
        document["visuals"] = [visual_document(surface) for surface in robot.visuals]
    if robot.masses:
        document["masses"] = [
            {"link": one.link, "mass": float(one.mass), "center": one.center.tolist()} for one in robot.masses
        ]
    if robot.payload:
        document["payload"] = float(robot.payload)
    document["carry"] = robot.carry.tolist()
    return document


def _joint(joint: Joint) -> dict[str, Any]:
    document: dict[str, Any] = {
        "name": joint.name,
        "kind": joint.kind,
        "lower": float(joint.lower) if isfinite(joint.lower) else None,
        "upper": float(joint.upper) if isfinite(joint.upper) else None,
        "frame": joint.T_parent_joint.tolist(),
        "axis": joint.axis.tolist(),
    }
    if joint.velocity != inf:
        document["velocity"] = float(joint.velocity)
    if joint.acceleration != inf:
        document["acceleration"] = float(joint.acceleration)
    if joint.mimic is not None:
        document["mimic"] = asdict(joint.mimic)
    return document


def _link_solids(robot: Robot) -> dict[str, Any]:
    """Return one radius where it describes all solids, else every solid."""
    solids = [solid_document(solid) for solid in robot.all_solids]
    radius = robot.solids[0].radius if robot.solids else 0.0
    if radius > 0 and solids == [solid_document(solid) for solid in capsules_along(robot.chain, radius)]:
        return {"link_radius": float(radius)}
    return {"solids": solids}
