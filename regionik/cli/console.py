"""Messages, tables, documents, progress and options that all commands share.

Answers go to stdout, everything else to stderr.
"""

from __future__ import annotations

import json
import math
import os
import sys
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, replace
from pathlib import Path
from threading import Event, Lock, Thread, Timer
from time import monotonic
from types import TracebackType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from regionik.cli import interrupts
from regionik.cli.exit_codes import ExitCode
from regionik.cli.options import COMMANDS
from regionik.planners.progress import listening
from regionik.storage.files import json_values
from regionik.verification.options import VERIFICATION
from regionik.worlds.errors import Explanation, InputError, NoPlanFound, RobotNote

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from regionik.values import Plan, Report, Skipped
    from regionik.worlds.scene import World

PAGES = (".html", ".htm")  # endings
_UNITS = dict.fromkeys(("direction", "orientation", "joints"), " rad")
_UNITS |= {"manipulability": " m3", "joint_margin": " of the range", "effort": " N m"}
_UNITS |= {"speeds": " of the limit", "jerk": " of the limit"}


def bundled_worlds(incomplete: str) -> list[str]:
    """Names of bundled worlds that begin so, for shells that complete words; files are left to the shell."""
    from regionik.worlds.bundled import world_names

    return [name for name in world_names() if name.startswith(incomplete)]


WorldName = Annotated[
    str,
    typer.Argument(
        metavar="WORLD", help="A bundled world's name, or a world file.", autocompletion=bundled_worlds
    ),
]
PlanPath = Annotated[Path, typer.Argument(metavar="PLAN", help="A plan.json.")]
Skip = Annotated[
    bool,
    typer.Option("--skip", help="Leave out set-points that cannot be reached, and name them."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document, and only it, on stdout.")]


def print_message(text: str) -> None:
    """Write text for people on stderr; a closed stderr is ignored."""
    with suppress(OSError):
        print(text, file=sys.stderr, flush=True)


def print_error(text: str) -> None:
    """Write one line on stderr, whatever line breaks ``text`` holds."""
    print_message("regionik: " + " ".join(text.split()))


def describe_failure(error: BaseException | None) -> str:
    """Describe an unexpected error: what it is, and where it was raised."""
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
    json.dump(json_values(document), sys.stdout, allow_nan=False, indent=2)
    print(flush=True)


def file_names(paths: Iterable[Path | str]) -> list[str]:
    """Return the names of files as text, which a JSON document can hold."""
    from regionik.worlds.readers.text import name_as_text

    return [name_as_text(str(path)) for path in paths]


def check_output(
    path: Path | None, suffixes: Iterable[str] = (), reads: Iterable[Path | str | None] = ()
) -> None:
    """Raise `InputError` if ``path`` cannot be written, before any work is done.

    A file that the command reads must not be overwritten.
    """
    if path is None:
        return
    choices = tuple(suffixes)
    if path.is_dir():
        raise InputError(f"{path}: expected a file to write, this is a folder")
    is_device = path.exists() and not path.is_file()  # a pipe, or /dev/stdout
    if choices and path.suffix.lower() not in choices and not is_device:
        raise InputError(f"{path}: expected a file name ending in {', '.join(choices)}")
    if not path.parent.is_dir():
        raise InputError(f"{path}: expected an existing folder, {path.parent} is not there")
    folder = os.path.dirname(os.path.realpath(path))
    if (path.is_file() or not path.exists()) and not os.access(folder, os.W_OK):
        raise InputError(f"{path}: nothing can be written in that folder")
    if path.is_file() and any(read is not None and _is_same_file(path, read) for read in reads):
        raise InputError(f"{path}: is the file to read, expected another to write")


def _is_same_file(path: Path, other: Path | str) -> bool:
    with suppress(OSError, ValueError):
        return path.samefile(other)
    return False


class DelayedProgress:
    """Progress bars on stderr for work that takes longer than a second.

    It listens to all stages while it is entered; call it with ``(stage, done, total)`` for others. It shows
    those that are not done, and leaves nothing behind. Where stderr is no terminal there is a line every ten
    seconds, unless REGIONIK_QUIET is set. ``work`` is shown from beginning to end, ``rest`` says what remains
    of it when Ctrl-C ends it, and ``said`` is what was said while it went on.
    """

    def __init__(self, work: str = "", rest: str = "") -> None:
        self.said: list[str] = []
        self._work, self._rest = work, rest
        self._bars: Progress | None = None
        self._tasks: dict[str, TaskID] = {}
        self._at: dict[str, tuple[int, int]] = {}  # done and total of stages
        self._listening = ExitStack()
        self._lock = Lock()
        self._compiled = 0  # kernels
        self._timer: Timer | None = None
        self._ended = Event()
        self._lines: Thread | None = None

    def __enter__(self) -> DelayedProgress:
        if sys.stderr.isatty():
            from rich import progress as bars
            from rich.console import Console

            columns = bars.TextColumn("{task.description}"), bars.BarColumn(), bars.MofNCompleteColumn()
            times = bars.TimeElapsedColumn(), bars.TextColumn("left"), bars.TimeRemainingColumn()
            self._bars = bars.Progress(*columns, *times, console=Console(stderr=True), transient=True)
            self._timer = Timer(COMMANDS.progress_delay, self._bars.start)
            self._timer.daemon = True
            self._timer.start()
        elif not os.environ.get("REGIONIK_QUIET"):
            self._lines = Thread(target=self._write_lines, daemon=True)
            self._lines.start()
        self._listening.enter_context(listening(self))
        self._listening.enter_context(interrupts.described(self._stopped))
        if self._work:
            self(self._work, 0, 0)
        return self

    def __call__(self, stage: str, done: int, total: int) -> None:
        with self._lock:
            before, _ = self._at.get(stage, (0, 0))
            self._at[stage] = (done, total)
            if self._bars is None:
                return
            if stage not in self._tasks:
                self._tasks[stage] = self._bars.add_task(stage, total=total or None)
            if done < before:
                self._bars.reset(self._tasks[stage])  # and its estimate
            shown = done < total or not total
            self._bars.update(self._tasks[stage], completed=done, total=total or None, visible=shown)

    @property
    def shown(self) -> bool:
        """True on a terminal."""
        return self._bars is not None

    @property
    def _going_on(self) -> str:
        """Stages that are not done, and how far they are."""
        at = self._at.copy().items()
        left = [
            (f"{stage} {n} of {total}" if total else stage)
            for stage, (n, total) in at
            if n < total or not total
        ]
        return ", ".join(left)

    def _write_lines(self) -> None:
        """Write how far the work is, again and again until it ends."""
        begun = monotonic()
        while not self._ended.wait(COMMANDS.line_interval):
            print_message(f"{monotonic() - begun:.0f} s: {self._going_on or 'at work'}")

    def _stopped(self) -> str:
        """Say where the work was stopped, and what is kept of it."""
        at, rest = self._going_on, "what is said above holds" if self.said else self._rest
        return (f" at {at}" if at else "") + (f": {rest}" if rest else "")

    def say(self, text: str) -> None:
        """Write text for people on stderr, above the bars."""
        self.said.append(text)
        if self._bars is None:
            print_message(text)
        else:
            self._bars.console.print(text, markup=False, highlight=False, soft_wrap=True)

    def compiling(self, kernel: str) -> None:
        """Say once that kernels are compiled, and count them."""
        if self._bars is None:
            return
        if not self._compiled:
            self._bars.console.print("compiling what is worth it; later runs have it")
        self._compiled += 1
        self("compile", self._compiled, 0)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        if self._lines is not None:
            self._lines.join()
        if self._timer is not None:
            self._timer.cancel()
            self._timer.join()
        if self._bars is not None:
            self._bars.stop()
            kernels = sys.modules.get("regionik.planners.kernels")
            if kernels is not None and kernels.plain_work() > COMMANDS.min_plain_work:
                print_message("much of this ran uncompiled: regionik warm-up makes later runs faster")
        self._listening.__exit__(kind, error, trace)


def read_world(name: str, progress: DelayedProgress) -> World:
    """Load a bundled world or a world file; notes on its robot are left to `read_world_to_plan`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotNote)
        return read_world_to_plan(name, progress)


def read_world_to_plan(name: str, progress: DelayedProgress) -> World:
    """Load a bundled world or a world file, and say what was left out of its robot."""
    progress("load", 0, 1)
    from regionik.worlds.documents.world_file import load_world

    world = load_world(name)
    progress("load", 1, 1)
    from regionik.planners.kernels import tell_compiling

    tell_compiling(progress.compiling)
    return world


def read_plan(path: Path, progress: DelayedProgress) -> Plan:
    """Load a plan file."""
    progress("load", 0, 1)
    from regionik.output.plan_file import load_plan

    plan = load_plan(path)
    progress("load", 1, 1)
    return plan


@contextmanager
def explain_no_plan(as_json: bool, progress: DelayedProgress) -> Iterator[None]:
    """Turn a `NoPlanFound` into its explanation, as JSON too if wanted, and exit code 1."""
    try:
        yield
    except NoPlanFound as no:
        print_explanation(no.explanation, progress)
        if as_json:
            print_json(explanation_document(no.explanation))
        raise typer.Exit(ExitCode.NO) from None


def print_explanation(explanation: Explanation, progress: DelayedProgress) -> None:
    """Print what of an explanation was not said while it was looked for."""
    if not progress.said:
        print_message(explanation.reason)
    elif len(explanation.repairs) > 1:
        print_message(f"The smallest change: {explanation.repairs[0].text}.")


def skipping(world: World, skip: bool) -> World:
    """Return the world with the rule that unreachable set-points are left out, if that is wanted."""
    return replace(world, rules=replace(world.rules, skip_unreachable=True)) if skip else world


def skipped_lines(skipped: Sequence[Skipped], count: int) -> list[str]:
    """Return lines on the set-points left out, of ``count`` as given: all in a sentence, then each reason."""
    if not skipped:
        return []
    from regionik.explain.several import left_out

    most = COMMANDS.max_listed
    lines = [f"  {left_out(skipped, count)}", *(f"    {one.reason}" for one in skipped[:most])]
    more = len(skipped) - most
    return [*lines, f"    ... and {more} more"] if more > 0 else lines


def explanation_document(explanation: Explanation) -> dict[str, Any]:
    """Return the JSON document of an explanation."""
    from regionik.explain.several import failures_of

    return {"ok": False, **asdict(replace(explanation, failures=failures_of(explanation)))}


def report_document(report: Report, plan: Plan) -> dict[str, Any]:
    """Return the JSON document of a plan's verification."""
    from regionik.storage.plan_document import skipped_document

    found: dict[str, Any] = {"margins": report.margins, "violations": [asdict(v) for v in report.violations]}
    found["skipped"] = skipped_document(plan.skipped)
    if report.ok:
        return {"ok": True, **found}
    first = report.violations[0]
    reason = f"The plan does not hold: {first.text}"
    return {**explanation_document(Explanation("plan-invalid", first.setpoint, reason)), **found}


def plan_summary(plan: Plan, seconds: float, written: Iterable[Path]) -> str:
    """Return a few lines on a plan, for people."""
    from regionik.view.picture import count_noun

    length = plan.world.robot.drive.travel(plan.motion.base)
    worst, count = max(c.error for c in plan.setpoints), len(plan.setpoints) + len(plan.skipped)
    done = f"{len(plan.setpoints)} of " * bool(plan.skipped) + count_noun(count, "set-point")
    spent = [c.iterations for c in plan.setpoints if c.iterations]
    lines = [
        f"{plan.world.name}: {done} within {worst * 1000:.3f} mm",
        f"  {count_noun(plan.lift_offs, 'lift-off')}, {length:.2f} m of base travel, "
        f"{count_noun(len(plan.motion), 'state')}",
    ]
    lines += lifted_lines(plan)
    if spent:  # what meets them now may be another posture
        met = "them" if len(spent) == len(plan.setpoints) else count_noun(len(spent), "set-point")
        within = f"{1000 * plan.world.rules.tolerance:g} mm"
        lines.append(f"  M-FABRIK met {met} to {within} in {count_noun(sum(spent), 'iteration')}")
    likely = [stop.probability for stop in plan.stops if stop.probability is not None]
    if likely:
        lines.append(f"  each stop is good after parking with at least {percent_text(min(likely))}")
    held = plan.stats.get("timing", {}).get("tool")
    if held and any(map(math.isfinite, plan.world.work_speeds)):
        lines.append(held_line(held))
    margins = plan.stats.get("margins")
    if margins:
        lines.append(f"  to spare: {spare_text(margins, plan.world)}")
    lines += skipped_lines(plan.skipped, count)
    lines.append(f"  planned and verified in {seconds:.1f} s")
    lines += [f"  wrote {path}" for path in written]
    return "\n".join(lines)


def lifted_lines(plan: Plan) -> list[str]:
    """Lines on lift-offs within strokes, which the rules of the plan allow."""
    task = plan.world.task
    return [
        f"  the tool is lifted within stroke {task[i].stroke}, from set-point {i} to {i + 1}: "
        f"{math.dist(task[i - 1].position, task[i].position):.3f} m are not worked"
        for i in plan.lifts_within()
    ]


def held_line(tool: Mapping[str, Any]) -> str:
    """Return for what share of their time the tool holds the speeds that are asked."""
    least, most = tool["asked"]
    if least == most:
        line = f"  the tool holds {most:g} m/s for {tool['held']:.0%} of its time on the path"
    else:
        line = (
            f"  the tool holds {least:.3g} to {most:.3g} m/s, as asked, for {tool['held']:.0%} of their time"
        )
    return line + f"; for {tool['capped']:.0%} the task asks for more" * (tool["capped"] > 0)


def percent_text(probability: float) -> str:
    """Return a lower bound of a probability in percent, rounded down: 99.99 % of 0.99999."""
    return f"{math.floor(probability * 1e4) / 100:.2f} %"


def report_summary(name: str, report: Report, plan: Plan) -> str:
    """Return a plan's verification for people."""
    from regionik.view.picture import count_noun

    if report.ok:
        count = len(plan.setpoints) + len(plan.skipped)
        part = f" for {len(plan.setpoints)} of {count} set-points" * bool(plan.skipped)
        spare = f"  to spare: {spare_text(report.margins, plan.world)}"
        told = [*lifted_lines(plan), *skipped_lines(plan.skipped, count)]
        return "\n".join([f"{name}: the plan holds{part}", spare, *told])
    lines = [f"{name}: the plan does not hold, {count_noun(len(report.violations), 'violation')}"]
    most = COMMANDS.max_listed
    lines += [f"  {violation.text}" for violation in report.violations[:most]]
    if len(report.violations) > most:
        lines.append(f"  ... and {len(report.violations) - most} more")
    return "\n".join(lines)


def spare_text(margins: Mapping[str, float], world: World) -> str:
    """Return what a plan has to spare, beside what was asked for.

    "Of" stands before what was allowed at most, "over" before what was demanded at least. Distances are
    measured up to a few centimetres: what is farther has "at least" that to spare.
    """
    asked = _required_number(world)
    parts = []
    for name, value in margins.items():
        capped = name in ("arm", "self", "contact") and value >= VERIFICATION.proofs.margin_range
        unit = _UNITS.get(name, " m")
        text = f"{name} {'at least ' if capped else ''}{value:z.4f}{unit}"
        parts.append(text + (f" {asked[name][0]} {asked[name][1]:g}{unit}" if name in asked else ""))
    return ", ".join(parts)


def _required_number(world: World) -> dict[str, tuple[str, float]]:
    """Return what a world allows at most ("of") or demands at least ("over"), if it is one number above 0."""
    rules, criteria = world.rules, world.rules.criteria
    cones = {target.cone for target in world.task if target.direction is not None}
    cone = next(iter(cones)) if len(cones) == 1 else 0.0
    found = {
        "step": ("of", rules.step),
        "setpoint": ("of", rules.tolerance),
        "path": ("of", rules.planned_path_tolerance),
        "direction": ("of", cone),
        "orientation": ("of", cone),
        "contact": ("of", rules.deepest_contact),
        "clearance": ("over", world.asks_alike * (rules.clearance + round(world.base_allowance, 4))),
        "arm": ("over", rules.arm_clearance + round(world.arm_clearance - rules.arm_clearance, 4)),
    }
    if criteria is not None:
        found["manipulability"] = ("over", criteria.manipulability or 0.0)
        found["joint_margin"] = ("over", criteria.joint_margin or 0.0)
        if isinstance(criteria.effort, float):
            found["effort"] = ("of", criteria.effort)
    return {name: bound for name, bound in found.items() if bound[1] > 0}
