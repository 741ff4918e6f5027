"""Ways found by OMPL's RRTConnect between two points of a box. The only file that imports ompl."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any

import numpy as np

from regionik.worlds.arrays import Array

_OMPL = Lock()  # its seed and its log level belong to the whole process

State = Any  # one of OMPL's, to be read by index and not kept


def connect(
    lower: Array,
    upper: Array,
    start: Array,
    goal: Array,
    free: Callable[[State], bool],
    clear: Callable[[State, State], bool],
    *,
    seed: int,
    most: int,
    stride: float | None = None,
) -> Array | None:
    """Connect two points of a box by motions that are straight in its coordinates.

    Parameters
    ----------
    lower, upper : (n,) array
        The box; a side of no width is given some.
    start, goal : (n,) array
        Different points of the box that are free.
    free : callable
        Whether the robot may be at a state; coordinates are read as ``state[i]``.
    clear : callable
        Whether it may move straight from one state to another.
    seed : int
        Same input, same way, whatever was planned before.
    most : int
        Iterations after which to give up: a bound without a clock.
    stride : float, optional
        Longest motion, in the box's coordinates; a fifth of the box's diagonal by default.

    Returns
    -------
    (k, n) array or None
        From start to goal; None when the iterations are used up.
    """
    count = len(lower)
    with _ompl(seed) as (base, geometric):
        space = base.RealVectorStateSpace(count)
        bounds = base.RealVectorBounds(count)
        for axis in range(count):
            bounds.setLow(axis, float(lower[axis]))
            bounds.setHigh(axis, float(max(upper[axis], lower[axis] + 1e-6)))
        space.setBounds(bounds)
        setup = geometric.SimpleSetup(space)
        information = setup.getSpaceInformation()
        setup.setStateValidityChecker(lambda p: bool(free(p)))
        information.setMotionValidator(_motions(base, information, clear))
        setup.setStartAndGoalStates(_state(space, start), _state(space, goal))
        planner = geometric.RRTConnect(information)
        if stride is not None:
            planner.setRange(stride)
        setup.setPlanner(planner)
        status = setup.solve(base.PlannerTerminationCondition(_after(most)))
        if status != base.PlannerStatus.EXACT_SOLUTION:
            return None
        states = setup.getSolutionPath().getStates()
        path = np.array([[p[i] for i in range(count)] for p in states])
    path[0], path[-1] = start, goal
    return path


@contextmanager
def _ompl(seed: int) -> Iterator[tuple[Any, Any]]:
    """OMPL's modules, imported late, silent and freshly seeded.

    Setting the seed restarts the stream from which every later generator takes its own seed, so a planner
    made after it does not depend on those made before. OMPL warns about that on its log, and refuses 0.
    """
    from ompl import base, geometric, util

    with _OMPL:
        level = util.getLogLevel()
        util.setLogLevel(util.LOG_NONE)
        util.RNG.setSeed(seed % (2**32 - 1) + 1)
        try:
            yield base, geometric
        finally:
            util.setLogLevel(level)


def _motions(base: Any, information: Any, clear: Callable[[State, State], bool]) -> Any:
    """A motion validator that asks once for the whole motion."""

    class Motions(base.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, p: Any, q: Any) -> bool:
            return bool(clear(p, q))

    return Motions(information)


def _state(space: Any, point: Array) -> Any:
    state = space.allocState()
    for i, value in enumerate(point.tolist()):
        state[i] = value
    return state


def _after(calls: int) -> Any:
    """A condition that turns true after so many calls."""
    left = iter(range(calls))
    return lambda: next(left, None) is None
