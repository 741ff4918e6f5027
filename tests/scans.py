"""Point clouds and octomaps written by tests, in every form that is read."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from tests.maths import Array

Cell = tuple[int, int, int]
MIDDLE = 2**15  # cells from the lower end of a tree to the origin


def clouds(points: Array) -> dict[str, bytes]:
    """Points (n, 3) in every form, by a file name each; others than x, y, z go along."""
    count = len(points)
    text = "\n".join(" ".join(map(repr, row)) for row in points.tolist()) + "\n"
    commas = "\n".join(",".join(map(repr, row)) for row in points.tolist()) + "\n"
    record = np.dtype([("i", "<u1"), ("x", "<f8"), ("y", "<f8"), ("z", "<f8")])
    rows = np.zeros(count, record)
    rows["x"], rows["y"], rows["z"] = points.T
    ply = "ply\nformat {} 1.0\ncomment by hand\nelement vertex {}\n"
    axes = "".join(f"property double {axis}\n" for axis in "xyz")
    pcd = "# .PCD v0.7\nVERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT {}\nWIDTH {}\nHEIGHT 1\n"
    pcd += f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA {{}}\n"
    normals = "\n".join(f"0 0 1 {line}" for line in text.splitlines()) + "\n"
    faces = "element face 0\nproperty list uchar int vertex_indices\nend_header\n"
    mixed = "property uchar i\n" + axes + faces
    little, big = (ply.format(f"binary_{order}_endian", count) + mixed for order in ("little", "big"))
    three = pcd.format("n x y z", "4 8 8 8", "F F F F", "3 1 1 1", count, "ascii") + normals
    binary = pcd.format("i x y z", "1 8 8 8", "U F F F", "1 1 1 1", count, "binary")
    titled = "r;Z;X;Y\n" + "".join(f"7;{z!r};{x!r};{y!r}\n" for x, y, z in points.tolist())
    return {
        "text.ply": (ply.format("ascii", count) + axes + faces + text).encode(),
        "little.ply": little.encode() + rows.tobytes(),
        "big.ply": big.encode() + rows.astype(record.newbyteorder(">")).tobytes(),
        "text.pcd": three.encode(),
        "binary.pcd": binary.encode() + rows.tobytes(),
        "p.xyz": text.encode(),
        "p.csv": commas.encode(),
        "titled.csv": titled.encode(),
    }


def octomap_of(cells: Sequence[Cell], side: float, *, binary: bool = True, color: bool = False) -> bytes:
    """An octomap of occupied cells; eight that fill a larger cube are one node, as OctoMap prunes them."""
    kind = "ColorOcTree" if color else "OcTree"
    first = f"# Octomap OcTree {'binary ' if binary else ''}file\n# (feel free to add / change comments)\n"
    head = f"{first}id {kind}\nsize {len(cells)}\nres {side!r}\ndata\n".encode()
    keys = {(x + MIDDLE, y + MIDDLE, z + MIDDLE) for x, y, z in cells}
    node = _binary(keys, 2 * MIDDLE) if binary else _full(keys, 2 * MIDDLE, b"\x01\x02\x03" * color)
    return head + node


def _parts(keys: set[Cell], width: int) -> list[set[Cell]]:
    """Cells of a cube in each of its eight children, from the child's lower corner."""
    half = width // 2
    parts: list[set[Cell]] = [set() for _ in range(8)]
    for x, y, z in keys:
        parts[x // half + 2 * (y // half) + 4 * (z // half)].add((x % half, y % half, z % half))
    return parts


def _binary(keys: set[Cell], width: int) -> bytes:
    half, bits, rest = width // 2, 0, b""
    for k, part in enumerate(_parts(keys, width)):
        if len(part) == half**3:
            bits |= 0b10 << 2 * k  # the first bit of a pair is the lower one: 0 1 is occupied
        elif part:
            bits |= 0b11 << 2 * k
            rest += _binary(part, half)
        elif k == 7:
            bits |= 0b01 << 2 * k  # free
    return bits.to_bytes(2, "little") + rest


def _full(keys: set[Cell], width: int, color: bytes) -> bytes:
    if len(keys) in (0, width**3):
        return struct.pack("<f", 2.0 if keys else -2.0) + color + b"\x00"
    parts = _parts(keys, width)
    there = [k for k in range(8) if parts[k] or k == 7]
    children = sum(1 << k for k in there)
    below = b"".join(_full(parts[k], width // 2, color) for k in there)
    return struct.pack("<f", 2.0) + color + bytes([children]) + below
