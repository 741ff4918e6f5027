"""Tool paths from tables with a header line: columns chosen by their titles."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal

import numpy as np

from regionik.worlds.errors import InputError
from regionik.worlds.readers.csv_path import COLUMNS, CSV_LIMIT, check_lengths, path_of_rows
from regionik.worlds.readers.text import clip, read_lines
from regionik.worlds.readers.validation import LARGEST
from regionik.worlds.toolpath import ToolPath

Delimiter = Literal["comma", "semicolon", "tab"]
_SIGNS: dict[Delimiter, str] = {"comma": ",", "semicolon": ";", "tab": "\t"}


def read_csv_columns(path: Path, columns: Mapping[str, str], delimiter: Delimiter) -> ToolPath:
    """Return the tool path in some columns of a CSV file.

    Parameters
    ----------
    path : Path
        Its first line that is neither empty nor begins with # holds the titles.
    columns : mapping of str to str
        Titles of the columns for x, y, z, and for nothing more, dx, dy, dz, or qx, qy, qz, qw.
    delimiter : {"comma", "semicolon", "tab"}

    Raises
    ------
    InputError
        Names the file, the line and what was expected.
    """
    names = next((names for names in COLUMNS.values() if set(names) == set(columns)), None)
    if names is None:
        valid = " or ".join(",".join(names) for names in COLUMNS.values())
        raise InputError(f"columns: expected titles for {valid}, got {','.join(columns)}")
    rows, numbers = [], []
    table = _table(path, _SIGNS[delimiter])
    places = _places(path, next(table, (1, [])), [columns[name] for name in names])
    for number, cells in table:
        rows.append(
            [_value(cells, place, title, f"{path}: line {number}") for title, place in places.items()]
        )
        numbers.append(number)
    if not rows:
        raise InputError(f"{path}: expected at least one line below the titles")
    return path_of_rows(np.array(rows), str(path), numbers)


def _table(path: Path, delimiter: str) -> Iterator[tuple[int, list[str]]]:
    """Numbers and cells of the lines that are neither empty nor comments."""
    lines = read_lines(path, CSV_LIMIT)
    check_lengths(lines, str(path), 1)
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


def _value(cells: list[str], place: int, title: str, where: str) -> float:
    cell = cells[place] if place < len(cells) else ""
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or abs(value) > LARGEST:
        raise InputError(
            f"{where}: {title}: expected a number of at most {LARGEST:g} in size, got {clip(cell)}"
        )
    return value
