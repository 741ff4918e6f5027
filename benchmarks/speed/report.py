"""The table of speeds as JSON and as Markdown, with the machine and the versions that it holds for."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any

from benchmarks.speed.harness import Row, Spread

PACKAGES = (
    "regionik", "numpy", "numba", "scipy", "shapely", "ompl", "roboticstoolbox-python", "pin", "pin-pink",
    "mink", "mujoco", "ikpy", "pytracik", "extremitypathfinder",
)  # fmt: skip
UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"))
MARKS = {True: "met", False: "missed", None: "-"}


def machine() -> dict[str, Any]:
    """Processor, cores, system and the versions of all that was measured; "absent" where not installed."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": platform.system(),
        "python": platform.python_version(),
        "packages": {name: _version(name) for name in PACKAGES},
    }


def as_json(groups: Mapping[str, Sequence[Row]], about: Mapping[str, Any]) -> dict[str, Any]:
    """The whole table as plain values, each row with whether it is met."""
    rows = [asdict(row) | {"group": name, "met": row.met} for name, rows in groups.items() for row in rows]
    return {"machine": dict(about), "rows": rows}


def as_markdown(groups: Mapping[str, Sequence[Row]], about: Mapping[str, Any], preface: str) -> str:
    """The whole table for people."""
    versions = ", ".join(f"{name} {version}" for name, version in about["packages"].items())
    place = f"{about['processor']}, {about['cores']} cores, {about['system']}, Python {about['python']}"
    parts = [preface, f"Machine: {place}.\n\nVersions: {versions}.\n"]
    for name, rows in groups.items():
        lines = [
            "| what | against | ours | theirs | figure (quartiles) | wanted | |",
            "|---|---|---|---|---|---|---|",
            *map(_line, rows),
        ]
        notes = [f"- {row.what}, {row.rival}: {row.note}" for row in rows if row.note]
        parts.append("\n".join([f"## {name}\n", *lines, "", *notes, ""]))
    return "\n".join(parts)


def seconds(value: float) -> str:
    """A time in the unit that suits it."""
    scale, unit = next((one for one in UNITS if value >= one[0]), UNITS[-1])
    return f"{value / scale:.3g} {unit}"


def _line(row: Row) -> str:
    ours, theirs = ("-" if side is None else seconds(side.median) for side in (row.ours, row.theirs))
    wanted, unit = ("-", "×") if row.wanted is None else (row.wanted.text, row.wanted.unit)
    cells = row.what, row.rival, ours, theirs, _figure(row.figure, unit), wanted, MARKS[row.met]
    return f"| {' | '.join(cells)} |"


def _figure(figure: Spread | None, unit: str) -> str:
    if figure is None:
        return "-"
    low, median, high = (_rounded(value) for value in (figure.low, figure.median, figure.high))
    return f"{median} {unit}".rstrip() + f" ({low} to {high})"


def _rounded(value: float) -> str:
    """Four digits, without an exponent."""
    return f"{float(f'{value:.4g}'):,.12g}"


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "absent"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
