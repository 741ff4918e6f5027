"""Triangle meshes from files."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError

SUFFIXES = (".stl", ".obj", ".ply", ".off")
MESH_LIMIT = 256 * 2**20  # [bytes]


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
        with path.open("rb") as stream:
            mesh: Any = trimesh.load(stream, file_type=kind[1:], force="mesh", skip_materials=True)
    # What trimesh's readers raise on files that are cut short or no mesh at all.
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, struct.error, OSError) as error:
        why = " ".join(str(error).split())[:80]
        raise InputError(
            f"{path}: expected a {kind[1:].upper()} mesh that can be read whole ({why})"
        ) from None
    if not len(mesh.faces):
        raise InputError(f"{path}: expected a mesh with triangles, got none")
    return np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)


def is_closed(vertices: Array, faces: np.ndarray) -> bool:
    """Whether every edge joins two triangles, so that there is an inside."""
    return bool(trimesh.Trimesh(vertices, faces, process=False).is_watertight)
