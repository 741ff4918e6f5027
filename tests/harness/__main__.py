"""A table of small worlds, to hold a change of the planner against the tree before it.

`run` plans them and keeps their figures; `compare` says of each world whether its plan is the same, as good,
or what fell, and exits with 1 where anything did.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from rich.console import Console
from rich.table import Table

from regionik.worlds.errors import InputError
from tests.harness.comparison import BAD, Compared, Row, compare
from tests.harness.running import run
from tests.harness.worlds import SHORT, WORLDS

COLUMNS = (  # of the table of a run: heading, figure, format
    ("lift-offs", "lift_offs", "d"), ("stops", "stops", "d"), ("bound", "stops_bound", "d"),
    ("time s", "duration", ".2f"), ("at speed", "at_speed", ".2f"), ("base m", "base_way", ".2f"),
    ("turn rad", "turning", ".2f"), ("arm rad", "arm_travel", ".2f"), ("states", "states", "d"),
    ("tries", "tries", "d"), ("CPU s", "cpu", ".2f"), ("verify s", "cpu_verify", ".2f"),
)  # fmt: skip
MARGINS = "clearance", "arm", "self", "joints"
SUMS = "cpu", "duration", "base_way", "arm_travel", "lift_offs", "stops"
STYLES = {"fell": "red", "missing": "red", "other world": "red", "better": "green"}
Rows = Mapping[str, Row]


def chosen(patterns: Sequence[str], short: bool) -> list[str]:
    """Return names of worlds that patterns match, in the order of the table; all without patterns."""
    known = SHORT if short else tuple(WORLDS)
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in known):
            raise InputError(f"no world is named {pattern!r}, valid names: {', '.join(known)}")
    return [name for name in known if not patterns or any(fnmatchcase(name, one) for one in patterns)]


def figures(source: Path, names: Sequence[str]) -> dict[str, Row]:
    """Return rows by world: those of a file, or of a checkout, which is run."""
    if source.is_dir():
        rows: dict[str, Row] = {}
        for name, row in run(source, names):
            rows[name] = row
            print(f"{name}: {row['verdict']}, {row.get('cpu', 0):.1f} s", file=sys.stderr)
        return rows
    try:
        kept: dict[str, Row] = json.loads(source.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{source}: expected the figures that `run -o` writes: {error}") from None
    return {name: kept[name] for name in names if name in kept}


def table_of(rows: Rows) -> Table:
    """Return the figures of a run, a row a world."""
    table = Table(box=None, header_style="bold")
    for heading in ("world", "verdict"):
        table.add_column(heading, no_wrap=True)
    for heading, _, _ in COLUMNS:
        table.add_column(heading, justify="right")
    for name in MARGINS:
        table.add_column(f"{name} room", justify="right")
    for name, row in rows.items():
        verdict = row["verdict"] if row.get("verified", True) else "planned, not verified"
        cells = (_cell(row.get(key), form) for _, key, form in COLUMNS)
        rooms = (_cell(row.get("margins", {}).get(key), ".3f") for key in MARGINS)
        table.add_row(name, verdict, *cells, *rooms)
    return table


def _cell(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)


def comparison_table(found: Iterable[Compared]) -> Table:
    """Return how worlds compare, a row each, with ratios of after to before."""
    table = Table(box=None, header_style="bold")
    for heading in ("world", "is"):
        table.add_column(heading, no_wrap=True)
    for heading in ("CPU", "time", "base", "arm"):
        table.add_column(heading, justify="right")
    table.add_column("what", overflow="fold")
    for one in found:
        ratios = (_cell(one.ratios.get(key), ".2f") for key in ("cpu", "duration", "base_way", "arm_travel"))
        what = "; ".join([*one.fell, *(f"better: {text}" for text in one.better)])
        table.add_row(one.name, one.state, *ratios, what, style=STYLES.get(one.state))
    return table


def sums(before: Rows, after: Rows) -> str:
    """Return sums over the worlds that both runs have, planned in both but for the processor's time."""
    both = [name for name in before if name in after]
    planned = [name for name in both if before[name]["verdict"] == after[name]["verdict"] == "planned"]
    lines = []
    for key in SUMS:
        names = both if key == "cpu" else planned
        old, new = (sum(rows[name].get(key) or 0 for name in names) for rows in (before, after))
        ratio = f", {new / old:.3f} times" if old else ""
        lines.append(f"{key.replace('_', ' ')}: {old:.6g} -> {new:.6g}{ratio}")
    return "\n".join(lines)


def compared(before: Rows, after: Rows, names: Iterable[str], console: Console) -> int:
    """Print how the worlds of two runs compare; return 1 where anything fell."""
    known = [name for name in names if name in before or name in after]
    found = [compare(name, before.get(name), after.get(name)) for name in known]
    console.print(comparison_table(found))
    states = [one.state for one in found]
    console.print(", ".join(f"{states.count(state)} {state}" for state in dict.fromkeys(states)))
    console.print(sums(before, after))
    return int(any(state in BAD for state in states))


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(prog="python -m tests.harness", description=__doc__)
    commands = made.add_subparsers(dest="command", required=True)
    one = commands.add_parser("run", help="plan the worlds and print their figures")
    one.add_argument("--tree", type=Path, default=Path(), help="checkout to run, by default this one")
    one.add_argument("-o", "--output", type=Path, help="file of figures, JSON")
    two = commands.add_parser("compare", help="say what a change of the planner made of the worlds")
    two.add_argument("before", type=Path, help="file of figures, or a checkout, which is run")
    two.add_argument("after", type=Path, help="file of figures, or a checkout, which is run")
    for command in (one, two):
        command.add_argument("names", nargs="*", metavar="NAME", help="of worlds, with * and ?")
        command.add_argument("--short", action="store_true", help="a few of them, a minute of processor time")
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    asked = parser().parse_args(arguments)
    console = Console(width=None if sys.stdout.isatty() else 210)
    names = chosen(asked.names, asked.short)
    if asked.command == "run":
        rows = figures(asked.tree, names)
        console.print(table_of(rows))
        if asked.output:
            lines = (f"{json.dumps(name)}: {json.dumps(row)}" for name, row in rows.items())
            asked.output.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")
        return 0
    before = figures(asked.before, names)
    return compared(before, figures(asked.after, names), names, console)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except InputError as error:
        sys.exit(str(error))
