"""Meshes: triangles of STL, OBJ, PLY and OFF files, and of COLLADA files with their colours.

URDF files often name COLLADA files as meshes of links. As in the tools of ROS, the unit is applied and the up
axis is not.
"""

from __future__ import annotations

import logging
import struct
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from regionik.worlds.arrays import Array, Index, transform_points
from regionik.worlds.chain import translation
from regionik.worlds.errors import InputError, located
from regionik.worlds.joints import Joint
from regionik.worlds.readers.text import MAX_NUMBER, reading
from regionik.worlds.readers.xml import Element, read_xml

SUFFIXES = (".stl", ".obj", ".ply", ".off")
_ENGINE_ERRORS = (  # that trimesh's readers raise on files that are cut short or no mesh at all
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    AttributeError,
    NameError,
    OverflowError,
    struct.error,
    OSError,
    ImportError,  # guessing the encoding of what is not text needs a package that is not installed
)

# trimesh logs its findings, with tracebacks; whoever gave the file gets one line.
logging.getLogger("trimesh").addHandler(logging.NullHandler())


def read_mesh(path: Path) -> tuple[Array, Index]:
    """Return the vertices (n, 3) and triangles (m, 3) of a mesh file."""
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        raise InputError(f"{path}: expected a mesh file that ends in {', '.join(SUFFIXES)}")
    with reading(path):
        data = path.read_bytes()
    try:
        import trimesh  # takes long to load

        with np.errstate(all="ignore"):  # non-finite numbers are for the caller
            mesh: Any = trimesh.load(BytesIO(data), file_type=kind[1:], force="mesh", skip_materials=True)
    except _ENGINE_ERRORS as error:
        why = "it is not text" if isinstance(error, ImportError) else " ".join(str(error).split())[:80]
        raise InputError(
            f"{path}: expected a mesh in {kind[1:].upper()} format that can be read whole ({why})"
        ) from None
    if not len(mesh.faces):
        raise InputError(f"{path}: expected a mesh with triangles, got none")
    if np.shape(mesh.vertices)[1:] != (3,):
        raise InputError(f"{path}: expected a mesh with x, y, z of each vertex")
    return np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)


COLLADA = ".dae"
MAX_POINTS = 2_000_000  # of a file that are placed, as a scene may show one geometry many times
MAX_OFFSET = 99  # of an input among those of a corner
_UNREAD_FACES = ("tristrips", "trifans")


class Surface(NamedTuple):
    """Triangles of one colour."""

    triangles: Array  # (m, 3, 3) [m]
    color: int | None  # 0xRRGGBB; None where the file gives none


class _Geometry(NamedTuple):
    """A geometry where a scene shows it."""

    shape: Element
    points: Array  # (n, 3) [m]
    materials: dict[str, str]  # by the symbols that its faces name


def read_geometries(path: Path) -> list[tuple[Array, Index | None]]:
    """Return vertices (n, 3) of each geometry of a COLLADA file as its scene places it [m], and triangles.

    Triangles (m, 3) are None where there are none, or where there are faces of kinds that are not read.
    """
    root = read_xml(path, "COLLADA")
    with located(str(path), ""):
        found = [(geometry.points, _whole_surface(geometry)) for geometry in _shown(root)]
        found = [(points, faces) for points, faces in found if len(points)]
        if not found or not all(np.isfinite(points).all() for points, _ in found):
            raise InputError("expected a mesh with finite vertices")
    return found


def _whole_surface(geometry: _Geometry) -> Index | None:
    groups = [child for mesh in geometry.shape.all("mesh") for child in mesh.children]
    if any(group.tag in _UNREAD_FACES or group.inside("ph") for group in groups):
        return None
    try:
        faces: Index = np.concatenate([np.empty((0, 3), np.int64), *(some for _, some in _faces(geometry))])
    except InputError:
        return None
    return faces if len(faces) else None


def read_surfaces(path: Path) -> list[Surface]:
    """Return the triangles of all geometries of a COLLADA file as its scene places them, by colour.

    Colours are the diffuse ones of materials; textures are not read.
    """
    root = read_xml(path, "COLLADA")
    with located(str(path), ""):
        colors = _material_colors(root)
        return [
            Surface(geometry.points[faces], colors.get(geometry.materials.get(symbol, symbol)))
            for geometry in _shown(root)
            for symbol, faces in _faces(geometry)
            if len(faces)
        ]


def _shown(root: Element) -> list[_Geometry]:
    """Return the geometries that a scene shows, where it shows them; all there are, where it shows none."""
    meter = _meter(root)
    scale = np.diag([meter, meter, meter, 1.0])
    geometries = root.inside("library_geometries", "geometry")
    clouds = {"#" + shape.attributes.get("id", ""): (shape, _vertices(shape)) for shape in geometries}
    placed: list[_Geometry] = []
    stack = [(scene, np.eye(4)) for scene in root.inside("library_visual_scenes", "visual_scene")]
    while stack:
        node, T = stack.pop()
        for one in node.all("instance_geometry"):
            if one.attributes.get("url", "") not in clouds:
                raise one.error("instance_geometry: expected the id of a geometry")
            shape, cloud = clouds[one.attributes["url"]]
            placed.append(_Geometry(shape, transform_points(scale @ T, cloud), _bound_materials(one)))
        if sum(len(geometry.points) for geometry in placed) > MAX_POINTS:
            raise node.error(f"expected at most {MAX_POINTS} points")
        stack += [(child, T @ _transform(child)) for child in node.all("node")]
    return placed or [_Geometry(shape, meter * cloud, {}) for shape, cloud in clouds.values()]


def _faces(geometry: _Geometry) -> Iterator[tuple[str, Index]]:
    """Yield the material of each group of faces, and its triangles (m, 3); polygons are cut into fans."""
    for mesh in geometry.shape.all("mesh"):
        for group in (child for child in mesh.children if child.tag in ("triangles", "polylist", "polygons")):
            inputs = list(group.all("input"))
            offsets = [_whole(one.attributes.get("offset", "0"), one) for one in inputs]
            semantics = [one.attributes.get("semantic") for one in inputs]
            vertex = [k for what, k in zip(semantics, offsets, strict=True) if what == "VERTEX"]
            if not vertex:
                raise group.error(f"{group.tag}: expected an input of vertices")
            lists = [_indices(element)[vertex[0] :: max(offsets) + 1] for element in group.all("p")]
            counts = [_indices(element) for element in group.all("vcount")]
            corners = np.concatenate([*lists, np.empty(0, dtype=np.int64)])
            sizes = counts[0] if counts else np.full(len(corners) // 3, 3)
            if group.tag == "polygons":
                sizes = np.array([len(one) for one in lists], dtype=np.int64)
            if sizes.sum() != len(corners) or (len(corners) and corners.max() >= len(geometry.points)):
                raise group.error(
                    f"{group.tag}: expected the corners of its polygons, each one of its points"
                )
            yield group.attributes.get("material", ""), _fans(corners, sizes)


def _fans(corners: Index, sizes: Index) -> Index:
    """Return polygons of some sizes, their corners one after the other, as triangles (m, 3)."""
    ends = np.cumsum(sizes)
    many = np.maximum(sizes - 2, 0)
    first = np.repeat(ends - sizes, many)
    step = np.arange(int(many.sum())) - np.repeat(np.cumsum(many) - many, many)
    triangles: Index = corners[np.column_stack([first, first + step + 1, first + step + 2])]
    return triangles


def _bound_materials(shown: Element) -> dict[str, str]:
    """Return the materials that a scene gives the symbols of a geometry."""
    path = ("bind_material", "technique_common", "instance_material")
    bound = (one.attributes for one in shown.inside(*path))
    return {one.get("symbol", ""): one.get("target", "").removeprefix("#") for one in bound}


def _material_colors(root: Element) -> dict[str, int]:
    """Return the diffuse colour of each material that has one, 0xRRGGBB."""
    effects: dict[str, int] = {}
    for effect in root.inside("library_effects", "effect"):
        shaders = (one for part in effect.inside("profile_COMMON", "technique") for one in part.children)
        for color in (color for one in shaders for color in one.inside("diffuse", "color")):
            red, green, blue = (np.clip(_numbers("".join(color.texts), color)[:3], 0, 1) * 255).round()
            effects["#" + effect.attributes.get("id", "")] = int(red) << 16 | int(green) << 8 | int(blue)
    return {
        material.attributes.get("id", ""): effects[one.attributes.get("url", "")]
        for material in root.inside("library_materials", "material")
        for one in material.all("instance_effect")
        if one.attributes.get("url", "") in effects
    }


def _whole(text: str, element: Element) -> int:
    if not text.strip().isdecimal() or int(text) > MAX_OFFSET:
        raise element.error(f"{element.tag}: expected an offset up to {MAX_OFFSET}")
    return int(text)


def _indices(element: Element) -> Index:
    values = _numbers("".join(element.texts), element)
    found: Index = values.astype(np.int64)
    if (found != values).any() or (found < 0).any():
        raise element.error(f"{element.tag}: expected whole numbers from 0")
    return found


def _meter(root: Element) -> float:
    unit = next(iter(root.inside("asset", "unit")), None)
    if unit is None:
        return 1.0
    value = _numbers(unit.attributes.get("meter", "1"), unit)
    if len(value) != 1 or not 0 < value[0] <= MAX_NUMBER:
        raise unit.error("unit: expected meter above 0")
    return float(value[0])


def _vertices(geometry: Element) -> Array:
    """Return the positions of a geometry's vertices, (n, 3)."""
    sources = {"#" + source.attributes.get("id", ""): source for source in geometry.inside("mesh", "source")}
    clouds = [np.empty((0, 3))]
    for given in geometry.inside("mesh", "vertices", "input"):
        if given.attributes.get("semantic") != "POSITION":
            continue
        source = sources.get(given.attributes.get("source", ""))
        numbers = None if source is None else source.first("float_array")
        if numbers is None:
            raise given.error("vertices: expected the id of a source of numbers")
        values = _numbers("".join(numbers.texts), numbers)
        if len(values) % 3:
            raise numbers.error(f"expected three numbers a vertex, got {len(values)}")
        clouds.append(values.reshape(-1, 3))
    return np.concatenate(clouds)


def _transform(node: Element) -> Array:
    """Return the transform of a node in its parent, (4, 4)."""
    T = np.eye(4)
    for step in node.children:
        if step.tag not in _STEPS:
            continue
        count, make = _STEPS[step.tag]
        values = _numbers("".join(step.texts), step)
        if len(values) != count:
            raise step.error(f"{step.tag}: expected {count} numbers, got {len(values)}")
        with located("", f"line {step.line}"):
            T = T @ make(values)
    return T


def _rotate(values: Array) -> Array:
    if not np.linalg.norm(values[:3]) > 1e-9:
        raise InputError("rotate: axis must not be zero")
    turn = Joint("rotate", "revolute", -np.inf, np.inf, np.eye(4), values[:3])
    return turn.transform(np.radians(values[3]))


_STEPS: dict[str, tuple[int, Callable[[Array], Array]]] = {
    "matrix": (16, lambda values: values.reshape(4, 4)),
    "translate": (3, lambda values: translation(*values)),
    "rotate": (4, _rotate),
    "scale": (3, lambda values: np.diag([*values, 1.0])),
}


def _numbers(text: str, element: Element) -> Array:
    try:
        values = np.array(text.split(), dtype=np.float64)
    except ValueError:
        values = np.array([np.nan])
    if not np.isfinite(values).all() or np.abs(values).max(initial=0.0) > MAX_NUMBER:
        raise element.error(f"{element.tag}: expected finite numbers of at most {MAX_NUMBER:g} in size")
    return values
