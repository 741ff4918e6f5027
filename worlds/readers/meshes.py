"""Triangle meshes from files."""

from __future__ import annotations

import logging
import struct
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from regionik.worlds.arrays import Array
from regionik.worlds.chain import rot_x, rot_y, rot_z
from regionik.worlds.errors import InputError

SUFFIXES = (".stl", ".obj", ".ply", ".off")
MESH_LIMIT = 256 * 2**20  # [bytes]
LINES_LIMIT = 1_000_000  # of OBJ and OFF files, which are read far more slowly
_FLAT = 1e-4  # thickness [m], or part of the width where that is more than a metre
_HULL_FLAT = 1e-7  # as _FLAT: of what is much thinner the hull engine loses corners without a word
_CHUNK = 10_000  # points looked at together
_MANY = 500  # points, with whose number the engine's time for a box grows fast
_STEPS, _ROUNDS = (0.2, 0.1, 0.05, 0.02), 4  # of turning a box [rad]

# What it thinks of a file on the way, with traces, is not for who gave the file: that has one line.
logging.getLogger(trimesh.__name__).addHandler(logging.NullHandler())


def read_mesh(path: Path) -> tuple[Array, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of a closed mesh.

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
            _count_lines(path)
        with path.open("rb") as stream, np.errstate(all="ignore"):  # what is no number is found by who asks
            mesh: Any = trimesh.load(stream, file_type=kind[1:], force="mesh", skip_materials=True)
    # What trimesh's readers raise on files that are cut short or no mesh at all.
    except (
        ValueError,
        KeyError,
        IndexError,
        TypeError,
        AttributeError,
        NameError,
        OverflowError,
        struct.error,
        OSError,
        ImportError,  # a guess at the encoding of what is no text needs a package that we do not
    ) as error:
        why = "it is no such text" if isinstance(error, ImportError) else " ".join(str(error).split())[:80]
        raise InputError(
            f"{path}: expected a {kind[1:].upper()} mesh that can be read whole ({why})"
        ) from None
    if not len(mesh.faces):
        raise InputError(f"{path}: expected a mesh with triangles, got none")
    if np.shape(mesh.vertices)[1:] != (3,):
        raise InputError(f"{path}: expected a mesh with x, y, z of each vertex")
    return np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)


def _count_lines(path: Path) -> None:
    with path.open("rb") as stream:
        count = sum(1 for _ in stream)
    if count > LINES_LIMIT:
        raise InputError(f"{path}: expected at most {LINES_LIMIT} lines, got {count}; STL may hold more")


def is_closed(vertices: Array, faces: np.ndarray) -> bool:
    """Whether every edge joins two triangles, so that there is an inside."""
    return bool(trimesh.Trimesh(vertices, faces, process=False).is_watertight)


def hull_of(points: Array) -> Array:
    """Corners (m, 3) of the convex hull of points (n, 3); of a flat cloud, each point once."""
    distinct: Array = np.unique(points, axis=0)
    hull = _hull(distinct)
    return distinct if hull is None else np.asarray(distinct[hull.vertices], dtype=np.float64)


def hull_triangles(points: Array) -> Array:
    """Triangles (m, 3, 3) of the convex hull of points (n, 3); of a flat cloud, each point as one."""
    hull = _hull(points)
    faces: Array = np.repeat(points[:, None], 3, axis=1) if hull is None else points[hull.simplices]
    return faces


def _hull(points: Array) -> ConvexHull | None:
    """None of fewer than four points, and of points all in one plane, or so nearly."""
    if _is_flat(_spread(points)[0], _HULL_FLAT):
        return None
    try:
        return ConvexHull(points)
    except QhullError:
        return None


def outer_hull(points: Array, faces: int = 400) -> Array:
    """Corners (m, 3) of a body of at most so many faces, each touching the points (n, 3), that contains them.

    A flat cloud has no such body: the corners of its hull are given back.
    """
    widths, axes = _spread(points)
    if _is_flat(widths):
        return hull_of(points)
    k = np.arange(faces) + 0.5  # directions evenly over the sphere, on a spiral
    z, turn = 1 - 2 * k / faces, np.pi * (1 + np.sqrt(5)) * k
    normals = np.column_stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z])
    middle, stretch = points.mean(0), axes * (widths / np.sqrt(len(points)))
    local = (points - middle) @ np.linalg.inv(stretch).T  # as wide one way as another
    chunks = np.array_split(local, 1 + len(points) // _CHUNK)
    reach = np.max([(chunk @ normals.T).max(0) for chunk in chunks], axis=0)
    body = HalfspaceIntersection(np.column_stack([normals, -reach]), np.zeros(3))
    corners: Array = hull_of(body.intersections) @ stretch.T + middle
    return corners


def oriented_box(points: Array) -> tuple[Array, Array]:
    """A small box around points (n, 3), at any angle: its frame (4, 4) and sizes (3,) [m].

    Sizes are 0 where points are flat. Of more than `_MANY` points it is one along the frame's or their
    principal axes.
    """
    widths, axes = _spread(points)
    turns = [np.eye(3), axes]
    if 3 < len(points) <= _MANY and not _is_flat(widths):  # the engine wants an inside
        engine: Any = trimesh.bounds
        turns.append(np.asarray(engine.oriented_bounds(points)[0], dtype=np.float64)[:3, :3].T)
    return _smallest(points, turns)


def nearly_least_box(points: Array) -> tuple[Array, Array]:
    """As `oriented_box`, quickly: along the principal axes or the frame's, then turned while that helps."""
    T, size = _smallest(points, [np.eye(3), _spread(points)[1]])
    for step in _STEPS:
        for _ in range(_ROUNDS):
            before = float(np.prod(size + _FLAT))
            T, size = _smallest(points, [T[:3, :3], *(T[:3, :3] @ turn for turn in _nudges(step))])
            if np.prod(size + _FLAT) >= before:
                break
    return T, size


def _nudges(angle: float) -> list[Array]:
    """Small turns about each axis, either way, (3, 3)."""
    return [turn(sign * angle)[:3, :3] for turn in (rot_x, rot_y, rot_z) for sign in (1, -1)]


def _spread(points: Array) -> tuple[Array, Array]:
    """Widths (3,) of points along their principal axes, least first, and these axes as columns (3, 3)."""
    spread = points - points.mean(axis=0)
    squares, axes = np.linalg.eigh(spread.T @ spread)
    return np.sqrt(np.maximum(squares, 0.0)), axes * np.sign(np.linalg.det(axes))


def _is_flat(widths: Array, limit: float = _FLAT) -> bool:
    return bool(widths[0] <= limit * max(widths[2], 1.0))


def _smallest(points: Array, turns: list[Array]) -> tuple[Array, Array]:
    # Measured again, as what an engine rounds must not leave points outside.
    boxes = [(turn, (points @ turn).min(axis=0), (points @ turn).max(axis=0)) for turn in turns]
    turn, low, high = min(boxes, key=lambda box: float(np.prod(box[2] - box[1] + _FLAT)))
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn, turn @ ((low + high) / 2)
    return T, high - low
