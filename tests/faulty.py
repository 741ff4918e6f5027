"""Commands that are asked to end in the middle of a stage: ``python -m tests.faulty FOLDER``.

All is imported once; each command then runs in a fork of this process, which has no threads.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
import threading
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

SOON = 0.05  # after a stage has begun [s]
LONGEST = 120.0  # a command that has not ended by then is taken for one that hangs [s]


class Case(NamedTuple):
    """A command, the function that is replaced while it runs, and what by."""

    command: str
    function: str
    instead: str


PLAN = "plan {world} -o plan.json --html plan.html"
CASES = {
    "load": Case(PLAN, "regionik.worlds.documents.world_file.load_world", "interrupted"),
    "areas": Case(PLAN, "regionik.pruning.path_areas", "interrupted"),
    "pruning": Case(PLAN, "regionik.pruning.prune", "interrupted"),
    "configurations": Case(PLAN, "regionik.motion.configurations", "interrupted"),
    "motion": Case(PLAN, "regionik.pipeline.connect_setpoints", "interrupted"),
    "verification": Case(PLAN, "regionik.smoothing.smooth_motion.verify", "interrupted"),
    "page": Case(PLAN, "regionik.view.page.html_page", "interrupted"),
    "writing": Case("plan {world} -o plan.json", "os.fsync", "interrupted"),
    "terminated": Case(PLAN, "regionik.pipeline.connect_setpoints", "terminated"),
    "terminated while it writes": Case("plan {world} -o plan.json", "os.fsync", "terminated"),
    "a kernel that does not end": Case(PLAN, "regionik.pruning.prune", "compiled"),
    "an engine that is imported": Case(PLAN, "regionik.pipeline.connect_setpoints", "imported"),
    "a tree that never connects": Case(PLAN, "regionik.pipeline.connect_setpoints", "grown"),
    "a program without an end": Case(PLAN, "regionik.pruning.prune", "solved"),
    "a library that swallows it": Case(PLAN, "regionik.pruning.prune", "swallowed"),
    "reach": Case(
        "reach {world} --csv {table} -o answers.csv", "regionik.output.answers.reach", "interrupted"
    ),
    "why": Case("why {world} --target 9 9 0.2 --html why.html", "regionik.pipeline.why", "interrupted"),
    "stops": Case("stops l_shape -o stops.geojson", "regionik.parking.stops.find", "interrupted"),
    "field": Case("field {world} -o field.npz", "regionik.reachability.field.reach_field", "interrupted"),
    "no room": Case("plan {world} -o plan.json", "regionik.smoothing.smooth_motion.verify", "cramped"),
    "killed while it writes": Case("plan {world} -o plan.json", "os.fsync", "killed"),
}


def interrupted(original: Callable[..., Any]) -> Callable[..., Any]:
    return _asked_at_once(original, signal.SIGINT)


def terminated(original: Callable[..., Any]) -> Callable[..., Any]:
    return _asked_at_once(original, signal.SIGTERM)


def killed(original: Callable[..., Any]) -> Callable[..., Any]:
    return _asked_at_once(original, signal.SIGKILL)


def _asked_at_once(original: Callable[..., Any], number: int) -> Callable[..., Any]:
    def stage(*arguments: Any, **options: Any) -> Any:
        _ask(number)
        return original(*arguments, **options)

    return stage


def _ask(number: int) -> None:
    os.kill(os.getpid(), number)


def _asked_soon() -> None:
    threading.Timer(SOON, _ask, [signal.SIGINT]).start()


def compiled(_: Callable[..., Any]) -> Callable[..., Any]:
    """A stage that is in one compiled call for ever."""
    from regionik.planners.kernels import compiled as compile_kernel
    from regionik.planners.kernels import compiled_at_once

    def endless(x: float) -> float:
        while x > 0.0:
            x = x / 2.0 + 1.0
        return x

    kernel = compile_kernel(endless)
    with compiled_at_once():
        kernel(-1.0)

    def stage(*_: Any, **__: Any) -> None:
        _asked_soon()
        kernel(1.0)

    return stage


def imported(_: Callable[..., Any]) -> Callable[..., Any]:
    """A stage in which OMPL is imported: an exception in the middle of that ends the process."""
    import enum

    import numpy as np

    from regionik.planners.driving.sampling import PlanningProblem, connect

    def stage(*_: Any, **__: Any) -> None:
        create = enum.EnumType.__call__

        def asked(*arguments: Any, **options: Any) -> Any:
            setattr(enum.EnumType, "__call__", create)  # noqa: B010
            _ask(signal.SIGINT)
            return create(*arguments, **options)

        setattr(enum.EnumType, "__call__", asked)  # noqa: B010
        ends = np.full(2, 0.1), np.full(2, 0.9)
        problem = PlanningProblem(np.zeros(2), np.ones(2), *ends, lambda p: True, lambda p, q: True)
        connect(problem, seed=0, iterations=9)

    return stage


def grown(_: Callable[..., Any]) -> Callable[..., Any]:
    """A stage in which a tree grows that may not get where it should."""
    import numpy as np

    from regionik.planners.driving.sampling import PlanningProblem, connect

    def stage(*_: Any, **__: Any) -> None:
        _asked_soon()
        problem = PlanningProblem(
            np.zeros(2), np.ones(2), np.full(2, 0.1), np.full(2, 0.9), lambda p: abs(p[0] - 0.5) > 0.1,
            lambda p, q: (p[0] < 0.5) == (q[0] < 0.5),
        )  # fmt: skip
        while True:
            connect(problem, seed=0, iterations=10**9)

    return stage


def solved(_: Callable[..., Any]) -> Callable[..., Any]:
    """A stage that solves an integer program for minutes."""
    import numpy as np
    from scipy.optimize import Bounds, LinearConstraint, milp

    drawn = np.random.default_rng(0)
    weights, worth = drawn.integers(0, 50, (60, 120)), -drawn.integers(1, 50, 120)
    room = LinearConstraint(weights, -np.inf, 0.3 * weights.sum(axis=1))

    def stage(*_: Any, **__: Any) -> None:
        _asked_soon()
        milp(worth, constraints=room, integrality=np.ones(120, dtype=np.int64), bounds=Bounds(0, 1))

    return stage


def swallowed(_: Callable[..., Any]) -> Callable[..., Any]:
    """A stage that goes on whatever is raised."""

    def stage(*_: Any, **__: Any) -> None:
        _asked_soon()
        while True:
            try:
                time.sleep(2 * LONGEST)
            except KeyboardInterrupt:
                continue

    return stage


def cramped(original: Callable[..., Any]) -> Callable[..., Any]:
    """A stage after which files may have 1000 bytes."""

    def stage(*arguments: Any, **options: Any) -> Any:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
        return original(*arguments, **options)

    return stage


def outcome(case: Case, folder: Path, names: dict[str, str]) -> dict[str, Any]:
    """Run a command in a fork, in a folder of its own: exit code, None where it hung, stderr, files."""
    folder.mkdir()
    child = os.fork()
    if not child:
        os.chdir(folder)
        for number, file in ((1, "out"), (2, "err")):
            os.dup2(os.open(file, os.O_CREAT | os.O_WRONLY), number)
        module, _, name = case.function.rpartition(".")
        place = import_module(module)
        setattr(place, name, globals()[case.instead](getattr(place, name)))
        sys.argv = ["regionik", *case.command.format(**names).split()]
        import_module("regionik.__main__").main()
        os._exit(99)
    code = _ended(child)
    err = (folder / "err").read_text()
    files = sorted(path.name for path in folder.iterdir() if path.name not in ("out", "err"))
    return {"code": code, "err": err, "files": files}


def _ended(child: int) -> int | None:
    """Exit code of a process; None where it hung and was killed for it."""
    until = time.monotonic() + LONGEST
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.01)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def main() -> None:
    """Run all cases and print what came of each, as one JSON document."""
    from regionik.cli.app import run

    away = Path(sys.argv[1])
    table = away / "targets.csv"
    table.write_text("x,y,z\n1,0,0.3\n")
    for command in ("plan free -o {0}/plan.json --html {0}/plan.html", "why free", "stops l_shape"):
        run(command.format(away).split())  # all is imported, and compiled
    for case in CASES.values():
        import_module(case.function.rpartition(".")[0])
    names = {"world": "free", "table": str(table)}
    found = {name: outcome(case, away / name, names) for name, case in CASES.items()}
    (away / "found.json").write_text(json.dumps(found))


if __name__ == "__main__":
    main()
