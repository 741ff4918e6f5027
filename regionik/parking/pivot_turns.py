"""Turns of the pivot at a stop: how much room a heading of the base leaves each set-point's pivot.

Of arms that work in one vertical plane: a place gives the direction of that plane but for its facing.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from regionik.areas.free_space import FreeSpace, into_span
from regionik.areas.layers import Geometries
from regionik.ladder import Ladder
from regionik.mfabrik import solver_for
from regionik.postures.families import BACK, Family
from regionik.postures.poses import pose_of
from regionik.scene import Scene
from regionik.worlds.arms import pivot_index
from regionik.worlds.arrays import Array, Index

HEADING_ROUNDING = 1e-9  # rounding of headings [rad]
MIN_AXIS_DISTANCE = 1e-12  # distance below which a target is on the pivot's axis [m]
EDGE_TOLERANCE = 1e-7  # how far off a place may lie that is on the edge of an area [m]


class Turns(NamedTuple):
    """Room of n set-points at h headings in both facings."""

    yaw: Array  # (h,) [rad]
    component: Index  # (2, n) in each facing the deepest around a place; -1 where there is none
    # (h, 2, n) offset of the base at which the pivot gets to a limit or the component ends, -inf for none [m]
    room: Array


@dataclass(frozen=True, eq=False)
class PivotTurns:
    """Turns of the pivot of a world's arm, at places in its parking areas."""

    scene: Scene
    free_space: FreeSpace
    ladder: Ladder
    narrow: Geometries  # (m,) components of the ladder shrunk by the circle to park in
    _zeros: dict[int, float] = field(default_factory=dict)

    def turns(self, setpoints: tuple[int, ...], axis: Array, side: int) -> Turns | None:
        """Room of set-points at the headings at which some pivot has just enough, and between these.

        None where the position is in no component of one of them.
        """
        components, rooms = self._deepest(setpoints, axis, side)
        if (components < 0).all(axis=0).any():
            return None
        away = np.array([self.scene.task[i].position[:2] for i in setpoints]) - axis
        off, bearing = np.hypot(*away.T), np.arctan2(away[:, 1], away[:, 0])
        zero = [self._plane_zero(setpoints, row, axis) for row in components]
        planes = bearing + np.array(zero)[:, None]
        joint = self.scene.robot.chain.active_joints[pivot_index(self.scene.robot.chain)]
        span, wide = self.free_space.sides[side].span, joint.upper - joint.lower
        if wide >= 2 * np.pi:
            yaws, pivoted = np.array([into_span(0.0, span)]), np.full((1, *planes.shape), np.inf)
        else:
            spare = (
                np.arcsin(
                    np.clip(self.scene.rules.stop_tolerance / np.maximum(off, MIN_AXIS_DISTANCE), 0.0, 1.0)
                )
                + HEADING_ROUNDING
            )
            ends = np.unique(np.mod([planes - joint.upper + spare, planes - joint.lower - spare], 2 * np.pi))
            between = (ends + np.append(ends[1:], ends[0] + 2 * np.pi)) / 2
            yaws = np.array([into_span(yaw, span) for yaw in np.concatenate([ends, between])])
            turned = np.mod(planes - yaws[:, None, None] - joint.lower, 2 * np.pi)
            pivoted = off * np.sin(np.clip(np.minimum(turned, wide - turned), -np.pi / 2, np.pi / 2))
        return Turns(yaws, components, np.minimum(pivoted, rooms))

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(self.narrow)

    def _deepest(self, setpoints: tuple[int, ...], axis: Array, side: int) -> tuple[Index, Array]:
        """The deepest component around a position by facing and set-point, -1 for none, and its room."""
        ladder, spot = self.ladder, shapely.Point(axis)
        here = np.sort(self._tree.query(spot, predicate="dwithin", distance=EDGE_TOLERANCE))
        here = here[ladder.side[here] == side]
        room = shapely.distance(shapely.boundary(ladder.component[here]), spot)
        column = {i: n for n, i in enumerate(setpoints)}
        best, most = np.full((2, len(setpoints)), -1), np.full((2, len(setpoints)), -np.inf)
        for k, inside in zip(here.tolist(), room.tolist(), strict=True):
            at = int(ladder.family[k].facing == BACK), column.get(int(ladder.target[k]), -1)
            if at[1] >= 0 and inside > most[at]:
                best[at], most[at] = k, inside
        return best, most

    def _plane_zero(self, setpoints: tuple[int, ...], components: Index, axis: Array) -> float:
        """Sum of base yaw and pivot less the target's bearing, the same for all targets of one facing.

        Found at a set-point that has a component of that facing here; 0 where none has, and nothing asks.
        """
        known = np.flatnonzero(components >= 0)
        if not len(known):
            return 0.0
        facing = self.ladder.family[int(components[known[0]])].facing
        if facing not in self._zeros:
            target = self.scene.task[setpoints[int(known[0])]]
            away, pivot = target.position[:2] - axis, pivot_index(self.scene.robot.chain)
            solver = replace(solver_for(self.scene, Family(facing)), heading="free")
            base = pose_of(self.scene.robot, axis, 0.0)
            found = solver.hold(target.position, base, self.scene.robot.carry)
            plane = float(found.base[2] + found.joints[pivot])
            self._zeros[facing] = plane - float(np.arctan2(away[1], away[0]))
        return self._zeros[facing]


def gathered(planes: Array) -> Array:
    """Angles (n,) by whole turns into the one turn that begins in the middle of their widest gap."""
    ordered = np.sort(np.mod(planes, 2 * np.pi))
    gaps = np.diff(np.append(ordered, ordered[0] + 2 * np.pi))
    widest = int(np.argmax(gaps))
    across = ordered[widest] + gaps[widest] / 2 + np.pi
    return across + np.mod(planes - across + np.pi, 2 * np.pi) - np.pi
