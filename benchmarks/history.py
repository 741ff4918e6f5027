"""Times of our own kernels and stages, kept from run to run: `make bench-history`.

No peers and no verdicts: pytest-benchmark saves every run and shows the last ones side by side.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from benchmarks.page.growth import meander
from regionik.mfabrik import Solver
from regionik.pipeline import search
from regionik.planners.kernels import compiled_at_once
from regionik.pruning import whole_path
from regionik.reachability.reach import reach
from regionik.scene import scene_of
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world

TOLERANCE = 1e-3  # [m]
Timed = Callable[..., Any]  # pytest-benchmark's fixture: calls what it is given, many times


@pytest.fixture(scope="module", autouse=True)
def compiled_kernels() -> Iterator[None]:
    with compiled_at_once():
        yield


def test_batch_of_10_000(benchmark: Timed) -> None:
    robot, rng = robot_named("youbot"), np.random.default_rng(0)
    targets = np.column_stack([rng.uniform(-1, 1, (10_000, 2)), rng.uniform(0.1, 0.4, 10_000)])
    joints = rng.uniform(robot.chain.lower, robot.chain.upper, (10_000, robot.chain.dof))
    solver = Solver(robot, tolerance=TOLERANCE)
    assert benchmark(solver.batch, targets, rng.uniform(-1, 1, (10_000, 3)), joints).converged.all()


def test_areas_and_pruning_of_1000(benchmark: Timed) -> None:
    found = benchmark(lambda: whole_path(scene_of(meander(1000, 1000))))
    assert len(found[1].inner) >= 1000


def test_reach_of_200(benchmark: Timed) -> None:
    world = load_world("l_shape")
    spots = np.random.default_rng(0).uniform([0, 0, 0.1], [4, 4, 0.8], (200, 3))
    assert len(benchmark(reach, world, spots).verdict) == 200


@pytest.mark.parametrize("name", ["l_shape", "pillar", "shelf"])
def test_plan(benchmark: Timed, name: str) -> None:
    assert benchmark(lambda: search(scene_of(load_world(name)))).setpoints


def test_verify(benchmark: Timed) -> None:
    assert benchmark(verify, search(scene_of(load_world("l_shape")))).ok
