"""`regionik.Solver` on arms that people own and on random ones: met, iterations and time beside rivals.

Targets are tool points of postures drawn within the limits, the base anywhere on the floor, so all are in
reach; every method starts from the base at the origin and the same posture. Met means: within 0.1 mm and
within the limits, by plain forward kinematics. To damped least squares and to Pink the base is two slides.
Times are of the processor and compare within one run; rivals' are multiples of ours.

Arms come by their rows (`tests.known_arms`), from installed URDF files, and at random (`tests.random_arms`):
wrists, links set off, slides, tilted axes, and all of these through URDF. What is missed is named.
Absent robots and rivals are named. Needs: pip install example-robot-data pin pin-pink daqp

Run: python -m benchmarks.bench_solver [random arms of a kind] [targets an arm]
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import groupby
from typing import NamedTuple

import numpy as np

import regionik as rik
from benchmarks.bench_urdf import ARMS, installed
from benchmarks.ik_peers import pink
from regionik.papers.comparison import by_sliding_base
from regionik.papers.rivals.iterative import DampedLeastSquares
from regionik.planners.kernels import compiled_at_once
from regionik.worlds.arms import sliding_chain
from regionik.worlds.arrays import Array
from regionik.worlds.chain import spread_postures
from tests.known_arms import NAMES, known_robot
from tests.random_arms import KINDS, random_robot

TOLERANCE = 1e-4  # [m]
LEAST_SHARE = 0.999  # of targets that `regionik.Solver` meets
SLACK = 1e-9  # rounding at limits [m], [rad]
STOCK = ("Panda", "xArm7", "UR5", "TIAGo without hand")  # of `ARMS`
PINK_TARGETS = 10  # an arm: it takes tens of milliseconds a target
PINK_STEPS, PINK_STARTS = 60, 3


class Found(NamedTuple):
    """What a method has come to, and its iterations where it tells them."""

    base: Array  # (3,)
    joints: Array  # (dof,)
    iterations: int | None


Solve = Callable[[Array, Array, Array], Found]  # of a target point, a base pose and joints


@dataclass
class Score:
    """What a method has met so far."""

    missed: list[str] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)
    times: list[float] = field(default_factory=list)

    def add(self, name: str, found: Found, met: bool, took: float) -> None:
        if not met:
            self.missed.append(name)
        if found.iterations is not None:
            self.iterations.append(found.iterations)
        self.times.append(took)

    def text(self, unit: float) -> str:
        asked = len(self.times)
        steps = f"{np.median(self.iterations):4.0f} iterations" if self.iterations else " " * 15
        took = f"{np.median(self.times) / unit:7.2f}"
        return f"{asked - len(self.missed):5} of {asked:5}, {steps}, {took}"


def robots(count: int) -> Iterator[tuple[str, str, rik.Robot]]:
    """Yield group, name and robot: known ones each a group, random ones by their kinds."""
    for name in NAMES:
        yield name, name, known_robot(name)
    for name, package, end, root, tip in ARMS:
        if name in STOCK:
            path = installed(package, end)
            if path is None:
                print(f"{name} by its URDF file: absent: {package}")
            else:
                yield f"{name} by URDF", name, rik.load_robot(path, root=root, tip=tip)
    for row, kind in enumerate(KINDS):
        for k in range(count):
            yield f"{kind}, {count} arms", f"{kind} {k}", random_robot(kind, np.random.default_rng([row, k]))


def drawn(robot: rik.Robot, count: int, seed: int = 0) -> list[Array]:
    """Tool points of postures within limits: targets that are in reach."""
    rng, chain = np.random.default_rng(seed), robot.chain
    lower, upper = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    bases = rng.uniform([-1, -1, -np.pi], [1, 1, np.pi], (count, 3))
    return [robot.tool(base, rng.uniform(lower, upper))[:3, 3] for base in bases]


def is_met(robot: rik.Robot, point: Array, found: Found) -> bool:
    chain, off = robot.chain, np.linalg.norm(robot.tool(found.base, found.joints)[:3, 3] - point)
    within = (found.joints >= chain.lower - SLACK).all() and (found.joints <= chain.upper + SLACK).all()
    return bool(within and off <= TOLERANCE * (1 + 1e-6))


def by_solver(robot: rik.Robot) -> Solve:
    solver = rik.Solver(robot, tolerance=TOLERANCE)

    def solve(point: Array, base: Array, joints: Array) -> Found:
        answer = solver(point, base, joints)
        return Found(answer.base, answer.joints, answer.iterations)

    return solve


def by_least_squares(robot: rik.Robot) -> Solve:
    method = DampedLeastSquares(sliding_chain(robot.chain), TOLERANCE)

    def solve(point: Array, base: Array, joints: Array) -> Found:
        answer = by_sliding_base(robot, method, rik.Target(point), base, joints)
        return Found(answer.base, answer.joints, answer.iterations)

    return solve


def by_pink(robot: rik.Robot) -> Solve:
    """Pink for the arm on two slides; an answer that it does not give counts as the start."""
    starts = spread_postures(robot.chain, 1.0, PINK_STARTS, 0)
    starts = np.column_stack([np.zeros((len(starts), 2)), starts])
    ask = pink(sliding_chain(robot.chain), TOLERANCE, 1.0, False, starts, PINK_STEPS)

    def solve(point: Array, base: Array, joints: Array) -> Found:
        T_world_arm, goal = robot.T_world_arm(base), np.eye(4)
        goal[:3, 3] = np.linalg.solve(T_world_arm, np.append(point, 1.0))[:3]
        found = ask(goal, np.concatenate([np.zeros(2), joints]), np.array([0.0, 0.0, 0.0, 1.0]))
        if found is None:
            return Found(base, joints, None)
        shift = T_world_arm[:2, :2] @ found[:2]
        return Found(base + [*shift, 0.0], found[2:], None)

    return solve


def measured(robot: rik.Robot, name: str, count: int, scores: dict[str, Score]) -> None:
    """Ask every method for the targets of a robot."""
    points, base = drawn(robot, count), np.zeros(3)
    joints: Array = np.clip(np.full(robot.chain.dof, 0.3), robot.chain.lower, robot.chain.upper)
    for method, (make, most) in METHODS.items():
        with suppress(ModuleNotFoundError):
            solve = make(robot)
            solve(points[0], base, joints)
            for k, point in enumerate(points[:most]):
                begun = time.process_time()
                found = solve(point, base, joints)
                took = time.process_time() - begun
                scores[method].add(f"{name}, target {k}", found, is_met(robot, point, found), took)


METHODS: dict[str, tuple[Callable[[rik.Robot], Solve], int]] = {
    "rik.Solver": (by_solver, sys.maxsize),
    "damped least squares": (by_least_squares, sys.maxsize),
    "Pink": (by_pink, PINK_TARGETS),
}


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    targets = int(sys.argv[2]) if len(sys.argv) > 2 else 60
    warnings.simplefilter("ignore")
    met = asked = 0
    with compiled_at_once():
        for group, rows in groupby(robots(count), lambda row: row[0]):
            scores = {method: Score() for method in METHODS}
            for _, name, robot in rows:
                measured(robot, name, targets, scores)
            ours = scores["rik.Solver"]
            unit = float(np.median(ours.times))
            asked, met = asked + len(ours.times), met + len(ours.times) - len(ours.missed)
            print(f"{group}; a target of ours takes {1e3 * unit:.3f} ms", flush=True)
            for method, score in scores.items():
                print(f"  {method:20} {score.text(unit)}" if score.times else f"  {method:20} absent")
            if ours.missed:
                print(f"  missed: {'; '.join(ours.missed)}")
    print(f"rik.Solver met {met} of {asked}: {100 * met / asked:.3f} %")
    if met < LEAST_SHARE * asked:
        sys.exit(f"expected at least {100 * LEAST_SHARE:g} %")


if __name__ == "__main__":
    main()
