"""The robot part of a world file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from regionik.worlds.bundled import BODY_HEIGHT, LINK_RADIUS
from regionik.worlds.checking import Strict
from regionik.worlds.grammar import File, Matrix4, NotNegative, OneLine, Positive, Vec2, Vec3, Vec4

DhRow = Annotated[
    list[float | None],
    Field(min_length=6, max_length=6, description="theta, d, a, alpha, lower, upper; null for no limit"),
]


class NamedRobot(Strict):
    name: OneLine
    limits: Literal["ignore"] | None = None


class Capsule(Strict):
    link: Annotated[int, Field(ge=0)]
    name: OneLine
    start: Vec3
    end: Vec3
    radius: Positive


class _OwnRobot(Strict):
    name: OneLine = "robot"
    base: Literal["omni", "differential", "car"] = "omni"
    footprint: Annotated[list[Vec2], Field(min_length=1)] = Field(default=[[0.0, 0.0]])
    mount: Vec4 = Field(default=[0.0, 0.0, 0.0, 0.0])
    body_height: Positive = BODY_HEIGHT
    turning_radius: NotNegative = 0.0
    link_radius: Positive = LINK_RADIUS
    solids: list[Capsule] | None = None
    carry: list[float] | None = None
    limits: Literal["ignore"] | None = None


class DhRobot(_OwnRobot):
    dh: Annotated[list[DhRow], Field(min_length=1)]
    names: list[OneLine] | None = None


class JointPart(Strict):
    name: OneLine
    kind: Literal["revolute", "prismatic"]
    lower: float | None
    upper: float | None
    frame: Matrix4 = Field(description="the joint's frame in its parent link, as a 4 x 4 matrix")
    axis: Vec3
    velocity: Positive | None = None


class ChainPart(Strict):
    joints: Annotated[list[JointPart], Field(min_length=1)]
    tool: Matrix4 = Field(description="the tool's frame in the last link, as a 4 x 4 matrix")


class ChainRobot(_OwnRobot):
    """Joint by joint, for arms whose frames no Denavit-Hartenberg row gives exactly."""

    chain: ChainPart


class UrdfRobot(Strict):
    urdf: File
    tip: OneLine
    root: OneLine | None = None
    base: Literal["omni", "differential", "car"] = "omni"
    footprint: Annotated[list[Vec2], Field(min_length=1)] = Field(default=[[0.0, 0.0]])
    mount: Vec4 = Field(default=[0.0, 0.0, 0.0, 0.0])
    turning_radius: NotNegative = 0.0
    body_height: Positive = BODY_HEIGHT
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
