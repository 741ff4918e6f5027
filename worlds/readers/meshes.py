"""Meshes: triangles of STL, OBJ, PLY and OFF files, vertices of COLLADA files.

URDF files often name COLLADA files as meshes of links. Their faces are not read. As in the tools of ROS, the
unit is applied and the up axis is not.
"""

from __future__ import annotations

import logging
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regionik.worlds.arrays import Array, transform_points
from regionik.worlds.chain import Joint, translation
from regionik.worlds.errors import InputError, located
from regionik.worlds.readers.text import Element, clip, read_xml
from regionik.worlds.readers.validation import LARGEST

SUFFIXES = (".stl", ".obj", ".ply", ".off")
MESH_LIMIT = 256 * 2**20  # [bytes]
COLLADA = ".dae"
COLLADA_LIMIT = 64 * 2**20  # [bytes]
_PLACED_LIMIT = 2_000_000  # points of a COLLADA file, as a scene may show one geometry many times
LINES_LIMIT = 1_000_000  # of OBJ and OFF files, which are read far more slowly
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


def read_mesh(path: Path) -> tuple[Array, NDArray[np.int64]]:
    """Return the vertices (n, 3) and triangles (m, 3) of a mesh file.

    Raises
    ------
    InputError
        Names the file and what was expected.
    """
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        raise InputError(f"{path}: expected a mesh file that ends in {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    if path.stat().st_size > MESH_LIMIT:
        raise InputError(f"{path}: expected at most {MESH_LIMIT / 2**20:g} MB")
    try:
        if kind in (".obj", ".off"):
            _check_line_count(path)
        with path.open("rb") as stream, np.errstate(all="ignore"):  # non-finite numbers are for the caller
            import trimesh  # takes long to load

            mesh: Any = trimesh.load(stream, file_type=kind[1:], force="mesh", skip_materials=True)
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


def _check_line_count(path: Path) -> None:
    with path.open("rb") as stream:
        count = sum(1 for _ in stream)
    if count > LINES_LIMIT:
        raise InputError(f"{path}: expected at most {LINES_LIMIT} lines, got {count}; STL may hold more")


# --- COLLADA


def read_points(path: Path) -> Array:
    """Return the vertices (n, 3) of all geometries of a COLLADA file as its scene places them [m].

    Raises
    ------
    InputError
        Names the file, the line and what was expected.
    """
    root = read_xml(path, COLLADA_LIMIT)
    with located(str(path), ""):
        if root.tag != "COLLADA":
            raise root.error(f"expected <COLLADA> as first element, got <{clip(root.tag)[1:-1]}>")
        meter = _meter(root)
        geometries = root.inside("library_geometries", "geometry")
        clouds = {"#" + shape.attributes.get("id", ""): _vertices(shape) for shape in geometries}
        found = _placed_clouds(root, clouds) or list(clouds.values())
        points: Array = meter * np.concatenate([*found, np.empty((0, 3))])
        if not len(points) or not np.isfinite(points).all():
            raise InputError("expected a mesh with finite vertices")
    return points


def _placed_clouds(root: Element, clouds: dict[str, Array]) -> list[Array]:
    """Return the vertices of each geometry that a scene shows, where it shows them."""
    placed: list[Array] = []
    stack = [(scene, np.eye(4)) for scene in root.inside("library_visual_scenes", "visual_scene")]
    while stack:
        node, T = stack.pop()
        for shown in node.all("instance_geometry"):
            cloud = clouds.get(shown.attributes.get("url", ""))
            if cloud is None:
                raise shown.error("instance_geometry: expected the id of a geometry")
            placed.append(transform_points(T, cloud))
        if sum(map(len, placed)) > _PLACED_LIMIT:
            raise node.error(f"expected at most {_PLACED_LIMIT} points")
        stack += [(child, T @ _transform(child)) for child in node.all("node")]
    return placed


def _meter(root: Element) -> float:
    unit = next(iter(root.inside("asset", "unit")), None)
    if unit is None:
        return 1.0
    value = _numbers(unit.attributes.get("meter", "1"), unit)
    if len(value) != 1 or not 0 < value[0] <= LARGEST:
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
    if not np.isfinite(values).all() or np.abs(values).max(initial=0.0) > LARGEST:
        raise element.error(f"{element.tag}: expected finite numbers of at most {LARGEST:g} in size")
    return values
