"""Meshes: triangles of STL, OBJ, PLY and OFF files."""

from __future__ import annotations

import logging
import struct
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from regionik.worlds.arrays import Array, Index
from regionik.worlds.errors import InputError
from regionik.worlds.readers.text import reading

SUFFIXES = (".stl", ".obj", ".ply", ".off")
MESH_LIMIT = 256 * 2**20  # [bytes]
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


def read_mesh(path: Path) -> tuple[Array, Index]:
    """Return the vertices (n, 3) and triangles (m, 3) of a mesh file."""
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        raise InputError(f"{path}: expected a mesh file that ends in {', '.join(SUFFIXES)}")
    with reading(path, MESH_LIMIT):
        data = path.read_bytes()
    lines = data.count(b"\n")
    if kind in (".obj", ".off") and lines > LINES_LIMIT:
        raise InputError(f"{path}: expected at most {LINES_LIMIT} lines, got {lines}; STL may hold more")
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
