"""Tool paths and targets from CSV files: a short file at once, a long one block by block.

With a line of titles columns are found by these, in any order and case; others are passed over, and named
once. Without one they are x, y, z, and either nothing more, or dx, dy, dz (tool axis), or qx, qy, qz, qw
(orientation). Empty lines and lines that begin with # are skipped.
"""

from __future__ import annotations

import csv
import hashlib
import math
import re
import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.chain import pose
from regionik.worlds.errors import FileNote, InputError, located
from regionik.worlds.readers.text import MAX_NUMBER, clip, is_number, join_names, read_text, reading
from regionik.worlds.scene import checked_name
from regionik.worlds.toolpath import ToolPath, rotation_from_quaternion

Delimiter = Literal["comma", "semicolon", "tab"]
LengthUnit = Literal["m", "cm", "mm", "in"]
AngleUnit = Literal["rad", "deg"]
Normals = Literal["outward", "inward"]
_UNIT_IN_TITLE = re.compile(r"\s*[\[(]\s*(\w+)\s*[\])]$")
PER_METRE: dict[LengthUnit, float] = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "in": 1 / 0.0254}
_SIGNS: dict[Delimiter, str] = {"comma": ",", "semicolon": ";", "tab": "\t"}
_POINT, _AXIS, _NORMAL = ("x", "y", "z"), ("dx", "dy", "dz"), ("nx", "ny", "nz")
_QUATERNION, _ANGLES = ("qx", "qy", "qz", "qw"), ("roll", "pitch", "yaw")
_AIMS = _AXIS, _NORMAL, _QUATERNION, _ANGLES  # a table has one of them at most
_UNTITLED = {len(names): names for names in (_POINT, _POINT + _AXIS, _POINT + _QUATERNION)}
_OTHERS = "name", "stroke", "speed", "flow"
_KNOWN = (*_OTHERS, *_POINT, *(name for aim in _AIMS for name in aim))
MAX_DIGITS = 9  # of the number of a stroke
PIECE = 2**20  # of a long file that is read at once [bytes]


@dataclass(frozen=True)
class CsvFormat:
    """What is to be known of a table beside what stands in it.

    Attributes
    ----------
    columns : dict
        Titles in the file, by what they stand for: x, y, z, name, dx, ...; empty where these are the titles.
    delimiter : {"comma", "semicolon", "tab"} or None
        None for that of them which the first line has most often.
    unit : {"m", "cm", "mm", "in"} or None
        Of x, y, z; None for metres.
    scale : float or None
        Metres of a unit that has none of these names.
    angle_unit : {"rad", "deg"} or None
        Of roll, pitch, yaw.
    normals : {"outward", "inward"} or None
        Which way nx, ny, nz point: out of the part, against the tool's axis, or into it, along that.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    delimiter: Delimiter | None = None
    unit: LengthUnit | None = None
    scale: float | None = None
    angle_unit: AngleUnit | None = None
    normals: Normals | None = None

    def __post_init__(self) -> None:
        choices = {"delimiter": Delimiter, "unit": LengthUnit, "angle_unit": AngleUnit, "normals": Normals}
        for key, kind in choices.items():
            value = getattr(self, key)
            if value is not None and value not in get_args(kind):
                raise InputError(f"{key}: expected one of {', '.join(get_args(kind))}, got {clip(value)}")
        if self.unit is not None and self.scale is not None:
            raise InputError("unit: expected one of unit, scale")
        if self.columns:
            with located("", "columns"):
                _check_complete(self.columns)
                if len(set(self.columns.values())) < len(self.columns):
                    raise InputError("expected a title of its own for each")


@dataclass(frozen=True)
class CsvLayout:
    """How the lines of one file are read."""

    where: str  # name of the file in error messages
    header: int  # number of the line of titles, or of the first with a point, counted from 1
    row: int  # number of the first line with a point
    width: int  # number of columns
    sign: str  # between cells
    places: tuple[tuple[str, str, int], ...]  # what is read, points first: its name, its title, its column
    form: CsvFormat


@dataclass(frozen=True)
class CsvBlock:
    """Some lines of a CSV file; parsing them needs the file no more."""

    layout: CsvLayout
    number: int  # number of the first of these lines within the file
    data: bytes

    def path(self) -> ToolPath:
        """Return the points of these lines."""
        return _path_of_lines(_text(self.data, self.layout.where).splitlines(), self.layout, self.number)


@dataclass(frozen=True)
class CsvTable:
    """A long CSV file, cut into blocks of ``size`` lines."""

    file: Path
    digest: str  # SHA-256 of the file
    layout: CsvLayout
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
        return CsvBlock(self.layout, k * self.size + 1, data)


def read_csv(path: Path, form: CsvFormat | None = None) -> ToolPath:
    """Return the tool path in a CSV file.

    Raises
    ------
    InputError
        With the line of what cannot be read, or can be in more than one way.

    Warns
    -----
    FileNote
        On titles that are passed over.
    """
    lines = read_text(path).splitlines()
    return _path_of_lines(lines, _layout(lines, str(path), form or CsvFormat()), 1)


def index_csv(path: Path, size: int, form: CsvFormat | None = None) -> CsvTable:
    """Return the blocks of ``size`` lines of a CSV file; of its points only the first is looked at."""
    with reading(path, None), open(path, "rb") as file:
        layout = _layout((_text(line, str(path)) for line in file), str(path), form or CsvFormat())
        file.seek(0)
        digest, after, count, place = hashlib.sha256(), [0], 0, 0
        while piece := file.read(PIECE):
            digest.update(piece)
            found = np.flatnonzero(np.frombuffer(piece, dtype=np.uint8) == ord("\n"))
            whole = (count + np.arange(1, len(found) + 1)) % size == 0
            after += (place + found[whole] + 1).tolist()
            count, place = count + len(found), place + len(piece)
    if place > after[-1]:
        after.append(place)
    return CsvTable(path, digest.hexdigest(), layout, size, tuple(after[1:]))


def _text(data: bytes, where: str) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{where}: expected UTF-8 text") from None


# --- which column is what


def _layout(lines: Iterable[str], where: str, form: CsvFormat) -> CsvLayout:
    """Return how a file is read, from its first lines."""
    filled = ((number, line) for number, line in enumerate(lines, start=1) if _is_filled(line))
    number, line = next(filled, (0, ""))
    if not line:
        raise InputError(f"{where}: expected at least one line of x,y,z, or of titles")
    signs = [_SIGNS[form.delimiter]] if form.delimiter else _SIGNS.values()
    sign = max(signs, key=re.sub('"[^"]*"', "", line).count)
    _, cells = next(_cells([line], sign, where, number), (number, []))
    titled = bool(form.columns) or not any(map(is_number, cells))
    row = next(filled, (0, ""))[0] if titled else number
    if not row:
        raise InputError(f"{where}: expected at least one line below the titles")
    with located(f"{where}: line {number}", ""):
        places = _places_by_title(cells, form) if titled else _places_in_order(cells)
        _check_said({name for name, _, _ in places}, form)
    passed = sorted({*range(len(cells))} - {column for _, _, column in places})
    if titled and not form.columns and any(cells[column] for column in passed):
        names = join_names([cells[column] for column in passed if cells[column]])
        text = f"{where}: line {number}: titles passed over: {clip(names)}; known are {', '.join(_KNOWN)}"
        warnings.warn(text, FileNote, stacklevel=3)
    return CsvLayout(where, number, row, len(cells), sign, places, form)


def _is_filled(line: str) -> bool:
    """Return whether a line has more than a comment and what stands between cells."""
    text = line.strip(" \r\n" + "".join(_SIGNS.values()))
    return bool(text) and not text.startswith("#")


def _places_in_order(cells: list[str]) -> tuple[tuple[str, str, int], ...]:
    """Return the columns of a table without titles."""
    if len(cells) not in _UNTITLED:
        valid = " or ".join(",".join(names) for names in _UNTITLED.values())
        raise InputError(f"expected {valid}, or a line of titles above; got {len(cells)} columns")
    return tuple((name, name, k) for k, name in enumerate(_UNTITLED[len(cells)]))


def _unit_in(title: str) -> tuple[str, str]:
    """Return a title without a unit in brackets at its end, and the unit; empty where there is none."""
    found = _UNIT_IN_TITLE.search(title)
    unit = "" if found is None else found[1].casefold()
    if found is None or unit not in (*get_args(LengthUnit), *get_args(AngleUnit)):
        return title, ""
    return title[: found.start()], unit


def _check_unit(title: str, form: CsvFormat) -> None:
    """Refuse a title that says another unit than is asked for."""
    unit, lengths = _unit_in(title)[1], get_args(LengthUnit)
    asked = (form.unit or "m") if unit in lengths else form.angle_unit
    if unit and unit != asked and not (unit in lengths and form.scale is not None):
        key = "unit" if unit in lengths else "angle_unit"
        raise InputError(f"the title {title!r} says {unit}, expected {key}: {unit} beside the file")


def _places_by_title(titles: list[str], form: CsvFormat) -> tuple[tuple[str, str, int], ...]:
    """Return the columns that are read of a table with titles."""
    shown = f"titles: {clip(', '.join(titles))}"
    lower = [_unit_in(title)[0].casefold() for title in titles]
    wanted = form.columns or {name: name for name in _KNOWN if name in lower}
    if not form.columns:
        _check_complete(wanted, f", {shown}; columns: chooses others")
    places = []
    for name in filter(wanted.__contains__, _KNOWN):
        title = wanted[name]
        found = [k for k, one in enumerate(titles) if form.columns and one == title]
        found = found or [k for k, one in enumerate(lower) if one == title.casefold()]
        if len(found) != 1:
            raise InputError(f"the title {title!r} is {'twice' if found else 'not'} there, {shown}")
        if not form.columns:  # a title that was chosen is what its chooser takes it for
            _check_unit(titles[found[0]], form)
        places.append((name, titles[found[0]], found[0]))
    return tuple(places)


def _check_complete(names: Collection[str], more: str = "") -> None:
    """Refuse columns that are no point, or a point with two of the ways to aim, or a part of one."""
    aims = [aim for aim in _AIMS if set(aim) & set(names)]
    missing = [name for aim in (_POINT, *aims) for name in aim if name not in names]
    strange = [name for name in names if name not in _KNOWN]
    if missing or strange or len(aims) > 1:
        valid = ", ".join(map(",".join, _AIMS))
        what = f"{', '.join(missing)} missing" if missing else f"got {','.join(names)}"
        what = f"unknown {', '.join(strange)}" if strange else what
        raise InputError(
            f"expected titles for x,y,z, at most one of {valid}, {', '.join(_OTHERS)}: {what}{more}"
        )


def _check_said(names: Collection[str], form: CsvFormat) -> None:
    """Refuse normals and angles that may mean two things, and words on columns that are not there."""
    for aim, key, value, words in (
        (_NORMAL, "direction", form.normals, "outward, out of the part, or inward (--normals"),
        (_ANGLES, "angle_unit", form.angle_unit, "deg or rad (--angle-unit"),
    ):
        if aim[0] in names and value is None:
            raise InputError(f"{','.join(aim)} need {key}: {words} at the command) beside them")
        if aim[0] not in names and value is not None:
            raise InputError(f"{key}: {value} goes with columns {','.join(aim)}, which are not there")


# --- lines


def _cells(lines: Iterable[str], sign: str, where: str, first: int) -> Iterator[tuple[int, list[str]]]:
    """Numbers and cells of the lines that are neither empty nor comments; ``first`` is that of the first."""
    kept = ("" if line.lstrip().startswith("#") else line for line in lines)
    reader = csv.reader(kept, delimiter=sign, skipinitialspace=True, strict=True)
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if any(cells):
                yield first + reader.line_num - 1, cells
    except csv.Error as error:
        raise InputError(f"{where}: line {first + reader.line_num - 1}: {error}") from None


def _path_of_lines(lines: Sequence[str], layout: CsvLayout, number: int) -> ToolPath:
    """Return the path of lines from the first with a point on; ``number`` is that of the first given."""
    rows: list[list[float]] = []
    names: list[str] = []
    strokes: list[int] = []
    speeds: list[float] = []
    flows: list[float] = []
    numbers: list[int] = []
    first = max(layout.row, number)
    for at, cells in _cells(lines[first - number :], layout.sign, layout.where, first):
        where = f"{layout.where}: line {at}"
        if any(cells[layout.width :]):
            expected = f"expected {layout.width} columns as in line {layout.header}, got {len(cells)}"
            raise InputError(f"{where}: {expected}")
        rows.append([])
        numbers.append(at)
        for what, title, column in layout.places:
            cell = cells[column] if column < len(cells) else ""
            if what == "name":
                with located(f"{where}: {title}", ""):
                    names.append(checked_name(cell))
            elif what == "stroke":
                strokes.append(_stroke(cell, title, where))
            elif what == "speed":
                speeds.append(_speed(cell, title, where))
            elif what == "flow":
                flows.append(_flow(cell, title, where))
            else:
                rows[-1].append(_number(cell, title, where))
    aim = tuple(what for what, _, _ in layout.places if what not in (*_POINT, *_OTHERS))
    path = _path_of_rows(np.array(rows), aim, layout, numbers)
    return replace(
        path,
        names=tuple(names),
        strokes=np.array(strokes) if strokes else None,
        speeds=np.array(speeds) if speeds else None,
        flows=np.array(flows) if flows else None,
    )


def _stroke(cell: str, name: str, where: str) -> int:
    if not (cell.isascii() and cell.isdigit() and len(cell) <= MAX_DIGITS):
        expected = "expected a whole number, 0 on travel or 1 and up for each stroke"
        raise InputError(f"{where}: {name}: {expected}, got {clip(cell)}")
    return int(cell)


def _speed(cell: str, name: str, where: str) -> float:
    """Return a speed, infinite for an empty cell [m/s]."""
    value = _number(cell, name, where) if cell else math.inf
    if value <= 0:
        raise InputError(f"{where}: {name}: expected a speed above 0 m/s, or nothing, got {clip(cell)}")
    return value


def _flow(cell: str, name: str, where: str) -> float:
    """Return what is fed per metre, 0 for an empty cell."""
    value = _number(cell, name, where) if cell else 0.0
    if value < 0:
        raise InputError(f"{where}: {name}: expected at least 0 a metre, or nothing, got {clip(cell)}")
    return value


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


def _path_of_rows(rows: Array, aim: tuple[str, ...], layout: CsvLayout, numbers: Sequence[int]) -> ToolPath:
    """Return the path of lines of such numbers: of rows of x, y, z and a way to aim."""
    form, (points, rest) = layout.form, np.split(rows.reshape(-1, 3 + len(aim)), [3], axis=1)
    points = points / PER_METRE[form.unit or "m"] if form.scale is None else points * form.scale
    if not aim:
        return ToolPath(points)
    if aim in (_AXIS, _NORMAL):
        zero = np.flatnonzero(np.linalg.norm(rest, axis=1) < 1e-9)
        if len(zero):
            what = f"{','.join(aim)} must not be zero"
            raise InputError(f"{layout.where}: line {numbers[zero[0]]}: {what}")
        return ToolPath(points, directions=-rest if form.normals == "outward" else rest)
    rest = np.radians(rest) if form.angle_unit == "deg" else rest
    turns = []
    for number, values in zip(numbers, rest, strict=True):
        with located(layout.where, f"line {number}: {','.join(aim)}"):
            turned = rotation_from_quaternion(values) if aim == _QUATERNION else pose((0, 0, 0), values)
            turns.append(turned[:3, :3])
    return ToolPath(points, orientations=np.array(turns).reshape(-1, 3, 3))
