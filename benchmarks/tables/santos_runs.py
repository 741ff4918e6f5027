"""What tables 2 to 6 and experiment 4 of Santos et al. (IEEE Access 2020) measure, M-FABRIK.

Scenes that the paper only draws are those of the bundled worlds `free`, `pillar`, `wall` and `l_shape`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
import shapely
from numpy.typing import ArrayLike

from benchmarks.tables.clock import REPEATS, seconds
from benchmarks.tables.sliding import SlidingRival
from regionik.mfabrik import Solver, configurations, solver_for
from regionik.papers.rivals.iterative import DampedLeastSquares, PseudoInverse, SmallSteps
from regionik.planners.driving.greedy_steps import greedy_points
from regionik.planners.geometry.polygons import FlatPolygon, clamp
from regionik.postures.poses import axis_of
from regionik.pruning import choose_chain, solvers_along, start_place, start_pose, whole_path
from regionik.scene import scene_of
from regionik.values import Batch, Configuration
from regionik.worlds.arrays import Array, Mask
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world

OURS, SMALL_STEPS = "M-FABRIK", "pseudo-inverse, small steps"
RUNS = 1000
SEED = 1
WIDE = 1.0  # targets lie within this of the base along x and y [m]
LOW, HIGH = 0.147, 0.3  # their heights: from the shoulder up [m]
ACCURACY = 1e-3  # in experiments 1 to 3 [m]
EDGE = 1e-6  # bases stand on the edge of the free floor, to rounding [m]


class Method(Protocol):
    """What the tables ask of a solver: the calls of `regionik.mfabrik.Solver`."""

    def __call__(self, target: ArrayLike, base: ArrayLike, joints: ArrayLike, /) -> Configuration: ...

    def batch(self, targets: ArrayLike, bases: ArrayLike, joints: ArrayLike, /) -> Batch: ...


def methods(accuracy: float) -> Mapping[str, Method]:
    """What is measured beside the paper, by the names of its columns; joint limits are ignored, as there."""
    robot = load_world("free").robot
    return {
        "pseudo-inverse": SlidingRival.make(PseudoInverse, robot, accuracy),
        SMALL_STEPS: SlidingRival.make(SmallSteps, robot, accuracy),
        "DLS": SlidingRival.make(DampedLeastSquares, robot, accuracy),
        OURS: Solver(robot, tolerance=accuracy, heading="face_target"),
    }


class Cases(NamedTuple):
    """Targets (n, 3), and bases (n, 3) and joints (n, 5) to start from."""

    targets: Array
    bases: Array
    joints: Array


def cases() -> Cases:
    """Random targets and postures; the paper says of neither where they lie."""
    rng, chain = np.random.default_rng(SEED), robot_named("youbot").chain
    targets = np.column_stack([rng.uniform(-WIDE, WIDE, (RUNS, 2)), rng.uniform(LOW, HIGH, RUNS)])
    return Cases(targets, np.zeros((RUNS, 3)), rng.uniform(chain.lower, chain.upper, (RUNS, 5)))


def at_random(accuracy: float) -> dict[str, Batch]:
    """Table 3: what each method makes of the random targets."""
    return {name: method.batch(*cases()) for name, method in methods(accuracy).items()}


def times_at_random(accuracy: float) -> dict[str, float]:
    """Table 2: time of all targets in one call [s]."""
    given = cases()

    def timed(method: Method) -> float:
        return seconds(lambda: method.batch(*given))

    return {name: timed(method) for name, method in methods(accuracy).items()}


@dataclass(frozen=True, eq=False)
class Followed:
    """A path followed set-point by set-point: configurations, and the time of each [s]."""

    found: tuple[Configuration, ...]
    seconds: Array


def experiment_1() -> dict[str, Followed]:
    """Tables 4 and 5: every set-point from the answer to the one before."""
    world = load_world("free")
    assert world.start is not None
    here, targets = (world.start.base, world.start.joints), [target.position for target in world.task]
    return {name: _followed(method, targets, *here) for name, method in methods(ACCURACY).items()}


def _followed(method: Method, targets: list[Array], base: Array, joints: Array) -> Followed:
    found: list[Configuration] = []
    for target in targets:
        found.append(method(target, base, joints))
        base, joints = found[-1].base, found[-1].joints
    starts = [Configuration(base, joints, 0.0, 0, True), *found]
    rows = list(zip(targets, starts, strict=False))
    taken = [_each(lambda row: method(row[0], row[1].base, row[1].joints), rows) for _ in range(REPEATS)]
    return Followed(tuple(found), np.median(taken, axis=0))


def _each(call: Callable[[Any], Any], rows: list[Any]) -> Array:
    """Processor time of a call on each row [s]."""
    marks = [time.process_time()]
    for row in rows:
        call(row)
        marks.append(time.process_time())
    return np.diff(marks)


class Row(NamedTuple):
    """A row of table 6.

    Attributes
    ----------
    setpoint : int
        Counted from 1.
    iterations : int or None
        None for an intermediate configuration that carries the arm, its target being out of reach.
    miss : float
        Distance of the tool from the target [m].
    """

    setpoint: int
    iterations: int | None
    miss: float


def pruned_components(name: str) -> Mask:
    """Experiment 4: which components of a bundled world's ladder are kept."""
    return whole_path(scene_of(load_world(name)))[2].keep


def experiment(name: str) -> list[Row]:
    """Table 6, experiment 4: the configurations of a bundled world, and those of Algorithm 2 between them.

    Algorithm 2 is asked wherever the straight way between two bases leaves the free floor.
    """
    world = load_world(name)
    free_space, _, pruned = whole_path(scene_of(world))
    chain = choose_chain(pruned, free_space, start_place(scene_of(world)))
    base, joints = start_pose(scene_of(world), pruned, chain[0])
    solvers = solvers_along(scene_of(world), pruned.ladder, free_space, chain)
    free = shapely.union_all(free_space.pieces.polygon)
    rows = []
    for i, goal in enumerate(configurations(world.task, solvers, (base, joints))):
        here, there = axis_of(world.robot, base), axis_of(world.robot, goal.base)
        if not free.buffer(EDGE).covers(shapely.LineString([here, there])):
            arm = solver_for(scene_of(world), pruned.ladder.family[chain[i]])
            flat = FlatPolygon.from_shapely(free)
            x, y = clamp(flat.vertices, flat.starts, *here)
            steps, _ = greedy_points(flat.vertices, flat.starts, x, y, there[0], there[1], world.rules.step)
            for spot in steps[1:-1]:
                held = arm.hold(world.task[i], np.array([*spot, base[2]]), joints)
                rows.append(Row(i + 1, held.iterations if held.converged else None, held.error))
        rows.append(Row(i + 1, goal.iterations, goal.error))
        base, joints = goal.base, goal.joints
    return rows
