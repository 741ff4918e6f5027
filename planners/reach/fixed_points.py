"""Outer reach of any arm for a tool direction or orientation, by other points of the tool that it fixes.

A frame asked of the tool says where each of its points is, and an axis where those on the axis are. Each must
be in reach of the arm whose tool ends there. A point on the last joint's axis moves with the link before, so
it bounds the reach as an arm with one joint less; where axes meet in a wrist, with three less.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from regionik.planners.reach.level_reach import outer_range
from regionik.planners.reach.meridian_plane import hub_along
from regionik.planners.solvers.damped_least_squares import DIRECTION, Aim
from regionik.worlds.arms import reach_bound
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, translation

LEVER = 0.3  # distance of two of the points from the wrist, as a share of the arm's length
GUARD = 1e-6  # against rounding, and of frames that are not quite rotations [m], [rad]
APART = 1e-6  # what is nearer to the tool's point than this tells nothing new [m]


class PointReach(NamedTuple):
    """Reach of one point of the tool."""

    center: Array  # (2,) where the point is, or the middle of where it may be, seen from above [m]
    rings: Array  # (k, 2) distances from it that the pivot axis may have [m]


def fixed_point_reach(chain: Chain, height: float, aim: Aim, *, coarse: bool) -> Iterator[PointReach]:
    """Bounds that points of the tool put to the places of the pivot axis: each holds all that meet an aim.

    The aim is a direction or an orientation in the world, its cone as wide as postures may use it; the arm's
    base frame is at a ``height`` over the floor [m]. For ``coarse`` see `outer_range`.
    """
    for e, moved in _fixed_points(chain, aim.kind):
        lever, cone = float(np.linalg.norm(e)), min(aim.cone + GUARD, np.pi)
        off = aim.turn @ e
        rise, up = float(aim.position[2]) - height, float(np.arcsin(np.clip(off[2] / lever, -1.0, 1.0)))
        low = rise + lever * np.sin(max(up - cone, -np.pi / 2)) - GUARD
        high = rise + lever * np.sin(min(up + cone, np.pi / 2)) + GUARD
        rings = np.array(outer_range(moved, float(low), float(high), coarse=coarse)).reshape(-1, 2)
        stray = lever * 2.0 * np.sin(cone / 2) + GUARD  # of the point, by the cone
        rings = np.column_stack([np.maximum(rings[:, 0] - stray, 0.0), rings[:, 1] + stray])
        yield PointReach(aim.position[:2] + off[:2], rings)


@lru_cache(maxsize=256)
def _fixed_points(chain: Chain, kind: int) -> tuple[tuple[Array, Chain], ...]:
    """Points (3,) in the tool frame that an aim fixes, and the chain whose tool ends there."""
    wrist, along = _wrist(chain)
    if kind == DIRECTION:  # fixes the tool's axis alone
        wrist, along = np.array([0.0, 0.0, wrist[2]]), np.array([0.0, 0.0, 1.0])
    lever = LEVER * reach_bound(chain).length
    points = [wrist, wrist - lever * along, wrist + lever * along]
    return tuple(
        (e, Chain(chain.joints, chain.T_last_tool @ translation(*e)))
        for e in points
        if np.linalg.norm(e) > APART
    )


def _wrist(chain: Chain) -> tuple[Array, Array]:
    """Point on the last axis nearest to the axis before, and that axis, in the tool frame."""
    T = np.linalg.inv(chain.T_last_tool)
    along: Array = T[:3, :3] @ chain.joints[-1].axis
    before = hub_along(*chain.joints[-2:]) if len(chain.joints) > 1 else 0.0
    return T[:3, 3] + before * along, along
