"""Floor and obstacles of a world file: their grammar, reading and writing.

A form of obstacle is a model whose ``solid`` gives the obstacle and whose `solid_to_document` case writes it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, Tag
from shapely.geometry import Polygon

from regionik.worlds.arrays import Array
from regionik.worlds.chain import pose
from regionik.worlds.documents.frames import FrameReference, Poses, frame_pose
from regionik.worlds.documents.scans import CloudShape, OctomapShape
from regionik.worlds.errors import InputError, located, read_each
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Solid, Sphere, as_polygon
from regionik.worlds.readers.meshes import read_mesh
from regionik.worlds.readers.moveit_scene import read_scene
from regionik.worlds.readers.occupancy_map import load_map
from regionik.worlds.readers.text import (
    FileName,
    Many,
    NotNegative,
    OneLine,
    Positive,
    Size3,
    Strict,
    Vec2,
    Vec3,
    file_in,
    one_of,
)
from regionik.worlds.scene import Floor
from regionik.worlds.zones import Keep, Zone

Ring = Annotated[Many[Vec2], Field(min_length=3)]
Range = Annotated[list[float], Field(min_length=2, max_length=2)]
HUGE_MESH, HUGE_MESH_SHARE = 10.0, 2.0  # sizes of mesh files that are told: at least [m], and of the floor's
_UPRIGHT = 1e-9  # by which the cosine of a frame's tilt may be off
Corner = Annotated[int, Field(ge=0)]


class BoxShape(Strict):
    size: Size3 = Field(description="three lengths [m]")
    center: Vec3 = Field(description="x, y, z [m]")
    yaw: float = 0.0

    def solid(self, name: str, _folder: Path) -> Box:
        return Box(name, np.array(self.size), np.array(self.center), self.yaw)


class CylinderShape(Strict):
    radius: Positive = Field(description="a length [m]")
    height: Positive = Field(description="a length [m]")
    center: Vec3 = Field(description="x, y, z [m]")

    def solid(self, name: str, _folder: Path) -> Cylinder:
        return Cylinder(name, self.radius, self.height, np.array(self.center))


class SphereShape(Strict):
    radius: Positive = Field(description="a length [m]")
    center: Vec3 = Field(description="x, y, z [m]")

    def solid(self, name: str, _folder: Path) -> Sphere:
        return Sphere(name, self.radius, np.array(self.center))


class PrismShape(Strict):
    polygon: Ring = Field(description="corners [[x, y], ...] [m]")
    holes: Many[Ring] = []
    z: Range = Field(description="bottom and top [m]")

    def solid(self, name: str, _folder: Path) -> Prism:
        bottom, top = self.z
        if not bottom < top:
            raise InputError(f"z: expected bottom below top, got [{bottom:g}, {top:g}]")
        return Prism(name, as_polygon(Polygon(self.polygon, self.holes), "polygon"), bottom, top)


class MapCell(PrismShape):
    """A blob of map cells, as written by `regionik.worlds.documents.world_file.world_to_document`."""

    name: OneLine


_SHEET = "a surface without an inside, such as a skin or a scan, which need not be closed"


class MeshFile(Strict):
    file: FileName = Field(description="an STL, OBJ, PLY or OFF file")
    position: Vec3 = [0.0, 0.0, 0.0]
    rpy: Vec3 = [0.0, 0.0, 0.0]
    scale: Positive = 1.0
    sheet: bool = Field(default=False, description=_SHEET)

    def solid(self, name: str, folder: Path) -> Mesh:
        with located("file", ""):
            vertices, faces = read_mesh(file_in(folder, self.file))
            mesh = Mesh(name, vertices * self.scale, faces, self.sheet)
            return _closed(mesh.transformed(pose(self.position, self.rpy)))


class MeshInline(Strict):
    vertices: Annotated[Many[Vec3], Field(min_length=3)] = Field(description="points [[x, y, z], ...] [m]")
    faces: Annotated[
        Many[Annotated[list[Corner], Field(min_length=3, max_length=3)]], Field(min_length=1)
    ] = Field(description="triangles [[i, j, k], ...]")
    sheet: bool = Field(default=False, description=_SHEET)

    def solid(self, name: str, _folder: Path) -> Mesh:
        with located("faces", ""):
            return _closed(Mesh(name, np.array(self.vertices), np.array(self.faces), self.sheet))


MeshShape = Annotated[
    Annotated[MeshFile, Tag("<file>")] | Annotated[MeshInline, Tag("<vertices>")], one_of("file", "vertices")
]


class _NamedObstacle(Strict):
    name: OneLine = Field(description="a name")
    clearance: NotNegative | None = Field(
        default=None, description="what the base keeps from it in place of rules.clearance [m]"
    )
    frame: FrameReference | None = None


class BoxObstacle(_NamedObstacle):
    box: BoxShape


class CylinderObstacle(_NamedObstacle):
    cylinder: CylinderShape


class SphereObstacle(_NamedObstacle):
    sphere: SphereShape


class PrismObstacle(_NamedObstacle):
    prism: PrismShape


class MeshObstacle(_NamedObstacle):
    mesh: MeshShape


class CloudObstacle(_NamedObstacle):
    cloud: CloudShape


class OctomapObstacle(_NamedObstacle):
    octomap: OctomapShape


ObstaclePart = Annotated[
    Annotated[BoxObstacle, Tag("<box>")]
    | Annotated[CylinderObstacle, Tag("<cylinder>")]
    | Annotated[SphereObstacle, Tag("<sphere>")]
    | Annotated[PrismObstacle, Tag("<prism>")]
    | Annotated[MeshObstacle, Tag("<mesh>")]
    | Annotated[CloudObstacle, Tag("<cloud>")]
    | Annotated[OctomapObstacle, Tag("<octomap>")],
    one_of("box", "cylinder", "sphere", "prism", "mesh", "cloud", "octomap"),
]


class PolygonFloor(Strict):
    polygon: Ring = Field(description="corners [[x, y], ...] [m]")
    holes: Many[Ring] = []
    cells: Many[MapCell] = []


class MapFloor(Strict):
    """A ROS map; ``free_thresh`` replaces the map's own."""

    map: FileName = Field(description="a map_server YAML file")
    height: Positive = 1.0
    free_thresh: Annotated[float, Field(ge=0, le=1)] | None = None


FloorPart = Annotated[
    Annotated[PolygonFloor, Tag("<polygon>")] | Annotated[MapFloor, Tag("<map>")], one_of("polygon", "map")
]


class ZonePart(Strict):
    """A zone of the floor that the base stays inside or outside."""

    name: OneLine = Field(description="a name")
    keep: Keep = Field(description="in: the footprint stays inside; out: it stays outside")
    polygon: Ring = Field(description="corners [[x, y], ...] [m]")
    holes: Many[Ring] = []

    def zone(self) -> Zone:
        """The zone itself."""
        return Zone(self.name, self.keep, as_polygon(Polygon(self.polygon, self.holes), "polygon"))


def read_floor(part: PolygonFloor | MapFloor, where: str, folder: Path) -> Floor:
    """Return the floor of a document that messages call ``where``; files are relative to ``folder``."""
    if isinstance(part, MapFloor):
        with located(where, "floor.map"):
            return load_map(file_in(folder, part.map), part.height, part.free_thresh)
    with located(where, "floor."):
        polygon = as_polygon(Polygon(part.polygon, part.holes), "polygon")
    return Floor(
        polygon, read_each(where, "floor.cells", part.cells, lambda cell: cell.solid(cell.name, folder))
    )


def read_obstacle(
    part: _NamedObstacle, where: str, place: str, folder: Path, poses: Poses
) -> tuple[Solid, ...]:
    """Return an obstacle, the boxes of a scan; ``place`` is where it stands in the document.

    ``poses`` are those of the document's frames.
    """
    (kind,) = part.model_fields_set - {"name", "frame", "clearance"}
    shape = getattr(part, kind)
    with located(where, f"{place}."):
        T = np.eye(4) if part.frame is None else frame_pose(part.frame, poses)
        if not isinstance(shape, MeshFile | MeshInline | SphereShape | CloudShape):
            _check_upright(kind, T)
    if isinstance(shape, CloudShape | OctomapShape):
        with located(where, f"{place}.{kind}."):
            solids: tuple[Solid, ...] = shape.solids(part.name, folder, T)
    else:
        with located(where, f"{place}.{kind}."):
            solid = shape.solid(part.name, folder)
        solids = (solid if part.frame is None else solid.transformed(T),)
    if part.clearance is not None:
        with located(where, f"{place}."):
            solids = tuple(replace(solid, clearance=part.clearance) for solid in solids)
    return solids


def _check_upright(kind: str, T: Array) -> None:
    if T[2, 2] < 1 - _UPRIGHT:
        one = f"an {kind}" if kind == "octomap" else f"a {kind}"
        raise InputError(f"frame: {one} stands upright, expected a frame that turns about z alone")


class MoveItScene(Strict):
    """A scene file of MoveIt, whose objects become obstacles."""

    file: FileName = Field(description="a .scene file of MoveIt")
    frame: FrameReference | None = Field(default=None, description="its planning frame")

    def solids(self, where: str, folder: Path, poses: Poses) -> tuple[Solid, ...]:
        with located(where, "moveit_scene.file"):
            solids = read_scene(file_in(folder, self.file))
        if self.frame is None:
            return tuple(solids)
        with located(where, "moveit_scene."):
            T = frame_pose(self.frame, poses)
            for one in solids:
                if not isinstance(one, Mesh | Sphere):
                    _check_upright(type(one).__name__.lower(), T)
            return tuple(one.transformed(T) for one in solids)


def huge_meshes(
    parts: Iterable[_NamedObstacle], groups: Iterable[Sequence[Solid]], floor: Floor
) -> Iterator[str]:
    """Yield a note on each obstacle of a mesh file that is far larger than the floor.

    ``groups`` are the solids of each of ``parts``.
    """
    x0, y0, x1, y1 = floor.polygon.bounds
    for part, (solid, *_) in zip(parts, groups, strict=True):
        from_file = isinstance(part, MeshObstacle) and isinstance(part.mesh, MeshFile)
        size = float(np.ptp(np.array(solid.bounds), axis=0).max()) if from_file else 0.0
        if size > max(HUGE_MESH, HUGE_MESH_SHARE * float(np.hypot(x1 - x0, y1 - y0))):
            yield (
                f"obstacle {solid.name} is {size:.3g} m in size: perhaps in millimetres, "
                "for which its mesh wants scale: 0.001"
            )


def _closed(mesh: Mesh) -> Mesh:
    if not (mesh.sheet or mesh.is_closed):
        raise InputError(
            "expected a closed surface, every edge in two triangles; a skin or a scan, which has no inside, "
            "is read with sheet: true"
        )
    return mesh


# --- writing


def floor_to_document(floor: Floor) -> dict[str, Any]:
    """Return plain values from which an equal floor is read."""
    document = _rings(floor.polygon)
    if floor.cells:
        document["cells"] = [{"name": cell.name, **_prism(cell)} for cell in floor.cells]
    return document


def zone_to_document(zone: Zone) -> dict[str, Any]:
    """Return plain values from which an equal zone is read."""
    return {"name": zone.name, "keep": zone.keep, **_rings(zone.polygon)}


def solid_to_document(solid: Solid) -> dict[str, Any]:
    """Return plain values from which an equal obstacle is read."""
    match solid:
        case Box(size=size, center=center):
            shape = {"box": {"size": size.tolist(), "center": center.tolist(), "yaw": float(solid.yaw)}}
        case Cylinder(radius=radius, height=height, center=center):
            sizes = {"radius": float(radius), "height": float(height)}
            shape = {"cylinder": {**sizes, "center": center.tolist()}}
        case Sphere(radius=radius, center=center):
            shape = {"sphere": {"radius": float(radius), "center": center.tolist()}}
        case Prism():
            shape = {"prism": _prism(solid)}
        case Mesh(vertices=vertices, faces=faces, sheet=sheet):
            surface = {"vertices": vertices.tolist(), "faces": faces.tolist()}
            shape = {"mesh": surface | ({"sheet": True} if sheet else {})}
    own = {} if solid.clearance is None else {"clearance": float(solid.clearance)}
    return {"name": solid.name, **own, **shape}


def _prism(solid: Prism) -> dict[str, Any]:
    return {**_rings(solid.polygon), "z": [float(solid.bottom), float(solid.top)]}


def _rings(polygon: Polygon) -> dict[str, Any]:
    document: dict[str, Any] = {"polygon": _corners(polygon.exterior.coords)}
    if polygon.interiors:
        document["holes"] = [_corners(ring.coords) for ring in polygon.interiors]
    return document


def _corners(coordinates: Any) -> list[list[float]]:
    return [[x, y] for x, y, *_ in list(coordinates)[:-1]]
