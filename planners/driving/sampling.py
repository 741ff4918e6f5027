"""Paths by OMPL's sampling planners: between two points of a box, or two poses on a floor.

The only file that imports ompl.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Lock, current_thread, main_thread
from typing import Any

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.drives import BasePlanner

_OMPL = Lock()  # its seed and its log level belong to the whole process

State = Any  # of OMPL: read by index, valid during the call only
BETTERING = ("RRTstar", "InformedRRTstar", "BITstar", "AORRTC")  # planners that use up their iterations


@dataclass(frozen=True, eq=False)
class PlanningProblem:
    """Two states of a space to be connected."""

    # lower, upper: (n,) the box to sample; a side of no width is widened by 1e-6
    lower: Array
    upper: Array
    # start, goal: (n,) different states that are free
    start: Array
    goal: Array
    state_is_free: Callable[[Any], bool]  # says if a state is free
    motion_is_free: Callable[[Any, Any], bool]  # says if the motion from one state to another is free
    planner: BasePlanner = "RRTConnect"  # by OMPL's name


def connect(
    problem: PlanningProblem, *, seed: int, iterations: int, stride: float | None = None
) -> Array | None:
    """Connect two points of a box by motions that are straight in its coordinates.

    Parameters
    ----------
    problem : PlanningProblem
        Its callables get points (n,).
    seed : int
        Same input, same path (k, n), whatever was planned before.
    iterations : int
        After which None is returned: a bound without a clock.
    stride : float, optional
        Longest motion, in the box's coordinates; a fifth of the box's diagonal by default.
    """
    count = len(problem.lower)

    def write(state: State, point: Array) -> None:
        for i, value in enumerate(point.tolist()):
            state[i] = value

    def read(state: State) -> Array:
        return np.array([state[i] for i in range(count)])

    with _ompl(seed) as (base, geometric):
        space = base.RealVectorStateSpace(count)
        return _connected(base, geometric, space, problem, write, read, iterations, stride)


def connect_poses(
    problem: PlanningProblem, *, turning_radius: float, seed: int, iterations: int
) -> Array | None:
    """Connect two poses (x, y [m], yaw [rad]) by motions that the problem makes and checks.

    Parameters
    ----------
    problem : PlanningProblem
        Its box (2,) holds positions; its callables get poses (3,).
    turning_radius : float
        Of the Reeds-Shepp curves that measure how near poses are and cut motions short; 0 for straight
        motions that turn evenly [m].
    seed, iterations
        As for `connect`. The path (k, 3) has headings from -pi to pi.
    """

    def write(state: State, pose: Array) -> None:
        state.setXY(float(pose[0]), float(pose[1]))
        state.setYaw(float(pose[2]))
        space.enforceBounds(state)  # the heading within a turn

    def read(state: State) -> Array:
        return np.array([state.getX(), state.getY(), state.getYaw()])

    with _ompl(seed) as (base, geometric):
        space = base.ReedsSheppStateSpace(turning_radius) if turning_radius else base.SE2StateSpace()
        return _connected(base, geometric, space, problem, write, read, iterations)


def _connected(
    base: Any,
    geometric: Any,
    space: Any,
    problem: PlanningProblem,
    write: Callable[[State, Array], None],
    read: Callable[[State], Array],
    iterations: int,
    stride: float | None = None,
) -> Array | None:
    """Path in a space whose states are rows, written and read; a motion is checked as a whole in one call."""

    class Motions(base.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, p: State, q: State) -> bool:
            return bool(problem.motion_is_free(read(p), read(q)))

    bounds = base.RealVectorBounds(len(problem.lower))
    for axis, (low, high) in enumerate(zip(problem.lower, problem.upper, strict=True)):
        bounds.setLow(axis, float(low))
        bounds.setHigh(axis, float(max(high, low + 1e-6)))
    space.setBounds(bounds)
    ends = [space.allocState(), space.allocState()]
    for state, row in zip(ends, (problem.start, problem.goal), strict=True):
        write(state, row)
    setup = geometric.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(lambda p: bool(problem.state_is_free(read(p))))
    information.setMotionValidator(Motions(information))
    setup.setStartAndGoalStates(*ends)
    planner = getattr(geometric, problem.planner)(information)
    if stride is not None and hasattr(planner, "setRange"):
        planner.setRange(stride)
    if problem.planner in BETTERING:
        setup.setOptimizationObjective(base.PathLengthOptimizationObjective(information))
    setup.setPlanner(planner)
    left = iter(range(iterations))
    status = setup.solve(base.PlannerTerminationCondition(lambda: next(left, None) is None))
    if status != base.PlannerStatus.EXACT_SOLUTION:
        return None
    path = np.array([read(p) for p in setup.getSolutionPath().getStates()])
    path[0], path[-1] = problem.start, problem.goal  # as they were given
    return path


@contextmanager
def _ompl(seed: int) -> Iterator[tuple[Any, Any]]:
    """OMPL's modules, imported late, silent and freshly seeded.

    Setting the seed restarts the stream from which every later generator takes its own seed, so a planner
    made after it does not depend on those made before. OMPL warns about that on its log, and refuses 0.
    """
    with _OMPL, _signals_held():
        from ompl import base, geometric, util

        level = util.getLogLevel()
        util.setLogLevel(util.LOG_NONE)
        util.RNG.setSeed(seed % (2**32 - 1) + 1)
        try:
            yield base, geometric
        finally:
            util.setLogLevel(level)


@contextmanager
def _signals_held() -> Iterator[None]:
    """Hold signals back: Ctrl-C raised while OMPL is imported, or in a callback, would abort the process."""
    caught: list[int] = []
    handlers = {}
    if current_thread() is main_thread():
        asking = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        handlers = {number: to for number in asking if callable(to := signal.getsignal(number))}
    try:
        for number in handlers:
            signal.signal(number, lambda which, _: caught.append(which))
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for one in caught:
            handlers[signal.Signals(one)](one, None)
