"""Paths of a point in a polygon: straight, by Algorithm 2 of M-FABRIK, or by RRTConnect and then shortest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.driving.greedy_steps import greedy_points
from regionik.planners.driving.sampling import PlanningProblem, connect
from regionik.planners.geometry.polygons import (
    DEPTH,
    FlatPolygon,
    checked_polygon,
    clamp,
    contains,
    segment_inside,
)
from regionik.planners.geometry.polylines import cut
from regionik.planners.geometry.shortest_paths import route, shorter_path, tighten
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index, frozen
from regionik.worlds.errors import InputError, RegionikError

Method = Literal["straight", "steps", "ompl", "triangles"]

ITERATIONS = 2000  # of RRTConnect, before the triangles are searched instead
ATTEMPTS = 2  # the shorter the path, the fewer corners may lie on one that is shorter still


@dataclass(frozen=True, eq=False)
class PointPath:
    """Path of the base from start to goal."""

    # (k, 2) from start to goal, each leg inside the free area and no longer than the step; one point where
    # the two are the same [m]
    points: Array
    # what found it. "steps" are Algorithm 2's own points; "ompl" is RRTConnect and "triangles" the complete
    # search where it gave up, both pulled tight, and taken another way round obstacles where that is shorter.
    method: Method


class NoPathError(RegionikError):
    """The base cannot drive from start to goal."""


def drive_point(
    free: Polygon | MultiPolygon, start: ArrayLike, goal: ArrayLike, *, step: float, seed: int
) -> PointPath:
    """Drive the base from start to goal without leaving the free area.

    Parameters
    ----------
    free : Polygon or MultiPolygon
        Free area of the base [m].
    start, goal : (2,) array_like
        [m]; moved onto the boundary when rounding put them outside by at most 1e-9 m.
    step : float
        Longest leg (rho of Algorithm 2) [m].
    seed : int
        Of the sampling planner, 0 or above. Same input, same path, whatever was planned before.

    Raises
    ------
    NoPathError
        When start or goal is not in ``free``, or they are in parts of it that do not join. In all other cases
        there is a path, and it is found.
    InputError
        When ``seed`` is negative, ``free`` is empty or a point is not two numbers.

    Examples
    --------
    >>> from shapely import box
    >>> drive_point(box(0, 0, 2, 1), [0.2, 0.5], [1.2, 0.5], step=0.5, seed=0).points.tolist()
    [[0.2, 0.5], [0.7, 0.5], [1.2, 0.5]]
    """
    if seed < 0:
        raise InputError(f"seed: expected a whole number from 0 up, got {seed}")
    a, b = frozen(start, (2,), "start"), frozen(goal, (2,), "goal")
    part = _common_part(free, a, b)
    return drive_point_inside(part, FlatPolygon.from_shapely(part), a, b, step=step, seed=seed)


def drive_point_inside(
    part: Polygon, flat: FlatPolygon, start: Array, goal: Array, *, step: float, seed: int
) -> PointPath:
    """`drive_point` in one polygon that is flat already; both ends are in it, but for rounding."""
    points, straight, arrived = _greedy_path(flat.vertices, flat.starts, np.array([start, goal]), step)
    if arrived:
        points.flags.writeable = False
        return PointPath(points, "straight" if straight else "steps")
    a, b = points
    planned = [tighten(part, path) for path in _attempts(flat, a, b, seed)]
    path = min(planned, key=_length) if planned else route(part, a, b)
    if path is None:
        raise NoPathError(f"no way through the free area from {_at(a)} to {_at(b)}")
    shorter = shorter_path(part, a, b, _length(path))
    points = cut(path if shorter is None else shorter, step)
    points.flags.writeable = False
    return PointPath(points, "ompl" if planned else "triangles")


@compiled
def _greedy_path(vertices: Array, starts: Index, ends: Array, step: float) -> tuple[Array, bool, bool]:
    """Points of the straight path or of Algorithm 2, and two flags: straight, arrived; else both ends."""
    for k in range(2):
        ends[k, 0], ends[k, 1] = clamp(vertices, starts, ends[k, 0], ends[k, 1])
    (ax, ay), (bx, by) = ends
    if ax == bx and ay == by:
        return ends[:1], True, True
    if segment_inside(vertices, starts, ax, ay, bx, by):
        return cut(ends, step), True, True
    points, arrived = greedy_points(vertices, starts, ax, ay, bx, by, step)
    return (points, False, True) if arrived else (ends, False, False)


def _common_part(free: Polygon | MultiPolygon, start: Array, goal: Array) -> Polygon:
    """Part of the free area that holds both points."""
    parts = shapely.get_parts(checked_polygon(free))
    gaps = shapely.distance(parts, shapely.points([start, goal])[:, None])
    for what, p, gap in (("start", start, gaps[0].min()), ("goal", goal, gaps[1].min())):
        if gap > DEPTH:
            raise NoPathError(f"{what} {_at(p)} is {gap:.3g} m outside the free area")
    common = np.flatnonzero((gaps <= DEPTH).all(axis=0))
    if not len(common):
        ends = f"start {_at(start)} and goal {_at(goal)}"
        raise NoPathError(f"{ends} are in parts of the free area that do not join")
    part: Polygon = parts[common[0]]
    return part


def _at(p: Array) -> str:
    return f"({p[0]:z.3f}, {p[1]:z.3f})"


def _length(points: Array) -> float:
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def _attempts(flat: FlatPolygon, start: Array, goal: Array, seed: int) -> Iterator[Array]:
    """Paths of RRTConnect, up to the first attempt that finds none: the next would hardly do better."""
    for k in range(ATTEMPTS):
        path = _connect(flat, start, goal, seed * ATTEMPTS + k)
        if path is None:
            return
        yield path


def _connect(flat: FlatPolygon, start: Array, goal: Array, seed: int) -> Array | None:
    """Path of RRTConnect, motions checked exactly; None when the iterations are used up."""
    vertices, starts = flat.vertices, flat.starts
    problem = PlanningProblem(
        vertices.min(axis=0),
        vertices.max(axis=0),
        start,
        goal,
        lambda p: contains(vertices, starts, p[0], p[1]),
        lambda p, q: segment_inside(vertices, starts, p[0], p[1], q[0], q[1]),
    )
    return connect(problem, seed=seed, iterations=ITERATIONS)
