"""Vertices of COLLADA files, which many URDF files name as meshes of their links.

Faces are not read. As in the tools of ROS, the unit is applied and the up axis is not.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.chain import Joint, translation
from regionik.worlds.errors import InputError, located, located_error
from regionik.worlds.readers.text import clip
from regionik.worlds.readers.validation import LARGEST
from regionik.worlds.readers.xml import Element, read_xml

SUFFIX = ".dae"
COLLADA_LIMIT = 64 * 2**20  # [bytes]
_PLACED_LIMIT = 2_000_000  # points, as a scene may show one geometry many times


def read_points(path: Path) -> Array:
    """Return the vertices (n, 3) of all geometries as the file's scene places them [m].

    Raises
    ------
    InputError
        Names the file, the line and what was expected.
    """
    where = str(path)
    root = read_xml(path, COLLADA_LIMIT)
    if root.tag != "COLLADA":
        raise located_error(
            where, f"line {root.line}", f"expected <COLLADA> as first element, got <{clip(root.tag)[1:-1]}>"
        )
    meter = _meter(root, where)
    clouds = {
        "#" + shape.attributes.get("id", ""): _points(shape, where)
        for shape in root.inside("library_geometries", "geometry")
    }
    scenes = root.inside("library_visual_scenes", "visual_scene")
    placed: list[Array] = []
    stack = [(scene, np.eye(4)) for scene in scenes]
    while stack:
        node, T = stack.pop()
        for shown in node.all("instance_geometry"):
            cloud = clouds.get(shown.attributes.get("url", ""))
            if cloud is None:
                raise located_error(
                    where, f"line {shown.line}", "instance_geometry: expected the id of a geometry"
                )
            placed.append(cloud @ T[:3, :3].T + T[:3, 3])
        if sum(map(len, placed)) > _PLACED_LIMIT:
            raise located_error(where, f"line {node.line}", f"expected at most {_PLACED_LIMIT} points")
        stack += [(child, T @ _transform(child, where)) for child in node.all("node")]
    found = placed or list(clouds.values())
    points: Array = meter * np.concatenate([*found, np.empty((0, 3))])
    if not len(points) or not np.isfinite(points).all():
        raise located_error(where, "", "expected a mesh with finite vertices")
    return points


def _meter(root: Element, where: str) -> float:
    unit = next(iter(root.inside("asset", "unit")), None)
    if unit is None:
        return 1.0
    value = _numbers(unit.attributes.get("meter", "1"), where, unit)
    if len(value) != 1 or not 0 < value[0] <= LARGEST:
        raise located_error(where, f"line {unit.line}", "unit: expected meter above 0")
    return float(value[0])


def _points(geometry: Element, where: str) -> Array:
    """Return the positions of a geometry's vertices, (n, 3)."""
    sources = {"#" + source.attributes.get("id", ""): source for source in geometry.inside("mesh", "source")}
    clouds = [np.empty((0, 3))]
    for given in geometry.inside("mesh", "vertices", "input"):
        if given.attributes.get("semantic") != "POSITION":
            continue
        source = sources.get(given.attributes.get("source", ""))
        numbers = None if source is None else source.first("float_array")
        if numbers is None:
            raise located_error(
                where, f"line {given.line}", "vertices: expected the id of a source of numbers"
            )
        values = _numbers("".join(numbers.texts), where, numbers)
        if len(values) % 3:
            raise located_error(
                where, f"line {numbers.line}", f"expected three numbers a vertex, got {len(values)}"
            )
        clouds.append(values.reshape(-1, 3))
    return np.concatenate(clouds)


def _transform(node: Element, where: str) -> Array:
    """Return the transform of a node in its parent, (4, 4)."""
    T = np.eye(4)
    for step in node.children:
        if step.tag not in _STEPS:
            continue
        count, make = _STEPS[step.tag]
        values = _numbers("".join(step.texts), where, step)
        if len(values) != count:
            raise located_error(
                where, f"line {step.line}", f"{step.tag}: expected {count} numbers, got {len(values)}"
            )
        with located(where, f"line {step.line}"):
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


def _numbers(text: str, where: str, element: Element) -> Array:
    try:
        values = np.array(text.split(), dtype=np.float64)
    except ValueError:
        values = np.array([np.nan])
    if not np.isfinite(values).all() or np.abs(values).max(initial=0.0) > LARGEST:
        text = f"{element.tag}: expected finite numbers of at most {LARGEST:g} in size"
        raise located_error(where, f"line {element.line}", text)
    return values
