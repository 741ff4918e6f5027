"""Point clouds: PLY, PCD, and text with three numbers a line."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError, located
from regionik.worlds.readers.text import MAX_NUMBER, clip, is_number, join_names, reading

SUFFIXES = (".ply", ".pcd", ".xyz", ".csv")
MAX_POINTS = 4_000_000  # of a file, which is read into memory as a whole

_AXES = ("x", "y", "z")
_PLY_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
}
_PLY_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_PCD_TYPES = {"F": ("4", "8"), "I": ("1", "2", "4", "8"), "U": ("1", "2", "4", "8")}
_MAX_FIELDS = 1000
_MAX_HEAD = _MAX_LINE = 100_000  # bytes before the points, and of a line of text
_TOO_LONG = re.compile(rb"[^\n]{%d}" % _MAX_LINE)


def read_points(path: Path) -> Array:
    """Return the points (n, 3) of a file in its own unit, without those that are no numbers.

    PLY files may be text or binary, PCD files text or binary but not compressed. In ``.xyz`` and ``.csv``
    files columns are parted by commas, semicolons or spaces; a line of titles may name x, y and z among
    others.

    Raises
    ------
    InputError
        One line: the file, what was expected, and what to do.
    """
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        raise InputError(f"{path}: expected a point cloud that ends in {', '.join(SUFFIXES)}")
    with reading(path):
        data = path.read_bytes()
    with located(str(path), ""):
        points = {".ply": _ply, ".pcd": _pcd}.get(kind, _text)(data)
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            raise InputError("expected at least one point with x, y and z")
        if np.abs(points).max() > MAX_NUMBER:
            raise InputError(f"expected coordinates of at most {MAX_NUMBER:g} in size")
    return points


def _ply(data: bytes) -> Array:
    head, end, _ = data[:_MAX_HEAD].partition(b"end_header")
    lines = [line.split() for line in head.decode("latin-1").splitlines()]
    if not end or lines[:1] != [["ply"]]:
        raise InputError("expected a PLY file, from ply to end_header")
    body = data[data.find(b"\n", len(head)) + 1 :]
    order = next((words[1] for words in lines if words[:1] == ["format"] and len(words) > 1), "")
    if order not in _PLY_ORDERS:
        raise InputError(f"format: expected one of {', '.join(_PLY_ORDERS)}, got {clip(order)}")
    elements = [k for k, words in enumerate(lines) if words[:1] == ["element"]]
    if not elements or lines[elements[0]][1:2] != ["vertex"]:
        raise InputError("expected vertices as the first element")
    count = _whole(lines[elements[0]][2:], "element vertex")
    after = elements[1] if len(elements) > 1 else len(lines)
    fields = [words[1:] for words in lines[elements[0] + 1 : after] if words[:1] == ["property"]]
    wrong = next((words for words in fields if len(words) != 2 or words[0] not in _PLY_TYPES), None)
    if wrong is not None:
        raise InputError(f"expected numbers as properties of vertices, got {clip(' '.join(wrong))}")
    columns = _columns([name for _, name in fields])
    if not _PLY_ORDERS[order]:
        return _rows(body, columns, count)
    return _records(body, [(_PLY_ORDERS[order] + _PLY_TYPES[kind], 1) for kind, _ in fields], columns, count)


def _pcd(data: bytes) -> Array:
    head, offset = dict[str, list[str]](), 0
    while "DATA" not in head:
        end = data.find(b"\n", offset)
        if end < 0 or end > _MAX_HEAD:
            raise InputError("expected a PCD file, with a line DATA")
        key, *words = data[offset:end].decode("latin-1").split() or [""]
        head[key], offset = words, end + 1
    names = head.get("FIELDS", [])
    columns = _columns(names)
    count = _whole(head.get("POINTS", []), "POINTS")
    kind = " ".join(head["DATA"])
    if kind == "ascii":
        return _rows(data[offset:], _spread(columns, head, len(names)), count)
    if kind == "binary":
        return _records(data[offset:], _pcd_fields(head, len(names)), columns, count)
    raise InputError(
        f"DATA: expected ascii or binary, got {clip(kind)}: save it anew, as by pcl_convert_pcd_ascii_binary "
        "IN.pcd OUT.pcd 1"
    )


def _pcd_fields(head: Mapping[str, Sequence[str]], count: int) -> list[tuple[str, int]]:
    """Return types of fields, and how many numbers each has."""
    sizes, kinds = head.get("SIZE", []), head.get("TYPE", [])
    repeats = _repeats(head, count)
    if not len(sizes) == len(kinds) == count or any(
        size not in _PCD_TYPES.get(kind, ()) for kind, size in zip(kinds, sizes, strict=True)
    ):
        raise InputError("SIZE, TYPE: expected a size of 1, 2, 4 or 8 and a type F, I or U of each field")
    return [(f"<{kind.lower()}{size}", some) for kind, size, some in zip(kinds, sizes, repeats, strict=True)]


def _repeats(head: Mapping[str, Sequence[str]], count: int) -> list[int]:
    repeats = [_whole([word], "COUNT") for word in head.get("COUNT", ["1"] * count)]
    if len(repeats) != count or max(repeats) > _MAX_FIELDS:
        raise InputError(f"COUNT: expected a number up to {_MAX_FIELDS} for each field")
    return repeats


def _spread(columns: Sequence[int], head: Mapping[str, Sequence[str]], count: int) -> list[int]:
    """Return the columns of a text in which fields may have several numbers."""
    starts = np.cumsum([0, *_repeats(head, count)])
    return [int(starts[column]) for column in columns]


def _text(data: bytes) -> Array:
    _check_lines(data)
    lines = data.removeprefix(b"\xef\xbb\xbf").split(b"\n", 50)
    for skipped, line in enumerate(lines[:50]):
        words, comma = _words(line.decode("latin-1"))
        if len(words) >= 3 and all(map(is_number, words[:3])):
            titles, _ = _words(lines[skipped - 1].decode("latin-1").lstrip("#/ ") if skipped else "")
            named = [title.strip("\"' ").lower() for title in titles]
            columns = [named.index(axis) for axis in _AXES] if set(_AXES) <= set(named) else [0, 1, 2]
            body = data.removeprefix(b"\xef\xbb\xbf").split(b"\n", skipped)[-1]
            return _rows(body, columns, None, comma)
    raise InputError("expected lines of numbers x y z")


def _words(line: str) -> tuple[list[str], str | None]:
    """Return the words of a line, and what parts them; None for spaces."""
    comma = next((sign for sign in ";," if sign in line), None)
    return line.strip().split(comma), comma


def _columns(names: Sequence[str]) -> list[int]:
    if not set(_AXES) <= set(names):
        raise InputError(f"expected x, y and z among the fields, got {clip(join_names(names, 8))}")
    return [names.index(axis) for axis in _AXES]


def _whole(words: Sequence[str], what: str) -> int:
    text = " ".join(words)
    if not (text.isascii() and text.isdigit() and len(text) < 12):
        raise InputError(f"{what}: expected a whole number, got {clip(text)}")
    if int(text) > MAX_POINTS:
        raise InputError(f"{what}: expected at most {MAX_POINTS}, got {int(text)}")
    return int(text)


def _check_lines(text: bytes) -> None:
    if _TOO_LONG.search(text) is not None:
        raise InputError(f"expected lines of at most {_MAX_LINE} characters")


def _rows(body: bytes, columns: Sequence[int], count: int | None, comma: str | None = None) -> Array:
    """Return numbers of some columns of text, in ``count`` lines or all, (n, 3)."""
    _check_lines(body)
    lines = body.count(b"\n") + 1
    if lines > MAX_POINTS or lines < (count or 0):
        expected = f"at most {MAX_POINTS}" if count is None else str(count)
        raise InputError(f"expected {expected} points, one a line, got {lines} lines")
    text = io.TextIOWrapper(io.BytesIO(body), "latin-1")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # where there is nothing
            found = np.loadtxt(text, delimiter=comma, usecols=columns, max_rows=count, ndmin=2)
    except (ValueError, OverflowError) as error:
        raise InputError(f"expected a point a line: {' '.join(str(error).split())[:100]}") from None
    if count is not None and len(found) < count:
        raise InputError(f"expected {count} points, got {len(found)}")
    return np.asarray(found.reshape(-1, 3), dtype=np.float64)


def _records(body: bytes, kinds: Sequence[tuple[str, int]], columns: Sequence[int], count: int) -> Array:
    """Return some fields of binary records (n, 3)."""
    record = np.dtype([(f"f{k}", kind, (some,)) for k, (kind, some) in enumerate(kinds)])
    if len(body) < count * record.itemsize:
        raise InputError(f"expected {count} points, the file ends after {len(body) // record.itemsize}")
    found: NDArray[np.void] = np.frombuffer(body, record, count)
    with np.errstate(all="ignore"):
        return np.stack([found[f"f{column}"][:, 0].astype(np.float64) for column in columns], axis=1)
