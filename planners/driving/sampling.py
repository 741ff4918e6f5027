"""Paths by OMPL's RRTConnect and RRT: between two points of a box, or two poses on a floor.

The only file that imports ompl.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock, current_thread, main_thread
from typing import Any, Literal

import numpy as np

from regionik.worlds.arrays import Array

_OMPL = Lock()  # its seed and its log level belong to the whole process

Curves = Literal["straight", "reeds-shepp", "dubins"]
State = Any  # of OMPL: read by index, valid during the call only


def connect(
    lower: Array,
    upper: Array,
    start: Array,
    goal: Array,
    free: Callable[[State], bool],
    clear: Callable[[State, State], bool],
    *,
    seed: int,
    iterations: int,
    stride: float | None = None,
) -> Array | None:
    """Connect two points of a box by motions that are straight in its coordinates.

    Parameters
    ----------
    lower, upper : (n,) array
        The box; a side of no width is widened by 1e-6.
    start, goal : (n,) array
        Different points of the box that are free.
    free : callable
        Says if a state is free; its coordinates are ``state[i]``.
    clear : callable
        Says if the straight motion from one state to another is free.
    seed : int
        Same input, same path, whatever was planned before.
    iterations : int
        After which to give up: a bound without a clock.
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
        status = setup.solve(base.PlannerTerminationCondition(_after(iterations)))
        if status != base.PlannerStatus.EXACT_SOLUTION:
            return None
        states = setup.getSolutionPath().getStates()
        path = np.array([[p[i] for i in range(count)] for p in states])
    path[0], path[-1] = start, goal
    return path


def connect_poses(
    lower: Array,
    upper: Array,
    start: Array,
    goal: Array,
    free: Callable[[Array], bool],
    clear: Callable[[Array, Array], bool],
    *,
    curves: Curves,
    radius: float = 1.0,
    seed: int,
    iterations: int,
) -> Array | None:
    """Connect two poses (x, y [m], yaw [rad]) by motions that ``clear`` makes and checks.

    Parameters
    ----------
    lower, upper : (2,) array
        Box to sample in [m].
    start, goal : (3,) array
        Different poses that are free.
    free : callable
        Says if a pose (3,) is free.
    clear : callable
        Says if the motion from one pose to another is free.
    curves : {"straight", "reeds-shepp", "dubins"}
        Metric of the space: measures how near neighbours are and cuts motions short.
    radius : float
        Turning radius of the curves [m].
    seed, iterations
        As for `connect`.

    Returns
    -------
    (k, 3) array or None
        From start to goal, headings from -pi to pi; None when the iterations are used up.
    """
    with _ompl(seed) as (base, geometric):
        space = _pose_space(base, curves, radius)
        bounds = base.RealVectorBounds(2)
        for axis in range(2):
            bounds.setLow(axis, float(lower[axis]))
            bounds.setHigh(axis, float(max(upper[axis], lower[axis] + 1e-6)))
        space.setBounds(bounds)
        setup = geometric.SimpleSetup(space)
        information = setup.getSpaceInformation()
        setup.setStateValidityChecker(lambda p: bool(free(_read(p))))
        information.setMotionValidator(_motions(base, information, lambda p, q: clear(_read(p), _read(q))))
        ends = [space.allocState(), space.allocState()]
        for state, pose in zip(ends, (start, goal), strict=True):
            state.setXY(float(pose[0]), float(pose[1]))
            state.setYaw(float(pose[2]))
        for state in ends:
            space.enforceBounds(state)
        setup.setStartAndGoalStates(*ends)
        # A tree from the goal would need curves that end at its states; where there and back differ, one tree
        # succeeds far more often.
        both = space.hasSymmetricDistance()
        setup.setPlanner((geometric.RRTConnect if both else geometric.RRT)(information))
        status = setup.solve(base.PlannerTerminationCondition(_after(iterations)))
        if status != base.PlannerStatus.EXACT_SOLUTION:
            return None
        path = np.array([_read(p) for p in setup.getSolutionPath().getStates()])
    path[0], path[-1] = start, goal
    return path


def _pose_space(base: Any, curves: Curves, radius: float) -> Any:
    """OMPL's state space of poses with a metric."""
    if curves == "straight":
        return base.SE2StateSpace()
    return base.ReedsSheppStateSpace(radius) if curves == "reeds-shepp" else base.DubinsStateSpace(radius)


def _read(state: State) -> Array:
    """Pose (3,) of a state."""
    return np.array([state.getX(), state.getY(), state.getYaw()])


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


def _motions(base: Any, information: Any, clear: Callable[[State, State], bool]) -> Any:
    """Motion validator that checks a whole motion in one call."""

    class Motions(base.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, p: Any, q: Any) -> bool:
            return bool(clear(p, q))

    return Motions(information)


def _state(space: Any, point: Array) -> Any:
    """State at a point of the box."""
    state = space.allocState()
    for i, value in enumerate(point.tolist()):
        state[i] = value
    return state


def _after(calls: int) -> Any:
    """Condition that turns true after a number of calls."""
    left = iter(range(calls))
    return lambda: next(left, None) is None
