"""Areas and clearances as half-spaces about given states, for programs that are linear in each round."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from regionik.areas.layers import Geometries
from regionik.moving.options import MOVING
from regionik.planners.collision.proximity import NearPairs, near_pairs
from regionik.planners.collision.robot_motion import WORLD
from regionik.planners.driving.footprint_scene import FootprintScene
from regionik.planners.smoothing.path_smoothing import HalfSpaces
from regionik.postures.collision_checker import CollisionChecker
from regionik.postures.poses import axis_of
from regionik.worlds.arrays import Array, Index
from regionik.worlds.robot import Robot

AREA_MARGIN, ARM_MARGIN = 0.03, 0.01  # kept where there is room [m]
OPTIONS = MOVING.solving
CHECKED_DISTANCE = 0.05  # distance from which clearance of a link or of the footprint is looked after [m]
CONTACT_ROUNDING = 1e-9  # of an outline and an edge, by rounding [m]


@dataclass(frozen=True, eq=False)
class StateConstraints:
    """Constraints that keep the arm axis in its areas, the footprint on the floor and the links clear."""

    robot: Robot
    collision: CollisionChecker
    room: FootprintScene | None  # where the free floor depends on the heading
    within: Geometries | None  # (n,) where the arm axis may be in each state, None for anywhere
    # (n,) distance from the edge of that, and beyond the clearance of links, that is not given up [m]
    demanded: Array
    area_cost: float = OPTIONS.area_cost  # of what is missing of an area, or on the floor [1/m]
    arm_cost: float = OPTIONS.arm_cost  # of what is missing of a link's clearance [1/m]
    # Kept where there is room: by the axis and the footprint, and by links [m]
    area_margin: float = AREA_MARGIN
    arm_margin: float = ARM_MARGIN

    def half_spaces(self, states: Array) -> HalfSpaces:
        """Return the half-spaces about given states; see `path_smoothing`."""
        bounded = self.within is not None and not self.robot.drive.rolls
        parts = [self._inside(states)] if bounded else []
        parts += [self.on_floor(states)] if self.room else []
        parts += [self._clear(states)] if self.collision.enabled else []
        if not parts:
            return _no_half_spaces(states)
        columns = ((one.state, one.normal, one.least, one.cost) for one in parts)
        return HalfSpaces(*(np.concatenate(column) for column in zip(*columns, strict=True)))

    def _inside(self, states: Array) -> HalfSpaces:
        """Return half-spaces that keep the arm axis on its side of the nearest edge of its area."""
        axis = axis_of(self.robot, states[:, :3])
        points = shapely.points(axis)
        lines = shapely.shortest_line(self._edges, points)
        away = axis - shapely.get_coordinates(lines).reshape(-1, 2, 2)[:, 0]
        depth = np.linalg.norm(away, axis=1)
        sign = np.where(shapely.covers(self.within, points), 1.0, -1.0)
        unit = away * (sign / np.maximum(depth, 1e-12))[:, None]
        normal = np.zeros(states.shape)
        normal[:, :2] = unit
        normal[:, 2] = unit[:, 1] * (axis - states[:, :2])[:, 0] - unit[:, 0] * (axis - states[:, :2])[:, 1]
        least = _least(sign * depth - self.demanded, self.area_margin)
        return HalfSpaces(np.arange(len(states)), normal, least, np.full(len(states), self.area_cost))

    def on_floor(self, states: Array) -> HalfSpaces:
        """Return half-spaces that keep the four sides of the footprint off what is nearest to each."""
        assert self.room is not None
        (x, y), c, s = self.room.corners.T, np.cos(states[:, 2:3]), np.sin(states[:, 2:3])
        turned = np.stack([c * x - s * y, s * x + c * y], axis=-1)
        reach = float(self.room.clearance.max(initial=0.0)) + CHECKED_DISTANCE
        far = reach + float(np.hypot(x, y).max())  # an outline takes longer than the point in it
        spots = shapely.points(states[:, :2])
        near = np.unique(self._floor_edges.query(spots, predicate="dwithin", distance=far)[0])
        if not len(near):
            return _no_half_spaces(states)
        outlines = shapely.convex_hull(
            shapely.multipoints((turned + states[:, None, :2])[near])
        )  # of one, too
        k, edge = self._floor_edges.query(outlines, predicate="dwithin", distance=reach)
        lines, k = shapely.shortest_line(self._floor_edges.geometries[edge], outlines[k]), near[k]
        on_edge, point = shapely.get_coordinates(lines).reshape(-1, 2, 2).swapaxes(0, 1)
        away = point - on_edge
        apart = np.linalg.norm(away, axis=1)
        inward = states[k, :2] + turned[k].mean(axis=1) - on_edge  # where they cross
        away = np.where(apart[:, None] > CONTACT_ROUNDING, away, inward)
        unit = away / np.linalg.norm(away, axis=1)[:, None]
        room = apart - self.room.clearance[edge] - self.demanded[k]
        lever = point - turned[k].mean(axis=1) - states[k, :2]
        parts = [_quadrant(way, states[k, 2]) for way in (unit, lever)]
        order = np.lexsort([room, *parts, k])
        kept = order[np.unique(np.column_stack([k, *parts])[order], axis=0, return_index=True)[1]]
        k, unit, lever = k[kept], unit[kept], (point - states[k, :2])[kept]
        normal = np.zeros((len(k), states.shape[1]))
        normal[:, :2] = unit
        normal[:, 2] = unit[:, 1] * lever[:, 0] - unit[:, 0] * lever[:, 1]
        return HalfSpaces(k, normal, _least(room[kept], self.area_margin), np.full(len(k), self.area_cost))

    def _clear(self, states: Array) -> HalfSpaces:
        """Return half-spaces that keep the clearance of links near obstacles."""
        near = self.near(states)
        room = near.room - self.demanded[near.state]
        normal = self.approach(near, states)
        return HalfSpaces(
            near.state, normal, _least(room, self.arm_margin), np.full(len(room), self.arm_cost)
        )

    def near(self, states: Array) -> NearPairs:
        """Return the pairs of nearby solids in states (n, m)."""
        return near_pairs(
            self.collision.bodies, states[:, :3], states[:, 3:], self.collision.contact, CHECKED_DISTANCE
        )

    def approach(self, near: NearPairs, states: Array) -> Array:
        """Return the derivatives of the distances of pairs in states (n, m), (k, m)."""
        at, own = states[near.state], near.other != WORLD
        frames = self.robot.frames(at[:, :3], at[:, 3:])
        moved = self._moved(frames, at, near.link, near.point)
        there = near.point - near.room[:, None] * near.normal
        moved[own] -= self._moved(frames[own], at[own], near.other[own], there[own])
        return np.asarray(near.normal[:, None] @ moved)[:, 0]

    def _moved(self, frames: Array, states: Array, links: Index, points: Array) -> Array:
        """Velocities of points (n, 3) of links for each coordinate's unit speed, (n, 3, m)."""
        J = np.zeros((len(states), 3, states.shape[1]))
        J[:, 0, 0] = J[:, 1, 1] = 1.0
        J[:, 0, 2], J[:, 1, 2] = states[:, 1] - points[:, 1], points[:, 0] - states[:, 0]
        J[:, :, 3:] = self.robot.chain.point_jacobian(frames, points, links + 1).swapaxes(1, 2)
        return J

    @cached_property
    def _edges(self) -> Geometries:
        return shapely.boundary(self.within)

    @cached_property
    def _floor_edges(self) -> shapely.STRtree:
        assert self.room is not None
        ends = self.room.edges.reshape(-1, 2, 2)
        alone = (ends[:, 0] == ends[:, 1]).all(axis=1)  # the middle of what is round
        return shapely.STRtree(np.where(alone, shapely.points(ends[:, 0]), shapely.linestrings(ends)))


def _no_half_spaces(states: Array) -> HalfSpaces:
    return HalfSpaces(np.empty(0, np.int64), np.empty((0, states.shape[1])), np.empty(0), np.empty(0))


def _quadrant(ways: Array, yaw: Array) -> Index:
    """Which quarter of a turn from the heading ways (n, 2) point to, (n,)."""
    return np.floor((np.arctan2(ways[:, 1], ways[:, 0]) - yaw) / (np.pi / 2)).astype(np.int64) % 4


def _least(room: Array, margin: float) -> Array:
    """Least change of a distance: it may shrink to the margin, and grows where it is negative."""
    return np.where(room < 0, -room, np.minimum(margin - room, 0.0))
