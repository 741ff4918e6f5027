"""The task part of a document -> set-points in order."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.chain import pose
from regionik.worlds.documents import world_schema
from regionik.worlds.documents.robot_reader import rotation
from regionik.worlds.readers.csv_path import read_csv
from regionik.worlds.readers.validation import at, wrong
from regionik.worlds.scene import Target
from regionik.worlds.toolpath import (
    ToolPath,
    arc,
    following,
    line,
    moved,
    rotation_from_quaternion,
    sine,
    targets_along,
)

SETPOINTS_LIMIT = 200_000  # a plan of so many can still be read back


def build_task(
    parts: list[world_schema.Piece], where: str, folder: Path
) -> tuple[tuple[Target, ...], list[str]]:
    """Set-points of all pieces, and the place in the document that each comes from."""
    targets: list[Target] = []
    places: list[str] = []
    for k, part in enumerate(parts):
        place = f"task[{k}]"
        found = _piece(part, where, place, folder, SETPOINTS_LIMIT - len(targets))
        targets.extend(found)
        places.extend([place] * len(found))
    return tuple(targets), places


def _piece(part: world_schema.Piece, where: str, place: str, folder: Path, most: int) -> tuple[Target, ...]:
    path = _path(part, where, place, folder)
    if len(path.points) > most:
        raise wrong(where, place, f"expected at most {SETPOINTS_LIMIT} set-points in all")
    own = path.directions is not None or path.orientations is not None
    for key in ("direction", "orientation"):
        if own and getattr(part, key) is not None:
            raise wrong(where, f"{place}.{key}", "the CSV file has its own, leave this out")
    if part.direction is not None and part.orientation is not None:
        raise wrong(where, place, "expected at most one of direction, orientation")
    if part.cone is not None and not own and part.direction is None and part.orientation is None:
        raise wrong(where, f"{place}.cone", "needs a direction or an orientation beside it")
    n = len(path.points)
    if part.direction is not None:
        if np.linalg.norm(part.direction) < 1e-9:
            raise wrong(where, f"{place}.direction", "must not be zero")
        path = ToolPath(path.points, directions=np.tile(part.direction, (n, 1)))
    if part.orientation is not None:
        with at(where, f"{place}.orientation"):
            path = ToolPath(path.points, orientations=np.tile(_turn(part.orientation), (n, 1, 1)))
    if isinstance(part, world_schema.ArcPiece) and part.follow:
        if part.direction is None and part.orientation is None:
            raise wrong(where, f"{place}.follow", "needs a direction or an orientation beside it")
        path = following(path, part.arc.start, part.arc.end)
    return targets_along(path, Target.cone if part.cone is None else part.cone)


def _path(part: world_schema.Piece, where: str, place: str, folder: Path) -> ToolPath:
    match part:
        case world_schema.PointsPiece(points=points):
            return ToolPath(np.array(points))
        case world_schema.CsvPiece(frame=frame):
            with at(where, f"{place}.csv"):
                return moved(read_csv(folder / part.csv), pose(frame.position, frame.rpy), part.scale)
        case world_schema.LinePiece(line=p):
            with at(where, f"{place}.line"):
                return ToolPath(line(p.start, p.end, p.count))
        case world_schema.SinePiece(sine=w):
            with at(where, f"{place}.sine"):
                return ToolPath(sine(w.start, w.end, w.amplitude, w.periods, w.count, w.phase, w.axis))
        case _:
            with at(where, f"{place}.arc"):
                a = part.arc
                return ToolPath(arc(a.center, a.radius, a.start, a.end, a.count, a.rise))


def _turn(orientation: list[float] | list[list[float]]) -> Array:
    values = np.array(orientation)
    return rotation(values) if values.ndim == 2 else rotation_from_quaternion(values)
