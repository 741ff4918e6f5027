"""Same world, same seed, same numbers: whatever the hash seed, the order of planning, the threads of BLAS."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from tests.determinism import NEAR, apart

NAMES = ["transits", "avoidance", "stops", "reach", "why"]
SALTS = ["0", "random"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, object]]:
    """What is planned in processes that differ in all that should not matter."""
    folder = tmp_path_factory.mktemp("made")
    found = []
    for k, salt in enumerate(SALTS):
        file = folder / f"{salt}.json"
        names = NAMES if k != 1 else NAMES[::-1]
        settings = {**os.environ, "PYTHONHASHSEED": salt, "OPENBLAS_NUM_THREADS": str(k + 1)}
        run = [sys.executable, "-W", "error", "-m", "tests.determinism", *names, "-o", str(file)]
        done = subprocess.run(run, env=settings, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        found.append(json.loads(file.read_text()))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_another_process_gives_the_same(name: str, made: list[dict[str, object]]) -> None:
    assert made[0][name] == made[1][name]


def test_the_comparison_sees_what_differs() -> None:
    one = {"a": [1.0, {"b": "x"}], "c": {"type": "Polygon", "coordinates": square(0.0)}}
    moved = {"a": [1.0 + 3e-9, {"b": "x"}], "c": {"type": "Polygon", "coordinates": square(0.0)[::-1]}}
    assert max(apart(one, one))[0] == 0.0
    assert max(apart(one, moved))[0] > NEAR
    assert max(apart(one, moved))[1] == ".a[0]"
    assert max(apart(one, {**one, "a": [1.0, {"b": "y"}]}))[0] == np.inf
    assert max(apart(one, {**one, "c": {"type": "Polygon", "coordinates": square(0.1)}}))[0] > 0.01


def square(x: float) -> list[list[list[float]]]:
    return [[[x, 0.0], [x + 1.0, 0.0], [x + 1.0, 1.0], [x, 1.0], [x, 0.0]]]
