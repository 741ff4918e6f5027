"""The solids and visual surfaces of a robot in a world file: their grammar, reading and writing."""

from __future__ import annotations

import base64
from contextlib import suppress
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag

from regionik.worlds.arrays import Array
from regionik.worlds.chain import check_rotation, pose
from regionik.worlds.errors import InputError, located
from regionik.worlds.links import BASE, MAX_HULL_CORNERS, LinkBox, LinkCapsule, LinkHull, LinkSolid
from regionik.worlds.readers.text import Matrix4, OneLine, Positive, Size3, Strict, Vec3
from regionik.worlds.surfaces import VisualSurface

Packed = Annotated[str, Field(max_length=2**22)]  # base 64


class _Named(Strict):
    name: OneLine = Field(description="a name")


class _OnLink(Strict):
    link: Annotated[int, Field(ge=BASE)] = Field(
        description="the number of a joint, from 0; -1 for what is fixed to the base"
    )


class _Capsule(_Named):
    start: Vec3 = Field(description="x, y, z [m]")
    end: Vec3 = Field(description="x, y, z [m]")
    radius: Positive = Field(description="a length [m]")

    def on(self, link: int) -> LinkCapsule:
        return LinkCapsule(link, self.name, np.array(self.start), np.array(self.end), self.radius)


class _Box(_Named):
    size: Size3 = Field(description="three lengths [m]")
    position: Vec3 = Field(default=[0.0, 0.0, 0.0])
    rpy: Vec3 = Field(default=[0.0, 0.0, 0.0])

    def on(self, link: int) -> LinkBox:
        return LinkBox(link, self.name, pose(self.position, self.rpy), np.array(self.size))


class CapsulePart(_Capsule, _OnLink):
    """All points within ``radius`` of a segment in the link's frame."""

    def solid(self) -> LinkCapsule:
        return self.on(self.link)


class PosedBox(_Box, _OnLink):
    """A box by the position of its middle and its roll, pitch, yaw in the link's frame."""

    def solid(self) -> LinkBox:
        return self.on(self.link)


class ToolCapsule(_Capsule):
    """All points within ``radius`` of a segment in the flange's frame."""


class ToolBox(_Box):
    """A box by the position of its middle and its roll, pitch, yaw in the flange's frame."""


class FramedBox(_Named, _OnLink):
    """A box as `regionik.worlds.documents.world_file.world_to_document` writes it, exact to the last bit."""

    size: Size3 = Field(description="three lengths [m]")
    frame: Matrix4 = Field(description="the box's frame in the link, as a 4 x 4 matrix")

    def solid(self) -> LinkBox:
        return LinkBox(self.link, self.name, matrix(self.frame, "frame"), np.array(self.size))


class HullPart(_Named, _OnLink):
    """The convex hull of corners in the link's frame."""

    corners: Annotated[list[Vec3], Field(min_length=4, max_length=MAX_HULL_CORNERS)] = Field(
        description="corners x, y, z [m]"
    )

    def solid(self) -> LinkHull:
        return LinkHull(self.link, self.name, np.array(self.corners))


_OWN_KEYS = {
    "<capsule>": {"start", "end", "radius"},
    "<posed>": {"size", "position", "rpy", "frame"},
    "<hull>": {"corners"},
}


def _tool_solid_kind(value: Any) -> str | None:
    kind = _solid_kind(value)
    return kind if kind in ("<capsule>", "<posed>") else None


def _solid_kind(value: Any) -> str | None:
    keys = set(value) if isinstance(value, dict) else set()
    kinds = [kind for kind, own in _OWN_KEYS.items() if keys & own]
    if len(kinds) != 1:
        return None
    return "<framed>" if "frame" in keys else kinds[0]


LinkSolidPart = Annotated[
    Annotated[CapsulePart, Tag("<capsule>")]
    | Annotated[PosedBox, Tag("<posed>")]
    | Annotated[FramedBox, Tag("<framed>")]
    | Annotated[HullPart, Tag("<hull>")],
    Discriminator(
        _solid_kind,
        custom_error_type="kind",
        custom_error_message="expected link, name and either start, end, radius (a capsule)"
        " or size, position, rpy (a box) or corners (a hull)",
    ),
]


ToolSolidPart = Annotated[
    Annotated[ToolCapsule, Tag("<capsule>")] | Annotated[ToolBox, Tag("<posed>")],
    Discriminator(
        _tool_solid_kind,
        custom_error_type="kind",
        custom_error_message="expected name and either start, end, radius (a capsule)"
        " or size, position, rpy (a box)",
    ),
]


class VisualPart(_OnLink):
    """A coloured surface, which pictures show."""

    color: Annotated[int, Field(ge=0, le=0xFFFFFF)] = Field(description="red, green and blue, a byte each")
    vertices: Packed = Field(description="x, y, z of each vertex in the link's frame [m], floats of 4 bytes")
    faces: Packed = Field(description="vertices of each triangle, whole numbers of 4 bytes")

    stands_for: list[OneLine] = Field(default=[], description="solids that are not shown beside it")

    def surface(self) -> VisualSurface:
        vertices, faces = _unpacked(self.vertices, "<f4", "vertices"), _unpacked(self.faces, "<u4", "faces")
        return VisualSurface(self.link, self.color, vertices, faces, tuple(self.stands_for))


def _unpacked(text: str, kind: str, what: str) -> NDArray[Any]:
    """Return rows of three numbers from their bytes in base 64."""
    with suppress(ValueError):
        return np.frombuffer(base64.b64decode(text, validate=True), kind).reshape(-1, 3)
    raise InputError(f"{what}: expected rows of three numbers, 12 bytes each, in base 64")


def visual_document(surface: VisualSurface) -> dict[str, Any]:
    """Return plain values from which the surface is read, its vertices rounded to single precision."""
    packed = {
        key: base64.b64encode(values.astype(kind).tobytes()).decode("ascii")
        for key, values, kind in (("vertices", surface.vertices, "<f4"), ("faces", surface.faces, "<u4"))
    }
    names = {"stands_for": list(surface.stands_for)} if surface.stands_for else {}
    return {"link": surface.link, "color": surface.color, **packed, **names}


def matrix(rows: list[list[float]], what: str) -> Array:
    """Return a homogeneous matrix from its rows, or raise an `InputError` where it is no rigid transform."""
    T = np.array(rows)
    with located("", what):
        check_rotation(T[:3, :3])
        if not np.array_equal(T[3], [0, 0, 0, 1]):
            raise InputError(f"expected 0, 0, 0, 1 as last row, got {T[3].tolist()}")
    return T


def solid_document(solid: LinkSolid) -> dict[str, Any]:
    """Return plain values from which an equal solid is read."""
    document: dict[str, Any] = {"link": solid.link, "name": solid.name}
    if isinstance(solid, LinkCapsule):
        ends = {"start": solid.start.tolist(), "end": solid.end.tolist()}
        return {**document, **ends, "radius": float(solid.radius)}
    if isinstance(solid, LinkHull):
        return {**document, "corners": solid.corners.tolist()}
    return {**document, "size": solid.size.tolist(), "frame": solid.T_link_box.tolist()}
