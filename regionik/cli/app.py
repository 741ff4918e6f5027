"""The command line: parse, call, print.

Exit codes: 0 done; 1 the answer is no, explained; 2 the input is wrong, one line; 3 an engine failed, one
line; 130 interrupted (143 by SIGTERM). Commands import what is heavy in their bodies, so that help is quick.
"""

from __future__ import annotations

import errno
import os
import select
import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Annotated, NoReturn

import typer

from regionik import __version__
from regionik.cli.compare import compare_methods
from regionik.cli.console import describe_failure, print_error
from regionik.cli.exit_codes import ExitCode
from regionik.cli.interrupts import end_process, exit_code, is_interrupted, print_interrupted
from regionik.cli.plan import (
    export_plan,
    list_worlds,
    plan_world,
    plot_plan,
    retime_plan,
    show_scene,
    verify_plan,
    warm_up,
)
from regionik.cli.reach import explain_world, find_stops, map_reach, reach_targets
from regionik.cli.simulate import simulate_plan
from regionik.worlds.errors import InputError, RegionikError

DISK_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # of stdout; files have their own message

app = typer.Typer(
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Exact base areas and whole-path planning for mobile manipulators.",
    epilog="Exit codes: 0 done; 1 the answer is no, explained; 2 the input is wrong; 3 a library failed; "
    "130 interrupted.",
)


def run_process() -> NoReturn:
    """Run the command of this process and leave with its exit code."""
    warnings.showwarning = lambda message, *_: print_error(f"note: {message}")
    end_process(run(sys.argv[1:]))


def run(arguments: Sequence[str]) -> int:
    """Run one command and return its exit code; failures become messages, never a traceback."""
    try:
        code = app(args=_fold_targets(arguments), prog_name="regionik", standalone_mode=False)
        sys.stdout.flush()
    except (KeyboardInterrupt, typer.Abort):
        code = ExitCode.INTERRUPTED
    except typer.TyperException as error:
        context = getattr(error, "ctx", None)
        command = "regionik" if context is None else context.command_path
        print_error(f"{error.format_message()} ({command} --help lists what there is)")
        return ExitCode.WRONG_INPUT
    except InputError as error:
        print_error(str(error))
        return ExitCode.WRONG_INPUT
    except (SystemExit, OSError) as error:
        if isinstance(error, SystemExit) and error.code == ExitCode.DONE and error.__context__ is None:
            return ExitCode.DONE  # a shell was told how words go on
        return _end_without_stdout(error)
    except Exception as error:
        if not is_interrupted():
            print_error(str(error) if isinstance(error, RegionikError) else describe_failure(error))
            return ExitCode.ENGINE_FAILED
        code = ExitCode.INTERRUPTED  # an interrupted import fails when it is tried again
    if code != ExitCode.INTERRUPTED:
        return int(code or ExitCode.DONE)
    print_interrupted()
    return exit_code()


def _end_without_stdout(error: BaseException) -> int:
    """End a command that cannot write on stdout: its reader left, as in ``| head -1``, or the disk is full.

    Typer makes a broken pipe a SystemExit. An error from elsewhere is a failure as any other.
    """
    cause = error.__context__ if isinstance(error, SystemExit) else error
    reader_gone = isinstance(cause, BrokenPipeError) and _is_reader_gone()
    if not reader_gone and getattr(cause, "errno", None) not in DISK_ERRORS:
        print_error(describe_failure(cause))
        return ExitCode.ENGINE_FAILED
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    if reader_gone:
        return ExitCode.DONE
    print_error(f"stdout: cannot be written: {cause}")
    return ExitCode.WRONG_INPUT


def _is_reader_gone() -> bool:
    stdout = select.poll()
    stdout.register(1, 0)
    return bool(stdout.poll(0))


def _fold_targets(arguments: Sequence[str]) -> list[str]:
    """Join the numbers after each ``--target``: typer cannot repeat an option of several values."""
    folded: list[str] = []
    rest = list(arguments)
    while rest:
        word = rest.pop(0)
        folded.append(word)
        if word == "--target":
            count = next((k for k, word in enumerate(rest[:7]) if not _is_number(word)), len(rest[:7]))
            folded.append(" ".join(rest[: max(count, 1)]))
            del rest[: max(count, 1)]
    return folded


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", "-V", help="Print the version and leave.")] = False,
) -> None:
    if version:
        print(f"regionik {__version__}")
        raise typer.Exit(ExitCode.DONE)
    if context.invoked_subcommand is None:
        print(context.get_help())


COMMANDS: dict[str, Callable[..., None]] = {
    "worlds": list_worlds,
    "plan": plan_world,
    "reach": reach_targets,
    "compare": compare_methods,
    "stops": find_stops,
    "field": map_reach,
    "verify": verify_plan,
    "show": show_scene,
    "export": export_plan,
    "plot": plot_plan,
    "retime": retime_plan,
    "simulate": simulate_plan,
    "why": explain_world,
    "warm-up": warm_up,
}
for name, command in COMMANDS.items():
    app.command(name)(command)
