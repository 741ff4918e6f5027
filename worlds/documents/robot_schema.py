"""Words of the grammar that the parts of a world file share."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeVar

from pydantic import Discriminator, FailFast, Field, Tag

from regionik.worlds.bundled import BODY_HEIGHT, LINK_RADIUS
from regionik.worlds.drives import BaseKind
from regionik.worlds.readers.validation import Strict
from regionik.worlds.robot import BASE

_Item = TypeVar("_Item")
Many = Annotated[list[_Item], FailFast()]  # no list of all that is wrong with a million of them

OneLine = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\r\n\x00-\x1f]+$")]
File = Annotated[str, Field(min_length=1, pattern=r"^[^\r\n\x00]+$")]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Vec2 = Annotated[list[float], Field(min_length=2, max_length=2)]
Vec3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Vec4 = Annotated[list[float], Field(min_length=4, max_length=4)]
Size3 = Annotated[list[Positive], Field(min_length=3, max_length=3)]
Matrix3 = Annotated[list[Vec3], Field(min_length=3, max_length=3)]
Matrix4 = Annotated[list[Vec4], Field(min_length=4, max_length=4)]
Ring = Annotated[Many[Vec2], Field(min_length=3)]
Range = Annotated[list[float], Field(min_length=2, max_length=2)]
Count = Annotated[int, Field(ge=2, le=1_000_000)]


def one_of(*kinds: str) -> Discriminator:
    """Tell mappings apart by the one key that names their kind."""

    def tag(value: Any) -> str | None:
        found = [kind for kind in kinds if isinstance(value, dict) and kind in value]
        return f"<{found[0]}>" if len(found) == 1 else None

    return Discriminator(
        tag,
        custom_error_type="kind",
        custom_error_message=f"expected exactly one of {', '.join(kinds)}",
    )


DhRow = Annotated[
    list[float | None],
    Field(min_length=6, max_length=6, description="theta, d, a, alpha, lower, upper; null for no limit"),
]


Names = Annotated[
    list[OneLine],
    Field(min_length=2, max_length=2, description="names of two solids that need not keep apart"),
]


class MassPart(Strict):
    """The mass of an arm link, its centre in the frame of the joint that moves the link."""

    link: Annotated[int, Field(ge=0)] = Field(description="the number of a joint, from 0")
    mass: Positive = Field(description="a mass [kg]")
    center: Vec3 = Field(default=[0.0, 0.0, 0.0], description="centre of mass x, y, z [m]")


class _Weighed(Strict):
    """What gravity pulls at; `rules.criteria.effort` asks for it."""

    masses: list[MassPart] = Field(default=[], description="masses of the arm's links")
    payload: NotNegative = Field(default=0.0, description="what the tool carries [kg]")


class NamedRobot(_Weighed):
    name: OneLine
    limits: Literal["ignore"] | None = None


class _OfLink(Strict):
    link: Annotated[int, Field(ge=BASE)] = Field(
        description="the number of a joint, from 0; -1 for what is fixed to the base"
    )
    name: OneLine = Field(description="a name")


class Capsule(_OfLink):
    """All points within ``radius`` of a segment in the link's frame."""

    start: Vec3 = Field(description="x, y, z [m]")
    end: Vec3 = Field(description="x, y, z [m]")
    radius: Positive = Field(description="a length [m]")


class PlacedBox(_OfLink):
    """A box whose middle and turn in the link's frame are given by hand."""

    size: Size3 = Field(description="three lengths [m]")
    position: Vec3 = Field(default=[0.0, 0.0, 0.0])
    rpy: Vec3 = Field(default=[0.0, 0.0, 0.0])


class FramedBox(_OfLink):
    """A box as `regionik.worlds.documents.world_file.world_to_document` writes it, exact to the last bit."""

    size: Size3 = Field(description="three lengths [m]")
    frame: Matrix4 = Field(description="the box's frame in the link, as a 4 x 4 matrix")


def _solid_kind(value: Any) -> str | None:
    keys = set(value) if isinstance(value, dict) else set()
    capsule, box = keys & {"start", "end", "radius"}, keys & {"size", "position", "rpy", "frame"}
    if bool(capsule) == bool(box):
        return None
    if capsule:
        return "<capsule>"
    return "<framed>" if "frame" in keys else "<placed>"


LinkSolidPart = Annotated[
    Annotated[Capsule, Tag("<capsule>")]
    | Annotated[PlacedBox, Tag("<placed>")]
    | Annotated[FramedBox, Tag("<framed>")],
    Discriminator(
        _solid_kind,
        custom_error_type="kind",
        custom_error_message="expected link, name and either start, end, radius (a capsule)"
        " or size, position, rpy (a box)",
    ),
]


class _OwnRobot(_Weighed):
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
    tip: OneLine | None = None
    root: OneLine | None = None
    base: BaseKind = "omni"
    footprint: Annotated[list[Vec2], Field(min_length=1)] | None = None
    mount: Vec4 | None = None
    turning_radius: NotNegative = 0.0
    body_height: Positive | None = None
    payload: NotNegative = Field(default=0.0, description="what the tool carries [kg]")
    carry: list[float] | None = None
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
