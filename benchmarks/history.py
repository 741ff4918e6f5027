"""Times of our own kernels and stages, kept from run to run: `make bench-history`.

No peers and no verdicts: pytest-benchmark saves every run and shows the last ones side by side.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from benchmarks.speed.areas import meander
from benchmarks.speed.mobile import TOLERANCE, task
from regionik.mfabrik import Solver
from regionik.pipeline import search
from regionik.planners.kernels import compiled_at_once
from regionik.pruning import whole_path
from regionik.reachability.reach import reach
from regionik.scene import scene_of
from regionik.verification.verifier import verify
from regionik.worlds.documents.world_file import load_world

Timed = Callable[..., Any]  # pytest-benchmark's fixture: calls what it is given, many times


@pytest.fixture(scope="module", autouse=True)
def compiled_kernels() -> Iterator[None]:
    with compiled_at_once():
        yield


def test_one_solve(benchmark: Timed) -> None:
    some = task(1)
    solver = Solver(some.robot, tolerance=TOLERANCE)
    assert benchmark(solver, some.targets[0], some.bases[0], some.joints[0]).converged


def test_batch_of_10_000(benchmark: Timed) -> None:
    some = task(10_000)
    solver = Solver(some.robot, tolerance=TOLERANCE)
    assert benchmark(solver.batch, some.targets, some.bases, some.joints).converged.all()


def test_areas_and_pruning_of_1000(benchmark: Timed) -> None:
    assert len(benchmark(whole_path, meander(1000, 1000))[1].inner) >= 1000


def test_reach_of_200(benchmark: Timed) -> None:
    world = load_world("l_shape")
    spots = np.random.default_rng(0).uniform([0, 0, 0.1], [4, 4, 0.8], (200, 3))
    assert len(benchmark(reach, world, spots).verdict) == 200


@pytest.mark.parametrize("name", ["l_shape", "pillar", "shelf"])
def test_plan(benchmark: Timed, name: str) -> None:
    assert benchmark(search, load_world(name)).setpoints


def test_verify(benchmark: Timed) -> None:
    assert benchmark(verify, search(scene_of(load_world("l_shape")))).ok
