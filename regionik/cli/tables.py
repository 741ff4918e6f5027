"""Tables: the options of those that are read, and those that are printed on stdout."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from regionik.cli.console import percent_text
from regionik.worlds.errors import InputError, located

if TYPE_CHECKING:
    from regionik.values import Answer, Stop
    from regionik.worlds.readers.csv_path import CsvFormat
    from regionik.worlds.scene import World

Columns = Annotated[
    str | None,
    typer.Option(
        "--columns", metavar="x=TITLE,...", help="Titles of its columns x, y, z, name, dx, ...; else these."
    ),
]
Unit = Annotated[str | None, typer.Option("--unit", help="Of its x, y, z: m, cm, mm or in; else m.")]
AngleUnitName = Annotated[
    str | None, typer.Option("--angle-unit", help="Of its roll, pitch, yaw: rad or deg; else rad.")
]
NormalsWay = Annotated[
    str | None,
    typer.Option("--normals", help="Which way its nx, ny, nz point: outward, against the tool, or inward."),
]


def csv_format(
    table: Path | None,
    option: str,
    columns: str | None,
    unit: str | None,
    angle_unit: str | None,
    normals: str | None,
) -> CsvFormat:
    """Return what options say of a table that another ``option`` names."""
    from regionik.worlds.readers.csv_path import CsvFormat

    said = {"--columns": columns, "--unit": unit, "--angle-unit": angle_unit, "--normals": normals}
    given = [name for name, value in said.items() if value is not None]
    if given and table is None:
        raise InputError(f"{given[0]}: goes with {option} TABLE")
    words: dict[str, Any] = {"unit": unit, "angle_unit": angle_unit, "normals": normals}
    with located(option, ""):
        return CsvFormat(_titles(columns), **words)


def _titles(columns: str | None) -> dict[str, str]:
    """Return the titles by what is read, of text such as ``x=East,y=North``."""
    found = {}
    for pair in filter(None, (columns or "").split(",")):
        what, sign, title = pair.partition("=")
        if not sign or not title.strip() or what.strip() in found:
            raise InputError(f"columns: expected each once, as in x=East,y=North,z=Up; got {columns!r}")
        found[what.strip()] = title.strip()
    return found


def print_answers(answer: Answer) -> None:
    """Print answers as a table on stdout, and below it the reason of each that is not "reachable"."""
    names = ["name", *answer.name] if any(answer.name) else [""] * (1 + len(answer.name))
    wide = max(map(len, names))
    print(f"{names[0]:{wide}}{'x':>8} {'y':>8} {'z':>8}  verdict      base x, y, yaw             code")
    for k, target in enumerate(answer.targets):
        x, y, z = (f"{value:z8g}" for value in target)
        base = ", ".join(f"{value:z.3f}" for value in answer.base[k]) if answer.reachable[k] else ""
        line = f"{names[k + 1]:{wide}}{x} {y} {z}  {answer.verdict[k]:11}  {base:25}  {answer.code[k]}"
        print(line.rstrip())
    for reason in filter(None, answer.reason):
        print(reason)


def print_stops(world: World, some: tuple[Stop, ...]) -> None:
    """Print stops as a table on stdout."""
    names = [", ".join(filter(None, (world.task[i].name for i in stop.setpoints))) for stop in some]
    told, doubts = any(stop.probability is not None for stop in some), bool(unconfirmed(some))
    more = "  probability    " * told + "  unconfirmed" * doubts + "  names" * any(names)
    print(f"stop  set-points      x [m]     y [m]  yaw [rad]  tolerance [m]{more}".rstrip())
    for n, (stop, called) in enumerate(zip(some, names, strict=True), 1):
        x, y, yaw = stop.base.tolist()
        span = f"{stop.first + 1} to {stop.last + 1}"
        likely = "" if stop.probability is None else f"  at least {percent_text(stop.probability)}"
        doubt = f"  {as_counted(stop.unconfirmed)}" if stop.unconfirmed else ""
        if sorted(stop.setpoints) != list(range(stop.first, stop.last + 1)):
            span = f"{len(stop.setpoints)} of them"
        place = f"{x:z9.3f} {y:z9.3f} {yaw:z10.3f} {stop.tolerance:14.4f}"
        print(f"{n:4d}  {span:12s} {place}{likely}{doubt}  {called}".rstrip())


def unconfirmed(some: tuple[Stop, ...]) -> list[int]:
    """Set-points at which no clear posture is known from their stop."""
    return sorted(i for stop in some for i in stop.unconfirmed)


def as_counted(setpoints: Sequence[int]) -> str:
    """Return the numbers of set-points as people count them, from 1."""
    return ", ".join(str(i + 1) for i in setpoints)
