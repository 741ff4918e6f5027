"""Shortest ways over the floor by a visibility graph, for a disc that every heading of a base covers.

A base that turns as it likes may go round corners more tightly than any disc round the whole of it, but never
more tightly than the largest disc inside it. A car cannot turn more tightly than its wheels steer. So what is
found here is the least that a drive can measure.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from tests.opinion.course import Course, wrapped
from tests.opinion.machine import Array, Facts
from tests.opinion.things import asked_of, floor_of

LOOSE = 1e-5  # by which free floor is larger, so that nobody on its edge is said to be off it [m]
SEEN = 1e-7  # by which a straight way may leave free floor, which is rounding [m]
ROUND = 8  # chords of a quarter circle, inside of it


def drives(course: Course) -> Iterator[tuple[int, int]]:
    """First and last state of every move with the tool lifted, from set-point to set-point."""
    last = len(course.kinds) - 1
    held = [k for k, kind in enumerate(course.kinds) if kind != "transit"]
    for here, there in pairwise([0, *held, last]):
        if "transit" in course.kinds[here : there + 1]:
            yield here, there


def driven(course: Course, first: int, last: int) -> float:
    """How long the way of the base is between two states [m]."""
    base = course.base[first : last + 1]
    turn, chord = wrapped(np.diff(base[:, 2])), np.hypot(*np.diff(base[:, :2], axis=0).T)
    return float((chord if course.machine.facts.base == "omni" else chord / np.sinc(turn / 2 / np.pi)).sum())


def least_turned(facts: Facts, start: Array, goal: Array) -> float:
    """Length of a car's shortest way between two poses over open floor; 0 for others [m].

    Source: Reeds and Shepp, Pacific J. Math. 145, 1990, as OMPL has it.
    """
    if facts.base != "car":
        return 0.0
    from ompl import base

    space = base.ReedsSheppStateSpace(facts.turning_radius)
    ends = [space.allocState(), space.allocState()]
    for state, (x, y, yaw) in zip(ends, (start, goal), strict=True):
        state.setXY(float(x), float(y))
        state.setYaw(float(yaw))
    return float(space.distance(*ends))


class Ground:
    """Where the middle of a disc may be on the floor of a plan, and the straight ways between its corners."""

    def __init__(self, course: Course) -> None:
        inside = inner_radius(course.machine.facts.footprint)
        least = inside - LOOSE
        whole = floor_of(course.world)
        solid = [
            thing.core.buffer(max(thing.radius + asked_of(thing, course.rules) + least, 0.0), quad_segs=ROUND)
            for thing in course.things
            if thing.core is not None
        ]
        # The floor's own edge is solid from outside: what is near to it is taken away in the same way.
        near = whole.boundary.buffer(inside - LOOSE, quad_segs=ROUND) if inside > LOOSE else shapely.Point()
        self.free = shapely.difference(whole, shapely.union_all([*solid, near]))
        if inside <= LOOSE:
            self.free = shapely.difference(whole.buffer(LOOSE, join_style="mitre"), shapely.union_all(solid))
        self.open = self.free.buffer(SEEN, join_style="mitre")
        shapely.prepare(self.open)
        self.corners = _corners(self.free)

    def shortest(self, start: Array, goal: Array) -> float:
        """Length of the shortest way between two places, infinite where there is none [m]."""
        spots = np.vstack([start, goal, self.corners])
        left = np.hypot(*(spots - goal).T)
        best = np.full(len(spots), np.inf)
        best[0], done = 0.0, np.zeros(len(spots), dtype=bool)
        queue = [(left[0], 0)]
        while queue:
            _, here = heapq.heappop(queue)
            if here == 1:
                return float(best[1])
            if done[here]:
                continue
            done[here] = True
            there = np.flatnonzero(~done)
            far = best[here] + np.hypot(*(spots[there] - spots[here]).T)
            there, far = there[far < best[there]], far[far < best[there]]
            ways = np.stack([np.broadcast_to(spots[here], (len(there), 2)), spots[there]], axis=1)
            sees = shapely.covers(self.open, shapely.linestrings(ways))
            best[there[sees]] = far[sees]
            for k in there[sees].tolist():
                heapq.heappush(queue, (best[k] + left[k], k))
        return np.inf

    def holds(self, spot: Array) -> bool:
        """Whether the middle may be at a place."""
        return bool(shapely.intersects_xy(self.open, *spot[:2]))


def inner_radius(footprint: Array) -> float:
    """Of the largest disc round the base's origin that its footprint covers; 0 where that is outside [m]."""
    hull, middle = shapely.MultiPoint(footprint).convex_hull, shapely.Point(0, 0)
    return float(hull.exterior.distance(middle)) if hull.area > 0 and hull.covers(middle) else 0.0


def _corners(free: Any) -> Array:
    """Corners (n, 2) round which a shortest way may bend: those that reach into free floor."""
    found = [np.empty((0, 2))]
    for part in shapely.get_parts(shapely.normalize(free)):  # outside clockwise, holes the other way round
        for ring in (part.exterior, *part.interiors):
            corners = np.asarray(ring.coords)[:-1]
            before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
            bend = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
            found.append(corners[bend > 0])
    return np.vstack(found)
