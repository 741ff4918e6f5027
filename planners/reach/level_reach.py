"""Reach of any arm on a vertical pivot at one height: distances proven to be in reach, and those that may be.

The pivot turns without end, as the base turns where it cannot, so reach is a matter of distance from the
pivot axis. Lifts before the pivot are joints like the others.

A tool direction or orientation bounds reach by other points of the tool that it fixes: a frame says where
each of them is, and an axis where those on the axis are. Each must be in reach of the arm whose tool ends
there. A point on the last joint's axis moves with the link before, so it bounds the reach as an arm with one
joint less; where axes meet in a wrist, with three less.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import floor
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.reach.meridian import (
    Meridian,
    hub_along,
    meridian_of,
    tool_for,
    walk_both_ways,
    walk_to_posture,
)
from regionik.planners.reach.options import REACH
from regionik.planners.reach.outer_bounds import outer_distances
from regionik.planners.solvers.damped_least_squares import DIRECTION, Aim
from regionik.worlds.arms import ReachBound, pivot_index, reach_bound
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, translation, within_half_turns
from regionik.worlds.joints import nearest_turn
from regionik.worlds.prepared import made_once

OPTIONS = REACH.level

Intervals = tuple[tuple[float, float], ...]

HEIGHT_TOLERANCE = 1e-9  # by which the tool of an arm that cannot rise may be off its height [m]
ROUNDING_MARGIN = 1e-6  # against rounding, and of frames that are not quite rotations [m], [rad]
MIN_POINT_DISTANCE = 1e-6  # what is nearer to the tool's point than this tells nothing new [m]


@dataclass(frozen=True, eq=False)
class PivotedArm:
    """An arm on a vertical pivot, prepared once for questions about its reach; made by `pivoted_arm`."""

    chain: Chain

    @cached_property
    def bound(self) -> ReachBound:
        return reach_bound(self.chain)

    @cached_property
    def meridian(self) -> Meridian | None:
        """All but the pivot, as kernels take it; None where nothing else moves the tool."""
        return meridian_of(self.chain)

    @cached_property
    def starts(self) -> Array:
        """Postures (n, m) of the meridian that walks start from, drawn evenly from the limits."""
        assert self.meridian is not None
        low, high = within_half_turns(self.meridian.lower, self.meridian.upper)
        return np.random.default_rng(0).uniform(low, high, (OPTIONS.batch * OPTIONS.max_batches, len(low)))

    @cached_property
    def is_level(self) -> bool:
        """True where the tool's height never changes, as all axes stand upright."""
        heights = self.chain.forward(_drawn(self.chain, np.random.default_rng(0), OPTIONS.samples))[:, 2, 3]
        return bool(np.ptp(heights) < HEIGHT_TOLERANCE)

    @cached_property
    def level_ends(self) -> tuple[Array, Array]:
        """Postures with the tool nearest to the base frame's axis and farthest from it."""
        rng = np.random.default_rng(0)
        ends = []
        for sign in (1.0, -1.0):
            best, spread = _drawn(self.chain, rng, 1)[0], np.pi
            for _ in range(OPTIONS.narrowings):
                near = best + spread * rng.normal(size=(OPTIONS.samples, self.chain.dof))
                tried = np.vstack([best, np.clip(near, self.chain.lower, self.chain.upper)])
                far = np.linalg.norm(self.chain.forward(tried)[:, :2, 3], axis=1)
                best, spread = tried[int(np.argmin(sign * far))], 0.8 * spread
            ends.append(best)
        return ends[0], ends[1]

    @cached_property
    def direction_points(self) -> tuple[tuple[Array, Chain], ...]:
        """Points (3,) in the tool frame that a direction of the tool fixes, and chains that end there."""
        wrist, _ = _wrist(self.chain)
        return self._points(np.array([0.0, 0.0, wrist[2]]), np.array([0.0, 0.0, 1.0]))

    @cached_property
    def frame_points(self) -> tuple[tuple[Array, Chain], ...]:
        """Those that an orientation of the tool fixes."""
        return self._points(*_wrist(self.chain))

    def _points(self, wrist: Array, along: Array) -> tuple[tuple[Array, Chain], ...]:
        lever = OPTIONS.lever_share * self.bound.length
        joints, T = self.chain.joints, self.chain.T_last_tool
        points = [wrist, wrist - lever * along, wrist + lever * along]
        return tuple(
            (e, Chain(joints, T @ translation(*e))) for e in points if np.linalg.norm(e) > MIN_POINT_DISTANCE
        )


@made_once
def pivoted_arm(chain: Chain) -> PivotedArm:
    """Prepare a chain; kept for the last few. An `InputError` says why its reach has no bound."""
    arm = PivotedArm(chain)
    assert arm.bound is not None  # refused here
    return arm


def inner_reach(chain: Chain, rise: float) -> Intervals:
    """Distances between pivot axis and target that are proven to be in reach, as ascending intervals [m].

    The target is at a height ``rise`` over the arm's base frame [m]. Every distance of an interval is that of
    some posture within the limits (`meridian`), but for rounding far below a nanometre. Distances that
    no walk from some 50 to 150 postures met are missing.

    Raises
    ------
    InputError
        When the arm has no vertical pivot, or a sliding joint has no end.

    Examples
    --------
    >>> from regionik.worlds.bundled import robot_named
    >>> [[round(end, 3) for end in ring] for ring in inner_reach(robot_named("hinge5").chain, 0.068)]
    [[0.0, 0.272]]
    """
    return _walked(chain, rise)[0]


@lru_cache(maxsize=4096)
def _walked(chain: Chain, rise: float) -> tuple[Intervals, Array]:
    """Rings proven to be in reach at a height, and what walks pass there, rows of `walk_both_ways` (n, 6)."""
    arm, passed = pivoted_arm(chain), np.empty((0, 6))
    if (meridian := arm.meridian) is None:
        return (), passed
    if arm.is_level:
        return _level_reach(arm, rise), passed
    tool, length = tool_for(meridian), 0.0
    for starts in np.split(arm.starts, OPTIONS.max_batches):
        more = np.empty((OPTIONS.batch, 6))
        count = walk_both_ways(meridian, rise, starts, tool, more)
        passed = np.concatenate([passed, more[:count]])
        before, length = length, sum(high - low for low, high in merged(passed[:, :2].tolist()))
        if len(passed) and length - before < OPTIONS.min_gain:
            break
    found = merged(passed[:, :2].tolist())
    return tuple(ring for ring in found if ring[1] - ring[0] > OPTIONS.min_gain), passed


def inner_sectors(chain: Chain, rise: float) -> tuple[tuple[float, float, float, float], ...]:
    """Distances proven to be in reach with the tool's azimuth, the pivot at zero, proven within bounds.

    Rows of low, high [m] and of bounds of the azimuth [rad]: of all walks a few, of wide rings and unlike
    azimuths. A pivot that turns from a to b reaches all azimuths from a + the upper bound to b + the lower
    one at every distance of a row.
    """
    walks = _walked(chain, rise)[1][:, 2:]
    walks = walks[walks[:, 1] - walks[:, 0] > OPTIONS.min_gain]
    worth = (walks[:, 1] ** 2 - walks[:, 0] ** 2) * (2 * np.pi - (walks[:, 3] - walks[:, 2]))
    walks = walks[np.argsort(-worth, kind="stable")]
    chosen: list[tuple[float, float, float, float]] = []
    while len(walks) and len(chosen) < OPTIONS.max_sectors:
        low, high, right, left = best = walks[0]
        chosen.append((float(low), float(high), float(right), float(left)))
        apart = walks[:, 2:].sum(axis=1) / 2 - best[2:].sum() / 2
        off = np.abs(nearest_turn(apart))
        wider = (walks[:, 0] < low - OPTIONS.min_gain) | (walks[:, 1] > high + OPTIONS.min_gain)
        walks = walks[wider | (off > OPTIONS.min_sector_change)]
    return tuple(chosen)


def outer_reach(chain: Chain, rise: float) -> Intervals:
    """Distances between pivot axis and target that are not proven to be out of reach; see `inner_reach`.

    No posture within the limits has any other distance. A budget of boxes (`outer_bounds`) bounds the
    work: with it spent, what is undecided stays in.
    """
    return outer_range(chain, rise, rise)


def likely_reach(chain: Chain, rise: float) -> Intervals:
    """Distances that are in reach just below a height and just above it: very likely there too, not proven.

    The heights looked at are the same for all targets, so that many targets ask for few of them.
    """
    if pivoted_arm(chain).is_level:
        return inner_reach(chain, rise)
    k = floor(rise / OPTIONS.layer)
    below, above = inner_reach(chain, k * OPTIONS.layer), inner_reach(chain, (k + 1) * OPTIONS.layer)
    both = [(max(a[0], b[0]), min(a[1], b[1])) for a in below for b in above]
    return merged([ring for ring in both if ring[0] < ring[1]])


def outer_layer(chain: Chain, rise: float) -> Intervals:
    """As `outer_reach`, for all heights of the layer that a height is in: larger, and the same for them."""
    return outer_range(chain, rise, rise, coarse=True)


def outer_range(chain: Chain, low: float, high: float, *, coarse: bool = False) -> Intervals:
    """As `outer_reach`, for all heights of a range; coarse: for all of the layers that it touches."""
    if coarse:
        first, last = floor(low / OPTIONS.layer), floor(high / OPTIONS.layer)
        return _outer_range(chain, first * OPTIONS.layer, (last + 1) * OPTIONS.layer, OPTIONS.max_layer_boxes)
    return _outer_range(chain, low, high, OPTIONS.max_boxes)


@lru_cache(maxsize=4096)
def _outer_range(chain: Chain, low: float, high: float, most: int) -> Intervals:
    arm = pivoted_arm(chain)
    meridian, span = arm.meridian, arm.bound
    off = max(0.0, abs((low + high) / 2 - span.height) - (high - low) / 2)
    if off > span.length + HEIGHT_TOLERANCE:
        return ()
    cap = span.radius + float(np.sqrt(max(0.0, span.length**2 - off**2)))
    if meridian is None:
        return ((0.0, cap),)
    known = np.array(merged([ring for z in {low, high} for ring in inner_reach(chain, z)])).reshape(-1, 2)
    limits = within_half_turns(meridian.lower, meridian.upper)
    left = outer_distances(meridian, (low, high), limits, known, cap, OPTIONS.max_gap, most)
    return merged([*known.tolist(), *left.tolist()])


def _level_reach(arm: PivotedArm, rise: float) -> Intervals:
    """Reach of an arm at the one height it has: its limits hang together, so all between two ends is met."""
    ends = arm.chain.forward(np.array(arm.level_ends))
    if abs(float(ends[0, 2, 3]) - rise) > HEIGHT_TOLERANCE:
        return ()
    near, far = np.linalg.norm(ends[:, :2, 3], axis=1).tolist()
    return ((near, far),)


def _level_posture(arm: PivotedArm, distance: float) -> Array:
    """A posture of a level arm at a distance between its ends, on the straight way from one to the other."""
    near, far = arm.level_ends
    low, high = 0.0, 1.0
    for _ in range(OPTIONS.halvings):
        share = 0.5 * (low + high)
        tool = arm.chain.forward(near + share * (far - near))
        low, high = (share, high) if np.hypot(*tool[:2, 3]) < distance else (low, share)
    found: Array = near + high * (far - near)
    return found


def _drawn(chain: Chain, rng: np.random.Generator, count: int) -> Array:
    """Random postures within limits, (count, dof)."""
    return rng.uniform(*within_half_turns(chain.lower, chain.upper), (count, chain.dof))


def posture_at(chain: Chain, point: ArrayLike, joints: ArrayLike) -> Array:
    """A posture with its tool at a point, or near it: slower than passes, but it gets to all inner reach.

    The point (3,) is in the arm's base frame [m], the pivot is taken as endless. Joints that do not matter
    keep their values in ``joints`` (dof,).
    """
    p, q = np.asarray(point, dtype=np.float64), np.array(joints, dtype=np.float64)
    arm, pivot, distance = pivoted_arm(chain), pivot_index(chain), float(np.hypot(p[0], p[1]))
    if arm.is_level:
        q = _level_posture(arm, distance)
    elif (meridian := arm.meridian) is not None:
        found = q[meridian.which]
        walk_to_posture(meridian, float(p[2]), distance, arm.starts, tool_for(meridian), found)
        q[meridian.which] = found
        _unwind(chain, q)
    here = chain.forward(q)[:2, 3]
    turn = np.arctan2(p[1], p[0]) - np.arctan2(here[1], here[0])
    q[pivot] += (turn + np.pi) % (2 * np.pi) - np.pi
    return q


def _unwind(chain: Chain, q: Array) -> None:
    """Take joints that were walked all round back by whole turns, into their limits."""
    for k, joint in enumerate(chain.active_joints):
        if joint.kind == "revolute" and q[k] < joint.lower:
            q[k] += 2 * np.pi * np.ceil((joint.lower - q[k]) / (2 * np.pi))
        elif joint.kind == "revolute" and q[k] > joint.upper:
            q[k] -= 2 * np.pi * np.ceil((q[k] - joint.upper) / (2 * np.pi))


def merged(intervals: list[list[float]] | list[tuple[float, float]]) -> Intervals:
    """The union of intervals, ascending and apart."""
    union: list[tuple[float, float]] = []
    for low, high in sorted((float(low), float(high)) for low, high in intervals):
        if union and low <= union[-1][1]:
            union[-1] = union[-1][0], max(high, union[-1][1])
        else:
            union.append((low, high))
    return tuple(union)


class PointReach(NamedTuple):
    """Reach of one point of the tool."""

    center: Array  # (2,) where the point is, or the middle of where it may be, seen from above [m]
    rings: Array  # (k, 2) distances from it that the pivot axis may have [m]


def fixed_point_reach(chain: Chain, height: float, aim: Aim, *, coarse: bool) -> Iterator[PointReach]:
    """Bounds that points of the tool put to the places of the pivot axis: each holds all that meet an aim.

    The aim is a direction or an orientation in the world, its cone as wide as postures may use it; the arm's
    base frame is at a ``height`` over the floor [m]. For ``coarse`` see `outer_range`.
    """
    arm = pivoted_arm(chain)
    for e, moved in arm.direction_points if aim.kind == DIRECTION else arm.frame_points:
        lever, cone = float(np.linalg.norm(e)), min(aim.cone + ROUNDING_MARGIN, np.pi)
        off = aim.turn @ e
        rise, up = float(aim.position[2]) - height, float(np.arcsin(np.clip(off[2] / lever, -1.0, 1.0)))
        low = rise + lever * np.sin(max(up - cone, -np.pi / 2)) - ROUNDING_MARGIN
        high = rise + lever * np.sin(min(up + cone, np.pi / 2)) + ROUNDING_MARGIN
        rings = np.array(outer_range(moved, float(low), float(high), coarse=coarse)).reshape(-1, 2)
        stray = lever * 2.0 * np.sin(cone / 2) + ROUNDING_MARGIN  # of the point, by the cone
        rings = np.column_stack([np.maximum(rings[:, 0] - stray, 0.0), rings[:, 1] + stray])
        yield PointReach(aim.position[:2] + off[:2], rings)


def _wrist(chain: Chain) -> tuple[Array, Array]:
    """Point on the last axis nearest to the axis before, and that axis, in the tool frame."""
    T = np.linalg.inv(chain.T_last_tool)
    along: Array = T[:3, :3] @ chain.joints[-1].axis
    before = hub_along(*chain.joints[-2:]) if len(chain.joints) > 1 else 0.0
    return T[:3, 3] + before * along, along
