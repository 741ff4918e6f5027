"""Programs of `benchmarks/` that check what they measure, on small numbers: none of them finds a fault."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}  # programs share parts of the tables
PROGRAMS = {
    "points inside areas are reached, none outside": "bench_reach --pairs 6 --points 10 --starts 200",
    "circle and door are met to rounding, without slip": "bench_tracker",
}


@pytest.mark.slow
@pytest.mark.parametrize("command", PROGRAMS.values(), ids=list(PROGRAMS))
def test_what_is_measured_is_right(command: str) -> None:
    program, *arguments = command.split()
    run = [sys.executable, f"benchmarks/{program}.py", *arguments]
    done = subprocess.run(run, cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
