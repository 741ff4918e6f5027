"""The task of a world file, set-points in order: grammar, reading and writing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag

from regionik.worlds.arrays import Array
from regionik.worlds.chain import check_rotation
from regionik.worlds.documents.frames import FrameReference, Poses, frame_pose
from regionik.worlds.errors import InputError, located, located_error
from regionik.worlds.readers.csv_path import (
    AngleUnit,
    CsvFormat,
    Delimiter,
    LengthUnit,
    Normals,
    read_csv,
)
from regionik.worlds.readers.gcode import read_gcode
from regionik.worlds.readers.text import (
    FileName,
    Many,
    Matrix3,
    OneLine,
    Positive,
    Strict,
    Vec3,
    Vec4,
    file_in,
    one_of,
)
from regionik.worlds.scene import Target, checked_name
from regionik.worlds.toolpath import (
    ToolPath,
    arc,
    divided_strokes,
    line,
    rotation_from_quaternion,
    sine,
    targets_along,
    transform_path,
    turn_along_path,
    turn_with_arc,
    with_leads,
)

MAX_SETPOINTS = 200_000  # a plan of so many can still be read back
POINT_TOLERANCE, AIM_TOLERANCE = 1e-6, 1e-9  # by which neighbouring set-points differ that are one [m], [1]
Count = Annotated[int, Field(ge=2, le=1_000_000)]


def _rotation_kind(value: Any) -> str:
    return "<matrix>" if isinstance(value, list) and value and isinstance(value[0], list) else "<quaternion>"


def _direction_kind(value: Any) -> str:
    return "<word>" if isinstance(value, str) else "<vector>"


class LeadPart(Strict):
    """A way along the tool's axis, with the tool down and off."""

    height: Positive = Field(description="a length [m]")
    speed: Positive | None = Field(default=None, description="greatest of the tool there [m/s]")


class _Aim(Strict):
    """Orientation of the tool, or how far it may deviate from a direction; frame, stroke, speed and flow."""

    frame: FrameReference | None = None
    orientation: (
        Annotated[
            Annotated[Vec4, Tag("<quaternion>")] | Annotated[Matrix3, Tag("<matrix>")],
            Discriminator(_rotation_kind),
        ]
        | None
    ) = None
    cone: Annotated[float, Field(gt=0, le=3.141592653589793)] | None = None
    x_axis: Literal["along_path"] | None = None
    stroke: Annotated[int, Field(ge=0)] | None = Field(
        default=None,
        description="neighbours of one number from 1 on are worked with the tool down all the way; 0: travel",
    )
    speed: Positive | None = Field(default=None, description="greatest of the tool at work [m/s]")
    lead: bool = Field(default=False, description="of its stroke, with the tool down and off")
    approach: LeadPart | None = Field(
        default=None, description="on which the tool comes down to each stroke, along its axis"
    )
    departure: LeadPart | None = Field(
        default=None, description="on which the tool leaves each stroke, along its axis"
    )
    flow: Annotated[float, Field(ge=0)] | None = Field(
        default=None, description="material fed per metre of the tool's way at work, in any unit"
    )


class ToolAim(_Aim):
    """Direction or orientation of the tool, both free where neither is given."""

    direction: Vec3 | None = None


class LineCurve(Strict):
    start: Vec3 = Field(alias="from", description="x, y, z [m]")
    end: Vec3 = Field(alias="to", description="x, y, z [m]")
    count: Count = Field(description="a number of set-points")


class SineCurve(LineCurve):
    amplitude: float = Field(description="a length [m]")
    periods: Positive = Field(description="a number of waves")
    phase: float = 0.0
    axis: Vec3 | None = None


class ArcCurve(Strict):
    center: Vec3 = Field(description="x, y, z [m]")
    radius: Positive = Field(description="a length [m]")
    start: float = Field(alias="from", description="an angle [rad]")
    end: float = Field(alias="to", description="an angle [rad]")
    rise: float = Field(default=0.0, description="a height climbed evenly [m]")
    count: Count = Field(description="a number of set-points")


class LinePiece(ToolAim):
    line: LineCurve

    def path(self, _folder: Path) -> ToolPath:
        return ToolPath(line(self.line.start, self.line.end, self.line.count))


class SinePiece(ToolAim):
    sine: SineCurve

    def path(self, _folder: Path) -> ToolPath:
        w = self.sine
        return ToolPath(sine(w.start, w.end, w.amplitude, w.periods, w.count, w.phase, w.axis))


class ArcPiece(ToolAim):
    """With ``follow`` the tool turns with the arc, from the direction or orientation given for angle 0."""

    arc: ArcCurve
    follow: bool = False

    def path(self, _folder: Path) -> ToolPath:
        a = self.arc
        return ToolPath(arc(a.center, a.radius, a.start, a.end, a.count, a.rise))


class PointsPiece(ToolAim):
    points: Annotated[Many[Vec3], Field(min_length=1)]
    names: Many[str] = Field(default=[], description="of the points, one each; empty for none")

    def path(self, _folder: Path) -> ToolPath:
        for k, name in enumerate(self.names):
            with located("", f"names[{k}]"):
                checked_name(name)
        return ToolPath(np.array(self.points), names=tuple(self.names))


class CsvColumns(Strict):
    """Titles of the columns: of x, y, z, of one way to aim at most, of names and of how it is worked."""

    x: OneLine = Field(description="a title")
    y: OneLine = Field(description="a title")
    z: OneLine = Field(description="a title")
    name: OneLine | None = Field(default=None, description="title of the column of names of set-points")
    stroke: OneLine | None = Field(default=None, description="title of the column of strokes, 0 for travel")
    speed: OneLine | None = Field(default=None, description="title of the column of speeds at work [m/s]")
    flow: OneLine | None = Field(default=None, description="title of the column of material fed per metre")
    dx: OneLine | None = None
    dy: OneLine | None = None
    dz: OneLine | None = None
    nx: OneLine | None = None
    ny: OneLine | None = None
    nz: OneLine | None = None
    qx: OneLine | None = None
    qy: OneLine | None = None
    qz: OneLine | None = None
    qw: OneLine | None = None
    roll: OneLine | None = None
    pitch: OneLine | None = None
    yaw: OneLine | None = Field(
        default=None, description="title of the column of an angle about a fixed axis"
    )


class CsvPiece(_Aim):
    direction: (
        Annotated[
            Annotated[Vec3, Tag("<vector>")] | Annotated[Normals, Tag("<word>")],
            Discriminator(_direction_kind),
        ]
        | None
    ) = None
    csv: FileName
    scale: Positive | None = None
    unit: LengthUnit | None = None
    angle_unit: AngleUnit | None = None
    columns: CsvColumns | None = None
    delimiter: Delimiter | None = None

    def path(self, folder: Path) -> ToolPath:
        columns = {} if self.columns is None else self.columns.model_dump(exclude_none=True)
        normals = self.direction if isinstance(self.direction, str) else None
        form = CsvFormat(columns, self.delimiter, self.unit, self.scale, self.angle_unit, normals)
        return read_csv(file_in(folder, self.csv), form)


class GcodePiece(ToolAim):
    """``chord`` is the largest distance of an arc from the chords it is cut into [m].

    The base goes on from set-point to set-point: moves at work that are longer than ``spacing`` are divided.
    """

    gcode: FileName
    chord: Positive = 0.0001
    spacing: Positive = Field(default=0.05, description="largest distance of set-points on strokes [m]")

    def path(self, folder: Path) -> ToolPath:
        path = read_gcode(file_in(folder, self.gcode), self.chord)
        length = np.linalg.norm(np.diff(path.points, axis=0), axis=1).sum()
        if length / self.spacing > MAX_SETPOINTS:
            raise InputError(f"spacing: expected at least {length / MAX_SETPOINTS:.3g} m for this path")
        return divided_strokes(path, self.spacing)


Piece = LinePiece | SinePiece | ArcPiece | PointsPiece | CsvPiece | GcodePiece
_KINDS = ("line", "sine", "arc", "points", "csv", "gcode")
PiecePart = Annotated[
    Annotated[LinePiece, Tag("<line>")]
    | Annotated[SinePiece, Tag("<sine>")]
    | Annotated[ArcPiece, Tag("<arc>")]
    | Annotated[PointsPiece, Tag("<points>")]
    | Annotated[CsvPiece, Tag("<csv>")]
    | Annotated[GcodePiece, Tag("<gcode>")],
    one_of(*_KINDS),
]


def read_task(
    parts: list[Piece], where: str, folder: Path, poses: Poses
) -> tuple[tuple[Target, ...], list[str]]:
    """Return the set-points of all pieces, and the place in the document that each comes from.

    ``poses`` are those of the frames that pieces may name.
    """
    paths: list[ToolPath] = []
    left = MAX_SETPOINTS
    for k, part in enumerate(parts):
        path = _path(part, where, f"task[{k}]", folder, left)
        left -= len(path.points)
        with located(where, f"task[{k}]."):
            paths.append(path if part.frame is None else transform_path(path, frame_pose(part.frame, poses)))
    targets: list[Target] = []
    places: list[str] = []
    for k, (part, path) in enumerate(zip(parts, _with_strokes(parts, paths), strict=True)):
        with located(where, f"task[{k}]."):
            targets += targets_along(path, Target.cone if part.cone is None else part.cone)
        places += [f"task[{k}]"] * len(path.points)
    return tuple(targets), places


def _with_strokes(parts: Sequence[Piece], paths: Sequence[ToolPath]) -> Iterator[ToolPath]:
    """Yield paths with strokes, if any has: numbers that are given, and above them those of files.

    A path that tells none is a stroke of its own.
    """
    highest = max((part.stroke or 0 for part in parts), default=0)
    for part, path in zip(parts, paths, strict=True):
        strokes = path.strokes
        if all(one.strokes is None for one in paths) or part.stroke is not None:
            yield path
            continue
        if strokes is None:
            strokes = np.ones(len(path.points), dtype=np.int64)
        numbered = np.where(strokes > 0, highest + strokes, 0)
        highest += int(strokes.max(initial=0))
        yield replace(path, strokes=numbered)


def without_repeats(task: tuple[Target, ...]) -> tuple[tuple[Target, ...], list[int]]:
    """Return set-points of which none is the one before it given again, and which those were, from 0.

    One with a name of its own is not.
    Where pieces meet end to start the tool would stand, while base and arm went from one posture of that
    point to another. Of travel and work at one point work is left, and of two strokes both are.
    """
    again, last = list[int](), 0
    for k in range(1, len(task)):
        one, other = task[last].stroke, task[k].stroke
        if not _is_same(task[last], task[k]) or (one and other and one != other):
            last = k
        elif one == 0 and other:
            again.append(last)
            last = k
        else:
            again.append(k)
    return tuple(np.delete(np.array(task, dtype=object), again)), again


def _is_same(one: Target, other: Target) -> bool:
    aims = (one.direction, other.direction), (one.orientation, other.orientation)
    return (
        other.name in ("", one.name)
        and float(np.linalg.norm(one.position - other.position)) <= POINT_TOLERANCE
        and one.cone == other.cone
        and all((a is None) == (b is None) for a, b in aims)
        and all(a is None or b is None or float(np.abs(a - b).max()) <= AIM_TOLERANCE for a, b in aims)
    )


def _path(part: Piece, where: str, place: str, folder: Path, most: int) -> ToolPath:
    """Return the path of a piece in its own frame, of so many points at most."""
    kind = next(kind for kind in _KINDS if hasattr(part, kind))
    with located(where, f"{place}.{kind}"):
        path = part.path(folder)
    with located(where, f"{place}."):
        path = _aimed(part, path) if len(path.points) <= most else path
    if len(path.points) > most:
        raise located_error(where, place, f"expected at most {MAX_SETPOINTS} set-points in all")
    return path


def _aimed(part: Piece, path: ToolPath) -> ToolPath:
    """Return a path with the direction or orientation of its piece, and with how that is worked."""
    own = path.directions is not None or path.orientations is not None
    direction = None if isinstance(part.direction, str) else part.direction  # a word has gone to the reader
    aims = {"direction": direction, "orientation": part.orientation}
    given = [key for key, value in aims.items() if value is not None]
    if own and given:
        raise InputError(f"{given[0]}: the CSV file has its own, leave this out")
    if len(given) > 1:
        raise InputError("direction: expected at most one of direction, orientation")
    if part.cone is not None and not own and not given:
        raise InputError("cone: needs a direction or an orientation beside it")
    n = len(path.points)
    if direction is not None:
        if np.linalg.norm(direction) < 1e-9:
            raise InputError("direction: must not be zero")
        path = replace(path, directions=np.tile(direction, (n, 1)))
    if part.orientation is not None:
        with located("", "orientation"):
            path = replace(path, orientations=np.tile(_rotation(part.orientation), (n, 1, 1)))
    if isinstance(part, ArcPiece) and part.follow:
        if not given:
            raise InputError("follow: needs a direction or an orientation beside it")
        path = turn_with_arc(path, part.arc.start, part.arc.end)
    path = _worked(part, path)
    path = path if part.x_axis is None else turn_along_path(path)
    ways = part.approach, part.departure
    if ways == (None, None):
        return path
    heights, speeds = zip(
        *((0.0, None) if way is None else (way.height, way.speed) for way in ways), strict=True
    )
    return with_leads(path, heights, (speeds[0] or math.inf, speeds[1] or math.inf))


def _worked(part: Piece, path: ToolPath) -> ToolPath:
    """Return a path with the stroke, the speed and the flow of its piece."""
    for key, own in (("stroke", path.strokes), ("speed", path.speeds), ("flow", path.flows)):
        if getattr(part, key) is not None and own is not None:
            raise InputError(f"{key}: the file has its own, leave this out")
    n = len(path.points)
    return replace(
        path,
        strokes=path.strokes if part.stroke is None else np.full(n, part.stroke),
        speeds=path.speeds if part.speed is None else np.full(n, part.speed),
        flows=path.flows if part.flow is None else np.full(n, part.flow),
        leads=np.ones(n, dtype=bool) if part.lead else path.leads,
    )


def _rotation(orientation: list[float] | list[list[float]]) -> Array:
    values = np.array(orientation)
    return check_rotation(values) if values.ndim == 2 else rotation_from_quaternion(values)


def task_to_document(task: tuple[Target, ...]) -> list[dict[str, Any]]:
    """Return the set-points as lists of points; neighbours that differ in place and name alone share one."""
    pieces: list[dict[str, Any]] = []
    for _, group in groupby(task, key=lambda target: repr(_aim(target))):
        targets = list(group)
        piece = {"points": [target.position.tolist() for target in targets], **_aim(targets[0])}
        names = [target.name for target in targets]
        pieces.append({**piece, "names": names} if any(names) else piece)
    return pieces


def _aim(target: Target) -> dict[str, Any]:
    own = {"stroke": target.stroke, "speed": target.speed, "flow": target.flow, "lead": target.lead or None}
    told = {key: value for key, value in own.items() if value is not None}
    if target.orientation is not None:
        return {"orientation": target.orientation.tolist(), "cone": float(target.cone), **told}
    if target.direction is not None:
        return {"direction": target.direction.tolist(), "cone": float(target.cone), **told}
    return told
