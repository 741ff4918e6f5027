"""Inverse kinematics of real arms: ours and that of others, asked for the same targets.

Targets are tool poses of postures drawn evenly within the limits, and every solver starts from the same other
such posture. Solved means: within 0.1 mm (and 1e-3 rad), all joints within their limits, by our plain forward
kinematics. One core; each solver is warm; times hold for all targets, solved or not, as seen from Python.

Absent robots and solvers are named. Needs: pip install example-robot-data pytracik pin-pink daqp
roboticstoolbox-python

Run: python -m benchmarks.bench_ik [targets] [robot]...
"""

from __future__ import annotations

import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress

import numpy as np
from scipy.spatial.transform import Rotation

import regionik as rik
from benchmarks.bench_urdf import ARMS, installed
from benchmarks.ik_peers import Ask, bounds, pink, toolbox, trac_ik
from benchmarks.tables.goals import aim_at, solve_goal
from regionik.planners.solvers.multistart_ik import ArmSolver, solve_ik
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, spread_postures

POSITION, ANGLE = 1e-4, 1e-3  # [m], [rad]
SLACK = 1e-6  # beyond limits that a peer may round
ROBOTS = ("TIAGo without hand", "UR5", "UR10", "Panda", "xArm7", "Kinova", "Baxter, left")
FEW = 200  # targets for a peer that takes tens of milliseconds a target


def ours(chain: Chain, posed: bool) -> Ask:
    solver = ArmSolver(chain, POSITION, ANGLE)

    def ask(T: Array, start: Array, _turn: Array) -> Array | None:
        answer = solve_goal(solver, aim_at(T[:3, 3], orientation=T[:3, :3] if posed else None), start)
        return answer.joints if answer.converged else None

    return ask


def kernel(chain: Chain, posed: bool) -> Ask:
    """The compiled solver alone: without what checks and confirms."""
    solver = ArmSolver(chain, POSITION, ANGLE)

    def ask(T: Array, start: Array, _turn: Array) -> Array | None:
        aim, q = aim_at(T[:3, 3], orientation=T[:3, :3] if posed else None), start.copy()
        bodies = solver.bodies(aim.kind)
        begun = time.perf_counter()
        solve_ik(bodies, aim, np.ascontiguousarray(solver.starts[:, : len(bodies.slide)]), solver.effort, q)
        inside.append(time.perf_counter() - begun)
        return q

    inside: list[float] = []
    ask.inside = inside  # type: ignore[attr-defined]
    return ask


def contenders(chain: Chain, posed: bool) -> Iterator[tuple[str, Callable[[], Ask]]]:
    """Every solver with its settings; those of peers are the best of the few that were tried."""
    starts = spread_postures(chain, 1.0, 10, 0)
    yield "regionik", lambda: ours(chain, posed)
    yield "regionik, kernel", lambda: kernel(chain, posed)
    if posed:  # its Python door has no bounds, so no position alone
        yield "trac-ik, 5 ms", lambda: trac_ik(chain, POSITION, 0.005)
        yield "trac-ik, 50 ms", lambda: trac_ik(chain, POSITION, 0.05)
    yield "toolbox LM chan", lambda: toolbox(chain, POSITION, posed, "chan", 1.0, 1.0, 100)
    yield "toolbox LM chan 0.1", lambda: toolbox(chain, POSITION, posed, "chan", 0.1, 1.0, 100)
    yield "toolbox LM sugihara", lambda: toolbox(chain, POSITION, posed, "sugihara", 1e-4, 1.0, 100)
    yield "pink, daqp", lambda: pink(chain, POSITION, ANGLE, posed, starts, 50)


def line(chain: Chain, posed: bool, name: str, make: Callable[[], Ask], count: int) -> str:
    try:
        ask = make()
    except ModuleNotFoundError as error:
        return f"{name:20} absent: {error.name}"
    lower, upper = bounds(chain)
    rng = np.random.default_rng(1)
    targets = chain.forward(rng.uniform(lower, upper, (count, chain.dof)))
    starts = rng.uniform(lower, upper, (count, chain.dof))
    turns = Rotation.from_matrix(targets[:, :3, :3]).as_quat()
    for k in range(3):
        ask(targets[k], starts[k], turns[k])
    inside = getattr(ask, "inside", None)
    times, solved = [], 0
    if inside is not None:
        inside.clear()
    for k in range(count if not name.startswith("pink") else min(count, FEW)):
        begun = time.perf_counter()
        joints = ask(targets[k], starts[k], turns[k])
        times.append(time.perf_counter() - begun)
        solved += joints is not None and is_solved(chain, targets[k], joints, posed)
    spent = 1e3 * np.array(times if inside is None else inside)
    share = 100 * solved / len(times)
    middle, most = np.median(spent), np.percentile(spent, 99)
    return (
        f"{name:20} {share:6.2f} % of {len(times):4}, median {middle:7.3f} ms, mean {spent.mean():7.3f}, "
        f"99 % within {most:7.2f}"
    )


def is_solved(chain: Chain, T: Array, joints: Array, posed: bool) -> bool:
    tool = chain.forward(joints)
    within = (joints >= chain.lower - SLACK).all() and (joints <= chain.upper + SLACK).all()
    angle = float(Rotation.from_matrix(T[:3, :3].T @ tool[:3, :3]).magnitude()) if posed else 0.0
    return bool(within and np.linalg.norm(tool[:3, 3] - T[:3, 3]) <= POSITION and angle <= ANGLE)


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    wanted = sys.argv[2:] or ROBOTS
    with suppress(AttributeError):  # where the system has it
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    warnings.simplefilter("ignore")
    for name, package, end, root, tip in ARMS:
        if name not in wanted:
            continue
        path = installed(package, end)
        if path is None:
            print(f"{name}: absent: {package}")
            continue
        robot = rik.load_robot(path, root=root, tip=tip)
        for posed in (False, True):
            print(f"\n{name}, {robot.chain.dof} joints, {'full pose' if posed else 'position'}", flush=True)
            for solver, make in contenders(robot.chain, posed):
                print("  " + line(robot.chain, posed, solver, make, count), flush=True)


if __name__ == "__main__":
    main()
