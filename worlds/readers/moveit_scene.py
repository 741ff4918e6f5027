"""Scenes of MoveIt: the text files that its planning scenes and RViz's scene objects are saved in.

A file names its scene, then each object after a star: its pose where it is of MoveIt 1.1 or later, its shapes
with a pose and a colour each, and its subframes. A point ends it.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from regionik.worlds.arrays import Array, transform_points
from regionik.worlds.errors import FileNote, InputError
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Solid, Sphere
from regionik.worlds.readers.text import read_text
from regionik.worlds.toolpath import rotation_from_quaternion

SHAPES = ("box", "sphere", "cylinder", "cone", "mesh")
MAX_SHAPES = 100_000  # of an object, and subframes
_SIDES = 32  # of a round shape that is tilted, round it
_UPRIGHT = 1e-9  # by which an axis may be off the vertical


def read_scene(path: Path) -> list[Solid]:
    """Return the solids of a scene file; those of an object of several shapes are numbered.

    Boxes and cylinders that are tilted, and cones, become meshes, round ones of 32 sides around them. A mesh
    that is not closed becomes a sheet, with a `FileNote`.

    Raises
    ------
    InputError
        With the line, for what is no scene, and for planes and octrees.
    """
    lines = _SceneLines(path)
    lines.take("the scene's name")
    found = list[Solid]()
    while (head := lines.take("an object after a star, or a point")) != ".":
        if not head.startswith("*") or not head[1:].strip():
            raise lines.wrong(
                f"expected * and an object's name, or a point that ends the scene, got {head[:40]!r}"
            )
        found += _object(head[1:].strip(), lines)
    return found


def _object(name: str, lines: _SceneLines) -> list[Solid]:
    """The solids of an object, from the line after its name on."""
    old = len(lines.peek().split()) == 1  # files of MoveIt 1.0 have no poses of objects
    T = np.eye(4) if old else lines.pose()
    shapes = list[Solid]()
    count = lines.count("shapes")
    for k in range(count):
        shapes.append(_shape(f"{name} {k + 1}" if count > 1 else name, T, lines))
        lines.numbers(4, "a colour")
    for _ in range(0 if old else lines.count("subframes")):
        lines.take("a subframe's name")
        lines.pose()
    return shapes


def _shape(name: str, T_world_object: Array, lines: _SceneLines) -> Solid:
    kind = lines.take("a shape")
    if kind not in SHAPES:
        raise lines.wrong(f"expected one of {', '.join(SHAPES)}, got {kind[:40]!r}")
    if kind == "mesh":
        return _mesh(name, T_world_object, lines)
    size = lines.numbers({"box": 3, "sphere": 1}.get(kind, 2), f"the size of a {kind}")
    if (size <= 0).any():
        raise lines.wrong(f"expected a {kind} whose sizes are above 0")
    T = T_world_object @ lines.pose()
    upright, (yaw, center) = T[2, 2] > 1 - _UPRIGHT, (float(np.arctan2(T[1, 0], T[0, 0])), T[:3, 3])
    match kind:
        case "sphere":
            return Sphere(name, float(size[0]), center)
        case "box" if upright:
            return Box(name, size, center, yaw)
        case "cylinder" if upright:
            return Cylinder(name, float(size[0]), float(size[1]), center)
        case _:
            return Mesh(name, transform_points(T, _corners(kind, size)), _FACES[kind])


def _mesh(name: str, T_world_object: Array, lines: _SceneLines) -> Mesh:
    """A mesh, whose pose comes after its triangles."""
    counts = lines.numbers(2, "numbers of vertices and triangles")
    if (counts != np.round(counts)).any() or (counts < 1).any():
        raise lines.wrong("expected numbers of vertices and triangles, whole and above 0")
    vertices = np.array([lines.numbers(3, "a vertex") for _ in range(int(counts[0]))])
    faces = np.array([lines.numbers(3, "a triangle") for _ in range(int(counts[1]))])
    if (faces != np.round(faces)).any() or faces.min() < 0 or faces.max() >= len(vertices):
        raise lines.wrong(f"expected triangles of vertices 0 to {len(vertices) - 1}")
    mesh = Mesh(name, transform_points(T_world_object @ lines.pose(), vertices), faces.astype(np.int64))
    if mesh.is_closed:
        return mesh
    note = f"{lines.path}: the mesh of {name} is not closed: it is a sheet, the room behind it is free"
    warnings.warn(note, FileNote, stacklevel=2)
    return Mesh(name, mesh.vertices, mesh.faces, sheet=True)


def _corners(kind: str, size: Array) -> Array:
    """Corners of a box, or round a cylinder or cone, about their middle [m]."""
    if kind == "box":
        return np.array([[x, y, z] for z in (-1, 1) for x, y in _SQUARE]) * size / 2
    turn = 2 * np.pi * np.arange(_SIDES) / _SIDES
    radius, half = size[0] / np.cos(np.pi / _SIDES), size[1] / 2
    ring = np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])
    below = np.column_stack([ring, np.full(_SIDES, -half)])
    if kind == "cone":
        return np.vstack([below, [[0.0, 0.0, half]]])
    return np.vstack([below, np.column_stack([ring, np.full(_SIDES, half)])])


def _prism_faces(sides: int) -> Iterator[list[int]]:
    """Triangles of a prism, the corners of its bottom first, both counter-clockwise."""
    for k in range(sides):
        after = (k + 1) % sides
        yield from ([k, after, sides + after], [k, sides + after, sides + k])
    for k in range(1, sides - 1):
        yield from ([0, k + 1, k], [sides, sides + k, sides + k + 1])


_SQUARE = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
_FACES = {
    "box": np.array(list(_prism_faces(4))),
    "cylinder": np.array(list(_prism_faces(_SIDES))),
    "cone": np.array(
        [[k, (k + 1) % _SIDES, _SIDES] for k in range(_SIDES)] + [[0, k + 1, k] for k in range(1, _SIDES - 1)]
    ),
}


class _SceneLines:
    """The lines of a file that say something, one after the other."""

    def __init__(self, path: Path) -> None:
        self.path = path
        said = enumerate(read_text(path).splitlines(), 1)
        self._left = [(number, line.strip()) for number, line in said if line.strip()][::-1]
        self._at = 0

    def take(self, what: str) -> str:
        if not self._left:
            raise InputError(f"{self.path}: expected {what}, the file ends after line {self._at}")
        self._at, line = self._left.pop()
        return line

    def peek(self) -> str:
        return self._left[-1][1] if self._left else ""

    def wrong(self, what: str) -> InputError:
        return InputError(f"{self.path}: line {self._at}: {what}")

    def numbers(self, count: int, what: str) -> Array:
        words = self.take(what).split()
        try:
            values = np.array([float(word) for word in words])
        except ValueError:
            values = np.full(1, np.nan)
        if values.shape != (count,) or not np.isfinite(values).all():
            plural = "number" if count == 1 else "numbers"
            raise self.wrong(f"expected {what}, {count} {plural}, got {' '.join(words)[:40]!r}")
        return values

    def count(self, what: str) -> int:
        (value,) = self.numbers(1, f"the number of {what}")
        if not 0 <= value <= MAX_SHAPES or value != round(value):
            raise self.wrong(f"expected the number of {what}, got {value:g}")
        return int(value)

    def pose(self) -> Array:
        """A pose (4, 4): a line of a position and one of a quaternion x, y, z, w."""
        T = np.eye(4)
        T[:3, 3] = self.numbers(3, "a position")
        quaternion = self.numbers(4, "a quaternion")
        if not np.linalg.norm(quaternion) > 0:
            raise self.wrong("expected a quaternion, got 0 0 0 0")
        T[:3, :3] = rotation_from_quaternion(quaternion / np.linalg.norm(quaternion))
        return T
