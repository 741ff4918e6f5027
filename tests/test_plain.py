"""Kernels as plain Python, with NUMBA_DISABLE_JIT, say what the compiled ones say."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np

from regionik.mfabrik import Solver
from regionik.planners.inverse import ArmSolver, Goal
from regionik.worlds.library import robot_named


def answers() -> list[list[float]]:
    """Some configurations of planar arms, and postures of one in space."""
    found = []
    for name in ("youbot", "youbot-real"):
        solver = Solver(robot_named(name))
        for x in (0.6, 1.0):
            one = solver([x, 0.2, 0.25], [0, 0, 0], robot_named(name).carry)
            found.append([*one.base.tolist(), *one.joints.tolist()])
    chain = robot_named("pioneer7").chain
    rng = np.random.default_rng(3)
    for _ in range(3):
        tool = chain.frames(rng.uniform(-1, 1, chain.dof))[-1] @ chain.T_last_tool
        for goal in (Goal(tool[:3, 3]), Goal(tool[:3, 3], orientation=tool[:3, :3])):
            found.append(ArmSolver(chain)(goal, np.zeros(chain.dof)).joints.tolist())
    return found


def test_plain_python_gives_the_same_numbers() -> None:
    command = [sys.executable, "-W", "error", "-m", "tests.test_plain"]
    there = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, env=there, capture_output=True, text=True, check=True)
    for mine, other in zip(answers(), json.loads(done.stdout), strict=True):
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-9)


if __name__ == "__main__":
    print(json.dumps(answers()))
