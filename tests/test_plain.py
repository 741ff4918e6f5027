"""Kernels as plain Python, with NUMBA_DISABLE_JIT or one at a time, say what the compiled ones say."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
import shapely

import regionik as rik
from benchmarks.tables.goals import aim_at, solve_goal
from regionik.mfabrik import Solver
from regionik.planners.geometry import polygons
from regionik.planners.solvers.multistart_ik import ArmSolver
from regionik.worlds.bundled import robot_named
from tests import MINUTES
from tests.twice import kernels_called_twice


def answers() -> list[list[float]]:
    """Some configurations of planar arms, and postures of one in space."""
    found = []
    for name in ("youbot-real",):
        solver = Solver(robot_named(name))
        for x in (0.6, 1.0):
            one = solver([x, 0.2, 0.25], [0, 0, 0], robot_named(name).carry)
            found.append([*one.base.tolist(), *one.joints.tolist()])
    chain = robot_named("pioneer7").chain
    rng = np.random.default_rng(3)
    for _ in range(1):
        tool = chain.frames(rng.uniform(-1, 1, chain.dof))[-1] @ chain.T_last_tool
        for goal in (aim_at(tool[:3, 3]), aim_at(tool[:3, 3], orientation=tool[:3, :3])):
            found.append(solve_goal(ArmSolver(chain), goal, np.zeros(chain.dof)).joints.tolist())
    return found


def test_plain_python_gives_the_same_numbers() -> None:
    command = [sys.executable, "-W", "error", "-m", "tests.test_plain"]
    there = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, env=there, capture_output=True, text=True, check=True)
    for mine, other in zip(answers(), json.loads(done.stdout), strict=True):
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "name", [pytest.param("pipe", marks=MINUTES), pytest.param("tao1", marks=pytest.mark.slow)]
)
def test_each_kernel_of_a_plan_says_the_same_as_plain_python(name: str) -> None:
    with kernels_called_twice():
        plan = rik.plan(rik.load_world(name))
    assert rik.verify(plan).ok


@pytest.mark.parametrize(
    "name", [pytest.param("l_shape", marks=pytest.mark.slow), pytest.param("shelf", marks=MINUTES)]
)
def test_each_kernel_of_bulk_answers_says_the_same_as_plain_python(name: str) -> None:
    world = rik.load_world(name)
    targets = np.random.default_rng(0).uniform([-1, -1, 0], [3, 3, 1], (10, 3))
    with kernels_called_twice():
        found = rik.reach(world, targets)
    np.testing.assert_array_equal(found.reachable, rik.reach(world, targets).reachable)


def test_each_kernel_of_a_batch_says_the_same_as_plain_python() -> None:
    solver, count = Solver(robot_named("youbot")), 40
    targets = np.random.default_rng(0).uniform([-1, -1, 0], [1, 1, 0.5], (count, 3))
    starts = np.zeros((count, 3)), np.tile(robot_named("youbot").carry, (count, 1))
    with kernels_called_twice():
        found = solver.batch(targets, *starts)
    np.testing.assert_array_equal(found.joints, solver.batch(targets, *starts).joints)


def test_a_kernel_that_says_something_else_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    square = polygons.FlatPolygon.from_shapely(shapely.box(0, 0, 1, 1))
    assert not polygons.contains(square.vertices, square.starts, 1.1, 0.5)
    monkeypatch.setattr(
        polygons, "ON_EDGE", 0.2
    )  # for plain Python; what is compiled keeps the number it knew
    with kernels_called_twice(), pytest.raises(AssertionError, match="plainly"):
        polygons.contains(square.vertices, square.starts, 1.1, 0.5)


if __name__ == "__main__":
    print(json.dumps(answers()))
