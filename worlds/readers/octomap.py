"""Octomaps: trees of cubes as OctoMap writes them, in its binary form (.bt) and its full one (.ot).

Both begin with lines of text. The binary form has two bytes for each inner node, two bits a child: unknown,
free, occupied or inner. The full one has the logarithm of the odds of each node, a colour where it has one,
and a byte that says which children there are. Nodes come in depth-first order; child k is on the upper side
of x, y, z where bit 0, 1, 2 of k is set.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np

from regionik.worlds.arrays import Index
from regionik.worlds.errors import InputError, located
from regionik.worlds.readers.text import MAX_NUMBER, clip, reading
from regionik.worlds.readers.voxels import MAX_CELLS

SUFFIXES = (".bt", ".ot")
MAX_NODES = 2_000_000  # of inner ones
_MIDDLE = 2**15  # cells from the lower end of the tree to the origin
_COLOR_BYTES = {"OcTree": 0, "ColorOcTree": 3}
_FREE, _OCCUPIED, _INNER = 1, 2, 3

_Cube = tuple[int, int, int, int]  # lower corner and side, in cells


class Octomap(NamedTuple):
    """Occupied cells of a map."""

    cells: Index  # (n, 3): cell 0, 0, 0 has its lower corner in the origin
    side: float  # of a cell [m]


def read_octomap(path: Path) -> Octomap:
    """Return the occupied cells of a map file; in the full form, what is as likely occupied as not counts.

    Raises
    ------
    InputError
        One line: the file, and what was expected.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: expected an octomap that ends in {', '.join(SUFFIXES)}")
    with reading(path):
        data = path.read_bytes()
    with located(str(path), ""):
        binary, kind, side, offset = _head(data)
        cubes = _binary(data, offset) if binary else _full(data, offset, _COLOR_BYTES[kind])
        if not cubes:
            raise InputError("expected a map with occupied cells, got none")
        return Octomap(_cells(np.array(cubes, dtype=np.int64)), side)


def _head(data: bytes) -> tuple[bool, str, float, int]:
    """Return whether a file is binary, the kind of its tree, the side of a cell [m], and where data begin."""
    first, found, offset = data[:100].split(b"\n", 1)[0], dict[str, str](), 0
    if not first.startswith(b"# Octomap OcTree"):
        raise InputError("expected a first line # Octomap OcTree file, or # Octomap OcTree binary file")
    while "data" not in found:
        end = data.find(b"\n", offset)
        if end < 0 or offset > 100_000:
            raise InputError("expected a line data, after which the tree begins")
        key, _, value = data[offset:end].decode("latin-1").strip().partition(" ")
        found[key], offset = value, end + 1
    if found.get("id") not in _COLOR_BYTES:
        raise InputError(f"id: expected one of {', '.join(_COLOR_BYTES)}, got {clip(found.get('id', ''))}")
    try:
        side = float(found.get("res", ""))
    except ValueError:
        side = 0.0
    if not 0 < side <= MAX_NUMBER:
        raise InputError(f"res: expected the side of a cell, got {clip(found.get('res', ''))}")
    return b"binary" in first, found["id"], side, offset


def _binary(data: bytes, at: int) -> list[_Cube]:
    occupied, stack, nodes = list[_Cube](), [_ROOT] if len(data) > at else [], 0
    while stack:
        cube, nodes = stack.pop(), nodes + 1
        _check(cube, nodes, left=len(data) - at - 2)
        bits, at = data[at] | data[at + 1] << 8, at + 2
        codes = [(bits >> 2 * k & 3, k) for k in range(8)]
        occupied += [_child(cube, k) for code, k in codes if code == _OCCUPIED]
        stack += [_child(cube, k) for code, k in reversed(codes) if code == _INNER]
    return occupied


def _full(data: bytes, at: int, color: int) -> list[_Cube]:
    occupied, stack, nodes = list[_Cube](), [_ROOT] if len(data) > at else [], 0
    while stack:
        cube, nodes = stack.pop(), nodes + 1
        _check(cube, nodes // 8, left=len(data) - at - color - 5, leaf=True)
        (odds,), children = struct.unpack_from("<f", data, at), data[at + 4 + color]
        at += color + 5
        if children:
            _check(cube, 0, left=0)
            stack += [_child(cube, k) for k in range(7, -1, -1) if children >> k & 1]
        elif odds >= 0:
            occupied.append(cube)
    return occupied


_ROOT: _Cube = (-_MIDDLE, -_MIDDLE, -_MIDDLE, 2 * _MIDDLE)


def _child(cube: _Cube, k: int) -> _Cube:
    x, y, z, side = cube
    half = side // 2
    return x + half * (k & 1), y + half * (k >> 1 & 1), z + half * (k >> 2 & 1), half


def _check(cube: _Cube, nodes: int, left: int, *, leaf: bool = False) -> None:
    """Refuse trees that are too deep, too large or cut off."""
    if left < 0:
        raise InputError("expected a whole tree, the file ends within it")
    if cube[3] == 1 and not leaf:
        raise InputError("expected a tree of 16 levels at most")
    if nodes > MAX_NODES:
        raise InputError(f"expected at most {MAX_NODES} inner nodes")


def _cells(cubes: Index) -> Index:
    """Return the cells (n, 3) of cubes (m, 4)."""
    total = int((cubes[:, 3].astype(np.float64) ** 3).sum())
    if total > MAX_CELLS:
        raise InputError(f"expected at most {MAX_CELLS} occupied cells, got {total}")
    parts = []
    for side in np.unique(cubes[:, 3]).tolist():
        steps = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        some = cubes[cubes[:, 3] == side, None, :3] + steps
        parts.append(some.reshape(-1, 3))
    return np.concatenate(parts)
