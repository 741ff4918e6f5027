"""A table of a paper beside what this code makes of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, eq=False)
class Table:
    number: str
    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()


def markdown(table: Table) -> str:
    """The table and its notes as a section of a markdown document."""
    lines = [
        f"### {table.number}: {table.title}",
        "",
        _line(table.header),
        _line(("---",) * len(table.header)),
    ]
    lines += [_line(row) for row in table.rows]
    if table.notes:
        lines += ["", *(f"- {note}" for note in table.notes)]
    return "\n".join(lines) + "\n"


def _line(cells: tuple[str, ...]) -> str:
    return f"| {' | '.join(cells)} |"


def ahead(ours: str, measured: Mapping[str, float], what: str) -> str:
    """In words: which of the measured methods need less than ours of something, and how much less."""
    better = [
        f"{name} ({value / measured[ours]:.2f} of it)"
        for name, value in measured.items()
        if value < measured[ours]
    ]
    return f"Ahead of {ours} in {what}: {', '.join(better) or 'none'}."
