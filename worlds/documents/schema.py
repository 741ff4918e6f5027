"""The grammar of a world file, version 1."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Discriminator, Field, Tag

from regionik.worlds.documents.grammar import (
    Count,
    File,
    Many,
    Matrix3,
    NotNegative,
    OneLine,
    Positive,
    Range,
    Ring,
    Size3,
    Vec3,
    Vec4,
    one_of,
)
from regionik.worlds.documents.robotschema import RobotPart
from regionik.worlds.readers.checking import Strict
from regionik.worlds.scene import Heading, Mode, Order, Rules, StopCriterion
from regionik.worlds.speeds import Speeds

# --- solids


class BoxShape(Strict):
    size: Size3 = Field(description="three lengths [m]")
    center: Vec3 = Field(description="x, y, z [m]")
    yaw: float = 0.0


class CylinderShape(Strict):
    radius: Positive = Field(description="a length [m]")
    height: Positive = Field(description="a length [m]")
    center: Vec3 = Field(description="x, y, z [m]")


class SphereShape(Strict):
    radius: Positive = Field(description="a length [m]")
    center: Vec3 = Field(description="x, y, z [m]")


class PrismShape(Strict):
    polygon: Ring = Field(description="corners [[x, y], ...] [m]")
    holes: Many[Ring] = []
    z: Range = Field(description="bottom and top [m]")


class Cell(PrismShape):
    """A blob of map cells, as written by `regionik.worlds.format.world_to_document`."""

    name: OneLine


class MeshFile(Strict):
    file: File = Field(description="an STL, OBJ, PLY or OFF file")
    position: Vec3 = [0.0, 0.0, 0.0]
    rpy: Vec3 = [0.0, 0.0, 0.0]
    scale: Positive = 1.0


class MeshInline(Strict):
    vertices: Annotated[Many[Vec3], Field(min_length=4)] = Field(description="points [[x, y, z], ...] [m]")
    faces: Annotated[
        Many[Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=3, max_length=3)]],
        Field(min_length=4),
    ] = Field(description="triangles [[i, j, k], ...]")


MeshShape = Annotated[
    Annotated[MeshFile, Tag("<file>")] | Annotated[MeshInline, Tag("<vertices>")], one_of("file", "vertices")
]


class _Named(Strict):
    name: OneLine = Field(description="a name")


class BoxObstacle(_Named):
    box: BoxShape


class CylinderObstacle(_Named):
    cylinder: CylinderShape


class SphereObstacle(_Named):
    sphere: SphereShape


class PrismObstacle(_Named):
    prism: PrismShape


class MeshObstacle(_Named):
    mesh: MeshShape


Obstacle = Annotated[
    Annotated[BoxObstacle, Tag("<box>")]
    | Annotated[CylinderObstacle, Tag("<cylinder>")]
    | Annotated[SphereObstacle, Tag("<sphere>")]
    | Annotated[PrismObstacle, Tag("<prism>")]
    | Annotated[MeshObstacle, Tag("<mesh>")],
    one_of("box", "cylinder", "sphere", "prism", "mesh"),
]


# --- floor


class PolygonFloor(Strict):
    polygon: Ring = Field(description="corners [[x, y], ...] [m]")
    holes: Many[Ring] = []
    cells: Many[Cell] = []


class MapFloor(Strict):
    """A ROS map; ``free_thresh`` stands in for the map's own."""

    map: File = Field(description="a map_server YAML file")
    height: Positive = 1.0
    free_thresh: Annotated[float, Field(ge=0, le=1)] | None = None


FloorPart = Annotated[
    Annotated[PolygonFloor, Tag("<polygon>")] | Annotated[MapFloor, Tag("<map>")], one_of("polygon", "map")
]


# --- task


def _turn_kind(value: Any) -> str:
    return "<matrix>" if isinstance(value, list) and value and isinstance(value[0], list) else "<quaternion>"


class Aim(Strict):
    """Where the tool points; nothing leaves it free."""

    direction: Vec3 | None = None
    orientation: (
        Annotated[
            Annotated[Vec4, Tag("<quaternion>")] | Annotated[Matrix3, Tag("<matrix>")],
            Discriminator(_turn_kind),
        ]
        | None
    ) = None
    cone: Annotated[float, Field(gt=0, le=3.141592653589793)] | None = None


class Line(Strict):
    start: Vec3 = Field(alias="from", description="x, y, z [m]")
    end: Vec3 = Field(alias="to", description="x, y, z [m]")
    count: Count = Field(description="a number of set-points")


class Sine(Line):
    amplitude: float = Field(description="a length [m]")
    periods: Positive = Field(description="a number of waves")
    phase: float = 0.0
    axis: Vec3 | None = None


class Arc(Strict):
    center: Vec3 = Field(description="x, y, z [m]")
    radius: Positive = Field(description="a length [m]")
    start: float = Field(alias="from", description="an angle [rad]")
    end: float = Field(alias="to", description="an angle [rad]")
    rise: float = Field(default=0.0, description="a height climbed evenly [m]")
    count: Count = Field(description="a number of set-points")


class Frame(Strict):
    position: Vec3 = [0.0, 0.0, 0.0]
    rpy: Vec3 = [0.0, 0.0, 0.0]


class LinePiece(Aim):
    line: Line


class SinePiece(Aim):
    sine: Sine


class ArcPiece(Aim):
    """With ``follow`` the tool turns with the arc, from the direction or orientation given for angle 0."""

    arc: Arc
    follow: bool = False


class PointsPiece(Aim):
    points: Annotated[Many[Vec3], Field(min_length=1)]


class CsvPiece(Aim):
    csv: File
    frame: Frame = Frame()
    scale: Positive = 1.0


Piece = Annotated[
    Annotated[LinePiece, Tag("<line>")]
    | Annotated[SinePiece, Tag("<sine>")]
    | Annotated[ArcPiece, Tag("<arc>")]
    | Annotated[PointsPiece, Tag("<points>")]
    | Annotated[CsvPiece, Tag("<csv>")],
    one_of("line", "sine", "arc", "points", "csv"),
]


# --- the whole


class StartPart(Strict):
    base: Vec3 = Field(description="x, y [m], yaw [rad]")
    joints: Many[float] = Field(description="one value a joint")


class CriteriaPart(Strict):
    """The fields of `regionik.worlds.criteria.Criteria`, checked."""

    manipulability: NotNegative | None = Field(default=None, description="least manipulability [m3]")
    joint_margin: Annotated[float, Field(ge=0, lt=0.5)] | None = Field(
        default=None, description="least distance from both limits, as a share of a joint's range"
    )
    effort: Positive | list[Positive] | None = Field(
        default=None, description="most torque from gravity, for all joints or for each [N m], [N] if sliding"
    )


class RulesPart(Strict):
    """The fields of `regionik.worlds.scene.Rules`, checked."""

    clearance: NotNegative = Rules.clearance
    arm_clearance: NotNegative = Rules.arm_clearance
    step: Positive = Rules.step
    heading: Heading = Rules.heading
    tolerance: Positive = Rules.tolerance
    path_tolerance: Positive = Rules.path_tolerance
    tool_contact: NotNegative = Rules.tool_contact
    contact_depth: NotNegative = Field(
        default=Rules.contact_depth,
        description="how deep the last link may sink into what the tool touches, beyond the tolerance; "
        "0 lets it touch only [m]",
    )
    reach_margin: NotNegative = Rules.reach_margin
    max_lift_offs: Annotated[int, Field(ge=0)] | None = Rules.max_lift_offs
    avoidance: bool = Rules.avoidance
    mode: Mode = Field(
        default=Rules.mode,
        description="continuous: the base goes along with the tool; stops: it stands still at as few stops "
        "as there can be, and the tool is lifted while it drives between them",
    )
    order: Order = Field(
        default=Rules.order,
        description="of the set-points; any goes with mode stops, for drilling and the like",
    )
    stop_criterion: StopCriterion = Field(
        default=Rules.stop_criterion,
        description="best place of a stop: tolerance, the middle of the largest circle to park in; "
        "clearance, farthest from where the base may not be; manipulability, its least over the stop's "
        "set-points largest; effort, the largest joint torque that holds a load at the tool smallest; "
        "distance, the shortest way through all stops",
    )
    stop_tolerance: NotNegative = Field(
        default=Rules.stop_tolerance, description="least radius of the circle to park in [m]"
    )
    criteria: CriteriaPart | None = None


class SpeedsPart(Strict):
    """The fields of `regionik.worlds.speeds.Speeds`, checked."""

    joint_velocity: Positive | list[Positive] | None = None
    joint_acceleration: Positive | list[Positive] | None = None
    base_velocity: Positive = Speeds.base_velocity
    base_acceleration: Positive = Speeds.base_acceleration
    turn_velocity: Positive = Speeds.turn_velocity
    turn_acceleration: Positive = Speeds.turn_acceleration
    wheel_velocity: Positive | None = Speeds.wheel_velocity
    tool_velocity: Positive | None = Speeds.tool_velocity


class WorldDocument(Strict):
    """A regionik world file, version 1. Metres, radians; right-handed, z up."""

    model_config = ConfigDict(title="regionik world file")

    version: Literal[1] = Field(description="1, the version of this format")
    name: OneLine | None = None
    about: OneLine | None = None
    robot: RobotPart = Field(description="a bundled name, or a mapping with one of name, dh, urdf, chain")
    floor: FloorPart = Field(description="{polygon: [[x, y], ...]} or {map: file}")
    obstacles: Many[Obstacle] = []
    start: StartPart | None = None
    task: Annotated[Many[Piece], Field(min_length=1)] = Field(description="set-points")
    rules: RulesPart = RulesPart()
    speeds: SpeedsPart | None = Field(default=None, description="what plans are timed by")
