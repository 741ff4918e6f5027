"""Measure every row of the table of speeds and write docs/benchmarks.json and docs/benchmarks.md.

Run: python -m benchmarks.speed [-o docs/benchmarks] [--only solver,...] [--rounds N] [--share F]

A group is a module of this package with a function ``rows(size)`` that yields rows. With ``--only`` the rows
of the other groups are kept as the JSON file has them.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks.speed.harness import Row, Size, Spread, Wanted
from benchmarks.speed.report import MARKS, as_json, as_markdown, machine
from regionik.planners.kernels import compiled_at_once

GROUPS = {  # module -> heading
    "solver": "One solve, against others",
    "batch": "Many solves, and solves inside an area",
    "areas": "Areas, stages and base paths",
}
PREFACE = """\
# Speed

Written by `make bench`. A figure is a ratio of two things timed in turns, in one process on one core,
everything warm: in every round each side does its work for about 50 ms, and the figure is the median of the
rounds' ratios, its quartiles behind it. Times are processor time, medians of one piece of work; trust the
ratios. A row is met where the median is what was wanted. A package that is not installed is absent, and so
are its rows.
"""


def measured(names: Sequence[str], size: Size) -> dict[str, list[Row]]:
    """Rows of the named groups, printed as they come."""
    groups: dict[str, list[Row]] = {}
    for name in names:
        groups[GROUPS[name]] = []
        for row in import_module(f"benchmarks.speed.{name}").rows(size):
            groups[GROUPS[name]].append(row)
            figure = "-" if row.figure is None else f"{row.figure.median:.4g}"
            print(f"{name}: {row.what}, {row.rival}: {figure} {MARKS[row.met]} {row.note}", flush=True)
    return groups


def kept(path: Path) -> dict[str, list[Row]]:
    """Rows of an earlier run, by group; none where there is no such file."""
    groups: dict[str, list[Row]] = {}
    if path.exists():
        for row in json.loads(path.read_text(encoding="utf-8"))["rows"]:
            groups.setdefault(row["group"], []).append(_row(row))
    return groups


def _row(row: dict[str, Any]) -> Row:
    ours, theirs, figure = (row[key] and Spread(**row[key]) for key in ("ours", "theirs", "figure"))
    wanted = row["wanted"] and Wanted(**row["wanted"])
    return Row(row["what"], row["rival"], ours, theirs, figure, wanted, row["note"])


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure the table of speeds.")
    parser.add_argument(
        "-o", "--out", type=Path, default=Path("docs/benchmarks"), help="files to write, no suffix"
    )
    parser.add_argument("--only", default=",".join(GROUPS), help=f"groups to measure: {', '.join(GROUPS)}")
    parser.add_argument("--rounds", type=int, default=15, help="of every pair")
    parser.add_argument("--share", type=float, default=1.0, help="of the full amount of work")
    given = parser.parse_args()
    names = [name for name in given.only.split(",") if name]
    if unknown := sorted(set(names) - set(GROUPS)):
        parser.error(f"no group {', '.join(unknown)}; there are {', '.join(GROUPS)}")
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    data, text = given.out.with_suffix(".json"), given.out.with_suffix(".md")
    with compiled_at_once():
        found = kept(data) | measured(names, Size(given.rounds, given.share))
    groups = {title: found[title] for title in GROUPS.values() if title in found}
    about = machine()
    data.write_text(json.dumps(as_json(groups, about), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    text.write_text(as_markdown(groups, about, PREFACE), encoding="utf-8")
    print(f"wrote {data} and {text}")


if __name__ == "__main__":
    main()
