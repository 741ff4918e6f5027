"""Greedy base steps towards a goal: Algorithm 2 of M-FABRIK (Santos et al., IEEE Access 2020), compiled.

The step area is taken from the whole free area, and the segment is tested besides the distance. The distance
to the goal never grows, so the steps cannot run in circles; they may end at a point from which every step
leads away, behind an obstacle or in a pocket.
"""

from __future__ import annotations

import math

import numpy as np

from regionik.planners.geometry.angles import wrap
from regionik.planners.geometry.polygons import (
    contains,
    near_boundary,
    nearest_on_boundary,
    nearest_on_segment,
    segment_inside,
)
from regionik.planners.geometry.vectors import squared
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index

MIN_PROGRESS = 1e-4  # a shorter step than this is no progress [m]
DISC_SIDES = 64  # of the polygon inscribed in the disc of one step
EDGE_TOLERANCE = 1e-11  # an edge this near to the base is the one that it stands on [m]
# a sector with its middle farther off the goal lies behind it [rad]
MAX_SECTOR_ANGLE = np.pi / 2 + np.pi / DISC_SIDES
MIN_SECTOR = 1e-9  # narrower sectors are rounding [rad]


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
            if EDGE_TOLERANCE < gap <= rho:
                edges[n] = px, py, qx, qy
                n += 1
            px, py = qx, qy
    return edges[:n]


@compiled
def _directions(edges: Array, rho: float) -> Array:
    """Sorted directions in [-pi, pi] between which one edge, or the disc alone, bounds the view."""
    angles = np.empty(4 * len(edges) + DISC_SIDES + 1)
    n = 0
    for e in range(len(edges)):
        px, py, qx, qy = edges[e]
        angles[n], angles[n + 1] = math.atan2(py, px), math.atan2(qy, qx)
        n += 2
        dx, dy = qx - px, qy - py
        length = np.hypot(dx, dy)
        foot = -(px * dx + py * dy) / length
        half2 = rho * rho - (px * px + py * py - foot * foot)
        for sign in (-1.0, 1.0):
            t = foot + sign * np.sqrt(max(half2, 0.0))
            if 0.0 < t < length:
                angles[n] = math.atan2(py + t * dy / length, px + t * dx / length)
                n += 1
    for k in range(DISC_SIDES + 1):
        angles[n] = -np.pi + 2.0 * np.pi * k / DISC_SIDES
        n += 1
    return np.sort(angles[:n])


@compiled
def _ray_on_edge(edge: Array, cx: float, cy: float, rho: float) -> tuple[float, float]:
    """Point at which a ray in direction (cx, cy) meets an edge, clamped to the edge and to the disc."""
    px, py, qx, qy = edge
    across_p, across_q = cx * py - cy * px, cx * qy - cy * qx
    t = 0.0
    if across_p != across_q:
        t = min(1.0, max(0.0, across_p / (across_p - across_q)))
    x, y = px + t * (qx - px), py + t * (qy - py)
    shrink = min(1.0, rho / max(np.hypot(x, y), EDGE_TOLERANCE))
    return x * shrink, y * shrink


@compiled
def _first_edge(edges: Array, cx: float, cy: float, rho: float) -> tuple[int, float]:
    """Edge that a ray meets first and its distance; -1 and ``rho`` for none within the disc."""
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
def visible_star(vertices: Array, starts: Index, bx: float, by: float, rho: float, ahead: float) -> Array:
    """Step area: all points that one straight step of at most ``rho`` reaches inside a polygon, (k, 2) [m].

    A star round the base, counter-clockwise, not closed, of one triangle for each sector between two
    directions; exact but for the disc, which is a polygon of at least 64 sides inscribed in it. With a
    direction ``ahead`` (NaN for none) sectors behind are left out: no point of them is nearer to a goal ahead
    than the base.
    """
    edges = _edges_near(vertices, starts, bx, by, rho)
    angles = _directions(edges, rho)
    star = np.empty((2 * len(angles), 2))
    n = 0
    # From the middle of the area all is inside that no edge hides; from an edge half of it is outside.
    interior = contains(vertices, starts, bx, by) and not near_boundary(
        vertices, starts, bx, by, EDGE_TOLERANCE
    )
    for k in range(len(angles) - 1):
        if angles[k + 1] - angles[k] < MIN_SECTOR:
            continue
        middle = 0.5 * (angles[k] + angles[k + 1])
        if abs(wrap(middle - ahead)) > MAX_SECTOR_ANGLE:
            star[n] = bx, by
            n += 1
            continue
        cx, cy = math.cos(middle), math.sin(middle)
        hit, reach = _first_edge(edges, cx, cy, rho)
        if not interior and not contains(vertices, starts, bx + 0.5 * reach * cx, by + 0.5 * reach * cy):
            star[n] = bx, by
            n += 1
            continue
        for angle in (angles[k], angles[k + 1]):
            x, y = rho * math.cos(angle), rho * math.sin(angle)
            if hit >= 0:
                x, y = _ray_on_edge(edges[hit], math.cos(angle), math.sin(angle), rho)
            star[n] = bx + x, by + y
            n += 1
    return star[:n]


@compiled
def _best_step(
    vertices: Array, starts: Index, x: float, y: float, goal_x: float, goal_y: float, rho: float
) -> tuple[float, float]:
    """Point of the step area that is nearest to the straight step (M-FABRIK, Alg. 2)."""
    part = min(1.0, rho / math.sqrt(squared(goal_x - x) + squared(goal_y - y)))
    # Alg. 2, l. 8: MoveOneStep
    hat_x, hat_y = x + (goal_x - x) * part, y + (goal_y - y) * part
    if segment_inside(vertices, starts, x, y, hat_x, hat_y):  # l. 10, 13
        return hat_x, hat_y
    star = visible_star(vertices, starts, x, y, rho, math.atan2(goal_y - y, goal_x - x))
    # l. 11: MoveToStepArea
    next_x, next_y = nearest_on_boundary(star, np.array([0, len(star)]), hat_x, hat_y)
    if segment_inside(vertices, starts, x, y, next_x, next_y):
        return next_x, next_y
    return x, y


@compiled
def greedy_points(
    vertices: Array, starts: Index, x: float, y: float, goal_x: float, goal_y: float, rho: float
) -> tuple[Array, bool]:
    """Positions of Algorithm 2, (k, 2), and True if the last is the goal; steps are at most ``rho``."""
    far = math.sqrt(squared(goal_x - x) + squared(goal_y - y))
    # Sliding past an obstacle takes a few times the straight number of steps; far more is creeping.
    most = 100 + 20 * math.ceil(far / rho)
    points = np.empty((most + 2, 2))
    points[0, 0], points[0, 1] = x, y
    for k in range(1, most + 1):
        # Alg. 2, l. 6 and 20: the last step
        if math.sqrt(squared(goal_x - x) + squared(goal_y - y)) <= rho and segment_inside(
            vertices, starts, x, y, goal_x, goal_y
        ):
            points[k, 0], points[k, 1] = goal_x, goal_y
            return points[: k + 1], True
        # Alg. 2, l. 8 to 14
        next_x, next_y = _best_step(vertices, starts, x, y, goal_x, goal_y, rho)
        if math.sqrt(squared(next_x - x) + squared(next_y - y)) < MIN_PROGRESS:
            return points[:k], False
        x, y = next_x, next_y
        points[k, 0], points[k, 1] = x, y
    return points[: most + 1], False
