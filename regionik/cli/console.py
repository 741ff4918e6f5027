"""What the commands print: answers on stdout, everything else on stderr."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from threading import Lock, Timer
from types import TracebackType
from typing import TYPE_CHECKING, Any

from regionik.worlds.errors import Explanation, InputError

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from regionik.reach import Answer
    from regionik.values import Plan, Report

PATIENCE = 1.0  # work shorter than this shows no progress bar [s]
_SHOWN = 20  # rows of a table, or violations, that a person is given at once


def say(text: str) -> None:
    """Write words for a person, on stderr; where nobody can read them they are not missed."""
    with suppress(OSError):
        print(text, file=sys.stderr, flush=True)


def complain(text: str) -> None:
    """Write one line on stderr, whatever line breaks ``text`` holds."""
    say("regionik: " + " ".join(text.split()))


def failure(error: BaseException | None) -> str:
    """Return what can be said of an error that nobody expected: what it is, and where it was raised."""
    if isinstance(error, MemoryError):
        return "out of memory: this needs more than there is"
    trace = None if error is None else error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    place = f", {Path(trace.tb_frame.f_code.co_filename).name} line {trace.tb_lineno}" if trace else ""
    return (
        f"{type(error).__name__}: {error} (a fault of regionik or of a library under it{place}; "
        "the same call from Python gives the traceback)"
    )


def print_json(document: Mapping[str, Any]) -> None:
    """Write one JSON document on stdout; NaN becomes null."""
    json.dump(plain(document), sys.stdout, allow_nan=False, indent=2)
    print(flush=True)


def plain(value: Any) -> Any:
    """Return ``value`` as what JSON knows: dicts, lists, strings, numbers, booleans and None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # a numpy array or scalar
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def check_output(
    path: Path | None, suffixes: Iterable[str] = (), reads: Iterable[Path | str | None] = ()
) -> None:
    """Raise `InputError` if ``path`` cannot be written; asked before the work, not after it.

    What the command reads, if it is a file, is not to be written over.
    """
    if path is None:
        return
    choices = tuple(suffixes)
    if choices and path.suffix.lower() not in choices:
        raise InputError(f"{path}: expected a file name ending in {', '.join(choices)}")
    if path.is_dir():
        raise InputError(f"{path}: is a folder, expected a file name")
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}")
    folder = os.path.dirname(os.path.realpath(path))
    if (path.is_file() or not path.exists()) and not os.access(folder, os.W_OK):
        raise InputError(f"{path}: nothing can be written in that folder")
    if path.is_file() and any(read is not None and _is_same(path, read) for read in reads):
        raise InputError(f"{path}: is what is read here, expected another file to write")


def _is_same(path: Path, other: Path | str) -> bool:
    with suppress(OSError, ValueError):
        return path.samefile(other)
    return False


class LateProgress:
    """Progress bars on stderr for work that takes longer than `PATIENCE`.

    Call it with ``(stage, done, total)``. It shows nothing where stderr is no terminal, and leaves nothing
    behind on one.
    """

    def __init__(self) -> None:
        self._bars: Progress | None = None
        self._tasks: dict[str, TaskID] = {}
        self._lock = Lock()
        self._timer: Timer | None = None

    def __enter__(self) -> LateProgress:
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import Progress

            self._bars = Progress(console=Console(stderr=True), transient=True)
            self._timer = Timer(PATIENCE, self._bars.start)
            self._timer.daemon = True
            self._timer.start()
        return self

    def __call__(self, stage: str, done: int, total: int) -> None:
        if self._bars is None:
            return
        with self._lock:
            if stage not in self._tasks:
                self._tasks[stage] = self._bars.add_task(stage, total=total or None)
            self._bars.update(self._tasks[stage], completed=done, total=total or None)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer.join()
        if self._bars is not None:
            self._bars.stop()


def refusal(explanation: Explanation) -> dict[str, Any]:
    """Return the JSON document of a no."""
    return {"ok": False, **asdict(explanation)}


def report_document(report: Report) -> dict[str, Any]:
    """Return the JSON document of a verification."""
    found = {"margins": report.margins, "violations": [asdict(v) for v in report.violations]}
    if report.ok:
        return {"ok": True, **found}
    first = report.violations[0]
    reason = f"The plan does not hold: {first.text}"
    return {**refusal(Explanation("plan-invalid", first.setpoint, reason)), **found}


def plan_summary(plan: Plan, seconds: float, written: Iterable[Path]) -> str:
    """Return what a person wants to know about a plan, in a few lines."""
    from regionik.storage.plan_document import keeps_areas

    way = plan.world.robot.drive.travel(plan.motion.base)
    worst = max(c.error for c in plan.setpoints)
    lines = [
        f"{plan.world.name}: {_count(len(plan.setpoints), 'set-point')} within {worst * 1000:.3f} mm, "
        f"{_count(sum(c.iterations for c in plan.setpoints), 'iteration')}",
        f"  {_count(plan.lift_offs, 'lift-off')}, {way:.2f} m of base travel, "
        f"{_count(len(plan.motion), 'state')}",
    ]
    margins = plan.stats.get("margins")
    if margins:
        lines.append(f"  margins: {_margins(margins)}")
    lines.append(f"  planned and verified in {seconds:.1f} s")
    lines += [f"  wrote {path}" for path in written]
    if not keeps_areas(plan):
        lines.append("  areas are left out of plan files, which could not be read back with so many corners")
    return "\n".join(lines)


def report_summary(name: str, report: Report) -> str:
    """Return a verification report for a person."""
    if report.ok:
        return f"{name}: the plan holds\n  margins: {_margins(report.margins)}"
    shown = [f"  {violation.text}" for violation in report.violations[:_SHOWN]]
    hidden = len(report.violations) - len(shown)
    more = [f"  ... and {hidden} more"] if hidden > 0 else []
    count = _count(len(report.violations), "violation")
    return "\n".join([f"{name}: the plan does not hold, {count}", *shown, *more])


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _margins(margins: Mapping[str, float]) -> str:
    unit = dict.fromkeys(("direction", "orientation", "joints"), " rad")
    unit |= {"manipulability": " m3", "joint_margin": " of the range", "effort": " N m"}
    return ", ".join(f"{name} {value:z.4f}{unit.get(name, ' m')}" for name, value in margins.items())


def print_worlds(rows: Iterable[tuple[str, str]]) -> None:
    """Print one line a world: its name and what it is about."""
    listed = list(rows)
    width = max((len(name) for name, _ in listed), default=0)
    for name, about in listed:
        print(f"{name:<{width}}  {about}")


def print_answers(answer: Answer) -> None:
    """Print answers as a table on stdout."""
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for column in ("x", "y", "z"):
        table.add_column(column, justify="right")
    table.add_column("verdict")
    table.add_column("base x, y, yaw")
    table.add_column("reason", overflow="fold")
    for k, target in enumerate(answer.targets):
        base = ", ".join(f"{v:z.3f}" for v in answer.base[k]) if answer.reachable[k] else ""
        verdict = str(answer.verdict[k])
        table.add_row(*(f"{v:zg}" for v in target), verdict, base, answer.reason[k])
    Console(markup=False, highlight=False).print(table)
