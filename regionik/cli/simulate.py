"""The command simulate."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from regionik.cli.console import (
    PAGES,
    AsJson,
    DelayedProgress,
    PlanPath,
    check_output,
    file_names,
    print_json,
    print_message,
    read_plan,
)
from regionik.cli.exit_codes import ExitCode
from regionik.worlds.errors import InputError

if TYPE_CHECKING:
    from regionik.simulation.noise import Noise
    from regionik.simulation.run import SimulatedRun


def simulate_plan(
    path: PlanPath,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="A .csv or .mcap file of the run.")
    ] = None,
    html: Annotated[Path | None, typer.Option("--html", help="File for an offline page of the run.")] = None,
    noise: Annotated[
        str, typer.Option("--noise", metavar="none|typical|KEY=VALUE,...", help="What disturbs the robot.")
    ] = "none",
    seed: Annotated[int, typer.Option("--seed", min=0, max=2**31 - 1, help="Same seed, same run.")] = 0,
    tolerance: Annotated[
        float | None, typer.Option("--tolerance", help="Largest tool error, else rules.path_tolerance [m].")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Execute a timed plan in MuJoCo and tell how well the tool keeps to it.

    The exit code is 1 if the tool leaves its tolerance or something touches. Typical noise is localisation to
    10 mm and 0.5 degrees, 20 times a second and 50 ms late, and wheels that slip by 2 %; or give position
    [m], heading [rad], rate [1/s], delay [s] and slip.
    """
    check_output(output, (".csv", ".mcap"), [path])
    check_output(html, PAGES, [path])
    disturbances = _noise(noise)
    with DelayedProgress("simulate") as progress:
        plan = read_plan(path, progress)
        from regionik.simulation.simulate import simulate

        run = simulate(plan, disturbances, seed=seed, tolerance=tolerance)
        written = _write_run(run, output, html)
    print_message(_summary(run))
    if disturbances:
        errors = ", ".join(f"{key}: {value:g}" for key, value in asdict(run.execution).items())
        print_message(f"  this run needs rules.execution: {{{errors}}}")
    for one in written:
        print_message(f"  wrote {one}")
    if as_json:
        files = file_names(written)
        told = {"ok": run.ok, "failure": run.failure or None, **run.figures}
        print_json({**told, "execution": asdict(run.execution), "files": files})
    if not run.ok:
        raise typer.Exit(ExitCode.NO)


def _noise(text: str) -> Noise:
    """Read the value of ``--noise``."""
    from regionik.simulation.noise import Noise, typical_noise

    if text in ("none", "typical"):
        return typical_noise() if text == "typical" else Noise()
    keys, given = tuple(Noise.__dataclass_fields__), {}
    for part in text.split(","):
        key, _, value = part.strip().partition("=")
        try:
            given[key] = float(value)
        except ValueError:
            raise InputError(f"--noise: expected none, typical or KEY=NUMBER,..., got {part!r}") from None
        if key not in keys:
            raise InputError(f"--noise: unknown key {key!r}, valid keys: {', '.join(keys)}")
    return Noise(**given)


def _write_run(run: SimulatedRun, output: Path | None, html: Path | None) -> list[Path]:
    from regionik.storage.files import write_atomic

    written: dict[Path, str | bytes] = {}
    if output is not None:
        from regionik.simulation.run_file import run_to_csv, run_to_mcap

        written[output] = run_to_mcap(run) if output.suffix.lower() == ".mcap" else run_to_csv(run)
    if html is not None:
        from regionik.simulation.run_picture import picture_of_run
        from regionik.view.page import html_page

        written[html] = html_page(picture_of_run(run))
    for path, content in written.items():
        write_atomic(path, content)
    return list(written)


def _summary(run: SimulatedRun) -> str:
    figures, used = run.figures, run.figures["used"]
    error = {key: 1000 * value for key, value in figures["tool_error"].items()}
    shares = ", ".join(f"{name.replace('_', ' ')} {share:.0%}" for name, share in used.items())
    return "\n".join(
        [
            f"{run.plan.world.name}: {figures['duration']:.2f} s simulated, {run.failure or 'plan kept'}",
            f"  tool error: median {error['median']:.2f} mm, 95 % below {error['p95']:.2f} mm, "
            f"worst {error['worst']:.2f} mm",
            f"  tool speed held for {figures['speed_held']:.1%} of the time on the path",
            f"  base off by at most {1000 * figures['base_error']:.1f} mm",
            f"  used of limits: {shares}",
        ]
    )
