"""Whether the robot can do its work from where its base came to stand, by brute force.

Of an arm on a vertical pivot many postures are drawn. With its pivot turned to a point, those whose tools
come nearest to it are bent until one meets it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import KDTree

from tests.opinion.course import Course, wrapped
from tests.opinion.machine import Array, Machine, jacobian
from tests.opinion.things import asked_of, floor_of

DRAWN = 20_000  # postures
NEAREST, TRIED = 48, 8  # of them that are looked at, and that are bent
FAR = 0.05  # from the nearest of them, beyond which none is bent [m]
STEPS = 30  # of damped least squares
CLOSE = 1e-5  # [m]

Mask = NDArray[np.bool_]


def good_parkings(document: dict[str, Any], machine: Machine, points: Array, poses: Array) -> Mask:
    """Which poses of the base (n, 3) keep its clearance and floor, the arm in reach of points (k, 3).

    Parameters
    ----------
    document : dict
        Of the world.
    machine : Machine
        Its first joint is a vertical pivot.
    """
    good = _has_room(document, machine, poses)
    search = _Reach(machine)
    for point in points:
        some = np.flatnonzero(good)
        off = point[:2] - poses[some, :2]
        seen = np.einsum("nji,nj->ni", _turns(poses[some, 2]), off)
        spots = np.column_stack([seen, np.full(len(some), point[2])])
        good[some] = search.meets(spots)
    return good


def _has_room(document: dict[str, Any], machine: Machine, poses: Array) -> Mask:
    """Which poses keep the base on its floor and off all that stands there."""
    course = Course({"world": document, "states": []}, machine)
    corners = np.einsum("nij,kj->nki", _turns(poses[:, 2]), machine.facts.footprint) + poses[:, None, :2]
    shapes = shapely.convex_hull(shapely.multipoints(list(corners)))
    floor = floor_of(document)
    shapely.prepare(floor)
    good: Mask = shapely.covers(floor, shapes)
    for thing in course.things:
        if thing.core is not None:
            asked = asked_of(thing, document["rules"])
            good &= shapely.distance(shapes, thing.core) - thing.radius >= asked
    return good


def _turns(yaw: Array) -> Array:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.moveaxis(np.array([[c, -s], [s, c]]), -1, 0)


class _Reach:
    """Postures drawn at random, by where their tools are about the pivot."""

    def __init__(self, machine: Machine) -> None:
        self.machine, self.mount = machine, machine.mount[:2, 3]
        low = np.where(np.isfinite(machine.lower), machine.lower, -np.pi)
        high = np.where(np.isfinite(machine.upper), machine.upper, np.pi)
        self.joints = np.random.default_rng(0).uniform(low, high, (DRAWN, machine.dof))
        tools = np.array([self.tool(q) for q in self.joints])
        off = tools[:, :2] - self.mount
        self.bearing = np.arctan2(off[:, 1], off[:, 0])
        self.tree = KDTree(np.column_stack([np.hypot(*off.T), tools[:, 2]]))

    def tool(self, joints: Array) -> Array:
        """The tool with the base at the origin (3,) [m]."""
        self.machine.place(np.zeros(3), joints)
        return self.machine.tool()[:3, 3].copy()

    def meets(self, spots: Array) -> Mask:
        """At which points (n, 3), seen from the base, a posture was found with the tool there."""
        off = spots[:, :2] - self.mount
        bearing = np.arctan2(off[:, 1], off[:, 0])
        far, near = self.tree.query(np.column_stack([np.hypot(*off.T), spots[:, 2]]), NEAREST)
        found = [
            bool(d[0] <= FAR) and self._meets(spot, k, b)
            for spot, k, b, d in zip(spots, near, bearing, far, strict=True)
        ]
        return np.array(found, dtype=bool)

    def _meets(self, spot: Array, near: NDArray[np.int64], bearing: float) -> bool:
        """True if one of some postures, its pivot turned to a point within its limits, can be bent to it."""
        low, high = self.machine.lower[0], self.machine.upper[0]
        starts = self.joints[near].copy()
        middle = (low + high) / 2 if np.isfinite(high - low) else 0.0
        starts[:, 0] = middle + wrapped(starts[:, 0] + bearing - self.bearing[near] - middle)
        beyond = np.maximum(low - starts[:, 0], starts[:, 0] - high)
        starts[:, 0] = np.clip(starts[:, 0], low, high)
        order = np.argsort(np.maximum(beyond, 0.0), kind="stable")[:TRIED]
        return any(self._bends(start, spot) for start in starts[order])

    def _bends(self, joints: Array, spot: Array) -> bool:
        """True if damped least squares bring the tool to a point."""
        q, damping, machine = joints, 1e-3, self.machine
        for _ in range(STEPS):
            off = spot - self.tool(q)
            if np.abs(off).max() < CLOSE:
                return True
            J = jacobian(machine, machine.configuration(np.zeros(3), q))[:3, machine.columns]
            step = J.T @ np.linalg.solve(J @ J.T + damping * np.eye(3), off)
            q = np.clip(q + np.clip(step, -0.5, 0.5), machine.lower, machine.upper)
            damping = max(damping / 2, 1e-9)
        return False
