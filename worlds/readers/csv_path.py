"""Tool paths and targets from CSV files: a short file at once, a long one block by block.

Columns are x, y, z, and either nothing more, or dx, dy, dz (tool axis), or qx, qy, qz, qw (orientation).
Lines with these names before the first point, empty lines and lines that begin with # are skipped. Of tables
with a header line, columns may be chosen by their titles.
"""

from __future__ import annotations

import csv
import hashlib
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.readers.text import MAX_NUMBER, clip, read_text, reading
from regionik.worlds.toolpath import ToolPath, rotation_from_quaternion

Delimiter = Literal["comma", "semicolon", "tab"]
_SIGNS: dict[Delimiter, str] = {"comma": ",", "semicolon": ";", "tab": "\t"}
COLUMNS = {
    3: ("x", "y", "z"),
    6: ("x", "y", "z", "dx", "dy", "dz"),
    7: ("x", "y", "z", "qx", "qy", "qz", "qw"),
}
PIECE = 2**20  # of a long file that is read at once [bytes]
_NEWLINE = 10


@dataclass(frozen=True)
class CsvBlock:
    """Some lines of a CSV file; parsing them needs the file no more."""

    where: str  # name of the file in error messages
    row: int  # number of the file's first line with a point
    columns: int  # of that line
    number: int  # number of the first of these lines within the file
    data: bytes

    def path(self) -> ToolPath:
        """Return the points of these lines."""
        lines = _text(self.data, self.where).splitlines()
        return _path_of_lines(lines, self.where, self.row, self.columns, self.number)


@dataclass(frozen=True)
class CsvTable:
    """A long CSV file, cut into blocks of ``size`` lines."""

    file: Path
    digest: str  # SHA-256 of the file
    row: int
    columns: int
    size: int  # lines of a block
    ends: tuple[int, ...]  # offset of the end of each block; the first begins at 0 [bytes]

    def __len__(self) -> int:
        return len(self.ends)

    def block(self, k: int) -> CsvBlock:
        """Return block ``k``, read from the file."""
        start = self.ends[k - 1] if k else 0
        with reading(self.file, None), open(self.file, "rb") as file:
            file.seek(start)
            data = file.read(self.ends[k] - start)
        return CsvBlock(str(self.file), self.row, self.columns, k * self.size + 1, data)


def read_csv(path: Path) -> ToolPath:
    """Return the tool path in a CSV file."""
    lines = read_text(path).splitlines()
    row, columns = _first_row(lines, str(path))
    return _path_of_lines(lines, str(path), row, columns, 1)


def index_csv(path: Path, size: int) -> CsvTable:
    """Return the blocks of ``size`` lines of a CSV file; of its contents only the first row is checked."""
    with reading(path, None), open(path, "rb") as file:
        row, columns = _first_row((_text(line, str(path)) for line in file), str(path))
        file.seek(0)
        digest, after, count, place = hashlib.sha256(), [0], 0, 0
        while piece := file.read(PIECE):
            digest.update(piece)
            found = np.flatnonzero(np.frombuffer(piece, dtype=np.uint8) == _NEWLINE)
            whole = (count + np.arange(1, len(found) + 1)) % size == 0
            after += (place + found[whole] + 1).tolist()
            count, place = count + len(found), place + len(piece)
    if place > after[-1]:
        after.append(place)
    return CsvTable(path, digest.hexdigest(), row, columns, size, tuple(after[1:]))


def _text(data: bytes, where: str) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{where}: expected UTF-8 text") from None


def _first_row(lines: Iterable[str], where: str) -> tuple[int, int]:
    """Return the number of the first line with a point, counted from 1, and the number of its columns."""
    for number, line in enumerate(lines, start=1):
        cells = _cells(line)
        if not _is_skipped(cells) and tuple(cells) not in COLUMNS.values():
            return number, len(_row(cells, f"{where}: line {number}"))
    raise InputError(f"{where}: expected at least one line of x,y,z")


def _path_of_lines(lines: Sequence[str], where: str, row: int, columns: int, number: int) -> ToolPath:
    """Return the path of lines from the first with a point on; ``number`` is that of the first given."""
    rows: list[list[float]] = []
    numbers: list[int] = []
    for at, line in enumerate(lines[max(0, row - number) :], start=max(row, number)):
        cells = _cells(line)
        if _is_skipped(cells):
            continue
        rows.append(_row(cells, f"{where}: line {at}"))
        numbers.append(at)
        if len(cells) != columns:
            expected = f"expected {columns} columns as in line {row}, got {len(cells)}"
            raise InputError(f"{where}: line {at}: {expected}")
    return _path_of_rows(np.array(rows).reshape(-1, columns), where, numbers)


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.split(",")]


def _is_skipped(cells: list[str]) -> bool:
    return not any(cells) or cells[0].startswith("#")


def _row(cells: list[str], where: str) -> list[float]:
    valid = " or ".join(",".join(names) for names in COLUMNS.values())
    if len(cells) not in COLUMNS:
        raise InputError(f"{where}: expected {valid}, got {len(cells)} columns")
    names = COLUMNS[len(cells)]
    if sorted(cells) == sorted(names) and tuple(cells) != names:
        raise InputError(f"{where}: expected the columns {valid} in this order, got {','.join(cells)}")
    return [_number(cell, name, where) for name, cell in zip(names, cells, strict=True)]


def _number(cell: str, name: str, where: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where}: {name}: expected a finite number, got {clip(cell)}")
    if abs(value) > MAX_NUMBER:
        what = f"expected a number of at most {MAX_NUMBER:g} in size"
        raise InputError(f"{where}: {name}: {what}, got {clip(cell)}")
    return value


def _path_of_rows(rows: Array, where: str, numbers: Sequence[int]) -> ToolPath:
    """Return the path of rows as one of `COLUMNS` has them, from lines of such numbers."""
    points, rest = rows[:, :3], rows[:, 3:]
    if rest.shape[1] == 0:
        return ToolPath(points)
    if rest.shape[1] == 3:
        zero = np.flatnonzero(np.linalg.norm(rest, axis=1) < 1e-9)
        if len(zero):
            raise InputError(f"{where}: line {numbers[zero[0]]}: dx,dy,dz must not be zero")
        return ToolPath(points, directions=rest)
    turns = []
    for number, quaternion in zip(numbers, rest, strict=True):
        try:
            turns.append(rotation_from_quaternion(quaternion))
        except InputError as error:
            raise InputError(f"{where}: line {number}: qx,qy,qz,qw: {error}") from None
    return ToolPath(points, orientations=np.array(turns).reshape(-1, 3, 3))


# --- columns chosen by their titles


def read_csv_columns(path: Path, columns: Mapping[str, str], delimiter: Delimiter) -> ToolPath:
    """Return the tool path in some columns of a CSV file.

    Its first line that is neither empty nor begins with # holds the titles. ``columns`` are the titles for
    x, y, z, and for nothing more, dx, dy, dz, or qx, qy, qz, qw.
    """
    names = next((names for names in COLUMNS.values() if set(names) == set(columns)), None)
    if names is None:
        valid = " or ".join(",".join(names) for names in COLUMNS.values())
        raise InputError(f"columns: expected titles for {valid}, got {','.join(columns)}")
    rows, numbers = [], []
    table = _table(path, _SIGNS[delimiter])
    places = _places(path, next(table, (1, [])), [columns[name] for name in names])
    for number, cells in table:
        given = {title: cells[place] if place < len(cells) else "" for title, place in places.items()}
        rows.append([_number(cell, title, f"{path}: line {number}") for title, cell in given.items()])
        numbers.append(number)
    if not rows:
        raise InputError(f"{path}: expected at least one line below the titles")
    return _path_of_rows(np.array(rows), str(path), numbers)


def _table(path: Path, delimiter: str) -> Iterator[tuple[int, list[str]]]:
    """Numbers and cells of the lines that are neither empty nor comments."""
    lines = read_text(path).splitlines()
    reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=True, strict=True)
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if any(cells) and not cells[0].startswith("#"):
                yield reader.line_num, cells
    except csv.Error as error:
        raise InputError(f"{path}: line {reader.line_num}: {error}") from None


def _places(path: Path, header: tuple[int, list[str]], titles: list[str]) -> dict[str, int]:
    """Places of titles in the line of the titles, in the order asked for."""
    number, found = header
    for title in titles:
        if found.count(title) != 1:
            how = "twice" if title in found else "not"
            valid = clip(", ".join(found))
            raise InputError(f"{path}: line {number}: the title {title!r} is {how} there, titles: {valid}")
    if len(set(titles)) < len(titles):
        raise InputError("columns: expected a title of its own for each")
    return {title: found.index(title) for title in titles}
