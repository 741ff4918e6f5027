"""Greedy base steps towards a goal: Algorithm 2 of M-FABRIK."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.geometry.flat import (
    FlatPolygon,
    Index,
    clamp,
    compiled,
    contains,
    near_boundary,
    nearest,
    nearest_on_segment,
    segment_inside,
)
from regionik.planners.solvers.kernels import wrap
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError

STALL = 1e-4  # a shorter step than this is no progress [m]
SIDES = 64  # of the polygon inscribed in the disc of one step
ON_IT = 1e-11  # an edge this near to the base is the one that it stands on [m]
BEHIND = np.pi / 2 + np.pi / SIDES  # the middle of a sector that lies behind is farther round than this [rad]
SLIT = 1e-9  # narrower sectors of view are rounding [rad]


@dataclass(frozen=True, eq=False)
class Steps:
    """Where Algorithm 2 went.

    Attributes
    ----------
    points : (k, 2) array
        The start, the intermediate positions and, when it arrived, the goal [m].
    arrived : bool
        False when the steps ended in a dead end before the goal.
    """

    points: Array
    arrived: bool


def step_through(free: Polygon | MultiPolygon, start: ArrayLike, goal: ArrayLike, rho: float) -> Steps:
    """Go from start to goal in straight steps of at most ``rho``, each the best one for itself.

    The distance to the goal never grows, so the steps cannot run in circles; they may end at a point
    from which every step leads away, behind an obstacle or in a pocket.

    Parameters
    ----------
    free : Polygon or MultiPolygon
        Where the base may stand [m].
    start, goal : (2,) array_like
        Both in ``free`` [m].
    rho : float
        Longest step [m].

    Returns
    -------
    Steps

    Raises
    ------
    InputError
        When ``rho`` is not above 0, ``free`` is empty or a point is not two numbers.

    Notes
    -----
    M-FABRIK, Algorithm 2, with the step area taken from the whole free area and with the segment
    tested besides the distance.

    Examples
    --------
    >>> from shapely import box
    >>> step_through(box(0, 0, 1, 1), [0.1, 0.5], [0.9, 0.5], 0.5).points.tolist()
    [[0.1, 0.5], [0.6, 0.5], [0.9, 0.5]]
    """
    if not 0 < rho < np.inf:
        raise InputError(f"step: expected a length above 0, got {rho}")
    ends = frozen(start, (2,), "start"), frozen(goal, (2,), "goal")
    flat = FlatPolygon.from_shapely(free)
    (x, y), (goal_x, goal_y) = clamp(flat.vertices, flat.starts, *ends[0]), ends[1]
    points, arrived = steps(flat.vertices, flat.starts, x, y, goal_x, goal_y, rho)
    return Steps(frozen(points, (None, 2), "steps"), bool(arrived))


def step_area(free: Polygon | MultiPolygon, base: ArrayLike, rho: float) -> Array:
    """Outline of all points that one straight step of at most ``rho`` reaches inside ``free``.

    Exact but for the disc, which is a polygon of at least 64 sides inscribed in it.

    Returns
    -------
    (k, 2) array
        A star round ``base``, counter-clockwise, not closed; ``base`` itself where the view is shut [m].
    """
    flat = FlatPolygon.from_shapely(free)
    b = frozen(base, (2,), "base")
    return _view(flat.vertices, flat.starts, b[0], b[1], rho, np.nan)


@compiled
def _edges_near(vertices: Array, starts: Index, bx: float, by: float, rho: float) -> Array:
    """Edges within ``rho``, as (n, 4) ends relative to the base, without those it stands on."""
    edges = np.empty((len(vertices), 4))
    n = 0
    for r in range(len(starts) - 1):
        px, py = vertices[starts[r + 1] - 1, 0] - bx, vertices[starts[r + 1] - 1, 1] - by
        for k in range(starts[r], starts[r + 1]):
            qx, qy = vertices[k, 0] - bx, vertices[k, 1] - by
            gap = np.hypot(*nearest_on_segment(px, py, qx, qy, 0.0, 0.0))
            # What lies behind an edge under the base is outside until another edge, which hides it.
            if ON_IT < gap <= rho:
                edges[n] = px, py, qx, qy
                n += 1
            px, py = qx, qy
    return edges[:n]


@compiled
def _directions(edges: Array, rho: float) -> Array:
    """Sorted directions in [-pi, pi] between which one edge, or the disc alone, bounds the view."""
    angles = np.empty(4 * len(edges) + SIDES + 1)
    n = 0
    for e in range(len(edges)):
        px, py, qx, qy = edges[e]
        angles[n], angles[n + 1] = np.arctan2(py, px), np.arctan2(qy, qx)
        n += 2
        dx, dy = qx - px, qy - py
        length = np.hypot(dx, dy)
        foot = -(px * dx + py * dy) / length
        half2 = rho * rho - (px * px + py * py - foot * foot)
        for sign in (-1.0, 1.0):
            t = foot + sign * np.sqrt(max(half2, 0.0))
            if 0.0 < t < length:
                angles[n] = np.arctan2(py + t * dy / length, px + t * dx / length)
                n += 1
    for k in range(SIDES + 1):
        angles[n] = -np.pi + 2.0 * np.pi * k / SIDES
        n += 1
    return np.sort(angles[:n])


@compiled
def _along(edge: Array, cx: float, cy: float, rho: float) -> tuple[float, float]:
    """Where a ray in direction (cx, cy) meets an edge, kept to the edge and to the disc."""
    px, py, qx, qy = edge
    across_p, across_q = cx * py - cy * px, cx * qy - cy * qx
    t = 0.0
    if across_p != across_q:
        t = min(1.0, max(0.0, across_p / (across_p - across_q)))
    x, y = px + t * (qx - px), py + t * (qy - py)
    shrink = min(1.0, rho / max(np.hypot(x, y), ON_IT))
    return x * shrink, y * shrink


@compiled
def _first_hit(edges: Array, cx: float, cy: float, rho: float) -> tuple[int, float]:
    """The edge that a ray meets first and how far off; -1 and ``rho`` for none on the disc."""
    first, reach = -1, rho
    for e in range(len(edges)):
        px, py, qx, qy = edges[e]
        across_p, across_q = cx * py - cy * px, cx * qy - cy * qx
        if (across_p > 0.0) != (across_q > 0.0):
            t = across_p / (across_p - across_q)
            ahead = cx * (px + t * (qx - px)) + cy * (py + t * (qy - py))
            if 0.0 < ahead < reach:
                first, reach = e, ahead
    return first, reach


@compiled
def _view(vertices: Array, starts: Index, bx: float, by: float, rho: float, ahead: float) -> Array:
    """The star of `step_area`: one triangle of view for each sector between two directions.

    Where a direction ``ahead`` is given the star is shut to what lies behind: nothing there is nearer to a
    place ahead than the base.
    """
    edges = _edges_near(vertices, starts, bx, by, rho)
    angles = _directions(edges, rho)
    star = np.empty((2 * len(angles), 2))
    n = 0
    # From the middle of the area all is inside that no edge hides; from an edge half of it is outside.
    amid = contains(vertices, starts, bx, by) and not near_boundary(vertices, starts, bx, by, ON_IT)
    for k in range(len(angles) - 1):
        if angles[k + 1] - angles[k] < SLIT:
            continue
        middle = 0.5 * (angles[k] + angles[k + 1])
        if abs(wrap(middle - ahead)) > BEHIND:
            star[n] = bx, by
            n += 1
            continue
        cx, cy = np.cos(middle), np.sin(middle)
        hit, reach = _first_hit(edges, cx, cy, rho)
        if not amid and not contains(vertices, starts, bx + 0.5 * reach * cx, by + 0.5 * reach * cy):
            star[n] = bx, by
            n += 1
            continue
        for angle in (angles[k], angles[k + 1]):
            x, y = rho * np.cos(angle), rho * np.sin(angle)
            if hit >= 0:
                x, y = _along(edges[hit], np.cos(angle), np.sin(angle), rho)
            star[n] = bx + x, by + y
            n += 1
    return star[:n]


@compiled
def _best_step(
    vertices: Array, starts: Index, x: float, y: float, goal_x: float, goal_y: float, rho: float
) -> tuple[float, float]:
    """The point of the step area that is nearest to the straight step (M-FABRIK, Alg. 2)."""
    part = min(1.0, rho / math.sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2))
    hat_x, hat_y = x + (goal_x - x) * part, y + (goal_y - y) * part
    if segment_inside(vertices, starts, x, y, hat_x, hat_y):
        return hat_x, hat_y
    star = _view(vertices, starts, x, y, rho, np.arctan2(goal_y - y, goal_x - x))
    next_x, next_y = nearest(star, np.array([0, len(star)]), hat_x, hat_y)
    if segment_inside(vertices, starts, x, y, next_x, next_y):
        return next_x, next_y
    return x, y


@compiled
def steps(
    vertices: Array, starts: Index, x: float, y: float, goal_x: float, goal_y: float, rho: float
) -> tuple[Array, bool]:
    """Positions of Algorithm 2, (k, 2), and whether the last of them is the goal."""
    far = math.sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2)
    # Sliding past an obstacle takes a few times the straight number of steps; far more is creeping.
    most = 100 + 20 * math.ceil(far / rho)
    points = np.empty((most + 2, 2))
    points[0, 0], points[0, 1] = x, y
    for k in range(1, most + 1):
        if math.sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2) <= rho and segment_inside(
            vertices, starts, x, y, goal_x, goal_y
        ):
            points[k, 0], points[k, 1] = goal_x, goal_y
            return points[: k + 1], True
        next_x, next_y = _best_step(vertices, starts, x, y, goal_x, goal_y, rho)
        if math.sqrt((next_x - x) ** 2 + (next_y - y) ** 2) < STALL:
            return points[:k], False
        x, y = next_x, next_y
        points[k, 0], points[k, 1] = x, y
    return points[: most + 1], False
